"""Which recordings are of one walk: by time, else by name."""

import pytest

from dior.ingest.glance import Stream
from dior.init import walks
from dior.init.found import Recording

T0, S = 1_708_000_000 * 10**9, 10**9
KIND = "sensor_msgs/msg/CompressedImage"


def recorded(path, start_s=None, seconds=10.0, by="stamps", topic="/cam01/image_raw/compressed"):
    first, last = (None, None) if start_s is None else (T0 + round(start_s * S), T0 + round((start_s + seconds) * S))
    kind = "bag" if path.endswith(".bag") else "video"
    stream = Stream(topic, KIND, 100, first, last, 48, 64, 10.0)
    return Recording(path, kind, (stream,), first, last, "" if first is None else by, {topic: KIND})


def groups(*recordings):
    return [[one.path for one in walk.recordings] for walk in walks.walks_of(recordings, [])]


def test_what_was_recorded_at_once_is_one_walk_whatever_it_is_called():
    assert groups(
        recorded("b/x.bag", 3), recorded("a/y.bag", 0), recorded("b/y.bag", 100), recorded("a/x.bag", 101)
    ) == [["a/y.bag", "b/x.bag"], ["a/x.bag", "b/y.bag"]]  # fmt: skip


def test_time_wins_over_names_and_the_reason_is_told():
    other = recorded("walk/pc2.bag", 3600, topic="/cam02/image")
    first, second = walks.walks_of([recorded("walk/pc1.bag", 0), other], [])
    assert [len(one.recordings) for one in (first, second)] == [1, 1] and not first.doubts
    assert "walk/pc2.bag began 3600 s after walk/pc1.bag, which is called the same" in second.doubts[0]
    again = walks.walks_of([recorded("walk/pc1.bag", 0), recorded("walk/pc2.bag", 3600)], [])
    assert not any(one.doubts for one in again), "the same camera, so another walk"


def test_a_video_has_its_own_camera():
    first, second = walks.walks_of([recorded("walk/cam1.mp4", 0), recorded("walk/cam2.mp4", 3600)], [])
    assert not first.doubts and "walk/cam2.mp4 began 3600 s after walk/cam1.mp4" in second.doubts[0]
    takes = walks.walks_of([recorded("walk/cam1.mp4", 0), recorded("walk/film/cam1.mp4", 3600)], [])
    assert not any(one.doubts for one in takes), "the same camera, so another walk"


@pytest.mark.parametrize("ending", ["bag", "mp4"])
def test_a_clock_that_is_wrong_by_as_much_as_lies_between_walks_is_told(ending):
    first = [recorded(f"walk_{i}/pc1.bag", 100 * i) for i in (1, 2, 3)]
    late = [recorded(f"walk_{i}/pc2.{ending}", 100 * i + 100, topic="/cam02/image") for i in (1, 2, 3)]
    found = walks.walks_of([*first, *late], [])
    assert [len(one.recordings) for one in found] == [1, 2, 2, 1]
    assert [len(one.doubts) for one in found] == [0, 1, 1, 0]
    assert (
        found[1]
        .doubts[0]
        .startswith(
            f"walk_1/pc2.{ending} is called as walk_1/pc1.bag, and was recorded while walk_2/pc1.bag was: time wins"
        )
    )
    alone = walks.walks_of([*first, recorded("walk_1_run/pc2.bag", 100), recorded("take.bag", 200)], [])
    assert not any(one.doubts for one in alone), "names that are no walk's"


def test_a_recording_that_went_on_between_walks_is_told():
    long = recorded("day/pc1.bag", 0, 210, topic="/cam02/image")
    (one,) = walks.walks_of([long, *(recorded(f"day/pc2_{i}.bag", 100 * i) for i in range(3))], [])
    assert "between day/pc2_0.bag and day/pc2_1.bag there is a break of 90.0 s" in one.doubts[0]
    assert "each while another one of them was" in one.reasons[0]
    (one,) = walks.walks_of([long, *(recorded(f"day/pc2_{i}.bag", 11 * i) for i in range(3))], [])
    assert not one.doubts


def test_recordings_that_share_less_than_half_are_two_walks():
    assert len(groups(recorded("a.bag", 0), recorded("b.bag", 5.1))) == 2
    assert len(groups(recorded("a.bag", 0), recorded("b.bag", 4.9))) == 1
    assert len(groups(recorded("a.bag", 0, 100), recorded("b.bag", 50, 1))) == 1


