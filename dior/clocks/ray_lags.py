"""How far apart the cameras' clocks are, roughly, before the cameras' poses are good.

INPUTS   cameras placed by tape or better, the pixels of every joint over time on each camera's own clock
OUTPUTS  a lag (s) per camera, good to a few hundredths of a second

For every lag of a pair of cameras the rays of the same joints at the same moments should meet. How nearly they can,
after the pair's poses have given way as far as a tape and an aim by eye allow, is the cost of the lag: walks repeat
every second and more, but the walker is a stride further on then, which the poses cannot make up for. The lags of all
cameras are those with the least total cost of all pairs. Exchanged sides and wrong limbs count little (Cauchy's loss).
Directions are unit vectors in the world, lengths m.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dior.arrays import Bools, Floats
from dior.clocks import lag
from dior.geometry.camera import Camera, undistort
from dior.geometry.rotation import from_rotvec

# chosen, all of them: the lag is to be good to a few hundredths of a second, as a start, in a second or so of computing
STEPS_HZ, GRID_HZ = 15.0, 60.0  # of the lags, and of the rays that are compared at them
EVERY_S, MOST_POINTS, FEWEST_POINTS = 0.1, 600, 100  # moments that are compared; joints at them
LOSS_RAD = (0.05, 0.02, 0.01, 0.006, 0.006)  # Cauchy's scale, round by round; the last is about 10 px at fx 1680
INDEPENDENT = 100.0  # measurements that the points of a pair amount to against the prior of the poses, as errors last
AIM_DEG, MOST_SHIFT_M = 12.0, 0.3  # 1 sigma of a camera by tape and aimed by eye, before its keypoints are asked
SHARED = 0.3  # a lag at which less than this share of the best lag's points is left says nothing


@dataclass(frozen=True, eq=False)
class Rays:
    """Directions (T, J, 3) of a camera's joints on its clock, NaN where not seen, every 1/60 s from `first` / 60 s."""

    first: int
    directions: Floats


def rays(camera: Camera, seconds: Floats, uv: Floats, max_gap_s: float) -> Rays:
    """`Rays` of pixels uv (F, J, 2) recorded at `seconds` (F,), never across a gap of more than `max_gap_s`."""
    from dior.clocks.axis import sample

    xy = undistort(camera.intrinsics, uv)
    first, last = int(np.ceil(seconds[0] * GRID_HZ)), int(np.floor(seconds[-1] * GRID_HZ))
    xy = sample(seconds, xy, np.arange(first, last + 1) / GRID_HZ, max_gap_s)
    ahead = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    return Rays(first, ahead / np.linalg.norm(ahead, axis=-1, keepdims=True) @ camera.wRc.T)


def coarse(
    cameras: Sequence[Camera],
    seen: Sequence[Rays],
    held: Bools,
    span: tuple[float, float],
    aim_rad: Floats,
    shift_m: Floats,
    most_s: float = lag.WINDOW_S,
) -> Floats:
    """What is to be added to the times (V,) s of the cameras' clocks so that they agree.

    `seen`: `Rays` of each camera on its clock as it is known, `held` (V,): clocks that are not to be moved, at least
    one; `span`: first and last second that is looked at; `aim_rad`, `shift_m` (V,): how far off the cameras may be, 1
    sigma; `most_s`: how far off the clocks may be: where one is found at the end of that it is searched further. A
    camera that shares too few joints with the others keeps its clock.
    """
    lags, most, costs = lag.window(STEPS_HZ, most_s), round(most_s * STEPS_HZ), {}
    for a, b in combinations(range(len(cameras)), 2):
        if held[a] and held[b]:
            continue
        reach = lags if held[a] or held[b] else lag.steps(2 * most) / STEPS_HZ
        apart = np.hypot(aim_rad[a], aim_rad[b]), np.hypot(shift_m[a], shift_m[b])
        costs[a, b] = pair_cost(cameras[a].centre, seen[a], cameras[b].centre, seen[b], reach, span, *apart)
    at, found = lag.together(costs, held, most), np.zeros(len(cameras))
    for view in np.flatnonzero(~np.asarray(held)).tolist():
        along = lag.along(costs, at, view, most)
        # a flat curve: it shares too little with the others
        found[view] = lag.lowest(lags, along, at[view] + most) if np.ptp(along) > 0 else 0.0
    more_s = lag.further(most_s, span[1] - span[0])
    if more_s > most_s and any(lag.at_an_end(lags, lags, late_s) for late_s in found.tolist()):
        return coarse(cameras, seen, held, span, aim_rad, shift_m, more_s)
    return found


