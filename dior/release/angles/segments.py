"""The segments of a walker as a chain: their axes, how long they are, and where the markers sit on them.

INPUTS   joints or Plug-in-Gait markers (T, J, 3) m by name, Y up as OpenSim has it
OUTPUTS  `Skeleton`
Axes of a segment: x forward, y up along it, z to the walker's right; its origin is the joint above, of the pelvis the
middle between the hips. All are parallel where all angles are zero. Joint centres: dior/body/coco17.py. With markers
the axes are those of Plug-in-Gait (Vicon's reference guide; Kadaba et al., J. Orthop. Res. 8 (1990) 383-392), but hips
and the axes of knees are those that the walk itself shows. With joints alone a knee's axis is at right angles to thigh
and shank where these are bent, and since two hips do not tell how a pelvis is tilted, it is tilted as the trunk is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dior.arrays import Floats
from dior.body.coco17 import across, coco17, pelvis_axes, thorax_axes, unit
from dior.body.names import COCO_17
from dior.errors import DiorError
from dior.gait.tracks import HEEL, TOE

PELVIS, THORAX = ("LASI", "RASI", "LPSI", "RPSI", "SACR"), ("C7", "T10", "CLAV", "STRN")
# chosen: in a leg that is straighter hip, knee and ankle do not tell the axis of its knee
BENT = np.sin(np.deg2rad(20.0))
# chosen: of fewer instants a median is not to be trusted
LEAST = 5
# m, sd of a hip that is known from the pelvis alone along an axis, and of the skin below a knee's marker, which counts
# as so many independent ones a side; chosen: regressions are off by 1 to 3 cm (Leardini et al., J. Biomech. 32 (1999)
# 99-103), skin moves by 5 to 10 mm, and alike in every step
HIP_M, SKIN_M, STEPS = 0.02, 0.007, 8.0
ROUNDS = 10


class Side(NamedTuple):
    """A side, the letters by which OpenSim's and Plug-in-Gait's names tell it, and the sign of z on it."""

    name: str
    end: str
    letter: str
    sign: float


SIDES = (Side("right", "r", "R", 1.0), Side("left", "l", "L", -1.0))


@dataclass(frozen=True, eq=False)
class Segment:
    """`joint` (3,) m: its origin in the axes of the segment `above`, "" of the pelvis; `markers`: places (3,) m in its
    own axes; `needs`: with how many of these in sight it is known."""

    name: str
    above: str
    joint: Floats
    markers: dict[str, Floats]
    needs: int


@dataclass(frozen=True, eq=False)
class Skeleton:
    """`segments`, each after the one above it; `stiff`: whether the trunk is tilted as the pelvis is; `middle` (T, 3) m
    between the hips and `heading` (T,) rad of the pelvis, from forward along x to the left."""

    segments: tuple[Segment, ...]
    stiff: bool
    middle: Floats
    heading: Floats


def skeleton_of(points: Floats, names: Sequence[str]) -> Skeleton:
    """`Skeleton` of points (T, J, 3) m called `names`. Raises DiorError where legs or the pelvis are not known."""
    seen = np.isfinite(points).all(axis=-1).sum(axis=0) >= LEAST
    at = {name: points[:, i] for i, name in enumerate(names) if seen[i]}
    if not at:
        raise DiorError("no joint angles: nobody is known in 3D")
    marked = pelvis_axes(at) if {"LKNE", "RKNE"} <= set(at) else None
    centres = _centres(at)
    if marked is not None:
        centres = _centres(at | _moved_hips(at, centres, _opensim(marked[1])))
    for joint in (f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle")):
        if np.isfinite(centres[joint]).all(axis=-1).sum() < LEAST:
            raise DiorError(f"no joint angles: the 3D has no {joint.replace('_', ' ')}")
    hips = centres["left_hip"], centres["right_hip"]
    middle = (hips[0] + hips[1]) / 2
    stiff = marked is None
    if marked is None:
        neck = (centres["left_shoulder"] + centres["right_shoulder"]) / 2
        z = unit(hips[1] - hips[0])
        pelvis = _axes(unit(across(neck - middle, z)), z)
        own = _both(centres, "hip")
    else:
        pelvis = _opensim(marked[1])
        own = _there(at, PELVIS)
    if _known(pelvis) < LEAST:
        raise DiorError(
            "no joint angles: neither hips and shoulders nor markers of the pelvis and both knees are known in 3D"
        )
    segments = [Segment("pelvis", "", np.zeros(3), _places(own, middle, pelvis), 2 if stiff else 3)]
    for side in SIDES:
        segments += _leg(side, at, centres, middle, pelvis)
    segments += _trunk(at, centres, middle, pelvis, marked)
    heading = np.arctan2(-pelvis[:, 2, 0], pelvis[:, 0, 0])
    known = np.isfinite(heading)
    heading[known] = np.unwrap(heading[known])
    return Skeleton(tuple(segments), stiff, middle, heading)


def _centres(at: dict[str, Floats]) -> dict[str, Floats]:
    points = np.stack(list(at.values()), axis=-2)
    return dict(zip(COCO_17, np.moveaxis(coco17(points, list(at))[0], -2, 0), strict=True))


def _moved_hips(at: dict[str, Floats], centres: dict[str, Floats], pelvis: Floats) -> dict[str, Floats]:
    """The hips (T, 3) about which the knees' markers go round, as far as they tell and both sides are alike."""
    middle = (centres["left_hip"] + centres["right_hip"]) / 2
    inside = {side: np.einsum("tia,ti->ta", pelvis, at[f"{letter}KNE"] - middle) for side, _, letter, _ in SIDES}
    inside = {side: knee[np.isfinite(knee).all(axis=-1)] for side, knee in inside.items()}
    start = _place(centres["right_hip"] - middle, pelvis)
    if min(map(len, inside.values())) < LEAST:
        return {}
    place, mirror = start, np.array([1.0, 1.0, -1.0])
    for _ in range(ROUNDS):
        normal, right = np.eye(3) / HIP_M**2, (start - place) / HIP_M**2
        for side, _, _, sign in SIDES:
            away = place - inside[side] * (mirror if sign < 0 else 1.0)
            far = _length(away)
            slope = away / far[:, None]
            slope, off = slope - slope.mean(axis=0), far.mean() - far
            normal = normal + STEPS * slope.T @ slope / (len(far) * SKIN_M**2)
            right = right + STEPS * slope.T @ off / (len(far) * SKIN_M**2)
        place = place + np.linalg.solve(normal, right)
    places = {"right_hip": place, "left_hip": place * mirror}
    return {hip: middle + np.einsum("tia,a->ti", pelvis, where) for hip, where in places.items()}


