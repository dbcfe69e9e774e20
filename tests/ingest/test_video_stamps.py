"""When a video's pictures were taken: sidecars of every layout, the file's own times, a start of its own."""

from pathlib import Path

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import video_stamps
from dior.ingest.video_stamps import NO_DATE_NS, Sidecar
from dior.ingest.videos import VideoIndex

T0 = 1_708_000_000_000_000_000
FRAME_NS = 40_000_000


def index(count=5, created_ns=None, tick_s=0.0, lost=(), pts_ns=None):
    pts_ns = FRAME_NS * np.arange(count) if pts_ns is None else np.asarray(pts_ns)
    size = np.full(count, 10)
    return VideoIndex(pts_ns, np.arange(count), size, size, lost, tick_s, created_ns)


def test_without_a_sidecar_the_start_is_as_good_as_what_it_is_by():
    created = video_stamps.stamps_of(index(created_ns=T0), None, "x")
    assert created.stamp_ns.tolist() == [T0 + FRAME_NS * i for i in range(5)]
    assert (created.source, created.start_sigma_s, created.undated) == ("created", 1.0, False)
    none = video_stamps.stamps_of(index(), None, "x")
    assert none.stamp_ns[0] == NO_DATE_NS and none.undated and none.start_sigma_s > created.start_sigma_s


def test_what_has_no_date_begins_with_the_others():
    dated = video_stamps.stamps_of(index(created_ns=T0), None, "x")
    none = video_stamps.stamps_of(index(), None, "x")
    found = video_stamps.together({"cam01": none, "cam02": dated}, None)
    assert found["cam01"].stamp_ns[0] == found["cam02"].stamp_ns[0] == T0
    assert video_stamps.together({"cam01": none}, T0 - 5)["cam01"].stamp_ns[0] == T0 - 5
    assert video_stamps.together({"cam01": none}, None)["cam01"].stamp_ns[0] == NO_DATE_NS


def test_a_sidecar_of_some_frames_gives_the_start_and_the_rate_between_them():
    assert video_stamps.stamps_of(index(), Sidecar({0: T0}), "x").stamp_ns.tolist() == [
        T0 + FRAME_NS * i for i in range(5)
    ]
    # a file's clock that is slow by a tenth between the second and the fourth picture
    found = video_stamps.stamps_of(index(), Sidecar({1: T0, 3: T0 + round(2.2 * FRAME_NS)}), "x")
    assert ((found.stamp_ns - T0) / FRAME_NS).tolist() == pytest.approx([-1, 0, 1.1, 2.2, 3.2])
    assert found.start_sigma_s == 0
    with pytest.raises(DiorError, match="x names frame 5, and the video has 5 pictures"):
        video_stamps.stamps_of(index(), Sidecar({5: T0}), "x")
    video_stamps.stamps_of(index(lost=((200_000_000, "cut_off"),)), Sidecar({5: T0, 4: T0 - FRAME_NS}), "x")


def test_rounded_times_of_a_regular_rate_are_put_back_and_others_keep_their_step():
    exact = np.rint(1e9 * np.delete(np.arange(300), [20, 21]) / 29.97).astype(int)
    rounded = np.rint(exact / 1e6).astype(int) * 10**6
    found = video_stamps.regular(rounded, 1e6)
    assert np.abs(found - exact).max() < 2e5 and np.abs(rounded - exact).max() > 4e5
    jittered = rounded + 10**6 * (np.arange(298) % 7 == 3)
    assert video_stamps.regular(jittered, 1e6) is None
    stamped = video_stamps.stamps_of(index(298, tick_s=1e-3, pts_ns=jittered), None, "x")
    assert stamped.sigma_s == pytest.approx(1e-3 / 12**0.5)
    assert (stamped.stamp_ns - NO_DATE_NS == jittered - jittered[0]).all()


