"""COCO-17 in 3D: a detector's joints by name, or joint centres from Plug-in-Gait markers.

INPUTS   points (..., M, 3) m by name: ML Kit's 33 or another detector's joints, or any subset of the markers
OUTPUTS  joints (..., 17, 3) m in COCO's order, NaN where they are not known; which of them were derived; by what rule
Axes of the pelvis, the thorax and the head: x forward, y left, z up. Rules, by the best that the markers allow:

| rule | joints | what it does |
|---|---|---|
| named | all | the point of that name |
| bell | hips | offsets from the pelvis in widths of it (Bell, Pedersen and Brand 1990) |
| chord | shoulders, knees, ankles | Plug-in-Gait: half a joint's width from its marker, a right angle at the joint |
| shift | knees, ankles | the same, inwards along the pelvis, where the thigh or tibia marker lacks |
| drop | shoulders | a share of their width below the marker towards the pelvis, where markers of the chest lack |
| hinge | elbows | half a width inwards along the axis on which both the upper arm and the forearm stand |
| head | nose, eyes, ears | offsets from the head band in lengths of it |
| marker | all | the mean of the markers nearest to the joint |
| no_<marker> | all | not known: this marker lacks |

Which rule holds follows from the markers that a recording has, not from a gap in one: there the joint is NaN. Widths
are an adult's (WIDTHS_M); the head's offsets have no source but proportions. Plug-in-Gait's rules: Vicon's reference
guide.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.joint_centres import CENTRES, mean_of
from dior.body.names import COCO_17

# widths of the joints and the drop of the shoulder below its marker, m; chosen: an adult's, for want of a measurement
WIDTHS_M = {"knee": 0.105, "ankle": 0.072, "elbow": 0.075}
SHOULDER_DROP_M = 0.045
SHOULDER_DROP = 0.17  # of the distance between LSHO and RSHO; chosen: 6 cm of an adult
MARKER_DIAMETER_M = 0.014  # the usual one of a Vicon
# of the hip from the middle of the front of the pelvis, in widths between LASI and RASI: forward, outwards, up
BELL = (-0.19, 0.36, -0.30)
# of a joint from the middle of the forehead markers (ears: of the side's two markers), forward, left, up: m on a head
# band that is as long as this; chosen by the proportions of an adult's head
HEAD_BAND_M = 0.190
HEAD = {
    "nose": (0.050, 0.0, -0.085),
    "left_eye": (0.025, 0.032, -0.045),
    "right_eye": (0.025, -0.032, -0.045),
    "left_ear": (0.0, 0.0, -0.050),
    "right_ear": (0.0, 0.0, -0.050),
}
# a joint, None where it is not known, and the rule
Found: TypeAlias = tuple[Floats | None, str]
SIDES = {"left": ("L", 1.0), "right": ("R", -1.0)}


def coco17(xyz: Floats, names: Sequence[str]) -> tuple[Floats, Bools, tuple[str, ...]]:
    """COCO-17 joints of points `xyz` (..., M, 3) m called `names`.

    Returns joints (..., 17, 3) m, whether each was derived from markers (17,), and the rule of each (17 words). A point
    that is NaN throughout counts as one that is not there.
    """
    xyz = np.asarray(xyz, float)
    there = np.all(np.isfinite(xyz), axis=-1).reshape(-1, xyz.shape[-2]).any(axis=0)
    at = {name: xyz[..., i, :] for i, name in enumerate(names) if there[i]}
    found: dict[str, Found] = {}
    for joint in COCO_17:
        if joint in at:
            found[joint] = at[joint], "named"
    # in this order: an ankle needs its knee, a knee its hip, an elbow its shoulder and wrist
    for part, rule in (
        ("hip", _hip), ("knee", _knee), ("ankle", _ankle), ("shoulder", _shoulder), ("wrist", _near), ("elbow", _elbow),
        ("nose", _head), ("eye", _head), ("ear", _head),
    ):  # fmt: skip
        for joint in COCO_17:
            if joint.endswith(part) and joint not in found:
                found[joint] = rule(joint, at, found)
    nothing = np.full((*xyz.shape[:-2], 3), np.nan)
    points = [nothing if point is None else point for point, _ in (found[joint] for joint in COCO_17)]
    rules = tuple(found[joint][1] for joint in COCO_17)
    derived = np.array([rule != "named" and not rule.startswith("no_") for rule in rules])
    return np.stack(points, axis=-2), derived, rules


def _hip(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    pelvis = pelvis_axes(at)
    if pelvis is None:
        return _near(joint, at, found)
    origin, axes, width = pelvis
    _, outwards = SIDES[joint.split("_")[0]]
    forward, aside, up = BELL
    return origin + width * _along(axes, (forward, outwards * aside, up)), "bell"


def _knee(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    return _leg(joint, at, found, "hip", "KNE", "THI", WIDTHS_M["knee"])


def _ankle(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    return _leg(joint, at, found, "knee", "ANK", "TIB", WIDTHS_M["ankle"])


def _leg(
    joint: str, at: dict[str, Floats], found: dict[str, Found], above: str, marker: str, wand: str, width: float
) -> Found:
    """A knee or an ankle: away from the marker of the segment, which lies further out than the joint's own."""
    side = joint.split("_")[0]
    letter, outwards = SIDES[side]
    outer, on_segment = at.get(letter + marker), at.get(letter + wand)
    upper, pelvis = found[f"{side}_{above}"][0], pelvis_axes(at)
    if outer is None or upper is None:
        return _near(joint, at, found)
    distance = (width + MARKER_DIAMETER_M) / 2
    if on_segment is not None:
        return _chord(upper, outer, outer - on_segment, distance), "chord"
    if pelvis is None:
        return _near(joint, at, found)
    return _chord(upper, outer, -outwards * pelvis[1][..., 1], distance), "shift"


