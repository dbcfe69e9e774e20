"""Where joints are, from Plug-in-Gait markers: the one table of the markers that are nearest to each joint.

INPUTS   markers (T, M, 3) m by name
OUTPUTS  joints (T, J, 3) m, NaN where a marker is missing, and axes of the segment (T, J, 3, 3)
A skin marker is 2 to 10 cm from the joint centre, by an offset that is constant in the axes of its segment. Marker
positions: Vicon's Plug-in-Gait guide. Three uses start from the mean of the nearest markers, and each needs another way
from there to the joint:

- the clocks (`joints`) take the mean as it is: its offset in the axes of the segment is one of their unknowns, so that
  the joint itself would not make them better (`python -m benchmarks.joint_centres`);
- what the body hides (dior/body/visibility.py) shifts it inwards by a share of the stature: good to a few centimetres,
  it is known where a marker of the chest or the thigh lacks, and the limbs are thicker than its error;
- COCO-17 (dior/body/coco17.py), which is released, builds the anatomical joint, and takes the mean only where the
  markers for that are missing.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dior.arrays import Floats
from dior.body.names import mirrored


class Segment(NamedTuple):
    """Of a joint: markers whose mean is near it, the pair along its segment, the pair that fixes the turn about it."""

    near: tuple[str, ...]
    along: tuple[str, ...]
    turn: tuple[str, ...]


_ACROSS = ("LASI", "RASI")
_SHOULDERS = ("LSHO", "RSHO")
_HEAD = (("LFHD", "RFHD"), ("LFHD", "LBHD"))
_FACE = ("LFHD", "RFHD")
_LEFT_AND_MIDDLE: dict[str, tuple[tuple[str, ...], ...]] = {
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
CENTRES = {name: Segment(*markers) for name, markers in _LEFT_AND_MIDDLE.items()}
CENTRES |= {
    mirrored(name): Segment(*(tuple(mirrored(marker) for marker in markers) for markers in segment))
    for name, segment in CENTRES.items()
    if mirrored(name) not in CENTRES
}


def mean_of(at: Mapping[str, Floats], markers: Sequence[str]) -> Floats | None:
    """Mean (..., 3) m of the `markers`, None where `at` lacks one of them."""
    return np.mean([at[marker] for marker in markers], axis=0) if set(markers) <= set(at) else None


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
        if name not in CENTRES or not set(sum(CENTRES[name], ())) <= set(at):
            continue
        near, along, turn = CENTRES[name]
        points[:, j] = mean_of(at, near)
        axes[:, j] = _axes(at[along[1]] - at[along[0]], at[turn[1]] - at[turn[0]])
    return points, axes


def group(name: str) -> str:
    """The part of the body whose markers make a joint: tracks of one part share their soft tissue."""
    return CENTRES[name].near[0] if name in CENTRES else name


def _axes(along: Floats, across: Floats) -> Floats:
    """Columns (T, 3, 3): along, at right angles to it in the plane of both, and normal to both."""
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    third = np.cross(first, across)
    third = third / np.linalg.norm(third, axis=-1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=-1)
