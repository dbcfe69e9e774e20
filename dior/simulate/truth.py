"""What is true of a simulated walk, and the tables that say so.

INPUTS   settings and a sequence's name
OUTPUTS  `View` of each camera in memory; truth/<sequence>/{labels_2d,skeletons_3d,cameras,detections,contacts,angles}
         .parquet, the last two without rows where the motion is that of a C3D; of the second person, where everybody is
         detected, second_{labels_2d,skeletons_3d}.parquet
Indoors the joints are the markers and, after them, the landmarks; outdoors the landmarks. World metres, Z up; pixels
as recorded.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Table
from dior.body.names import MLKIT_33
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.simulate import bystander, draw, scene
from dior.simulate.bystander import SecondPerson
from dior.simulate.clocks import Clock, clocks_of
from dior.simulate.gait import Contacts
from dior.simulate.motion import Motion, mocap_lasts, motion_of
from dior.simulate.settings import Sequence, Settings, generator
from dior.tables import tables

# chosen to fit `draw`: how deep a joint lies below the drawn surface around it, as a fraction of the body height
DEPTH = {"hip": 0.075, "shoulder": 0.055, "knee": 0.048, "elbow": 0.038, "ankle": 0.034, "wrist": 0.028}
DEPTH_OTHER = 0.03
DEPTH_FACE = 0.066
FACE = ("nose", "eye", "ear", "mouth", "FHD", "BHD")


@dataclass(frozen=True, eq=False)
class View:
    """One camera of one walk, a row per picture of its clock: times (P,) s, landmarks (P, 33, 3), and of every joint
    (P, J) pixel, depth and status. In the tables a picture that is recorded twice is two frames.
    """

    placed: scene.Placed
    clock: Clock
    seconds: Floats
    landmarks: Floats
    joints: tuple[str, ...]
    uv: Floats
    depth: Floats
    status: NDArray[np.str_]

    @property
    def camera(self) -> Camera:
        return self.placed.camera

    def landmark(self, values: NDArray[Any]) -> NDArray[Any]:
        """The columns of values (F, J, ...) that belong to the 33 landmarks."""
        return values[:, [self.joints.index(name) for name in MLKIT_33]]


@dataclass(frozen=True, eq=False)
class Detected:
    """What a detector gives, and what was done to it: a row per picture, a column per landmark as it is named.

    Pixels (P, 33, 2), scores (P, 33), relative depth (P, 33) px, and where there is a person (P,). Of the pixels, the
    noise and the constant offset (P, 33, 2) px, NaN where it is another person's; whether the landmark is the one of
    the other side, was hidden, lies on the other limb, or is the second person's (P, 33).
    """

    uv: Floats
    score: Floats
    z: Floats
    found: Bools
    noise: Floats
    bias: Floats
    swapped: Bools
    guessed: Bools
    wrong_together: Bools
    bystander: Bools


def view(settings: Settings, sequence: Sequence, motion: Motion, camera: str) -> View:
    """`View` of the camera of that name."""
    placed = scene.cameras_of(settings, sequence.session)[camera]
    clocks, _ = clocks_of(settings, sequence)
    seconds = clocks[camera].seconds
    joints, points, known, landmarks = _joints(sequence, motion, seconds)
    behind = _behind_others(settings, sequence, placed.camera, seconds, points)
    return _seen(placed, clocks[camera], joints, points, known, landmarks, motion.height, behind)


def second_view(settings: Settings, sequence: Sequence, subject: View, height: float, other: SecondPerson) -> View:
    """`View` of the second person, whom the subject of that `height` (m) hides where he is nearer; the landmarks alone,
    missing while the person is not there."""
    camera, landmarks = subject.camera, np.nan_to_num(other.landmarks)
    behind = np.zeros(landmarks.shape[:2], bool)
    if sequence.environment == "outdoor":
        behind |= scene.behind_wall(settings, camera, landmarks)
    behind |= draw.hidden(camera, draw.figure(subject.landmarks, height), height, landmarks, np.zeros(len(MLKIT_33)))
    known = np.repeat(other.present[:, None], len(MLKIT_33), axis=1)
    return _seen(subject.placed, subject.clock, MLKIT_33, landmarks, known, landmarks, other.height, behind)


def _seen(
    placed: scene.Placed,
    clock: Clock,
    joints: tuple[str, ...],
    points: Floats,
    known: Bools,
    landmarks: Floats,
    height: float,
    behind: Bools,
) -> View:
    """`View` of points (F, J, 3) m of a body with `landmarks` (F, 33, 3) m; `behind` (F, J) something else."""
    uv, depth = scene.project(placed.camera, points)
    inside = scene.in_picture(placed.camera.intrinsics, uv)
    slack = height * np.array([depth_below_surface(name) for name in joints])
    hidden = behind | draw.hidden(placed.camera, draw.figure(landmarks, height), height, points, slack)
    status = np.select(
        [~known, depth <= 0, ~inside, hidden],
        ["missing_3d", "behind_camera", "out_of_frame", "occluded"],
        "ok",
    )
    uv = np.where((known & (depth > 0))[..., None], uv, np.nan)
    return View(placed, clock, clock.seconds, landmarks, joints, uv, np.where(known, depth, np.nan), status)


def _joints(sequence: Sequence, motion: Motion, seconds: Floats) -> tuple[tuple[str, ...], Floats, Bools, Floats]:
    """Names, points (T, J, 3), whether each is known (T, J), and the landmarks (T, 33, 3) at some times."""
    landmarks, markers = motion.at(seconds)
    everywhere = np.ones(landmarks.shape[:2], bool)
    if sequence.environment == "outdoor":
        return MLKIT_33, landmarks, everywhere, landmarks
    points = np.concatenate([markers, landmarks], axis=1)
    known = np.concatenate([motion.seen(seconds), everywhere], axis=1)
    return (*motion.names, *MLKIT_33), points, known, landmarks


def depth_below_surface(name: str) -> float:
    if any(part in name for part in FACE):
        return DEPTH_FACE
    return next((depth for part, depth in DEPTH.items() if name.endswith(part)), DEPTH_OTHER)


def _behind_others(settings: Settings, sequence: Sequence, camera: Camera, seconds: Floats, points: Floats) -> Bools:
    """Whether points (F, J, 3) are hidden behind the second person, outdoors also behind the wall: (F, J) bool."""
    out = np.zeros(points.shape[:2], bool)
    if sequence.environment == "outdoor":
        out |= scene.behind_wall(settings, camera, points)
    other = bystander.seen(settings, sequence, camera, seconds) if settings.bystander else None
    if other is not None and other.present.any():
        there = other.present
        figure = draw.figure(other.landmarks[there], other.height)
        out[there] |= draw.hidden(camera, figure, other.height, points[there], np.zeros(points.shape[1]))
    return out


def mocap_seconds(settings: Settings) -> Floats:
    """Times (T,) s of the C3D's ticks: the recording and a little more, since the cameras start later."""
    return np.arange(int(round(mocap_lasts(settings) * settings.mocap_hz)) + 1) / settings.mocap_hz


