"""What is given to a fit of a camera to boxes, silhouettes or clicks (`boxes_fit`): what was seen, and what may move.

Recorded pixels, world in metres. `EdgeObservations` has the pictures of all walks in one row; where the clock of the
pictures is to be found, too, it has the 3D of each walk at any moment (`tracks`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.calibrate.outline.tracks import BodyTrack
from dior.clocks import lag

# chosen: 3D joints of real detectors are off by about 1 % of the body height (design, section 9), for as long as the
# same side is seen, and the outline of a body goes around other points than theirs
JOINT_BIAS_M = 0.025
# chosen: hair, soles, clothes and build that `silhouettes.outline` does not know, on each side of a person; at crown
# and soles the same from wherever they are seen
OUTLINE_M = 0.02
# chosen: sd of what a person draws each of the four edges further out than the margin of its axis, in every box alike
HABIT_PX = 0.5


@dataclass(frozen=True)
class Freedom:
    """Standard errors of what is known before: `turn` (3,) rad, `shift` (3,) m along, right and up, `focal` of the log.

    0 holds a value. `margin_px` that of the margin of all edges, `margin_split_px` that of v against u, by which habits
    part them included. `habit_px`: of what each edge is drawn further out than that in every box: top against bottom
    looks like a tilt and left against right like a pan, so that no number of boxes tells it. `clock_s` and `drift_ppm`
    (K,): of the clocks of the K walks.
    """

    turn: tuple[float, float, float] = (np.radians(5), np.radians(5), np.radians(3))
    shift: tuple[float, float, float] = (0.3, 0.0, 0.0)
    focal: float = 0.0
    margin_px: float = 3.0
    margin_split_px: float = 0.3
    habit_px: float = 0.0
    clock_s: tuple[float, ...] = ()
    drift_ppm: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class EdgeObservations:
    """F pictures: `points` (F, J, 3) m with NaN, `edges` (F, 4) px with NaN, `clicks` (F, J, 2) px with NaN.

    `seconds` (F,) and `walk` (F,): pictures of one walk near in time may share their errors. `bias_m`: standard error
    of a joint's place that is constant while the same side of the body is seen and shows in no residual. `flesh_m`
    (J,): how far the outline that the edges are of lies outside of each joint, `outline_m`: standard error of that, 0
    where the edges are those of the joints. `tracks`: that of each walk, on whose time axis the `seconds` are where a
    clock is to be found; `points` are then those at these `seconds`. `bones` (B, 2): which points a limb joins, so that
    an occluder may cut it; none where the edges are those of the joints. `most_s`: how far off the clocks may be.
    """

    points: Floats
    edges: Floats
    clicks: Floats
    seconds: Floats
    walk: Ints
    bias_m: float = JOINT_BIAS_M
    flesh_m: Floats | float = 0.0
    tracks: tuple[BodyTrack, ...] = ()
    outline_m: float = 0.0
    bones: Ints = field(default_factory=lambda: np.zeros((0, 2), int))
    most_s: float = lag.WINDOW_S

    def middle_s(self, walk: int) -> float:
        """Time (s) in the middle of the pictures of a walk, where errors of its clock and drift are independent; 0
        without one."""
        seconds = self.seconds[self.walk == walk]
        return float(seconds.mean()) if len(seconds) else 0.0

    def at(self, clocks: Floats) -> tuple[Floats, Floats, Floats]:
        """Points (F, J, 3) m with clocks (K, 2) s and ppm that are off, their velocities, and the time (F,) s from the
        middle of the walk."""
        velocity, since = np.zeros(self.points.shape), np.zeros(len(self.points))
        for track, mine, after, moments in self._moments(clocks):
            velocity[mine], since[mine] = track.velocity(moments), after
        return self.points_at(clocks), velocity, since

    def points_at(self, clocks: Floats) -> Floats:
        """The points of `at` alone."""
        points = self.points.copy() if self.tracks else self.points
        for track, mine, _, moments in self._moments(clocks):
            points[mine] = track.at(moments)
        return points

    def _moments(self, clocks: Floats) -> Iterator[tuple[BodyTrack, Bools, Floats, Floats]]:
        """Of each walk its track, pictures (F,), how long after its middle they are and where on its time axis, s."""
        for k, track in enumerate(self.tracks):
            mine = self.walk == k
            after = self.seconds[mine] - self.middle_s(k)
            yield track, mine, after, self.seconds[mine] + clocks[k, 0] + 1e-6 * clocks[k, 1] * after

    def only(self, walk: int, lag_s: float = 0.0) -> EdgeObservations:
        """One walk alone, its pictures `lag_s` later."""
        mine = self.walk == walk
        seconds = self.seconds[mine] + lag_s
        return EdgeObservations(
            self.tracks[walk].at(seconds), self.edges[mine], self.clicks[mine], seconds,
            np.zeros(mine.sum(), int), self.bias_m, self.flesh_m, (), self.outline_m, self.bones, self.most_s,
        )  # fmt: skip


def _margins(freedom: Freedom, habit_px: float) -> Floats:
    """Covariance (2, 2) px^2 of the margins of u and v, without the part that `habit_px` has in what parts them."""
    common, half = freedom.margin_px**2, max(freedom.margin_split_px**2 - habit_px**2, 0.0) / 2
    return np.array([[common + half, common - half], [common - half, common + half]])


def of_prior(P: Floats, freedom: Freedom) -> Floats:
    """What the prior of precision P (as `prior` gives it) has in the scatter of the gradient: P, if what is known were
    as uncertain as it says. The habit, which the margins' prior allows for, is counted edge by edge elsewhere, and must
    not count twice where only one edge of an axis tells (`edge_errors.of_habit`)."""
    out = P.copy()
    if freedom.margin_px > 0:
        own = P[7:9, 7:9]
        out[7:9, 7:9] = own @ _margins(freedom, freedom.habit_px) @ own
    return out


def prior(freedom: Freedom, walks: int = 0) -> Floats:
    """Precision (9 + 2K, 9 + 2K) of the parameters; 1e18 for what is held."""
    clocks = np.zeros((walks, 2))
    if freedom.clock_s:
        clocks[:, 0], clocks[:, 1] = freedom.clock_s, freedom.drift_ppm or 0.0
    sd = np.array([*freedom.turn, *freedom.shift, freedom.focal, 1, 1, *clocks.ravel()], float)
    P = np.diag([1 / s**2 if s > 0 else 1e18 for s in sd])
    P[7:9, 7:9] = np.linalg.inv(_margins(freedom, 0.0)) if freedom.margin_px > 0 else 1e18 * np.eye(2)
    return P
