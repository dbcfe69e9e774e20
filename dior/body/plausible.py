"""Is the reconstructed person possible? Pixels can be right while the world is wrong.

INPUTS   joints of one sequence in the world, points (T, J, 3) m with NaN for missing, their names
OUTPUTS  measured figures, or a DiorError that says which one is impossible, by how much, and what to look at

World in metres, Z up, floor at Z = 0. Vocabulary of adjust and reconstruct. A figure whose joints are missing is NaN
and passes. Limits are the section `physics` of config.yaml.
"""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dior.arrays import Floats
from dior.body.proportions import SEGMENTS, SIDES, SOLE_M
from dior.errors import DiorError

FEET = ("heel", "foot_index", "big_toe")
STANDING_SHARE = 0.25  # of the heights of heels and toes; chosen: a foot stands for 60 % of a stride, its heel for less
HEIGHT_SIGMAS = 4  # chosen: by chance once in 16 000
OTHERS_WALK = (
    "where somebody else walks, too, adjust with a walk, or with pictures of it, where nobody does (`adjust` in "
    "session.yaml)"
)
# chosen: beyond any adult and any child of school age, to catch a wrong scale, floor or vertical and no unusual person
LIMITS: dict[str, Any] = {
    "stature_m": [1.0, 2.2],
    "stature_share": 0.15,
    "feet_m": 0.3,
    "lean_deg": 40.0,
    "speed_m_s": 8.0,
}


class Fault(NamedTuple):
    """What no person in a right world does: its `code`, and the sentence about it."""

    code: str
    text: str


def measured(points: Floats, joints: Sequence[str], seconds: Floats | None = None) -> dict[str, float]:
    """The figures that `LIMITS` judges, by name; `seconds` (T,): when, for the speed."""
    return {
        "stature_m": stature(points, joints),
        "feet_m": feet(points, joints),
        "lean_deg": lean(points, joints),
        "speed_m_s": np.nan if seconds is None else speed(points, joints, seconds),
    }


def faults(found: Mapping[str, float], limits: Mapping[str, Any]) -> list[Fault]:
    """What is impossible in the figures of `measured`, by limits as of `LIMITS`."""
    wrong = []
    low, high = limits["stature_m"]
    if found["stature_m"] < low or found["stature_m"] > high:
        text = (
            f"the person would be {found['stature_m']:.2f} m tall, outside of {low:g}-{high:g} m "
            "(physics.stature_m); the scale is wrong, check the tape, the tag's size_m and other metric facts"
        )
        wrong.append(Fault("stature", text))
    if abs(found["feet_m"]) > limits["feet_m"]:
        side = "above" if found["feet_m"] > 0 else "below"
        text = (
            f"the feet stand {abs(found['feet_m']):.2f} m {side} the floor, more than {limits['feet_m']:g} m "
            "(physics.feet_m); is Z = 0 the floor in tape.position_m and tag.position_m?"
        )
        wrong.append(Fault("floor", text))
    if found["lean_deg"] > limits["lean_deg"]:
        text = (
            f"the body leans by {found['lean_deg']:.0f} degrees on average, more than {limits['lean_deg']:g} "
            "(physics.lean_deg); is Z up, and is tag.up right?"
        )
        wrong.append(Fault("vertical", text))
    if found["speed_m_s"] > limits["speed_m_s"]:
        text = (
            f"the person moves at {found['speed_m_s']:.1f} m/s, more than {limits['speed_m_s']:g} "
            "(physics.speed_m_s); check the scale and the stamps"
        )
        wrong.append(Fault("speed", text))
    return wrong


def check(
    points: Floats,
    joints: Sequence[str],
    where: str,
    limits: dict[str, Any] | None = None,
    seconds: Floats | None = None,
) -> dict[str, float]:
    """Refuse an impossible person, naming the figure; returns the figures by name.

    `limits`: some of `LIMITS`; `seconds` (T,): when, for the speed.
    """
    found = measured(points, joints, seconds)
    for fault in faults(found, LIMITS | (limits or {})):
        raise DiorError(f"{where}: {fault.text}")
    return found


def height_off(height: float, height_m: float, sigma_m: float, share: float) -> bool:
    """Whether a person `height` m tall is not the one of `height_m` +- `sigma_m`: beyond `share` and 4 sigma of it."""
    return abs(height - height_m) > max(share * height_m, HEIGHT_SIGMAS * sigma_m)