def write(
    settings: Settings, sequence: Sequence, views: dict[str, View], found: dict[str, Detected], folder: Path
) -> None:
    """Write the truth of a sequence. `views`: camera -> `View`; `found`: camera -> `Detected`."""
    tables.write(folder / "labels_2d.parquet", "labels_2d", _stacked(_labels(sequence, v) for v in views.values()))
    motion = motion_of(settings, sequence)
    tables.write(folder / "skeletons_3d.parquet", "skeletons_3d", _skeleton(settings, sequence, motion, views))
    cameras = [v.camera for v in views.values()]
    camera_tables.write_cameras(
        folder / "cameras.parquet",
        cameras,
        sequence.session,
        sequence.name,
        [v.clock.offset_s for v in views.values()],
        [v.clock.drift_ppm for v in views.values()],
    )
    tables.write(
        folder / "detections.parquet",
        "simulated_detections",
        _stacked(_detections(views[camera], done) for camera, done in found.items()),
    )
    tables.write(folder / "contacts.parquet", "contacts", _contacts(settings, sequence, motion, views))
    tables.write(folder / "angles.parquet", "simulated_angles", _angles(settings, sequence, motion, views))


def write_second(settings: Settings, sequence: Sequence, views: dict[str, View], folder: Path) -> None:
    """Write the truth of the second person, `sequence.subject`; null where nobody is there."""
    tables.write(
        folder / "second_labels_2d.parquet", "labels_2d", _stacked(_labels(sequence, v) for v in views.values())
    )
    seconds = _instants(settings, sequence, views)
    other = bystander.at(settings, sequence, seconds)
    points, known = other.landmarks, np.repeat(other.present[:, None], len(MLKIT_33), axis=1)
    skeleton = _skeleton_of(settings, sequence, seconds, MLKIT_33, points, known)
    tables.write(folder / "second_skeletons_3d.parquet", "skeletons_3d", skeleton)


def _stacked(parts: Iterable[Table]) -> Table:
    parts = list(parts)
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _labels(sequence: Sequence, seen: View) -> Table:
    shown, each = seen.clock.messages, seen.depth.shape[1]
    count = len(shown)
    rows = count * each
    return {
        "subject": np.full(rows, sequence.subject, object),
        "sequence": np.full(rows, sequence.name, object),
        "camera": np.full(rows, seen.camera.name, object),
        "joint": np.tile(np.array(seen.joints, object), count),
        "frame": np.repeat(np.arange(count), each),
        "stamp_ns": np.repeat(seen.clock.stamp_ns[shown], each),
        "u": seen.uv[shown, :, 0].ravel(),
        "v": seen.uv[shown, :, 1].ravel(),
        "depth": seen.depth[shown].ravel(),
        "status": seen.status[shown].ravel().astype(object),
    }


