"""The clock of a camera in the sequences where it has marks, found together with its pose.

INPUTS   marks of C3D markers with the time of their pictures by the camera's own clock, the motions, a lens
OUTPUTS  an offset per sequence, a start for the pose; then covariance and `dior.clocks.clock.Clock`s of the final
solution

A walker at constant speed looks the same to a camera that stands further ahead: what tells the time is what moves
against the body, the legs above all, and every turn. So the pose is fitted anew for each of the offsets of a grid, the
best ones are refined with the pose, and an offset counts only where no other in the window fits about as well.
Drift does not show in a few frames: it is held at 0, and what that may do to pose and time is in their covariance.
World in metres, Z up; recorded pixels; seconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats, Ints, Texts
from dior.calibrate.marks import marks as hand_marks
from dior.calibrate.marks import pnp, pose_grid
from dior.clocks import clock as on_axis
from dior.clocks import lag
from dior.clocks.axis import ClockValues
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import Camera, project

LAGS_HZ = 50.0  # a foot that swings moves 10 cm in a step of these, within what RANSAC takes for agreement
STAMP_SD_S = 0.0005  # chosen: of a header stamp, which all marks of a frame share; what cameras' drivers jitter by
CANDIDATES = 8  # chosen: minima that are refined; a window of 4 s has about as many steps
UNCERTAIN_S = 0.010  # chosen: half a 95 % interval from which on more marks are asked for, 1.2 cm of walking


@dataclass(frozen=True, eq=False)
class Places:
    """Where N marks are in the world, at any offsets of the `names`d sequences whose clocks are to be found.

    `xyz` (N, 3) m of marks that stay, NaN for the others; of those `clock` (N,) index of the sequence, else -1; `t`
    (N,) s after the mocap's start by the camera's clock, `joint` (N,) index in `motions[clock]`; `most_s`:
    how far off the clocks may be.
    """

    xyz: Floats
    clock: Ints
    t: Floats
    joint: Ints
    motions: tuple[hand_marks.Motion, ...]
    names: tuple[str, ...]
    most_s: float = lag.WINDOW_S

    def at(self, offsets: Floats) -> tuple[Floats, Floats]:
        """Points (..., N, 3) m and velocities (..., N, 3) m/s at `offsets` (..., S); NaN where a marker is missing."""
        offsets = np.asarray(offsets, float)
        shape = (*offsets.shape[:-1], *self.xyz.shape)
        xyz, velocity = np.broadcast_to(self.xyz, shape).copy(), np.zeros(shape)
        for s, motion in enumerate(self.motions):
            own = self.clock == s
            xyz[..., own, :], velocity[..., own, :] = _linear(
                motion, self.joint[own], self.t[own] + offsets[..., s, None]
            )
        return xyz, velocity

    def only(self, keep: Bools) -> Places:
        part = self.xyz[keep], self.clock[keep], self.t[keep], self.joint[keep]
        return Places(*part, self.motions, self.names, self.most_s)


def _linear(motion: hand_marks.Motion, joint: Ints, t: Floats) -> tuple[Floats, Floats]:
    """Points and velocities (..., N, 3) of joints (N,) at times (..., N), on the line between two ticks."""
    after = np.clip(np.searchsorted(motion.t, t, side="right"), 1, len(motion.t) - 1)
    start, step = motion.t[after - 1], motion.t[after] - motion.t[after - 1]
    inside = (t >= motion.t[0]) & (t <= motion.t[-1]) & (step <= hand_marks.longest_step(motion))
    a, b = motion.xyz[after - 1, joint], motion.xyz[after, joint]
    velocity = np.where(inside[..., None], (b - a) / step[..., None], np.nan)
    return a + (t - start)[..., None] * velocity, velocity


def places(
    marks: hand_marks.Marks,
    t: Floats,
    motions: Mapping[str, hand_marks.Motion],
    fixed: Mapping[str, ClockValues],
    most_s: float = lag.WINDOW_S,
) -> Places:
    """`Places` of marks (N) whose sequences are free unless in `fixed`: sequence -> (offset_s, drift_ppm, ...).

    Sequences with the most frames come first.
    """
    moving = np.isfinite(t)
    free = [s for s in dict.fromkeys(marks.sequence[moving].tolist()) if s not in fixed]
    frames = {s: len(set(marks.frame[moving & (marks.sequence == s)].tolist())) for s in free}
    names = tuple(sorted(free, key=lambda s: (-frames[s], -(marks.sequence == s).sum(), s)))
    clock, joint, xyz = np.full(len(marks), -1), np.zeros(len(marks), int), marks.xyz.copy()
    for i in np.flatnonzero(moving):
        motion = motions[marks.sequence[i]]
        joint[i] = motion.joints.index(marks.joint[i])
        if marks.sequence[i] in names:
            clock[i] = names.index(marks.sequence[i])
            continue
        offset_s, drift_ppm = fixed[marks.sequence[i]][:2]
        at = t[i : i + 1] * (1 + 1e-6 * drift_ppm) + offset_s
        xyz[i] = _linear(motion, joint[i : i + 1], at)[0][0]
    return Places(xyz, clock, t, joint, tuple(motions[s] for s in names), names, most_s)


@dataclass(frozen=True, eq=False)
class ClocksFromMarks:
    """What the marks say of the clocks: `offsets` (S,) s, NaN where they cannot tell, and `why` (S,) then says why.

    `wTc` (4, 4): the pose that goes with them, None without any offset; `profile`: sequence -> lags (L,) s and the
    robust rms (L,) px with each.
    """

    offsets: Floats
    why: tuple[str, ...]
    wTc: Floats | None
    profile: dict[str, tuple[Floats, Floats]]


def search(
    camera: Camera, where_marked: Places, uv: Floats, frame: Ints, ransac_px: float, where: str
) -> ClocksFromMarks:
    """`ClocksFromMarks` for all sequences of `where_marked`: N marks at `uv` (N, 2) px on the pictures `frame` (N,).

    The first sequence is searched together with the pose, the next ones with the pose known, each refined with all
    before it. Raises DiorError where several offsets of a sequence fit and 0 is none of them.
    """
    count, lags = len(where_marked.names), lag.window(LAGS_HZ, where_marked.most_s)
    offsets, why, profile, start = np.full(count, np.nan), [""] * count, {}, None
    fixed = where_marked.clock < 0
    settled = fixed & np.isfinite(where_marked.xyz).all(axis=1)
    for s, name in enumerate(where_marked.names):
        own = where_marked.clock == s
        if start is None and settled.sum() <= pose_grid.FEWEST and len(set(frame[own].tolist())) < 2:
            why[s] = "all its marks are on one frame"
            continue
        if own.sum() < pose_grid.FEWEST:
            why[s] = f"it has {own.sum()} marks"
            continue
        use = settled | own
        part, seen = where_marked.only(use), uv[use]
        tried = np.tile(np.nan_to_num(offsets), (len(lags), 1))
        tried[:, s] = lags
        xyz = part.at(tried)[0]
        poses, cost = pose_grid.grid(camera.intrinsics, xyz, seen, ransac_px, start)
        # an offset at which there is no mocap fits nothing
        there = np.isfinite(xyz[:, part.clock == s]).all(axis=2)
        cost = np.where(there.mean(axis=1) < pose_grid.SHARE_OF_CONSENSUS, np.inf, cost)
        profile[name] = lags, np.sqrt(cost / use.sum())
        ends, lost = _refined(camera, part, seen, np.nan_to_num(offsets), s, poses, cost, ransac_px)
        why[s] = _doubts(ends, lost, lags, cost, use.sum(), f"{where}, {name}", s)
        if why[s]:
            continue
        start, offsets = (
            ends[0].camera.wTc,
            np.where(np.isnan(offsets) & (np.arange(count) != s), np.nan, ends[0].offsets),
        )
        settled = use
    return ClocksFromMarks(offsets, tuple(why), start, profile)


@dataclass(frozen=True, eq=False)
class End:
    """Where a start led: the `camera`, the `offsets` (S,) s, its robust cost px^2, the inliers (N,)."""

    camera: Camera
    offsets: Floats
    cost: float
    inlier: Bools


def _refined(
    camera: Camera,
    part: Places,
    uv: Floats,
    offsets: Floats,
    s: int,
    poses: Floats,
    cost: Floats,
    limit_px: float,
) -> tuple[list[End], tuple[str, ...]]:
    """`End`s of the best local minima of a grid, the best one first, and where the others put the camera that cannot
    stand there; sequence `s` is the one that was searched."""
    # half a step of the grid costs less than that
    most = cost.min() + len(uv) * limit_px**2 / 2
    lowest = lag.minima(cost)
    lowest = lowest[cost[lowest] <= most]
    ends, lost = [], []
    for k in lowest[np.argsort(cost[lowest], kind="stable")][:CANDIDATES]:
        tried = offsets.copy()
        tried[s] = lag.window(LAGS_HZ, part.most_s)[k]
        end = arrive(camera.at(poses[k]), part, uv, tried, s, limit_px)
        if end is None or np.abs(end.offsets[s]) > part.most_s:
            continue
        xyz = part.only(end.inlier).at(end.offsets)[0]
        cannot = pnp.impossible(end.camera, xyz[np.isfinite(xyz).all(axis=1)])
        if cannot:
            lost.append(cannot)
        else:
            ends.append(end)
    ends.sort(key=lambda end: end.cost)
    return _without_mirrored(ends, len(uv)), tuple(dict.fromkeys(lost))


def _without_mirrored(ends: list[End], marks: int) -> list[End]:
    """`ends` without those of an upside-down camera, where an upright one fits about as well as the best of them."""
    if not ends:
        return ends
    limit = ends[0].cost + lag.CLEARLY * _variance(ends[0], marks)
    if any(end.cost < limit and pnp.upright(end.camera.wTc) == 1 for end in ends):
        return [end for end in ends if pnp.upright(end.camera.wTc) != -1]
    return ends


def _variance(end: End, marks: int) -> float:
    """Variance (px^2) of a coordinate, from the residuals of inliers and how people click before anything is seen."""
    return (pnp.CLICK_WORTH * pnp.CLICK_SD_PX**2 + end.cost) / (pnp.CLICK_WORTH + max(2 * marks - 7, 0))


def arrive(camera: Camera, part: Places, uv: Floats, offsets: Floats, s: int, limit_px: float) -> End | None:
    """`End` from a start, None where fewer than half of the marks agree, of all or of sequence `s`; the net is wide at
    first.
    """
    own = part.clock == s
    inlier = np.zeros(len(uv), bool)
    for limit in (4 * limit_px, 2 * limit_px, *(limit_px,) * 8):
        before = inlier
        inlier = _agree(camera, part, uv, offsets, limit)
        if any(
            inlier[some].sum() < max(pose_grid.FEWEST, pose_grid.SHARE_OF_CONSENSUS * some.sum())
            for some in (own, own | True)
        ):
            return None
        if limit == limit_px and (inlier == before).all():
            break
        wTc, offsets = refine(camera, part.only(inlier), uv[inlier], offsets)
        camera = camera.at(wTc)
    xyz = part.at(offsets)[0]
    there = np.all(np.isfinite(xyz), axis=1)
    return End(camera, offsets, float(pose_grid.cost(project(camera, xyz)[0] - uv, there, limit_px)), inlier)


def _agree(camera: Camera, part: Places, uv: Floats, offsets: Floats, limit_px: float) -> Bools:
    with np.errstate(invalid="ignore"):
        return np.linalg.norm(project(camera, part.at(offsets)[0])[0] - uv, axis=1) <= limit_px


def refine(camera: Camera, part: Places, uv: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    """Pose (4, 4) and offsets (S,) near `camera.wTc` and `offsets` with the least squared residuals in recorded pixels.

    A mark whose marker is missing has no say, nor has a sequence without marks in `part`.
    """
    from scipy.optimize import least_squares

    used = np.isin(np.arange(len(offsets)), part.clock)
    spread = np.eye(len(offsets))[:, used]

    def miss(x: Floats) -> Floats:
        xyz, _ = part.at(offsets + spread @ x[6:])
        off = project(covariance.moved(camera, x[:6]), xyz)[0] - uv
        # a step that puts a point behind the camera must look bad, not missing
        off = np.where(np.all(np.isfinite(xyz), axis=1)[:, None], np.nan_to_num(off, nan=1e4), 0.0)
        return off.ravel()

    def by(x: Floats) -> Floats:
        J = jacobian(covariance.moved(camera, x[:6]), part, offsets + spread @ x[6:])
        return np.nan_to_num(np.concatenate([J[:, :6], J[:, 6:][:, used]], axis=1))

    fit = least_squares(miss, np.zeros(6 + used.sum()), jac=by, x_scale="jac", xtol=1e-9, ftol=1e-12, gtol=1e-12)
    return covariance.moved(camera, fit.x[:6]).wTc, offsets + spread @ fit.x[6:]


def jacobian(camera: Camera, part: Places, offsets: Floats) -> Floats:
    """Derivatives (2N, 6 + S) px of the marks by the camera's error and by the offsets."""
    xyz, velocity = part.at(offsets)
    by_point, by_camera = covariance.projection(camera, xyz)
    own = part.clock[:, None] == np.arange(len(offsets))
    by_offset = np.einsum("nij,nj->ni", by_point, velocity)[:, :, None] * own[:, None, :]
    return np.concatenate([by_camera, by_offset], axis=2).reshape(-1, 6 + len(offsets))


