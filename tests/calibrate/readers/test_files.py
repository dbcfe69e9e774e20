"""Which calibration a file is, is told by what is in it; and what becomes of its world."""

import numpy as np
import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.calibrate.readers import files
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose
from tests.calibrate.readers import test_kalibr, test_opencap, test_opencv_storage
from tests.calibrate.readers import test_qualisys as qualisys
from tests.calibrate.readers import test_ros_camera_info as ros
from tests.calibrate.readers import test_toml_cameras as toml
from tests.calibrate.readers import test_vicon as vicon


@pytest.fixture
def every(tmp_path):
    """A file of each format, and the names of its cameras."""
    found = {}
    texts = {"qualisys": qualisys.TEXT, "vicon": vicon.TEXT, "ros": ros.TEXT, "toml": toml.CAMERA}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        found[name] = tmp_path / name
    found["kalibr"] = test_kalibr.chain(tmp_path)
    found["opencap"] = test_opencap.written(tmp_path, test_opencap.content())
    for ending in test_opencv_storage.ENDINGS:
        found[ending] = test_opencv_storage.of_sample(tmp_path / f"a.{ending}")
    return found


def test_a_name_tells_nothing(every, tmp_path):
    names = {kind: [camera.name for camera in files.cameras(path)] for kind, path in every.items()}
    stem = tmp_path / "calibration.txt"
    for kind, path in every.items():
        raw = path.read_bytes()
        # a byte order mark, as editors on Windows write it, is no part of a text
        for content in (raw, raw if kind == "opencap" else b"\xef\xbb\xbf" + raw):
            stem.write_bytes(content)
            found = [camera.name for camera in files.cameras(stem)]
            assert found == (["calibration"] if kind in ("opencap", "yml", "xml", "json") else names[kind]), kind


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "no calibration that is read (OpenCap, Qualisys, "),
        ("role: close\ntopic: /a\n", "no calibration that is read"),
        ("# a\n- 1\n- 2\n", "no calibration that is read"),
        ("<html><body/></html>", "an XML file with <html>, and no calibration that is read (OpenCap, "),
        (
            "<opencv_storage><a>1</a></opencv_storage>",
            "an XML file with <opencv_storage>, and no calibration",
        ),
        ("<calibration/>", "an XML file with <calibration>, and no calibration that is read"),
        ("<a><b></a>", "line 1: not valid XML"),
        ("<" + "a><" * 100_000, "nested 40 times; is a tag left open?"),
        ("a: [1, 2\n", "not valid YAML"),
        ("cam0: {camera_model: pinhole}\n---\ncam0: {camera_model: pinhole}\n", "; are two files joined? keep what"),
        ("M1: {rows: 3}\n", "no matrix as its FileStorage writes it (`!!opencv-matrix` with"),
        ("cam0: {camera_model: pinhole}\ncam0: {camera_model: pinhole}\n", "key 'cam0' is given twice"),
        ("[a]\nb = \n", "not readable as TOML"),
        ("%YAML:1.0\n---\na: !!opencv-matrix\n  rows: 1\n", "no calibration that is read"),
        ('{"a": 1}', "no calibration that is read"),
    ],
)
def test_files_that_are_none(tmp_path, text, sentence):
    path = tmp_path / "calibration"
    path.write_text(text)
    with pytest.raises(DiorError) as caught:
        from_file(path, "cam01")
    assert str(path) in str(caught.value) and sentence in str(caught.value)


def test_a_file_that_is_gone_or_too_large(tmp_path):
    with pytest.raises(DiorError, match=r"gone\.yaml: there is no such file; check the camera's YAML and data_root"):
        from_file(tmp_path / "gone.yaml", "cam01")
    (tmp_path / "long.yaml").write_text("# a\n" * 300_000)
    with pytest.raises(DiorError, match=r"long\.yaml: has 1 MB, and at most 1 MB"):
        from_file(tmp_path / "long.yaml", "cam01")


def test_a_world_that_is_no_floor_is_refused_unless_the_walk_gives_one(every):
    """Of the formats, those of which it is known; of the others the step `reference` looks at the walk."""
    for kind, name in (("kalibr", "cam1"), ("opencap", "Cam1")):
        with pytest.raises(DiorError, match="its Z is no vertical and its Z = 0 no floor"):
            reference_pose(every[kind], name)
        assert np.isfinite(reference_pose(every[kind], name, world="from_walk")).all()


@pytest.mark.parametrize(
    ("K", "sentence"),
    [
        ("[[600, 0, 0], [0, 600, 0], [320, 240, 1]]", "last row 0, 0, 1, and has .*; it looks transposed: write it by"),
        ("[[600, 0, 320], [9, 600, 240], [0, 0, 1]]", "K must have 0 below its diagonal"),
        ("[[600, 0, 320], [0, 600, 240], [0, 0, 0]]", "K must have .* the last row 0, 0, 1"),
        (
            "[[0.9, 0, 0.5], [0, 1.25, 0.5], [0, 0, 1]]",
            "0.9 and 1.25 are no pixels; .* row by 640 and its second by 480",
        ),
        ("[[320, 0, 600], [0, 240, 600], [0, 0, 1]]", "600, 600 lies outside .* 640 x 480 px; .* were exchanged"),
        (
            "[[1800, 0, 960], [0, 1800, 540], [0, 0, 1]]",
            "outside .*; K looks like one of pictures of about 1920 x 1080",
        ),
        ("[[600, 0, -320], [0, 600, 240], [0, 0, 1]]", "-320, 240 lies outside .*; give the K of the whole pictures"),
    ],
)
def test_a_matrix_that_is_none_of_these_pictures_is_refused_and_says_what_it_looks_like(tmp_path, K, sentence):
    path = tmp_path / "calibration.toml"
    path.write_text(toml.CAMERA.replace("[[600, 0, 320], [0, 600, 240], [0, 0, 1]]", K))
    with pytest.raises(DiorError, match=rf"calibration\.toml \[cam_01\]: .*{sentence}"):
        from_file(path, "cam_01")


def test_real_files_read_as_they_did(shared):
    """Centres and focal lengths that dior 0.1 read of them."""
    folder = shared / "real_outdoor/reference"
    for file in ("calibration.toml", "calibration_qualisys.toml"):
        wTc = reference_pose(folder / file, "cam_04")
        np.testing.assert_allclose(wTc[:3, 3], [-3.758720480, -1.415665402, 1.881794104], atol=1e-8)
        assert from_file(folder / file, "cam_04").fx == 1675.234985359375
    path = shared / "charuco/camera_array.toml"
    lens, wTc = from_file(path, "cameras.2"), reference_pose(path, "2")
    assert (lens.fx, lens.distortion[4]) == (650.801908585405, 0.12402327219756225)
    np.testing.assert_allclose(inverse_pose(wTc)[:3, 3], [-0.23847883889, 0.18461082841, 1.16829439007], atol=1e-10)


def test_a_name_in_other_letters_is_nearer_than_any_other(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("".join(toml.CAMERA.replace("cam_01", name) for name in ("CAM_02", "cam_03")))
    with pytest.raises(DiorError, match="no camera 'cam_02' .did you mean 'CAM_02'"):
        files.camera(path, "cam_02")
