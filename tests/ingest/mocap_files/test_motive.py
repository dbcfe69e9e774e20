import re

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import mocap
from tests.ingest.c3d_files import PLACES, person
from tests.ingest.mocap_files.texts import motive

LABELS = [f"S01:{label}" for label in PLACES]
POINTS = person(LABELS, 12)


@pytest.mark.parametrize("unit", ["Meters", "Millimeters", "Centimeters"])
@pytest.mark.parametrize("solved, timecode", [(True, False), (False, True)])
def test_units_columns_and_gaps(tmp_path, unit, solved, timecode):
    points = POINTS.copy()
    points[3:5, 7] = np.nan
    got = mocap.read(motive(tmp_path / "a.csv", LABELS, points, 120.0, 40, unit, solved, timecode))
    assert (got.rate, got.first_frame) == (120.0, 40)
    np.testing.assert_allclose(got.points, points[:, [LABELS.index(f"S01:{m}") for m in got.markers]], atol=1e-5)
    assert [code for _, code, _ in got.said] == ["mocap_turned"]


def test_a_file_with_z_up_is_not_turned(tmp_path):
    path = motive(tmp_path / "a.csv", LABELS, POINTS, up="z")
    got = mocap.read(path)
    assert got.said == () and got.points[0, got.markers.index("C7")].tolist() == [-0.08, 0.0, 1.45]
    with pytest.raises(DiorError, match="the body does not stand along the y axis, but along z; set `mocap: {up: z}`"):
        mocap.read(path, up="y")


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("Space,Global", "Space,Local", "its Coordinate Space is 'Local'; export it in the global one"),
        ("Exported Frames,12", "Exported Frames,13", "it holds 12 of its 13 frames"),
        (",Meters,", ",Feet,", "Length Units is 'Feet', not one of mm, cm, m"),
        ("Frame,Time", "Frames,Time", "it has no rows Type, Name and Frame before its numbers"),
        (",Marker", ",Bone Marker", r"no column is a Marker's position \(there are Bone, Bone Marker\)"),
        ("\r\n2,", "\r\ntwo,", "holds something that is no number"),
        ("\r\n2,", "\r\n2\r\n2,", "line 10 has 1 columns, not 74; was the export interrupted"),
    ],
)
def test_what_is_no_such_file(tmp_path, old, new, text):
    path = motive(tmp_path / "a.csv", LABELS, POINTS)
    content = path.read_bytes().decode()
    assert old in content
    path.write_bytes(content.replace(old, new).encode())
    with pytest.raises(DiorError, match=rf"a\.csv: .*{text}"):
        mocap.read(path)


def test_decimal_commas_without_quotes_are_named(tmp_path):
    path = motive(tmp_path / "a.csv", LABELS, POINTS)
    path.write_text(re.sub(r"(\d)\.(\d)", r"\1,\2", path.read_text()))
    with pytest.raises(DiorError, match=r"line \d+ has \d+ columns and its header \d+; decimals must have a point"):
        mocap.read(path)
