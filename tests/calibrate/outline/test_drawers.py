"""What drawers have drawn apart, and the habit that follows from it."""

import numpy as np
import pytest

from dior.calibrate.outline import drawers

BOX = np.array([[10.0, 20.0, 20.0, 50.0]])


def drawn(frames, *outwards):
    """Boxes with each edge so many px further right or down."""
    frames = np.array(frames)
    return frames, np.repeat(BOX, len(frames), axis=0) + np.array(outwards)


def test_the_middles_of_pictures_that_both_drew_are_compared():
    # top 2 px up and bottom as it is: the middle 1 px up; the left 1 px left and the right 3 px right: 1 px right
    first = {"max": drawn(range(10), 0, 0, 0, 0), "zoe": drawn(range(5, 20), -1, -2, 3, 0)}
    # of another walk he drew 5 more, with boxes that are as large on all sides, which is no difference
    second = {"max": drawn(range(5), 0, 0, 0, 0), "zoe": drawn(range(5), -3, -3, 3, 3)}
    found = drawers.apart([first, second])
    assert found.names == ("zoe",) and found.count == (10,)
    np.testing.assert_allclose(found.mean, [[0.5, -0.5]])
    np.testing.assert_allclose(found.sigma, np.std([1] * 5 + [0] * 5, ddof=1) / np.sqrt(10) * np.ones((1, 2)))


def test_two_who_change_places_from_walk_to_walk_are_one_difference():
    max_, zoe = drawn(range(5), 0, 0, 0, 0), drawn(range(5), 1, -2, 1, -2)
    found = drawers.apart([{"max": max_, "zoe": zoe}, {"zoe": zoe, "max": max_}])
    assert found.names == ("zoe",) and found.count == (10,)
    np.testing.assert_allclose(found.mean, [[1, -2]])


def test_few_pictures_and_one_drawer_tell_nothing():
    few = {"max": drawn(range(10), 0, 0, 0, 0), "zoe": drawn(range(3), 1, 1, 1, 1)}
    for one in ([few], [{}], [{"max": drawn(range(10), 0, 0, 0, 0)}]):
        found = drawers.apart(one)
        assert found.names == () and drawers.habit(0.5, found) == 0.5 and drawers.findings("s", found, 0.5, 0.5) == []


@pytest.mark.parametrize(("apart_px", "habit_px"), [(0.0, 0.5 / np.sqrt(2)), (0.5, 0.5), (2.0, np.sqrt(2.125))])
def test_the_habit_is_between_what_was_thought_and_what_is_found(apart_px, habit_px):
    found = drawers.Apart(("zoe",), np.full((1, 2), apart_px), np.zeros((1, 2)), (10,))
    assert drawers.habit(0.5, found) == pytest.approx(habit_px)
    # what the hand's own scatter explains is no habit
    noisy = drawers.Apart(("zoe",), np.full((1, 2), apart_px), np.full((1, 2), apart_px + 0.1), (10,))
    assert drawers.habit(0.5, noisy) == pytest.approx(0.5 / np.sqrt(2))


def test_drawers_are_told_apart_where_no_habit_explains_it():
    codes = [
        drawers.findings(
            "field/cam04", drawers.Apart(("zoe",), np.array([[0.1, v]]), np.full((1, 2), 0.1), (9,)), 0.5, 1
        )
        for v in (-1.4, -1.7)
    ]
    assert [(found[0][1], found[0][2]) for found in codes] == [
        ("info", "drawers_compared"),
        ("warning", "drawers_differ"),
    ]
    assert "-1.70 ± 0.20 px below" in codes[1][0][3] and "(drawer zoe)" in codes[1][0][3]


def test_another_drawer_makes_intervals_hold_for_those_who_draw_alike_and_for_those_who_do_not():
    """Of camera errors by a habit h, the 95 % interval by `habit` of one other drawer; the default of 0.5 px alone."""
    random = np.random.default_rng(1)
    for h, least, most in ((0.25, 0.97, 1.0), (0.5, 0.93, 0.97), (1.0, 0.78, 0.9)):
        mine, theirs = random.normal(0, h / np.sqrt(2), (2, 4000, 2))
        held = [
            (own**2).sum() / (drawers.habit(0.5, drawers.Apart(("b",), apart[None], np.zeros((1, 2)), (9,))) ** 2 / 2)
            < 5.991
            for own, apart in zip(mine, theirs - mine, strict=True)
        ]
        assert least <= np.mean(held) <= most
