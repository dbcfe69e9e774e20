"""Covering a head in a picture so that nobody can uncover it.

INPUTS   a picture, the box of whole pixels that holds the head (`heads` table)
OUTPUTS  the picture with the ellipse in that box covered, in place
Covering destroys: all that is left of a head are the mean colours of at most CELLS x CELLS cells of its box, in which
the head itself has about three by three. A Gaussian blur can be undone.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints

# Cells along a side of the box at most. Chosen: a face of three by three colours tells nobody, a picture with a hole
# where heads are is worth less for training.
CELLS = 4
# a cell is at least this wide and high, px, so that a head of five pixels becomes one colour
CELL_PX = 4
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
    import cv2

    rows, columns = inside(box, *picture.shape[:2])
    part = picture[rows, columns]
    if not part.size:
        return
    if how == "filled":
        instead: NDArray[Any] = np.full_like(part, GREY)
    else:
        size = (part.shape[0], part.shape[1])
        instead = _from_cells(cv2.resize(part, _cells(size), interpolation=cv2.INTER_AREA), size, how)
    if whole:
        part[:] = instead
        return
    at = [np.arange(piece.start, piece.stop) for piece in (rows, columns)]
    np.copyto(part, instead, where=ellipse(box, *at)[..., None])


def weights(size: tuple[int, int], how: str) -> tuple[Floats, Floats]:
    """How much each row (h, R) and each column (w, C) of cells counts in those of a box of `size` (h, w) px.

    A pixel has the colours of the R x C cells, times the weights of both.
    """
    if how == "filled":
        return np.ones((size[0], 1)), np.ones((size[1], 1))
    across, down = _cells(size)
    rows = _from_cells(np.eye(down), (size[0], down), how)
    columns = _from_cells(np.eye(across), (size[1], across), how)
    return rows, columns


def _cells(size: tuple[int, int]) -> tuple[int, int]:
    """How many cells a box of `size` (h, w) px has across and down."""
    high, wide = (int(np.clip(side // CELL_PX, 1, CELLS)) for side in size)
    return wide, high


def _from_cells(cells: NDArray[Any], size: tuple[int, int], how: str) -> NDArray[Any]:
    """A picture of `size` (h, w) px of the colours of its cells."""
    import cv2

    smooth = cv2.INTER_NEAREST if how == "pixelated" else cv2.INTER_LINEAR
    return cv2.resize(cells, size[::-1], interpolation=smooth)
