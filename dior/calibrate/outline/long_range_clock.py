"""The clock of a camera that stands where it is known to: by edges of boxes or silhouettes around a walker whose 3D is
known.

INPUTS   the camera, `seen_edges.EdgeObservations` of one walk with its track, which side an occluder has
OUTPUTS  `dior.clocks.clock.Clock` and the cost of each lag (px)

The edges are those of `boxes_fit`. A joint is not where the outline is, nor where the 3D has it, and that difference is
constant while the same side of the body is seen: each (joint, side) has a shift of its own in the fit, with a prior, so
that no constant turns into time. An outline that is not known before and behind the body (toes, a bag) has one shift
more in the direction of the walk, whichever that is: while the whole body goes ahead that looks like time, and the gait
tells the two apart, feet and hands that stand still or swing while the body goes. What is left is robustly weighted;
the covariance is a sandwich over blocks of time and over the edges of one side of the body, since errors near in time
are alike, and so are those of every step. World in metres, recorded pixels, times in s on the axis of the track.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats
from dior.calibrate.outline import boxes_fit, edge_errors, seen_edges
from dior.calibrate.outline.seen_edges import EdgeObservations, Freedom
from dior.clocks import lag, persistence
from dior.clocks.clock import DRIFT_SD_PPM, OFFSET_SD_S, Clock
from dior.geometry.camera import Camera
from dior.ingest.video_starts import MOST_SIGMAS

LAGS_HZ = 25.0  # chosen: in 40 ms a walker's outline moves little; the fit does the rest
NEAR_S = np.arange(-20, 21) / 100  # chosen: lags about the best whose likelihood is looked at, less than half a step
MOST_HEIGHT = 0.15  # chosen: of the person's height, from which on an edge is an outlier in the search
HALF_STEP_S = 0.04  # chosen: edges are differentiated over twice that, in which another joint may become the extreme
STEPS = 30  # of the fit at most
FEWEST = 8  # edges: as many as two boxes have; the margins, the time and the drift are 4 unknowns
MOST_SIGMA_S = 0.15  # chosen: a 95 % interval of more than a step of walking, 0.6 s in all, is refused
# chi2 by which another lag has to fit worse, that of 3 standard errors: the interval above already refuses what is
# doubtful, and at the 20 of `lag` a walk of the benchmark was refused whose time was right (clocks_pictures, 1 of 8)
CLEARLY = 9.0
MOST_GROWN = 4.0  # chosen: by so much at most the variance of edges is larger than that of their residuals
FITTED = [7, 8, 9, 10]  # of the parameters of `boxes_fit`: both margins, time and drift


# names of the cameras that made the 3D, and what gives the derivative (F, J, 3, 6V) of its points by their errors
Makers: TypeAlias = tuple[list[str], Callable[[Floats], Floats]]


@dataclass(frozen=True, eq=False)
class Misfit:
    """Where the outline is not where the points are: `lead_m` in the direction of the walk, and the shift (3,) m of
    each group of (joint, side of the body)."""

    lead_m: float
    shifts: dict[int, Floats]

    @property
    def values(self) -> Floats:
        return np.array([self.lead_m, *np.array(list(self.shifts.values())).ravel()])

    def moved(self, step: Floats) -> "Misfit":
        shifts = np.array(list(self.shifts.values())) + step[1:].reshape(-1, 3)
        return Misfit(self.lead_m + float(step[0]), dict(zip(self.shifts, shifts, strict=True)))


@dataclass(frozen=True, eq=False)
class ClockFromEdges:
    """The `clock`, the cost px of each lag (`lags_of`), the residual px before (no offset) and after, the number of
    edges and why it was refused, or ""."""

    clock: Clock
    costs_px: Floats
    before_px: float
    after_px: float
    count: int
    refused: str = ""


def lags_of(costs: Sequence[float] | Floats) -> Floats:
    """The lags (L,) s that have the costs (L,)."""
    return lag.steps(len(costs) // 2) / LAGS_HZ if len(costs) else np.zeros(0)


def estimate(
    camera: Camera,
    seen: EdgeObservations,
    method: str,
    margin: tuple[float, float] = (3.0, 0.3),
    side: str = "",
    makers: Makers | None = None,
    trails_m: float = 0.0,
) -> ClockFromEdges:
    """`ClockFromEdges` for the pictures `seen` (`seen_edges.EdgeObservations` with one track) of a camera.

    `margin`: prior of the margin of all edges and of v against u, px. `makers`: names of the cameras that the track
    comes from and a function that gives the derivative (F, J, 3, 6V) of its points by their errors. `trails_m`:
    standard error of an outline that goes ahead of or behind the body where it moves, which no residual tells from
    time.
    """
    freedom = seen_edges.Freedom(
        turn=(0, 0, 0), shift=(0, 0, 0), margin_px=margin[0], margin_split_px=margin[1],
        clock_s=(max(OFFSET_SD_S, seen.most_s / MOST_SIGMAS),), drift_ppm=(DRIFT_SD_PPM,),
    )  # fmt: skip
    reading = boxes_fit.Reading(camera, freedom, seen, side)
    middle, count = seen.middle_s(0), int(np.isfinite(seen.edges).sum())
    zero = Clock(0.0, middle_s=middle)
    if count < FEWEST:
        untried = np.full(len(lag.window(LAGS_HZ, seen.most_s)), np.nan)
        return ClockFromEdges(zero, untried, np.nan, np.nan, count, f"only {count} edges")
    limit = outlier_px(seen)
    costs = curve(reading, limit)
    if not np.isfinite(costs).any():
        return ClockFromEdges(zero, costs, np.nan, np.nan, count, "no picture shows the person")
    best = int(np.nanargmin(costs))
    reading.clocks[0, 0] = lags_of(costs)[best]
    given, gains, sd, speed = _refine(reading, camera, seen, makers)
    count = len(reading.residuals()[1])
    given = np.hypot((max(given[0], width(reading, limit, sd)), given[1]), (trails_m / speed, 0.0))
    offset, drift = reading.clocks[0]
    # the fit has the time in the middle, the formula that at t0
    clock = Clock(
        float(offset - 1e-6 * drift * middle),
        float(drift),
        "estimated",
        method,
        middle,
        (float(given[0]), float(given[1])),
        gains,
    )
    at_zero = len(costs) // 2
    after = float(cost_at(reading, limit))
    why = _doubt(costs, given, offset, sd, count)
    if not np.isfinite(after):
        why = "the 3D is missing at most of the pictures"
    return ClockFromEdges(zero if why else clock, costs, float(costs[at_zero]), after, count, why)


def best_lag(camera: Camera, freedom: Freedom, seen: EdgeObservations) -> float:
    """The lag s of the least cost with the camera as it is and nothing hidden; 0 where none can be compared."""
    costs = curve(boxes_fit.Reading(camera, freedom, seen, ""), outlier_px(seen))
    return float(lags_of(costs)[np.nanargmin(costs)]) if np.isfinite(costs).any() else 0.0


def outlier_px(seen: EdgeObservations) -> float:
    """Residual of an edge that is an outlier, px."""
    height = float(np.nanmedian(seen.edges[:, 3] - seen.edges[:, 1]))
    return MOST_HEIGHT * height if np.isfinite(height) else 20.0


def curve(reading: boxes_fit.Reading, limit_px: float) -> Floats:
    """Robust rms px of the edges for each lag, each side of the boxes about its own median."""
    kept = reading.values.copy()

    def cost(late_s: float) -> float:
        reading.clocks[0] = late_s, 0.0
        return cost_at(reading, limit_px)

    costs = lag.curve(cost, lag.window(LAGS_HZ, reading.seen.most_s))
    reading.values = kept
    return costs


def cost_at(reading: boxes_fit.Reading, limit_px: float) -> float:
    """Robust rms px of the edges at the reading's clock; an edge that cannot be compared counts as in the mean."""
    kind, residual = reading.residuals()
    if len(residual) < max(FEWEST, np.isfinite(reading.seen.edges).sum() / 3):
        return np.nan
    for one in np.unique(kind):
        residual[kind == one] -= np.median(residual[kind == one])
    return np.sqrt(np.minimum(residual**2, limit_px**2).mean())


