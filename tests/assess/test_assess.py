"""`dior assess` on folders as other tools write them."""

import csv
import json

import numpy as np
import pytest

from benchmarks import assess as made
from dior.assess import dataset
from dior.cli import main
from dior.errors import DiorError
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
    assert [row["verdict"] for row in rows] == ["ok", "offset", "ok"]
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
