"""The report's light by boxes that are tight, fair and large, and the clock by boxes: the rates are benchmarks
(`python -m benchmarks.long_range yardstick` and `clocks`), two seeds of each here."""

import numpy as np
import pytest

from benchmarks import clocks_pictures, long_range, yardstick

SEEDS = (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("margin", yardstick.MARGINS_PX)
@pytest.mark.parametrize("seed", SEEDS)
def test_right_labels_are_green_and_wrong_ones_are_not_however_boxes_are_drawn(seed, margin):
    lights = [yardstick.by_truth("ideal", seed, margin, 0.0, 30, off)["light"] for off in (0.0, 2.0, 4.0)]
    assert lights[0] == "good" and lights[1] == "look" and lights[2] in ("look", "bad")
    right = yardstick.by_truth("ideal", seed, margin, 0.0, 30, 0.0)
    assert abs(right["in_box_share"] - right["in_box_expected"]) < 0.05
    assert right["in_box_share"] > 0.99 if margin == 3 else right["in_box_share"] < 0.7 if margin == -1 else True


@pytest.mark.slow
@pytest.mark.parametrize("count", yardstick.COUNTS)
@pytest.mark.parametrize("level", long_range.LEVELS)
@pytest.mark.parametrize("seed", SEEDS)
def test_labels_that_boxes_placed_are_judged_by_fits_without_them(seed, level, count):
    found = [yardstick.by_fits(level, seed, margin, 0.0, count) for margin in (0.0, 3.0)]
    assert [one["light"] for one in found] == ["good", "good"] and found[0]["error"] < 1
    # of 10 boxes none is kept back, and all are judged
    assert ("held_back_share" in found[0]) == (count == 30) and "left_out_share" in found[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_a_second_drawer_judges_the_habit(seed):
    """Who draws alike makes the habit smaller, and the ellipses still hold."""
    alike, apart = (yardstick.by_fits("ideal", seed, 1.0, habit, 30, another=True) for habit in (0.0, 2.0))
    assert alike["habit_px"] < 0.5 < apart["habit_px"] and not alike["differ"]
    assert alike["light"] == "good" and alike["inside"] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("level", long_range.LEVELS)
@pytest.mark.parametrize("seed", SEEDS)
def test_clocks_by_boxes_are_within_their_intervals(seed, level):
    """Four walks a level, across, along, straight and circling; 99 % of what is normal is within 2.6 sigma."""
    followed, with_true, with_found = clocks_pictures.long_range_clocks(level, seed)
    assert not [refused for *_, refused in followed if refused]
    assert all(abs(error) < 2.6 * sigma for error, sigma, _ in followed)
    assert np.median([abs(error) for error, *_ in followed]) < 0.04 and with_found < with_true + 0.15
