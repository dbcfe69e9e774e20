"""Which capture of a log the pictures are of, and what follows for the mocap and the timeline."""

import json

import numpy as np
import pytest

from dior.clocks import clock
from dior.errors import DiorError
from dior.ingest import mocap
from dior.ingest.trigger_log import Capture, choose, read
from dior.reconstruct import timeline
from dior.tables import tables
from tests.ingest.test_mocap import MARKERS, T0, write_c3d

S = 1_000_000_000


def write(path, *events):
    """A log with events (event, name, seconds after T0)."""
    keys = {"start": "start_ns", "stop": "stop_ns"}
    lines = [json.dumps({"event": "listening", "host_ns": T0})]
    lines += [json.dumps({"event": kind, "name": name, keys[kind]: T0 + round(at * S)}) for kind, name, at in events]
    path.write_text("\n".join(lines) + "\n")
    return path


DAY = (
    ("start", "walk_01", 0), ("stop", "walk_01", 60), ("start", "walk_02", 100), ("stop", "walk_02", 160),
    ("start", "walk_03", 200), ("start", "walk_03", 300), ("stop", "walk_03", 360),
)  # fmt: skip


def chosen(path, first, last, **how):
    return choose(read(path), T0 + round(first * S), T0 + round(last * S), path, **how)


def test_captures_with_their_stops(tmp_path):
    found = read(write(tmp_path / "a.jsonl", *DAY))
    assert found == [
        Capture("walk_01", T0, T0 + 60 * S), Capture("walk_02", T0 + 100 * S, T0 + 160 * S),
        Capture("walk_03", T0 + 200 * S), Capture("walk_03", T0 + 300 * S, T0 + 360 * S),
    ]  # fmt: skip


@pytest.mark.parametrize(
    "first, last, began",
    # the trigger starts the recording; it was on before; it began late; a capture whose stop was lost
    [(0.4, 60.2, 0), (80, 165, 100), (150, 190, 100), (201, 290, 200), (301, 400, 300)],
)
def test_the_capture_that_ran_while_the_pictures_were_taken(tmp_path, first, last, began):
    assert chosen(write(tmp_path / "a.jsonl", *DAY), first, last).start_ns == T0 + began * S


def test_a_capture_is_known_by_the_name_of_the_c3d(tmp_path):
    path = write(tmp_path / "a.jsonl", *DAY)
    assert chosen(path, -5, 500, c3d="Walk_02.c3d").start_ns == T0 + 100 * S
    assert chosen(path, 301, 360, c3d="walk_03.c3d").start_ns == T0 + 300 * S, "the second of that name"
    assert chosen(path, 1, 60, c3d="cleaned.c3d").start_ns == T0
    assert chosen(path, -5, 500, c3d="walk_02.c3d", name="walk_01").start_ns == T0


def test_what_cannot_be_told_is_refused(tmp_path):
    path = write(tmp_path / "a.jsonl", *DAY)
    with pytest.raises(
        DiorError, match=r"'walk_01' .*'walk_0[23]' .*both ran.*behind the path.*trigger\.jsonl#walk_03"
    ):
        chosen(path, 0, 165)
    with pytest.raises(DiorError, match="'walk_02' began 3500.0 s before the first picture.*NTP state"):
        chosen(path, 3600, 3660, c3d="walk_02.c3d")
    with pytest.raises(DiorError, match="'walk_01' began 100.0 s after the first picture"):
        chosen(path, -100, -50)
    with pytest.raises(DiorError, match="no capture of this trigger log is called 'walk_2' .did you mean 'walk_02'"):
        chosen(path, 100, 160, name="walk_2")
    with pytest.raises(DiorError, match="no capture has begun"):
        chosen(write(tmp_path / "b.jsonl"), 0, 1)


def test_a_torn_or_strange_line_is_left_out_and_another_file_refused(tmp_path):
    path = write(tmp_path / "a.jsonl", ("start", "walk_01", 0))
    lines = ['{"event": "stop", "na', "[1, 2]", '{"event": "start", "name": 5, "start_ns": 3}', '{"event": "start"}']
    lines += ['{"event": "start", "name": "x", "start_ns": "soon"}', "\x00\xff", "[" * 5000, ""]
    # JSON holds numbers that no clock shows
    lines += [f'{{"event": "start", "name": "x", "start_ns": {ns}}}' for ns in ("9" * 400, "9" * 5000, "1e999", "-1")]
    path.write_bytes(path.read_bytes() + "\n".join(lines).encode("latin-1"))
    assert read(path) == [Capture("walk_01", T0)]
    for content in (b"", b"time,name\n0,walk\n", b"[1]\n{}\n"):
        (tmp_path / "b.jsonl").write_bytes(content)
        with pytest.raises(DiorError, match=r"b\.jsonl: no log of `dior trigger`"):
            read(tmp_path / "b.jsonl")
    with pytest.raises(DiorError, match=r"gone\.jsonl: there is no such trigger log"):
        read(tmp_path / "gone.jsonl")


