"""The body: segment lengths of a subject, and landmarks and skin markers from the poses of its segments.

Lengths are fractions of the body height by Drillis and Contini (1966) as in Winter, Biomechanics and Motor Control of
Human Movement, 4th ed., fig. 4.1. Segment axes: x forward, y left, z up, metres; a skin marker lies on the surface,
a landmark at the joint centre.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Floats
from dior.body.names import MLKIT_33, PLUG_IN_GAIT_39
from dior.simulate.settings import Settings, generator, person

# origin (T, 3) and axes (T, 3, 3) of a segment, columns forward, left, up; segments by name
Segment: TypeAlias = tuple[Floats, Floats]
Segments: TypeAlias = dict[str, Segment]
# markers of 14 mm, the size usual for whole bodies
MARKER_RADIUS_M = 0.007

# Body heights; of the other parts of a body only the height is known. Said here, not taken from `dior.body`, on
# purpose: the steps judge bodies by their own table, and a slip in one of the two shows against the other.
THIGH, SHANK, HALF_HIPS, HALF_SHOULDERS, UPPER_ARM, FOREARM, TRUNK = 0.245, 0.246, 0.052, 0.112, 0.186, 0.146, 0.288
# How people of one height differ: standard deviations of the legs as a share of their length, with the trunk making up
# for it, and of the other lengths. Trotter and Gleser, Am. J. Phys. Anthropol. 10 (1952) 463-514, white men: stature
# follows from femur, tibia, humerus or radius to 3.27, 3.37, 4.05 and 4.32 cm, with slopes of 2.38, 2.52, 3.08 and
# 3.78. With statures that scatter by 6.6 cm (our assumption) that leaves 2.5, 3.0, 3.1 and 3.4 % of these lengths at a
# given stature. The breadths' spread is our assumption: a little more, since they follow stature less.
LEGS_SD, LENGTH_SD, BREADTH_SD = 0.025, 0.03, 0.04


@dataclass(frozen=True)
class Body:
    """Segment lengths of one person, m; the shares are body heights."""

    height: float
    thigh_share: float = THIGH
    shank_share: float = SHANK
    half_hips_share: float = HALF_HIPS
    half_shoulders_share: float = HALF_SHOULDERS
    upper_arm_share: float = UPPER_ARM
    forearm_share: float = FOREARM
    trunk_share: float = TRUNK

    def part(self, fraction: Any) -> Any:
        return fraction * self.height

    @property
    def thigh(self) -> float:
        return self.part(self.thigh_share)

    @property
    def shank(self) -> float:
        return self.part(self.shank_share)

    @property
    def long_legs(self) -> float:
        """How much longer the legs are than those of the average body of this height, as a factor."""
        return (self.thigh_share + self.shank_share) / (THIGH + SHANK)

    @property
    def ankle_height(self) -> float:
        return self.part(0.039)

    @property
    def heel(self) -> Floats:
        """Lowest point of the heel from the ankle centre in the foot's axes (x, z)."""
        return np.array([-self.part(0.030), -self.ankle_height])

    @property
    def ball(self) -> Floats:
        """Lowest point of the ball of the foot from the ankle centre in the foot's axes (x, z)."""
        return np.array([self.part(0.085), -self.ankle_height])

    @property
    def half_hips(self) -> float:
        return self.part(self.half_hips_share)

    @property
    def half_shoulders(self) -> float:
        return self.part(self.half_shoulders_share)

    @property
    def upper_arm(self) -> float:
        return self.part(self.upper_arm_share)

    @property
    def forearm(self) -> float:
        return self.part(self.forearm_share)

    @property
    def trunk(self) -> float:
        """From the middle of the hips to the middle of the shoulders."""
        return self.part(self.trunk_share)


def body_of(settings: Settings, subject: str) -> Body:
    """The body of a subject: height drawn between 1.66 and 1.84 m, mm; proportions where people differ in them."""
    who = person(settings, subject)
    height = round(float(generator(settings, "body", who).uniform(1.66, 1.84)), 3)
    if settings.people != "different":
        return Body(height)
    legs, split, arms, fore, hips, shoulders = generator(settings, "proportions", who).standard_normal(6).tolist()
    longer = 1 + LEGS_SD * legs
    return Body(
        height,
        thigh_share=THIGH * longer * (1 + LENGTH_SD / 2 * split),
        shank_share=SHANK * longer * (1 - LENGTH_SD / 2 * split),
        half_hips_share=HALF_HIPS * (1 + BREADTH_SD * hips),
        half_shoulders_share=HALF_SHOULDERS * (1 + BREADTH_SD * shoulders),
        upper_arm_share=UPPER_ARM * (1 + LENGTH_SD * arms),
        forearm_share=FOREARM * (1 + LENGTH_SD * fore),
        trunk_share=TRUNK - (THIGH + SHANK) * LEGS_SD * legs,
    )


# Landmarks: position in the segment's axes as fractions of the body height; those of the left are mirrored for the
# right side. Chosen by eye: a face and a hand of usual shape. Head: origin at the middle of the ears (0.936 H up,
# Drillis and Contini's eye height).
_HEAD = {
    "nose": (0.063, 0.0, -0.012),
    "left_eye_inner": (0.054, 0.010, 0.010),
    "left_eye": (0.052, 0.018, 0.010),
    "left_eye_outer": (0.047, 0.026, 0.010),
    "left_ear": (0.0, 0.042, 0.0),
    "left_mouth": (0.052, 0.014, -0.034),
}
_HAND = {"left_pinky": (0.0, -0.016, -0.050), "left_index": (0.0, 0.016, -0.052), "left_thumb": (0.008, 0.024, -0.028)}