def width(reading: boxes_fit.Reading, limit_px: float, sd: float) -> float:
    """Standard deviation (s) of the likelihood of the lags near the reading's, each side of the boxes about its median.

    Where little tells the time it is no bell, and wider than what it is at its peak: noise finds other swings of limbs.
    """
    kept = reading.values.copy()

    def cost(late_s: float) -> float:
        reading.clocks[0, 0] = kept[9] + late_s
        return cost_at(reading, limit_px)

    chi2 = len(reading.residuals()[1]) * lag.curve(cost, NEAR_S) ** 2 / sd**2
    reading.values = kept
    if not np.isfinite(chi2).any():
        return 0.0
    likely = np.nan_to_num(np.exp(-(chi2 - np.nanmin(chi2)) / 2))
    middle = (likely * NEAR_S).sum() / likely.sum()
    return float(np.sqrt((likely * (NEAR_S - middle) ** 2).sum() / likely.sum()))


def _refine(
    reading: boxes_fit.Reading, camera: Camera, seen: EdgeObservations, makers: Makers | None
) -> tuple[Floats, dict[str, Floats], float, float]:
    """Moves the reading's clock and margins to the best; given sigma (2,), gains by camera, sd px of an
    edge, and the speed m/s of what tells the time."""
    scale, misfit = None, Misfit(0.0, {})
    for _ in range(STEPS):
        rows = reading.rows()
        J, prior, residual, misfit = _system(reading, rows, camera, seen, misfit)
        if scale is None:
            scale = max(edge_errors.spread(residual - np.median(residual)), 1.0) * 2 * boxes_fit.CUT
        step, _, _ = _solve(J, prior, residual, misfit, reading, scale)
        scale = max(0.7 * scale, boxes_fit.CUT * edge_errors.spread(residual))
        reading.values[FITTED] += step[:4] * np.minimum(1.0, 0.2 / max(abs(step[2]), 1e-12))
        misfit = misfit.moved(step[4:])
        if abs(step[2]) < 1e-6 and scale <= boxes_fit.CUT * edge_errors.spread(residual) * 1.001:
            break
    rows = reading.rows()
    J, prior, residual, misfit = _system(reading, rows, camera, seen, misfit)
    sd = edge_errors.spread(residual)
    _, A, weight = _solve(J, prior, residual, misfit, reading, boxes_fit.CUT * sd)
    slope = max(edge_errors.slopes(residual, boxes_fit.CUT * sd).sum() / weight.sum(), 0.2)
    # the shifts of many joints took their part of what few edges err
    grown = _grown(A, prior, float(weight.sum()))
    A, sd, residual = (A - prior) / grown**2 + prior, grown * sd, grown * residual
    inverse = np.linalg.inv(slope * (A - prior) + prior)
    score = J * (weight * residual / sd**2)[:, None]
    side = edge_errors.way_seen(camera, seen.at(reading.clocks)[0], seen.seconds, seen.walk)[rows.frame]
    alike = [np.arange(len(score)), np.floor(seen.seconds[rows.frame] / persistence.LASTS_S), 5 * rows.kind + side]
    own, near, same = (_clustered(score, label) for label in alike)
    # both ways of being alike, without counting an edge's own error twice
    spread = [inverse @ (meat + prior) @ inverse for meat in (own, near, same, near + same - own)]
    given = np.sqrt(np.max([np.diagonal(s)[2:4] for s in spread], axis=0))
    pull = slope * inverse[2:4] @ (J * weight[:, None]).T / sd**2
    gains = {camera.name: -pull @ rows.by_camera}
    if makers:
        names, derivative = makers
        moves = np.nan_to_num(derivative(seen.at(reading.clocks)[0])[rows.frame, rows.joint])
        by = -pull @ np.einsum("ni,nij->nj", rows.by_point, moves)
        gains |= {name: by[:, 6 * i : 6 * i + 6] for i, name in enumerate(names)}
    moves = np.abs(J[:, 2])
    trail = (weight * moves * np.linalg.norm(rows.by_point, axis=1)).sum()
    return given, gains, sd, max(float((weight * moves**2).sum() / max(trail, 1e-12)), 1e-3)


