"""Counts of a set of tables that are known by heart: two walks indoors, one outdoors with a camera 50 m away."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.evaluate import statistics
from dior.tables import tables

SHEET = {
    "walk_1": {"environment": "indoor", "session": "lab", "subject": "A", "outfit": "coat", "walk": "line"},
    "walk_2": {"environment": "indoor", "session": "lab", "subject": "B", "outfit": "coat", "walk": "circle"},
    "walk_3": {"environment": "outdoor", "session": "field", "subject": "A", "outfit": "", "walk": "line"},
}
ROLES = {("lab", "cam01"): "close", ("field", "cam01"): "close", ("field", "far"): "long_range"}
JOINTS = ("nose", "left_heel")
# statuses of the labels, a picture's after another's
LABELS = {
    "walk_1.cam01": ["ok", "ok", "ok", "out_of_frame"],
    "walk_2.cam01": ["ok", "missing_3d"],
    "walk_3.cam01": ["ok", "behind_camera", "missing_3d", "missing_3d"],
    "walk_3.far": ["ok", "ok", "ok", "ok", "missing_3d", "missing_3d"],
}
SKELETONS = {
    "walk_1": ["ok", "gap_filled", "ok", "rejected"],
    "walk_2": ["ok", "ok"],
    "walk_3": ["ok", "ok", "too_few_views", "too_few_views"],
}
DROPPED = {"walk_3": [("cam01", "not_sent"), ("cam01", "not_sent"), ("far", "same_picture")]}


def write_labels(path, status):
    count = len(status) // 2
    there = np.array([word not in ("missing_3d", "behind_camera") for word in status])
    tall = np.repeat(20.0 + np.arange(count), 2) * np.tile([0.0, 1.0], count)
    columns = {
        "joint": list(JOINTS) * count,
        "frame": np.repeat(np.arange(count), 2),
        "u": np.where(there, 5.0, np.nan),
        "v": np.where(there, 300 + tall, np.nan),
        "depth": np.where(there, np.repeat(50.0 + 2 * np.arange(count), 2), np.nan),
        "status": status,
    }
    tables.write(path, "labels_2d", columns)


@pytest.fixture
def files(tmp_path):
    found = {"labels": [], "skeletons": [], "frames": [], "dropped": []}

    def path(kind, name):
        found[kind].append(tmp_path / kind / f"{name}.parquet")
        return found[kind][-1]

    for name, status in {**LABELS, "walk_9.cam01": ["ok", "ok"]}.items():
        write_labels(path("labels", name), status)
    for name, status in SKELETONS.items():
        tables.write(path("skeletons", name), "skeletons_3d", {"joint": JOINTS * (len(status) // 2), "status": status})
    for name in SHEET:
        cameras = [k.split(".")[1] for k, v in LABELS.items() if k.startswith(name) for _ in range(len(v) // 2)]
        tables.write(path("frames", name), "frames", {"camera": cameras})
        columns = dict(zip(("camera", "reason"), zip(*DROPPED.get(name, ()), strict=True), strict=False))
        tables.write(path("dropped", name), "dropped_frames", columns or {"camera": []})
    return found


@pytest.fixture
def rows(files):
    return statistics.rows_of(SHEET, ROLES, **files, angles=["frontal"] * 3 + ["down45"])


@pytest.mark.parametrize(
    ("what", "where", "value"),
    [
        ("frames", {}, 2 + 1 + 2 + 3),
        ("frames", {"environment": "indoor"}, 3),
        ("frames", {"environment": "indoor", "role": "close", "camera": "cam01"}, 3),
        ("frames", {"environment": "outdoor", "role": "close", "camera": "cam01"}, 2),
        ("frames", {"role": "long_range"}, 3),
        ("camera_recordings", {}, 4),
        ("keypoints_2d", {}, 3 + 1 + 1 + 4),
        ("keypoints_2d", {"environment": "outdoor", "role": "long_range", "camera": "far"}, 4),
        ("missing_2d", {}, 1 + 1 + 3 + 2),
        ("missing_2d", {"reason": "missing_3d"}, 1 + 2 + 2),
        ("missing_2d", {"environment": "outdoor", "role": "close", "camera": "cam01", "reason": "behind_camera"}, 1),
        ("keypoints_3d", {}, 3 + 2 + 2),
        ("keypoints_3d", {"reason": "gap_filled"}, 1),
        ("missing_3d", {}, 3),
        ("missing_3d", {"environment": "indoor", "reason": "rejected"}, 1),
        ("dropped_frames", {}, 3),
        ("dropped_frames", {"reason": "not_sent"}, 2),
        ("dropped_frames", {"role": "long_range"}, 1),
        ("sequences", {}, 3),
        ("sequences", {"environment": "indoor"}, 2),
        ("subjects", {}, 2),
        ("subjects", {"environment": "outdoor"}, 1),
        ("outfits", {}, 1),
        ("walks", {}, 2),
        ("sessions", {}, 2),
        ("gallery_pictures", {}, 4),
        ("gallery_pictures", {"camera": "frontal"}, 3),
        ("person_height", {"role": "long_range"}, 20.5),
        ("distance", {"role": "long_range"}, 51.0),
    ],
)
def test_every_count(rows, what, where, value):
    assert statistics.of(rows, what, **where) == value


def test_no_row_is_there_twice_and_parts_make_the_whole(rows):
    keys = [tuple(row[c] for c in statistics.COLUMNS[:5]) for row in rows]
    assert len(set(keys)) == len(keys)
    for what in ("frames", "keypoints_2d", "missing_2d", "dropped_frames"):
        by_camera = [r["value"] for r in rows if r["what"] == what and r["camera"] and not r["reason"]]
        assert sum(by_camera) == statistics.of(rows, what)


def test_the_csv_is_read_back(rows, tmp_path):
    path = tmp_path / "statistics.csv"
    path.write_text(statistics.as_csv(rows))
    assert statistics.read(path) == rows
    path.write_text("a,b\n1,2\n")
    with pytest.raises(DiorError, match="columns"):
        statistics.read(path)


def test_the_properties_of_the_paper(rows):
    made = {name: (has, much) for name, has, much in statistics.properties(rows)}
    assert made["MoCap pose"] == (True, "3 of 8 pictures")
    assert made["Multi-view"] == (False, "1.33 cameras")
    assert made["Long range"] == (True, "3 pictures from 51 m")
    assert made["Less than 25 px tall"] == (True, "20.5 px, lowest to highest keypoint")
    nothing = {name: has for name, has, _ in statistics.properties([])}
    assert not any(nothing.values()) and set(nothing) == set(made)
