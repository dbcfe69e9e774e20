"""The real walks, upper and lower body, written again in each format of text: the same table."""

import ezc3d
import numpy as np
import pytest

from dior.body.names import PLUG_IN_GAIT_39
from dior.ingest import mocap
from dior.ingest.c3d_check import layout
from dior.tables import tables
from tests.ingest.mocap_files import texts
from tests.ingest.test_mocap import run

WRITERS = {
    "qtm": lambda path, *how: texts.qtm(path, *how),
    "qtm, bare": lambda path, labels, points, rate, first: texts.qtm(
        path, labels, points, rate, columns=False, zeros=False
    ),
    "motive": lambda path, *how: texts.motive(path, *how, unit="Millimeters"),
    "trc": lambda path, *how: texts.trc(path, *how),
}
# as Qualisys' and OptiTrack's sets after Cappozzo et al. call what is the same place on the body
THEIRS = {
    "LASI": "L_IAS", "RASI": "R_IAS", "LPSI": "L_IPS", "RPSI": "R_IPS", "LKNE": "L_FLE", "RKNE": "R_FLE",
    "LANK": "L_FAL", "RANK": "R_FAL", "LHEE": "L_FCC", "RHEE": "R_FCC", "LTOE": "L_FM2", "RTOE": "R_FM2",
}  # fmt: skip


def content(path):
    """(labels, points (F, N, 3) m) of the markers of a C3D and the first of its other points."""
    labels = layout(path).labels
    kept = [i for i, label in enumerate(labels) if label in PLUG_IN_GAIT_39 or i < 8]
    xyz = ezc3d.c3d(str(path))["data"]["points"][:3, kept].transpose(2, 1, 0) / 1000
    return [labels[i] for i in kept], np.where((xyz == 0).all(axis=-1, keepdims=True), np.nan, xyz)


@pytest.mark.parametrize("name", ["walk_100hz", "overground_events_100hz"])
@pytest.mark.parametrize("writer", WRITERS)
def test_the_same_table(shared, tmp_path, name, writer):
    real = shared / "mocap" / f"{name}.c3d"
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    expected = run(tmp_path / "a", real)
    labels, points = content(real)
    rate, first = layout(real).rate, layout(real).first
    got = run(tmp_path / "b", WRITERS[writer](tmp_path / "b" / "a.txt", labels, points, rate, first))
    for key in ("joint", "instant", "stamp_ns", "status"):
        np.testing.assert_array_equal(got[key], expected[key])
    for key in "xyz":
        # a micrometre of millimetres with three decimals
        np.testing.assert_allclose(got[key], expected[key], atol=1.1e-6)
    said = [tables.metadata(tmp_path / side / "mocap.parquet") for side in ("a", "b")]
    assert said[0]["rate_hz"] == said[1]["rate_hz"]
    assert said[1]["first_frame"] == ("1" if "bare" in writer else said[0]["first_frame"])


@pytest.mark.parametrize("writer", WRITERS)
def test_a_labs_own_names_by_the_sheet(shared, tmp_path, writer):
    real = shared / "mocap" / "overground_events_100hz.c3d"
    labels, points = content(real)
    path = WRITERS[writer](tmp_path / "a.txt", [THEIRS.get(label, label) for label in labels], points, 100.0, 1)
    sheet = tmp_path / "markers.tsv"
    sheet.write_text("name\tmarker\n" + "".join(f"{theirs}\t{ours}\n" for ours, theirs in THEIRS.items()))
    expected, got = run(tmp_path, real), run(tmp_path, path, names=sheet, findings=tmp_path / "f.parquet")
    np.testing.assert_array_equal(got["joint"], expected["joint"])
    np.testing.assert_allclose(got["x"], expected["x"], atol=1.1e-6)
    found = dict(zip(*(tables.read(tmp_path / "f.parquet", "findings")[key] for key in ("code", "text")), strict=True))
    assert found["markers_by_sheet"] == "12 of 16 markers have the names that config/markers.tsv gives them"
    assert set(found) <= {"markers_by_sheet", "mocap_turned"}


def test_clean_walks_bring_no_finding(shared):
    for name in ("walk_100hz", "static_100hz", "overground_events_100hz"):
        assert mocap.read(shared / "mocap" / f"{name}.c3d").said == ()
