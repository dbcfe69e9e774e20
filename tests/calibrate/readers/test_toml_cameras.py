"""Somebody else's calibration, damaged or written by something else: one sentence that names file, section and key."""

import re

import numpy as np
import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from tests.calibrate.readers import rigs

CAMERA = (
    '[cam_01]\nname = "left"\nsize = [640, 480]\nmatrix = [[600, 0, 320], [0, 600, 240], [0, 0, 1]]\n'
    "distortions = [0, 0, 0, 0]\nrotation = [0, 0, 0]\ntranslation = [1, 2, 3]\n"
)


def refused(folder, read, old, new):
    path = folder / "calibration.toml"
    text = CAMERA.replace(old, new, 1)
    assert text != CAMERA
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(DiorError) as caught:
        read(path, "cam_01")
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_a_section_twice_is_two_files_and_a_word_is_no_fisheye(tmp_path):
    assert "are two files joined?" in refused(tmp_path, from_file, CAMERA, CAMERA + CAMERA)
    said = refused(tmp_path, from_file, 'name = "left"', 'fisheye = "false"')
    assert said.endswith("[cam_01]: `fisheye` must be true or false without quotes, and is 'false'")


def test_a_name_with_blanks_at_its_end_is_shown_as_such(tmp_path):
    assert "did you mean 'cam_01 '?); it has 'cam_01 '" in refused(tmp_path, from_file, "[cam_01]", '["cam_01 "]')


@pytest.mark.parametrize("read", [from_file, reference_pose])
@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("600", "9" * 5000, "not readable as TOML (a number has thousands of digits)"),
        ("[[600", "a = " + "[" * 50_000, "not readable as TOML ("),
        ('name = "left"', "x = " + "[" * 3000 + "]" * 3000, "not readable as TOML (nested too deeply)"),
        ("[cam_01]", "[cam_01", "not readable as TOML ("),
        ("left", "Gerät", "line 2: the byte 0xe4 is not UTF-8"),
        ("left", "x\0", "line 2: holds a zero byte"),
        ("[cam_01]", "[cam1]", "no camera 'cam_01' (did you mean 'cam1'?); it has cam1"),
        ("[cam_01]", "[" + "a." * 30 + "cam_01]", "no camera 'cam_01'"),
        ("[cam_01]", "[" + "a." * 300_000 + "cam_01]", "line 1: a key of more than 40 parts; is the file damaged?"),
        ('name = "left"', "x = {" + "a.b." * 2000 + "c = 1}", "line 2: a key of more than 40 parts"),
        ('"left"', "0x" + "f" * 5000, None),
    ],
)
def test_a_file_that_is_none(tmp_path, read, old, new, sentence):
    if sentence is None:
        # a name that is no text names nothing, and the section has one
        (tmp_path / "calibration.toml").write_text(CAMERA.replace(old, new))
        read(tmp_path / "calibration.toml", "cam_01")
        with pytest.raises(DiorError, match="no camera 'left'"):
            read(tmp_path / "calibration.toml", "left")
    else:
        assert sentence in refused(tmp_path, read, old, new)


def test_long_lists_and_leaders_are_no_keys(tmp_path):
    path = tmp_path / "calibration.toml"
    path.write_text(CAMERA + f"points = [{', '.join(['0.125'] * 500)}]\n# x{'.' * 100}\n")
    assert from_file(path, "cam_01").fx == 600


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("600, 0, 320", '"x", 0, 320', r"\[cam_01\]: `matrix` must be 3 x 3 numbers"),
        ("[[600, 0, 320], [0, 600, 240], [0, 0, 1]]", "{a = 1}", "`matrix` must be 3 x 3 numbers"),
        ("[0, 600, 240], ", "", "`matrix` must be 3 x 3 numbers, and there is 2 x 3"),
        ("600, 0, 320", "nan, 0, 320", "`matrix` has a value that is not finite"),
        ("[640, 480]", "[inf, 480]", "`size` has a value that is not finite"),
        ("[640, 480]", f"[0x{'f' * 400}, 480]", "`size` must be 2 numbers"),
        ("[640, 480]", "640", "`size` must be 2 numbers, and there is one"),
        ("[0, 0, 0, 0]", "[1e300, 0, 0, 0]", "`distortions` has a value that is not finite or above 1e.07"),
    ],
)
def test_numbers_that_are_none(tmp_path, old, new, sentence):
    assert re.search(sentence, refused(tmp_path, from_file, old, new))


