"""Where the bright round blob is that a person clicked beside: a reflective marker in the whole picture.

INPUTS   a grey picture as decoded (height, width), a click in recorded pixels
OUTPUTS  the blob's middle in recorded pixels, to a fraction of one
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats

REACH_PX = 5.0  # as far as a click may be beside the blob
# chosen: wider is no marker of 14 or 16 mm but a lamp or a sleeve; a marker at 2 m and 1280 px is 5 px wide
WIDEST_PX = 11
# chosen: grey levels, of 255, above what surrounds it; the noise of a JPEG is a third of it
LEAST_CONTRAST = 20.0
# chosen: the shorter axis of a blob over its longer one; a disc of 3 px has 0.8 or more, a bright line less than 0.3
LEAST_ROUND = 0.45
# chosen: of the brightest within reach; what is fainter is an edge's ringing in the JPEG beside a marker
LEAST_SHARE = 0.5
# of a blob's own brightness: where the outline at half of it is not round, a bright arm around it may be in it
LEVELS = (0.5, 0.7)


def snapped(grey: NDArray[np.uint8], u: float, v: float) -> Floats | None:
    """The middle (2,) px of the blob nearest to a click, None where there is none within 5 px.

    What is brighter than the widest bright thing that it lies on counts (a white top-hat), weighted by how much
    brighter, so that a marker before an edge is not drawn to either side.
    """
    import cv2

    margin = int(REACH_PX) + WIDEST_PX + 2
    left, top = max(round(u) - margin, 0), max(round(v) - margin, 0)
    part = grey[top : round(v) + margin + 1, left : round(u) + margin + 1]
    if min(part.shape) < 3:
        return None
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (WIDEST_PX, WIDEST_PX))
    hat = cv2.morphologyEx(part, cv2.MORPH_TOPHAT, disc).astype(float)
    smooth = cv2.GaussianBlur(hat, (0, 0), 0.8)
    peak = (smooth == cv2.dilate(smooth, np.ones((3, 3)))) & (hat >= LEAST_CONTRAST)
    click = np.array([u - left, v - top])
    rows, columns = np.nonzero(peak)
    within = np.hypot(columns - click[0], rows - click[1]) <= REACH_PX + 1
    rows, columns = rows[within], columns[within]
    bright = hat[rows, columns] >= LEAST_SHARE * hat[rows, columns].max(initial=0.0)
    middles = [_middle(hat, peak, row, column) for row, column in zip(rows[bright], columns[bright], strict=True)]
    near = [one for one in middles if one is not None and np.linalg.norm(one - click) <= REACH_PX]
    if not near:
        return None
    best: Floats = min(near, key=lambda one: float(np.linalg.norm(one - click)))
    return best + (left, top)


def _middle(hat: Floats, peaks: Bools, row: int, column: int) -> Floats | None:
    """The middle (2,) of the blob around a peak of `hat`; None where it is not round or too wide."""
    found = (_outlined(hat, peaks, row, column, level) for level in LEVELS)
    return next((middle for middle in found if middle is not None), None)


def _outlined(hat: Floats, peaks: Bools, row: int, column: int, level: float) -> Floats | None:
    """`_middle` of what is as bright as `level` of the peak."""
    import cv2

    high = (hat >= level * hat[row, column]).astype(np.uint8)
    labels: NDArray[Any] = cv2.connectedComponents(high, connectivity=4)[1]
    own = labels == labels[row, column]
    rows, columns = np.nonzero(own)
    if rows.max() - rows.min() >= WIDEST_PX or columns.max() - columns.min() >= WIDEST_PX:
        return None
    at = np.stack([columns, rows], axis=1).astype(float)
    # of two blobs that touch, each has what is nearer to it
    others = np.argwhere(peaks & own)[:, ::-1]
    nearest = np.linalg.norm(at[:, None] - others, axis=2).argmin(axis=1)
    mine = nearest == int(np.flatnonzero((others == (column, row)).all(axis=1))[0])
    at, weight = at[mine], hat[rows, columns][mine]
    middle = weight @ at / weight.sum()
    off = at - middle
    # a pixel is as wide as one, so that one alone is round
    spread = (weight[:, None] * off).T @ off / weight.sum() + np.eye(2) / 12
    shorter, longer = np.sqrt(np.linalg.eigvalsh(spread))
    return middle if shorter >= LEAST_ROUND * longer else None