def _instants(settings: Settings, sequence: Sequence, views: dict[str, View]) -> Floats:
    """Times (T,) s of the instants of the truth."""
    if sequence.environment == "indoor":
        return mocap_seconds(settings)
    last = max(v.seconds[-1] for v in views.values())
    return np.arange(int(np.floor(last * settings.fps)) + 1) / settings.fps


def _contacts(settings: Settings, sequence: Sequence, motion: Motion, views: dict[str, View]) -> Table:
    """When the subject's feet touch the floor and leave it, in the time of the truth."""
    known = motion.contacts
    if known is None:
        known = Contacts(np.empty(0), np.empty(0, int), np.empty(0, bool), np.empty((0, 2)))
    instants, (_, t0) = _instants(settings, sequence, views), clocks_of(settings, sequence)
    rows = np.flatnonzero((known.seconds >= instants[0]) & (known.seconds <= instants[-1]))
    return {
        "subject": np.full(len(rows), sequence.subject, object),
        "sequence": np.full(len(rows), sequence.name, object),
        "foot": np.array(["left", "right"], object)[known.foot[rows]],
        "event": np.where(known.strike[rows], "heel_strike", "toe_off").astype(object),
        "stamp_ns": t0 + np.round(known.seconds[rows] * 1e9).astype(np.int64),
        "x": known.heel[rows, 0],
        "y": known.heel[rows, 1],
    }


def _angles(settings: Settings, sequence: Sequence, motion: Motion, views: dict[str, View]) -> Table:
    """The subject's joint angles at the instants of the truth."""
    instants, (_, t0) = _instants(settings, sequence, views), clocks_of(settings, sequence)
    found = motion.angles(instants) if motion.angles else {}
    rows = len(found) * len(instants)
    return {
        "subject": np.full(rows, sequence.subject, object),
        "sequence": np.full(rows, sequence.name, object),
        "stamp_ns": np.repeat(t0 + np.round(instants * 1e9).astype(np.int64), len(found)),
        "angle": np.tile(np.array(list(found), object), len(instants)),
        "value": np.stack(list(found.values()), axis=-1).ravel() if found else np.empty(0),
    }


def _skeleton(settings: Settings, sequence: Sequence, motion: Motion, views: dict[str, View]) -> Table:
    seconds = _instants(settings, sequence, views)
    joints, points, known, _ = _joints(sequence, motion, seconds)
    return _skeleton_of(settings, sequence, seconds, joints, points, known)


def _skeleton_of(
    settings: Settings, sequence: Sequence, seconds: Floats, joints: tuple[str, ...], points: Floats, known: Bools
) -> Table:
    _, t0 = clocks_of(settings, sequence)
    points = np.where(known[..., None], points, np.nan)
    count, each = known.shape
    return {
        "subject": np.full(count * each, sequence.subject, object),
        "sequence": np.full(count * each, sequence.name, object),
        "joint": np.tile(np.array(joints, object), count),
        "instant": np.repeat(np.arange(count), each),
        "stamp_ns": np.repeat(t0 + np.round(seconds * 1e9).astype(np.int64), each),
        **{axis: points[..., i].ravel() for i, axis in enumerate("xyz")},
        "n_views": np.full(count * each, -1),
        "status": np.where(known, "ok", "too_few_views").ravel().astype(object),
    }


def _detections(seen: View, done: Detected) -> Table:
    shown, each = seen.clock.messages, done.noise.shape[1]
    count, somebody = len(shown), done.found[:, None]
    errors = {"noise_u": done.noise[..., 0], "noise_v": done.noise[..., 1]}
    errors |= {"bias_u": done.bias[..., 0], "bias_v": done.bias[..., 1]}
    flags = {key: getattr(done, key) & somebody for key in ("swapped", "guessed", "wrong_together", "bystander")}
    return {
        "camera": np.full(count * each, seen.camera.name, object),
        "frame": np.repeat(np.arange(count), each),
        "stamp_ns": np.repeat(seen.clock.stamp_ns[shown], each),
        "person": np.repeat(np.where(done.found, 0, -1)[shown], each),
        "joint": np.tile(np.array(MLKIT_33, object), count),
        **{key: np.where(somebody, values, np.nan)[shown].ravel() for key, values in errors.items()},
        "missed": np.repeat(~done.found[shown], each),
        **{key: values[shown].ravel() for key, values in flags.items()},
    }


def detector_generator(settings: Settings, sequence: Sequence, camera: str) -> np.random.Generator:
    """The generator of a camera's detector in a sequence."""
    return generator(settings, "detector", sequence.name, camera)
