"""What is a person's own in a walk: proportions of the body and dynamics of the gait, from the 3D skeleton.

INPUTS   COCO-17 joints (T, 17, 3) m, world Z up, NaN where missing; their covariances where known; instants per second
OUTPUTS  a vector of FEATURES with a standard error each
Lengths enter as logarithms: the mean of all is the body's size, the rest are proportions, which know no scale. The
gait is taken where the person walks straight on; angles are expanded in harmonics of the stride (left and right
together, the right half a stride later), so that a walk's beginning and its length do not matter.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats, runs_of
from dior.body.names import COCO_17
from dior.reid.inputs import filled

AT = {name: i for i, name in enumerate(COCO_17)}
# bones with two sides count once, by their mean
BONES = {
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "trunk": ("hip", "shoulder"),
}
BREADTHS = {"hips": "hip", "shoulders": "shoulder", "ears": "ear"}
LENGTHS = (*BONES, *BREADTHS)
# angle: its harmonics of the stride, of a side's own phase or of the left leg's
SIDED = {"hip": 3, "knee": 3, "shoulder": 2, "elbow": 2, "abduction": 1, "leg_drop": 2}
MIDDLE = {"lean": 2, "bend": 1, "hips_turn": 1, "hips_tilt": 1, "chest_turn": 1, "rise": 2, "sway": 1, "step_width": 0}
GRAVITY = 9.81  # m/s^2
# strides per second that are tried; chosen: from a slow old walk to a run
STRIDES_HZ = np.arange(0.55, 1.85, 0.01)
# the path of the hips is smoothed over this, s; chosen: about half a stride, so that the sway of a step goes
SMOOTH_S = 0.6
# straight on: turning less than this, and faster than this share of the usual speed; chosen
TURN_RAD_S, SLOW = 0.5, 0.6
# gaps of the hips across which the path is interpolated, s; no other joint is (chosen: half a stride)
WAY_GAP_S = 0.5
# a straight part and all of them together last at least, s; chosen: a step, and two strides
STRETCH_S, LEAST_S = 0.7, 2.0
# correlation time of the joints' errors: so many seconds of a walk count as one measurement (chosen)
LASTS_S = 0.3
# standard error of the phase at either end of a walk, as a share of a stride; chosen: one and a half pictures at 30 Hz
PHASE_SHARE = 0.05


def _columns() -> Iterator[str]:
    yield "size"
    yield from (f"{name}_share" for name in LENGTHS)
    yield from ("cadence", "stride")
    for angles in (SIDED, MIDDLE):
        for name, most in angles.items():
            yield f"{name}_0"
            yield from (f"{name}_{part}{k}" for k in range(1, most + 1) for part in ("cos", "sin"))


FEATURES = tuple(_columns())


@dataclass(frozen=True, eq=False)
class Gait:
    """`values` and standard errors `sigma` (D,) of FEATURES. Logarithms, radians, shares of the leg's length."""

    values: Floats
    sigma: Floats


def measure(points: Floats, covariance: Floats, fps: float) -> tuple[Gait | None, str]:
    """`Gait` of a walk and "", or None and why there is none.

    `covariance` (T, 17, 3, 3) m^2, NaN where not known.
    """
    lengths, own = _lengths(points, covariance)
    if not np.isfinite(lengths).all():
        lacks = [name for name, value in zip(LENGTHS, lengths, strict=True) if not np.isfinite(value)]
        return None, f"the 3D has no {' and no '.join(lacks)}"
    leg = np.exp(lengths[LENGTHS.index("thigh")]) + np.exp(lengths[LENGTHS.index("shank")])
    heading, speed, straight = _heading(points, fps)
    stretches = _stretches(straight, fps)
    if sum(b - a for a, b in stretches) < LEAST_S * fps:
        return None, f"less than {LEAST_S:g} s of straight walking in a row of {STRETCH_S:g} s and more"
    apart = _along(points[:, AT["left_ankle"]] - points[:, AT["right_ankle"]], heading[0])
    strides = _strides(apart, stretches, fps)
    if strides is None:
        return None, "no strides found in it"
    rate, phase = strides
    size = lengths.mean()
    pace = np.nanmean(np.concatenate([speed[a:b] for a, b in stretches]))
    values = [size, *(lengths - size)]
    sigma = [np.sqrt((own**2).mean() / len(own)), *own]
    seconds = sum(b - a for a, b in stretches) / fps
    values += [np.log(rate * np.sqrt(leg / GRAVITY)), np.log(max(pace, 1e-3) / rate / leg)]
    sigma += [PHASE_SHARE / (seconds * rate)] * 2
    for k, (_, most) in enumerate([*SIDED.items(), *MIDDLE.items()]):
        found, error = _harmonics(_angles(points, heading, leg, k), phase, most, fps)
        values += list(found)
        sigma += list(error)
    gait = Gait(np.array(values), np.array(sigma))
    if not np.isfinite(gait.values).all():
        return None, f"{FEATURES[int(np.flatnonzero(~np.isfinite(gait.values))[0])]} cannot be told from its 3D"
    return gait, ""


