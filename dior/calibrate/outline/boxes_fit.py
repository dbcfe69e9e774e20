"""Fit a camera to what a person draws or a still camera shows: boxes around a body whose 3D is known, clicked joints.

INPUTS   a start, `Freedom` (what may move, how far the tape is trusted), `EdgeObservations` (3D at the pictures, edges,
         clicks)
OUTPUTS  `Fitted`: the camera, what was fitted with its covariance, which edges agreed

An edge of a box is the extreme of the projected points in its direction (of the body's outline where a person drew it,
of the joints where a machine did), moved outwards by a margin in u and one in v. Which point is the extreme changes
from step to step; between the changes the edge has that point's derivative. Robust least squares (Geman-McClure
weights, the scale lowered in steps) with the priors as further observations. What the edges above and below, or left
and right, have unequal looks like a turn of the camera and is in the covariance alone, by its prior.

Where the clock of a walk's pictures is not known either, the fit has the time in the middle of its pictures and the
drift as further parameters, and the camera's covariance is that with both left open. A walk in one direction only tells
the turn and the time apart by the limbs.

World in metres, recorded pixels, radians. Parameters: turn about the camera's own axes (3), shift of its centre along
the line of sight, to its right and up (3), log of the focal length, margin along u and along v; time (s) and drift
(ppm) of each walk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.calibrate.outline import edge_errors, seen_edges
from dior.calibrate.outline.edge_errors import EdgeResiduals
from dior.calibrate.outline.seen_edges import EdgeObservations, Freedom
from dior.clocks import lag
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import covariance
from dior.geometry.camera import Camera
from dior.project import boxes

TURN, SHIFT, FOCAL, MARGIN = slice(0, 3), slice(3, 6), 6, slice(7, 9)
AXIS, OUTWARDS = np.array([0, 1, 0, 1]), np.array([-1.0, -1.0, 1.0, 1.0])  # of u_min, v_min, u_max, v_max
SCALES = (16.0, 8.0, 4.0)  # chosen: of the weights, px, before they follow the residuals
CUT = 3.0  # chosen: residuals of that many sd weigh a quarter
# chosen: what it costs to read a side as an occluder's, beyond the usual cost 1 of each edge that is left out: a chi2.
# As much again with many edges, so that a small misfit of all of them is not taken for a wall.
COST_OF_HIDING = 25.0
COST_OF_LOSING = 4.0  # chosen: of an edge at a moment of which there is no 3D; as much as of one that is 2 sd off
HIDDEN_HEADS = 20.0  # chosen: walls and hedges hide legs; little hides heads
DOUBTFUL = 12.0  # chosen: chi2 by which the reading that is taken is ahead of the next, e^6 at even odds
# chosen: readings of which the labels differ less, in heights of the body, are the same to who uses them; half a body
# that is taken for a whole one puts them further off, and chance less (`python -m benchmarks.long_range hidden`)
OTHER_LABELS = 0.13
LINE_PX = 1.0  # chosen: how well an occluder's line is known
FEWEST = 8  # edges and coordinates of clicks: with fewer nothing is fitted
LAGS_HZ = 10.0  # chosen: of clocks; a start, from which the fit goes on


# of points by the errors of the close cameras (F, J, 3, 6V), or what gives it for points (F, J, 3)
Derivative: TypeAlias = Callable[[Floats], Floats] | Floats | None


@dataclass(frozen=True, eq=False)
class Fitted:
    """`values` (9,) and `covariance` (9, 9) of the parameters, of the six of `dior.geometry.covariance` with those of V
    close cameras `by_cameras` (9, 6V); `residual` (F, 4) px of the edges, NaN where none; `agree` (F, 4);
    `click_residual` (F, J, 2) px; `sd_px` of an edge;
    `inflation` by time; `ahead` by how much (chi2) the edges prefer this reading to any that would put the labels
    elsewhere. `clocks` (K, 2) s and ppm: what is to be added to each walk's time in the middle of its pictures and
    drift, with `clock_sigma` (K, 2); `points` (F, J, 3) with these clocks.
    """

    camera: Camera
    values: Floats
    covariance: Floats
    residual: Floats
    agree: Bools
    click_residual: Floats
    sd_px: float
    inflation: float
    ahead: float = np.inf
    by_cameras: Floats = field(default_factory=lambda: np.zeros((9, 0)))
    clocks: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    clock_sigma: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    points: Floats = field(default_factory=lambda: np.zeros((0, 0, 3)))

    @property
    def pose_covariance(self) -> Floats:
        """(6, 6) of the camera's turn (rad) and shift (m, world)."""
        T = to_pose(self.camera)
        return T @ self.covariance @ T.T


