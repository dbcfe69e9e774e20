"""What names of files tell of cameras, walks, people and days."""

import pytest

from dior.init import names


@pytest.mark.parametrize(
    ("path", "key"),
    [
        ("walk_01/pc1.bag", "walk_01"), ("walk_01/mlkit/cam01.jsonl", "walk_01"), ("cam02/walk_01.mp4", "walk_01"),
        ("videos/day 1/walk_01/Kamera 3.MP4", "day 1/walk_01"), ("walk_01_cam01_keypoints.json", "walk_01"),
        ("pc1_2024-05-01-10-30-00.bag", "2024-05-01-10-30-00"), ("pc1.bag", ""), ("walk_01/left.mp4", "walk_01"),
        ("turn_left.bag", "turn_left"), ("lefty/right_turn.bag", "lefty/right_turn"), ("GoPro2/Gang 1.mp4", "Gang 1"),
        ("mlkit/walk_01", "walk_01"), ("walk_01.trc", "walk_01"), ("recordings/data", ""),
    ],
)  # fmt: skip
def test_files_of_one_walk_have_one_key(path, key):
    assert names.walk_key(path) == key


def test_cameras_that_are_known_are_no_part_of_a_key():
    assert names.walk_key("walk_01/fern.mp4", ["fern"]) == "walk_01"
    assert names.walk_key("walk_01/ferns.mp4", ["fern"]) == "walk_01/ferns"


@pytest.mark.parametrize(
    ("paths", "known", "whole", "called"),
    [
        (["w/cam01.mp4", "w/cam02.mp4"], [], "w/{camera}.mp4", ["cam01", "cam02"]),
        (["w/Kamera 1.mp4", "w/Kamera 2.mp4"], [], "w/Kamera {camera}.mp4", ["1", "2"]),
        (["cam1/w_cam1.mp4", "cam2/w_cam2.mp4"], [], "{camera}/w_{camera}.mp4", ["cam1", "cam2"]),
        (["walk_1/1.mp4", "walk_1/2.mp4"], ["1", "2"], "walk_1/{camera}.mp4", ["1", "2"]),
        (["w/left.mp4", "w/right.mp4"], [], "w/{camera}.mp4", ["left", "right"]),
        (["w/a_hall_x.json", "w/a_hill_x.json"], [], "w/a_{camera}_x.json", ["hall", "hill"]),
        (["w/mlkit/cam01.jsonl"], ["cam01", "cam02"], "w/mlkit/{camera}.jsonl", ["cam01"]),
    ],
)  # fmt: skip
def test_one_path_stands_for_the_files_of_all_cameras(paths, known, whole, called):
    assert names.pattern(paths, known) == (whole, dict(zip(paths, called, strict=True)))


@pytest.mark.parametrize(
    "paths", [["w/Küche.mp4", "w/Flur.mp4"], ["a/cam1.mp4", "b/c/cam2.mp4"], ["w/{a}1.mp4", "w/{a}2.mp4"]]
)
def test_where_no_path_does_none_is_given(paths):
    assert names.pattern(paths) is None


def test_names_are_made_of_anything():
    assert names.valid("Gang 3, Küche (Süd)") == "Gang_3_Kueche_Sued" and names.valid("--é!") == "e"
    assert names.valid("步") == "" and names.is_valid(names.valid("x" * 300))
    assert names.unique("walk", ["Walk", "walk_2"]) == "walk_3" and names.unique("a", ["b"]) == "a"


@pytest.mark.parametrize("name", ["2024-05-01-10-30-07", "VID_20240501_103007.mp4", "a 2024.05.01 10h30m07s"])
def test_dates_are_read_as_cameras_write_them(name):
    assert names.date_ns(name) == 1714559407 * 10**9


def test_what_is_no_date_is_none_and_dates_are_left_out_of_names():
    assert names.date_ns("walk_20240501") is None and names.date_ns("20241301_103007") is None
    assert names.without_dates("hall_2024-05-01-10-30-07/2024-05-01/20240501_x") == "hall/x"
    assert names.without_dates("hall_2/walk_20249901") == "hall_2/walk_20249901"


def test_what_all_keys_have_in_common_is_a_walks_name():
    assert names.common(["day/0123_hall_1", "day/0456_hall_1"]) == "day/hall_1"
    assert names.common(["a b", "b a"]) == "a b" and names.common(["x", "y"]) == "" and names.common(["a", "a/b"]) == ""


def test_people_are_known_by_their_numbers_and_are_in_no_name():
    assert names.person("sub-03/walk_1/cam01.bag") == "sub-03" and names.person("S01/walk_1/P02.bag") == ""
    assert names.person("steps/speed_10.bag") == ""
    assert names.without_people("S01/walk_1_S01") == "walk_1" and names.without("anna_walk_1", "Anna") == "walk_1"


def test_a_walk_is_in_a_longer_name_as_a_whole_word():
    assert names.holds("walk_1/run", "walk_1") and not names.holds("walk_10", "walk_1") and not names.holds("a", "")