def _leg(of: Side, at: dict[str, Floats], centres: dict[str, Floats], middle: Floats, pelvis: Floats) -> list[Segment]:
    side, end, letter, sign = of
    hip, knee, ankle = (centres[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
    thigh, shank = knee - hip, ankle - knee
    if f"{letter}KNE" in at:
        outwards = sign * (at[f"{letter}KNE"] - knee)
        of_thigh, of_shank = _there(at, (f"{letter}THI", f"{letter}KNE")), _there(at, (f"{letter}TIB", f"{letter}ANK"))
    else:
        outwards = np.cross(shank, thigh)
        bent = _length(outwards) > BENT * _length(shank) * _length(thigh)
        outwards = np.where(bent[:, None], outwards, np.nan)
        of_thigh, of_shank = {f"{side}_knee": knee}, {f"{side}_ankle": ankle}
    femur = _bending_in_plane(_axes(-unit(thigh), unit(across(outwards, thigh))), shank)
    tibia = _axes(-unit(across(shank, femur[..., 2])), femur[..., 2])
    if min(_known(femur), _known(tibia)) < LEAST:
        raise DiorError(f"no joint angles: {side} hip, knee and ankle are never known at a time, or it is never bent")
    found = [
        Segment(f"femur_{end}", "pelvis", _place(hip - middle, pelvis), _places(of_thigh, hip, femur), 1),
        Segment(f"tibia_{end}", f"femur_{end}", _place(thigh, femur), _places(of_shank, knee, tibia), 1),
    ]
    heel, toe = (next((kind[side] for kind in kinds if kind[side] in at), None) for kinds in (HEEL, TOE))
    if heel is None or toe is None:
        return found
    x = unit(at[toe] - at[heel])
    z = unit(across(tibia[..., 2], x))
    foot = np.stack([x, np.cross(z, x), z], axis=-1)
    if _known(foot) < LEAST:
        return found
    own = _places(_there(at, (heel, toe)), ankle, foot)
    return [*found, Segment(f"foot_{end}", f"tibia_{end}", _place(shank, tibia), own, 2)]


def _bending_in_plane(femur: Floats, shank: Floats) -> Floats:
    """Axes (T, 3, 3) of a thigh, turned about it by the one angle with which a knee that bends does not swing the shank
    (T, 3) sideways (Baker, Finney and Orr, Hum. Mov. Sci. 18 (1999) 655-667): its marker is rarely on its axis."""
    x, _, z = np.einsum("tia,ti->at", femur, unit(shank))
    known = np.isfinite(x) & np.isfinite(z)
    if known.sum() < LEAST or np.ptp(x[known]) < BENT:
        return femur
    angle = np.arctan(np.polyfit(x[known], z[known], 1)[0])
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(femur @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]))