LAYOUTS = {
    "ours": "frame,stamp_ns\n0,1708000000000000000\n1,1708000000040000001\n",
    "caliscope": "cam_id,frame_time\n1,1708000000.04\n2,9\n1,1708000000.0\n",
    "caliscope before": "sync_index,port,frame_index,frame_time\n0,1,7,1708000000.0\n0,2,7,9\n1,1,8,1708000000.04\n",
    "freemocap": (
        "recording_frame_number,connection_frame_number,timestamp.from_recording_start.sec,timestamp.utc.seconds,x\n"
        "0,100,1.52e-07,1708000000.0,y\n1,101,0.04,1708000000.0400000,y\n"
    ),
    "skellycam before": ",0\n0,1.708e+18\n1,1.70800000004e+18\n",
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_stamps_by_frame(tmp_path, layout):
    """The columns are as the tools' sources have them; the numbers are made up here."""
    (tmp_path / "s.csv").write_text(LAYOUTS[layout])
    found = video_stamps.read_sidecar(tmp_path / "s.csv", Path("walk/cam_1.mp4")).stamp_ns
    assert found == {0: T0, 1: T0 + FRAME_NS + (layout == "ours")}


def test_seconds_of_no_date_count_from_one():
    assert video_stamps.LONGEST_UPTIME_NS < NO_DATE_NS < T0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x\n1,2\n", "its columns are time, x, which are stamps of no layout"),
        ("", "the file is empty; its first line must be frame,stamp_ns"),
        ("frame,stamp_ns\n", "it has no stamps$"),
        ("frame,stamp_ns\n0,soon\n", "line 2: is not frame, stamp_ns"),
        ("frame,stamp_ns\n0\n", "line 2: is not frame, stamp_ns"),
        ("frame,stamp_ns\n0,1e18\n0,1e18\n", "it has frames twice"),
        ("frame,stamp_ns\n0,nan\n", "line 2: is not frame, stamp_ns"),
        (
            "frame,stamp_ns\n0,1e18\n1,1e25\n",
            "line 3: has a number that is too large for a frame or for stamp_ns in ns",
        ),
        ("frame,stamp_ns\n1e25,1e18\n", "line 2: is not frame, stamp_ns"),
        (f"frame,stamp_ns\n{10**25},1e18\n", "line 2: has a number that is too large"),
        ("cam_id,frame_time\n1,9e999999\n", "line 2: is not cam_id, frame_time"),
        ("frame,stamp_ns,stamp_ns\n0,1e18,0\n", "column 'stamp_ns' is there twice"),
        ("Frame,stamp_ns\n0,1e18\n", "unknown column 'Frame'; did you mean 'frame'"),
        ("frame;stamp_ns\n0;1e18\n", "the columns must be separated by commas, not by semicolons"),
        ("frame\tstamp_ns\n0\t1e18\n", "the columns must be separated by commas, not by tabs"),
        ("cam_id,frame_time\n2,5\n", "it has no stamps of cam_id 1, the number in the name of cam_1.mp4"),
    ],
)
def test_a_sidecar_that_is_none_is_refused(tmp_path, text, words):
    (tmp_path / "s.csv").write_text(text)
    with pytest.raises(DiorError, match=words):
        video_stamps.read_sidecar(tmp_path / "s.csv", Path("cam_1.mp4"))


def test_uptimes_are_stamps(tmp_path):
    (tmp_path / "s.csv").write_text("cam_id,frame_time\n1,12.5\n1,12.54\n")
    found = video_stamps.read_sidecar(tmp_path / "s.csv", Path("cam_1.mp4")).stamp_ns
    assert found == {0: NO_DATE_NS + 12_500_000_000, 1: NO_DATE_NS + 12_540_000_000}


