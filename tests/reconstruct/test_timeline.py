import numpy as np
import pytest

from dior.clocks import clock
from dior.errors import DiorError
from dior.reconstruct import timeline
from dior.tables import tables

T0 = 1_700_000_000_000_000_000


def run(folder, starts, counts, drop=None, offsets=None, mocap=None):
    stamps = [T0 + start + np.arange(count) * 33_333_333 for start, count in zip(starts, counts, strict=True)]
    if drop is not None:
        stamps[1] = np.delete(stamps[1], drop)
    names = [f"cam{i + 1:02d}" for i in range(len(stamps))]
    total = sum(map(len, stamps))
    blank = {"bag": ["a"] * total, "topic": ["t"] * total, "nth": np.zeros(total, int)}
    columns = {
        "camera": np.concatenate([np.full(len(s), n, object) for s, n in zip(stamps, names, strict=True)]),
        "frame": np.concatenate([np.arange(len(s)) for s in stamps]),
        "stamp_ns": np.concatenate(stamps),
        "receive_ns": np.concatenate(stamps),
        "height": np.full(total, 720),
        "width": np.full(total, 1280),
    }
    tables.write(folder / "frames.parquet", "frames", columns | blank)
    known = {name: clock.Clock((offsets or {}).get(name, 0.0)) for name in names}
    clock.write(folder / "c.parquet", folder / "g.parquet", "walk", known)
    timeline.run(
        sequence="walk",
        frames=folder / "frames.parquet",
        cameras=names,
        clocks=[folder / "c.parquet"],
        mocap=mocap,
        max_gap=1.5,
        out=folder / "t.parquet",
    )
    line = tables.read(folder / "t.parquet", "timeline")
    return {name: tables.of_camera(line, name) for name in names}


def test_instants_are_a_grid_and_every_camera_is_bracketed(tmp_path):
    line = run(tmp_path, (0, 10_000_000), (30, 30))
    assert (line["cam01"]["frame_before"][:30] == np.arange(30)).all()
    assert line["cam01"]["weight"][:30] == pytest.approx(0, abs=1e-4)
    second = line["cam02"]
    assert second["frame_before"][0] == -1, "the second camera starts 10 ms later"
    assert (second["frame_before"][1:30] == np.arange(29)).all()
    assert (second["frame_after"][1:30] == np.arange(1, 30)).all()
    assert second["weight"][1:30] == pytest.approx(0.7, abs=1e-3)
    assert (np.diff(line["cam01"]["stamp_ns"]) > 33_333_332).all() and line["cam01"]["stamp_ns"][0] == T0


def test_a_dropped_picture_leaves_its_instants_empty(tmp_path):
    line = run(tmp_path, (0, 10_000_000), (30, 30), drop=12)["cam02"]
    empty = np.flatnonzero(line["frame_before"] == -1)
    assert empty.tolist() == [0, 12, 13]


def test_a_clock_offset_moves_a_camera(tmp_path):
    line = run(tmp_path, (0, 10_000_000), (30, 30), offsets={"cam02": -0.01})
    assert line["cam02"]["weight"] == pytest.approx(0, abs=1e-4)


def test_a_camera_without_a_clock_is_named(tmp_path):
    run(tmp_path, (0, 0), (5, 5))
    clock.write(tmp_path / "c.parquet", tmp_path / "g.parquet", "walk", {"cam01": clock.Clock(0.0)})
    with pytest.raises(DiorError, match="walk: .*c.parquet has no clock of cam02"):
        timeline.run(
            sequence="walk", frames=tmp_path / "frames.parquet", cameras=["cam01", "cam02"],
            clocks=[tmp_path / "c.parquet"], mocap=None, max_gap=1.5, out=tmp_path / "t.parquet",
        )  # fmt: skip


def test_indoors_the_instants_are_the_mocaps(tmp_path):
    ticks = T0 + np.arange(50) * 10_000_000
    tables.write(
        tmp_path / "m.parquet",
        "skeletons_3d",
        {
            "joint": np.tile(np.array(["LASI", "RASI"], object), 50),
            "instant": np.repeat(np.arange(50), 2),
            "stamp_ns": np.repeat(ticks, 2),
        },
    )
    line = run(tmp_path, (0, 10_000_000), (30, 30), mocap=tmp_path / "m.parquet")
    assert (line["cam01"]["stamp_ns"] == ticks).all()
    assert line["cam01"]["weight"][:4] == pytest.approx([0, 0.3, 0.6, 0.9], abs=1e-4)


def timeline_of_the_second(folder, known):
    """The timeline of cam02, of frames in f.parquet and two cameras with the clocks `known`."""
    clock.write(folder / "c.parquet", folder / "g.parquet", "walk", known)
    timeline.run(
        sequence="walk", frames=folder / "f.parquet", cameras=["cam01", "cam02"], clocks=[folder / "c.parquet"],
        mocap=None, max_gap=1.5, out=folder / "t.parquet",
    )  # fmt: skip
    return tables.of_camera(tables.read(folder / "t.parquet", "timeline"), "cam02")


@pytest.mark.parametrize(("hz", "missing"), [(60, [10]), (15, [])])
def test_a_drop_is_told_by_each_cameras_own_rate(tmp_path, hz, missing):
    """Instants at 30 Hz: of a camera at 60 Hz 33 ms are a lost picture, of one at 15 Hz 67 ms are none."""
    stamps = [T0 + np.round(np.arange(n) * 1e9 / rate).astype(np.int64) for n, rate in ((31, 30), (hz + 1, hz))]
    if hz == 60:
        stamps[1] = np.delete(stamps[1], 20)
    cameras = np.repeat(np.array(["cam01", "cam02"], object), list(map(len, stamps)))
    tables.write(tmp_path / "f.parquet", "frames", {"camera": cameras, "stamp_ns": np.concatenate(stamps)})
    known = {name: clock.Clock(0.0) for name in ("cam01", "cam02")}
    line = timeline_of_the_second(tmp_path, known)
    assert np.flatnonzero(line["frame_before"][:31] < 0).tolist() == missing


def test_a_drift_moves_a_camera_further_and_further(tmp_path):
    """At 2000 ppm 2 ms a second: a third of a picture at 30 Hz after 5 s."""
    stamps = T0 + np.round(np.arange(301) * 1e9 / 30).astype(np.int64)
    columns = {"camera": np.repeat(np.array(["cam01", "cam02"], object), 301), "stamp_ns": np.tile(stamps, 2)}
    tables.write(tmp_path / "f.parquet", "frames", columns)
    known = {"cam01": clock.Clock(0.0), "cam02": clock.Clock(0.0, -2000.0)}
    line = timeline_of_the_second(tmp_path, known)
    assert line["frame_before"][[30, 150]].tolist() == [30, 150]
    assert line["weight"][[30, 150]] == pytest.approx([0.06, 0.3], abs=0.002)
