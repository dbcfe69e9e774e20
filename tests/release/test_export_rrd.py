"""`dior export --rrd`: what rerun reads back is what the tables hold; without rerun it says what to install."""

import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.evaluate.grids import label_grids
from dior.geometry import covariance
from dior.geometry.camera import project
from dior.ingest import bags, messages
from dior.release import export_rrd
from dior.tables import tables
from tests.project.test_project import root  # noqa: F401
from tests.report import walks


def test_without_rerun_it_says_what_to_install(root, monkeypatch, capsys):  # noqa: F811
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main.main(["export", str(root), "--rrd", str(root / "rrd")]) == 1
    said = capsys.readouterr().err
    assert said == "dior export: `dior export --rrd` needs rerun; install it: pip install -e '.[rrd]'\n"
    assert not (root / "rrd").exists()


def test_half_sizes_and_turns_of_an_ellipsoid_are_its_covariance():
    rng = np.random.default_rng(1)
    sigmas, rhos = rng.uniform(0.01, 0.05, (20, 3)), rng.uniform(-0.3, 0.3, (20, 3))
    found = export_rrd._ellipsoids(covariance.of_sigmas(sigmas, rhos))
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(found["quaternions"]).as_matrix()
    again = turns @ (found["half_sizes"][:, :, None] ** 2 * turns.transpose(0, 2, 1))
    np.testing.assert_allclose(again, covariance.of_sigmas(sigmas, rhos), atol=1e-12)


def recorded(rows, data_root):
    """In place of `bags.read_messages`: JPEG files that differ by frame; frame 12 is damaged."""
    for row, frame in enumerate(rows["frame"].tolist()):
        picture = np.full((720, 1280, 3), frame, np.uint8)
        data = cv2.imencode(".jpg", picture)[1][:, None].ravel()
        data = data[:100] if frame == 12 else data
        stamp = SimpleNamespace(sec=1, nanosec=0)
        raw = SimpleNamespace(data=data, format="jpeg", header=SimpleNamespace(stamp=stamp))
        yield row, SimpleNamespace(kind=messages.COMPRESSED, raw=raw, wire=messages.PICTURE), data_root / "a.bag"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Of a walk of 90 instants and four cameras: its recording, the tables that it was made of, and what was said."""
    pytest.importorskip("rerun")
    folder = tmp_path_factory.mktemp("walk")
    given = walks.write(folder)
    return folder / "walk.rrd", given, write(folder / "walk.rrd", given)


def write(path, given):
    keys = ("frames", "timeline", "skeleton", "labels", "clocks", "cameras", "covariance")
    files = export_rrd.WalkFiles(given["sequence"], "p-0001", **{key: given[key] for key in keys})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bags, "read_messages", recorded)
        return export_rrd.write(path, files, path.parent)


@pytest.fixture(scope="module")
def found(written):
    return columns(written[0])


def columns(path):
    """entity -> component or timeline -> values by row, as rerun's own reader finds them."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).store().stream():
        batch = chunk.to_record_batch()
        own = found.setdefault(chunk.entity_path, {})
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            jpegs = name == "EncodedImage:blob"
            values = [one.values[0].values.to_numpy().tobytes() for one in column] if jpegs else column.to_pylist()
            own.setdefault(name, []).extend(values)
    return found


def test_a_recording_is_named_and_has_a_layout(written):
    from rerun.chunk import RrdReader

    reader = RrdReader(written[0])
    assert [(one.application_id, one.recording_id) for one in reader.recordings()] == [("dior", walks.SEQUENCE)]
    assert len(reader.blueprints()) == 1
    assert written[2] == "4 cameras, 56 pictures, 3D at 90 instants"


