"""A small release with known truth, in the layout of the real one: two people, indoors and outdoors, two cameras."""

import shutil

import cv2
import numpy as np

from dior.body.coco17 import coco17
from dior.body.names import COCO_17, MLKIT_33, PLUG_IN_GAIT_39
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.label.reproject import labels
from dior.release import checksums
from dior.simulate import settings
from dior.simulate.motion import motion_of
from dior.tables import tables

PICTURES, FPS, MOCAP_HZ = 12, 30.0, 100.0
START_NS = 1_700_000_000_000_000_000
# the cameras' clocks are wrong by this, s: the labels were made at the right time, the stamps are as recorded
LATE_S = 0.0213
# subject, sequence, session, order, environment, outfit, walk
WALKS = (
    ("pb22", "walk_3", "lab", 2, "indoor", "coat", "line"),
    ("pa11", "walk_1", "lab", 1, "indoor", "shirt", "line"),
    ("pa11", "walk_2", "field", 1, "outdoor", "shirt", "line"),
    ("pb22", "walk_4", "field", 2, "outdoor", "coat", "circle"),
)
PART = {"pa11": "train", "pb22": "test"}
CAMERAS = ("cam01", "cam02")
NO_PICTURE = ("pb22", "walk_4")  # who did not agree to pictures
GAP = ("pa11", "walk_1", slice(20, 26), "RANK")  # a marker that was not seen


def camera(name):
    """Two cameras around the walkway, one with a lens, one so near that a part of the body is outside."""
    lens = Intrinsics(1280, 720, 640.0, 641.0, 640.5, 359.2, distortion=(-0.05, 0.06, 5e-4, 4e-4, -0.02))
    centre = {"cam01": (4.5, 3.0, 1.5), "cam02": (1.5, -1.9, 1.9)}[name]
    return Camera(name, lens, pose(look_at(centre, (0.0, 0.0, 1.0)), centre), "close", "tape")


def motion(environment):
    """Names and a function of time (s) that gives points (T, J, 3) m."""
    walker = settings.from_dict({"environments": [environment], "duration_s": 2.0})
    walk = motion_of(walker, settings.sequences(walker)[0])
    if environment == "indoor":
        return PLUG_IN_GAIT_39, lambda t: walk.at(t)[1]
    return MLKIT_33, lambda t: walk.at(t)[0]


def picture(sequence, name, frame):
    colour = np.full((36, 64, 3), (len(sequence) * frame * 7 + len(name)) % 256, np.uint8)
    return cv2.imencode(".jpg", colour)[1].tobytes()


def build(folder):
    """Write the release; returns the true COCO-17 pixels (F, 17, 2) and status by (sequence, camera)."""
    rows = []
    for subject, sequence, *_, environment, _, _ in WALKS:
        names, at = motion(environment)
        _skeleton(folder, subject, sequence, names, at, MOCAP_HZ if environment == "indoor" else FPS)
        _gait_events(folder, subject, sequence)
        for name in CAMERAS:
            _labels(folder, subject, sequence, name, names, at)
            _frames(folder, subject, sequence, name)
            rows.append(("subject", PART[subject], subject, sequence, name))
            rows.append(("outfit", "probe" if subject == "pb22" else "gallery", subject, sequence, name))
    columns = ("split", "part", "subject", "sequence", "camera")
    tables.write(folder / "splits.parquet", "splits", _columns(columns, rows))
    columns = ("subject", "sequence", "session", "session_order", "environment", "outfit", "walk")
    tables.write(folder / "sequences.parquet", "sequences", _columns(columns, WALKS))
    people = {"subject": ["pa11", "pb22"], "height_m": [1.72, np.nan]}
    tables.write(folder / "subjects.parquet", "subjects", people)
    rig = [camera(name) for name in CAMERAS]
    both = [camera_tables.camera_columns(rig, session) for session in ("field", "lab")]
    joined = {key: [*both[0][key], *both[1][key]] for key in both[0] if key in tables.columns_of("released_cameras")}
    tables.write(folder / "cameras.parquet", "released_cameras", joined)
    return summed(folder)


