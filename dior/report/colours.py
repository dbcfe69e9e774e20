"""The colours of the report's figures and contact sheets; those of the pages are in templates/style.css."""

from collections.abc import Iterable

# one per camera, subject or method, in their order: the palette of Okabe and Ito (Color Universal Design, 2008), which
# the colour-blind can tell apart, without its yellow and black, and a grey and a violet beyond them
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#7F7F7F", "#8A6FB0")
ORANGE = COLOURS[5]
RED, GREY, DARK = "#C0392B", "#8a8f98", "#20242b"
GRID, EDGE, WHITE = "#e3e6ea", "#c9ced6", "#ffffff"
# what stands for ink and paper on a dark page, whose paper is WHITE's (`--card` of style.css)
AT_NIGHT = {
    DARK: "#e4e7ec", WHITE: "#1c2128", GRID: "#333b46", EDGE: "#4b5563", GREY: "#9aa2ad", RED: "#ff8a80",
    COLOURS[0]: "#4aa3e0",
}  # fmt: skip
# BGR, as OpenCV draws; style.css has the same for the key of the sheets. The body's left, its right, neither side
LEFT, RIGHT, MIDDLE = (255, 170, 60), (40, 160, 255), (235, 235, 235)
OUTLIER, DETECTION, BOX = (40, 40, 230), (80, 230, 80), (200, 90, 230)


def colours_of(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name, in their order; from the first again where there are more names than colours."""
    return {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
