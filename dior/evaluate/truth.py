"""Errors against a known truth, which only a simulated capture has.

INPUTS   `LabelGrid` and the truth's `labels_2d`; two `skeletons_3d` tables.
OUTPUT   distances (frames or instants, joints), px or m; NaN where either is missing.
"""

import numpy as np

from dior.arrays import Floats, Ints
from dior.errors import DiorError
from dior.evaluate.grids import LabelGrid, distance, onto
from dior.geometry.multiview import similarity


def errors_2d(grid: LabelGrid, true: LabelGrid) -> Floats:
    """Distances (F, J) px of in-frame labels from the true keypoints of the `LabelGrid` `true`."""
    return distance(grid.uv, onto(grid.frames, grid.joints, true.uv, true.frames, true.joints))


def errors_3d(points: Floats, true: Floats) -> tuple[Floats, Floats]:
    """Distances (I, J) m of `points` from `true`, both (I, J, 3), as they are and after rigid alignment.

    The alignment has no scale: a wrong size of the person stays an error. It is the least-squares fit over all
    common points of the sequence at once; NaN throughout with fewer than three.
    """
    plain = distance(points, true)
    common = np.isfinite(plain)
    if common.sum() < 3:
        return plain, np.full(plain.shape, np.nan)
    _, R, t = similarity(points[common], true[common], scale=False)
    return plain, distance(points @ R.T + t, true)


def check_instants(stamp_ns: Ints, true_stamp_ns: Ints, tolerance_ns: int, where: str) -> None:
    """Refuse instants that mean another time than the truth's, stamps (I,) of the same instants.

    A clock offset that the pipeline has to find moves the stamps a little; another instant zero or another rate
    moves them by more than `tolerance_ns`.
    """
    if len(stamp_ns) and np.abs(stamp_ns - true_stamp_ns).max() > tolerance_ns:
        worst = np.abs(stamp_ns - true_stamp_ns).max() / 1e9
        raise DiorError(f"{where}: the instants are up to {worst:.3f} s from the truth's; they cannot be compared")
