"""What is said while marks are made: of a made-up walk whose camera and clock are known."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.geometry.camera import project
from dior.studio import live_pose
from tests.calibrate.marks.test_clock_from_marks import FPS, NAMES, T0, VIEW, marked, motion, walker

CLOCK = {"walk_1": (0.0, 0.0, "assumed_zero")}
STAMPS = {"walk_1": (np.arange(200), T0 + np.round(np.arange(200) / FPS * 1e9).astype(int))}
OFFSET_S = 0.1437


def given(marks, clock=CLOCK):
    unplaced = VIEW.at(np.full((4, 4), np.nan))
    return live_pose.Given(
        unplaced, marks, "cam01.marks.csv", {"walk_1": motion()}, STAMPS, clock, 8.0, "lab/cam01"
    )  # fmt: skip


def away(answer):
    return float(np.linalg.norm(answer.camera.centre - VIEW.centre))


def test_with_the_clock_that_is_known_the_pose_is_there_at_once():
    answer = live_pose.at_once(given(marked([30], OFFSET_S).only(np.arange(6))), {"walk_1": OFFSET_S})
    # between two ticks of the capture a marker is on a line
    assert away(answer) < 1e-3 and answer.residual_px.max() < 0.01 and not answer.searched
    assert np.isnan(live_pose.clock_95_s(answer, "walk_1"))


def test_a_clock_by_hand_is_not_guessed():
    clock = {"walk_1": (OFFSET_S, 0.0, "manual")}
    assert away(live_pose.at_once(given(marked([30], OFFSET_S), clock), {})) < 1e-3


def test_a_likely_clock_explains_the_marks_of_one_frame():
    answer = live_pose.at_once(given(marked([60], 0.41, noise_px=0.3)), {})
    assert answer.inlier.all() and answer.residual_px.max() < 3
    # so that the others of the frame are where they are
    few = live_pose.at_once(given(marked([60], 0.41, noise_px=0.3).only(np.arange(8))), {})
    true = project(VIEW, walker([60 / FPS + 0.41]))[0][0]
    off = live_pose.seen(given(marked([60], 0.41)), few, "walk_1", 60).uv - true
    assert np.nanmedian(np.linalg.norm(off, axis=1)) < 6


def test_fewer_than_four_marks_are_refused():
    with pytest.raises(DiorError, match="3 usable marks"):
        live_pose.at_once(given(marked([30], 0.0).only(np.arange(3))), {})


def test_a_search_tells_pose_and_clock_with_their_errors_and_then_it_is_enough():
    own = given(marked([20, 70, 120], OFFSET_S, noise_px=0.5))
    answer = live_pose.searched(own)
    assert away(answer) < 0.03 and abs(answer.clock["walk_1"][0] - OFFSET_S) < 0.005
    assert 0 < live_pose.clock_95_s(answer, "walk_1") < 0.01
    assert not live_pose.unmarked(own, answer, "walk_1", 70)
    assert live_pose.enough(own, answer, None)
    assert not live_pose.enough(own, live_pose.at_once(own, {"walk_1": OFFSET_S}), None)


def test_the_mark_of_another_marker_is_named_with_it():
    marks = marked([20, 70, 120], OFFSET_S, noise_px=0.3)
    i, j = 16 + NAMES.index("M03"), 16 + NAMES.index("M12")
    marks.uv[i] = marks.uv[j]
    own = given(marks)
    answer = live_pose.searched(own)
    wrong = [*np.flatnonzero(~answer.inlier), *([answer.suspect[0]] if answer.suspect else [])]
    assert [(answer.used.joint[k], answer.used.frame[k]) for k in wrong] == [("M03", 70)]
    assert live_pose.taken_for(own, answer, wrong[0]) == "M12"
    assert not live_pose.enough(own, answer, None)


def test_what_is_asked_for_first_helps_most_and_nothing_twice():
    marks = marked([20, 70, 120], OFFSET_S, noise_px=0.3)
    own = given(marks.only(np.isin(marks.joint, NAMES[:5])))
    answer = live_pose.searched(own)
    free = live_pose.unmarked(own, answer, "walk_1", 70)
    assert {mark.joint for mark in free} <= set(NAMES[5:]) and {mark.frame for mark in free} == {70}
    order = live_pose.ranked(own, answer, free)
    assert len({mark.joint for mark, _, _ in order}) == len(order) == live_pose.RANKED
    after = [after for _, _, after in order]
    assert all(b <= a for a, b in zip(after, after[1:], strict=False)) and order[0][2] < order[0][1]
    # each begins where the one before has ended
    np.testing.assert_allclose([before for _, before, _ in order[1:]], after[:-1], rtol=1e-6)


def test_a_frame_outside_of_the_capture_has_no_markers():
    own = given(marked([20, 70], OFFSET_S))
    answer = live_pose.at_once(own, {"walk_1": OFFSET_S})
    assert np.isnan(live_pose.seen(own, answer, "walk_1", 199).uv).all()
    assert not live_pose.unmarked(own, answer, "walk_1", 199)


def test_frames_at_once_are_those_one_by_one():
    own = given(marked([60], 0.41))
    answer, frames = live_pose.at_once(own, {"walk_1": 0.41}), np.array([10, 60, 140])
    every = live_pose.seen_on(own, answer, "walk_1", frames)
    for i, frame in enumerate(frames.tolist()):
        one = live_pose.seen(own, answer, "walk_1", frame)
        for name in ("uv", "hidden", "xyz"):
            assert np.array_equal(getattr(every, name)[i], getattr(one, name), equal_nan=name != "hidden")
