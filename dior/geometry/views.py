"""Points from several views of which some are wrong: the views that disagree are left out.

Vocabulary of adjust and triangulate. World in metres, recorded pixels.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.geometry import camera as cam
from dior.geometry import multiview

DROP_FACTOR = 4.0  # a view disagrees where the mean error is this many times the usual one


def by_dropping(
    cameras: Sequence[cam.Camera], uv: Floats, weights: Floats, drop_px: float, max_error_px: float
) -> tuple[Floats, Floats, Bools, Bools]:
    """Weighted linear triangulation that leaves out the views that disagree.

    `uv` (V, ..., 2) px, `weights` (V, ...), 0 for a view without a say. While the mean reprojection error of the
    views used is above `drop_px` (at fx 1680, scaled by each camera's fx), or they meet nowhere, the best subset with
    one view fewer is tried, down to two. Returns points (..., 3), mean error px (...,), the views used (V, ...) bool
    and whether the error is at most `max_error_px` (...,).
    """
    shape = uv.shape[1:-1]
    uv = uv.reshape(len(cameras), -1, 2)
    weights = np.where(np.isfinite(uv).all(axis=-1), weights.reshape(len(cameras), -1), 0.0)
    xy = np.stack([cam.undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    cTw = [cam.inverse_pose(c.wTc) for c in cameras]
    scale = cam.REFERENCE_FX / np.array([c.intrinsics.fx for c in cameras])
    seen = weights > 0

    def attempt(columns: Ints, keep: Bools) -> tuple[Floats, Floats, Floats]:
        """Triangulate some columns with the views `keep` (V, n): points, error at fx 1680, error px."""
        points = multiview.triangulate(cTw, xy[:, columns], np.where(keep, weights[:, columns], 0.0))
        errors = np.where(keep, cam.reprojection_errors(cameras, points, uv[:, columns]), 0.0)
        count = np.maximum(keep.sum(axis=0), 1)
        return points, (errors * scale[:, None]).sum(axis=0) / count, errors.sum(axis=0) / count

    points, scaled, pixels = attempt(np.arange(uv.shape[1]), seen)
    used = seen.copy()
    for views_left in range(len(cameras) - 1, 1, -1):
        # NaN, where the point of all views lies behind one of them, is no agreement
        bad = np.flatnonzero(~(scaled <= drop_px) & (seen.sum(axis=0) > views_left))
        if not len(bad):
            continue
        best = np.full(len(bad), np.inf)
        for kept in itertools.combinations(range(len(cameras)), views_left):
            keep = np.zeros((len(cameras), len(bad)), bool)
            keep[list(kept)] = True
            keep &= seen[:, bad]
            p, s, e = attempt(bad, keep)
            better = (keep.sum(axis=0) == views_left) & (s < best)
            best = np.where(better, s, best)
            at = bad[better]
            points[at], scaled[at], pixels[at], used[:, at] = p[better], s[better], e[better], keep[:, better]
    good = scaled <= max_error_px  # false for NaN
    return points.reshape(*shape, 3), pixels.reshape(shape), used.reshape(len(cameras), *shape), good.reshape(shape)


def usual_error(cameras: Sequence[cam.Camera], uv: Floats, weights: Floats) -> float:
    """Median over all points of the mean reprojection error with every view, px at fx 1680; inf without a point."""
    scale = np.mean([cam.REFERENCE_FX / c.intrinsics.fx for c in cameras])
    _, error, used, _ = by_dropping(cameras, uv, weights, np.inf, np.inf)
    known = (used.sum(axis=0) >= 2) & np.isfinite(error)
    return float(np.median(error[known]) * scale) if known.any() else np.inf
