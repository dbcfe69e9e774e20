"""The body: segment lengths of a subject, and landmarks and skin markers from the poses of its segments.

Lengths are fractions of the body height by Drillis and Contini (1966) as in Winter, Biomechanics and Motor Control of
Human Movement, 4th ed., fig. 4.1. Segment axes: x forward, y left, z up, metres; a skin marker lies on the surface,
a landmark at the joint centre.
"""

from dataclasses import dataclass

import numpy as np

from dior.simulate.settings import generator
from dior.skeletons import MLKIT_33, PLUG_IN_GAIT_39

MARKER_RADIUS_M = 0.007


@dataclass(frozen=True)
class Body:
    """Segment lengths of one person, m."""

    height: float

    def part(self, fraction):
        return fraction * self.height

    @property
    def thigh(self):
        return self.part(0.245)

    @property
    def shank(self):
        return self.part(0.246)

    @property
    def ankle_height(self):
        return self.part(0.039)

    @property
    def heel(self):
        """Lowest point of the heel from the ankle centre in the foot's axes (x, z)."""
        return np.array([-self.part(0.030), -self.ankle_height])

    @property
    def ball(self):
        """Lowest point of the ball of the foot from the ankle centre in the foot's axes (x, z)."""
        return np.array([self.part(0.085), -self.ankle_height])

    @property
    def half_hips(self):
        return self.part(0.052)

    @property
    def half_shoulders(self):
        return self.part(0.112)

    @property
    def upper_arm(self):
        return self.part(0.186)

    @property
    def forearm(self):
        return self.part(0.146)

    @property
    def trunk(self):
        """From the middle of the hips to the middle of the shoulders."""
        return self.part(0.288)


def body_of(settings, subject):
    """The body of a subject: height drawn between 1.66 and 1.84 m, mm."""
    return Body(round(float(generator(settings, "body", subject).uniform(1.66, 1.84)), 3))


# Landmarks: segment and position in the segment's axes as fractions of the body height; `L` rows are mirrored for the
# right side. Head: origin at the middle of the ears (0.936 H up, Drillis and Contini's eye height).
_HEAD = {
    "nose": (0.063, 0.0, -0.012),
    "left_eye_inner": (0.054, 0.010, 0.010),
    "left_eye": (0.052, 0.018, 0.010),
    "left_eye_outer": (0.047, 0.026, 0.010),
    "left_ear": (0.0, 0.042, 0.0),
    "left_mouth": (0.052, 0.014, -0.034),
}
_HAND = {"left_pinky": (0.0, -0.016, -0.050), "left_index": (0.0, 0.016, -0.052), "left_thumb": (0.008, 0.024, -0.028)}

# Markers on the skin, fractions of the body height in the axes of their segment (the surface of an average build).
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


def landmarks(body, segments):
    """The 33 landmarks (T, 33, 3) in ML Kit's order.

    `segments` maps a segment's name (`head`, `chest`, `pelvis`; `left_thigh` and so on) to (origin (T, 3), axes
    (T, 3, 3), columns forward, left, up).
    """
    points = {}
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


def markers(body, segments):
    """The 39 Plug-in-Gait markers (T, 39, 3) in the order of `PLUG_IN_GAIT_39`; `segments` as for `landmarks`."""
    points = {name: _at(segments[s], body.part(np.array(offset))) for name, (s, offset) in _MIDDLE.items()}
    for segment, offsets in _MARKERS.items():
        left = segments.get(segment) or segments[f"left_{segment}"]
        right = segments.get(segment) or segments[f"right_{segment}"]
        for name, offset in offsets.items():
            points |= _both(body, left, right, name, offset)
    return np.stack([points[name] for name in PLUG_IN_GAIT_39], axis=1)


def _at(segment, offset):
    origin, axes = segment
    return origin + axes @ np.asarray(offset, float)


def _both(body, left, right, name, offset):
    """A point and its mirror image on the other side, by name; a point without a side is given once."""
    here = body.part(np.array(offset))
    if not name.startswith(("left_", "L")):
        return {name: _at(left, here)}
    other = "right_" + name[5:] if name.startswith("left_") else "R" + name[1:]
    return {name: _at(left, here), other: _at(right, here * (1, -1, 1))}
