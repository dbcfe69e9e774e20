"""The clocks of the window's sequences, found while the cameras are adjusted to them.

INPUTS   what the cameras have of each sequence (`window.Recorded`), clocks that a person gave, cameras
OUTPUTS  the clocks, the joints at the window's instants by them, and what the clocks' errors do to the cameras

Poses and clocks are found by turns: with the cameras as they are the clocks follow from how the joints move
(`clock.fit`: a detector's constant errors have no say), then the cameras are adjusted at the instants by these clocks.
Each gives way to what is wrong in the other, so that the turns are lengthened by what the ones before have shown.
Where they end, both are least squares of linear equations in each other: camera errors x = A c + e, clock errors
c = G x + f. Hence x = (1 - A G)^-1 (e + A f).
The clock of the first camera by name is the reference. A clock is the time (s) in the middle of its stretch and the
drift (ppm).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dior.arrays import Bools, Floats
from dior.calibrate.bundle import outcome, reduced, uncertainty
from dior.calibrate.bundle.window import InWindow, Recorded, at_instants, together
from dior.calibrate.clock import fit as clock_fit
from dior.calibrate.clock import from_cameras
from dior.clocks import lag, ray_lags
from dior.clocks.axis import ClockValues
from dior.clocks.clock import DRIFT_SD_PPM, NORMAL_95, doubtful_s
from dior.geometry.camera import Camera
from dior.geometry.disagreeing_views import agreeing

# chosen: how much of a sequence its clocks are fitted to while the cameras still move, and at last
QUICK_S, MOST_S = 5.0, 20.0
# chosen: the turns end where the clocks move by less than either, 0.3 standard errors
SETTLED_S, SETTLED = 2e-4, 0.3
STEPS = 5, 2  # chosen: of the clocks in a turn, while the cameras still move and at last
MOST_LONGER, MOST_STEP_S, MOST_STEP_PPM = 5.0, 0.1, 100.0  # chosen: bounds of one step
MANY = 20  # chosen: joints; of more only every second (third ...) is asked, for the face and the fingers move as one


@dataclass(frozen=True, eq=False)
class Sequences:
    """`recorded`: a `window.Recorded` of each of S sequences, `windows` their instants, `names` of the V cameras.

    `given` (S, V, 2): clocks as a person gave them or 0, offset s and drift ppm at t0; `held` (S, V): those that are
    not to be estimated.
    """

    recorded: tuple[Recorded, ...]
    windows: tuple[dict[str, int], ...]
    names: tuple[str, ...]
    given: Floats
    held: Bools
    min_views: int

    @property
    def reference(self) -> int:
        """Index of the camera whose clock is the time axis of the others."""
        return self.names.index(min(self.names))

    def middle(self, i: int) -> float:
        """The middle (s) of the stretch that the clocks of a sequence are fitted in."""
        grid = self.grid(i, MOST_S)
        return float((grid[0] + grid[-1]) / 2)

    def grid(self, i: int, most_s: float) -> Floats:
        """Moments (T,) s that the clocks of a sequence are fitted to: about the window, `most_s` long, thinned."""
        found, window = self.recorded[i], self.windows[i]
        last = int(max(own.elapsed[-1] for own in found.seen) * found.fps)
        centre = window["first"] + window["step"] * window["count"] // 2
        most, every = round(most_s * found.fps), clock_fit.thinning(found.fps)
        first = int(np.clip(centre - most // 2, 0, max(last - most, 0)))
        return np.arange(first, min(first + most, last) + 1, every) / found.fps

    def at_t0(self, values: Floats) -> Floats:
        """Clocks (S, V, 2) as offset (s) at t0 and drift, from the time in the middle and drift."""
        middle = np.array([self.middle(i) for i in range(len(values))])
        return np.stack([values[..., 0] - 1e-6 * values[..., 1] * middle[:, None], values[..., 1]], axis=-1)

    def at_middle(self, offsets: Floats) -> Floats:
        """Clocks (S, V, 2) as time in the middle (s) and drift, from the offset (s) at t0 and drift."""
        middle = np.array([self.middle(i) for i in range(len(offsets))])
        return np.stack([offsets[..., 0] + 1e-6 * offsets[..., 1] * middle[:, None], offsets[..., 1]], axis=-1)

    def start(self, cameras: Sequence[Camera], aim_rad: Floats, shift_m: Floats) -> Floats:
        """Clocks (S, V, 2) as given, the others by `ray_lags`. `aim_rad`, `shift_m` (V,)."""
        values = self.at_middle(self.given)
        for i, found in enumerate(self.recorded):
            if self.held[i].all():
                continue
            rays = [
                ray_lags.rays(camera, self.times(i, v, values[i, v]), own.uv, own.max_gap_s)
                for v, (camera, own) in enumerate(zip(cameras, found.seen, strict=True))
            ]
            grid = self.grid(i, MOST_S)
            most_s, span = max(own.most_s for own in found.seen), (grid[0], grid[-1])
            values[i, :, 0] += ray_lags.coarse(cameras, rays, self.held[i], span, aim_rad, shift_m, most_s)
        return values

    def times(self, i: int, view: int, value: Floats) -> Floats:
        """Times (F,) s of a camera's pictures in sequence `i` by a clock (2,)."""
        own = self.recorded[i].seen[view]
        return own.elapsed + value[0] + 1e-6 * value[1] * (own.elapsed - self.middle(i))

    def observations(self, values: Floats) -> tuple[Floats, uncertainty.Tracks, list[InWindow]]:
        """Pixels (V, N, 2) and `uncertainty.Tracks` of the joints at the windows' instants, and each `InWindow`."""
        parts = [
            at_instants(found, clocks, window, self.min_views)
            for found, clocks, window in zip(self.recorded, self.at_t0(values), self.windows, strict=True)
        ]
        return *together(parts, [window["count"] for window in self.windows]), parts

    def fitted(
        self, cameras: Sequence[Camera], values: Floats, thorough: bool = False
    ) -> tuple[Floats, list[Fit | None]]:
        """Clocks (S, V, 2) by how the joints move, with the cameras as they are, and the `Fit` of each sequence.

        None for a sequence of which nothing tells.
        """
        fits: list[Fit | None] = []
        values = values.copy()
        for i in range(len(values)):
            fits.append(None)
            if not self.held[i].all():
                values[i], fits[i] = self._settled(i, cameras, values[i], thorough)
        return values, fits

    def freed(self) -> Sequences:
        """The same with no clock held but the reference's: what the detections alone say."""
        return replace(self, held=np.broadcast_to(np.arange(len(self.names)) == self.reference, self.held.shape))

    def searched_far(self) -> Sequences:
        """The same with clocks that are looked for as far off as any are."""
        recorded = []
        for i, found in enumerate(self.recorded):
            grid = self.grid(i, MOST_S)
            far_s = lag.furthest(float(grid[-1] - grid[0]))
            seen = tuple(replace(own, most_s=max(own.most_s, far_s)) for own in found.seen)
            recorded.append(replace(found, seen=seen))
        return replace(self, recorded=tuple(recorded))

    def compared(self, cameras: Sequence[Camera], values: Floats, fits: Sequence[Fit | None]) -> list[Fit | None]:
        """The `Fit`s with what the cameras' errors add; None where all clocks are held or nothing tells."""
        return [
            None if fit is None else self._fit(i, cameras, values[i], fit, True, True) for i, fit in enumerate(fits)
        ]

    def _settled(self, i: int, cameras: Sequence[Camera], value: Floats, thorough: bool) -> tuple[Floats, Fit | None]:
        """Clocks (V, 2) of a sequence, and the last `Fit`.

        Noise in the velocities of the joints makes every step too short.
        """
        free, fit, walked = ~self.held[i], None, Walked()
        for _ in range(STEPS[thorough]):
            fit = self._fit(i, cameras, value, fit, thorough)
            if fit is None:
                break
            walked = walked.on(fit.step * free[:, None])
            value = value + walked.went
            if np.abs(walked.went[:, 0]).max() < SETTLED_S:
                break
        return value, fit

    def _fit(
        self, i: int, cameras: Sequence[Camera], value: Floats, before: Fit | None, thorough: bool, last: bool = False
    ) -> Fit | None:
        grid, middle, views = self.grid(i, MOST_S if thorough else QUICK_S), self.middle(i), len(cameras)
        order = [self.reference, *(v for v in range(views) if v != self.reference)]
        seen = self.recorded[i].seen
        joints = slice(None, None, 1 + len(self.recorded[i].names) // MANY)
        names = self.recorded[i].names[joints]
        uv = np.stack([seen[v].at(grid, value[v], middle)[:, joints] for v in order])
        ordered = [cameras[v] for v in order]
        used = agreeing(ordered, uv)
        uv = np.where(used[..., None], uv, np.nan)
        tracks = from_cameras.tracks_of(
            ordered,
            uv,
            names,
            grid,
            middle,
            last,
            before.solved if thorough and before and len(before.solved.sd_px) == len(names) * views else None,
        )
        # only the drift is known beforehand, about nothing
        about = (value[order] - value[self.reference])[1:]
        solved = clock_fit.solve(tracks, about.ravel(), np.tile([0.0, DRIFT_SD_PPM**-2], views - 1))
        if solved is None:
            return None
        step, given = np.zeros((views, 2)), np.zeros((2 * views, 2 * views))
        gain = np.zeros((2 * views, 6 * views))
        step[order[1:]] = solved.step.reshape(-1, 2)
        clock = np.array([2 * v + k for v in order[1:] for k in (0, 1)])
        given[np.ix_(clock, clock)] = solved.given
        if last:
            camera = np.array([6 * v + k for v in order for k in range(6)])
            gain[np.ix_(clock, camera)] = solved.gain
            # what moves and scales the world as a whole does not change the time
            world = uncertainty.gauge(cameras)
            gain -= gain @ world @ np.linalg.pinv(world)
        return Fit(step, given, gain, solved)


@dataclass(frozen=True, eq=False)
class Walked:
    """The last step of an iteration whose steps are too short by the same share: `wanted` of it and `went` (..., 2)."""

    wanted: Floats = field(default_factory=lambda: np.zeros((1, 2)))
    went: Floats = field(default_factory=lambda: np.zeros((1, 2)))

    def on(self, wanted: Floats) -> Walked:
        """The next step, longer by as much as the last one has changed what is wanted by less than its length.

        Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988) 141-148.
        """
        longer, length = 1.0, (self.went[..., 0] ** 2).sum()
        if length > 0:
            changed = ((self.wanted - wanted) * self.went)[..., 0].sum()
            longer = length / changed if changed > 0 else MOST_LONGER
        went = np.clip(longer, 1.0, MOST_LONGER) * wanted
        return Walked(wanted, np.clip(went, [-MOST_STEP_S, -MOST_STEP_PPM], [MOST_STEP_S, MOST_STEP_PPM]))


@dataclass(frozen=True, eq=False)
class Fit:
    """`step` (V, 2) of the clocks of a sequence, covariance `given` (2V, 2V) with the cameras as they are, and `gain`
    (2V, 6V) by the cameras' errors; zeros for the reference. `solved`: the `fit.SolvedClocks` that they come from."""

    step: Floats
    given: Floats
    gain: Floats
    solved: clock_fit.SolvedClocks


def _together(fits: Sequence[Fit | None], shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Gains (2SV, 6V) and covariance (2SV, 2SV) of the fits of all sequences, zeros where there is none."""
    sequences, views, _ = shape
    each = 2 * views
    gain, given = np.zeros((sequences * each, 6 * views)), np.zeros((sequences * each,) * 2)
    for i, fit in enumerate(fits):
        if fit is not None:
            own = slice(i * each, (i + 1) * each)
            gain[own], given[own, own] = fit.gain, fit.given
    return gain, given


def settled(before: Floats, after: Floats, fits: Sequence[Fit | None]) -> bool:
    """Whether the clocks (S, V, 2) of no sequence have moved by what counts."""
    for was, now, fit in zip(before, after, fits, strict=True):
        if fit is not None:
            sigma = np.sqrt(np.diagonal(fit.given)).reshape(now.shape)
            if (np.abs(now - was) > np.maximum(SETTLED * sigma, SETTLED_S))[:, 0].any():
                return False
    return True


def of(
    recorded: Sequence[Recorded],
    windows: Sequence[dict[str, int]],
    names: Sequence[str],
    given: Sequence[Sequence[ClockValues]],
    min_views: int,
) -> Sequences:
    """`Sequences` by what `by_hand.read` gives for every sequence and camera, [[(offset, drift, source)]]."""
    values = np.array([[clock[:2] for clock in each] for each in given], float).reshape(len(given), len(names), 2)
    held = np.array([[clock[2] == "manual" for clock in each] for each in given], bool).reshape(values.shape[:2])
    held[:, names.index(min(names))] = True
    return Sequences(tuple(recorded), tuple(windows), tuple(names), values, held, min_views)


def with_errors(
    spread: uncertainty.Uncertainty,
    solved: reduced.Solved,
    tracks: uncertainty.Tracks,
    timed: Sequences,
    fits: Sequence[Fit | None],
) -> tuple[uncertainty.Uncertainty, Floats]:
    """The cameras' `Uncertainty` with that of the clocks, and the clocks' standard errors (S, V, 2) in all."""
    gain, given = _together(fits, timed.given.shape)
    free = np.repeat(~timed.held.ravel(), 2)
    A = by_clocks(solved, tracks, timed) * free
    cameras, clocks = np.eye(len(A)), np.eye(len(gain))
    both = np.linalg.inv(cameras - A @ gain)
    covariance = both @ (spread.covariance + A @ given @ A.T) @ both.T
    back = np.linalg.inv(clocks - gain @ A)
    of_clocks = back @ (given + gain @ spread.covariance @ gain.T) @ back.T
    sigma = np.sqrt(np.diagonal(of_clocks)).reshape(timed.given.shape)
    return replace(spread, covariance=(covariance + covariance.T) / 2, across=both @ spread.across), sigma


def by_clocks(solved: reduced.Solved, tracks: uncertainty.Tracks, timed: Sequences) -> Floats:
    """(6V, 2 S V): how the adjusted cameras move with the clocks (time in the middle s, drift ppm)."""
    linear, views = solved.linear, len(solved.cameras)
    people, count = len(tracks.joint), solved.linear.r.shape[-1]
    speed = np.zeros((count, 3))
    aside = np.zeros(count)
    for i, (found, window) in enumerate(zip(timed.recorded, timed.windows, strict=True)):
        own = np.flatnonzero(tracks.sequence == i)
        seconds = (window["first"] + window["step"] * np.arange(window["count"])) / found.fps
        moment = tracks.moment[own] - sum(w["count"] for w in timed.windows[:i])
        points = np.full((window["count"], len(tracks.names), 3), np.nan)
        points[moment, tracks.joint[own]] = solved.points[own]
        moves = np.gradient(points, seconds, axis=0) if len(seconds) > 1 else np.zeros_like(points)
        speed[own] = np.nan_to_num(moves)[moment, tracks.joint[own]]
        aside[own] = 1e-6 * (seconds[moment] - timed.middle(i))
    # the pixels at an instant move on with the clock, the residual is predicted less seen
    by_time = -(linear.J * speed.T).sum(axis=2)
    derivative = np.stack([by_time, by_time * aside], axis=2)
    derivative[..., people:] = 0.0
    sequence = np.zeros(count, int)
    sequence[:people] = tracks.sequence
    first = 2 * (sequence * views + np.arange(views)[:, None])
    at = np.stack([first, first + 1], axis=1)
    return uncertainty.by_parameters(solved, derivative, at, 2 * views * len(timed.recorded))


def findings(
    session: str,
    sequences: Sequence[str],
    timed: Sequences,
    done: outcome.Adjusted,
    alone: outcome.Adjusted | None = None,
) -> list[tuple[str, str, str, str]]:
    """What the clocks are, with 95 % intervals, and where a clock given by hand contradicts the detections.

    `done`, `alone`: the `outcome.Adjusted` with the clocks that are held, and with all of them free (`freed`).
    """
    found: list[tuple[str, str, str, str]] = []
    if done.clocks is None:
        return found
    offsets = timed.at_t0(done.clocks)
    for i, sequence in enumerate(sequences):
        for v, name in enumerate(timed.names):
            scope, held = f"{sequence}/{name}", timed.held[i, v]
            adjusted = alone if held else done
            if v == timed.reference or adjusted is None or adjusted.clocks is None or adjusted.clocks_sigma is None:
                continue
            if adjusted.fits[i] is None:
                text = f"its clock cannot be told from the detections; it counts as {'given' if held else 'stamped'}"
                found.append((scope, "warning", "adjust_clock_unknown", text))
                continue
            sigma = adjusted.clocks_sigma[i, v, 0]
            if not held:
                text = (
                    f"in the middle of the window its clock is {1000 * done.clocks[i, v, 0]:+.1f} ms ± "
                    f"{1000 * NORMAL_95 * sigma:.1f} ms from that of {timed.names[timed.reference]}, at t0 "
                    f"{1000 * offsets[i, v, 0]:+.1f} ms"
                )
                found.append((scope, "info", "adjust_clock", text))
                continue
            off, period = adjusted.clocks[i, v, 0] - done.clocks[i, v, 0], 1.0 / timed.recorded[i].fps
            if abs(off) > doubtful_s(sigma):
                text = (
                    f"the clock given by hand is {abs(off) / period:.1f} pictures off: config/offsets/{sequence}.yaml "
                    f"says {1000 * done.clocks[i, v, 0]:+.1f} ms in the middle of the window, the detections "
                    f"{1000 * adjusted.clocks[i, v, 0]:+.1f} ms ± {1000 * NORMAL_95 * sigma:.1f} ms"
                )
                found.append((scope, "warning", "clock_contradicts", text))
    return found
