"""Where a detector's joints are, from Plug-in-Gait markers: near enough to tell the time, with the axes of the rest.

INPUTS   markers (T, M, 3) m by name
OUTPUTS  joints (T, J, 3) m, NaN where a marker is missing, and axes of the segment (T, J, 3, 3)
A skin marker is 2 to 10 cm from the joint centre, by an offset that is constant in the axes of its segment. The clocks
need no more than the axes: the offset is one of their unknowns. Marker positions: Vicon's Plug-in-Gait guide.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from dior.arrays import Floats
from dior.body.names import mirrored

# markers whose mean is near a joint, the pair along its segment's axis, the pair that fixes the turn about it
Segment: TypeAlias = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]

_ACROSS = ("LASI", "RASI")
_SHOULDERS = ("LSHO", "RSHO")
_HEAD = (("LFHD", "RFHD"), ("LFHD", "LBHD"))
_FACE = ("LFHD", "RFHD")
CENTRES: dict[str, Segment] = {
    **{
        name: (_FACE, *_HEAD)
        for name in (
            "nose left_eye_inner left_eye left_eye_outer left_mouth head right_eye_inner right_eye right_eye_outer "
            "right_mouth"
        ).split()
    },
    "left_ear": (("LFHD", "LBHD"), *_HEAD),
    "neck": (("C7", "CLAV"), ("C7", "CLAV"), _SHOULDERS),
    "mid_hip": (("LASI", "RASI", "LPSI", "RPSI"), _ACROSS, ("LASI", "LPSI")),
    "left_shoulder": (("LSHO",), _SHOULDERS, ("C7", "CLAV")),
    "left_elbow": (("LELB",), ("LSHO", "LELB"), _SHOULDERS),
    "left_wrist": (("LWRA", "LWRB"), ("LELB", "LWRA"), ("LWRA", "LWRB")),
    **{f"left_{name}": (("LFIN",), ("LWRA", "LFIN"), ("LWRA", "LWRB")) for name in ("pinky", "index", "thumb")},
    "left_hip": (("LASI", "LPSI"), _ACROSS, ("LASI", "LPSI")),
    "left_knee": (("LKNE",), ("LKNE", "LANK"), _ACROSS),
    "left_ankle": (("LANK",), ("LKNE", "LANK"), _ACROSS),
    "left_heel": (("LHEE",), ("LHEE", "LTOE"), _ACROSS),
    **{
        f"left_{name}": (("LTOE",), ("LHEE", "LTOE"), _ACROSS) for name in ("foot_index", "big_toe", "small_toe")
    },
}  # fmt: skip


def _mirrored(segment: Segment) -> Segment:
    """The same segment of the other side of the body."""
    near, along, turn = (tuple(mirrored(marker) for marker in markers) for markers in segment)
    return near, along, turn


CENTRES |= {
    mirrored(name): _mirrored(parts)
    for name, parts in list(CENTRES.items())
    if mirrored(name) != name and mirrored(name) not in CENTRES
}


def joints(markers: Floats, names: Sequence[str], wanted: Sequence[str]) -> tuple[Floats, Floats]:
    """Joints (T, J, 3) m and segment axes (T, J, 3, 3) of the joints `wanted`, NaN where their markers are missing.

    Markers that are themselves `wanted` are taken as they are, with the world's axes.
    """
    at = {name: markers[:, i] for i, name in enumerate(names)}
    count = len(markers)
    points, axes = np.full((count, len(wanted), 3), np.nan), np.full((count, len(wanted), 3, 3), np.nan)
    for j, name in enumerate(wanted):
        if name in at:
            points[:, j], axes[:, j] = at[name], np.eye(3)
            continue
        base, along, across = CENTRES.get(name, ((), (), ()))
        if not base or not set(base + along + across) <= set(at):
            continue
        points[:, j] = np.mean([at[marker] for marker in base], axis=0)
        axes[:, j] = _axes(at[along[1]] - at[along[0]], at[across[1]] - at[across[0]])
    return points, axes


def group(name: str) -> str:
    """The part of the body whose markers make a joint: tracks of one part share their soft tissue."""
    base = CENTRES.get(name, ((name,),))[0]
    return base[0]


def _axes(along: Floats, across: Floats) -> Floats:
    """Columns (T, 3, 3): along, at right angles to it in the plane of both, and normal to both."""
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    third = np.cross(first, across)
    third = third / np.linalg.norm(third, axis=-1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=-1)
