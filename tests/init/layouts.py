"""The demo's recordings as labs keep theirs: copied into other folders, files and formats, without the truth."""

import shutil

import numpy as np

from dior.ingest import bags, containers
from tests.ingest import bagfiles, videofiles

WALKS = ("indoor_01", "outdoor_01")
DATES = {"indoor_01": "2023-11-14-22-18-", "outdoor_01": "2023-11-15-22-18-"}
STAMP = 10**9


def as_bags(recordings, target):
    """As they are."""
    target.mkdir(parents=True)
    for walk in WALKS:
        shutil.copytree(recordings / walk, target / walk)


def as_cameras(recordings, target):
    """`<walk>/cam01.bag`: a bag per camera."""
    _beside(recordings, target)
    for walk in WALKS:
        for path in _bags(recordings, walk):
            messages = _messages(path)
            for camera in sorted({one.topic.split("/")[1] for one in messages}):
                mine = [one for one in messages if one.topic.split("/")[1] == camera]
                bagfiles.write(target / walk / camera, mine, "ros1")


def as_one(recordings, target):
    """`<walk>.bag`: one bag of all cameras, the rest beside it under the walk's name."""
    target.mkdir(parents=True)
    for walk in WALKS:
        messages = sorted((one for path in _bags(recordings, walk) for one in _messages(path)), key=_received)
        bagfiles.write(target / walk, messages, "ros1")
        for path in (recordings / walk / "mlkit").iterdir():
            shutil.copy(path, target / f"{walk}_{path.name}")
        if (recordings / walk / "mocap.c3d").exists():
            shutil.copy(recordings / walk / "mocap.c3d", target / f"{walk}.c3d")


def as_ros2(recordings, target):
    """`<walk>/pc1/metadata.yaml`: a folder of ROS 2 per computer."""
    _beside(recordings, target)
    for walk in WALKS:
        for path in _bags(recordings, walk):
            bagfiles.write(target / walk / path.stem, _messages(path), "mcap")


def as_flat(recordings, target):
    """One folder, everything in it by computer or camera and date, which is a second off between computers."""
    target.mkdir(parents=True)
    for walk in WALKS:
        for i, path in enumerate(_bags(recordings, walk)):
            shutil.copy(path, target / f"{path.stem}_{DATES[walk]}{20 + i}.bag")
        for path in (recordings / walk / "mlkit").iterdir():
            shutil.copy(path, target / f"{path.stem}_{DATES[walk]}20.jsonl")
        if (recordings / walk / "mocap.c3d").exists():
            shutil.copy(recordings / walk / "mocap.c3d", target / f"Trial_{DATES[walk]}19.c3d")


def as_videos(recordings, target):
    """`<walk>/cam01.mp4` with `cam01.csv`, detections, and `lenses.toml` of all."""
    _beside(recordings, target)
    for walk in WALKS:
        videofiles.from_bags(_bags(recordings, walk), target / walk)
        (target / walk / "lenses.toml").write_text(videofiles.lens_toml(_bags(recordings, walk)))


WAYS = {
    "bags": as_bags, "cameras": as_cameras, "one": as_one, "ros2": as_ros2, "flat": as_flat, "videos": as_videos,
}  # fmt: skip


def _bags(recordings, walk):
    return sorted((recordings / walk).glob("*.bag"))


def _beside(recordings, target):
    """All but the bags."""
    target.mkdir(parents=True)
    for walk in WALKS:
        shutil.copytree(recordings / walk, target / walk, ignore=shutil.ignore_patterns("*.bag"))


def _received(one):
    return one.receive_ns


def _messages(path):
    """The pictures and lenses of a ROS 1 bag, as `bagfiles.Sent`, without decoding a picture."""
    from dior.ingest import messages

    found = []
    for one in containers.messages(path, set(bags.topics_of(path))):
        message = messages.decoded(one.kind, one.raw, one.wire)
        stamp = message.header.stamp
        keys = ("format", "data") if one.kind == messages.COMPRESSED else ("height", "width", "distortion_model")
        content = {key: getattr(message, key) for key in keys}
        if one.kind == messages.CAMERA_INFO:
            content |= {key: np.array(getattr(message, key)) for key in "dkrp"} | {"binning_x": 0, "binning_y": 0}
        found.append(bagfiles.Sent(one.topic, one.receive_ns, stamp.sec * STAMP + stamp.nanosec, one.kind, content))
    return found