def frames_table(folder, seconds):
    """The frames of two cameras, the second 10 ms later."""
    stamps = np.concatenate([T0 + round(start * S) + np.arange(60) * 33_333_333 for start in (seconds, seconds + 0.01)])
    tables.write(folder / "frames.parquet", "frames", {
        "camera": np.repeat(["cam01", "cam02"], 60), "frame": np.tile(np.arange(60), 2), "stamp_ns": stamps,
    })  # fmt: skip
    return folder / "frames.parquet"


def markers(folder, c3d, log, seconds=0.4, capture=""):
    out = folder / "mocap.parquet"
    mocap.run(
        sequence="walk", subject="S01", c3d=c3d, frames=frames_table(folder, seconds), trigger_log=log, out=out,
        capture=capture,
    )  # fmt: skip
    return out


def test_the_mocap_begins_when_the_log_says(tmp_path):
    c3d = write_c3d(tmp_path / "walk_02.c3d")
    log = write(tmp_path / "a.jsonl", ("start", "walk_01", -50), ("start", "walk_02", 0.033))
    out = markers(tmp_path, c3d, log)
    stamps = tables.read(out, "skeletons_3d")["stamp_ns"].reshape(-1, len(MARKERS))[:, 0]
    assert (stamps - T0).tolist() == [33_000_000, 43_000_000, 53_000_000, 63_000_000]
    assert tables.metadata(out)["t0_from"] == "trigger_log"
    stamps = tables.read(markers(tmp_path, c3d, None), "skeletons_3d")["stamp_ns"]
    assert stamps[0] == T0 + 400_000_000 and tables.metadata(out)["t0_from"] == "pictures"


def test_a_c3d_of_a_part_of_the_capture_begins_later(tmp_path):
    import ezc3d

    file = ezc3d.c3d(str(write_c3d(tmp_path / "whole.c3d")))
    file["header"]["points"]["first_frame"] = 147
    file.write(str(tmp_path / "part.c3d"))
    out = markers(tmp_path, tmp_path / "part.c3d", write(tmp_path / "a.jsonl", ("start", "walk_01", 0)))
    assert tables.read(out, "skeletons_3d")["stamp_ns"][0] == T0 + 1_470_000_000


def test_the_sheet_may_name_the_capture(tmp_path):
    c3d = write_c3d(tmp_path / "renamed.c3d")
    log = write(tmp_path / "a.jsonl", ("start", "a", 0), ("start", "b", 1.4))
    with pytest.raises(DiorError, match="both ran"):
        markers(tmp_path, c3d, log)
    out = markers(tmp_path, c3d, log, capture="b")
    assert tables.read(out, "skeletons_3d")["stamp_ns"][0] == T0 + 1_400_000_000


def test_the_timeline_counts_from_the_same_moment(tmp_path):
    """Another t0 with the offsets to match it brackets every instant by the same pictures."""
    c3d = write_c3d(tmp_path / "walk.c3d", frames=150)

    def bracketed(log, offset):
        known = {"cam01": clock.Clock(offset), "cam02": clock.Clock(offset - 0.004)}
        clock.write(tmp_path / "clocks.parquet", tmp_path / "gains.parquet", "walk", known)
        timeline.run(
            sequence="walk", frames=tmp_path / "frames.parquet", cameras=list(known),
            mocap=markers(tmp_path, c3d, log), clocks=[tmp_path / "clocks.parquet"], max_gap=1.5,
            out=tmp_path / "timeline.parquet",
        )  # fmt: skip
        return tables.read(tmp_path / "timeline.parquet", "timeline")

    without = bracketed(None, 0.15)
    # the first picture is 0.4 s after T0 and 0.15 s after the first tick, which the log says began 0.05 s before it did
    with_log = bracketed(write(tmp_path / "a.jsonl", ("start", "walk", 0.2)), -0.05)
    for key in ("frame_before", "frame_after"):
        np.testing.assert_array_equal(with_log[key], without[key])
    np.testing.assert_allclose(with_log["weight"], without["weight"], atol=1e-6)
    assert (with_log["frame_before"] >= 0).sum() > 200
    assert set(without["stamp_ns"] - with_log["stamp_ns"]) == {200_000_000}