def test_the_3d_is_that_of_the_table(written, found):
    given = written[1]
    body, sigma = (found[f"/world/skeleton{end}"] for end in ("", "/sigma"))
    points, joints = tables.grid(tables.read(given["skeleton"], "skeletons_3d"), "x", "y", "z")
    assert body["instant"] == list(range(90)) and body["time"][30].total_seconds() == pytest.approx(1.0, abs=1e-6)
    for i in (0, 25, 89):
        known = np.isfinite(points[i]).all(axis=1)
        assert body["Points3D:keypoint_ids"][i] == np.flatnonzero(known).tolist()
        np.testing.assert_allclose(body["Points3D:positions"][i], points[i][known], atol=1e-6)
        np.testing.assert_allclose(sigma["Ellipsoids3D:centers"][i], points[i][known], atol=1e-6)
    context = found["/world"]["AnnotationContext:context"][0][0]
    (described,) = [one["class_description"] for one in context]
    assert [each["label"] for each in described["keypoint_annotations"]] == joints
    assert described["info"]["label"] == "p-0001" and len(described["keypoint_connections"]) > 20


def test_labels_lie_on_their_pictures_and_a_damaged_one_has_none(written, found):
    grids = label_grids(written[1]["labels"])
    for i, camera in enumerate(walks.cameras(4)):
        place = f"/world/cameras/{camera.name}"
        pictures, labels = found[f"{place}/picture"], found[f"{place}/picture/labels"]
        order = np.argsort(pictures["frame"])
        assert sorted(pictures["frame"]) == labels["frame"] and 12 not in labels["frame"]
        assert np.diff(labels["frame"]).tolist().count(6) >= 12
        for row, frame in zip(order, labels["frame"], strict=True):
            picture = cv2.imdecode(np.frombuffer(pictures["EncodedImage:blob"][row], np.uint8), cv2.IMREAD_COLOR)
            assert abs(picture.mean() - frame) < 1
            uv = grids[camera.name].uv[frame]
            known = np.isfinite(uv).all(axis=1)
            at = labels["frame"].index(frame)
            assert labels["time"][at].total_seconds() == pytest.approx(frame / 30 + 0.002 * i, abs=1e-4)
            assert labels["Points2D:keypoint_ids"][at] == np.flatnonzero(known).tolist()
            np.testing.assert_allclose(labels["Points2D:positions"][at], uv[known] + 0.5, atol=1e-3)


def test_a_camera_projects_as_dior_does(found):
    """rerun's pixel (0, 0) is a corner; its matrices are stored by columns."""
    points = np.array([[0, 0, 1.0], [0.5, -0.5, 1.4]])
    for camera in walks.cameras(4):
        pose, lens = found[f"/world/cameras/{camera.name}"], found[f"/world/cameras/{camera.name}/picture"]
        (turn,), (centre,) = (pose[f"Transform3D:{key}"][0] for key in ("mat3x3", "translation"))
        (matrix,) = next(one for one in lens["Pinhole:image_from_camera"] if one)
        uvw = (points - centre) @ np.reshape(turn, (3, 3)).T @ np.reshape(matrix, (3, 3))
        np.testing.assert_allclose(uvw[:, :2] / uvw[:, 2:] - 0.5, project(camera, points)[0], atol=0.01)
        assert lens["Pinhole:resolution"] and found[f"/world/camera_sigma/{camera.name}"]


def test_the_same_input_gives_the_same_content(written, found, tmp_path, capsys):
    """Bytes differ: rerun numbers rows by its clock. What cannot be read is told."""
    write(tmp_path / "again.rrd", written[1])
    again = columns(tmp_path / "again.rrd")
    both = [{place: {**own, "rerun.controls.RowId": 0} for place, own in one.items()} for one in (found, again)]
    assert both[0] == both[1]
    assert "frame 12 of cam01 is left out (its JPEG data are cut off" in capsys.readouterr().err


def test_a_walk_without_labels_is_named(root):  # noqa: F811
    pytest.importorskip("rerun")
    with pytest.raises(DiorError, match=r"results/.*is not there, so .* is not labelled; run the workflow first"):
        export_rrd.run(root, rrd=root / "rrd")
    with pytest.raises(DiorError, match="no sequence 'nowhere'"):
        export_rrd.run(root, ["nowhere"], rrd=root / "rrd")
    assert not (root / "rrd").exists()
