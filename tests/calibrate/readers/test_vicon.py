"""A Vicon XCP, written here by Vicon's page on that format and a public file's attributes: its programs are not free.

The pose is compared with what Pose2Sim 0.10.49 (`calib_vicon_fun`) made of the same text.
"""

import numpy as np
import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose, pose
from tests.calibrate.readers import rigs

TEXT = """<?xml version="1.0" encoding="UTF-8" standalone="no" ?>
<Cameras NAME="" VERSION="1.0">

  <Camera ACTIVE_THRESHOLD="1" DEVICEID="2119270" DISPLAY_TYPE="Vue" ISDV="2" NAME="Vue_1" PIXEL_ASPECT_RATIO="1" \
SENSOR="VUE" SENSOR_SIZE="1920 1080" SKEW="0" SYSTEM="" TYPE="VideoInputDevice" USERID="9">
    <ThresholdGrid BIT_DEPTH="1" DATA="r 100 0" GRID_SIZE="294 108" TILE_SIZE="16 32"/>
    <ControlFrames/>
    <KeyFrames>
      <KeyFrame FOCAL_LENGTH="1650.5" FRAME="0" IMAGE_ERROR="0.2" ORIENTATION="0.55 -0.3 0.2 0.7533259586659681" \
POSITION="1200.5 -3400.25 1510.75" PRINCIPAL_POINT="960.25 540.5" \
VICON_RADIAL2="Vicon3Parameter 960.25 540.5 0 0 0" WORLD_ERROR="0.3"/>
    </KeyFrames>
  </Camera>

</Cameras>
"""
# cTw by Pose2Sim, rad and m
ROTATION, TRANSLATION = (1.200431521718684, -0.6547808300283731, 0.43652055335224876), (
    -2.6845638211488168, 2.538682535908675, 1.2780743120222582,
)  # fmt: skip


def written(folder, old="", new=""):
    assert old in TEXT
    path = folder / "lab.xcp"
    path.write_text(TEXT.replace(old, new, 1) if old else TEXT)
    return path


@pytest.mark.parametrize("name", ["2119270", "Vue_1"])
def test_pose_and_lens(tmp_path, name):
    from scipy.spatial.transform import Rotation

    path = written(tmp_path)
    theirs = inverse_pose(pose(Rotation.from_rotvec(ROTATION).as_matrix(), TRANSLATION))
    rigs.same_pose(reference_pose(path, name), theirs)
    np.testing.assert_allclose(theirs[:3, 3], [1.2005, -3.40025, 1.51075], atol=1e-9)
    K = np.array([[1650.5, 0, 960.25], [0, 1650.5, 540.5], [0, 0, 1]])
    rigs.same_lens(path, name, (), (1920, 1080), K)


@pytest.mark.parametrize("zeros", ["0 0 0", "0.000000e+00 -0.0E-12 +0", ""])
def test_a_radial_polynomial_of_zeros_is_none_however_they_are_written(tmp_path, zeros):
    assert not any(from_file(written(tmp_path, "540.5 0 0 0", f"540.5 {zeros}"), "Vue_1").distortion)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "540.5 0 0 0",
            "540.5 1.2e-08 0 0",
            "Vicon's VICON_RADIAL2 is not understood, .* from a chessboard or",
        ),
        ('VICON_RADIAL2="Vicon3Parameter 960.25 540.5 0 0 0"', 'VICON_RADIAL="1e-8 0"', "Vicon's VICON_RADIAL is not"),
        ('RATIO="1"', 'RATIO="1.02"', "pixels that are not square"),
        ('"1920 1080"', '"1920"', "`SENSOR_SIZE` must be 2 numbers"),
        ('FOCAL_LENGTH="1650.5"', 'FOCAL_LENGTH="x"', "`FOCAL_LENGTH` must be one number$"),
        (
            'FOCAL_LENGTH="1650.5"',
            'FOCAL_LENGTH="1650,5"',
            "must be one number, and '1650,5' has a decimal comma; write",
        ),
        ('"960.25 540.5"', '"960,25 540,5"', "must be 2 numbers, and '960,25' has a decimal comma"),
        ('FOCAL_LENGTH="1650.5"', "", "`FOCAL_LENGTH` is missing"),
    ],
)
def test_lenses_that_are_refused_leave_the_pose(tmp_path, old, new, sentence):
    path = written(tmp_path, old, new)
    with pytest.raises(DiorError, match=sentence) as caught:
        from_file(path, "Vue_1")
    assert "lab.xcp [2119270]" in str(caught.value)
    np.testing.assert_allclose(reference_pose(path, "Vue_1")[:3, 3], [1.2005, -3.40025, 1.51075], atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("0.7533259586659681", "0.5", "ORIENTATION is no quaternion of length 1"),
        (" 0.7533259586659681", "", "`ORIENTATION` must be 4 numbers, and there is 3"),
        ("    </KeyFrames>", '      <KeyFrame FRAME="9"/>\n    </KeyFrames>', "has 2 KeyFrames, so that it moves"),
        ("</Cameras>", "", r"line \d+: not valid XML"),
        ("<Cameras NAME", "<Cams NAME", "line .*: not valid XML"),
        ("<Cameras", "<!DOCTYPE x><Cameras", "declares a document type"),
    ],
)
def test_poses_that_are_refused(tmp_path, old, new, sentence):
    with pytest.raises(DiorError, match=sentence) as caught:
        reference_pose(written(tmp_path, old, new), "Vue_1")
    assert "lab.xcp" in str(caught.value)


def test_another_unit_or_convention_is_refused_and_its_own_is_not(tmp_path):
    path = written(tmp_path)
    for said in ({"units": "m"}, {"convention": "wTc"}):
        with pytest.raises(DiorError, match="by its format, and"):
            reference_pose(path, "Vue_1", **said)
    assert np.array_equal(reference_pose(path, "Vue_1", "cTw", "mm"), reference_pose(path, "Vue_1"))