def sight(camera: Camera) -> Floats:
    """(3, 3) with columns along the line of sight, to the right and up; the first two are horizontal."""
    ahead = camera.wRc[:, 2] * (1, 1, 0)
    if np.linalg.norm(ahead) < 1e-6:
        return np.eye(3)
    ahead = ahead / np.linalg.norm(ahead)
    return np.stack([ahead, np.cross(ahead, (0, 0, 1)), (0, 0, 1)], axis=1)


def to_pose(camera: Camera, range_m: float | None = None) -> Floats:
    """(6, 9) that brings the parameters' errors to those of `dior.geometry.covariance`.

    An error of the focal length is given as the shift along the optical axis that looks alike `range_m` away.
    """
    T = np.zeros((6, 9))
    T[:3, TURN], T[3:, SHIFT] = np.eye(3), sight(camera)
    if range_m is not None:
        T[3:, FOCAL] = range_m * camera.wRc[:, 2]
    return T


def with_parameters(start: Camera, axes: Floats, values: Floats) -> Camera:
    """The camera with the parameters `values` (9,); `axes` as from `sight(start)`."""
    step = np.concatenate([values[TURN], axes @ values[SHIFT]])
    camera = covariance.moved(start, step)
    lens = camera.intrinsics
    grown = np.exp(values[FOCAL])
    return replace(camera, intrinsics=replace(lens, fx=lens.fx * grown, fy=lens.fy * grown))


READINGS = {"auto": ("", "below", "above"), "none": ("",), "below": ("below",), "above": ("above",)}


def fit(
    start: Camera,
    freedom: Freedom,
    seen: EdgeObservations,
    where: str,
    derivative: Derivative = None,
    occluder: str = "auto",
) -> Fitted:
    """`Fitted` from a start a few degrees off.

    `derivative`: a function that gives the (F, J, 3, 6V) of points by the errors of the close cameras, or the array
    itself, for `by_cameras`. Of the readings "all edges are the body's" and "the edge below (above) is an occluder's,
    which hides the joints beyond it" the one is chosen that the edges agree with best; `occluder` (auto, none, below,
    above) may say which. Raises DiorError (beginning with `where`) with too little to fit.
    """
    check_enough(where, int(np.isfinite(seen.edges).sum() + np.isfinite(seen.clicks).sum()))
    readings = READINGS[occluder] if np.isfinite(seen.edges).any() else ("",)
    tried, error = [], None
    for hides in readings:
        try:
            tried.append(Reading(start, freedom, seen, hides).solve(where))
        except DiorError as one:
            error = one
    if error and not tried:
        raise error
    sd_px = min(reading.sd for reading in tried)
    costs = np.array([reading.cost(sd_px) for reading in tried])
    best = int(np.argmin(costs))
    found = tried[best].fitted(derivative)
    # what a wall costs beforehand chooses, but must not hide that the edges alone say nothing of what is likely anyway
    alone = costs - [reading.charge - reading.unlikely for reading in tried]
    lead = np.minimum(costs - costs[best], alone - alone[best])
    elsewhere = [i for i in range(len(tried)) if i != best and tried[best].labels_differ(tried[i])]
    ahead = float(min(lead[elsewhere], default=np.inf))
    if ahead >= DOUBTFUL:
        return replace(found, ahead=ahead)
    # the labels may as well be where the next reading has them: as far off is one standard deviation
    step = tried[min(elsewhere, key=lambda i: lead[i])].values[:9] - found.values
    return replace(found, ahead=ahead, covariance=found.covariance + np.outer(step, step))


def check_enough(where: str, count: int) -> None:
    """Refuse so few edges and clicked coordinates that nothing is fitted."""
    if count < FEWEST:
        raise DiorError(f"{where}: {count} usable edges and clicked coordinates; draw boxes on at least 4 pictures")


