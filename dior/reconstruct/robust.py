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

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.clocks.persistence import LASTS_S, autocorrelation
from dior.geometry.camera import Camera
from dior.geometry.disagreeing_views import best_subsets
from dior.geometry.triangulation import (
    Rig,
    mean_errors,
    meet_in_blocks,
    rig_of,
    views_of,
    with_every_view,
)
from dior.reconstruct.detector_noise import DROP_FACTOR, SAMPLE, Noise, estimated, median_chi2
from dior.reconstruct.timeline import instants_within

FEW_JOINTS = 5  # fewer say nothing about a person; chosen
DIES_S = 0.3  # up to which lag errors that die away are summed; chosen: twice the 0.15 s of pose networks
# chosen: more than this is never constant; and how far what is constant of shares and of pixels is held together
MOST_STAYS, ALIKE = 0.9, 0.01
LEAST_REST = 0.05  # a smaller sum of correlations may be chance; chosen
# a joint is predicted from good instants at most this far away on either side; chosen: longer, and the line between
# them is no prediction
PREDICT_S = 0.2


@dataclass(frozen=True, eq=False)
class Points:
    """Triangulated joints.

    `points` (T, J, 3) m, `used` (V, T, J) bool, `residual` (T, J) px mean distance of the detections used, `scaled` the
    same at fx 1680, `sigma` (V, T, J) px of a detection with score 1, in u and in v.
    """

    points: np.ndarray
    used: np.ndarray
    residual: np.ndarray
    scaled: np.ndarray
    sigma: np.ndarray


def triangulate(
    cameras: Sequence[Camera], uv: Floats, score: Floats, fps: float, sigma: Floats | None = None
) -> Points:
    """`Points` of pixels uv (V, T, J, 2) with scores (V, T, J), 0 for a view without a say.

    Views that disagree are left out, one more at a time, as long as a point's residuals are `DROP_FACTOR` times the
    noise. Of the subsets of one size that is taken which agrees best with itself and with the joint's prediction.
    """
    shape = count, joints = uv.shape[1:3]
    sigma = estimated(cameras, uv, score, fps).sigma if sigma is None else sigma
    rig = rig_of(cameras)
    weights = score / sigma
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
    weights = certain / estimated(cameras, middle, certain, fps).sigma
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


def covariance(cameras: Sequence[Camera], points: Floats, weights: Floats, own: Floats | None = None) -> Floats:
    """Covariance (T, J, 3, 3) m^2 of points (T, J, 3) given the cameras; weights (V, T, J) 1/px, 0: not used.

    `own` (V,): what of the views' variances is the detections' own, all where None. NaN where a point is, and with
    fewer than two views.
    """
    rig = rig_of(cameras)
    p = (points - rig.origin).reshape(-1, 3).T
    w = weights.reshape(len(cameras), -1) * np.array([c.intrinsics.fx for c in cameras])[:, None]
    with np.errstate(all="ignore"):
        at = rig.rows[..., :3] @ p + rig.rows[..., 3:]
        x, y = at[:, 0] / at[:, 2], at[:, 1] / at[:, 2]
        w2 = np.where(w > 0, (w / at[:, 2]) ** 2, 0.0)
        features = np.stack([w2 * (x * x + y * y), w2 * x, w2 * y, w2], axis=1)
        information = _symmetric(rig, features)
        told = None if own is None else _symmetric(rig, features * own[:, None, None])
    known = np.isfinite(information).all(axis=1) & ((w > 0).sum(axis=0) >= 2)
    out = np.full((p.shape[1], 3, 3), np.nan)
    inverse = np.linalg.inv(information[known].reshape(-1, 3, 3))
    if told is not None:
        inverse = inverse @ told[known].reshape(-1, 3, 3) @ inverse
    out[known] = inverse
    return out.reshape(*points.shape, 3)


def _symmetric(rig: Rig, features: Floats) -> Floats:
    """Information (N, 9) about N points, rows of the 3x3 matrices, from what the views (V, 4, N) say of them."""
    return np.asarray((rig.linear[:6] @ features.reshape(-1, features.shape[-1]))[[0, 1, 2, 1, 3, 4, 2, 4, 5]].T)


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
        out[j] = np.sqrt(np.median(square[known[:, j], j]) / median_chi2(3))
    return out


def error_correlation(
    cameras: Sequence[Camera], uv: Floats, score: Floats, found: Points, fps: float, noise: Noise | None = None
) -> tuple[float, Floats]:
    """How the errors of the detections are correlated in time: time constant (s) of what dies away, and the share
    (T, J) of the points' variance that is constant.

    From the correlation in time of the residuals of `found` (`Points`), which the walk itself does not move: what is
    left after `LASTS_S` is taken to be constant (a detector's offset of a joint), the rest to be autoregressive, with
    the sum of its correlations up to `DIES_S`, since it is slow noise that a smoother leaves: detections interpolated
    between two pictures share one with the instant before, which is as slow. 0 s is white noise. Of the two parts of
    `noise`, shares of the body's size and pixels, each has a constant share of its own.
    """
    count, joints = uv.shape[1:3]
    views = views_of(rig_of(cameras), uv, np.where(found.used, score, 0.0) / found.sigma)
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

    stays = float(np.clip(autocorrelation(series, round(LASTS_S * fps), axis=2), 0.0, MOST_STAYS))
    by_size = np.zeros(uv.shape[:3]) if noise is None else noise.by_size
    of_size, of_pixels = _constant_shares(series, by_size[:, rows], round(LASTS_S * fps), stays)
    seen = np.maximum(found.used.sum(axis=0), 1)
    constant = (np.where(found.used, of_size * by_size + of_pixels * (1 - by_size), 0.0)).sum(axis=0) / seen
    lags = max(1, round(DIES_S * fps))
    rest = sum(autocorrelation(series, lag, axis=2) - stays for lag in range(1, lags + 1)) / (1 - stays)
    if rest < LEAST_REST:
        return 0.0, constant
    # the autoregressive noise whose correlations have that sum
    ar1 = 0.0
    for _ in range(50):
        ar1 = min(rest / (rest + 1 - ar1**lags), 0.98)
    return -1 / (fps * np.log(ar1)), constant


def _constant_shares(series: Floats, by_size: Floats, apart: int, stays: float) -> tuple[float, float]:
    """What is constant of the noise in shares of the body's size, and of that in pixels, of residuals (V, 2, T, J).

    `by_size` (V, T, J): the first one's share of the variance; `apart` instants that count as long. A regression of
    products of residuals on these shares. `stays`, of all, is what both are where nothing tells them apart.
    """
    if not 0 < apart < series.shape[2]:
        return stays, stays
    later, earlier = series[:, :, apart:], series[:, :, :-apart]
    both = np.isfinite(later) & np.isfinite(earlier)
    product = np.where(both, later * earlier, 0.0).sum(axis=1)
    power = np.where(both, later**2 + earlier**2, 0.0).sum(axis=1) / 2
    size = np.sqrt(by_size[:, apart:] * by_size[:, :-apart])
    pixels = np.sqrt((1 - by_size[:, apart:]) * (1 - by_size[:, :-apart]))
    N = np.array([[(a * b * power).sum() for b in (size, pixels)] for a in (size, pixels)])
    c = np.array([(a * product).sum() for a in (size, pixels)])
    held = ALIKE * power.sum()
    if not held > 0:
        return stays, stays
    of_size, of_pixels = np.clip(np.linalg.solve(N + held * np.eye(2), c + held * stays), 0.0, MOST_STAYS)
    return float(of_size), float(of_pixels)