# as caliscope 0.11.8 wrote it (`CameraArray.to_toml`), whose numbers are those of `rigs` but for the pose
CALISCOPE = """[cameras.1]
cam_id = 1
rotation_count = 0
fisheye = false
size = [1280, 720]
matrix = [[900.25, 0.0, 640.5], [0.0, 901.75, 355.125], [0.0, 0.0, 1.0]]
distortions = [-0.05, 0.12, 0.0005, -0.0007, 0.01]
translation = [-0.010903287265562042, 1.0727647457135046, 4.172416196723553]
rotation = [0.510328871455346, -2.064576510723368, 1.8004470523105496]
"""
# the same as aniposelib 0.8.0 wrote it (`CameraGroup.dump`), from a board given in mm
ANIPOSE = """[cam_0]
name = "left"
size = [ 1280, 720,]
matrix = [ [ 900.25, 0.0, 640.5,], [ 0.0, 901.75, 355.125,], [ 0.0, 0.0, 1.0,],]
distortions = [ -0.05, 0.12, 0.0005, -0.0007, 0.01,]
rotation = [ 0.510328871455346, -2.064576510723368, 1.8004470523105496,]
translation = [ -10.903287265562042, 1072.7647457135045, 4172.416196723553,]

[metadata]
adjusted = true
error = 0.4
"""
# what stands below it in FreeMoCap 1.8.2 (anipose_camera_calibrator.py), written here by its source
FREEMOCAP = """[metadata]
charuco_square_size = {square}
charuco_board_object = "CharucoBoardDefinition()"
path_to_recorded_videos = "session/recording"
date_time_calibrated = "2026-11-30T00:00:00"
groundplane_calibration = {ground}
"""


def written(folder, text):
    path = folder / "calibration.toml"
    path.write_text(text)
    return path


def freemocap(folder, square="39.0", ground="true"):
    return written(folder, ANIPOSE.partition("[metadata]")[0] + FREEMOCAP.format(square=square, ground=ground))


def test_caliscope_and_anipose_give_the_camera_that_they_were_given(tmp_path):
    """4 m from the origin at 120 degrees, 1.6 m high, looking at a point above it."""
    wTc = reference_pose(written(tmp_path, CALISCOPE), "1")
    np.testing.assert_allclose(wTc[:3, 3], [4 * np.cos(2 * np.pi / 3), 4 * np.sin(2 * np.pi / 3), 1.6], atol=1e-9)
    rigs.same_lens(tmp_path / "calibration.toml", "cameras.1")
    path = written(tmp_path, ANIPOSE)
    with pytest.raises(DiorError, match=r"\[cam_0\]: the file does not say its unit; add `reference.units`"):
        reference_pose(path, "left")
    rigs.same_pose(reference_pose(path, "left", units="mm"), wTc)
    rigs.same_lens(path, "left")


def test_pose2sim_writes_metres_and_a_person_may_say_otherwise(tmp_path):
    path = written(tmp_path, ANIPOSE.replace("\n\n[meta", "\nfisheye = false\n\n[meta").replace("true", "false"))
    inches = 39.37
    assert np.linalg.norm(reference_pose(path, "left")[:3, 3]) > 100 * inches
    assert np.linalg.norm(reference_pose(path, "left", units="mm")[:3, 3]) < 5


def test_freemocap_says_its_unit_and_its_floor(tmp_path):
    wTc = reference_pose(written(tmp_path, CALISCOPE), "1")
    rigs.same_pose(reference_pose(freemocap(tmp_path), "left"), wTc)
    with pytest.raises(DiorError, match="FreeMoCap did not take its board for the floor .*groundplane_calibration"):
        reference_pose(freemocap(tmp_path, ground="false"), "left")
    rigs.same_pose(reference_pose(freemocap(tmp_path, ground="false"), "left", world="from_walk"), wTc)
    for square in ("1", "0.058", "5.8", '"58"', "true", "nan"):
        with pytest.raises(DiorError, match="the file does not say its unit"):
            reference_pose(freemocap(tmp_path, square=square), "left")
    rigs.same_pose(reference_pose(freemocap(tmp_path, square="3.9"), "left", units="mm"), wTc)


def test_a_fisheye_lens_is_refused_by_name_whatever_the_yaml_says(tmp_path):
    """As aniposelib's FisheyeCamera writes it."""
    four = ANIPOSE.replace("-0.0007, 0.01,]", "-0.0007,]").replace("\n\n[meta", "\nfisheye = true\n\n[meta")
    for said in ("", "plumb_bob"):
        with pytest.raises(DiorError, match=r"a lens of the model equidistant \(fisheye\) is not understood"):
            from_file(written(tmp_path, four), "left", said)
