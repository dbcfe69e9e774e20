"""The clocks of cameras against each other, from 2D detections of the walker that they all see.

INPUTS   cameras with their poses, detections (px) and stamps of their pictures
OUTPUTS  `dior.clocks.clock.Clock` of each (method "cameras"; the first is the reference), the costs over the lag
A search over the window, camera by camera, finds the lag at which the rays of the joints meet; then all clocks are
fitted to how the joints move (`clock.fit`), with the 3D of every moment unknown. World in metres, recorded px, seconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.calibrate.clock import fit
from dior.clocks import lag
from dior.clocks.axis import sample
from dior.clocks.clock import DRIFT_SD_PPM, Clock, Estimate
from dior.geometry import camera as cam
from dior.geometry import covariance
from dior.geometry.camera import Camera
from dior.geometry.disagreeing_views import agreeing
from dior.geometry.multiview import side_seen
from dior.geometry.triangulation import triangulate

SEARCHED = 200  # chosen: moments that the search compares, spread over the recording
CAP = 0.06  # chosen: of an epipolar distance at focal length 1, 100 px at fx 1680; another limb counts no more
MOST_S, RUNS = 180.0, 3  # of all cameras together: what takes part, in runs; bounds the time of computing
MOST_APART_S = 0.15  # chosen: of fit and search, where both poses err; a quarter of a step is a wrong minimum
ROUNDS = 12  # steps of the clocks at most; they end when `fit.settled`
BELIEVED_ROUNDS = 3  # chosen: an error hides a smaller one beside it, which the next round finds
UNBELIEVED, LEAST_OFF_M = 8.0, 0.2  # chosen: a joint so many times as far off its path as usual, and so far, is another
FASTEST_M_S = 8.0  # chosen: above a foot that swings in a run; what is faster is an error
SMOOTH_S = 0.1  # chosen: sd of the bell that velocities are taken with: their noise would pass for a clearer time


# joints of which none repeats another: the face and the fingers move as one
TIMED = {"nose", "neck", "mid_hip"} | {
    f"{side}_{part}"
    for side in ("left", "right")
    for part in "ear shoulder elbow wrist hip knee ankle heel foot_index big_toe small_toe".split()
}


@dataclass(frozen=True, eq=False)
class TimedDetections:
    """What a camera has: `elapsed` (F,) s after t0, `uv` (F, J, 2) px with NaN, `max_gap_s` of its pictures; how far
    (s) its clock may be off those of the others, `most_s`."""

    elapsed: Floats
    uv: Floats
    max_gap_s: float
    most_s: float = lag.WINDOW_S

    def at(self, grid: Floats, value: Floats, middle: float) -> Floats:
        """Detections (T, J, 2) at moments `grid` (T,) s, by a clock (time in the middle s, drift ppm)."""
        times = self.elapsed + value[0] + 1e-6 * value[1] * (self.elapsed - middle)
        return sample(times, self.uv, grid, self.max_gap_s)

    def with_pixels(self, uv: Floats) -> "TimedDetections":
        """The same pictures with another file's detections uv (G, J, 2), frame by frame: what is beyond them is lost,
        what lacks is missing."""
        return replace(self, uv=frame_by_frame(uv, len(self.elapsed)))


def frame_by_frame(uv: Floats, count: int) -> Floats:
    """Detections uv (F, J, 2) of a file as those of `count` pictures, NaN where it has no frame."""
    out = np.full((count, *uv.shape[1:]), np.nan)
    out[: len(uv)] = uv[:count]
    return out


def from_detections(
    cameras: Sequence[Camera], seen: Sequence[TimedDetections], names: Sequence[str], grid: Floats, fps: float
) -> dict[str, Estimate]:
    """By camera: `Clock`, lags (L,) s, costs (L,) px, the reason why it is not known or "".

    `cameras` (V), the first of which is the reference; `seen`: a `TimedDetections` of each; `names` of the joints;
    `grid` (T,) s regular, at `fps` Hz.
    """
    middle = float((grid[0] + grid[-1]) / 2)
    timed = [i for i, name in enumerate(names) if name in TIMED] or list(range(len(names)))
    names, seen = [names[i] for i in timed], [replace(s, uv=s.uv[:, timed]) for s in seen]
    rays = [cam.undistort(c.intrinsics, s.at(grid, np.zeros(2), middle)) for c, s in zip(cameras, seen, strict=True)]
    found = searched(cameras, rays, fps, max(s.most_s for s in seen))
    why = {name: reason for name, (_, _, reason) in found.items()}
    known = [c for c in cameras if not why.get(c.name)]
    clocks = {cameras[0].name: Clock(0.0, source="reference", given=(0.0, 0.0), middle_s=middle)}
    if len(known) > 1:
        of = {c.name: s for c, s in zip(cameras, seen, strict=True)}
        start = np.array([[lag.lowest(*found[c.name][:2]), 0.0] for c in known[1:]])
        value, solved = fitted(known, [of[c.name] for c in known], names, grid, middle, start)
        for i, camera in enumerate(known[1:]):
            if solved is None:
                why[camera.name] = "too few joints that two cameras see"
                continue
            apart = value[i, 0] - lag.lowest(*found[camera.name][:2])
            why[camera.name] = fit.doubt(solved, i) or fit.disagreement(apart, MOST_APART_S)
            made = fit.clock_of(value[i], middle, solved, [c.name for c in known], i)
            clocks[camera.name] = replace(made, method="cameras")
    lags = np.zeros(0)
    return {
        c.name: (
            clocks.get(c.name, Clock(0.0)) if not why.get(c.name) else Clock(0.0),
            *(found[c.name][:2] if c.name in found else (lags, lags)),
            why.get(c.name, ""),
        )
        for c in cameras
    }


def searched(
    cameras: Sequence[Camera], rays: Sequence[Floats], fps: float, most_s: float
) -> dict[str, tuple[Floats, Floats, str]]:
    """`search`, and again further where a best lag is at an end: a start may be worse than it was said to be."""
    found = search(cameras, rays, fps, most_s)
    more_s = lag.further(most_s, len(rays[0]) / fps)
    ends = [
        lag.at_an_end(lags, costs, lag.lowest(lags, costs))
        for lags, costs, _ in found.values()
        if np.isfinite(costs).any()
    ]
    return searched(cameras, rays, fps, more_s) if more_s > most_s and any(ends) else found


def search(
    cameras: Sequence[Camera], rays: Sequence[Floats], fps: float, most_s: float = lag.WINDOW_S
) -> dict[str, tuple[Floats, Floats, str]]:
    """By camera but the first: lags (L,) s up to `most_s`, costs (L,) px of epipolar distance, the reason against it or
    "".

    `rays` (V) of (T, J, 2) ideal coordinates at moments 1/fps apart. A camera's cost at a lag is that of its pairs,
    and of what the lags of the other cameras then make worse among themselves: two cameras on a stride from each other
    may fit, but hardly with a third one.
    """
    most = round(most_s * fps)
    count = len(cameras)
    costs = {}
    for a, b in combinations(range(count), 2):
        reach = lag.steps(2 * most if a else most)
        curve = lag.mean_cost(*_epipolar(cameras[a], cameras[b], rays[a], rays[b], reach))
        if np.isfinite(curve).any():
            # where too little overlaps nothing is said for the lag
            costs[a, b] = np.nan_to_num(curve, nan=np.nanmax(curve))
    at, lags, out = lag.together(costs, np.arange(count) == 0, most), lag.window(fps, most_s), {}
    for view in range(1, count):
        curve = np.full(len(lags), np.nan)
        own = [pair for pair in costs if view in pair]
        if own:
            others = lag.total({pair: costs[pair] for pair in costs if view not in pair}, at)
            # the detections of a camera that is late come late: its clock has to be put back
            profile = lag.profile(costs, at, view, most)[::-1]
            curve = cameras[view].intrinsics.fx * (profile - others) / len(own)
        out[cameras[view].name] = lags, curve, _unclear(lags, curve)
    return out


def _unclear(lags: Floats, costs: Floats) -> str:
    if not np.isfinite(costs).any():
        return "no joint is seen by it and another camera at once"
    return lag.doubt(lags, lag.worse(costs, fit.POSITIONS), lag.lowest(lags, costs))


def _epipolar(one: Camera, other: Camera, x: Floats, y: Floats, steps: Ints) -> tuple[Floats, Ints]:
    """Sums (L,) of capped epipolar distances, at focal length 1, of rays x (T, J, 2) and y `steps` later; counts."""
    from dior.geometry.rotation import cross

    bRa = other.wRc.T @ one.wRc
    E = cross(other.wRc.T @ (one.centre - other.centre)) @ bRa
    count = len(x)
    at = np.unique(np.linspace(0, count - 1, min(SEARCHED, count)).round().astype(int))
    x = np.concatenate([x[at], np.ones((*x[at].shape[:-1], 1))], axis=-1)
    line = x @ E.T
    total, seen = np.zeros(len(steps)), np.zeros(len(steps), int)
    for k, step in enumerate(steps):
        later = at + step
        inside = (later >= 0) & (later < count)
        b = np.concatenate([y[later[inside]], np.ones((inside.sum(), y.shape[1], 1))], axis=-1)
        back = b @ E
        miss = np.abs((b * line[inside]).sum(axis=-1))
        size = np.sqrt((line[inside, :, :2] ** 2).sum(axis=-1) + (back[..., :2] ** 2).sum(axis=-1))
        distance = np.minimum(miss / np.maximum(size, 1e-12), CAP)
        known = np.isfinite(distance)
        total[k], seen[k] = distance[known].sum(), known.sum()
    return total, seen


def fitted(
    cameras: Sequence[Camera],
    seen: Sequence[TimedDetections],
    names: Sequence[str],
    grid: Floats,
    middle: float,
    start: Floats,
) -> tuple[Floats, fit.SolvedClocks | None]:
    """Clocks (V - 1, 2) of the cameras but the first, and `fit.SolvedClocks` there (None with too little)."""
    value = start
    precision = np.tile([0.0, DRIFT_SD_PPM**-2], len(start))
    at = fit.runs(grid, MOST_S / len(cameras), RUNS)
    solved = None
    for i in range(ROUNDS):
        full = np.concatenate([np.zeros((1, 2)), value])
        uv = np.stack([s.at(grid[at], own, middle) for s, own in zip(seen, full, strict=True)])
        used = agreeing(cameras, uv)
        last = i == ROUNDS - 1 or solved is not None and fit.settled(solved)
        tracks = tracks_of(cameras, np.where(used[..., None], uv, np.nan), names, grid[at], middle, last, solved)
        solved = fit.solve(tracks, value.ravel(), precision)
        if solved is None or last:
            break
        value = value + np.clip(solved.step.reshape(-1, 2), [-0.05, -100], [0.05, 100])
    return value, solved


def tracks_of(
    cameras: Sequence[Camera],
    uv: Floats,
    names: Sequence[str],
    seconds: Floats,
    middle: float,
    with_cameras: bool,
    noise: fit.SolvedClocks | None,
) -> fit.ResidualTracks:
    """`fit.ResidualTracks` of detections (V, T, J, 2) px at moments `seconds` (T,).

    `with_cameras`: with the derivatives by the cameras' errors; `noise`: the step before, which says how large the
    detections' noise is; its share in the velocities is not subtracted where None.
    """
    views, count, each = uv.shape[:3]
    xy = np.stack([cam.undistort(c.intrinsics, own) for c, own in zip(cameras, uv, strict=True)])
    seen = np.isfinite(xy).all(axis=-1).astype(float)
    points = triangulate(np.stack([cam.inverse_pose(c.wTc) for c in cameras]), xy, seen)
    points, speed = smooth(points, seconds)
    left = _left(points, names)
    body = _middle(points)
    drifted = 1e-6 * (seconds - middle)
    feigned = np.zeros_like(speed)
    if noise is not None:
        feigned = _by_chance(cameras, points, np.all(np.isfinite(uv), axis=-1), noise, seconds)
    parts = []
    for v, camera in enumerate(cameras):
        px, depth = cam.project(camera, points)
        by_point, by_camera = covariance.projection(camera, points)
        moves = (by_point @ speed[..., None])[..., 0]
        by_clock, by_noise = np.zeros((2, count, each, 2, 2 * (views - 1)))
        if v:
            for out, seen in ((by_clock, moves), (by_noise, (by_point @ feigned[..., None])[..., 0])):
                out[..., 2 * v - 2] = seen
                out[..., 2 * v - 1] = seen * drifted[:, None, None]
        by_clock[~np.isfinite(moves).all(axis=-1)] = np.nan
        all_cameras = np.zeros((count, each, 2, 6 * views if with_cameras else 0))
        if with_cameras:
            all_cameras[..., 6 * v : 6 * v + 6] = by_camera
        side = np.broadcast_to(side_seen(camera.centre, left, body)[:, None], depth.shape)
        parts.append((px - uv[v], by_clock, all_cameras, fit.constants(depth, side), by_point, by_noise))
    residual, by_clock, by_camera, basis, by_point, by_noise = (
        np.concatenate([np.swapaxes(x, 0, 1) for x in column]) for column in zip(*parts, strict=True)
    )
    joint = np.tile(np.arange(each), views)
    return fit.ResidualTracks(
        residual, by_clock, by_camera, basis, by_point, joint, joint, seconds,
        np.nan_to_num(by_noise),
    )  # fmt: skip


def _middle(points: Floats) -> Floats:
    """Middle (T, 2) of the joints (T, J, 3) that are known, NaN without any."""
    known = np.all(np.isfinite(points), axis=-1, keepdims=True)
    return np.where(known, points, 0.0).sum(axis=1)[:, :2] / np.where(known.any(axis=1), known.sum(axis=1), np.nan)


def _by_chance(
    cameras: Sequence[Camera], points: Floats, used: Bools, noise: fit.SolvedClocks, seconds: Floats
) -> Floats:
    """Velocities (T, J, 3) m/s that noise like that of `fit.SolvedClocks` alone would make, drawn anew."""
    shape = (*used.shape, 2)
    drawn = np.random.default_rng(0).standard_normal(shape) * noise.sd_px.reshape(shape[0], 1, shape[2], 1)
    # each is what is left of the one before, and new noise
    for t in range(1, shape[1]):
        drawn[:, t] += noise.keep * drawn[:, t - 1]
    J = np.stack([covariance.projection(c, points)[0] for c in cameras])
    J = np.nan_to_num(J) * used[..., None, None]
    N = np.einsum("vtjap,vtjaq->tjpq", J, J) + 1e-9 * np.eye(3)
    shift = np.linalg.solve(N, np.einsum("vtjap,vtja->tjp", J, drawn)[..., None])[..., 0]
    shift = np.where(np.isfinite(points), shift, np.nan)
    step = np.median(np.diff(seconds))
    tick = np.round((seconds - seconds[0]) / step).astype(int)
    whole = np.full((tick[-1] + 1, *shift.shape[1:]), np.nan)
    whole[tick] = shift
    return _lines(whole, step)[1][tick]


def smooth(points: Floats, seconds: Floats) -> tuple[Floats, Floats]:
    """Points (T, J, 3) m that their neighbours in time believe, NaN for the others, and their velocities (T, J, 3) m/s.

    Both from straight lines under a bell; a point far from the line through its neighbours (an exchanged limb, another
    person) is left out.
    """
    step = np.median(np.diff(seconds))
    # moments of a regular grid, on which runs are apart
    tick = np.round((seconds - seconds[0]) / step).astype(int)
    whole = np.full((tick[-1] + 1, *points.shape[1:]), np.nan)
    whole[tick] = points
    for _ in range(BELIEVED_ROUNDS):
        path, _ = _lines(whole, step)
        off = np.linalg.norm(whole - path, axis=-1)
        some = np.any(np.isfinite(off), axis=0)
        usual = np.zeros(off.shape[1])
        usual[some] = np.nanmedian(off[:, some], axis=0)
        whole = np.where((off <= np.maximum(UNBELIEVED * usual, LEAST_OFF_M))[..., None], whole, np.nan)
    _, velocity = _lines(whole, step)
    slow = np.linalg.norm(velocity, axis=-1) < FASTEST_M_S
    return whole[tick], np.where(slow[..., None], velocity, np.nan)[tick]


def _lines(values: Floats, step: float) -> tuple[Floats, Floats]:
    """Values and slopes per s (T, J, 3) of the straight lines under a bell around each moment; NaN with too little."""
    reach = int(np.ceil(3 * SMOOTH_S / step))
    lag = np.arange(-reach, reach + 1)
    bell = np.exp(-0.5 * (lag * step / SMOOTH_S) ** 2)
    padded = np.pad(values, ((reach, reach), (0, 0), (0, 0)), constant_values=np.nan)
    known: Bools = np.all(np.isfinite(padded), axis=-1)
    # the coordinates first: numpy is slow along an axis of three
    filled = np.moveaxis(np.where(known[..., None], padded, 0.0), -1, 0).copy()
    n, t, tt = np.zeros((3, *values.shape[:2]))
    y, ty = np.zeros((2, 3, *values.shape[:2]))
    for k, weight in zip(lag, bell, strict=True):
        at = slice(reach + k, len(padded) - reach + k)
        w = weight * known[at]
        y += w * filled[:, at]
        n += w
        w *= k
        ty += w * filled[:, at]
        t += w
        w *= k
        tt += w
    spread = n * tt - t * t
    enough = (n > 0.4 * bell.sum()) & (spread > 1e-9)
    slope = np.where(enough, (n * ty - t * y) / np.where(enough, spread, 1.0), np.nan)
    value = (y - slope * t) / np.where(enough, n, np.nan)
    return np.moveaxis(value, 0, -1), np.moveaxis(slope, 0, -1) / step


def _left(points: Floats, names: Sequence[str]) -> Floats:
    """(T, 2): from the right to the left of the body, by the hips and shoulders that are known."""
    at = {name: points[:, i, :2] for i, name in enumerate(names)}
    pairs = [(f"left_{part}", f"right_{part}") for part in ("shoulder", "hip", "knee", "ankle")]
    found = [at[a] - at[b] for a, b in pairs if a in at and b in at]
    return np.nansum(found, axis=0) if found else np.zeros((len(points), 2))
