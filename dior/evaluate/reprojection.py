"""Reprojection error: the distance of a close camera's labels from that camera's own detections.

INPUTS   `LabelGrid` of a camera, rows of `detections` of that camera.
OUTPUT   distances (frames, joints) px, NaN where either is missing or the detector was not sure enough.
"""

from collections.abc import Sequence

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table
from dior.body.names import is_leg, swap_index
from dior.evaluate.grids import LabelGrid, distance, onto, value_grid


def errors(grid: LabelGrid, detections: Table, min_score: float, exchanged: Table | None = None) -> Floats:
    """Distances (F, J) px of the labels from the detections of the same frame and joint.

    The paper's equation (section 4.2, close range cameras) is the mean of these. Detections below `min_score` are
    left out: the detector itself says that it guessed them. In the rows `exchanged` of `swaps`, where triangulate
    found left and right exchanged, they are exchanged back: swaps are counted on their own, and would drown every other
    error.
    """
    if not len(detections["frame"]):
        return np.full(grid.in_frame.shape, np.nan)
    values, frames, joints = value_grid(detections, "frame", "u", "v", "score")
    if exchanged is not None:
        values = np.where(_turned(exchanged, frames, joints)[..., None], values[:, swap_index(joints)], values)
    found = onto(grid.frames, grid.joints, values, frames, joints)
    with np.errstate(invalid="ignore"):
        sure = found[..., 2] >= min_score
    return np.where(sure, distance(grid.uv, found[..., :2]), np.nan)


def _turned(exchanged: Table, frames: Ints, joints: Sequence[str]) -> Bools:
    """Whether (F, J) a joint was exchanged in a frame. Without a part it was the whole body."""
    legs = np.array([is_leg(name) for name in joints])
    part = exchanged.get("part", np.full(len(exchanged["frame"]), ""))
    found = exchanged["swapped"].astype(bool)
    of_legs, of_rest = (np.isin(frames, exchanged["frame"][found & (part != other)]) for other in ("rest", "legs"))
    return np.where(legs, of_legs[:, None], of_rest[:, None])


def comparable(grid: LabelGrid, detections: Table) -> bool:
    """Whether labels and detections are of the same joints; mocap markers and a detector's keypoints are not."""
    return bool(set(grid.joints) & set(np.unique(detections["joint"].astype(str))))