def _trunk(
    at: dict[str, Floats],
    centres: dict[str, Floats],
    middle: Floats,
    pelvis: Floats,
    marked: tuple[Floats, Floats, Floats] | None,
) -> list[Segment]:
    """The trunk; with markers it turns about the middle of the four of the pelvis, at about the top of the sacrum."""
    if marked is None:
        own = _both(centres, "shoulder")
        y = unit(sum(own.values()) / 2 - middle)
        torso = _axes(y, unit(across(own["right_shoulder"] - own["left_shoulder"], y)))
        return [Segment("torso", "pelvis", np.zeros(3), _places(own, middle, torso), 2)]
    thorax = thorax_axes(at)
    if thorax is None or _known(thorax[1]) < LEAST:
        return []
    back = at["SACR"] if "SACR" in at else (at["LPSI"] + at["RPSI"]) / 2
    joint = (marked[0] + back) / 2
    own = _places(_there(at, THORAX), joint, _opensim(thorax[1]))
    return [Segment("torso", "pelvis", _place(joint - middle, pelvis), own, 3)]


def _both(centres: dict[str, Floats], part: str) -> dict[str, Floats]:
    return {f"{side.name}_{part}": centres[f"{side.name}_{part}"] for side in SIDES}


def _there(at: dict[str, Floats], names: Sequence[str]) -> dict[str, Floats]:
    return {name: at[name] for name in names if name in at}


def _axes(y: Floats, z: Floats) -> Floats:
    """Axes (T, 3, 3) in columns of unit vectors y and z (T, 3) at right angles."""
    return np.stack([np.cross(y, z), y, z], axis=-1)


def _opensim(axes: Floats) -> Floats:
    """Axes (T, 3, 3) forward, left, up as forward, up, right."""
    return np.stack([axes[..., 0], axes[..., 2], -axes[..., 1]], axis=-1)


def _places(own: dict[str, Floats], origin: Floats, axes: Floats) -> dict[str, Floats]:
    shifts = {name: point - origin for name, point in own.items()}
    return {name: _place(shift, axes) for name, shift in shifts.items() if _known(axes * shift[:, None]) >= LEAST}


def _place(vectors: Floats, axes: Floats) -> Floats:
    """The median (3,) m of vectors (T, 3) m in axes (T, 3, 3)."""
    return np.asarray(np.nanmedian(np.einsum("tia,ti->ta", axes, vectors), axis=0))


def _known(axes: Floats) -> int:
    return int(np.isfinite(axes).all(axis=(-1, -2)).sum())


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=-1))
