"""Reprojection error: the distance of a close camera's labels from that camera's own detections.

INPUTS   `LabelGrid` of a camera, rows of `detections` of that camera.
OUTPUT   distances (frames, joints) px, NaN where either is missing or the detector was not sure enough.
"""

import numpy as np

from dior.evaluate.grids import distance, onto, value_grid
from dior.skeletons import swap_index


def errors(grid, detections, min_score, swapped_frames=()):
    """Distances (F, J) px of the labels from the detections of the same frame and joint.

    The paper's equation (section 4.2, close range cameras) is the mean of these. Detections below `min_score` are
    left out: the detector itself says that it guessed them. In `swapped_frames`, where triangulate found left and
    right exchanged, they are exchanged back: swaps are counted on their own, and would drown every other error.
    """
    if not len(detections["frame"]):
        return np.full(grid.in_frame.shape, np.nan)
    values, frames, joints = value_grid(detections, "frame", "u", "v", "score")
    swapped = np.isin(frames, swapped_frames)
    values[swapped] = values[swapped][:, swap_index(joints)]
    found = onto(grid.frames, grid.joints, values, frames, joints)
    with np.errstate(invalid="ignore"):
        sure = found[..., 2] >= min_score
    return np.where(sure, distance(grid.uv, found[..., :2]), np.nan)


def comparable(grid, detections):
    """Whether labels and detections are of the same joints; mocap markers and a detector's keypoints are not."""
    return bool(set(grid.joints) & set(np.unique(detections["joint"].astype(str))))