def _grown(A: Floats, prior: Floats, count: float) -> float:
    """How much larger errors are than the residuals of `count` edges to which as many parameters were fitted as the
    normal matrix `A` (P, P) tells beside their `prior`."""
    fitted = float(np.trace(np.linalg.solve(A, A - prior)))
    return float(np.sqrt(count / max(count - fitted, count / MOST_GROWN)))


def _clustered(score: Floats, label: NDArray[Any]) -> Floats:
    """Sum (P, P) of the squares of the scores (N, P) added up where the label (N,) is the same."""
    names, index = np.unique(label, return_inverse=True)
    sums = np.zeros((len(names), score.shape[1]))
    np.add.at(sums, index, score)
    return sums.T @ sums * len(names) / max(len(names) - 2, 1)


def _system(
    reading: boxes_fit.Reading,
    rows: edge_errors.EdgeResiduals,
    camera: Camera,
    seen: EdgeObservations,
    misfit: Misfit,
) -> tuple[Floats, Floats, Floats, Misfit]:
    """Derivatives (N, 5 + 3G) by margins, time, drift, the lead (m) and the shift (m) of each (joint, side of the
    body), the precision of their priors, residuals (N,) px with the misfit so far, and that with the groups of now."""
    points, velocity, _ = seen.at(reading.clocks)
    side = edge_errors.way_seen(camera, points, seen.seconds, seen.walk)[rows.frame]
    groups, index = np.unique(rows.joint * 5 + side, return_inverse=True)
    misfit = Misfit(misfit.lead_m, {g: misfit.shifts.get(g, np.zeros(3)) for g in groups.tolist()})
    at = np.arange(len(index))
    J = np.zeros((len(index), 5 + 3 * len(groups)))
    J[:, :4] = rows.J[:, FITTED]
    by_time = _by_time(reading, rows, len(seen.seconds))
    J[:, 2], J[:, 3] = by_time, 1e-6 * by_time * (seen.seconds[rows.frame] - seen.middle_s(0))
    J[:, 4] = np.einsum("ni,ni->n", rows.by_point, ahead(velocity)[rows.frame])
    for axis in range(3):
        J[at, 5 + 3 * index + axis] = rows.by_point[:, axis]
    prior = np.eye(J.shape[1]) / max(np.hypot(seen.bias_m, seen.outline_m), 1e-4) ** 2
    prior[:4, :4] = reading.prior[np.ix_(FITTED, FITTED)]
    # half of what before and behind have unequal
    prior[4, 4] = 1 / max(seen.outline_m / np.sqrt(2), 1e-6) ** 2
    return J, prior, rows.residual - J[:, 4:] @ misfit.values, misfit


