"""Names of joints and markers, their left-right pairs, and the bones that a picture shows."""

import re
from collections.abc import Sequence

import numpy as np

from dior.arrays import Ints

MLKIT_33 = tuple(
    (
        "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer left_ear right_ear "
        "left_mouth right_mouth left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist left_pinky "
        "right_pinky left_index right_index left_thumb right_thumb left_hip right_hip left_knee right_knee left_ankle "
        "right_ankle left_heel right_heel left_foot_index right_foot_index"
    ).split()
)
PLUG_IN_GAIT_39 = tuple(
    (
        "LFHD RFHD LBHD RBHD C7 T10 CLAV STRN RBAK LSHO LUPA LELB LFRM LWRA LWRB LFIN RSHO RUPA RELB RFRM RWRA RWRB "
        "RFIN LASI RASI LPSI RPSI LTHI LKNE LTIB LANK LHEE LTOE RTHI RKNE RTIB RANK RHEE RTOE"
    ).split()
)
COCO_17 = tuple(
    (
        "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
        "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
    ).split()
)
# OpenPose, include/openpose/pose/poseParametersRender.hpp; BODY_25B as in its training repository
BODY_25 = tuple(
    (
        "nose neck right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist mid_hip right_hip "
        "right_knee right_ankle left_hip left_knee left_ankle right_eye left_eye right_ear left_ear left_big_toe "
        "left_small_toe left_heel right_big_toe right_small_toe right_heel"
    ).split()
)
BODY_25B = (
    *COCO_17,
    *"neck head left_big_toe left_small_toe left_heel right_big_toe right_small_toe right_heel".split(),
)
COCO_18 = tuple(
    (
        "nose neck right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist right_hip right_knee "
        "right_ankle left_hip left_knee left_ankle right_eye left_eye right_ear left_ear"
    ).split()
)

# iBUG's 68 face points: numbers on the subject's right, and what they and their mirrors on the left add up to
_FACE_PAIRS = (
    (range(0, 8), 16),
    (range(17, 22), 43),
    (range(31, 33), 66),
    (range(36, 40), 81),
    (range(40, 42), 87),
    (range(48, 51), 102),
    (range(58, 60), 114),
    (range(60, 62), 124),
    (range(67, 68), 132),
)


def _sided_face() -> tuple[str, ...]:
    names = [f"face_{number:02d}" for number in range(68)]
    for numbers, total in _FACE_PAIRS:
        for right in numbers:
            names[right], names[total - right] = f"right_face_{right:02d}", f"left_face_{right:02d}"
    return tuple(names)


FACE_68 = _sided_face()
HANDS_42 = tuple(f"{side}_hand_{i:02d}" for side in ("left", "right") for i in range(21))
# github.com/Fang-Haoshu/Halpe-FullBody and github.com/jin-s13/COCO-WholeBody
HALPE_26 = (
    *COCO_17,
    *"head neck mid_hip left_big_toe right_big_toe left_small_toe right_small_toe left_heel right_heel".split(),
)
HALPE_136 = (*HALPE_26, *FACE_68, *HANDS_42)
WHOLEBODY_133 = (
    *COCO_17,
    *"left_big_toe left_small_toe left_heel right_big_toe right_small_toe right_heel".split(),
    *FACE_68,
    *HANDS_42,
)
# keypoint lists that their length tells apart
BY_COUNT = {len(names): names for names in (COCO_17, COCO_18, HALPE_26, MLKIT_33, WHOLEBODY_133, HALPE_136)}

_JOINT_BONES = (
    "nose-left_eye nose-right_eye left_eye-left_ear right_eye-right_ear left_shoulder-right_shoulder "
    "left_shoulder-left_elbow left_elbow-left_wrist right_shoulder-right_elbow right_elbow-right_wrist "
    "left_wrist-left_index right_wrist-right_index left_shoulder-left_hip right_shoulder-right_hip "
    "left_hip-right_hip left_hip-left_knee left_knee-left_ankle right_hip-right_knee right_knee-right_ankle "
    "left_ankle-left_heel right_ankle-right_heel left_heel-left_foot_index right_heel-right_foot_index "
    "left_heel-left_big_toe right_heel-right_big_toe"
)
_MARKER_BONES = (
    "LFHD-RFHD LFHD-LBHD RFHD-RBHD LBHD-RBHD C7-CLAV CLAV-STRN C7-T10 CLAV-LSHO CLAV-RSHO LSHO-LELB LELB-LWRA "
    "LELB-LWRB LWRA-LFIN LWRB-LFIN RSHO-RELB RELB-RWRA RELB-RWRB RWRA-RFIN RWRB-RFIN LASI-RASI LASI-LPSI RASI-RPSI "
    "LPSI-RPSI LASI-LTHI LTHI-LKNE LKNE-LTIB LTIB-LANK LANK-LHEE LANK-LTOE LHEE-LTOE RASI-RTHI RTHI-RKNE RKNE-RTIB "
    "RTIB-RANK RANK-RHEE RANK-RTOE RHEE-RTOE"
)
BONES = tuple(tuple(bone.split("-")) for bone in f"{_JOINT_BONES} {_MARKER_BONES}".split())


_LEG = re.compile(
    r"(left|right)_(hip|knee|ankle|heel|foot_index|big_toe|small_toe)|[LR](ASI|PSI|THI|KNE|TIB|ANK|HEE|TOE)"
)
_LIMB_PARTS = (
    ("elbow", "wrist", "pinky", "index", "thumb"),
    ("knee", "ankle", "heel", "foot_index", "big_toe", "small_toe"),
)
# joints of a limb and the same ones of the limb that a detector may take for it
LIMBS = tuple(
    tuple(tuple(f"{side}_{part}" for part in parts) for side in sides)
    for parts in _LIMB_PARTS
    for sides in (("left", "right"), ("right", "left"))
)


def is_leg(name: str) -> bool:
    """Whether a joint or marker belongs to the legs, hips included."""
    return _LEG.fullmatch(name) is not None


def mirrored(name: str) -> str:
    """The name of the same joint or marker on the other side of the body."""
    if name.startswith(("left_", "right_")):
        return name.replace("left_", "right_", 1) if name[0] == "l" else name.replace("right_", "left_", 1)
    if re.fullmatch(r"[LR][A-Z0-9]{3}", name) and name in PLUG_IN_GAIT_39:
        other = ("R" if name[0] == "L" else "L") + name[1:]
        return other if other in PLUG_IN_GAIT_39 else name
    return name


def side_of(name: str) -> str:
    """`left`, `right` or `middle`: on which side of the body a joint or marker is."""
    if mirrored(name) == name:
        return "middle"
    return "left" if name[0] in "lL" else "right"


def swap_index(names: Sequence[str]) -> Ints:
    """Index (J,) that exchanges left and right: `uv[..., swap_index(names), :]`. Unpaired joints stay."""
    where = {name: i for i, name in enumerate(names)}
    return np.array([where.get(mirrored(name), i) for i, name in enumerate(names)])


def bones_of(names: Sequence[str]) -> Ints:
    """Pairs of indices (B, 2) into `names` of the bones whose both ends are there."""
    where = {name: i for i, name in enumerate(names)}
    return np.array([(where[a], where[b]) for a, b in BONES if a in where and b in where]).reshape(-1, 2)
