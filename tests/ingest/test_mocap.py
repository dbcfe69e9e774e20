"""The markers of a C3D on the clock of the pictures: files that ezc3d writes, and the real walk."""

import struct

import ezc3d
import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import mocap
from dior.tables import tables
from tests.ingest.c3d_files import person

T0 = 1_708_000_000_000_000_000
MARKERS = ("LANK", "LASI", "RASI", "LKNE", "LPSI")


def write_c3d(path, labels=MARKERS, points=None, rate=100.0, unit="mm", frames=4):
    """A C3D of a person who walks along x at 1 m/s, unless `points` (F, N, 3) in its unit is given."""
    c3d = ezc3d.c3d()
    if points is None:
        points = person(labels, frames, rate) / mocap.METRES.get(unit.lower(), 1e-3)
    c3d["data"]["points"] = np.concatenate([points.transpose(2, 1, 0), np.ones((1, *points.shape[1::-1]))])
    c3d["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate]
    c3d.add_parameter("POINT", "UNITS", [unit] if unit else [])
    c3d.write(str(path))
    return path


def run(tmp_path, c3d, stamps=((("cam01", T0 + 7), ("cam02", T0))), trigger_log=None, subject="S01", **settings):
    count = len(stamps)
    tables.write(tmp_path / "frames.parquet", "frames", {
        "camera": [camera for camera, _ in stamps], "frame": np.zeros(count, int),
        "stamp_ns": np.array([stamp for _, stamp in stamps], np.int64),
    })  # fmt: skip
    out = tmp_path / "mocap.parquet"
    mocap.run(
        sequence="walk", subject=subject, c3d=c3d, frames=tmp_path / "frames.parquet", trigger_log=trigger_log, out=out,
        **settings,
    )  # fmt: skip
    return tables.read(out, "skeletons_3d")


def test_markers_by_name_in_metres_on_the_clock_of_the_pictures(tmp_path):
    table = run(tmp_path, write_c3d(tmp_path / "a.c3d", rate=120.0))
    xyz, joints = tables.grid(table, "x", "y", "z")
    assert joints == ["LASI", "RASI", "LPSI", "LKNE", "LANK"]
    np.testing.assert_allclose(xyz, person(joints, 4, 120.0), atol=1e-6)
    assert table["instant"].reshape(4, 5)[:, 0].tolist() == [0, 1, 2, 3]
    assert (table["stamp_ns"].reshape(4, 5)[:, 0] - T0).tolist() == [0, 8_333_333, 16_666_667, 25_000_000]
    assert set(table["status"]) == {"ok"} and set(table["n_views"]) == {-1}
    assert set(table["subject"]) == {"S01"} and set(table["sequence"]) == {"walk"}
    assert np.isnan(table["residual_px"]).all()


@pytest.mark.parametrize("unit", ["mm", "cm", "m", "MM", "Meters"])
def test_the_files_own_unit(tmp_path, unit):
    points = person(MARKERS, 4) / mocap.METRES[{"Meters": "m"}.get(unit, unit.lower())]
    got = mocap.read(write_c3d(tmp_path / "a.c3d", points=points, unit=unit))
    np.testing.assert_allclose(got.points, person(got.markers, 4), atol=1e-6)


def test_gaps_are_null_with_a_reason(tmp_path):
    points = 1000 * person(MARKERS, 4)
    points[2, 1] = np.nan
    points[1, 2] = 0.0
    table = run(tmp_path, write_c3d(tmp_path / "a.c3d", points=points))
    xyz, joints = tables.grid(table, "x", "y", "z")
    gap = np.zeros((4, 5), bool)
    gap[2, joints.index("LASI")] = gap[1, joints.index("RASI")] = True
    np.testing.assert_array_equal(np.isnan(xyz), np.repeat(gap[..., None], 3, axis=-1))
    np.testing.assert_array_equal(table["status"].reshape(4, 5) == "too_few_views", gap)


@pytest.mark.parametrize("coordinates", [(1001.0, 21.0, 5.0), (0.0, 0.0, 0.0)])
def test_a_point_with_a_negative_residual_is_a_gap_whatever_its_coordinates(tmp_path, coordinates):
    path = write_c3d(tmp_path / "a.c3d")
    content = bytearray(path.read_bytes())
    # header word 9: where the data begin; 4 floats a point, the residual last
    (block,) = struct.unpack_from("<H", content, 16)
    at = 512 * (block - 1) + 16 * (2 * len(MARKERS) + 1)
    assert struct.unpack_from("<4f", content, at) == pytest.approx((100.0, 120.0, 960.0, 0.0), rel=1e-6)
    struct.pack_into("<4f", content, at, *coordinates, -1.0)
    path.write_bytes(content)
    got = mocap.read(path)
    gap = np.isnan(got.points).all(axis=-1)
    assert gap[2, got.markers.index(MARKERS[1])] and gap.sum() == 1
    assert np.isfinite(got.points[~gap]).all()


def test_prefix_is_stripped_and_other_points_are_ignored(tmp_path):
    labels = ["LKneeAngles", "S01:LASI", "Subject_2:RASI", "*7", "S01:LKNE", "S01:LANK", "LHipForce"]
    assert mocap.read(write_c3d(tmp_path / "a.c3d", labels)).markers == ("LASI", "RASI", "LKNE", "LANK")


def test_any_four_markers_and_what_is_no_marker_set(tmp_path):
    """Also without LASI and RASI: what needs them later says so there."""
    assert mocap.read(write_c3d(tmp_path / "a.c3d", ["LKNE", "C7", "LASX", "LANK", "RELB"])).markers == (
        "C7", "RELB", "LKNE", "LANK",
    )  # fmt: skip
    with pytest.raises(
        DiorError, match=r"b\.c3d: 3 of the 39 .* fewer than 4 .* its labels are LASI, RASX, RKNE, LKNE"
    ):
        mocap.read(write_c3d(tmp_path / "b.c3d", ["LASI", "RASX", "RKNE", "LKNE"]))


def test_missing_and_broken_c3d(tmp_path):
    with pytest.raises(DiorError, match=r"gone\.c3d: there is no such C3D"):
        mocap.read(tmp_path / "gone.c3d")
    for content in (b"", b"hello" * 200):
        (tmp_path / "bad.c3d").write_bytes(content)
        with pytest.raises(DiorError, match=r"bad\.c3d: not a readable C3D"):
            mocap.read(tmp_path / "bad.c3d")


def test_frames_without_pictures(tmp_path):
    c3d = write_c3d(tmp_path / "a.c3d")
    with pytest.raises(DiorError, match="has no picture"):
        run(tmp_path, c3d, stamps=())


def test_real_walk(shared, tmp_path):
    table = run(tmp_path, shared / "mocap" / "walk_100hz.c3d")
    xyz, joints = tables.grid(table, "x", "y", "z")
    assert xyz.shape == (315, 35, 3)
    shank = np.linalg.norm(xyz[:, joints.index("LKNE")] - xyz[:, joints.index("LANK")], axis=-1)
    assert np.nanmean(shank) == pytest.approx(0.3865, abs=5e-5) and np.nanstd(shank) == pytest.approx(0.0068, abs=1e-4)
    assert np.isnan(xyz[..., 0]).mean() == pytest.approx(0.003, abs=5e-4)
    assert table["stamp_ns"].max() - T0 == 3_140_000_000
    # the file counts from 1 and stores from its frame 148; counted from 0, as ezc3d does, that is 147
    assert {"rate_hz": "100.0", "first_frame": "148"}.items() <= tables.metadata(tmp_path / "mocap.parquet").items()
    travelled = np.nanmean(xyz[-1], axis=0) - np.nanmean(xyz[0], axis=0)
    assert np.hypot(*travelled[:2]) / 3.14 == pytest.approx(1.15, abs=0.05)


@pytest.mark.parametrize("name", ["static_100hz", "overground_events_100hz"])
def test_other_real_files_have_every_number_that_ezc3d_has(shared, name):
    """A subject who stands, and a lower body beside angles, forces and analog channels."""
    path = shared / "mocap" / f"{name}.c3d"
    c3d, got = ezc3d.c3d(str(path)), mocap.read(path)
    labels = [label.rpartition(":")[2].strip() for label in c3d["parameters"]["POINT"]["LABELS"]["value"]]
    points = c3d["data"]["points"][:3, [labels.index(marker) for marker in got.markers]].transpose(2, 1, 0)
    np.testing.assert_allclose(got.points, np.where((points == 0).all(-1, keepdims=True), np.nan, points / 1000))
    assert len(got.markers) == {"static_100hz": 35, "overground_events_100hz": 16}[name]
    assert got.first_frame == c3d["header"]["points"]["first_frame"] + 1


def test_truncated_real_walk(shared, tmp_path):
    content = (shared / "mocap" / "walk_100hz.c3d").read_bytes()
    for share in (0.03, 0.5):
        (tmp_path / "cut.c3d").write_bytes(content[: int(share * len(content))])
        with pytest.raises(DiorError, match=r"cut\.c3d: .*(cut off|not a readable)"):
            mocap.read(tmp_path / "cut.c3d")