def _doubts(ends: list[End], lost: tuple[str, ...], lags: Floats, cost: Floats, marks: int, where: str, s: int) -> str:
    """Why the best of the ends is no answer for sequence `s`, or "". Raises DiorError where 0 is none either.

    `lost`: where ends put the camera that cannot stand there.
    """
    if not ends and lost:
        return (
            f"where its marks agree on a pose, the camera is {' or '.join(lost)}; are they on the right markers, is "
            "the mocap's Z up and its floor at 0?"
        )
    if not ends:
        return f"no offset within {lags[-1]:g} s brings half of its marks to where they are"
    best = ends[0]
    variance = _variance(best, marks)
    chi2 = (cost - best.cost) / variance
    refined = [end.offsets[s] for end in ends[1:] if end.cost - best.cost < lag.CLEARLY * variance]
    others = np.sort([*lag.rivals(lags, chi2, best.offsets[s]), *refined])
    others = others[np.abs(others - best.offsets[s]) > lag.APART_S]
    if not len(others):
        return ""
    # one end of a valley stands for it
    named = ", ".join(f"{x:.2f} s" for x in others[np.diff(others, prepend=-np.inf) > lag.APART_S])
    if chi2[np.argmin(np.abs(lags))] < lag.CLEARLY:
        return f"offsets of {best.offsets[s]:.2f} s and {named} fit as well"
    raise DiorError(
        f"{where}: offsets of {best.offsets[s]:.2f} s and {named} fit the marks equally well, as one stride and the "
        "next do; mark frames of another part of the walk too, where the subject turns or changes pace, or give the "
        "offset in config/offsets"
    )


