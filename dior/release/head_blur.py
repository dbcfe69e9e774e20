"""Covering a head in a picture so that nobody can uncover it.

INPUTS   a picture, the box of whole pixels that holds the head (`heads` table)
OUTPUTS  the picture with the ellipse in that box covered, in place
Covering destroys: all that is left of a head are the mean colours of at most CELLS x CELLS cells of its box, in which
the head itself has about three by three. A Gaussian blur can be undone.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints

# Cells along a side of the box at most. Chosen: a face of three by three colours tells nobody, a picture with a hole
# where heads are is worth less for training.
CELLS = 4
# a cell is at least this wide and high, px, so that a head of five pixels becomes one colour
CELL_PX = 4
# sides of boxes that are remembered; chosen: those of some pictures
SIDES = 256
# what `filled` leaves, the middle of 0..255
GREY = 128


def ellipse(box: Sequence[float] | Floats, rows: Ints, columns: Ints) -> Bools:
    """Which of the pixels `rows` (R,), `columns` (C,) are in the ellipse that touches the edges of a box: (R, C) bool.

    `box`: first column and row, and those after the last, px.
    """
    u_min, v_min, u_max, v_max = box
    across = (2 * columns + 1 - u_min - u_max) / (u_max - u_min)
    down = (2 * rows + 1 - v_min - v_max) / (v_max - v_min)
    return down[:, None] ** 2 + across[None] ** 2 <= 1


def inside(box: Sequence[float] | Floats, height: int, width: int) -> tuple[slice, slice]:
    """Rows and columns of a picture that a box covers, as slices; empty outside the picture."""
    u_min, v_min, u_max, v_max = (int(edge) for edge in box)
    return (
        slice(min(max(v_min, 0), height), min(max(v_max, 0), height)),
        slice(min(max(u_min, 0), width), min(max(u_max, 0), width)),
    )


def cover(picture: NDArray[np.uint8], box: Sequence[float] | Floats, how: str, whole: bool = False) -> None:
    """Cover the head in `box` (4,) px of a BGR `picture` (height, width, 3) uint8, in place.

    `whole`: all of the box, not only the ellipse in it. `how`: `blurred` and `pixelated` leave the mean colours of a
    few cells, `filled` nothing.
    """
    rows, columns = inside(box, *picture.shape[:2])
    part = picture[rows, columns]
    if not part.size:
        return
    if whole:
        part[:] = instead(part, how)
        return
    at = [np.arange(piece.start, piece.stop) for piece in (rows, columns)]
    np.copyto(part, instead(part, how), where=ellipse(box, *at)[..., None])


def instead(part: NDArray[np.uint8], how: str) -> NDArray[np.uint8]:
    """What covers a `part` (h, w, 3) of a picture."""
    if how == "filled":
        return np.full_like(part, GREY)
    planes = from_cells(np.moveaxis(part, -1, 0).astype(np.float32), how)
    return np.moveaxis(np.rint(planes), 0, -1).clip(0, 255).astype(np.uint8)


def from_cells(planes: Floats, how: str) -> Floats:
    """Planes (..., h, w) float32 of what is left of such planes: the means of the cells, `blurred` or `pixelated`."""
    (down, rows), (across, columns) = (_sides(side, how) for side in planes.shape[-2:])
    return rows @ (down @ planes @ across.T) @ columns.T


@lru_cache(SIDES)
def _sides(side: int, how: str) -> tuple[Floats, Floats]:
    """(R, side) how much each of the pixels along a side counts in the R cells, and (side, R) the cells in each of the
    pixels; float32."""
    import cv2

    cells, eye = _cells(side), np.eye(side, dtype=np.float32)
    means = cv2.resize(eye, (side, cells), interpolation=cv2.INTER_AREA)
    smooth = cv2.INTER_NEAREST if how == "pixelated" else cv2.INTER_LINEAR
    shown = cv2.resize(np.eye(cells, dtype=np.float32), (cells, side), interpolation=smooth)
    return np.asarray(means), np.asarray(shown)


def weights(size: tuple[int, int], how: str) -> tuple[Floats, Floats]:
    """How much each row (h, R) and each column (w, C) of cells counts in those of a box of `size` (h, w) px.

    A pixel has the colours of the R x C cells, times the weights of both.
    """
    if how == "filled":
        return np.ones((size[0], 1)), np.ones((size[1], 1))
    rows, columns = (_sides(side, how)[1].astype(float) for side in size)
    return rows, columns


def _cells(side: int) -> int:
    """How many cells a box has along a side of so many px."""
    return int(np.clip(side // CELL_PX, 1, CELLS))
