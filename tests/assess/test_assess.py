"""`dior assess` on folders as other tools write them."""

import csv
import json

import numpy as np
import pytest

from benchmarks import assess as made
from dior.assess import dataset
from dior.cli import main
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.tables import tables
from tests.calibrate.readers import written
from tests.ingest import formats
from tests.ingest.mocap_files import texts

LATE = 9  # pictures


@pytest.fixture(scope="module")
def right():
    return made.recording("ideal", seed=3, frames=180)


def write(folder, recording, late=0, rate=30.0):
    """The dataset as a lab keeps it: Pose2Sim's calibration, OpenPose's folders, a TRC of the joints; the second
    camera's files are numbered `late` pictures too early."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "calibration").mkdir()
    written.pose2sim(folder / "calibration", [view.camera for view in recording.views])
    body25 = [recording.joints.index(name) for name in BODY]
    for number, view in enumerate(recording.views):
        uv = view.uv[late:] if number == 1 else view.uv[: len(view.uv) - late]
        points = np.concatenate([uv[:, body25], np.full((len(uv), len(BODY), 1), 0.9)], axis=-1)
        points[~np.isfinite(points).all(axis=-1)] = np.nan
        home = folder / f"walk_1/pose_{view.camera.name}"
        path = formats.openpose(home, {frame: [of_coco(one)] for frame, one in enumerate(points)})
        path.rename(folder / f"walk_1/{view.camera.name}_json")
        home.rmdir()
    xyz = recording.motion.xyz[: len(recording.motion.t) - late, body25]
    texts.trc(folder / "walk_1.trc", [spelled(name) for name in BODY], xyz, rate=rate)
    return folder


BODY = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
    "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
).split()


def of_coco(points):
    return np.where(np.isfinite(points), points, 0.0)


def spelled(name):
    side, _, part = name.partition("_")
    return side[0].upper() + part.capitalize() if part else name.capitalize()


def test_a_folder_is_read_by_what_is_in_it(right, tmp_path):
    (found,) = dataset.read(write(tmp_path / "theirs", right))
    assert [view.camera.name for view in found.views] == ["cam01", "cam02", "cam03"]
    assert set(BODY) <= set(found.joints) and set(found.motion.names) == set(BODY)
    # the rate is that of the 3D with as many frames
    assert {view.fps for view in found.views} == {30.0}
    said = " ".join(found.notes)
    assert "Calib.toml" in said and "OpenPose" in said and "walk_1.trc" in said
    np.testing.assert_allclose(
        found.motion.xyz[5], right.motion.xyz[5, [right.joints.index(n) for n in BODY]], atol=1e-4
    )


def test_pictures_that_are_too_early_are_named_on_the_terminal_in_json_and_in_a_table(right, tmp_path, capsys):
    folder = write(tmp_path / "theirs", right, LATE)
    assert main.main(["assess", str(folder), "--json", "--csv", str(tmp_path / "out.csv")]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    first, second, third = found["cameras"]
    assert found["wrong"] and [fault["code"] for fault in second["faults"]] == ["offset"]
    assert not first["faults"] and not third["faults"]
    assert second["offset_low"] < LATE / 30 < second["offset_high"] + 0.002
    assert second["offset_pictures"] == pytest.approx(LATE, abs=0.2)
    rows = list(csv.DictReader((tmp_path / "out.csv").open()))
    assert [row["verdict"].partition(",")[0] for row in rows] == ["ok", "offset", "ok"]
    assert "k1 known to ± 0." in rows[0]["lens_untold"] and not rows[1]["lens_untold"]
    assert f"({LATE}.0 pictures) too early" in found["verdict"]


def test_what_is_missing_is_one_sentence(right, tmp_path, capsys):
    with pytest.raises(DiorError, match="there is no such folder"):
        dataset.read(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DiorError, match="no calibration that is read"):
        dataset.read(tmp_path / "empty")
    folder = write(tmp_path / "theirs", right)
    (folder / "walk_1.trc").unlink()
    assert main.main(["assess", str(folder)]) == 1
    assert "say it by --fps" in capsys.readouterr().err
    (found,) = dataset.read(folder, fps=30.0)
    assert found.motion is None


def test_cameras_without_3d_are_assessed_against_the_first(right, tmp_path, capsys):
    folder = write(tmp_path / "theirs", right, LATE)
    (folder / "walk_1.trc").unlink()
    assert main.main(["assess", str(folder), "--fps", "30", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["against"] == "cam01"
    assert [[fault["code"] for fault in one["faults"]] for one in found["cameras"]] == [[], ["offset"], []]
    assert found["cameras"][1]["offset_pictures"] == pytest.approx(LATE, abs=0.3)


START_NS, OFFSET_S = 1_700_000_000_000_000_000, 0.25


def release(folder, recording, offset_s):
    """What is looked at of a release, the second camera's stamps `OFFSET_S` too early; its clocks say offset_s."""
    of_walk = {"subject": "pa11", "sequence": "walk_1"}
    tables.write(folder / "sequences.parquet", "sequences", {k: [v] for k, v in of_walk.items()} | {"session": ["lab"]})
    columns = camera_tables.camera_columns([view.camera for view in recording.views], "lab")
    columns = {key: columns[key] for key in columns if key in tables.columns_of("released_cameras")}
    tables.write(folder / "cameras.parquet", "released_cameras", columns)
    names = [view.camera.name for view in recording.views]
    clocks = {key: [word] * len(names) for key, word in of_walk.items()}
    clocks |= {"camera": names, "offset_s": [0.0, offset_s, 0.0], "drift_ppm": [0.0] * len(names)}
    tables.write(folder / "clocks.parquet", "released_clocks", clocks)
    motion = recording.motion
    columns = rows(of_walk, motion.t, motion.names) | dict(zip("xyz", motion.xyz.reshape(-1, 3).T, strict=True))
    columns["instant"] = columns.pop("frame")
    tables.write(folder / "skeletons_3d/pa11/walk_1.parquet", "skeletons_3d", columns)
    for number, view in enumerate(recording.views):
        columns = rows(of_walk, view.elapsed - (OFFSET_S if number == 1 else 0.0), recording.joints)
        u, v = view.uv.reshape(-1, 2).T
        columns |= {"camera": [view.camera.name] * len(u), "u": u, "v": v, "score": np.full(len(u), 0.9)}
        tables.write(folder / f"detections/pa11/walk_1.{view.camera.name}.parquet", "released_detections", columns)
    return folder


def rows(of_walk, seconds, joints):
    """The columns of a row for each joint of each moment."""
    stamps = START_NS + np.rint(np.asarray(seconds) * 1e9).astype(np.int64)
    count = len(stamps) * len(joints)
    out = {key: [word] * count for key, word in of_walk.items()} | {"joint": [*joints] * len(stamps)}
    return out | {"frame": np.repeat(np.arange(len(stamps)), len(joints)), "stamp_ns": np.repeat(stamps, len(joints))}


def test_a_release_of_dior_is_held_against_its_own_clocks(right, tmp_path):
    (found,) = dataset.read(release(tmp_path / "right", right, OFFSET_S))
    assert found.name == "walk_1" and [view.camera.name for view in found.views] == ["cam01", "cam02", "cam03"]
    assert not made.judged(found).wrong
    (found,) = dataset.read(release(tmp_path / "wrong", right, 0.0))
    said = made.judged(found)
    assert made.said(said) == [("cam02", "offset")]
    assert said.rows[1].timing.late_s == pytest.approx(OFFSET_S, abs=0.003)
