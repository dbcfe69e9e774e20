"""A second person who stands or walks beside the walkway for a part of the recording.

OUTPUT   `SecondPerson`: the landmarks at the pictures of a camera, and what the camera sees of them
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.names import MLKIT_33, swap_index
from dior.geometry.camera import Camera
from dior.simulate import scene
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.simulate.settings import Sequence, Settings, generator

# chosen, in view of several cameras and in the way of none: azimuth (degrees) and distance (m) from the middle of the
# walkway
PLACES = {"indoor": (90.0, 3.3), "outdoor": (-30.0, 3.3)}
# chosen: m, the middle of the loop on which a second person walks; before and behind the subject, by camera
LOOP_AT = (0.0, -2.2)
# chosen: amplitude at the top of the head and period of the sway of somebody who stands
SWAY_M, SWAY_S = 0.015, 3.7
SUBJECT = "S00"
_LEFT = [i for i, name in enumerate(MLKIT_33) if name.startswith("left_")]
_RIGHT = swap_index(MLKIT_33)[_LEFT].tolist()


@dataclass(frozen=True, eq=False)
class SecondPerson:
    """Of a second person: landmarks (P, 33, 3) m, pixels (P, 33, 2), depths and which are in the picture (P, 33), and
    when the person is there (P,); a row per picture.
    """

    height: float
    landmarks: Floats
    uv: Floats
    depth: Floats
    inside: Bools
    present: Bools


@dataclass(frozen=True, eq=False)
class Bystander:
    """Landmarks (P, 33, 3) m of a second person of that `height` m, and when the person is there (P,)."""

    height: float
    landmarks: Floats
    present: Bools


def seen(settings: Settings, sequence: Sequence, camera: Camera, seconds: Floats) -> SecondPerson:
    """`SecondPerson` by a camera at `seconds` (P,); NaN where there is nobody in the whole recording."""
    count = len(seconds)
    if not settings.bystander:
        nowhere, never = np.full((count, len(MLKIT_33), 3), np.nan), np.zeros((count, len(MLKIT_33)), bool)
        return SecondPerson(np.nan, nowhere, nowhere[..., :2], nowhere[..., 2], never, never[:, 0])
    one = at(settings, sequence, seconds)
    uv, depth = scene.project(camera, one.landmarks)
    uv = np.where((depth > 0)[..., None], uv, np.nan)
    inside = scene.in_picture(camera.intrinsics, uv)
    return SecondPerson(one.height, one.landmarks, uv, depth, inside, one.present)


def at(settings: Settings, sequence: Sequence, seconds: Floats) -> Bystander:
    """`Bystander` of a recording at `seconds` (P,)."""
    draw = generator(settings, "bystander", sequence.name)
    body = Body(round(float(draw.uniform(1.66, 1.84)), 3))
    length = settings.bystander * settings.duration_s
    begin = draw.uniform(0.0, settings.duration_s - length)
    first = settings.clocks.start_delay_s[0] if sequence.environment == "indoor" else 0.0
    present = (seconds >= first + begin) & (seconds < first + begin + length)
    if settings.bystander_walks:
        walker = Walker(body, start=float(draw.uniform(0.0, 8.0)), until=float(seconds.max(initial=0.0)) + 1.0)
        landmarks = walker.at(seconds)[0] + (*LOOP_AT, 0.0)
    else:
        landmarks = _swaying(body, sequence.environment, seconds)
    return Bystander(body.height, landmarks, present)


def _swaying(body: Body, environment: str, seconds: Floats) -> Floats:
    """Landmarks (P, 33, 3) m of a body that stands in its place at `seconds` (P,)."""
    azimuth, distance = PLACES[environment]
    angle = np.deg2rad(azimuth)
    points = standing(body, np.array([distance * np.cos(angle), distance * np.sin(angle)]), angle + np.pi)
    height = points[:, 2:] / body.height
    sway = SWAY_M * np.stack([np.sin(2 * np.pi * seconds / SWAY_S), np.cos(4.4 * seconds / SWAY_S)], axis=-1)
    landmarks = np.repeat(points[None], len(seconds), axis=0)
    landmarks[..., :2] += sway[:, None] * height
    return landmarks


def standing(body: Body, place: Floats, heading: float) -> Floats:
    """Landmarks (33, 3) m of a body that stands at `place` (2,) m and looks along `heading` (rad)."""
    return _turned(_upright(body), heading) + (*place, 0.0)


@cache
def _upright(body: Body) -> Floats:
    """Landmarks (33, 3) m of a body that stands at the origin and looks along x."""
    walking = Walker(body, until=2.0).at(np.linspace(0.0, 2.0, 80))[0]
    left_ankle, right_ankle = (MLKIT_33.index(f"{side}_ankle") for side in ("left", "right"))
    apart = np.linalg.norm(walking[:, left_ankle, :2] - walking[:, right_ankle, :2], axis=-1)
    # of one stride, the picture in which the feet are side by side; the leg that stands, on both sides
    points = walking[apart.argmin()]
    hips = points[[MLKIT_33.index("left_hip"), MLKIT_33.index("right_hip")]]
    left = hips[0] - hips[1]
    points = _turned(points - (*hips.mean(axis=0)[:2], 0.0), -np.arctan2(-left[0], left[1]))
    below, other = (_LEFT, _RIGHT) if points[left_ankle, 2] < points[right_ankle, 2] else (_RIGHT, _LEFT)
    points[other] = points[below] * (1.0, -1.0, 1.0)
    points[MLKIT_33.index("nose"), 1] = 0.0
    return points


def _turned(points: Floats, angle: float) -> Floats:
    """Points (..., 3) turned about the vertical axis by `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