def _shoulder(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    letter, _ = SIDES[joint.split("_")[0]]
    marker, thorax = at.get(letter + "SHO"), thorax_axes(at)
    if marker is not None and thorax is not None:
        origin, axes = thorax
        return _chord(origin, marker, -axes[..., 2], SHOULDER_DROP_M + MARKER_DIAMETER_M / 2), "chord"
    if marker is None or not {"LSHO", "RSHO", "LASI", "RASI"} <= set(at):
        return _near(joint, at, found)
    width = np.linalg.norm(at["LSHO"] - at["RSHO"], axis=-1, keepdims=True)
    return marker + SHOULDER_DROP * width * unit((at["LASI"] + at["RASI"]) / 2 - marker), "drop"


def _elbow(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    """n is the axis of the hinge inwards, d half its width: the joint E = marker + d n. The upper arm and the forearm
    stand on it, so that n.(shoulder - marker) = n.(wrist - marker) = d. Where they do not allow it (|n| > 1: the
    skin moved) n is the one in the plane of all three.

    For the remaining sign: an elbow bends one way only.
    """
    side = joint.split("_")[0]
    letter, outwards = SIDES[side]
    marker = at.get(letter + "ELB")
    shoulder, wrist = found[f"{side}_shoulder"][0], found[f"{side}_wrist"][0]
    if marker is None or shoulder is None or wrist is None:
        return _near(joint, at, found)
    distance = (WIDTHS_M["elbow"] + MARKER_DIAMETER_M) / 2
    up, down = shoulder - marker, wrist - marker
    uu, dd, ud = (up * up).sum(-1), (down * down).sum(-1), (up * down).sum(-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = distance / (uu * dd - ud * ud)
    in_plane = (scale * (dd - ud))[..., None] * up + (scale * (uu - ud))[..., None] * down
    rest = 1 - (in_plane * in_plane).sum(-1)
    out_of_plane = np.sqrt(np.maximum(rest, 0.0))[..., None] * -outwards * unit(np.cross(up, down))
    return marker + distance * unit(in_plane + out_of_plane), "hinge"


def _head(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    side = joint.split("_")[0]
    band = _band(at)
    if band is None:
        return _near(joint, at, found)
    front, axes, length = band
    base = front
    if joint.endswith("ear"):
        letter, _ = SIDES[side]
        base = (at[letter + "FHD"] + at[letter + "BHD"]) / 2
    return base + (length / HEAD_BAND_M) * _along(axes, HEAD[joint]), "head"


def _near(joint: str, at: dict[str, Floats], found: dict[str, Found]) -> Found:
    """The mean of the markers that are nearest to the joint."""
    markers = CENTRES[joint].near
    lacking = [marker for marker in markers if marker not in at]
    return mean_of(at, markers), f"no_{lacking[0]}" if lacking else "marker"


def pelvis_axes(at: dict[str, Floats]) -> tuple[Floats, Floats, Floats] | None:
    """Origin (..., 3) between LASI and RASI, axes (..., 3, 3) in columns and width (..., 1), or None."""
    if not {"LASI", "RASI"} <= set(at):
        return None
    if "SACR" in at:
        back = at["SACR"]
    elif {"LPSI", "RPSI"} <= set(at):
        back = (at["LPSI"] + at["RPSI"]) / 2
    else:
        return None
    origin = (at["LASI"] + at["RASI"]) / 2
    left = at["LASI"] - at["RASI"]
    y = unit(left)
    z = unit(np.cross(y, back - origin))
    return origin, np.stack([np.cross(y, z), y, z], axis=-1), np.linalg.norm(left, axis=-1, keepdims=True)


def thorax_axes(at: dict[str, Floats]) -> tuple[Floats, Floats] | None:
    """Origin (..., 3), half a marker behind CLAV, and axes (..., 3, 3) in columns, or None."""
    if not {"CLAV", "C7", "STRN", "T10"} <= set(at):
        return None
    z = unit(at["CLAV"] + at["C7"] - at["STRN"] - at["T10"])
    x = unit(across(at["CLAV"] + at["STRN"] - at["C7"] - at["T10"], z))
    return at["CLAV"] - MARKER_DIAMETER_M / 2 * x, np.stack([x, np.cross(z, x), z], axis=-1)


def _band(at: dict[str, Floats]) -> tuple[Floats, Floats, Floats] | None:
    """Middle (..., 3) of the forehead markers, axes (..., 3, 3) in columns and length (..., 1) of the band, or None."""
    if not {"LFHD", "RFHD", "LBHD", "RBHD"} <= set(at):
        return None
    front, back = (at["LFHD"] + at["RFHD"]) / 2, (at["LBHD"] + at["RBHD"]) / 2
    x = unit(front - back)
    y = unit(across(at["LFHD"] + at["LBHD"] - at["RFHD"] - at["RBHD"], x))
    return front, np.stack([x, y, np.cross(x, y)], axis=-1), np.linalg.norm(front - back, axis=-1, keepdims=True)


def _chord(centre: Floats, marker: Floats, toward: Floats, distance: float) -> Floats:
    """The joint (..., 3) at `distance` from its marker, with a right angle at the joint between marker and `centre`,
    in their plane with the direction `toward` and on that side. NaN where the centre is nearer than `distance`."""
    line = centre - marker
    length = np.linalg.norm(line, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = distance / length
        sine = np.sqrt(1 - cosine * cosine)
    return marker + distance * (cosine * unit(line) + sine * unit(across(toward, line)))


def across(vectors: Floats, line: Floats) -> Floats:
    """The part of vectors (..., 3) at right angles to `line`."""
    along = unit(line)
    return vectors - (vectors * along).sum(axis=-1, keepdims=True) * along


def unit(vectors: Floats) -> Floats:
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _along(axes: Floats, offset: tuple[float, float, float]) -> Floats:
    return axes @ np.asarray(offset, float)