# Markers on the skin, fractions of the body height in the axes of their segment (the surface of
# an average build, chosen by eye).
_MARKERS = {
    "head": {"LFHD": (0.042, 0.034, 0.030), "LBHD": (-0.040, 0.032, 0.028)},
    "chest": {"LSHO": (0.0, 0.100, 0.036)},
    "pelvis": {"LASI": (0.058, 0.070, 0.052), "LPSI": (-0.066, 0.028, 0.058)},
    "upper_arm": {"LUPA": (0.0, 0.030, -0.095), "LELB": (0.0, 0.027, -0.184)},
    "forearm": {"LFRM": (0.006, 0.024, -0.075), "LWRA": (0.016, 0.006, -0.146), "LWRB": (-0.016, 0.006, -0.146)},
    "hand": {"LFIN": (0.0, 0.014, -0.045)},
    "thigh": {"LTHI": (0.0, 0.048, -0.140), "LKNE": (0.0, 0.034, -0.243)},
    "shank": {"LTIB": (0.0, 0.031, -0.130), "LANK": (0.0, 0.024, -0.245)},
    "foot": {"LHEE": (-0.036, 0.0, -0.012), "LTOE": (0.082, 0.0, -0.010)},
}
_MIDDLE = {
    "C7": ("chest", (-0.040, 0.0, 0.036)),
    "T10": ("chest", (-0.066, 0.0, -0.085)),
    "CLAV": ("chest", (0.043, 0.0, -0.006)),
    "STRN": ("chest", (0.068, 0.0, -0.090)),
    "RBAK": ("chest", (-0.056, -0.050, -0.050)),
}


def landmarks(body: Body, segments: Segments) -> Floats:
    """The 33 landmarks (T, 33, 3) in ML Kit's order.

    `segments` maps a segment's name (`head`, `chest`, `pelvis`; `left_thigh` and so on) to (origin (T, 3), axes
    (T, 3, 3), columns forward, left, up).
    """
    points: dict[str, Floats] = {}
    for name, offset in _HEAD.items():
        points |= _both(body, segments["head"], segments["head"], name, offset)
    for side in ("left", "right"):
        for joint, segment in (("shoulder", "upper_arm"), ("elbow", "forearm"), ("wrist", "hand"), ("hip", "thigh")):
            points[f"{side}_{joint}"] = segments[f"{side}_{segment}"][0]
        points[f"{side}_knee"] = segments[f"{side}_shank"][0]
        points[f"{side}_ankle"] = segments[f"{side}_foot"][0]
        heel, ball = body.heel, body.ball
        rise = body.part(0.014)
        points[f"{side}_heel"] = _at(segments[f"{side}_foot"], (heel[0], 0.0, heel[1] + rise))
        points[f"{side}_foot_index"] = _at(segments[f"{side}_foot"], (ball[0] + body.part(0.012), 0.0, ball[1] + rise))
    for name, offset in _HAND.items():
        points |= _both(body, segments["left_hand"], segments["right_hand"], name, offset)
    return np.stack([points[name] for name in MLKIT_33], axis=1)


def markers(body: Body, segments: Segments) -> Floats:
    """The 39 Plug-in-Gait markers (T, 39, 3) in the order of `PLUG_IN_GAIT_39`; `segments` as for `landmarks`."""
    scale = _proportions(body)
    points = {
        name: _at(segments[s], body.part(np.array(offset)) * scale.get(s, 1.0)) for name, (s, offset) in _MIDDLE.items()
    }
    for segment, offsets in _MARKERS.items():
        left = segments.get(segment) or segments[f"left_{segment}"]
        right = segments.get(segment) or segments[f"right_{segment}"]
        for name, offset in offsets.items():
            points |= _both(body, left, right, name, np.array(offset) * scale.get(segment, 1.0))
    return np.stack([points[name] for name in PLUG_IN_GAIT_39], axis=1)


def _proportions(body: Body) -> dict[str, Floats]:
    """By how much a segment is larger than that of the average body of this height: forward, left, up."""
    shoulders, hips = body.half_shoulders_share / HALF_SHOULDERS, body.half_hips_share / HALF_HIPS
    return {
        "chest": np.array([1.0, shoulders, body.trunk_share / TRUNK]),
        "pelvis": np.array([1.0, hips, 1.0]),
        "upper_arm": np.array([1.0, 1.0, body.upper_arm_share / UPPER_ARM]),
        "forearm": np.array([1.0, 1.0, body.forearm_share / FOREARM]),
        "thigh": np.array([1.0, 1.0, body.thigh_share / THIGH]),
        "shank": np.array([1.0, 1.0, body.shank_share / SHANK]),
    }


def _at(segment: Segment, offset: ArrayLike) -> Floats:
    origin, axes = segment
    return origin + axes @ np.asarray(offset, float)


def _both(body: Body, left: Segment, right: Segment, name: str, offset: ArrayLike) -> dict[str, Floats]:
    """A point and its mirror image on the other side, by name; a point without a side is given once."""
    here = body.part(np.array(offset))
    if not name.startswith(("left_", "L")):
        return {name: _at(left, here)}
    other = "right_" + name[5:] if name.startswith("left_") else "R" + name[1:]
    return {name: _at(left, here), other: _at(right, here * (1, -1, 1))}