def pair_cost(
    centre_a: Floats,
    a: Rays,
    centre_b: Floats,
    b: Rays,
    lags: Floats,
    span: tuple[float, float],
    aim_rad: float,
    shift_m: float,
) -> Floats:
    """Mean cost (L,) of the points that both see when b's clock is `lags` (L,) s late: time of a = time of b + lag.

    `aim_rad`, `shift_m`: how far their relative pose may be off. 0 at every lag where the points are too few.
    """
    first, last = (int(np.ceil(s * GRID_HZ)) for s in span)
    every = int(round(EVERY_S * GRID_HZ))
    index = np.arange(max(first, a.first), min(last, a.first + len(a.directions) - 1) + 1, every)
    A = a.directions[index - a.first]
    moments, joints = np.nonzero(np.isfinite(A[..., 0]))
    chosen = np.sort(np.random.default_rng(0).permutation(len(moments))[:MOST_POINTS])
    moments, joints = moments[chosen], joints[chosen]
    at = index[moments] - np.round(lags[:, None] * GRID_HZ).astype(int) - b.first
    inside = (at >= 0) & (at < len(b.directions))
    B = b.directions[np.clip(at, 0, len(b.directions) - 1), joints]
    good = inside & np.isfinite(B[..., 0])
    count = good.sum(axis=1)
    if count.max(initial=0) < FEWEST_POINTS:
        return np.zeros(len(lags))
    B = np.ascontiguousarray(np.swapaxes(np.where(good[..., None], B, 0.0), 1, 2))
    cost = _fitted(A[moments, joints].T, B, good, centre_b - centre_a, aim_rad, shift_m)
    enough = count >= max(SHARED * count.max(), FEWEST_POINTS / 2)
    return np.where(enough, cost, cost[enough].max())


def _fitted(A: Floats, B: Floats, good: Bools, baseline: Floats, aim_rad: float, shift_m: float) -> Floats:
    """Mean cost (L,) of rays A (3, N) and B (L, 3, N) after turning B and shifting its centre, for each lag.

    The residual is the sine of the angle by which a ray misses the plane of the other and the baseline.
    """
    line, given = np.repeat(baseline[None], len(B), axis=0), np.zeros((len(B), 6))
    prior = np.repeat([aim_rad**-2, shift_m**-2], 3)
    share = INDEPENDENT / np.maximum(good.sum(axis=1), 1)
    for loss in LOSS_RAD:
        residual, D = _missed(A, B, line)
        weighted = D * (good / (loss**2 + residual**2) * share[:, None])[:, None]
        H = weighted @ np.swapaxes(D, 1, 2) + np.diag(prior)
        g = (weighted @ residual[..., None])[..., 0] + given * prior
        step = -np.linalg.solve(H, g[..., None])[..., 0]
        B = from_rotvec(step[:, :3]) @ B
        line, given = line + step[:, 3:], given + step
    residual = _missed(A, B, line)[0]
    cost = (np.log1p((residual / LOSS_RAD[-1]) ** 2) * good).sum(axis=1) / np.maximum(good.sum(axis=1), 1)
    return cost + (given**2 @ prior) / INDEPENDENT


def _missed(A: Floats, B: Floats, line: Floats) -> tuple[Floats, Floats]:
    """By how much B (L, 3, N) misses the plane of A (3, N) and the baseline (L, 3): (L, N), and its derivative
    (L, 6, N) by a turn of B in the world and a shift of its centre."""
    a, b = A[None], np.swapaxes(B, 0, 1)
    cross = np.stack([A[1] * b[2] - A[2] * b[1], A[2] * b[0] - A[0] * b[2], A[0] * b[1] - A[1] * b[0]], axis=1)
    with_a, with_b = line @ A, (line[:, None] @ B)[:, 0]
    norm = np.sqrt(np.maximum((line**2).sum(axis=1)[:, None] - (with_a**2 + with_b**2) / 2, 1e-12))
    turn = line[..., None] * (a * B).sum(axis=1)[:, None] - a * with_b[:, None]
    return (line[:, None] @ cross)[:, 0] / norm, np.concatenate([turn, cross], axis=1) / norm[:, None]