def uncertainty(
    J: Floats, t: Floats, miss: Floats, joint: Ints | Texts, frame: Ints | Texts, by_lens: Floats
) -> tuple[Floats, Floats, Floats]:
    """Covariance (6 + 2S, 6 + 2S) of the errors of pose, times (s) and drifts (ppm); when (S,) s those times are; and
    covariance (6, 3) of the pose and the lens, if this has a variance of 1.

    `J` (2N, 6 + S) and `miss` (N, 2) px of the inliers, `t` (N,) s as in `Places`, `joint` and `frame` as in
    `pnp.pose_covariance`; `by_lens` (2N, 3) px of the marks by its errors, times their sigma. Stamps have errors of
    their own. A drift that is held at 0 moves pose and offsets by what the marks make of it; the time is the camera's
    where its own drift does not move it, in the middle of the marked frames.
    """
    S = J.shape[1] - 6
    solve = np.linalg.solve(J.T @ J, J.T)
    moved = solve @ np.nan_to_num(J[:, 6:] * np.repeat(t, 2)[:, None]) * 1e-6  # (6 + S, S), by a drift of 1 ppm
    own = 6 + np.arange(S), np.arange(S)
    middle = 1e6 * moved[own]
    moved[own] = 0.0
    # the error of a drift of 0 is the drift's negative
    by_error = np.concatenate([-moved, np.eye(S)])
    full = on_axis.DRIFT_SD_PPM**2 * by_error @ by_error.T
    by_stamp = solve @ (J[:, 6:].sum(axis=1)[:, None] * np.repeat(np.equal.outer(frame, np.unique(frame)), 2, axis=0))
    # pose and clocks make up for a lens that is wrong as well as they can
    adapted = -solve @ by_lens
    full[: 6 + S, : 6 + S] += (
        pnp.pose_covariance(J, miss, joint, frame) + STAMP_SD_S**2 * by_stamp @ by_stamp.T + adapted @ adapted.T
    )
    return full, middle, adapted[:6]


