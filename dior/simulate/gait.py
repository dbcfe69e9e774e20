"""The parametric walker: walking back and forth on a walkway, at any time.

INPUTS: a body, a speed, a walkway (half length, direction), a random start.
OUTPUTS: landmarks and skin markers in the world (m, Z up) at any times (s).

The legs follow published joint angles over the gait cycle as far as planted feet allow: a foot stays where it was
set down from heel contact to toe-off, rolling over heel and ball by the published foot angle; in between the ankle
follows the path that the joint angles give, bent so that it starts and ends on the footprints with the right velocity
and acceleration. The knee follows from hip and ankle, so that bones keep their lengths.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints
from dior.simulate.body import Body, Segments, landmarks, markers
from dior.simulate.patterns import WALK, Pattern

# a function of the phase, of the time or of the way along the loop, as arrays: a spline
Curve: TypeAlias = Callable[[Any], Floats]
# chosen: a leg is at most this share of its length, since a knee is never quite straight
STRETCH = 0.996
# chosen, samples of 0.005 cycles: over how much of the gait the pelvis' height is smoothed
SMOOTH = 15
# chosen: a sole this near to flat is flat
LIFT = np.deg2rad(1.2)


def stride_length(speed: ArrayLike, height: float, pattern: Pattern = WALK) -> Floats:
    """Length of a stride (two steps), m."""
    return np.asarray(speed) / (pattern.strides(speed, height) * pattern.quickness)


def _smooth(u: Floats) -> Floats:
    """0 to 1 with no velocity or acceleration at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10 + u * (6 * u - 15))


def _axes(yaw: ArrayLike, pitch: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> Floats:
    """Axes (T, 3, 3), columns forward, left, up: yaw about z, then nose-up pitch, then left-up roll."""
    yaw, pitch, roll = np.broadcast_arrays(*(np.asarray(a, float) for a in (yaw, pitch, roll)))
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    zero = np.zeros_like(cy)
    Z = np.stack([cy, -sy, zero, sy, cy, zero, zero, zero, zero + 1], axis=-1).reshape(*cy.shape, 3, 3)
    Y = np.stack([cp, zero, -sp, zero, zero + 1, zero, sp, zero, cp], axis=-1).reshape(*cy.shape, 3, 3)
    X = np.stack([zero + 1, zero, zero, zero, cr, -sr, zero, sr, cr], axis=-1).reshape(*cy.shape, 3, 3)
    return Z @ Y @ X


def _frame_along(down: Floats, forward: Floats) -> Floats:
    """Axes of a limb that points along `down` (T, 3), its front towards `forward`."""
    up = -down / np.linalg.norm(down, axis=-1, keepdims=True)
    left = np.cross(up, forward)
    left /= np.linalg.norm(left, axis=-1, keepdims=True)
    return np.stack([np.cross(left, up), left, up], axis=-1)


def _quintic(
    u: Floats, span: float, start: tuple[Floats, Floats, Floats], end: tuple[Floats, Floats, Floats]
) -> Floats:
    """Polynomial in u in [0, 1] from `start` to `end`, each (value, d/dphi, d2/dphi2) over `span` cycles."""
    p0, v0, a0 = start[0], start[1] * span, start[2] * span**2
    p1, v1, a1 = end[0], end[1] * span, end[2] * span**2
    c3 = 10 * (p1 - p0) - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * (p1 - p0) + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * (p1 - p0) - 3 * (v0 + v1) - 0.5 * (a0 - a1)
    return p0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))))


def _cycle(values: tuple[float, ...]) -> Curve:
    """Periodic cubic spline of a table over the gait cycle: degrees in, function of the phase in radians out."""
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.arange(len(values) + 1) / len(values), np.deg2rad([*values, values[0]]), bc_type="periodic")


def _dead_zone(angle: Floats, width: float) -> Floats:
    """The angle without its smallest values: about 0 below `width`, smooth."""

    def ramp(x: Floats) -> Floats:
        return (x + np.sqrt(x * x + LIFT * LIFT / 16)) / 2

    return ramp(angle - width) - ramp(-angle - width)


def _from_below(values: Floats, reach: int) -> Floats:
    """A smooth curve that is nowhere above `values` (T,): the lowest within `reach` samples, averaged over those."""
    padded = np.pad(values, 2 * reach, mode="edge")
    lowest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).min(axis=-1)
    bell = np.hanning(2 * reach + 3)[1:-1]
    return np.convolve(lowest, bell / bell.sum(), mode="valid")