def summed(folder):
    """Write the checksums of a release that was edited; returns its folder."""
    (folder / checksums.SUMS).unlink(missing_ok=True)
    shutil.rmtree(folder / checksums.FOLDER, ignore_errors=True)
    checksums.write(folder)
    return folder


def truth(environment, name):
    """COCO-17 pixels (F, 17, 2) at the true times of the pictures, and status (F, 17), with the markers as seen."""
    names, at = motion(environment)
    points, _, _ = coco17(at(true_times()), names)
    uv, _, status = labels(camera(name), points, COCO_17)
    return uv, status


def true_times():
    return 0.05 + np.arange(PICTURES) / FPS


def stamps():
    return START_NS + np.rint((true_times() + LATE_S) * 1e9).astype(np.int64)


def _columns(names, rows):
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def _skeleton(folder, subject, sequence, names, at, rate):
    instants = np.arange(int(0.6 * rate))
    points = at(instants / rate)
    if (subject, sequence) == GAP[:2]:
        points[GAP[2], names.index(GAP[3])] = np.nan
    flat = points.reshape(-1, 3)
    columns = {
        "subject": [subject] * len(flat), "sequence": [sequence] * len(flat), "joint": list(names) * len(instants),
        "instant": np.repeat(instants, len(names)),
        "stamp_ns": np.repeat(START_NS + np.rint(instants * 1e9 / rate).astype(np.int64), len(names)),
        "x": flat[:, 0], "y": flat[:, 1], "z": flat[:, 2],
        "status": np.where(np.isnan(flat[:, 0]), "too_few_views", "ok"),
    }  # fmt: skip
    tables.write(folder / f"skeletons_3d/{subject}/{sequence}.parquet", "skeletons_3d", columns)


def _gait_events(folder, subject, sequence):
    """A heel strike of each foot."""
    columns = {
        "subject": [subject] * 2, "sequence": [sequence] * 2, "foot": ["left", "right"], "event": ["heel_strike"] * 2,
        "stamp_ns": [START_NS + 123_000_000, START_NS + 456_000_000], "instant": [12, 46], "time_s": [0.123, 0.456],
        "sigma_s": [0.01, 0.02], "low_s": [0.103, 0.416], "high_s": [0.143, 0.496], "reason": ["", "turn"],
    }  # fmt: skip
    tables.write(folder / f"gait_events/{subject}/{sequence}.parquet", "gait_events", columns)


def _labels(folder, subject, sequence, name, names, at):
    uv, depth, status = labels(camera(name), at(true_times()), names)
    n = depth.size
    columns = {
        "subject": [subject] * n, "sequence": [sequence] * n, "camera": [name] * n, "joint": list(names) * PICTURES,
        "frame": np.repeat(np.arange(PICTURES), len(names)), "stamp_ns": np.repeat(stamps(), len(names)),
        "u": uv[..., 0].ravel(), "v": uv[..., 1].ravel(), "depth": depth.ravel(), "status": status.ravel(),
        "sigma_u": np.full(n, 0.5 if name == "cam01" else np.nan), "sigma_v": np.full(n, 0.25),
    }  # fmt: skip
    tables.write(folder / f"labels_2d/{subject}/{sequence}.{name}.parquet", "labels_2d", columns)


def _frames(folder, subject, sequence, name):
    agreed = (subject, sequence) != NO_PICTURE
    columns = {
        "subject": [subject] * PICTURES, "sequence": [sequence] * PICTURES, "camera": [name] * PICTURES,
        "frame": np.arange(PICTURES), "stamp_ns": stamps(), "height": [720] * PICTURES, "width": [1280] * PICTURES,
        "image": [picture(sequence, name, frame) if agreed else None for frame in range(PICTURES)],
        "no_image": ["" if agreed else "no_consent"] * PICTURES,
    }  # fmt: skip
    tables.write(folder / f"frames/{subject}/{sequence}.{name}.parquet", "released_frames", columns)
