"""Whose walk is recorded: the parametric walker, or the markers of a real C3D; both are evaluable at any time.

OUTPUTS: `Motion.at(t)`: landmarks (T, 33, 3) and markers (T, M, 3), m, world with Z up.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.names import MLKIT_33, PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.simulate import body as bodies
from dior.simulate.gait import Contacts, Walker
from dior.simulate.patterns import RUN, WALK, of_person
from dior.simulate.settings import Sequence, Settings, generator, motion_path, person
from dior.simulate.soft_tissue import movement

# chosen: the cameras run on for a while after the trigger's delay, and their clocks differ
AFTER_DELAY_S = 0.05
RUNNING = 2.1  # chosen: times as fast as walking, a jog of 2.0-2.5 m/s
C3D_STRIDE_HZ = 0.9  # chosen: strides per second of a natural walk
# chosen: m, of `Walker`; a runner needs a longer loop with wider turns, and every loop lies in view of every camera
LOOPS: dict[str, dict[str, Any]] = {
    "running": {"half_length": 1.25, "turn_radius": 0.8},
    "straight": {"half_length": 2.2},
    "circling": {"half_length": 0.1, "turn_radius": 1.2},
}


@dataclass(frozen=True)
class Motion:
    """A walk. `names` of the markers; `at(t)` gives landmarks and markers, `seen(t)` (T, M) where a marker was seen;
    `contacts` of the feet with the floor and joint `angles(t)` (T,) in degrees, None where nobody knows them."""

    names: tuple[str, ...]
    height: float
    at: Callable[[Floats], tuple[Floats, Floats]]
    seen: Callable[[Floats], Bools]
    lasts_s: float = np.inf
    contacts: Contacts | None = None
    angles: Callable[[Floats], dict[str, Floats]] | None = None


def mocap_lasts(settings: Settings) -> float:
    """Length of the motion capture, s: the recording and a little more, since the cameras start later."""
    return settings.duration_s + settings.clocks.start_delay_s[1] + settings.clocks.apart_s + AFTER_DELAY_S


@lru_cache(maxsize=16)
def motion_of(settings: Settings, sequence: Sequence) -> Motion:
    """The motion of a sequence, soft tissue included. Raises DiorError where a C3D is shorter than the recording."""
    motion, stride_hz = _motion(settings, sequence)
    if not settings.soft_tissue_mm[1]:
        return motion
    random = generator(settings, "soft tissue", sequence.name)
    low, high = settings.soft_tissue_mm
    slip = movement(random, len(motion.names), (low / 1000, high / 1000), stride_hz)

    def at(t: Floats) -> tuple[Floats, Floats]:
        landmarks, markers = motion.at(t)
        return landmarks, markers + slip(t)

    return replace(motion, at=at)


def _motion(settings: Settings, sequence: Sequence) -> tuple[Motion, float]:
    """The motion without soft tissue, and its strides per second."""
    path = motion_path(settings)
    if path:
        motion = from_c3d(path)
        needed = mocap_lasts(settings)
        if motion.lasts_s < needed:
            raise DiorError(
                f"simulate.motion: {path.name} lasts {motion.lasts_s:.2f} s; set simulate.duration_s to at most "
                f"{motion.lasts_s - (needed - settings.duration_s):.2f}"
            )
        return motion, C3D_STRIDE_HZ
    body = bodies.body_of(settings, sequence.subject)
    who = person(settings, sequence.subject)
    draw = generator(settings, "walk", sequence.name)
    speed = generator(settings, "speed", who).uniform(1.0, 1.15) * draw.uniform(0.97, 1.03)
    running = sequence.walk == "running"
    pattern, speed = (RUN, RUNNING * speed) if running else (WALK, speed)
    if settings.people == "different":
        pattern = of_person(pattern, generator(settings, "gait", who))
    direction = (np.pi / 2 if sequence.walk == "along" else 0.0) + np.deg2rad(draw.uniform(-4, 4))
    walker = Walker(
        body,
        pattern,
        speed=float(speed),
        direction=float(direction),
        start=float(draw.uniform(0.0, 8.0)),
        until=settings.duration_s + 2.0,
        **LOOPS.get(sequence.walk, {}),
    )
    motion = Motion(
        PLUG_IN_GAIT_39,
        body.height,
        walker.at,
        lambda t: np.ones((len(t), len(PLUG_IN_GAIT_39)), bool),
        contacts=walker.contacts,
        angles=walker.angles,
    )
    return motion, float(pattern.strides(speed, body.height) * pattern.quickness)


def from_c3d(path: Path) -> Motion:
    """The walk of a real C3D with Plug-in-Gait markers, centred on the walkway; gaps are filled; `seen` says where.

    Raises DiorError as `mocap.read`, and where a marker is missing that the body needs.
    """
    from scipy.interpolate import CubicSpline

    from dior.ingest import mocap

    recorded = mocap.read(path)
    names, xyz = recorded.markers, recorded.points
    missing = [name for name in NEEDED if name not in names]
    if missing:
        raise DiorError(f"simulate.motion: {path} has no marker {', '.join(missing)}")
    seen: Bools = np.asarray(np.isfinite(xyz).all(axis=-1))
    xyz = _filled(xyz, seen)
    middle = (xyz.max(axis=(0, 1)) + xyz.min(axis=(0, 1))) / 2
    xyz = xyz - (middle[0], middle[1], 0.0)
    ticks = np.arange(len(xyz)) / recorded.rate
    curve = CubicSpline(ticks, xyz, axis=0)

    def at(t: Floats) -> tuple[Floats, Floats]:
        found = curve(np.clip(t, 0.0, ticks[-1]))
        return landmarks_of(found, names), found

    def seen_at(t: Floats) -> Bools:
        before = np.clip(np.searchsorted(ticks, t + 1e-9, side="right") - 1, 0, len(ticks) - 1)
        after = np.minimum(before + (np.abs(ticks[before] - t) > 1e-6), len(ticks) - 1)
        return seen[before] & seen[after]

    top = np.mean([xyz[:, names.index(n), 2].mean() for n in ("LFHD", "RFHD", "LBHD", "RBHD")])
    return Motion(names, float(top) * 1.05, at, seen_at, float(ticks[-1]))


NEEDED = (
    "LFHD RFHD LBHD RBHD C7 CLAV LSHO RSHO LELB RELB LWRA LWRB RWRA RWRB LFIN RFIN LASI RASI LPSI RPSI LKNE RKNE LANK "
    "RANK LHEE RHEE LTOE RTOE"
).split()


def _filled(xyz: Floats, seen: Bools) -> Floats:
    """Gaps (T, M, 3) filled by the marker's place relative to the markers without any gap."""
    whole = seen.all(axis=0)
    middle = xyz[:, whole].mean(axis=1)
    rows = np.arange(len(xyz))
    out = xyz.copy()
    for m in np.flatnonzero(~whole & seen.any(axis=0)):
        good = seen[:, m]
        for axis in range(3):
            own = xyz[good, m, axis] - middle[good, axis]
            out[~good, m, axis] = (np.interp(rows, rows[good], own) + middle[:, axis])[~good]
    return out