def every(unit_ns, count=30, first=0, by_ns=FRAME_NS):
    """Stamps by frame as `read_sidecar` gives them of a column whose unit is taken for 1 ns."""
    return {first + i: T0 // unit_ns + i * by_ns // unit_ns for i in range(count)}


@pytest.mark.parametrize(("unit", "unit_ns"), [("us", 10**3), ("ms", 10**6), ("s", 10**9)])
@pytest.mark.parametrize("timed", ["the video", ""])
def test_stamps_of_another_unit_are_refused_by_its_name(unit, unit_ns, timed):
    with pytest.raises(DiorError, match=rf"x: the column stamp_ns has .* they are in {unit}, and stamp_ns is in ns"):
        video_stamps.stamps_of(index(30), Sidecar(every(unit_ns)), "x", "video", timed)
    with pytest.raises(DiorError, match=r"x: the column frame_time has .* they are in ms, and frame_time is in s"):
        seconds = Sidecar(every(1, by_ns=FRAME_NS * 1000), "frame_time", "s")
        video_stamps.stamps_of(index(30), seconds, "x", "video", timed)
    with pytest.raises(DiorError, match=r"they are in s, and"):
        video_stamps.stamps_of(index(30), Sidecar(every(10**9, by_ns=10**9)), "x", "video", timed)


def test_stamps_of_another_rate_are_refused_with_both_and_a_pause_is_none():
    with pytest.raises(DiorError, match=r"200 pictures per second, and the video 25; is it of another.*slow motion"):
        video_stamps.stamps_of(index(30), Sidecar(every(1, by_ns=FRAME_NS // 8)), "x")
    with pytest.raises(DiorError, match=r"12\.5 pictures per second, and the video 25"):
        video_stamps.stamps_of(index(30), Sidecar({0: T0, 29: T0 + 58 * FRAME_NS}), "x")
    paused = {frame: stamp + (frame > 15) * 10**10 for frame, stamp in every(1).items()}
    assert video_stamps.stamps_of(index(30), Sidecar(paused), "x").stamp_ns[-1] == paused[29]
    assert video_stamps.stamps_of(index(30), Sidecar(every(1, by_ns=33_333_333)), "x").source == "sidecar"


def test_stamps_that_stand_or_go_back_name_their_file_and_column():
    with pytest.raises(DiorError, match=r"x: stamp_ns is the same for all 30 pictures"):
        video_stamps.stamps_of(index(30), Sidecar(dict.fromkeys(range(30), T0)), "x")
    back = every(1) | {frame: T0 for frame in (20, 21)}
    for wrong in (back | {20: T0 - 10**10}, {0: T0 + 10**9, 29: T0}, dict(enumerate(reversed(every(1).values())))):
        with pytest.raises(DiorError, match=r"x: stamp_ns goes back, the furthest by .* s at frame \d+"):
            video_stamps.stamps_of(index(30), Sidecar(wrong), "x")
    swapped = every(1) | {10: T0 + 11 * FRAME_NS, 11: T0 + 10 * FRAME_NS}
    assert video_stamps.stamps_of(index(30), Sidecar(swapped), "x").source == "sidecar"


def test_rows_without_a_number_are_as_many_as_pictures():
    for count in (29, 31):
        by_place = Sidecar(every(1, count), "frame_time", "s", by_place=True)
        with pytest.raises(DiorError, match=f"x has {count} stamps, and the video has 30 pictures"):
            video_stamps.stamps_of(index(30), by_place, "x")
    video_stamps.stamps_of(index(30), Sidecar(every(1), "frame_time", "s", by_place=True), "x")


def test_frames_that_count_from_1_are_refused_and_a_lone_one_is_noted():
    for count in (30, 29, 2):
        with pytest.raises(DiorError, match=f"x names the frames 1 to {count} of the folder's 30 .*count from 0"):
            video_stamps.stamps_of(index(30), Sidecar(every(1, count, first=1)), "x", "folder")
    found = video_stamps.stamps_of(index(30), Sidecar({1: T0}), "x")
    assert found.stamp_ns[1] == T0 and "frames count from 0" in found.note
    assert not video_stamps.stamps_of(index(30), Sidecar({0: T0}), "x").note


@pytest.mark.parametrize("stamp, unit", [(T0 // 10**6, "ms"), (T0 // 10**3, "us"), (T0 // 10**9, "s")])
def test_one_stamp_in_another_unit(tmp_path, stamp, unit):
    """Several are told by their rate."""
    path = tmp_path / "stamps.csv"
    path.write_text(f"frame,stamp_ns\n0,{stamp}\n")
    with pytest.raises(
        DiorError, match=rf"stamps\.csv: its one stamp is {stamp}, a date if it is in {unit}, and stamp_ns"
    ):
        video_stamps.read_sidecar(path, Path("cam01.mp4"))
    path.write_text(f"frame,stamp_ns\n0,{stamp}\n1,{stamp + FRAME_NS}\n")
    assert len(video_stamps.read_sidecar(path, Path("cam01.mp4")).stamp_ns) == 2


def test_one_stamp_of_an_uptime_or_a_date(tmp_path):
    path = tmp_path / "stamps.csv"
    for stamp, read in ((T0, T0), (7 * 3600 * 10**9, 7 * 3600 * 10**9 + NO_DATE_NS)):
        path.write_text(f"frame,stamp_ns\n0,{stamp}\n")
        assert video_stamps.read_sidecar(path, Path("cam01.mp4")).stamp_ns == {0: read}
