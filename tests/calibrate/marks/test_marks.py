"""Reading hand marks and giving them their world points."""

import numpy as np
import pytest

from dior.calibrate.marks import marks
from dior.errors import DiorError, DiorErrors
from tests.rig import ring

T0 = 1_708_000_000_000_000_000
HEADER = "sequence,frame,joint,u,v\n"


def write(folder, text):
    path = folder / "cam01.marks.csv"
    path.write_text(text)
    return path


def motion():
    """LASI moves at 1, 2, 3 m/s from (0, 0, 1) at 100 Hz and is missing at tick 5; tick 8 is left out."""
    t = np.delete(np.arange(12), 8) / 100
    xyz = np.stack([np.array([0, 0, 1.0]) + t[:, None] * (1, 2, 3), np.zeros((11, 3))], axis=1)
    xyz[5, 0] = np.nan
    return marks.Motion(t, T0, xyz, ["LASI", "RASI"])


def in_world(path, seconds, offset_s=0.0, drift_ppm=0.0):
    """Marks in the world with the picture of frame 0 at `seconds`."""
    stamps = {"indoor_01": (np.array([0]), np.array([T0 + round(seconds * 1e9)]))}
    return marks.in_world(
        marks.read(path), path, "cam01", ring(1)[0].intrinsics, {"indoor_01": motion()}, stamps,
        {"indoor_01": (offset_s, drift_ppm, "manual")}, "lab/cam01",
    )  # fmt: skip


def test_columns_in_any_order_and_optional_xyz(tmp_path):
    text = "joint,sequence,frame,v,u,x,y,z\nLASI,a,3,2.5,1.5,,,\nRASI,a,4,7,6,0.1,0.2,0.3\n"
    read = marks.read(write(tmp_path, text))
    assert read.joint.tolist() == ["LASI", "RASI"] and read.frame.tolist() == [3, 4] and read.line.tolist() == [2, 3]
    np.testing.assert_array_equal(read.uv, [[1.5, 2.5], [6, 7]])
    np.testing.assert_array_equal(read.xyz, [[np.nan] * 3, [0.1, 0.2, 0.3]])


def test_a_file_with_a_header_only_has_no_marks(tmp_path):
    assert len(marks.read(write(tmp_path, HEADER))) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sequence,frame,joint,u\n", "column 'v' is missing"),
        ("sequence,frame,joint,u,v,x,y\n", "column 'z' is missing"),
        ("sequence,frame,joints,u,v\n", "unknown column 'joints'.*did you mean 'joint'"),
        ("sequence,frame,joint,u,u\n", "column 'u' is there twice"),
        (HEADER + "a,0,LASI,1\n", "line 2: has . cells where the header has 5"),
        (HEADER + "a,0,LASI,1,2,3\n", "line 2: has . cells where the header has 5"),
        (HEADER + "a,0,LASI,1,2\na,1.5,LASI,1,2\n", "line 3: frame is '1.5'"),
        (HEADER + "a,-1,LASI,1,2\n", "line 2: frame is '-1'"),
        (HEADER + "a,0,LASI,one,2\n", "line 2: u is 'one'"),
        (HEADER + "a,0,LASI,nan,2\n", "line 2: u is 'nan'"),
        (HEADER + "a,0,,1,2\n", "line 2: sequence or joint is empty"),
        ("sequence,frame,joint,u,v,x,y,z\na,0,P,1,2,0.1,,0.3\n", "line 2: give all of x,y,z or none"),
        (HEADER + "a,0,LASI,1,2\na,0,LASI,3,4\n", "line 3: LASI on frame 0 of a is marked already on line 2"),
    ],
)
def test_bad_lines_are_named(tmp_path, text, message):
    with pytest.raises(DiorError, match=message) as error:
        marks.read(write(tmp_path, text))
    assert "cam01.marks.csv" in str(error.value)


def test_all_bad_lines_are_named_together(tmp_path):
    with pytest.raises(DiorErrors) as error:
        marks.read(write(tmp_path, HEADER + "a,0,LASI,one,2\na,0,LASI,1,2\na,-1,LASI,1,2\n"))
    assert ["line 2" in str(error.value.found[0]), "line 4" in str(error.value.found[1])] == [True, True]


def test_no_file(tmp_path):
    with pytest.raises(DiorError, match="no such file"):
        marks.read(tmp_path / "cam01.marks.csv")


@pytest.mark.parametrize(("seconds", "offset_s", "at"), [(0.02, 0, 0.02), (0.013, 0, 0.013), (0.5, -0.487, 0.013)])
def test_the_marker_is_taken_at_the_stamp_plus_offset(tmp_path, seconds, offset_s, at):
    found, findings = in_world(write(tmp_path, HEADER + "indoor_01,0,LASI,600,300\n"), seconds, offset_s)
    np.testing.assert_allclose(found.xyz, [[at, 2 * at, 1 + 3 * at]], atol=1e-9)
    assert not findings


def test_the_drift_counts(tmp_path):
    found, _ = in_world(write(tmp_path, HEADER + "indoor_01,0,LASI,600,300\n"), 0.02, 0.0, 1e5)
    np.testing.assert_allclose(found.xyz[0, 0], 0.022, atol=1e-9)


@pytest.mark.parametrize("seconds", [0.045, 0.05, 0.055, 0.08, 0.2, -0.01])
def test_a_mark_without_its_marker_is_dropped_and_named(tmp_path, seconds):
    path = write(tmp_path, HEADER + "indoor_01,0,LASI,600,300\nindoor_01,0,RASI,610,300\n")
    found, findings = in_world(path, seconds)
    assert "LASI" not in found.joint
    scope, severity, code, text = findings[0]
    assert (scope, severity, code) == ("lab/cam01", "warning", "mark_without_marker")
    assert "of 2 marks are not used" in text and "line 2 LASI, frame 0 of indoor_01" in text


def test_own_world_points_need_no_mocap(tmp_path):
    path = write(tmp_path, "sequence,frame,joint,u,v,x,y,z\nindoor_01,0,corner,600,300,1,2,3\n")
    np.testing.assert_array_equal(in_world(path, 99.0)[0].xyz, [[1, 2, 3]])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("indoor_01,0,LASIS,600,300", "line 2: 'LASIS' is not a marker of indoor_01.*did you mean 'LASI'"),
        ("indoor_01,1,LASI,600,300", "line 2: cam01 has no frame 1 in indoor_01"),
        ("indoor_1,0,LASI,600,300", "line 2: 'indoor_1' is not a sequence.*did you mean 'indoor_01'"),
        ("indoor_01,0,LASI,1300,300", "line 2: .1300, 300. is outside of the 1280x720 picture"),
    ],
)
def test_unknown_names_give_the_nearest(tmp_path, line, message):
    with pytest.raises(DiorError, match=message):
        in_world(write(tmp_path, HEADER + line + "\n"), 0.0)