def test_a_bag_that_was_split_is_one_walk():
    parts = [recorded("w/pc1_0.bag", 0), recorded("w/pc1_1.bag", 10.1), recorded("w/pc1_2.bag", 20.2)]
    assert groups(*parts) == [[one.path for one in parts]]
    assert len(groups(parts[0], recorded("w/pc1_1.bag", 10.6))) == 2
    assert len(groups(parts[0], recorded("w/pc1_1.bag", 10.1, topic="/cam02/image"))) == 2
    assert len(groups(parts[0], recorded("v/pc1_1.bag", 10.1))) == 2


def test_a_walk_is_called_as_all_its_recordings_are():
    (one,) = walks.walks_of([recorded("0123_hall_1.bag", 0), recorded("0456_hall_1.bag", 1)], [])
    assert one.key == "hall_1"
    (one,) = walks.walks_of([recorded(f"pc{i}_2024-05-01-10-30-0{i}.bag", i) for i in (1, 2)], [])
    assert one.key == ""


def test_names_tell_where_no_time_does():
    found = groups(*(recorded(f"walk_{n}/cam{i}.mp4") for n in (1, 2, 10) for i in (1, 2)))
    assert found == [[f"walk_{n}/cam{i}.mp4" for i in (1, 2)] for n in (1, 2, 10)]
    assert groups(*(recorded(f"cam{i}/walk_{n}.mp4") for i in (1, 2) for n in (1, 2))) == [
        [f"cam{i}/walk_{n}.mp4" for i in (1, 2)] for n in (1, 2)
    ]
    assert groups(recorded("w/hall.mp4"), recorded("w/door.mp4")) == [["w/door.mp4", "w/hall.mp4"]]
    assert groups(recorded("cam1.mp4"), recorded("cam2.mp4")) == [["cam1.mp4", "cam2.mp4"]]


def test_a_video_without_a_time_goes_with_the_bag_of_its_name():
    assert groups(recorded("w_1/pc1.bag", 0), recorded("w_2/pc1.bag", 60), recorded("w_2/cam9.mp4")) == [
        ["w_1/pc1.bag"], ["w_2/cam9.mp4", "w_2/pc1.bag"],
    ]  # fmt: skip


def test_dates_in_names_tell_to_some_seconds():
    at = [recorded(f"cam{i}_20240501_10300{i}.mp4", i, by="name") for i in (1, 2)]
    later = recorded("cam1_20240501_104000.mp4", 600, by="name")
    assert groups(*at, later) == [[one.path for one in at], [later.path]]


WALKS = [
    walks.Walk((recorded(f"{place}/pc1.bag", 0),), (key,), ())
    for place, key in (("day1/walk_1", "day1/walk_1"), ("day1/walk_10", "day1/walk_10"), ("x", "hall"))
]


@pytest.mark.parametrize(
    ("path", "places"),
    [
        ("day1/walk_1/mlkit/cam01.json", [0]), ("day1/walk_10.c3d", [1]), ("mocap/day1/walk_10/trial.c3d", [1]),
        ("mocap/walk_1.c3d", [0]), ("x/trial.c3d", [2]), ("mocap/walk_2.c3d", []), ("mocap/day1/trial.c3d", []),
        ("mocap/hall.c3d", [2]), ("day1.c3d", [0, 1]), ("mocap/Walk 01.c3d", [0]), ("mocap/Day 1 Walk10.c3d", [1]),
        ("mocap/gang1.c3d", []), ("mocap/1_10.c3d", []),
    ],
)  # fmt: skip
def test_which_walk_a_file_is_of_its_name_or_its_place_tells(path, places):
    found, why = walks.walks_named(path, WALKS, [])
    assert [WALKS.index(one) for one in found] == places and why


def test_the_only_walk_has_what_has_no_name_of_its_own():
    flat = walks.Walk((recorded("pc1.bag", 0),), ("",), ())
    assert walks.walks_named("trial.c3d", [flat], [])[0] == [flat]
    assert walks.walks_named("other/trial_7.c3d", WALKS[:1], [])[0] == []
    assert walks.walks_named("mocap/data.c3d", WALKS[:1], [])[0] == WALKS[:1]
