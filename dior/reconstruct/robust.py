"""Points from several views of which some are wrong: fast where all agree, subsets of views only where they do not.

INPUTS   cameras, detections at the instants (V, T, J), their scores
OUTPUTS  `Points`: 3D joints (T, J, 3), the views used, residuals, and the noise of the detections
World in metres, recorded pixels; NaN is missing. What no two views agree on is not good.

A point of three views in which one is wrong leaves three pairs, and each pair has one equation more than unknowns: a
wrong view whose error lies along the epipolar lines agrees with both others. So the choice also asks where the joint
was just before and after: its prediction between the nearest good instants, whose error is measured on good points.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.clocks.persistence import LASTS_S, autocorrelation
from dior.geometry.camera import Camera
from dior.geometry.disagreeing_views import best_subsets
from dior.geometry.triangulation import (
    Rig,
    mean_errors,
    meet,
    meet_in_blocks,
    residuals,
    rig_of,
    views_of,
    with_every_view,
)
from dior.reconstruct.timeline import instants_within

# a view disagrees where the residuals are this many times what the noise makes of them; chosen: less leaves out right
# views, more believes wrong ones
DROP_FACTOR = 3.0
ROUNDS = 3  # of points and noise in turn; chosen
FEW_JOINTS = 5  # fewer say nothing about a person; chosen
LEAST_PX = 0.05  # no detector is better; chosen
SAMPLE = 2500  # points that the noise is estimated from: its error is then a few per cent
APART_S = 0.3  # residuals nearer in time say the same: the noise of pose networks is correlated over 0.15 s
# a joint's noise in a view is mixed with the view's as if so many independent equations spoke for that; chosen: less
# follows chance in short walks, more makes all joints alike
SHRINK = 30.0
DIES_S = 0.3  # up to which lag errors that die away are summed; chosen: twice the 0.15 s of pose networks
LEAST_REST = 0.05  # a smaller sum of correlations may be chance; chosen
# a joint is predicted from good instants at most this far away on either side; chosen: longer, and the line between
# them is no prediction
PREDICT_S = 0.2


@dataclass(frozen=True, eq=False)
class Points:
    """Triangulated joints.

    `points` (T, J, 3) m, `used` (V, T, J) bool, `residual` (T, J) px mean distance of the detections used, `scaled` the
    same at fx 1680, `sigma` (V, J) px of a detection with score 1, in u and in v.
    """

    points: np.ndarray
    used: np.ndarray
    residual: np.ndarray
    scaled: np.ndarray
    sigma: np.ndarray


def noise(cameras: Sequence[Camera], uv: Floats, score: Floats, fps: float) -> Floats:
    """Standard deviation (V, J) px, in u and in v, of a detection with score 1; that of score s is 1/s of it.

    From the residuals of a sample of the instants at which all views agree, with the degrees of freedom that the points
    took (Helmert's variance components): the residuals themselves are smaller than the errors.
    """
    joints = uv.shape[2]
    seen = (score > 0).sum(axis=0) >= 2
    rows = np.flatnonzero(seen.any(axis=1))
    if not len(rows):
        return np.full((len(cameras), joints), np.nan)
    every = max(1, len(rows) * joints // SAMPLE)
    rows = rows[::every]
    independent = min(1.0, every / fps / APART_S)
    uv, score = uv[:, rows], score[:, rows]
    joint = np.tile(np.arange(joints), len(rows))
    start = views_of(rig_of(cameras), uv, np.where(score > 0, score, 0.0))
    degrees = 2 * (start.w > 0).sum(axis=0) - 3
    points, chi2 = meet(start)
    known = np.isfinite(chi2) & (degrees >= 1)
    if not known.any():
        return np.full((len(cameras), joints), np.nan)
    # half of the points agree, whatever the others do
    per_degree = np.median(chi2[known] / _median_chi2(degrees[known]))
    sigma = np.full((len(cameras), joints), max(np.sqrt(per_degree), LEAST_PX))
    for _ in range(ROUNDS):
        views = replace(start, w=start.w / sigma[:, joint])
        points, chi2 = meet(views)
        agree = np.flatnonzero(chi2 <= DROP_FACTOR**2 * degrees)
        left, free = residuals(views.at(agree), points[:, agree])
        free = np.where(views.w[:, agree] > 0, free, 0.0)
        square = (left**2).sum(axis=1) * sigma[:, joint[agree]] ** 2
        sums = [np.stack([np.bincount(joint[agree], v, joints) for v in values]) for values in (square, free)]
        total = sums[0].sum() / sums[1].sum()
        sums = [values * independent for values in sums]
        of_view = [values.sum(axis=1, keepdims=True) for values in sums]
        of_view = (of_view[0] + SHRINK * total) / (of_view[1] + SHRINK)
        sigma = np.maximum(np.sqrt((sums[0] + SHRINK * of_view) / (sums[1] + SHRINK)), LEAST_PX)
    return sigma


def _median_chi2(degrees: Any) -> Any:
    """Median of chi squared (Wilson and Hilferty 1931), good to 1 % from one degree on."""
    return degrees * (1 - 2 / (9 * degrees)) ** 3


def triangulate(
    cameras: Sequence[Camera], uv: Floats, score: Floats, fps: float, sigma: Floats | None = None
) -> Points:
    """`Points` of pixels uv (V, T, J, 2) with scores (V, T, J), 0 for a view without a say.

    Views that disagree are left out, one more at a time, as long as a point's residuals are `DROP_FACTOR` times the
    noise. Of the subsets of one size that is taken which agrees best with itself and with the joint's prediction.
    """
    shape = count, joints = uv.shape[1:3]
    sigma = noise(cameras, uv, score, fps) if sigma is None else sigma
    rig = rig_of(cameras)
    weights = score / sigma[:, None]
    points, chi2, used, pixels, scaled = with_every_view(rig, uv, weights)
    seen = used.sum(axis=0, dtype=np.int8)
    good = chi2 <= DROP_FACTOR**2 * (2 * seen - 3)
    bad = np.flatnonzero(~good & (seen > 2))
    if len(bad):
        expected, spread = predicted(points.reshape(3, count, joints), good.reshape(shape), bad, fps)
        uv = uv.reshape(len(cameras), -1, 2)[:, bad]
        views = views_of(rig, uv, weights.reshape(len(cameras), -1)[:, bad])

        def judge(at: Ints, p: Floats, chi2: Floats, keep: Bools) -> tuple[Floats, Bools]:
            off = ((p - expected[:, at]) ** 2).sum(axis=0) / spread[at] ** 2
            return chi2 + np.where(np.isfinite(off), off, 0.0), chi2 <= DROP_FACTOR**2 * (2 * keep.sum(axis=0) - 3)

        points[:, bad], used[:, bad] = best_subsets(views, points[:, bad], np.zeros(len(bad), bool), judge)
        pixels[bad], scaled[bad] = mean_errors(rig, points[:, bad], uv, used[:, bad])
    xyz = np.empty((points.shape[1], 3))
    np.add(points.T, rig.origin, out=xyz)
    return Points(xyz.reshape(*shape, 3), used.reshape(-1, *shape), pixels.reshape(shape), scaled.reshape(shape), sigma)


def strangers(cameras: Sequence[Camera], uv: Floats, score: Floats, fps: float, mirror: Ints) -> Bools:
    """Views (V, T) that look at somebody else than the others do, whatever they call left and right.

    `mirror` (J,): the joint of the other side. The middle of two such joints stays where it is when a detector
    exchanges them.
    """
    both = (score > 0) & (score[:, :, mirror] > 0)
    middle = (uv + uv[:, :, mirror]) / 2
    certain = np.where(both, np.minimum(score, score[:, :, mirror]), 0.0)
    rig = rig_of(cameras)
    weights = certain / noise(cameras, middle, certain, fps)[:, None]
    _, chi2, used, _, _ = with_every_view(rig, middle, weights)
    rows = _strange(chi2, used, uv.shape[1:3])
    out = np.zeros(uv.shape[:2], bool)
    if len(rows):
        out[:, rows] = ~_same_person(rig, middle[:, rows], weights[:, rows])
    return out


def _strange(chi2: Floats, used: Bools, shape: tuple[int, int]) -> Ints:
    """Instants (n,) at which most joints of three or more views disagree: a view looks at somebody else."""
    seen = used.sum(axis=0, dtype=np.int8)
    several = (seen > 2).reshape(shape)
    bad = several & ~(chi2 <= DROP_FACTOR**2 * (2 * seen - 3)).reshape(shape)
    return np.flatnonzero((bad.sum(axis=1) > several.sum(axis=1) / 2) & (several.sum(axis=1) >= FEW_JOINTS))


def _same_person(rig: Rig, uv: Floats, weights: Floats) -> Bools:
    """Which views (V, n) are left without those that, as a whole, agree least with the others; weights (V, n, J).

    Joint by joint a stranger's pixel may meet one view of the subject by chance; all his joints do not.
    """
    shape = uv.shape[1:3]
    views = views_of(rig, uv, weights)
    keep = np.ones((len(uv), shape[0]), bool)
    agreed = np.zeros(shape[0], bool)
    for views_left in range(len(uv) - 1, 1, -1):
        best = np.full(shape[0], np.inf)
        for kept in combinations(range(len(uv)), views_left):
            say = np.zeros((len(uv), 1), bool)
            say[list(kept)] = True
            w = np.where(say, views.w, 0.0)
            seen = (w > 0).sum(axis=0)
            chi2 = meet_in_blocks(replace(views, w=w))[1]
            cost = np.minimum(np.nan_to_num(chi2, nan=np.inf) / np.maximum(2 * seen - 3, 1), 4 * DROP_FACTOR**2)
            count = (seen >= 2).reshape(shape).sum(axis=1)
            cost = np.where(seen >= 2, cost, 0.0).reshape(shape).sum(axis=1) / np.maximum(count, 1)
            better = ~agreed & (count >= FEW_JOINTS) & (cost < best)
            best = np.where(better, cost, best)
            keep = np.where(better, say, keep)
        agreed |= best <= DROP_FACTOR**2
    return keep


def covariance(cameras: Sequence[Camera], points: Floats, weights: Floats) -> Floats:
    """Covariance (T, J, 3, 3) m^2 of points (T, J, 3) given the cameras; weights (V, T, J) 1/px, 0: not used.

    NaN where a point is, and with fewer than two views.
    """
    rig = rig_of(cameras)
    p = (points - rig.origin).reshape(-1, 3).T
    w = weights.reshape(len(cameras), -1) * np.array([c.intrinsics.fx for c in cameras])[:, None]
    with np.errstate(all="ignore"):
        at = rig.rows[..., :3] @ p + rig.rows[..., 3:]
        x, y = at[:, 0] / at[:, 2], at[:, 1] / at[:, 2]
        w2 = np.where(w > 0, (w / at[:, 2]) ** 2, 0.0)
        features = np.stack([w2 * (x * x + y * y), w2 * x, w2 * y, w2], axis=1)
        information = (rig.linear[:6] @ features.reshape(-1, p.shape[1]))[[0, 1, 2, 1, 3, 4, 2, 4, 5]].T
    known = np.isfinite(information).all(axis=1) & ((w > 0).sum(axis=0) >= 2)
    out = np.full((p.shape[1], 3, 3), np.nan)
    out[known] = np.linalg.inv(information[known].reshape(-1, 3, 3))
    return out.reshape(*points.shape, 3)


def predicted(points: Floats, good: Bools, at: Ints, fps: float) -> tuple[Floats, Floats]:
    """Where joints should be, from the nearest good instants on both sides: (3, n) m, and its sd per axis (n,) m.

    `points` (3, T, J), `good` (T, J), `at` (n,) indices into T J. The sd is that of the prediction of good points from
    instants as far away. NaN where there is none within `PREDICT_S` on either side.
    """
    count, joints = good.shape
    t, j = np.divmod(at, joints)
    index = np.where(good, np.arange(count)[:, None], -1)
    before = np.maximum.accumulate(index, axis=0)[t, j]
    after = np.minimum.accumulate(np.where(good, index, count)[::-1], axis=0)[::-1][t, j]
    reach = max(1, instants_within(PREDICT_S, fps))
    there = (before >= 0) & (after < count) & (t - before <= reach) & (after - t <= reach)
    before, after = np.where(there, before, t), np.where(there, after, t)
    weight = (t - before) / np.maximum(after - before, 1)
    expected = points[:, before, j] * (1 - weight) + points[:, after, j] * weight
    half = np.where(there, -(-(after - before) // 2), 0)
    spread = np.full(len(at), np.nan)
    for h in np.unique(half[there]).tolist():
        sd = _prediction_error(points, good, h)
        spread[half == h] = sd[j[half == h]]
    return np.where(there & np.isfinite(spread), expected, np.nan), spread


def _prediction_error(points: Floats, good: Bools, half: int) -> Floats:
    """Standard deviation (J,) m per axis of the mean of a joint `half` instants before and after, as a prediction."""
    middle = np.arange(half, points.shape[1] - half)
    middle = middle[:: max(1, len(middle) * points.shape[2] // SAMPLE)]
    off = points[:, middle] - (points[:, middle - half] + points[:, middle + half]) / 2
    square = np.where(good[middle] & good[middle - half] & good[middle + half], (off**2).sum(axis=0), np.nan)
    known = np.isfinite(square)
    out = np.full(points.shape[2], np.nan)
    for j in np.flatnonzero(known.any(axis=0)):
        out[j] = np.sqrt(np.median(square[known[:, j], j]) / _median_chi2(3))
    return out


def error_correlation(
    cameras: Sequence[Camera], uv: Floats, score: Floats, found: Points, fps: float
) -> tuple[float, float]:
    """How the errors of the detections are correlated in time: time constant (s) of what dies away, and the share of
    the variance that is constant.

    From the correlation in time of the residuals of `found` (`Points`), which the walk itself does not move: what is
    left after `LASTS_S` is taken to be constant (a detector's offset of a joint), the rest to be autoregressive, with
    the sum of its correlations up to `DIES_S`, since it is slow noise that a smoother leaves: detections interpolated
    between two pictures share one with the instant before, which is as slow. 0 s is white noise.
    """
    count, joints = uv.shape[1:3]
    views = views_of(rig_of(cameras), uv, np.where(found.used, score, 0.0) / found.sigma[:, None])
    origin = views.rig.origin
    rows = slice(0, min(count, max(1, 10 * SAMPLE // joints)))
    columns = np.arange(count * joints).reshape(count, joints)[rows].ravel()
    some = views.at(columns)
    p = found.points.reshape(-1, 3)[columns] - origin
    known = np.isfinite(p).all(axis=1) & ((some.w > 0).sum(axis=0) >= 2)
    some = views.at(columns[known])
    at = some.rig.rows[..., :3] @ p[known].T + some.rig.rows[..., 3:]
    left = np.full((len(cameras), 2, len(columns)), np.nan)
    ideal = np.stack([some.x - at[:, 0] / at[:, 2], some.y - at[:, 1] / at[:, 2]], axis=1)
    left[..., known] = np.where(some.w[:, None] > 0, np.clip(ideal * some.w[:, None], -3.0, 3.0), np.nan)
    series = left.reshape(len(cameras), 2, -1, joints)

    constant_share = float(np.clip(autocorrelation(series, round(LASTS_S * fps), axis=2), 0.0, 0.9))
    lags = max(1, round(DIES_S * fps))
    rest = sum(autocorrelation(series, lag, axis=2) - constant_share for lag in range(1, lags + 1)) / (
        1 - constant_share
    )
    if rest < LEAST_REST:
        return 0.0, constant_share
    # the autoregressive noise whose correlations have that sum
    ar1 = 0.0
    for _ in range(50):
        ar1 = min(rest / (rest + 1 - ar1**lags), 0.98)
    return -1 / (fps * np.log(ar1)), constant_share
