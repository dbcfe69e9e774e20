"""What a release tells is covered must be covered in its pictures.

INPUTS   a `Walk` (evidence.py): pictures and `covers`. OUTPUTS: problems as (path, sentence)
All that a cover leaves are the mean colours of a few cells (head_blur.py). So cells are fitted to what the picture
shows there. What they leave over must be no more than encoding the fitted cover in its place does. A head that differs
from its surroundings by no more than that is not told from a cover: nothing is said of it. Without `decode` some
pictures of a recording are looked at (sample.py).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints, Table
from dior.release import head_blur, jpeg, jpeg_covers
from dior.release.heads import EDGES
from dior.release.verify import walk_checks
from dior.release.verify.evidence import Walk
from dior.release.verify.walk_checks import PARTS, Problem, pictures_in
from dior.tables import tables

# Of what the cells leave over (grey levels, root mean square): so many times what encoding leaves, and more. Chosen:
# sound releases take up a third of MORE (`python -m benchmarks.covers`), and bare ones far more than all.
TIMES, MORE = 2.0, 2.0
# pixels a cell, below which the fit explains anything, and above which more say no more; chosen
LEAST_PIXELS, MOST_PIXELS = 4, 200
# of a JPEG, which are coded together
BLOCK = 16
# of BGR, ITU-R BT.601
GREYS = np.array([0.114, 0.587, 0.299])


@dataclass(frozen=True, eq=False)
class Cover:
    """The `part` (h, w, 3) of a picture around a cover, in whole blocks; the pixels `y`, `x` (n,) of its box, whose
    first one is at `corner` in the part, that nothing else covers; weights of the `rows` and `columns` of cells in the
    box (head_blur.weights)."""

    part: NDArray[np.uint8]
    corner: tuple[int, int]
    y: Ints
    x: Ints
    rows: Floats
    columns: Floats

    @property
    def cells(self) -> tuple[int, int]:
        return self.rows.shape[1], self.columns.shape[1]

    @property
    def at(self) -> tuple[Ints, Ints]:
        """Where the pixels are in the part."""
        return self.y + self.corner[0], self.x + self.corner[1]

    def fitted(self, part: NDArray[np.uint8] | Floats) -> tuple[float, Floats]:
        """What cells do not explain of such a part, root mean square of grey levels, and their colours (R, C, 3)."""
        count = self.cells[0] * self.cells[1]
        some = slice(None, None, max(1, len(self.y) // (MOST_PIXELS * count)))
        weights = (self.rows[self.y[some], :, None] * self.columns[self.x[some], None]).reshape(-1, count)
        y, x = self.at
        colours = part[y[some], x[some]].astype(float)
        means = np.linalg.pinv(weights.T @ weights) @ (weights.T @ colours)
        grey = (colours - weights @ means) @ GREYS
        return float(np.sqrt(np.mean(grey**2))), means.reshape(*self.cells, 3)

    def drawn(self, means: Floats) -> NDArray[np.uint8]:
        """The part with cells of these colours in the place of the pixels."""
        filled = np.moveaxis(self.rows @ np.moveaxis(means, -1, 0) @ self.columns.T, 0, -1)
        out = self.part.copy()
        out[self.at] = filled[self.y, self.x].round().clip(0, 255)
        return out


def check(walk: Walk) -> list[Problem]:
    """Pictures that show more where they are to be covered than a cover leaves."""
    faces = str(walk.rig.settings.get("release.faces", ""))
    how = "blurred" if faces == "shown" else faces
    problems: list[Problem] = []
    for name in sorted(walk.of("covers")) if how in ("blurred", "pixelated", "filled") else ():
        path = walk.path("frames", name)
        frames, file = walk.of("frames").get(name), walk.files.get(path)
        if frames is None or file is None:
            continue
        covers, _ = walk_checks.read(walk.files[walk.path("covers", name)], PARTS["covers"], ("frame", "what", *EDGES))
        bare = np.zeros(len(frames["frame"]), bool)
        for row, data in pictures_in(file) if walk.decode else walk.pictures.get(name, ()):
            mine = tables.rows(covers, covers["frame"] == frames["frame"][row])
            bare[row] = len(mine["frame"]) > 0 and shows(data, mine, how)
        what = "pictures that show more than a cover leaves, where `covers` says that they are covered"
        problems += [(path, text) for text in walk_checks.first(bare, what, frames)]
    return problems


def shows(data: bytes, covers: Table, how: str) -> bool:
    """Whether a picture (JPEG bytes) shows more in one of its `covers` (their rows of the table) than `how` leaves."""
    import cv2

    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if picture is None:
        return False
    table = luma_table(data)
    for cover in _covers(np.asarray(picture, np.uint8), covers, how):
        if len(cover.y) >= LEAST_PIXELS * cover.cells[0] * cover.cells[1]:
            left, means = cover.fitted(cover.part)
            if left > TIMES * cover.fitted(coded(cover.drawn(means), table))[0] + MORE:
                return True
    return False


def luma_table(data: bytes) -> tuple[int, ...]:
    """The quantisation table of a JPEG file's luma; of one that `jpeg.frame_of` does not take, one that loses
    nothing."""
    frame = jpeg.frame_of(data)
    return frame.components[0].table if frame else (1,) * 64


def coded(part: NDArray[np.uint8], table: tuple[int, ...]) -> Floats:
    """A part (h, w, 3) of a BGR picture, from the corner of a block on, as encoding its luma by a quantisation table
    and rounding its colours leave it."""
    luma = part @ GREYS
    return np.rint(part + (jpeg_covers.coded(luma, table) - luma)[..., None]).clip(0, 255)


def _covers(picture: NDArray[np.uint8], covers: Table, how: str) -> Iterator[Cover]:
    """The covers of a picture, the heads last, as `pixels` does it."""
    high, wide = picture.shape[:2]
    edges = np.stack([covers[key] for key in EDGES], axis=1)
    order = np.argsort(covers["what"] == "head", kind="stable").tolist()
    last = np.full((high, wide), -1, np.int32)
    for i in order:
        rows, columns = head_blur.inside(edges[i], high, wide)
        last[rows, columns][_shape(covers, edges, i, rows, columns)] = i
    for i in order:
        box = head_blur.inside(edges[i], high, wide)
        y, x = np.nonzero(last[box] == i)
        if len(y):
            weights = head_blur.weights((box[0].stop - box[0].start, box[1].stop - box[1].start), how)
            around = tuple(slice(side.start // BLOCK * BLOCK, -(-side.stop // BLOCK) * BLOCK) for side in box)
            yield Cover(picture[around], (box[0].start % BLOCK, box[1].start % BLOCK), y, x, *weights)


def _shape(covers: Table, edges: Floats, i: int, rows: slice, columns: slice) -> Bools:
    """Which pixels of its box a cover fills."""
    if covers["what"][i] != "head":
        return np.ones((rows.stop - rows.start, columns.stop - columns.start), bool)
    return head_blur.ellipse(edges[i], np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop))