@dataclass(frozen=True, eq=False)
class Contacts:
    """Rows in the order of time: `seconds` (E,), `foot` (E,) 0 left and 1 right, `strike` (E,) or else toe off, and
    where the heel rests in that stance, `heel` (E, 2) m."""

    seconds: Floats
    foot: Ints
    strike: Bools
    heel: Floats


@dataclass(frozen=True)
class Walker:
    """A person who walks back and forth.

    `direction` (rad) of the walkway in the world, `half_length` (m) of its straight part, `start` (m) along the loop
    at time 0, `until` (s) the last time that will be asked for (from -1 s).
    """

    body: Body
    pattern: Pattern = WALK
    speed: float = 1.1
    half_length: float = 1.3
    turn_radius: float = 0.45
    direction: float = 0.0
    start: float = 0.0
    until: float = 12.0

    def at(self, t: Floats) -> tuple[Floats, Floats]:
        """Landmarks (T, 33, 3) and skin markers (T, 39, 3) in the world, m, at times `t` (T,), s."""
        segments = self.segments(t)
        return landmarks(self.body, segments), markers(self.body, segments)

    @cached_property
    def _tables(self) -> tuple[Curve, Curve, Curve, Curve]:
        """Splines: place (s -> x, y, yaw), and s and phase over time, and s over phase."""
        from scipy.interpolate import CubicSpline

        straight, turn = 2 * self.half_length, np.pi * self.turn_radius * 1.25
        lap = 2 * (straight + turn)
        s = np.linspace(0.0, lap, int(lap / 0.005) + 1)
        along = np.mod(s - self.half_length, lap / 2)
        turning = _smooth((along - 0.0) / turn)
        yaw = np.pi * (np.floor((s - self.half_length) / (lap / 2)) + turning)
        # leaving a straight needs no look back: before the first turn floor() is -1 and turning 1
        ds = s[1] - s[0]
        middle = CubicSpline(s, yaw)
        xy = np.stack([middle_integral(middle, s, ds, np.cos), middle_integral(middle, s, ds, np.sin)], axis=1)
        xy -= (xy.max(axis=0) + xy.min(axis=0)) / 2
        c, n = np.cos(self.direction), np.sin(self.direction)
        xy = xy @ np.array([[c, n], [-n, c]])

        laps = int(np.ceil((self.until + 3.0) * self.speed / lap)) + 1
        many = np.concatenate([k * lap + s[:-1] for k in range(-1, laps + 1)])
        place = np.concatenate([np.column_stack([xy, yaw + 2 * np.pi * k])[:-1] for k in range(-1, laps + 1)])
        place[:, 2] += self.direction
        near = np.mod(many - self.half_length + turn / 2, lap / 2)
        slow = _smooth(near / (turn / 2)) - _smooth((near - 1.5 * turn) / (turn / 2))
        v = self.speed * (1 - 0.3 * slow)
        rate_t, rate_phase = 1 / v, 1 / stride_length(v, self.body.height, self.pattern)
        step = np.diff(many)
        t = np.concatenate([[0.0], np.cumsum(step * (rate_t[1:] + rate_t[:-1]) / 2)])
        phase = np.concatenate([[0.0], np.cumsum(step * (rate_phase[1:] + rate_phase[:-1]) / 2)])
        here = np.searchsorted(many, self.start)
        t, phase = t - t[here], phase - np.floor(phase[here])
        if t[-1] < self.until or t[0] > -1.0:
            raise ValueError("the walk is shorter than `until`")
        return CubicSpline(many, place), CubicSpline(t, many), CubicSpline(t, phase), CubicSpline(phase, many)

    @cached_property
    def _angles(self) -> tuple[Curve, Curve, Curve]:
        return _cycle(self.pattern.hip), _cycle(self.pattern.knee), _cycle(self.pattern.ankle)

    def _behind(self, side: int) -> float:
        """How much later than the left one this foot comes down, share of the cycle."""
        return 0.0 if side > 0 else self.pattern.second

    def _foot_angle(self, phase: Floats) -> Floats:
        """Angle of the sole to the floor (rad, toes up positive): the published angles, flat where they nearly are."""
        hip, knee, ankle = (curve(np.mod(phase, 1.0)) for curve in self._angles)
        return _dead_zone(hip - knee + ankle + LIFT / 2, 2 * LIFT)

    def _pelvis(self, phase: Floats, height: Curve) -> tuple[Floats, Floats, Floats]:
        """Middle of the hips (T, 3), pelvis axes (T, 3, 3) and heading (T,) at phases of the left leg.

        `height` (m) is a function of the phase.
        """
        place, _, _, s_of = self._tables
        s = s_of(phase)
        x, y, heading = np.moveaxis(place(s), -1, 0)
        H, turn = self.body.height, 2 * np.pi
        sway = self.pattern.sway * H * np.cos(turn * (phase - 0.31))
        centre = np.stack([x - sway * np.sin(heading), y + sway * np.cos(heading), height(phase)], axis=-1)
        yaw = heading - np.deg2rad(self.pattern.hips_turn) * np.cos(turn * phase)
        return centre, _axes(yaw, 0.0, np.deg2rad(self.pattern.hips_drop) * np.cos(turn * (phase - 0.14))), heading

    def _footprint(self, cycle: Floats, side: int) -> tuple[Floats, Floats]:
        """Place of the flat foot's ankle (T, 3) and its yaw (T,); `cycle` counts the leg's heel contacts."""
        place, _, _, s_of = self._tables
        phase = cycle + self._behind(side)
        x, y, yaw = np.moveaxis(place(s_of(phase + self.pattern.midstance)), -1, 0)
        out = side * self.pattern.feet_apart * self.body.height
        ankle = np.stack([x - out * np.sin(yaw), y + out * np.cos(yaw), np.full_like(x, self.body.ankle_height)], -1)
        return ankle, yaw + side * np.deg2rad(self.pattern.feet_out)

    def _stance(self, phase: Floats, cycle: Floats, side: int) -> Floats:
        """Ankle (T, 3) of the foot that stands on footprint `cycle`; `phase` of that leg."""
        flat, yaw = self._footprint(cycle, side)
        angle = self._foot_angle(phase)
        pivot = np.where((angle > 0)[..., None], self.body.heel, self.body.ball)
        c, s = np.cos(angle), np.sin(angle)
        dx = pivot[..., 0] - (c * pivot[..., 0] - s * pivot[..., 1])
        dz = pivot[..., 1] - (s * pivot[..., 0] + c * pivot[..., 1])
        return flat + np.stack([dx * np.cos(yaw), dx * np.sin(yaw), dz], axis=-1)

    def _free(self, phase: Floats, side: int, height: Curve) -> Floats:
        """Ankle (T, 3) as the published joint angles alone give it; `phase` of that leg."""
        centre, axes, heading = self._pelvis(phase + self._behind(side), height)
        hip = centre + axes @ np.array([0.0, side * self.body.half_hips, 0.0])
        h, k, _ = (curve(np.mod(phase, 1.0)) for curve in self._angles)
        forward = self.body.thigh * np.sin(h) + self.body.shank * np.sin(h - k)
        down = self.body.thigh * np.cos(h) + self.body.shank * np.cos(h - k)
        return hip + np.stack([forward * np.cos(heading), forward * np.sin(heading), -down], axis=-1)

    def _ankle(self, phase: Floats, side: int, height: Curve) -> tuple[Floats, Floats, Floats]:
        """Ankle (T, 3), foot yaw (T,) and foot angle (T,) of a leg at its own phases."""
        cycle = np.floor(phase)
        u = phase - cycle
        standing = self._stance(phase, cycle, side)

        def bend(at: Floats, footprint: Floats) -> tuple[Floats, Floats, Floats]:
            """How far the footprint's ankle lies from the free one: value and two derivatives over the phase."""
            h = 0.004
            before, here, after = (
                self._stance(at + d, footprint, side) - self._free(at + d, side, height) for d in (-h, 0.0, h)
            )
            return here, (after - before) / (2 * h), (after - 2 * here + before) / h**2

        toe_off = self.pattern.toe_off
        w = np.clip((u - toe_off) / (1 - toe_off), 0.0, 1.0)
        change = _quintic(w[..., None], 1 - toe_off, bend(cycle + toe_off, cycle), bend(cycle + 1.0, cycle + 1.0))
        swinging = self._free(phase, side, height) + change
        angle = self._foot_angle(phase)
        # never through the floor: a smooth maximum with the height at which the lower of heel and ball touches it
        c, s = np.cos(angle), np.sin(angle)
        floor = np.maximum(*(-(s * p[0] + c * p[1]) for p in (self.body.heel, self.body.ball)))
        bump = (4 * w * (1 - w)) ** 2
        above = swinging[..., 2] - floor - self.pattern.clearance * bump
        swinging[..., 2] += (np.sqrt(above**2 + (0.03 * bump) ** 2) - above) / 2 * (bump > 0)
        ankle = np.where((u < toe_off)[..., None], standing, swinging)
        yaw0, yaw1 = self._footprint(cycle, side)[1], self._footprint(cycle + 1, side)[1]
        return ankle, yaw0 + (yaw1 - yaw0) * _smooth(w), angle

    @cached_property
    def _height(self) -> Curve:
        """Height of the pelvis (m) over the phase: as high as the legs reach, smoothed from below.

        The body vaults over the standing leg; a bone is never stretched, in the turns either.
        """
        from scipy.interpolate import CubicSpline

        _, _, phase_of, _ = self._tables
        ends = phase_of([-1.0, self.until])
        phase = np.arange(ends[0], ends[1] + 0.005, 0.005)
        legs = self.body.thigh + self.body.shank
        flat = 0.52 * self.body.height * self.body.long_legs
        height = CubicSpline(phase[[0, 1, 2, -1]], [flat] * 4)
        for _ in range(4):
            limit = self._at_most(phase)
            for side in (1, -1):
                centre, axes, _ = self._pelvis(phase, height)
                hip = axes @ np.array([0.0, side * self.body.half_hips, 0.0])
                ankle = self._ankle(phase - self._behind(side), side, height)[0]
                away2 = ((centre + hip - ankle)[..., :2] ** 2).sum(axis=-1)
                reach = np.sqrt(np.maximum((STRETCH * legs) ** 2 - away2, 0.0))
                limit = np.minimum(limit, ankle[..., 2] + reach - hip[..., 2])
            height = CubicSpline(phase, _from_below(limit, SMOOTH))
        return height

    def _at_most(self, phase: Floats) -> Floats:
        """Height of the pelvis (m) that the gait would like: lowest at each leg's midstance, two times per cycle."""
        dip = self.pattern.bounce * (1 + np.cos(4 * np.pi * (phase - self.pattern.midstance))) / 2
        return (self.pattern.height - dip) * self.body.height * self.body.long_legs

    @cached_property
    def contacts(self) -> "Contacts":
        """When each foot touches the floor and when it leaves it, from how it is planted."""
        _, _, phase_of, _ = self._tables
        t = np.arange(-1.0, self.until, 0.001)
        rows: list[tuple[float, int, bool, float, float]] = []
        for number, side in enumerate((1, -1)):
            phase = phase_of(t) - self._behind(side)
            cycles = np.arange(np.floor(phase[0]), np.ceil(phase[-1]) + 1)
            flat, yaw = self._footprint(cycles, side)
            heel = flat[:, :2] + self.body.heel[0] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
            for strike, after in ((True, -self.pattern.lands), (False, self.pattern.toe_off + self.pattern.rolls)):
                inside = (cycles + after >= phase[0]) & (cycles + after <= phase[-1])
                when = np.interp(cycles[inside] + after, phase, t)
                rows += [
                    (s, number, strike, x, y) for s, (x, y) in zip(when.tolist(), heel[inside].tolist(), strict=True)
                ]
        table = np.array(sorted(rows))
        return Contacts(table[:, 0], table[:, 1].astype(int), table[:, 2] > 0, table[:, 3:])

    def segments(self, t: Floats) -> Segments:
        """Origin (T, 3) and axes (T, 3, 3) of every segment at times `t` (T,), s; see `body.landmarks`."""
        _, _, phase_of, _ = self._tables
        body, t = self.body, np.asarray(t, float)
        phase = phase_of(t)
        turn = 2 * np.pi * phase
        centre, pelvis, heading = self._pelvis(phase, self._height)
        found = {"pelvis": (centre, pelvis)}
        chest_axes = _axes(heading + np.deg2rad(self.pattern.chest_turn) * np.cos(turn), np.deg2rad(-self.pattern.lean))
        shoulders = centre + chest_axes @ np.array([0.0, 0.0, body.trunk])
        found["chest"] = (shoulders, chest_axes)
        head_axes = _axes(heading)
        found["head"] = (shoulders + head_axes @ np.array([body.part(0.012), 0.0, body.part(0.118)]), head_axes)
        for name, side in (("left", 1), ("right", -1)):
            found |= self._leg(name, side, phase - self._behind(side), centre, pelvis)
            found |= self._arm(name, side, turn if side > 0 else turn - np.pi, shoulders, chest_axes)
        return found

    def angles(self, t: Floats) -> dict[str, Floats]:
        """Joint angles (T,) in degrees at times `t` (T,), s, by the names and signs of OpenSim's gait models.

        Of the pelvis in the world by rotation, list and tilt; the others by flexion, adduction and rotation about axes
        of the joint, 0 where the segments' axes are parallel. A knee is a hinge; of an ankle the third is not told.
        """
        from scipy.spatial.transform import Rotation

        # forward, up, right
        to = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        axes = {name: Rotation.from_matrix(to @ one[1] @ to.T) for name, one in self.segments(t).items()}
        yaw, list_, tilt = axes["pelvis"].as_euler("YXZ", degrees=True).T
        found = {"pelvis_rotation": np.unwrap(yaw, period=360), "pelvis_list": list_, "pelvis_tilt": tilt}

        def between(above: str, below: str, order: str) -> Floats:
            turn = axes[above].inv() * axes[below]
            return np.asarray(turn.as_euler(order, degrees=True).T)

        lumbar = between("pelvis", "chest", "ZXY")
        found |= {f"lumbar_{what}": a for what, a in zip(("extension", "bending", "rotation"), lumbar, strict=True)}
        for side, end, sign in (("right", "r", 1), ("left", "l", -1)):
            flexion, adduction, rotation = between("pelvis", f"{side}_thigh", "ZXY")
            found |= {
                f"hip_flexion_{end}": flexion,
                f"hip_adduction_{end}": sign * adduction,
                f"hip_rotation_{end}": sign * rotation,
                f"knee_angle_{end}": -between(f"{side}_thigh", f"{side}_shank", "ZXY")[0],
            }
            dorsiflexion, turned, _ = between(f"{side}_shank", f"{side}_foot", "ZYX")
            found |= {f"ankle_angle_{end}": dorsiflexion, f"ankle_rotation_{end}": sign * turned}
        return found

    def _leg(self, name: str, side: int, phase: Floats, centre: Floats, pelvis: Floats) -> Segments:
        body = self.body
        hip = centre + pelvis @ np.array([0.0, side * body.half_hips, 0.0])
        ankle, yaw, angle = self._ankle(phase, side, self._height)
        foot = _axes(yaw, angle)
        front = _axes(yaw)[..., 0] + pelvis[..., 0]
        reach = ankle - hip
        distance = np.linalg.norm(reach, axis=-1, keepdims=True)
        along = reach / distance
        front = front - (front * along).sum(axis=-1, keepdims=True) * along
        front /= np.linalg.norm(front, axis=-1, keepdims=True)
        a = (distance**2 + body.thigh**2 - body.shank**2) / (2 * distance)
        knee = hip + a * along + np.sqrt(np.maximum(body.thigh**2 - a**2, 0.0)) * front
        return {
            f"{name}_thigh": (hip, _frame_along(knee - hip, front)),
            f"{name}_shank": (knee, _frame_along(ankle - knee, front)),
            f"{name}_foot": (ankle, foot),
        }

    def _arm(self, name: str, side: int, turn: Floats, shoulders: Floats, chest: Floats) -> Segments:
        """Arm swing, against the leg of the same side."""
        body, (shoulder_at, shoulder_by, elbow_at, elbow_by) = self.body, self.pattern.arm
        shoulder = shoulders + chest @ np.array([0.0, side * body.half_shoulders, 0.0])
        flexion = np.deg2rad(shoulder_at - shoulder_by * np.cos(turn))
        elbow_flexion = np.deg2rad(elbow_at - elbow_by * np.cos(turn))
        out = side * np.deg2rad(7.0)

        def limb(angle: Floats) -> Floats:
            local = np.stack([np.sin(angle), np.full_like(angle, np.sin(out)), -np.cos(angle) * np.cos(out)], axis=-1)
            local /= np.linalg.norm(local, axis=-1, keepdims=True)
            return (chest @ local[..., None])[..., 0]

        upper, lower = limb(flexion), limb(flexion + elbow_flexion)
        elbow = shoulder + body.upper_arm * upper
        wrist = elbow + body.forearm * lower
        front = chest[..., 0]
        return {
            f"{name}_upper_arm": (shoulder, _frame_along(upper, front)),
            f"{name}_forearm": (elbow, _frame_along(lower, front)),
            f"{name}_hand": (wrist, _frame_along(limb(flexion + elbow_flexion + 0.1), front)),
        }


def middle_integral(yaw: Curve, s: Floats, ds: float, function: Curve) -> Floats:
    """Integral of `function(yaw(s))` from the first of `s` to each (Simpson's rule between neighbours)."""
    half = function(yaw(s[:-1] + ds / 2))
    ends = function(yaw(s))
    return np.concatenate([[0.0], np.cumsum(ds * (ends[:-1] + 4 * half + ends[1:]) / 6)])