def ahead(velocity: Floats) -> Floats:
    """The horizontal direction (F, 3) in which a body goes whose points have the velocities (F, J, 3) m/s; 0 where it
    stands."""
    whole = velocity.mean(axis=1) * (1, 1, 0)
    speed = np.linalg.norm(whole, axis=1, keepdims=True)
    return np.where(speed > edge_errors.STANDS_M_S, whole / np.maximum(speed, 1e-9), 0.0)


def _by_time(reading: boxes_fit.Reading, rows: edge_errors.EdgeResiduals, count: int) -> Floats:
    """Derivative (N,) px/s of the extremes by the time: over a few hundredths of a second, since another joint may then
    be the extreme."""
    kept, sides = reading.values, []
    for step in (-HALF_STEP_S, HALF_STEP_S):
        reading.values = kept.copy()
        reading.clocks[0, 0] += step
        there, edge = reading.rows(), np.full((count, 4), np.nan)
        edge[there.frame, there.kind] = -there.residual
        sides.append(edge[rows.frame, rows.kind])
    reading.values = kept
    slope = (sides[1] - sides[0]) / (2 * HALF_STEP_S)
    return np.where(np.isfinite(slope), slope, rows.J[:, 9])


def _solve(
    J: Floats, prior: Floats, residual: Floats, misfit: Misfit, reading: boxes_fit.Reading, scale: float
) -> tuple[Floats, Floats, Floats]:
    """A step of all parameters, the normal matrix and the weights; the scale of the weights is `CUT` sd."""
    weight, sd = edge_errors.weights(residual, scale), scale / boxes_fit.CUT
    A = (J * weight[:, None]).T @ J / sd**2 + prior
    values = np.concatenate([reading.values[FITTED], misfit.values])
    step = np.linalg.solve(A, J.T @ (weight * residual) / sd**2 - prior @ values)
    return step, A, weight


def _doubt(costs: Floats, given: Floats, offset: float, sd: float, count: int) -> str:
    """Why the data cannot tell, or ""."""
    if not given[0] < MOST_SIGMA_S:
        return f"the motion leaves ± {1.96 * given[0]:.2f} s open"
    lags = lags_of(costs)
    return lag.doubt(lags, lag.worse(costs, count, sd), offset, max(lag.APART_S, 3 * given[0]), CLEARLY)
