"""Somebody else's calibration, damaged or written by something else: one sentence that names file, section and key."""

import re

import pytest

from dior.calibrate.intrinsics import from_toml
from dior.calibrate.place import reference_pose
from dior.errors import DiorError

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


@pytest.mark.parametrize("read", [from_toml, reference_pose])
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
    assert from_toml(path, "cam_01").fx == 600


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
    assert re.search(sentence, refused(tmp_path, from_toml, old, new))