def check_height(
    points: Floats,
    joints: Sequence[str],
    where: str,
    subject: str,
    height_m: float,
    sigma_m: float = 0.0,
    share: float = LIMITS["stature_share"],
) -> None:
    """Refuse a person (points as for `check`) who is not as tall as subjects.tsv says, `height_m` +- `sigma_m`.

    Beyond `share` of it, and beyond 4 sigma. The message, which goes into a log, does not tell the height.
    """
    height = stature(points, joints)
    if height_off(height, height_m, sigma_m, share):
        off, limit = height - height_m, max(share * height_m, HEIGHT_SIGMAS * sigma_m)
        raise DiorError(
            f"{where}: {subject} would be {100 * abs(off):.0f} cm {'taller' if off > 0 else 'smaller'} than "
            f"config/subjects.tsv says, more than {100 * limit:.0f} cm (physics.stature_share); correct height_m, or "
            f"the scale by the tape, the tag's size_m and the other metric facts; {OTHERS_WALK}"
        )


def joint(points: Floats, joints: Sequence[str], name: str) -> Floats:
    """A joint (T, 3), NaN where the detector has none of that name."""
    return points[:, list(joints).index(name)] if name in joints else np.full((len(points), 3), np.nan)


def middle(points: Floats, joints: Sequence[str], part: str) -> Floats:
    """Mean of the left and right `part` (T, 3), NaN where one is missing."""
    return np.mean([joint(points, joints, f"{side}_{part}") for side in SIDES], axis=0)


def _median(values: Floats, axis: int | None = None) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.nanmedian(values, axis=axis)


def segment(points: Floats, joints: Sequence[str], a: str, b: str) -> float:
    """Median length (m) from `a` to `b`: of both sides, or of the trunk between the middles of both sides."""
    if a == "shoulder":
        each = [middle(points, joints, a) - middle(points, joints, b)]
    else:
        each = [joint(points, joints, f"{s}_{a}") - joint(points, joints, f"{s}_{b}") for s in SIDES]
    return float(_median(np.linalg.norm(each, axis=-1)))


def stature(points: Floats, joints: Sequence[str]) -> float:
    """Height (m) by the lengths of thighs, shanks and trunk; NaN where none of them is known."""
    length, share = 0.0, 0.0
    for (a, b), part in SEGMENTS.items():
        size = segment(points, joints, a, b)
        if np.isfinite(size):
            length, share = length + size, share + part
    return float(length / share) if share else np.nan


def feet(points: Floats, joints: Sequence[str]) -> float:
    """How far (m) the soles of the standing feet are above the floor: the lowest quarter of heels and toes."""
    heights = np.stack([joint(points, joints, f"{side}_{part}")[:, 2] for side in SIDES for part in FEET]).ravel()
    heights = heights[np.isfinite(heights)]
    if not len(heights):
        return np.nan
    return float(np.median(heights[heights <= np.quantile(heights, STANDING_SHARE)]) - SOLE_M)


def lean(points: Floats, joints: Sequence[str]) -> float:
    """Angle (degrees) of the mean direction from hips to shoulders with the vertical."""
    trunk = middle(points, joints, "shoulder") - middle(points, joints, "hip")
    with np.errstate(invalid="ignore"):
        direction = _median(trunk / np.linalg.norm(trunk, axis=1, keepdims=True), axis=0)
    size = np.linalg.norm(direction)
    return float(np.degrees(np.arccos(np.clip(direction[2] / size, -1, 1)))) if size > 0 else np.nan


def speed(points: Floats, joints: Sequence[str], seconds: Floats) -> float:
    """Median horizontal speed (m/s) of the hips between instants about a third of a second apart."""
    hips, seconds = middle(points, joints, "hip"), np.asarray(seconds, float)
    if len(seconds) < 2:
        return np.nan
    apart = min(max(1, round(1 / 3 / np.median(np.diff(seconds)))), len(seconds) - 1)
    step = np.linalg.norm((hips[apart:] - hips[:-apart])[:, :2], axis=1)
    return float(_median(step / (seconds[apart:] - seconds[:-apart])))