def again(start: Camera, freedom: Freedom, seen: EdgeObservations, found: Fitted, where: str) -> tuple[Camera, Floats]:
    """The camera and the points (F, J, 3) m at its times by fewer observations of the pictures that gave `found`.

    From the same start, with its reading of the edges and from its clocks, which need not be searched again.
    """
    reading = Reading(start, freedom, seen, found.camera.occluded)
    reading.clocks[:] = found.clocks
    reading._iterate(where)
    return reading.camera(), seen.at(reading.clocks)[0]


class Reading:
    """One reading of the edges, with the state of its iteration."""

    def __init__(self, start: Camera, freedom: Freedom, seen: EdgeObservations, hides: str) -> None:
        self.start, self.axes, self.seen, self.hides = replace(start, occluded=hides), sight(start), seen, hides
        self.side = side = cam.occluded_edge(self.start)
        self.freedom = freedom
        self.prior = seen_edges.prior(freedom, len(seen.tracks))
        self.free = np.diagonal(self.prior) < 1e15
        self.values = np.zeros(len(self.prior))
        self.sd = SCALES[-1] / CUT
        self.line = np.nan if side is None else boxes.line_of(seen.edges[:, side])

    @property
    def clocks(self) -> Floats:
        """(K, 2) a view of the parameters."""
        return self.values[9:].reshape(-1, 2)

    def solve(self, where: str) -> Reading:
        unknown = [k for k in range(len(self.seen.tracks)) if self.free[9 + 2 * k]]
        for k in unknown:
            self.clocks[k, 0] = self._search(k, where)
        self._iterate(where)
        for k in unknown:
            self._try_another(k, where)
        return self

    def _search(self, walk: int, where: str) -> float:
        """The clock (s) of a walk by its pictures alone, with an aim of their own."""
        held = replace(self.freedom, clock_s=(), drift_ppm=())

        def cost(late_s: float) -> float:
            alone = Reading(self.start, held, self.seen.only(walk, late_s), self.hides)
            return alone.cost_of_search(where) + (late_s / self.freedom.clock_s[walk]) ** 2

        lags = lag.window(LAGS_HZ, self.seen.most_s)
        return float(lags[np.argmin(lag.curve(cost, lags))])

    def cost_of_search(self, where: str) -> float:
        """The cost after a few steps; what cannot be compared counts as much as what fits."""
        count = np.isfinite(self.seen.edges).sum() + np.isfinite(self.seen.clicks).sum()
        if not np.isfinite(cam.project(self.start, self.seen.points)[0]).any():
            return float(count * CUT**2)
        self.values[TURN] = self._aim(where) * self.free[TURN]
        for scale in SCALES:
            for _ in range(2):
                self.values = self.values + self._step(self.rows(), scale)
        return self.cost(SCALES[-1] / CUT) + (0 if self.side is not None else count - len(self.residuals()[0]))

    def _try_another(self, walk: int, where: str) -> None:
        """Another clock of this walk, if all pictures together agree better with it."""
        sd, kept = self.sd, self.values.copy()

        def cost(late_s: float) -> float:
            self.clocks[walk, 0] = late_s
            return self.cost(sd) + self._lost()

        lags = lag.window(LAGS_HZ, self.seen.most_s)
        best = float(lags[np.argmin(lag.curve(cost, lags))])
        self.values = kept.copy()
        if abs(best - self.clocks[walk, 0]) <= lag.APART_S:
            return
        before = self.cost(sd) + self._lost()
        self.clocks[walk, 0] = best
        try:
            self._iterate(where)
            better = self.cost(sd) + self._lost() <= before
        except DiorError:
            better = False
        if not better:
            self.values, self.sd = kept, sd

    def _lost(self) -> float:
        """What it costs that pictures with edges are at moments of which there is no 3D; a clock must not go there."""
        there = np.any(np.isfinite(self.seen.at(self.clocks)[0]).all(axis=-1), axis=1)
        return COST_OF_LOSING * float(np.isfinite(self.seen.edges[~there]).sum())

    def _iterate(self, where: str) -> None:
        self.values[TURN] = self._aim(where) * self.free[TURN]
        for scale in (*SCALES, *(None,) * 12):
            for _ in range(6 if scale else 3):
                rows = self.rows()
                if not len(rows.residual):
                    raise DiorError(f"{where}: no edge or click is where the 3D goes; is tape.target_m where that is?")
                if scale is None:
                    self.sd = edge_errors.spread(rows.residual)
                step = self._step(rows, scale or CUT * self.sd)
                self.values = self.values + step
                small = np.abs(step[TURN]).max() < 1e-9 and np.abs(step[SHIFT]).max() < 1e-7
                if small and np.abs(step[9::2]).max(initial=0.0) < 1e-6:
                    break

    def _aim(self, where: str) -> Floats:
        """The turn that brings the middles of the projected boxes onto the drawn ones, in the median."""
        uv = cam.project(self.start, self.seen.at(self.clocks)[0])[0]
        if not np.isfinite(uv).any():
            raise DiorError(f"{where}: none of the 3D is in front of the camera; is tape.target_m where the person is?")
        low, high = _extremes(uv, np.all(np.isfinite(uv), axis=-1))
        miss = np.concatenate(
            [
                (self.seen.edges[:, :2] + self.seen.edges[:, 2:] - low - high) / 2,
                (self.seen.clicks - uv).reshape(-1, 2),
            ]
        )
        if self.side is not None:
            # one edge is not the body's: the other says where it is
            k, axis = self.side, AXIS[self.side]
            other = self.seen.edges[:, axis] - low[:, axis] if k > 1 else self.seen.edges[:, 2 + axis] - high[:, axis]
            miss[: len(other), axis] = other
        u, v = np.nanmedian(miss, axis=0)
        lens = self.start.intrinsics
        return np.array([np.arctan(v / lens.fy), -np.arctan(u / lens.fx), 0.0])

    def camera(self) -> Camera:
        return with_parameters(self.start, self.axes, self.values)

    def visible(self, uv: Floats) -> tuple[Bools, Bools, Bools]:
        """Joints (F, J) that are surely not behind the occluder, those that may not be, and pictures (F,) it cuts."""
        there = np.all(np.isfinite(uv), axis=-1) & cam.in_frame(self.start.intrinsics, uv)
        if self.side is None:
            return there, there, np.zeros(len(uv), bool)
        k = self.side
        cut = boxes.at_line(self.seen.edges[:, k], self.line)
        beyond = OUTWARDS[k] * (uv[..., AXIS[k]] - self.line) + self.values[7 + AXIS[k]]
        surely, perhaps = (there & ~((beyond > slack) & cut[:, None]) for slack in (-LINE_PX, LINE_PX))
        return surely, perhaps, cut

    def _cut_limbs(self, uv: Floats, flesh: Floats, cut: Bools) -> Floats:
        """How far outwards (F, B, 4) px the bones reach where the occluder's line cuts them, -inf where it does not."""
        k = cam.occluded_edge(self.start)
        a, b = self.seen.bones.T
        line = self.line - OUTWARDS[k] * self.values[7 + AXIS[k]]
        one, other = uv[:, a, AXIS[k]] - line, uv[:, b, AXIS[k]] - line
        with np.errstate(invalid="ignore", divide="ignore"):
            part = one / (one - other)
        at = uv[:, a] + part[..., None] * (uv[:, b] - uv[:, a])
        reach = at[..., AXIS] * OUTWARDS + np.maximum(flesh[:, a], flesh[:, b])[..., None]
        return np.where((cut[:, None] & (one * other < 0))[..., None], reach, -np.inf)

    def rows(self) -> EdgeResiduals:
        """`EdgeResiduals` of every edge and click at the present values."""
        camera = self.camera()
        points, velocity, since = self.seen.at(self.clocks)
        uv, frame, joint, axis, kind, residual = self._compared(camera, points)
        by_point, by_camera = covariance.projection(camera, points[frame, joint])
        at = np.arange(len(frame))
        lens = camera.intrinsics
        J = np.zeros((len(frame), len(self.values)))
        J[:, :6] = by_camera[at, axis]
        J[:, SHIFT] = J[:, 3:6] @ self.axes
        J[:, FOCAL] = (uv[frame, joint] - (lens.cx, lens.cy))[at, axis]
        J[at, 7 + axis] = _outwards(kind)
        if self.seen.tracks:
            by_time = np.einsum("ni,ni->n", by_point[at, axis], velocity[frame, joint])
            J[at, 9 + 2 * self.seen.walk[frame]] = by_time
            J[at, 10 + 2 * self.seen.walk[frame]] = 1e-6 * by_time * since[frame]
        return EdgeResiduals(frame, joint, axis, kind, residual, J, by_point[at, axis], by_camera[at, axis])

    def residuals(self) -> tuple[Ints, Floats]:
        """Side and residual px, (N,), of every edge and click: `rows` without the derivatives."""
        return self._compared(self.camera(), self.seen.points_at(self.clocks))[-2:]

    def _compared(self, camera: cam.Camera, points: Floats) -> tuple[Floats, Ints, Ints, Ints, Ints, Floats]:
        """Pixels (F, J, 2), and frame, joint, axis, side and residual px, (N,), of every edge and click."""
        uv, depth = cam.project(camera, points)
        shown, perhaps, cut = self.visible(uv)
        edges = np.where(np.any(shown, axis=1)[:, None], self.seen.edges, np.nan)
        if self.side is not None:
            edges[cut, self.side] = np.nan
        with np.errstate(invalid="ignore", divide="ignore"):
            flesh = np.broadcast_to(camera.intrinsics.fx * np.asarray(self.seen.flesh_m) / depth, uv.shape[:2])
        outwards, most = (
            np.where(known[..., None], uv[..., AXIS] * OUTWARDS + flesh[..., None], -np.inf)
            for known in (shown, perhaps)
        )
        if self.side is not None:
            most = np.concatenate([most, self._cut_limbs(uv, flesh, cut)], axis=1)
            # an edge that hangs on a joint at the occluder's line, or on a limb that it cuts, tells nothing
            edges[~(most.max(axis=1) < outwards.max(axis=1) + LINE_PX / 2)] = np.nan
        frame, side = np.nonzero(np.isfinite(edges))
        joint = outwards.argmax(axis=1)[frame, side]
        clicked = np.argwhere(np.isfinite(self.seen.clicks) & np.isfinite(uv))
        kind = np.concatenate([side, np.full(len(clicked), -1)])
        frame, joint, axis = (
            np.concatenate(pair).astype(int) for pair in zip((frame, joint, AXIS[side]), clicked.T, strict=True)
        )
        observed = np.concatenate([edges[np.isfinite(edges)], self.seen.clicks[tuple(clicked.T)]])
        margin = self.values[7 + axis] + np.nan_to_num(flesh[frame, joint])
        return uv, frame, joint, axis, kind, observed - (uv[frame, joint, axis] + _outwards(kind) * margin)

    def _step(self, rows: EdgeResiduals, scale: float) -> Floats:
        weight = edge_errors.weights(rows.residual, scale)
        H = (rows.J * weight[:, None]).T @ rows.J / self.sd**2 + self.prior
        g = rows.J.T @ (weight * rows.residual) / self.sd**2 - self.prior @ self.values
        step = np.zeros(len(self.values))
        step[self.free] = np.linalg.solve(H[np.ix_(self.free, self.free)], g[self.free])
        return step

    @property
    def charge(self) -> float:
        """What it costs beforehand to read the edges so, a chi2."""
        if self.side is None:
            return 0.0
        hidden = boxes.at_line(self.seen.edges[:, self.side], self.line).sum()
        return float(max(COST_OF_HIDING, hidden)) + self.unlikely

    @property
    def unlikely(self) -> float:
        """The part of `charge` that is not for any wall, but for one that few have."""
        return HIDDEN_HEADS if self.hides == "above" else 0.0

    def labels_differ(self, other: Reading) -> bool:
        """Whether this reading puts the body elsewhere than `other`: by more than OTHER_LABELS of its height."""
        ours, theirs = (
            cam.project(reading.camera(), reading.seen.points_at(reading.clocks))[0] for reading in (self, other)
        )
        low, high = _extremes(ours, np.all(np.isfinite(ours), axis=-1))
        height = np.nanmedian((high - low).max(axis=1))
        off = np.linalg.norm(ours - theirs, axis=-1)
        # by another clock they may have no picture with 3D in common
        return not np.isfinite(off).any() or bool(np.nanmedian(off) > OTHER_LABELS * height)

    def cost(self, sd_px: float) -> float:
        """Chi2 of the edges, no more than that of an outlier each, and of the priors; `sd_px` of an edge."""
        kind, residual = self.residuals()
        z2 = (residual / sd_px) ** 2
        missing = np.isfinite(self.seen.edges).sum() - (kind >= 0).sum()
        prior = self.values[self.free] @ self.prior[np.ix_(self.free, self.free)] @ self.values[self.free]
        lost = np.isfinite(self.seen.clicks).sum() - (kind < 0).sum() + missing
        hiding = lost if self.seen.tracks else 0.0
        if self.side is not None:
            hiding = missing + self.charge
        return (z2 / (1 + z2 / CUT**2)).sum() + hiding + prior

    def fitted(self, derivative: Derivative) -> Fitted:
        rows = self.rows()
        scale = CUT * self.sd
        weight = edge_errors.weights(rows.residual, scale)
        free = np.ix_(self.free, self.free)
        inflation = edge_errors.inflation(rows, weight, self.seen)
        # the derivative of the weighted residual, in the mean: weights that fall make the valley flatter
        slope = edge_errors.slopes(rows.residual, scale).sum() / weight.sum()
        slope = max(slope, 0.2)
        H = slope * (rows.J * weight[:, None]).T @ rows.J / self.sd**2 + self.prior
        inverse = np.zeros(H.shape)
        inverse[free] = np.linalg.inv(H[free])
        meat = inflation * (rows.J * (weight**2 * rows.residual**2)[:, None]).T @ rows.J / self.sd**4
        meat = meat * len(rows.residual) / max(len(rows.residual) - self.free.sum(), 1)
        meat[free] += seen_edges.of_prior(self.prior, self.freedom)[free]
        # what moves a point moves the edge: by_point along its axis; what moves all edges moves the camera as far
        pull = slope * inverse @ (rows.J * weight[:, None]).T / self.sd**2
        points = self.seen.at(self.clocks)[0]
        of_bias = edge_errors.of_bias(pull, rows, self.camera(), points, self.seen)
        of_habit = edge_errors.of_habit(pull, rows, self.freedom.habit_px)
        of_outline = edge_errors.of_outline(pull, rows, self.camera(), points, self.seen)
        spread = inverse @ meat @ inverse + of_bias + of_outline + of_habit
        by_cameras = np.zeros((9, 0))
        if derivative is not None:
            moves = derivative(points) if callable(derivative) else derivative
            moved_by = np.einsum("ni,nij->nj", rows.by_point, np.nan_to_num(moves[rows.frame, rows.joint]))
            by_cameras = -(pull @ moved_by)[:9]
        edge = rows.kind >= 0
        residual = np.full(self.seen.edges.shape, np.nan)
        residual[rows.frame[edge], rows.kind[edge]] = rows.residual[edge]
        clicks = np.full(self.seen.clicks.shape, np.nan)
        clicks[rows.frame[~edge], rows.joint[~edge], rows.axis[~edge]] = rows.residual[~edge]
        with np.errstate(invalid="ignore"):
            agree = np.abs(residual) <= scale
        camera = self.camera()
        sigma = np.sqrt(np.diagonal(spread))[9:].reshape(-1, 2)
        return Fitted(
            camera, self.values[:9], spread[:9, :9], residual, agree, clicks, self.sd, inflation,
            by_cameras=by_cameras, clocks=self.clocks, clock_sigma=sigma, points=points,
        )  # fmt: skip


def _outwards(kind: Ints) -> Floats:
    """Which way is outwards of each side (N,), 0 for a click."""
    return np.where(kind >= 0, OUTWARDS[kind], 0.0)


def _extremes(uv: Floats, known: Bools) -> tuple[Floats, Floats]:
    """Lowest and highest pixel (F, 2) of the known joints, NaN where there are none."""
    low = np.where(known[..., None], uv, np.inf).min(axis=1)
    high = np.where(known[..., None], uv, -np.inf).max(axis=1)
    return np.where(np.isfinite(low), low, np.nan), np.where(np.isfinite(high), high, np.nan)
