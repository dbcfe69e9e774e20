"""Share of the labels inside hand-drawn boxes, the paper's measure of the long-range labels.

INPUTS   frames and edges as `dior.project.boxes` reads them, px; inside is `u_min <= u <= u_max`
OUTPUT   0 or 1 per (frame, joint), NaN for frames without a box and labels outside the picture.
"""

import numpy as np

from dior.arrays import Floats, Ints
from dior.evaluate.grids import LabelGrid
from dior.project.boxes import COLUMNS, kept_back, read

__all__ = ["COLUMNS", "kept_back", "of_frames", "read", "within"]


def of_frames(grid: LabelGrid, box_frames: Ints, boxes: Floats) -> Floats:
    """Edges (F, 4) px of the box of every frame of the labels, NaN where there is none."""
    edges = np.full((len(grid.frames), 4), np.nan)
    _, row, box = np.intersect1d(grid.frames, box_frames, return_indices=True)
    edges[row] = boxes[box]
    return edges


def within(grid: LabelGrid, hand: Floats) -> Floats:
    """1 or 0 (F, J) whether an in-frame label lies in its frame's box `hand` (F, 4) px, NaN where there is nothing to
    judge.
    """
    u, v = grid.uv[..., 0], grid.uv[..., 1]
    u_min, v_min, u_max, v_max = hand.T[:, :, None]
    with np.errstate(invalid="ignore"):
        hit = (u >= u_min) & (u <= u_max) & (v >= v_min) & (v <= v_max)
    judged = np.isfinite(u_min) & grid.in_frame
    return np.where(judged, hit.astype(float), np.nan)
