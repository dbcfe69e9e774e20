"""C3D files written here, and the real walk."""

import struct

import ezc3d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.ingest import mocap
from dior.tables import tables

T0 = 1_708_000_000_000_000_000
MARKERS = ("LANK", "LASI", "RASI", "LKNE", "LPSI")


def write_c3d(path, labels=MARKERS, points=None, rate=100.0, unit="mm", frames=4):
    """A C3D whose marker i is at (1000 + i, 10 * frame + 1, 5) in its unit, unless `points` (3, N, F) is given."""
    c3d = ezc3d.c3d()
    if points is None:
        points = np.stack(np.broadcast_arrays(
            1000.0 + np.arange(len(labels))[:, None], 10.0 * np.arange(frames)[None] + 1, 5.0
        ))  # fmt: skip
    c3d["data"]["points"] = np.concatenate([points, np.ones((1, *points.shape[1:]))])
    c3d["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate]
    c3d.add_parameter("POINT", "UNITS", [unit] if unit else [])
    c3d.write(str(path))
    return path


def run(tmp_path, c3d, stamps=((("cam01", T0 + 7), ("cam02", T0))), trigger_log=None):
    count = len(stamps)
    tables.write(tmp_path / "frames.parquet", "frames", {
        "camera": [camera for camera, _ in stamps], "frame": np.zeros(count, int),
        "stamp_ns": np.array([stamp for _, stamp in stamps], np.int64),
    })  # fmt: skip
    out = tmp_path / "mocap.parquet"
    mocap.run(
        sequence="walk", subject="S01", c3d=c3d, frames=tmp_path / "frames.parquet", trigger_log=trigger_log, out=out
    )
    return tables.read(out, "skeletons_3d")


def test_markers_by_name_in_metres_on_the_clock_of_the_pictures(tmp_path):
    table = run(tmp_path, write_c3d(tmp_path / "a.c3d", rate=120.0))
    xyz, joints = tables.grid(table, "x", "y", "z")
    assert joints == ["LASI", "RASI", "LPSI", "LKNE", "LANK"]
    np.testing.assert_allclose(xyz[0, :, 0], [1.001, 1.002, 1.004, 1.003, 1.0], atol=1e-6)
    np.testing.assert_allclose(xyz[:, 0, 1], [0.001, 0.011, 0.021, 0.031], atol=1e-6)
    assert table["instant"].reshape(4, 5)[:, 0].tolist() == [0, 1, 2, 3]
    assert (table["stamp_ns"].reshape(4, 5)[:, 0] - T0).tolist() == [0, 8_333_333, 16_666_667, 25_000_000]
    assert set(table["status"]) == {"ok"} and set(table["n_views"]) == {-1}
    assert set(table["subject"]) == {"S01"} and set(table["sequence"]) == {"walk"}
    assert np.isnan(table["residual_px"]).all()


@pytest.mark.parametrize("unit, scale", [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("MM", 0.001)])
def test_the_files_own_unit(tmp_path, unit, scale):
    got = mocap.read(write_c3d(tmp_path / "a.c3d", unit=unit))
    np.testing.assert_allclose(got.points[0, 0], np.array([1001, 1, 5]) * scale, rtol=1e-6)


@pytest.mark.parametrize("unit", ["", "furlong"])
def test_unknown_unit(tmp_path, unit):
    with pytest.raises(DiorError, match=rf"a\.c3d: POINT:UNITS is '{unit}', not one of mm, cm, m"):
        mocap.read(write_c3d(tmp_path / "a.c3d", unit=unit))


def test_gaps_are_null_with_a_reason(tmp_path):
    points = np.arange(1, 61, dtype=float).reshape(3, 5, 4)
    points[:, 1, 2] = np.nan
    points[:, 2, 1] = 0.0
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
    assert struct.unpack_from("<4f", content, at) == (1001.0, 21.0, 5.0, 0.0)
    struct.pack_into("<4f", content, at, *coordinates, -1.0)
    path.write_bytes(content)
    got = mocap.read(path)
    gap = np.isnan(got.points).all(axis=-1)
    assert gap[2, got.markers.index(MARKERS[1])] and gap.sum() == 1
    assert np.isfinite(got.points[~gap]).all()


def test_prefix_is_stripped_and_other_points_are_ignored(tmp_path):
    labels = ["LKneeAngles", "S01:LASI", "Subject_2:RASI", "*7", "S01:LKNE", "S01:LANK", "LHipForce"]
    assert mocap.read(write_c3d(tmp_path / "a.c3d", labels)).markers == ("LASI", "RASI", "LKNE", "LANK")


def test_two_labels_of_one_marker(tmp_path):
    labels = ["A:LASI", "A:RASI", "B:LASI", "LKNE", "LANK"]
    with pytest.raises(DiorError, match=r"a\.c3d: the labels 'A:LASI' and 'B:LASI' are both the marker LASI"):
        mocap.read(write_c3d(tmp_path / "a.c3d", labels))


def test_any_four_markers_and_what_is_no_marker_set(tmp_path):
    """Also without LASI and RASI: what needs them later says so there."""
    assert mocap.read(write_c3d(tmp_path / "a.c3d", ["LKNE", "C7", "Lasi", "LANK", "RELB"])).markers == (
        "C7", "RELB", "LKNE", "LANK",
    )  # fmt: skip
    with pytest.raises(
        DiorError, match=r"b\.c3d: 3 of the 39 .* fewer than 4 .* its labels are LASI, Rasi, RKNE, LKNE"
    ):
        mocap.read(write_c3d(tmp_path / "b.c3d", ["LASI", "Rasi", "RKNE", "LKNE"]))


def test_labels_beyond_255_points(tmp_path):
    labels = [f"x{i}" for i in range(258)] + list(MARKERS)
    got = mocap.read(write_c3d(tmp_path / "a.c3d", labels, frames=2))
    np.testing.assert_allclose(got.points[0, :, 0], [1.259, 1.260, 1.262, 1.261, 1.258], atol=1e-6)


def test_missing_and_broken_c3d(tmp_path):
    with pytest.raises(DiorError, match=r"gone\.c3d: there is no such C3D"):
        mocap.read(tmp_path / "gone.c3d")
    for content in (b"", b"hello" * 200):
        (tmp_path / "bad.c3d").write_bytes(content)
        with pytest.raises(DiorError, match=r"bad\.c3d: not a readable C3D"):
            mocap.read(tmp_path / "bad.c3d")


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    return write_c3d(tmp_path_factory.mktemp("c3d") / "a.c3d", frames=20).read_bytes()


@settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_a_flipped_bit_or_a_cut_is_read_or_refused_in_one_sentence(content, tmp_path, data):
    damaged = bytearray(content)
    at = data.draw(st.integers(0, len(content) - 1))
    damaged[at] ^= 1 << data.draw(st.integers(0, 7))
    (tmp_path / "bad.c3d").write_bytes(damaged[: data.draw(st.sampled_from([len(content), len(content) - 1, at]))])
    try:
        read = mocap.read(tmp_path / "bad.c3d")
    except DiorError as error:
        assert "bad.c3d" in str(error) and "\n" not in str(error)
    else:
        assert read.points.size <= len(content)


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


def test_truncated_real_walk(shared, tmp_path):
    content = (shared / "mocap" / "walk_100hz.c3d").read_bytes()
    for share in (0.03, 0.5):
        (tmp_path / "cut.c3d").write_bytes(content[: int(share * len(content))])
        with pytest.raises(DiorError, match=r"cut\.c3d: .*(cut off|not a readable)"):
            mocap.read(tmp_path / "cut.c3d")