def _unit(v: Floats) -> Floats:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def landmarks_of(markers: Floats, names: tuple[str, ...]) -> Floats:
    """Landmarks (T, 33, 3) from Plug-in-Gait markers (T, M, 3), m.

    Joint centres by the rules that need no anthropometry: hips by Bell and Brand from the ASIS distance, knees, ankles
    and elbows half a joint width (105, 72, 75 mm, Vicon's usual values) and a marker radius towards the body's middle,
    shoulders a sixth of the shoulder width below SHO, the face from the head markers.
    """
    m = {name: markers[:, i] for i, name in enumerate(names)}
    p = {}
    origin, W = (m["LASI"] + m["RASI"]) / 2, np.linalg.norm(m["LASI"] - m["RASI"], axis=-1, keepdims=True)
    sacrum = (m["LPSI"] + m["RPSI"]) / 2
    left = _unit(m["LASI"] - origin)
    up = _unit(np.cross(left, sacrum - origin))
    forward = np.cross(left, up)
    down = _unit((m["LASI"] + m["RASI"]) / 2 - (m["LSHO"] + m["RSHO"]) / 2)
    width = np.linalg.norm(m["LSHO"] - m["RSHO"], axis=-1, keepdims=True)
    front, back = (m["LFHD"] + m["RFHD"]) / 2, (m["LBHD"] + m["RBHD"]) / 2
    X = _unit(front - back)
    Y = m["LFHD"] + m["LBHD"] - m["RFHD"] - m["RBHD"]
    Y = _unit(Y - (Y * X).sum(axis=-1, keepdims=True) * X)
    Z, s = np.cross(X, Y), np.linalg.norm(front - back, axis=-1, keepdims=True) / 0.19
    p["nose"] = front + s * (0.050 * X - 0.085 * Z)
    for side, L, sign in (("left", "L", 1), ("right", "R", -1)):
        for name, out in (("eye_inner", 0.018), ("eye", 0.032), ("eye_outer", 0.045)):
            p[f"{side}_{name}"] = front + s * (0.025 * X + sign * out * Y - 0.045 * Z)
        p[f"{side}_ear"] = (m[f"{L}FHD"] + m[f"{L}BHD"]) / 2 - s * 0.050 * Z
        p[f"{side}_mouth"] = front + s * (0.030 * X + sign * 0.025 * Y - 0.125 * Z)
        hip = p[f"{side}_hip"] = origin - 0.19 * W * forward - 0.30 * W * up + sign * 0.36 * W * left
        shoulder = p[f"{side}_shoulder"] = m[f"{L}SHO"] + 0.17 * width * down
        wrist = p[f"{side}_wrist"] = (m[f"{L}WRA"] + m[f"{L}WRB"]) / 2

        def inwards(marker: Floats, towards: Floats, half_width: float, inner: Floats = -sign * left) -> Floats:
            along = _unit(towards - marker)
            across = _unit(inner - (inner * along).sum(axis=-1, keepdims=True) * along)
            return marker + (half_width + bodies.MARKER_RADIUS_M) * across

        knee = p[f"{side}_knee"] = inwards(m[f"{L}KNE"], hip, 0.0525)
        p[f"{side}_ankle"] = inwards(m[f"{L}ANK"], knee, 0.036)
        p[f"{side}_elbow"] = inwards(m[f"{L}ELB"], shoulder, 0.0375)
        thumb = _unit(m[f"{L}WRA"] - m[f"{L}WRB"])
        fingers = m[f"{L}FIN"] - wrist
        p[f"{side}_index"] = wrist + 1.05 * fingers + 0.02 * thumb
        p[f"{side}_pinky"] = wrist + 1.0 * fingers - 0.03 * thumb
        p[f"{side}_thumb"] = wrist + 0.6 * fingers + 0.04 * thumb
        p[f"{side}_heel"] = m[f"{L}HEE"] + 0.012 * _unit(m[f"{L}TOE"] - m[f"{L}HEE"]) - (0.0, 0.0, 0.010)
        p[f"{side}_foot_index"] = m[f"{L}TOE"] + 0.030 * _unit(m[f"{L}TOE"] - m[f"{L}HEE"]) - (0.0, 0.0, 0.015)
    return np.stack([p[name] for name in MLKIT_33], axis=1)
