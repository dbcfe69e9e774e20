"""Which mistake made a world wrong: its unit or size, its vertical, its floor, its hand, the way its poses are written.

INPUTS   joints of one person in the world, (T, J, 3) with NaN for missing, and their names; for poses that were written
         in another way, cameras and detections (V, T, J, 2) px
OUTPUTS  `plausible.Fault`s that name the mistake, and readings of the poses under which the views agree

A right world is in metres, right-handed, Z up, its floor at Z = 0. A scale or a turn of the world moves no pixel, so
that a wrong size and a wrong vertical are found by the person alone. Poses of the other direction, axes of another kind
of camera and a left-handed world are no similarity: the views' rays do not meet, and the reading under which they do
tells what was written.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from dior.arrays import Floats
from dior.body import plausible
from dior.body.joint_centres import joints as centres_of
from dior.body.names import PLUG_IN_GAIT_39
from dior.body.plausible import Fault
from dior.body.proportions import SEGMENTS, SIDES
from dior.geometry.camera import REFERENCE_FX, Camera, inverse_pose, pose, reprojection_errors
from dior.geometry.triangulation import triangulated

# how many of a unit are a metre
UNITS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37, "feet": 3.281}
KEYS = {"millimetres": "mm", "centimetres": "cm"}
# chosen: a size that is off by more is another unit; a camera nearer to the origin, of the rig's extent, stands in it
USELESS, AT_ORIGIN = 2.5, 1e-3
# chosen: people differ by less from `TYPICAL_M`, and from a height that somebody measured
UNIT_RATIO, UNIT_RATIO_MEASURED = 1.3, 1.15
TYPICAL_M = 1.7
# chosen: a body that leans by more stands along another axis, and by less than the second along that axis
LYING_DEG, ALONG_DEG = 60.0, 35.0
# chosen: a segment that is so much longer than its share of the body (`proportions`), or shorter, is none; detectors'
# trunks are up to a fifth off, and hips and shoulders of markers a quarter
BONE_RATIO = 1.5
# chosen: the triple product of left, up and forward is about 1 for a walker's unit vectors and -1 for his mirror image;
# short of this he turns, or his feet are not seen
HANDED = 0.3
# joints by which a person of markers is judged
JOINTS = tuple(
    f"{side}_{part}" for side in SIDES for part in ("shoulder", "hip", "knee", "ankle", "heel", "foot_index")
)
# chosen: px at fx 1680; rays that pass each other by less meet, as detectors err by 10-15 px
MEETING_PX = 40.0
# chosen: another reading of the poses explains the views where the errors are so much smaller with it
BETTER = 4.0
# chosen: where the errors with one are less than so many times those with another it is the better one; less than a
# pixel is chance
CLEARLY, ALIKE_PX = 0.8, 1.0


class Person(NamedTuple):
    """Whose height is known: `height_m` +- `sigma_m` by subjects.tsv."""

    name: str
    height_m: float
    sigma_m: float = 0.0


def of_markers(names: Sequence[str]) -> bool:
    """Whether these are Plug-in-Gait markers and not joints."""
    return bool(set(names) & set(PLUG_IN_GAIT_39))


def joints_of(points: Floats, names: Sequence[str]) -> tuple[Floats, tuple[str, ...]]:
    """Joints (T, J, 3) and their names, from joints or from Plug-in-Gait markers."""
    return (centres_of(points, names, JOINTS)[0], JOINTS) if of_markers(names) else (points, tuple(names))


def scale_words(ratio: float, tolerance: float = UNIT_RATIO_MEASURED) -> str:
    """What makes a body `ratio` times as large as it is: another unit, or a factor."""
    for unit, size in UNITS.items():
        if abs(math.log(ratio / size)) < math.log(tolerance):
            return f"in {unit}, not metres"
        if unit in ("millimetres", "centimetres") and abs(math.log(ratio * size)) < math.log(tolerance):
            return f"too small by {size:g} (metres taken for {unit}?)"
    return f"too large by {ratio:.2f}" if ratio > 1 else f"too small by {1 / ratio:.2f}"


def size_fault(points: Floats, joints: Sequence[str], person: Person | None, limits: Mapping[str, Any]) -> Fault | None:
    """The fault of a world in which the person has not his size; his height is not told where it is of subjects.tsv."""
    height = plausible.stature(points, joints)
    if not np.isfinite(height):
        return None
    low, high = limits["stature_m"]
    if person is not None:
        if not plausible.height_off(height, person.height_m, person.sigma_m, limits["stature_share"]):
            return None
        words = scale_words(height / person.height_m)
        return Fault(
            "world_scale",
            f"the world is {words}, by the height of {person.name} in config/subjects.tsv (physics.stature_share)",
        )
    if low <= height <= high:
        return None
    words = scale_words(height / TYPICAL_M, UNIT_RATIO)
    about = words if words.startswith("in ") else words.replace(" by ", " by about ")
    return Fault(
        "world_scale",
        f"the world is {about}: the person would be {height:.4g} m tall, outside of {low:g}-{high:g} m "
        "(physics.stature_m)",
    )


def upward(points: Floats, joints: Sequence[str]) -> Floats:
    """Mean direction (3,) of length 1 from the ankles (or knees, or hips) to the shoulders; NaN where not known."""
    top = plausible.middle(points, joints, "shoulder")
    for part in ("ankle", "knee", "hip"):
        with np.errstate(invalid="ignore"):
            along = top - plausible.middle(points, joints, part)
            along = along / np.linalg.norm(along, axis=1, keepdims=True)
        if np.isfinite(along).all(axis=1).any():
            mean = np.nanmedian(along, axis=0)
            return mean / np.linalg.norm(mean)
    return np.full(3, np.nan)


def off_vertical(up: Floats) -> tuple[float, str]:
    """Angle (degrees) of a direction with Z, and the axis nearest to it, such as `-Y`; "" where none is near."""
    if not np.isfinite(up).all():
        return 0.0, ""
    axis = int(np.abs(up).argmax())
    angle = float(np.degrees(np.arccos(np.clip(up[2], -1, 1))))
    near = np.degrees(np.arccos(min(abs(up[axis]), 1.0))) < ALONG_DEG
    return angle, f"{'-' if up[axis] < 0 else ''}{'XYZ'[axis]}" if near else ""


def handedness(points: Floats, joints: Sequence[str]) -> float:
    """Median triple product of a walker's left, up and forward (toes before heels), of unit vectors.

    About 1 in a right-handed world, -1 in a left-handed one; NaN where not enough is known.
    """

    def across(part: str) -> Floats:
        return plausible.joint(points, joints, f"left_{part}") - plausible.joint(points, joints, f"right_{part}")

    def unit(v: Floats) -> Floats:
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    with np.errstate(invalid="ignore", divide="ignore"):
        left = unit(across("hip") + across("shoulder"))
        up = unit(plausible.middle(points, joints, "shoulder") - plausible.middle(points, joints, "ankle"))
        feet = [
            plausible.joint(points, joints, f"{side}_{toe}") - plausible.joint(points, joints, f"{side}_heel")
            for side in SIDES
            for toe in ("foot_index", "big_toe")
        ]
        forward = unit(np.nansum(feet, axis=0))
        triple = (np.cross(left, up) * forward).sum(axis=-1)
    return float(np.median(triple[np.isfinite(triple)])) if np.isfinite(triple).any() else np.nan


def bone_fault(points: Floats, joints: Sequence[str]) -> Fault | None:
    """The fault of a segment (thigh, shank, trunk) that is no part of the body whose other segments are there."""
    lengths = {f"{a} to {b}": (plausible.segment(points, joints, a, b), part) for (a, b), part in SEGMENTS.items()}
    known = {name: (size, part) for name, (size, part) in lengths.items() if np.isfinite(size)}
    if len(known) < 2:
        return None
    off = {}
    for name, (size, part) in known.items():
        others = [value for other, value in known.items() if other != name]
        expected = part * sum(size for size, _ in others) / sum(share for _, share in others)
        off[name] = size / expected
    worst = max(off, key=lambda name: abs(math.log(off[name])))
    if abs(math.log(off[worst])) < math.log(BONE_RATIO):
        return None
    times = off[worst] if off[worst] > 1 else 1 / off[worst]
    return Fault(
        "world_bones",
        f"{worst} is {times:.1f} times too {'long' if off[worst] > 1 else 'short'} for the rest of the body",
    )


def of_person(
    points: Floats,
    joints: Sequence[str],
    seconds: Floats | None = None,
    person: Person | None = None,
    limits: Mapping[str, Any] | None = None,
) -> list[Fault]:
    """What no world shows of a person who walks in it, the mistake named where it is one of the usual.

    `points` (T, J, 3) of joints or Plug-in-Gait markers, `seconds` (T,); `limits`: some of `plausible.LIMITS`.
    """
    markers = of_markers(joints)
    points, joints = joints_of(points, joints)
    limits = plausible.LIMITS | dict(limits or {})
    found: list[Fault] = []
    # markers of the pelvis are above the hips: thighs are too long by what trunks are too short, so that a size needs
    # both, and single bones tell nothing (`marker_checks` looks at pairs on one bone)
    if markers and not all(np.isfinite(plausible.segment(points, joints, *pair)) for pair in SEGMENTS):
        person = None
    if (size := size_fault(points, joints, person, limits)) is not None:
        found.append(size)
    hand = handedness(points, joints)
    if hand < -HANDED:
        text = (
            "the world is left-handed: the walker is his own mirror image, his toes point backwards; or left and right "
            "are exchanged throughout"
        )
        found.append(Fault("world_left_handed", text))
    angle, axis = off_vertical(upward(points, joints))
    if angle > LYING_DEG:
        what = f"{axis} is up" if axis else f"the vertical is {angle:.0f} degrees off"
        found.append(Fault("world_axes", f"{what}, not Z: the body does not stand along Z"))
    # a body that lies has no feet on the floor, one in millimetres no speed: only the first cause is told
    figures = plausible.measured(points, joints, seconds)
    for fault in plausible.faults(figures, limits):
        if fault.code == "vertical" and angle <= LYING_DEG or not found and fault.code in ("floor", "speed"):
            found.append(Fault(f"world_{fault.code}", fault.text.partition(";")[0]))
    if not markers and (bones := bone_fault(points, joints)) is not None:
        found.append(bones)
    return found


class Reading(NamedTuple):
    """Poses read in another way: `cameras` as they would stand, what the file would hold, and how to say so.

    `axes` (3,): by what the coordinates in the world of `cameras` are multiplied to be the file's.
    """

    cameras: list[Camera]
    words: str
    fix: str
    axes: tuple[int, int, int] = (1, 1, 1)


# of a camera's axes those that another convention has the other way round
_AXES = {
    "has the camera axes of OpenGL (y up, z backward)": (1, -1, -1),
    "is left-handed (a camera's x is mirrored)": (-1, 1, 1),
    "is left-handed (a camera's y is up)": (1, -1, 1),
    "is left-handed (a camera's z is backward)": (1, 1, -1),
}
_RIGHT_HANDED = "export it with OpenCV's axes (x right, y down, z forward) and a right-handed world"


def readings(cameras: Sequence[Camera], convention: str = "cTw") -> list[Reading]:
    """Other ways to read the poses of cameras; `convention` of the file is how they were read."""
    other = "wTc" if convention == "cTw" else "cTw"
    inverse = [c.at(inverse_pose(c.wTc)) for c in cameras]
    turned = f"holds {other} where {convention} was read (inverted poses)"
    fix = f"set reference.convention: {other}"
    found = [Reading(inverse, turned, fix)]
    for words, axes in _AXES.items():
        world = (1, math.prod(axes), 1)
        found.append(Reading([_mirrored(c, axes, world) for c in cameras], words, _RIGHT_HANDED, world))
        both = [_mirrored(c, axes, world) for c in inverse]
        found.append(Reading(both, f"{turned} and {words}", f"{fix} and {_RIGHT_HANDED}", world))
    for a, b in combinations(range(len(cameras)), 2):
        exchanged = list(cameras)
        exchanged[a], exchanged[b] = cameras[a].at(cameras[b].wTc), cameras[b].at(cameras[a].wTc)
        names = f"{cameras[a].name} and {cameras[b].name}"
        found.append(
            Reading(exchanged, f"has {names} exchanged", f"exchange reference.name, or detections, of {names}")
        )
    return found


def _mirrored(camera: Camera, axes: tuple[int, int, int], world: tuple[int, int, int]) -> Camera:
    """The camera with axes of its own the other way round, in a world that is mirrored where they are."""
    S, M = (np.diag(signs).astype(float) for signs in (axes, world))
    return camera.at(pose(M @ camera.wRc @ S, M @ camera.centre))


def meeting(cameras: Sequence[Camera], uv: Floats) -> tuple[float, Floats]:
    """Median error (px at fx 1680) of points seen by two or more views, and the points (T, J, 3).

    A point that is behind a camera that sees it has none, and its error is infinite. `uv` (V, T, J, 2) recorded px.
    """
    points = triangulated(cameras, uv)
    scale = np.array([REFERENCE_FX / c.intrinsics.fx for c in cameras])[:, None, None]
    errors = reprojection_errors(cameras, points, uv) * scale
    seen = np.isfinite(uv).all(axis=-1)
    enough = seen.sum(axis=0) >= 2
    if not enough.any():
        return np.inf, points
    with np.errstate(invalid="ignore"):
        total = np.where(seen, errors, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    total = np.where(np.isfinite(total), total, np.inf)[enough]
    return float(np.median(total)), points


def other_reading(
    cameras: Sequence[Camera], uv: Floats, joints: Sequence[str], convention: str = "cTw"
) -> tuple[Reading | None, Floats]:
    """The reading of the poses under which the views agree, None where that is as given, and the points by it.

    Another one counts only where it brings the rays together that do not meet as given, or meet worse in a world that
    mirrors the walker or lays him down, and makes a body of them. Readings that do so about as well are named together.
    """
    given, points = meeting(cameras, uv)
    odd = handedness(points, joints) < -HANDED or off_vertical(upward(points, joints))[0] > LYING_DEG
    if given < MEETING_PX and not odd:
        return None, points
    least = CLEARLY * given if odd else min(given / BETTER, MEETING_PX)
    found = []
    for reading in readings(cameras, convention):
        error, theirs = meeting(reading.cameras, uv)
        sound = bone_fault(theirs, joints) is None and not handedness(theirs, joints) < -HANDED
        if error < least and sound and np.isfinite(plausible.stature(theirs, joints)):
            found.append((error, reading, theirs))
    if not found:
        return None, points
    best, reading, points = min(found, key=lambda one: one[0])
    alike = [other for error, other, _ in found if other is not reading and CLEARLY * error <= best + ALIKE_PX]
    words = ", or ".join([reading.words, *(other.words for other in alike)])
    fix = ", or ".join(dict.fromkeys([reading.fix, *(other.fix for other in alike)]))
    return reading._replace(words=words, fix=fix), points


def of_poses(
    cameras: Sequence[Camera],
    uv: Floats,
    joints: Sequence[str],
    person: Person | None = None,
    convention: str = "cTw",
    vertical: bool = True,
    metres: float = 1.0,
) -> tuple[list[Fault], Floats]:
    """Why poses that somebody else found are of no use here, with the fix in each sentence, and the points by them.

    `uv` (V, T, J, 2) recorded px of one person, NaN where not seen; the faults begin with a verb, their subject is
    the calibration; `metres`: what a unit of its translations is taken for. Without `vertical` it may stand as it
    likes. A size that is off by less than `USELESS` is left to `of_person`, which judges every sequence.
    """
    reading, points = other_reading(cameras, uv, joints, convention)
    found = []
    if reading is not None:
        points = points * reading.axes
        left = "left-handed" in reading.words
        found.append(Fault("world_left_handed" if left else "world_poses", f"{reading.words}; {reading.fix}"))
    expected, tolerance = (person.height_m, UNIT_RATIO_MEASURED) if person else (TYPICAL_M, UNIT_RATIO)
    ratio = plausible.stature(points, joints) / expected
    if ratio > USELESS or ratio < 1 / USELESS:
        words = scale_words(ratio, tolerance)
        short = {f"in {unit}, not metres": key for unit, key in KEYS.items()}.get(words, "")
        fix = "correct its translations"
        if short:
            fix = f"set reference.units: {short}, or, if its format says the unit, export it anew"
        if metres != 1 and 1 / USELESS < ratio / metres < USELESS:
            fix = "its translations are metres, so set reference.units: m in the YAML of every camera of it"
        found.append(Fault("world_scale", f"is {words}; {fix}"))
    angle, axis = off_vertical(upward(points, joints))
    spread = np.ptp([c.centre for c in cameras], axis=0).max()
    own = [c.name for c in cameras if np.linalg.norm(c.centre) < AT_ORIGIN * spread]
    if vertical and own:
        text = (
            f"has {own[0]} as the origin of its world, which is to be on the floor with Z up; set "
            "reference.world: from_walk in the YAML of every camera of it, which takes the floor and the vertical from "
            "the walk"
        )
        found.append(Fault("world_of_camera", text))
    elif vertical and angle > LYING_DEG:
        what = f"has {axis} up, not Z" if axis else f"has a vertical that is {angle:.0f} degrees off Z"
        text = (
            f"{what}; export it with Z up, or set reference.world: from_walk in the YAML of every camera of it, which "
            "takes the floor and the vertical from the walk"
        )
        found.append(Fault("world_axes", text))
    return found, points
