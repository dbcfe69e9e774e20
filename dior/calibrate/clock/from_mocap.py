"""The clock of a camera against the motion capture, from 2D detections of the walker.

INPUTS   a located camera, the markers of the C3D, detections (px) and stamps of the camera's pictures
OUTPUTS  `dior.clocks.clock.Clock` (method "detections"), the cost over the lag
A search over the window finds the lag at which the projected markers are nearest to the detections; then time and
drift are fitted to how the joints move (`clock.fit`). World of the C3D in metres, recorded px, seconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dior.arrays import Floats
from dior.body import joint_centres
from dior.calibrate.clock import fit
from dior.clocks import lag
from dior.clocks.axis import blend, bracket
from dior.clocks.clock import DRIFT_SD_PPM, Clock, Estimate
from dior.geometry import camera as cam
from dior.geometry import covariance
from dior.geometry.camera import Camera
from dior.geometry.multiview import side_seen

STEPS_HZ, SEARCHED = 60.0, 240  # chosen: of the lags; pictures that the search compares, spread over the recording
REACH_M = 0.3  # chosen: a detection farther from its joint is of another limb or of somebody else
MOST_S, RUNS = 80.0, 3  # of the recording: what takes part, in runs; bounds the time of computing
ROUNDS = 12  # steps of the clock at most; they end when `fit.settled`
MOST_APART_S = 0.06  # chosen: of fit and search, which knows the 3D: a detector's constants of 1 % are 15 ms of walking


@dataclass(frozen=True, eq=False)
class WalkerJoints:
    """Joints of the walker at ticks `t` (I,) s: `points` (I, J, 3) m, `axes` (I, J, 3, 3) of their segments, names.

    `left` (I, 2): from the right to the left of the body.
    """

    t: Floats
    points: Floats
    axes: Floats
    left: Floats
    names: list[str]

    @cached_property
    def velocity(self) -> Floats:
        return np.gradient(self.points, self.t, axis=0)


def walker_of(t: Floats, xyz: Floats, markers: Sequence[str], wanted: Sequence[str]) -> WalkerJoints:
    """`WalkerJoints` of the joints `wanted` that the markers xyz (I, M, 3) tell, or that are among them."""
    points, axes = joint_centres.joints(xyz, markers, wanted)
    there = np.isfinite(points).all(axis=-1).mean(axis=0) > 0.2
    at = {name: xyz[:, i, :2] for i, name in enumerate(markers)}
    sided = [(f"L{part}", f"R{part}") for part in ("ASI", "PSI", "SHO", "KNE", "ANK")]
    sided += [(f"left_{part}", f"right_{part}") for part in ("hip", "shoulder", "knee", "ankle")]
    pairs = [(a, b) for a, b in sided if {a, b} <= set(at)]
    left = np.nansum([at[a] - at[b] for a, b in pairs], axis=0) if pairs else np.zeros((len(t), 2))
    return WalkerJoints(
        t, points[:, there], axes[:, there], left, [name for name, yes in zip(wanted, there, strict=True) if yes]
    )


@lru_cache(maxsize=1)
def _projected(camera: Camera, motion: WalkerJoints) -> tuple[Floats, Floats]:
    """Pixels (I, J, 2) and depths (I, J) m of the joints at all ticks; several questions about a camera start here."""
    return cam.project(camera, motion.points)


def from_detections(
    camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, most_s: float = lag.WINDOW_S
) -> Estimate:
    """`Clock`, lags (L,) s and costs (L,) px of the lag; the reason where it is not known (the clock is zero then).

    `uv` (F, J, 2) of `motion.names`, NaN where not seen; `elapsed` (F,) s after t0, ascending;
    `most_s`: how far off the clock may be.
    """
    lags, costs = searched(camera, motion, uv, elapsed, most_s)
    if not np.isfinite(costs).any():
        return Clock(0.0), lags, costs, "no joint is both detected and known from the markers"
    best_s = lag.lowest(lags, costs)
    unclear = lag.doubt(lags, lag.worse(costs, fit.POSITIONS), best_s)
    if unclear:
        return Clock(0.0), lags, costs, unclear
    at = fit.runs(elapsed, MOST_S, RUNS)
    middle = float((elapsed[0] + elapsed[-1]) / 2)
    start = np.array([best_s, 0.0])
    value, solved = fitted(camera, motion, uv[at], elapsed[at], middle, start)
    if solved is None:
        return Clock(0.0), lags, costs, "too few detections of moving joints"
    why = fit.doubt(solved) or fit.disagreement(value[0] - best_s, MOST_APART_S)
    return fit.clock_of(value, middle, solved, [camera.name]), lags, costs, why


def searched(camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, most_s: float) -> tuple[Floats, Floats]:
    """`search`, and again further where the best lag is at an end: a start may be worse than it was said to be."""
    lags, costs = search(camera, motion, uv, elapsed, most_s)
    more_s = lag.further(most_s, float(elapsed[-1] - elapsed[0]))
    if more_s > most_s and np.isfinite(costs).any() and lag.at_an_end(lags, costs, lag.lowest(lags, costs)):
        return searched(camera, motion, uv, elapsed, more_s)
    return lags, costs


def search(
    camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, most_s: float = lag.WINDOW_S
) -> tuple[Floats, Floats]:
    """Lags (L,) s up to `most_s` and the mean distance (L,) px of detections from the projected joints, each no more
    than 0.3 m."""
    lags = lag.window(STEPS_HZ, most_s)
    at = np.unique(np.linspace(0, len(elapsed) - 1, min(SEARCHED, len(elapsed))).round().astype(int))
    where = bracket(motion.t, (elapsed[at] + lags[:, None]).ravel(), 2.5 * np.median(np.diff(motion.t)))
    px, depth = _projected(camera, motion)
    reach = np.where(depth > 0, camera.intrinsics.fx * REACH_M / np.where(depth > 0, depth, 1.0), np.nan)
    seen = np.broadcast_to(uv[at], (len(lags), *uv[at].shape)).reshape(-1, *uv.shape[1:])
    far = blend(reach, *where)
    distance = np.minimum(np.linalg.norm(blend(px, *where) - seen, axis=-1), far).reshape(len(lags), -1)
    known = np.isfinite(distance)
    total = np.where(known, distance, 0.0).sum(axis=1)
    return lags, lag.mean_cost(total, known.sum(axis=1))


def off_m(camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, lags_s: Sequence[float]) -> float:
    """How far (m) detections are from the joints, beside them at their depth: the median, at the best of some lags.

    Arguments as of `from_detections`. NaN where nothing is both detected and known.
    """
    every = max(1, len(elapsed) // SEARCHED)
    px, depth = _projected(camera, motion)
    metres = np.where(depth > 0, depth, np.nan) / camera.intrinsics.fx
    found = []
    for late in lags_s:
        where = bracket(motion.t, elapsed[::every] + late, 2.5 * float(np.median(np.diff(motion.t))))
        off = np.linalg.norm(blend(px, *where) - uv[::every], axis=-1) * blend(metres, *where)
        if np.isfinite(off).any():
            found.append(float(np.nanmedian(off)))
    return min(found, default=np.nan)


def aside_m(
    camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, clock: Clock
) -> tuple[dict[str, Floats], float]:
    """How far (2,) m right of and below each joint its detections lie at its depth, the median; and px per m there.

    `clock`: that counts; other arguments as of `from_detections`. Joints that are not seen are left out.
    """
    px, depth = _projected(camera, motion)
    late = clock.offset_s + 1e-6 * clock.drift_ppm * elapsed
    where = bracket(motion.t, elapsed + late, 2.5 * float(np.median(np.diff(motion.t))))
    at = blend(np.where(depth > 0, depth, np.nan), *where)
    off = (uv - blend(px, *where)) * at[..., None] / camera.intrinsics.fx
    seen = np.flatnonzero(np.isfinite(off).all(axis=-1).any(axis=0))
    found = {motion.names[i]: np.nanmedian(off[:, i], axis=0) for i in seen.tolist()}
    return found, camera.intrinsics.fx / float(np.nanmedian(at)) if found else np.nan


def fitted(
    camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, middle: float, start: Floats
) -> tuple[Floats, fit.SolvedClocks | None]:
    """The clock (time in the middle s, drift ppm) from a start, and the step there, None with too few detections."""
    value, solved = start, None
    for _ in range(ROUNDS):
        tracks = tracks_of(camera, motion, uv, elapsed, middle, value)
        solved = fit.solve(tracks, value, np.array([0.0, DRIFT_SD_PPM**-2]))
        if solved is None:
            break
        value = value + np.clip(solved.step, [-0.1, -200], [0.1, 200])
        if fit.settled(solved):
            break
    return value, solved


def tracks_of(
    camera: Camera, motion: WalkerJoints, uv: Floats, elapsed: Floats, middle: float, value: Floats
) -> fit.ResidualTracks:
    """`fit.ResidualTracks` at a clock `value` (time in the middle s, drift ppm)."""
    seconds = elapsed + value[0] + 1e-6 * value[1] * (elapsed - middle)
    where = bracket(motion.t, seconds, 2.5 * np.median(np.diff(motion.t)))
    points = blend(motion.points, *where)
    speed = blend(motion.velocity, *where)
    axes = blend(motion.axes, *where)
    px, depth = cam.project(camera, points)
    by_point, by_camera = covariance.projection(camera, points)
    residual = px - uv
    far = np.linalg.norm(residual, axis=-1) > camera.intrinsics.fx * REACH_M / np.where(depth > 0, depth, np.nan)
    residual = np.where(far[..., None], np.nan, residual)
    moves = (by_point @ speed[..., None])[..., 0]
    by_clock = np.stack([moves, moves * (1e-6 * (elapsed - middle))[:, None, None]], axis=-1)
    known = np.isfinite(points).all(axis=-1, keepdims=True)
    body = np.where(known, points, 0.0).sum(axis=1)[:, :2] / np.maximum(known.sum(axis=1), 1)
    side = side_seen(camera.centre, blend(motion.left, *where), body)
    side = np.broadcast_to(side[:, None], depth.shape)
    basis = fit.constants(depth, side, by_point @ axes)
    groups = [joint_centres.group(name) for name in motion.names]
    residual, by_clock, by_camera, basis = (np.swapaxes(x, 0, 1) for x in (residual, by_clock, by_camera, basis))
    group = np.unique(groups, return_inverse=True)[1]
    return fit.ResidualTracks(residual, by_clock, by_camera, basis, None, np.arange(len(groups)), group, elapsed)
