"""The clock formula and the files that override it."""

import numpy as np
import pytest

from dior.calibrate import offsets
from dior.errors import DiorError

CAMERAS = ["cam01", "cam02"]


def write(folder, text):
    path = folder / "indoor_01.yaml"
    path.write_text(text)
    return path


def test_absent_file_and_absent_camera_are_assumed_zero(tmp_path):
    assert offsets.read(None, CAMERAS) == {c: (0.0, 0.0, "assumed_zero") for c in CAMERAS}
    assert offsets.read(tmp_path / "none.yaml", CAMERAS)["cam01"] == (0.0, 0.0, "assumed_zero")
    found = offsets.read(write(tmp_path, "cam02: {offset_s: -0.12, drift_ppm: 40}\n"), CAMERAS)
    assert found == {"cam01": (0.0, 0.0, "assumed_zero"), "cam02": (-0.12, 40.0, "manual")}


def test_empty_file_is_no_override(tmp_path):
    assert offsets.read(write(tmp_path, "# nothing\n"), CAMERAS)["cam02"][2] == "assumed_zero"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cam2: {offset_s: 0.1}", "'cam2' is not one of the cameras .*did you mean 'cam0"),
        ("cam01: {offset: 0.1}", "unknown key 'offset'.*offset_s"),
        ("cam01: {offset_s: fast}", "cam01.offset_s is 'fast', not a number"),
        ("cam01: {offset_s: .nan}", "not a number"),
        ("cam01: {offset_s: true}", "not a number"),
        ("cam01: 0.1", "must hold offset_s"),
        ("- cam01", "must map cameras"),
        ("cam01: {offset_s: 0.1", "YAML"),
    ],
)
def test_bad_files_name_the_file_and_the_key(tmp_path, text, message):
    with pytest.raises(DiorError, match=message) as error:
        offsets.read(write(tmp_path, text), CAMERAS)
    assert "indoor_01.yaml" in str(error.value)


def test_seconds_by_the_formula():
    t0 = 1_708_000_000_000_000_000
    stamps = t0 + np.array([0, 1_000_000_000, 120_000_000_000])
    expected = np.array([0, 1, 120]) * (1 + 50e-6) - 0.25
    np.testing.assert_allclose(offsets.seconds(stamps, t0, -0.25, 50), expected, rtol=0, atol=1e-12)


def test_seconds_keeps_a_nanosecond():
    t0 = 1_708_000_000_000_000_000
    assert offsets.seconds(np.array([t0 + 1]), t0)[0] == 1e-9
