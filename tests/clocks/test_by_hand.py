"""Files that override the clocks."""

import pytest

from dior.clocks import by_hand
from dior.errors import DiorError

CAMERAS = ["cam01", "cam02"]


def write(folder, text):
    path = folder / "indoor_01.yaml"
    path.write_text(text)
    return path


def test_absent_file_and_absent_camera_are_assumed_zero(tmp_path):
    assert by_hand.read(None, CAMERAS) == {c: (0.0, 0.0, "assumed_zero") for c in CAMERAS}
    assert by_hand.read(tmp_path / "none.yaml", CAMERAS)["cam01"] == (0.0, 0.0, "assumed_zero")
    found = by_hand.read(write(tmp_path, "cam02: {offset_s: -0.12, drift_ppm: 40}\n"), CAMERAS)
    assert found == {"cam01": (0.0, 0.0, "assumed_zero"), "cam02": (-0.12, 40.0, "manual")}


def test_empty_file_is_no_override(tmp_path):
    assert by_hand.read(write(tmp_path, "# nothing\n"), CAMERAS)["cam02"][2] == "assumed_zero"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cam2: {offset_s: 0.1}", "'cam2' is not one of the cameras .*did you mean 'cam0"),
        ("cam01: {offset_s: 0.1, drift: 2}", "unknown key .cam01.drift..*drift_ppm"),
        ("cam01: {offset_s: fast}", "'cam01.offset_s' is 'fast' but should be a number"),
        ("cam01: {offset_s: .nan}", "number"),
        ("cam01: {offset_s: true}", "should be a number"),
        ("cam01: {drift_ppm: 3}", "'cam01.offset_s' is missing"),
        ("cam01: 0.1", "should be keys with values"),
        ("- cam01", "should be keys with values"),
        ("cam01: {offset_s: 0.1", "YAML"),
    ],
)
def test_bad_files_name_the_file_and_the_key(tmp_path, text, message):
    with pytest.raises(DiorError, match=message) as error:
        by_hand.read(write(tmp_path, text), CAMERAS)
    assert "indoor_01.yaml" in str(error.value)


def test_the_error_that_a_person_gives_is_of_the_time_in_seconds(tmp_path):
    found = by_hand.by_hand(write(tmp_path, "cam01: {offset_s: 0.1, sigma_s: 0.004}\ncam02: {offset_s: 1}\n"), CAMERAS)
    assert found["cam01"].given == (0.004, 0.0) and found["cam02"].given == (0.0, 0.0)
