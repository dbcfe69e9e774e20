"""Tracks of everybody, put side by side for the choice of the subject."""

import numpy as np

from dior.body.which_person import STRANGER, UNDECIDED, Choice, Followed, Stretch
from dior.reconstruct import everybody

JOINTS = 2


def table(*tracks):
    """Rows of `detected_people` of one camera: (number, first frame, last frame) each, u being the number."""
    rows = [
        (frame, number) for number, first, last in tracks for frame in range(first, last + 1) for _ in range(JOINTS)
    ]
    frame, track = np.array(rows).T
    return {"frame": frame, "track": track, "u": track * 1.0, "v": frame * 1.0, "score": np.ones(len(frame))}


def test_those_who_are_there_at_one_time_lie_side_by_side_and_the_longest_first():
    values, track = everybody._slots(table((7, 0, 3), (8, 2, 9), (9, 5, 6)), 10, JOINTS)
    assert track.tolist() == [[-1, -1] + [8] * 8, [7] * 4 + [-1, 9, 9] + [-1] * 3]
    np.testing.assert_array_equal(values[1, 5], [[9.0, 5.0, 1.0]] * JOINTS)
    assert np.isnan(values[0, :2]).all() and np.isfinite(values[0, 2:]).all()


def test_of_more_than_most_the_shortest_is_left_out():
    crowd = [(number, 0, 9 - number) for number in range(everybody.MOST + 1)]
    _, track = everybody._slots(table(*crowd), 10, JOINTS)
    assert len(track) == everybody.MOST and everybody.MOST not in track


FPS, CAMERAS = 30.0, ("cam01", "cam02")


def said(*stretches):
    """(code, text) of a choice among two people; frames of cam01 are instants + 100, cam02 has none."""
    frames = np.stack([np.arange(100) + 100, np.full(100, -1)])
    choice = Choice(np.zeros((2, 100), int), np.zeros(100, int), stretches, 2, Followed([], [], [], [], 1, 0.0))
    return [(code, text) for _, _, code, text in everybody.findings("walk", choice, CAMERAS, frames, FPS, False)]


def test_a_stretch_of_somebody_else_is_told_by_frames_metres_and_the_picture_in_its_middle():
    [(code, text), (after, _)] = said(Stretch(20, 40, STRANGER, 1.234, 0.04))
    assert (code, after) == ("somebody_else", "others_told_apart")
    assert text.startswith("frames 120 to 140 of cam01, 1.23 m from the subject and 4 cm taller: only somebody else")
    assert "{camera: cam01, frame: 130, u: <u>, v: <v>}" in text
    assert "and 4 cm smaller:" in said(Stretch(20, 40, STRANGER, 1.0, -0.04))[0][1]


def test_a_blink_of_somebody_else_is_not_worth_a_warning_but_one_of_nobody_known_is():
    short, enough = Stretch(10, 14, STRANGER, 1.0, np.nan), Stretch(30, 35, STRANGER, 1.0, np.nan)
    assert [code for code, _ in said(short)] == ["others_told_apart"]
    assert said(short, enough)[0][1].startswith("frames 130 to 135 of cam01, 1.00 m from the subject: ")
    undecided = said(Stretch(10, 14, UNDECIDED, np.nan, np.nan))
    assert [code for code, _ in undecided] == ["who_is_subject"] and "enter height_m" in undecided[0][1]


def test_nobody_is_at_an_instant_without_a_picture():
    detections = table((0, 0, 9)) | {"camera": np.full(20, "cam01"), "joint": np.tile(["nose", "left_eye"], 10)}
    line = {"frame_before": np.array([-1, 0, 1]), "frame_after": np.array([-1, 0, 2]), "weight": np.array([0, 0, 0.5])}
    timeline = {key: np.concatenate([values]) for key, values in line.items()} | {"camera": np.full(3, "cam01")}
    seen = everybody.at_instants(detections, None, timeline, ["cam01"], 0.5, FPS)
    assert seen.track.tolist() == [[[-1, 0, 0]]]
    assert seen.uv[0, 0, 1:, 0, 1].tolist() == [0.0, 1.5] and np.isnan(seen.uv[0, 0, 0]).all()
