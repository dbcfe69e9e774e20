"""Points from several views of which some are wrong: the views that disagree are left out.

Vocabulary of calibrate, reconstruct and evaluate. World in metres, recorded pixels.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.geometry import camera as cam
from dior.geometry.triangulation import Views, mean_errors, meet, rig_of, views_of, with_every_view

# chosen: a view disagrees where the mean error is this many times the usual one; less takes good detections with it
DROP_FACTOR = 4.0
BEST_DETECTOR_PX = 1.0  # chosen, at fx 1680: no pose network is better, so that less is no disagreement


def best_subsets(
    views: Views,
    points: Floats,
    agree: Bools,
    judge: Callable[[Ints, Floats, Floats, Bools], tuple[Floats, Bools]],
) -> tuple[Floats, Bools]:
    """Points (3, N) and the views used (V, N): views are left out one more at a time as long as those left disagree.

    `points` (3, N) from the rig's origin are those of all views, `agree` (N,) tells for which nothing is to be done.
    `judge` gets which points they are (n,), their places (3, n) and chi squared (n,) with the views (V, n); it returns
    the cost (n,) by which subsets of one size are compared, and whether the views of a subset agree (n,). A cost of NaN
    or infinity is no solution.
    """
    points, agree, used = points.copy(), agree.copy(), views.w > 0
    seen = used.sum(axis=0)
    for views_left in range(len(used) - 1, 1, -1):
        at = np.flatnonzero(~agree & (seen > views_left))
        if not len(at):
            continue
        some = views.at(at)
        best = np.full(len(at), np.inf)
        for kept in combinations(range(len(used)), views_left):
            keep = np.zeros(some.w.shape, bool)
            keep[list(kept)] = True
            keep &= some.w > 0
            p, chi2 = meet(replace(some, w=np.where(keep, some.w, 0.0)))
            cost, agreeing = judge(at, p, chi2, keep)
            better = (keep.sum(axis=0) == views_left) & (cost < best)
            best = np.where(better, cost, best)
            to = at[better]
            points[:, to], used[:, to], agree[to] = p[:, better], keep[:, better], agreeing[better]
    return points, used


def by_dropping(
    cameras: Sequence[cam.Camera], uv: Floats, weights: Floats, drop_px: float, max_error_px: float
) -> tuple[Floats, Floats, Bools, Bools]:
    """Weighted linear triangulation that leaves out the views that disagree.

    `uv` (V, ..., 2) px, `weights` (V, ...) 1/px, 0 for a view without a say. While the mean reprojection error of the
    views used is above `drop_px` (at fx 1680, scaled by each camera's fx), or they meet nowhere, the best subset with
    one view fewer is tried, down to two. Returns points (..., 3), mean error px (...,), the views used (V, ...) bool
    and whether the error is at most `max_error_px` (...,).
    """
    shape = uv.shape[1:-1]
    rig, uv, weights = rig_of(cameras), uv.reshape(len(cameras), -1, 2), weights.reshape(len(cameras), -1)
    points, _, used, pixels, scaled = with_every_view(rig, uv[:, :, None], weights[:, :, None])
    # NaN, where the point of all views lies behind one of them, is no agreement
    bad = np.flatnonzero(~(scaled <= drop_px) & (used.sum(axis=0) > 2))
    if len(bad):
        doubtful = uv[:, bad]

        def judge(at: Ints, p: Floats, chi2: Floats, keep: Bools) -> tuple[Floats, Bools]:
            _, error = mean_errors(rig, p, doubtful[:, at], keep)
            return error, error <= drop_px

        views = views_of(rig, doubtful, weights[:, bad])
        points[:, bad], used[:, bad] = best_subsets(views, points[:, bad], np.zeros(len(bad), bool), judge)
        pixels[bad], scaled[bad] = mean_errors(rig, points[:, bad], doubtful, used[:, bad])
    good = scaled <= max_error_px  # false for NaN
    xyz = (points.T + rig.origin).reshape(*shape, 3)
    return xyz, pixels.reshape(shape), used.reshape(len(cameras), *shape), good.reshape(shape)


def usual_error(cameras: Sequence[cam.Camera], uv: Floats, weights: Floats) -> float:
    """Median over all points of the mean reprojection error with every view, px at fx 1680; inf without a point."""
    uv, weights = uv.reshape(len(cameras), -1, 2), weights.reshape(len(cameras), -1)
    _, _, used, _, error = with_every_view(rig_of(cameras), uv[:, :, None], weights[:, :, None])
    known = (used.sum(axis=0) >= 2) & np.isfinite(error)
    return float(np.median(error[known])) if known.any() else np.inf


def agreeing(cameras: Sequence[cam.Camera], uv: Floats, least_px: float = BEST_DETECTOR_PX) -> Bools:
    """Mask (V, ...) of the pixels uv (V, ..., 2) that agree with the other views of their point.

    A view disagrees beyond `DROP_FACTOR` times the usual error, or `least_px` at fx 1680 if that is more. Where only
    two views are left and disagree, or nothing tells which one is wrong, all of the point are left out.
    """
    weights = np.isfinite(uv).all(axis=-1).astype(float)
    limit = max(DROP_FACTOR * usual_error(cameras, uv, weights), least_px)
    _, _, used, good = by_dropping(cameras, uv, weights, limit, limit)
    return used & good