def clocks(
    camera: str, names: Sequence[str], offsets: Floats, full: Floats, middle: Floats
) -> dict[str, on_axis.Clock]:
    """`Clock` by sequence, with the camera's share, from `uncertainty`."""
    S, found = len(names), {}
    for s, name in enumerate(names):
        own = [6 + s, 6 + S + s]
        gain = np.asarray(np.linalg.solve(full[:6, :6], full[:6, own]).T, float)
        given = np.sqrt(np.diagonal(full[np.ix_(own, own)] - gain @ full[:6, own]))
        found[name] = on_axis.Clock(
            float(offsets[s]),
            0.0,
            "estimated",
            "marks",
            float(middle[s]),
            (float(given[0]), float(given[1])),
            {camera: gain},
        )
    return found


def costs(camera: str, profile: Mapping[str, tuple[Floats, Floats]]) -> dict[str, Any]:
    """Columns of table `clock_costs` from `ClocksFromMarks.profile`; null where half of the markers are missing."""
    lags, cost = (np.concatenate([[], *(each[i] for each in profile.values())]) for i in (0, 1))
    return {
        "sequence": [name for name, (lag, _) in profile.items() for _ in lag],
        "camera": [camera] * len(lags),
        "lag_s": lags,
        "cost_px": np.where(np.isfinite(cost), cost, np.nan),
    }