def _lengths(points: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Logarithms (L,) of the median lengths of LENGTHS and their standard errors, of errors that do not average out."""
    pairs = [[(AT[f"{side}_{a}"], AT[f"{side}_{b}"]) for side in ("left", "right")] for a, b in BONES.values()]
    pairs += [[(AT[f"left_{joint}"], AT[f"right_{joint}"])] for joint in BREADTHS.values()]
    values, sigma = [], []
    for sides in pairs:
        length, variance = [], []
        for a, b in sides:
            d = points[:, b] - points[:, a]
            each = np.linalg.norm(d, axis=-1)
            known = np.isfinite(each)
            if known.sum() < 2:
                length.append(np.nan)
                continue
            length.append(np.median(each[known]))
            n = d[known] / each[known, None]
            spread = np.einsum("ti,tij,tj->t", n, covariance[known, a] + covariance[known, b], n)
            spread = spread[np.isfinite(spread)]
            variance.append(
                np.median(spread) if len(spread) else (np.subtract(*np.percentile(each[known], [75, 25]))) ** 2
            )
        values.append(np.log(np.mean(length)))
        sigma.append(np.sqrt(np.mean(variance) / len(sides)) / np.mean(length) if variance else np.nan)
    return np.array(values), np.array(sigma)


def _heading(points: Floats, fps: float) -> tuple[Floats, Floats, Bools]:
    """Axes forward and left (2, T, 3), horizontal, of the way; speed (T,) m/s; whether straight on (T,)."""
    hips = (points[:, AT["left_hip"]] + points[:, AT["right_hip"]]) / 2
    way = filled(hips[:, None, :2], int(WAY_GAP_S * fps))[:, 0]
    way = _smoothed(way, max(int(SMOOTH_S * fps) // 2, 1))
    velocity = np.gradient(way, 1 / fps, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    angle = np.arctan2(velocity[:, 1], velocity[:, 0])
    before, after = np.roll(angle, 1), np.roll(angle, -1)
    turn = np.angle(np.exp(1j * (after - before))) * fps / 2
    turn[[0, -1]] = np.nan
    usual = np.nanpercentile(speed, 75) if np.isfinite(speed).any() else np.nan
    with np.errstate(invalid="ignore"):
        straight = (np.abs(turn) < TURN_RAD_S) & (speed > SLOW * usual)
    zero = np.zeros_like(angle)
    forward = np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)
    left = np.stack([-np.sin(angle), np.cos(angle), zero], axis=-1)
    return np.stack([forward, left]), speed, straight


def _smoothed(values: Floats, half: int) -> Floats:
    """Mean over 2 half + 1 rows, twice; NaN where one of them is."""
    kernel = np.convolve(np.ones(2 * half + 1), np.ones(2 * half + 1))
    kernel /= kernel.sum()
    out = np.full(values.shape, np.nan)
    if len(values) >= len(kernel):
        edge = len(kernel) // 2
        for i in range(values.shape[1]):
            out[edge : len(values) - edge, i] = np.convolve(values[:, i], kernel, "valid")
    return out


def _stretches(straight: Bools, fps: float) -> list[tuple[int, int]]:
    """Begin and end of the runs of `straight` of at least STRETCH_S."""
    return [(a, b) for a, b in runs_of(straight).tolist() if b - a >= STRETCH_S * fps]


def _along(vectors: Floats, axis: Floats) -> Floats:
    return (vectors * axis).sum(axis=-1)


def _strides(apart: Floats, stretches: list[tuple[int, int]], fps: float) -> tuple[float, Floats] | None:
    """Strides per second and the phase (T,) of the left leg, rad, NaN outside of the stretches.

    The rate under which a sine in each stretch explains best how far the left ankle is ahead of the right (T,); the
    phase is 0 where it is furthest. None where no rate fits better than its neighbours.
    """

    def fit(rate: float) -> tuple[float, dict[tuple[int, int], float]]:
        lost, phases = 0.0, {}
        for a, b in stretches:
            t = np.arange(a, b) / fps
            known = np.isfinite(apart[a:b])
            if known.sum() < 5:
                continue
            turn = 2 * np.pi * rate * t[known]
            design = np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)], axis=1)
            found, *_ = np.linalg.lstsq(design, apart[a:b][known], rcond=None)
            lost += ((apart[a:b][known] - design @ found) ** 2).sum()
            phases[a, b] = np.arctan2(found[2], found[1])
        return lost, phases

    each = np.array([fit(rate)[0] for rate in STRIDES_HZ])
    best = int(each.argmin())
    if best in (0, len(STRIDES_HZ) - 1) or not each[best] > 0:
        return None
    y0, y1, y2 = each[best - 1 : best + 2]
    rate = STRIDES_HZ[best] + (STRIDES_HZ[1] - STRIDES_HZ[0]) * 0.5 * (y0 - y2) / (y0 - 2 * y1 + y2)
    phase = np.full(len(apart), np.nan)
    for (a, b), start in fit(rate)[1].items():
        phase[a:b] = 2 * np.pi * rate * np.arange(a, b) / fps - start
    return float(rate), phase


def _angles(points: Floats, heading: Floats, leg: float, which: int) -> list[tuple[Floats, float]]:
    """The angle number `which` of SIDED and MIDDLE: a list of (values (T,), phase ahead of the left leg's)."""
    forward, left = heading
    up = np.array([0.0, 0.0, 1.0])

    def at(name: str) -> Floats:
        return points[:, AT[name]]

    def swing(side: str, a: str, b: str) -> Floats:
        d = at(f"{side}_{b}") - at(f"{side}_{a}")
        return np.arctan2(_along(d, forward), -d[:, 2])

    def bent(side: str, a: str, b: str, c: str) -> Floats:
        one, two = at(f"{side}_{b}") - at(f"{side}_{a}"), at(f"{side}_{c}") - at(f"{side}_{b}")
        cosine = _along(one, two) / np.linalg.norm(one, axis=-1) / np.linalg.norm(two, axis=-1)
        return np.arccos(np.clip(cosine, -1, 1))

    def side_of(side: str) -> dict[str, Callable[[], Floats]]:
        sign = 1.0 if side == "left" else -1.0
        whole = at(f"{side}_ankle") - at(f"{side}_hip")
        return {
            "hip": lambda: swing(side, "hip", "knee"),
            "knee": lambda: bent(side, "hip", "knee", "ankle"),
            "shoulder": lambda: swing(side, "shoulder", "elbow"),
            "elbow": lambda: bent(side, "shoulder", "elbow", "wrist"),
            "abduction": lambda: sign * _along(whole, left) / leg,
            "leg_drop": lambda: -whole[:, 2] / leg,
        }

    sided = list(SIDED)
    if which < len(sided):
        return [(side_of(side)[sided[which]](), ahead) for side, ahead in (("left", 0.0), ("right", np.pi))]
    hips, shoulders = at("left_hip") - at("right_hip"), at("left_shoulder") - at("right_shoulder")
    pelvis, chest = (at("left_hip") + at("right_hip")) / 2, (at("left_shoulder") + at("right_shoulder")) / 2
    ankles, trunk = (at("left_ankle") + at("right_ankle")) / 2, chest - pelvis
    values = {
        "lean": np.arctan2(_along(trunk, forward), trunk[:, 2]),
        "bend": np.arctan2(_along(trunk, left), trunk[:, 2]),
        "hips_turn": np.arctan2(-_along(hips, forward), _along(hips, left)),
        "hips_tilt": np.arctan2(hips @ up, _along(hips, left)),
        "chest_turn": np.arctan2(-_along(shoulders, forward), _along(shoulders, left)),
        "rise": (pelvis - ankles)[:, 2] / leg,
        "sway": _along(pelvis - ankles, left) / leg,
        "step_width": _along(at("left_ankle") - at("right_ankle"), left) / leg,
    }
    return [(values[list(MIDDLE)[which - len(sided)]], 0.0)]


def _harmonics(angles: list[tuple[Floats, float]], phase: Floats, most: int, fps: float) -> tuple[Floats, Floats]:
    """Coefficients (1 + 2 most,) of 1, cos, sin, cos 2, ... of the phase, and their standard errors."""
    parts, designs = [], []
    for value, ahead in angles:
        known = np.isfinite(value) & np.isfinite(phase)
        turn = phase[known] + ahead
        columns = [np.ones_like(turn)]
        for k in range(1, most + 1):
            columns += [np.cos(k * turn), np.sin(k * turn)]
        designs.append(np.stack(columns, axis=1))
        parts.append(value[known])
    design, values = np.concatenate(designs), np.concatenate(parts)
    if len(values) < 4 * design.shape[1]:
        return np.full(design.shape[1], np.nan), np.full(design.shape[1], np.nan)
    found = np.asarray(np.linalg.lstsq(design, values, rcond=None)[0], float)
    rest = values - design @ found
    effective = max(len(values) / (LASTS_S * fps), 1.0)
    scale = np.linalg.inv(design.T @ design / len(values)).diagonal()
    return found, np.sqrt(scale * rest.var() / effective)
