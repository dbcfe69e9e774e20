import numpy as np
import pytest

from dior.clocks import lag_curve

LAGS = np.arange(-20, 21) / 10


def test_the_lowest_lag_lies_between_the_samples():
    assert lag_curve.lowest(LAGS, (LAGS - 0.53) ** 2) == pytest.approx(0.53)
    assert lag_curve.lowest(LAGS, (LAGS - 5) ** 2) == 2.0


def test_another_minimum_makes_a_time_ambiguous():
    costs = 10 - 8 * np.exp(-(((LAGS - 0.5) / 0.1) ** 2))
    assert lag_curve.second_minimum(LAGS, costs) is None
    costs = costs - 7.9 * np.exp(-(((LAGS + 0.6) / 0.1) ** 2))
    assert lag_curve.second_minimum(LAGS, costs) == pytest.approx(-0.6)


def test_the_flank_of_a_broad_minimum_is_not_another():
    assert lag_curve.second_minimum(LAGS, 5 + 0.1 * (LAGS - 0.2) ** 2) is None


def test_lags_at_which_nothing_overlaps_are_not_chosen():
    costs = np.where(np.abs(LAGS) > 1, np.nan, 1 + LAGS**2)
    assert lag_curve.lowest(LAGS, costs) == pytest.approx(0.0)
    assert lag_curve.second_minimum(LAGS, costs) is None
