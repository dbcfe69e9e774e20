"""What all figures of the report have in common: their style, what a page shows of one, and how it becomes an SVG file.

Same numbers, same bytes. Figures are narrow, with type that can still be read when a phone scales them down.
"""

import io
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from dior.report.colours import AT_NIGHT, DARK, GREY, GRID, WHITE
from dior.tables.files import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# what a template shows of a figure: src, title, caption, alt
Shown: TypeAlias = dict[str, str]

# inches; chosen: type of 10 points can still be read where a phone shows it 9 cm wide
WIDTH = 5.2
# Matplotlib knows its parameters by a Literal of all their names
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "dior",
    "svg.fonttype": "path",
    # text is measured for the layout as it is drawn
    "text.hinting": "none",
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    # said, not left at black, so that a dark page can exchange it
    **{key: DARK for key in ("text.color", "axes.labelcolor", "xtick.labelcolor", "ytick.labelcolor")},
    **{key: GREY for key in ("xtick.color", "ytick.color")},
    "savefig.transparent": True,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 9,
}


@cache
def _styled() -> "type[Figure]":
    """Matplotlib's figures, in the report's style; pyplot takes as long to import again."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcdefaults()
    matplotlib.rcParams.update(STYLE)
    return Figure


def new_figure(
    rows: int = 1, columns: int = 1, height: float = 3.1, layout: Any = "constrained", **options: Any
) -> "tuple[Figure, Any]":
    """A figure and its axes, one or an array of them, WIDTH wide in the report's style; `height` in inches."""
    figure = _styled()(figsize=(WIDTH, height), layout=layout)
    return figure, figure.subplots(rows, columns, **options)


def save_svg(figure: "Figure", path: Path) -> None:
    """Write a figure as SVG, without date or version, readable on a light and a dark page."""
    if layout := figure.get_layout_engine():
        layout.execute(figure)
        # else Matplotlib draws the whole figure twice
        figure.set_layout_engine(None)
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    write_text(path, drawn.getvalue().replace("</defs>", f"{_night()}</defs>", 1))


@cache
def _night() -> str:
    """A style sheet that exchanges the colours of ink and paper where the reader prefers a dark page.

    Matplotlib writes each colour where it is used, so that only the text of a style tells what it is.
    """
    rules = "".join(
        f'[style*="{what}: {day.lower()}"]{{{what}:{night}!important}}'
        for day, night in AT_NIGHT.items()
        for what in ("fill", "stroke")
    )
    return f"<style>@media (prefers-color-scheme: dark){{svg{{background:{AT_NIGHT[WHITE]}}}{rules}}}</style>"


def drawn(
    folder: Path,
    link: str,
    name: str,
    draw: Callable[..., None],
    *args: Any,
    title: str,
    caption: str,
    alt: str,
    **options: Any,
) -> Shown:
    """What a page shows of the figure that `draw` makes as `<folder>/<name>.svg`; `link`: to the folder."""
    draw(folder / f"{name}.svg", *args, **options)
    return {"src": f"{link}/{name}.svg", "title": title, "caption": caption, "alt": alt}


def legend(figure: "Figure", colours: Mapping[str, str]) -> None:
    """Names with their colours above the axes of a figure."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], marker="o", ls="", color=c, label=name) for name, c in colours.items()]
    figure.legend(handles=handles, loc="outside upper left", ncols=min(len(handles), 4), handletextpad=0.2,
                  columnspacing=1.2)  # fmt: skip


def short(n: float) -> str:
    """A count in few characters, as plots show it."""
    return f"{n / 1e6:.3g}M" if n >= 1e6 else f"{n / 1e3:.3g}k" if n >= 1e4 else str(int(n))
