import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import mocap
from tests.ingest.c3d_files import PLACES, person
from tests.ingest.mocap_files.texts import qtm

LABELS = list(PLACES)
POINTS = person(LABELS, 12)
NEWER = (["FILE_VERSION", "2.0.0"], ["EVENT", "Label", "3", "0.03"], ["TRAJECTORY_TYPES", *["Measured"] * len(LABELS)])


@pytest.mark.parametrize("columns", [True, False])
@pytest.mark.parametrize("zeros", [True, False])
@pytest.mark.parametrize("more", [(), NEWER])
def test_every_header_and_gaps(tmp_path, columns, zeros, more):
    points = POINTS.copy()
    points[3:5, 7] = np.nan
    got = mocap.read(qtm(tmp_path / "a.tsv", LABELS, points, 120.0, 40, columns, zeros, more))
    assert (got.rate, got.first_frame, got.said) == (120.0, 40 if columns else 1, ())
    expected = points[:, [LABELS.index(marker) for marker in got.markers]]
    np.testing.assert_allclose(got.points, expected, atol=1e-6)


@pytest.mark.parametrize(
    "kept, at, first, text",
    [("Frame", 0, 40, "line 17: frame 46 follows frame 44"), ("Time", 1, 1, "line 17: its time is 0.02 s after that")],
)
def test_one_of_frame_and_time_alone(tmp_path, kept, at, first, text):
    path = qtm(tmp_path / "a.tsv", LABELS, POINTS, 100.0, 40)
    head, _, rest = path.read_text().partition("Frame\tTime")
    names, *rows = rest.splitlines()
    rows = [line.split("\t") for line in rows]
    rows = ["\t".join([row[at], *row[2:]]) for row in rows]
    path.write_text("\n".join([f"{head}{kept}{names}", *rows]))
    got = mocap.read(path)
    assert got.first_frame == first
    np.testing.assert_allclose(got.points, POINTS[:, [LABELS.index(m) for m in got.markers]], atol=1e-6)
    del rows[5]
    path.write_text("\n".join([f"{head}{kept}{names}".replace("FRAMES\t12", "FRAMES\t11"), *rows]))
    with pytest.raises(DiorError, match=rf"a\.tsv: .*{text}"):
        mocap.read(path)


def test_a_column_more_that_nothing_names_is_refused(tmp_path):
    path = qtm(tmp_path / "a.tsv", LABELS, POINTS, columns=False)
    head, names, rest = path.read_text().partition("MARKER_NAMES")
    lines = rest.splitlines()
    path.write_text(head + names + lines[0] + "\n" + "".join(f"{i}\t{line}\n" for i, line in enumerate(lines[1:], 1)))
    with pytest.raises(DiorError, match="line 11 has 73 columns for 24 markers, with or without frame, time"):
        mocap.read(path)


def test_a_tab_at_the_end_of_every_row(tmp_path):
    for columns in (True, False):
        path = qtm(tmp_path / "a.tsv", LABELS, POINTS, columns=columns)
        path.write_text(path.read_text().replace("\n", "\t\n"))
        assert len(mocap.read(path).markers) == len(LABELS)


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("DATA_INCLUDED\t3D", "DATA_INCLUDED\t6D", "its DATA_INCLUDED is '6D', not 3D"),
        ("MARKER_NAMES", "BODY_NAMES", "it has no MARKER_NAMES"),
        ("NO_OF_FRAMES\t12", "NO_OF_FRAMES\t13", "it holds 12 of its 13 frames; it is cut off"),
        ("FREQUENCY\t100", "FREQUENCY\tfast", "its FREQUENCY is 'fast', which is no number"),
        ("FREQUENCY\t100", "FREQUENCY\t0", "FREQUENCY is 0; it needs its frame rate"),
        ("\n3\t", "\n3\tx\t", "line 14 holds something that is no number"),
        ("\tRTOE\n", "\tRTOE\tRTOE2\n", "its NO_OF_MARKERS is 24, and it names 25 markers"),
        ("NO_OF_MARKERS\t24", "NO_OF_MARKERS\t25", "line 12 has 74 columns, not 77"),
    ],
)
def test_what_is_no_such_file(tmp_path, old, new, text):
    path = qtm(tmp_path / "a.tsv", LABELS, POINTS)
    content = path.read_text()
    assert old in content
    path.write_text(content.replace(old, new, 1))
    with pytest.raises(DiorError, match=rf"a\.tsv: .*{text}"):
        mocap.read(path)
