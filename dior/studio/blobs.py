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
# of a blob's own brightness, where its outline is. Chosen: half, and more where what is added to it by that has many
# times as many pixels, as a bright arm around it has
LEVELS, GROWN = (0.5, 0.7, 0.85), 2.5


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
    outlines = [_outline(hat, row, column, level) for level in LEVELS]
    pairs = zip(outlines, outlines[1:], strict=False)
    own = next((outer for outer, inner in pairs if outer.sum() <= GROWN * inner.sum() and _narrow(outer)), outlines[-1])
    if not _narrow(own):
        return None
    rows, columns = np.nonzero(own)
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


def _outline(hat: Floats, row: int, column: int, level: float) -> Bools:
    """The pixels around a peak that are as bright as `level` of it."""
    import cv2

    labels: NDArray[Any] = cv2.connectedComponents((hat >= level * hat[row, column]).astype(np.uint8), connectivity=4)[
        1
    ]
    return np.asarray(labels == labels[row, column])


def _narrow(own: Bools) -> bool:
    """Whether what is outlined is no wider than a marker."""
    return all(np.ptp(places) < WIDEST_PX for places in np.nonzero(own))
