"""ROS's file of a camera's CameraInfo, written here as image_common's parse_yml.cpp writes it."""

import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from tests.calibrate.readers import rigs

TEXT = """image_width: 1280
image_height: 720
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [900.25, 0, 640.5, 0, 901.75, 355.125, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.05, 0.12, 5e-04, -7e-04, 0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [850, 0, 639, 0, 0, 860, 354, 0, 0, 0, 1, 0]
"""


def written(folder, old="", new=""):
    assert old in TEXT
    path = folder / "head_camera.yaml"
    path.write_text(TEXT.replace(old, new, 1) if old else TEXT)
    return path


def test_the_lens_of_the_raw_pictures_by_either_name(tmp_path):
    path = written(tmp_path)
    for name in ("left", "head_camera"):
        assert rigs.same_lens(path, name).model == "plumb_bob"
    with pytest.raises(DiorError, match=r"no camera 'lefd' \(did you mean 'left'\?\); it has left"):
        from_file(path, "lefd")


def test_eight_coefficients_and_a_file_of_an_older_kind(tmp_path):
    eight = "cols: 8\n  data: [0.1, -0.2, 0.001, 0.002, 0.05, 0.3, -0.1, 0.02]"
    text = TEXT.replace("plumb_bob", "rational_polynomial").replace(
        "cols: 5\n  data: [-0.05, 0.12, 5e-04, -7e-04, 0.01]", eight
    )
    (tmp_path / "a.yaml").write_text(text)
    assert from_file(tmp_path / "a.yaml", "a").distortion[7] == 0.02
    assert from_file(written(tmp_path, "distortion_model: plumb_bob\n"), "left").model == "plumb_bob"


def test_it_has_no_pose(tmp_path):
    with pytest.raises(DiorError, match=r"head_camera\.yaml \[left\]: a CameraInfo of ROS has no pose"):
        reference_pose(written(tmp_path), "left")


def test_a_pose_without_the_tags_of_opencv_is_named(tmp_path):
    path = tmp_path / "head_camera.yaml"
    path.write_text(f"{TEXT}\nR: {{rows: 3, cols: 1, data: [0, 0, 0]}}\nT: {{rows: 3, cols: 1, data: [0, 0, 0]}}\n")
    with pytest.raises(DiorError, match="only read of OpenCV's files, and its matrices have no `!!opencv-matrix`"):
        reference_pose(path, "head_camera")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("plumb_bob", "equidistant", "a lens of the model equidistant is not understood"),
        ("cols: 5", "cols: 4", "`distortion_coefficients` is 1 x 4, and has 5 numbers"),
        ("900.25, 0, 640.5, 0, 901.75, 355.125, 0, 0, 1", "0, 0, 0, 0, 0, 0, 0, 0, 0", "K is all zero"),
        ("image_width: 1280", "image_width: 1280.5", "pictures of 1280.5 x 720 px cannot be"),
        ("image_width: 1280", "image_width: wide", "`image_width` must be one number"),
        ("  cols: 3\n  data: [900.25, 0", "  cols: 3\n  data: [900.25, left", "`data` must be 9 numbers"),
        ("image_height: 720\n", "", "`image_height` is missing"),
    ],
)
def test_what_is_refused(tmp_path, old, new, sentence):
    with pytest.raises(DiorError, match=sentence) as caught:
        from_file(written(tmp_path, old, new), "left")
    assert "head_camera.yaml" in str(caught.value)