def findings(
    scope: str, clocks: Mapping[str, on_axis.Clock], spread: Floats, marks: hand_marks.Marks
) -> list[tuple[str, str, str, str]]:
    """What was found: `clocks` (sequence -> `Clock`), `spread` (6, 6) of the camera, the `marks` that agree."""
    found = []
    for name, clock in clocks.items():
        own, half = marks.sequence == name, on_axis.NORMAL_95 * clock.sigma(list(clock.gains), spread)[0]
        text = (
            f"{name}: in the middle of the marks the pictures are {clock.late_s:+.4f} s ± {half:.4f} s (95 %) from "
            f"the mocap, by {own.sum()} marks on {len(set(marks.frame[own].tolist()))} frames"
        )
        if half > UNCERTAIN_S:
            found.append(
                (
                    scope,
                    "warning",
                    "clock_uncertain",
                    f"{text}; mark more frames, best those in which one foot passes the other",
                )
            )
        else:
            found.append((scope, "info", "clock_from_marks", text))
    return found


def not_found(scope: str, why: Mapping[str, str], left_out: bool) -> list[tuple[str, str, str, str]]:
    """Findings for sequences whose clock the marks cannot tell: `why`, sequence -> reason."""
    then = "its marks are not used" if left_out else "it is taken to be 0, and an error of it moves the camera"
    return [
        (scope, "warning", "clock_assumed_zero", f"{name}: the marks do not tell the offset of the clock ({reason}); "
         f"{then}; mark 3 frames or more of different parts of the walk, or give the offset in "
         f"config/offsets/{name}.yaml")
        for name, reason in why.items()
    ]  # fmt: skip
