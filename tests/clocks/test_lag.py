"""The lag search: minima between the samples, rivals, and the lags of several cameras together."""

import numpy as np
import pytest

from dior.clocks import lag

LAGS = lag.window(10.0)


def valley(at, depth, width=0.1):
    return depth * np.exp(-(((LAGS - at) / width) ** 2))


def test_the_window_is_symmetric_and_in_seconds():
    for hz in (15.0, 60.0, 120.0):
        lags = lag.window(hz)
        assert lags[0] == -lag.WINDOW_S and lags[-1] == lag.WINDOW_S and (lags == -lags[::-1]).all()
        assert np.diff(lags) == pytest.approx(1 / hz)


def test_the_lowest_lag_lies_between_the_samples():
    assert lag.lowest(LAGS, (LAGS - 0.53) ** 2) == pytest.approx(0.53)
    for lags in (LAGS, LAGS[1:]):
        assert lag.lowest(lags, (lags - 5) ** 2) == 2.0 and lag.lowest(lags, (lags + 5) ** 2) == lags[0]
    # near an index that is not the least the parabola goes no further than half a step
    assert lag.lowest(LAGS, (LAGS - 0.53) ** 2, at=22) == pytest.approx(0.25)


def test_another_minimum_makes_a_time_doubtful():
    costs = 10 - valley(0.5, 8)
    assert lag.doubt(LAGS, lag.worse(costs, 45), 0.5) == ""
    for other in (-0.6, 1.1):
        twice = costs - valley(other, 7.9)
        assert lag.rivals(LAGS, lag.worse(twice, 45), 0.5) == pytest.approx([other])
        assert lag.doubt(LAGS, lag.worse(twice, 45), 0.5) == f"a lag of {other:+.2f} s fits about as well as +0.50 s"


def test_a_lag_at_the_end_of_what_could_be_compared_is_doubtful():
    costs = 10 - valley(1.0, 8, 0.5)
    assert lag.doubt(LAGS, lag.worse(costs, 45), 1.0) == ""
    cut = np.where(LAGS > 1.0, np.nan, costs)
    said = "the best lag is at the end of the -2.0 to +1.0 s that were tried"
    assert lag.doubt(LAGS, lag.worse(cut, 45), 1.0) == said
    assert lag.at_an_end(LAGS, cut, 0.95) and not lag.at_an_end(LAGS, cut, 0.85)
    assert lag.at_an_end(LAGS, -LAGS, -1.95) and not lag.at_an_end(LAGS, -LAGS, -1.85)


def test_how_far_lags_are_searched_next():
    assert [lag.further(2.0, length_s) for length_s in (2.0, 5.0, 30.0)] == [2.0, 3.0, 4.0]


def test_how_much_worse_is_clearly_worse():
    # chi2 of 100 measurements: 100 (c^2 / c0^2 - 1)
    for factor, rival in ((0.99, True), (1.01, False)):
        deeper = np.sqrt(1 + factor * lag.CLEARLY / 100)
        costs = 10.0 - valley(0.5, 9) - valley(-0.5, 10 - deeper)
        assert bool(lag.doubt(LAGS, lag.worse(costs, 100), 0.5)) == rival
    # the same costs tell less where one measurement errs by more than they show
    assert lag.doubt(LAGS, lag.worse(costs, 100, sd=1.1), 0.5)


def test_the_flank_of_a_broad_minimum_is_no_rival():
    costs = 5 + 0.1 * (LAGS - 0.2) ** 2
    assert not len(lag.rivals(LAGS, lag.worse(costs, 1), 0.2))
    # nor is what lies within the minimum that was found
    bumpy = costs - valley(0.4, 0.05, 0.02)
    assert not len(lag.rivals(LAGS, lag.worse(bumpy, 1), 0.2)) and len(lag.rivals(LAGS, lag.worse(bumpy, 1), 0.1))


def test_lags_at_which_little_overlaps_are_not_chosen():
    costs = np.where(np.abs(LAGS) > 1, np.nan, 1 + LAGS**2)
    assert lag.lowest(LAGS, costs) == pytest.approx(0.0)
    assert lag.doubt(LAGS, lag.worse(costs, 45), 0.0) == ""
    mean = lag.mean_cost(np.array([0.4, 8.0, 5.1, 0.0]), np.array([4, 10, 6, 0]))
    assert mean == pytest.approx([np.nan, 0.8, 0.85, np.nan], nan_ok=True)


def test_minima_at_the_ends_and_on_plateaus_count():
    assert lag.minima(np.array([1.0, 2, 2, 2, 0, 3, np.nan, 1])).tolist() == [0, 2, 4, 7]


def dip(*at, reach=10):
    """A cost curve with minima at some lags."""
    return 5.0 - sum(depth * np.exp(-0.5 * (np.arange(-reach, reach + 1) - lag) ** 2) for lag, depth in at)


def test_a_third_camera_decides_between_two_strides():
    # two cameras fit best a stride from each other; the third is sure of both
    costs = {(0, 1): dip((-4, 3.1), (3, 3.0)), (0, 2): dip((2, 3.0)), (1, 2): dip((-1, 3.0), reach=20)}
    assert lag.together({(0, 1): costs[0, 1]}, [True, False], 10).tolist() == [0, -4]
    at = lag.together(costs, [True, False, False], 10)
    assert at.tolist() == [0, 3, 2]
    profile = lag.profile(costs, at, 1, 10)
    assert profile.argmin() - 10 == 3 and profile.min() == pytest.approx(lag.total(costs, at))
    # with camera 1 a stride off the best that the third one can do is to agree with the first
    assert profile[10 - 4] == pytest.approx(lag.total(costs, np.array([0, -4, 2])))
    assert (profile <= np.array([lag.total(costs, np.array([0, step, 2])) for step in lag.steps(10)]) + 1e-9).all()


def test_lags_are_told_against_whichever_camera_is_held():
    costs = {(0, 1): dip((3, 3.0), reach=20), (0, 2): dip((2, 3.0), reach=20), (1, 2): dip((-1, 3.0), reach=20)}
    assert lag.together(costs, [False, True, False], 10).tolist() == [-3, 0, -1]
    assert lag.together(costs, [False, False, True], 10).tolist() == [-2, 1, 0]
    assert lag.together({(0, 1): costs[0, 1]}, [True, True], 10).tolist() == [0, 0]


def test_the_cost_along_one_camera_has_the_sign_of_its_lag():
    costs = {(0, 1): dip((3, 3.0)), (1, 2): dip((-1, 3.0), reach=20)}
    at = np.array([0, 3, 2])
    assert lag.along(costs, at, 1, 10).argmin() - 10 == 3 and lag.along(costs, at, 2, 10).argmin() - 10 == 2


def test_how_clear_it_has_to_be_is_the_callers():
    chi2 = 100 - valley(0.5, 100) - valley(-0.5, 85)
    assert lag.doubt(LAGS, chi2, 0.5) and not lag.doubt(LAGS, chi2, 0.5, clearly=9.0)
