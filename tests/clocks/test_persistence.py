"""Errors that last, against series whose autocorrelation is known, at 15, 60 and 120 Hz."""

import tracemalloc

import numpy as np
import pytest

from dior.clocks import persistence

RATES = (15.0, 60.0, 120.0)
TAU_S = 0.15


def lasting(hz, seconds=400.0, series=20, tau_s=TAU_S, seed=0):
    """Residuals (T, series) of variance 1 whose correlation falls by e in `tau_s`, and that of neighbours."""
    from scipy.signal import lfilter

    keep, count = np.exp(-1 / (hz * tau_s)), int(seconds * hz)
    white = np.random.default_rng(seed).standard_normal((count, series)) * np.sqrt(1 - keep**2)
    white[0] /= np.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], white, axis=0), keep


@pytest.mark.parametrize("hz", RATES)
def test_what_makes_one_measurement_is_a_time_and_no_number_of_pictures(hz):
    values, keep = lasting(hz)
    # the sum ends where the correlation is below 0.05
    last = int(np.log(persistence.FORGOTTEN) / np.log(keep))
    expected = 1 + 2 * (keep ** np.arange(1, last + 1)).sum()
    found = persistence.inflation(values, hz)
    assert found == pytest.approx(expected, rel=0.08)
    # an exponential with that time constant: two of them, but for what is forgotten, whatever the rate
    assert found / hz == pytest.approx(2 * TAU_S * 0.95, abs=0.04)


@pytest.mark.parametrize("hz", RATES)
def test_irregular_times_give_the_same_as_regular_ones(hz):
    values, keep = lasting(hz)
    rng = np.random.default_rng(1)
    t, series = np.repeat(np.arange(len(values)) / hz, values.shape[1]), np.tile(np.arange(20), len(values))
    shown = rng.permutation(len(t))[: int(0.7 * len(t))]
    found = persistence.inflation_at(values.ravel()[shown], t[shown], series[shown])
    # of 7 in 10 pictures each has so many fewer neighbours
    whole = 2 * (keep ** np.arange(1, round(hz) + 1)).sum()
    assert found == pytest.approx(1 + 0.7 * whole, rel=0.1)


def test_the_correlation_is_that_of_known_pairs_of_one_stretch():
    values = np.array([1.0, 2, np.nan, 4, -4, 2])
    assert persistence.autocorrelation(values, 1) == pytest.approx((2 - 16 - 8) / ((1 + 4 + 16 + 16 + 16 + 4) / 2))
    stretch = np.array([0, 0, 0, 0, 1, 1])
    assert persistence.autocorrelation(values, 1, stretch=stretch) == pytest.approx((2 - 8) / ((1 + 4 + 16 + 4) / 2))
    assert persistence.autocorrelation(values, 2) == pytest.approx((8 + 8) / ((4 + 16 + 16 + 4) / 2))
    assert persistence.autocorrelation(values, 6) == persistence.autocorrelation(values * np.nan, 1) == 0.0
    other = np.stack([values, 0 * values])
    assert persistence.autocorrelation(other, 1, axis=1) == persistence.autocorrelation(values, 1)


def test_white_residuals_are_one_measurement_each():
    values = np.random.default_rng(0).standard_normal((4000, 5))
    assert persistence.inflation(values, 30.0) == 1.0
    assert persistence.inflation(-np.abs(values) * (-1) ** np.arange(4000)[:, None], 30.0) == 1.0


def test_every_pair_of_a_series_counts_once_and_none_of_two_series():
    rng = np.random.default_rng(3)
    t, series, values = rng.integers(0, 90, 300) / 30, rng.integers(0, 4, 300), rng.standard_normal(300) + 0.3
    alike = (series[:, None] == series) & (np.abs(t[:, None] - t) <= 1.0) & ~np.eye(300, dtype=bool)
    expected = 1 + np.where(alike, np.outer(values, values), 0.0).sum() / (values**2).sum()
    assert expected > 1
    assert persistence.inflation_at(values, t, series) == pytest.approx(expected, rel=1e-9)
    assert persistence.inflation_at(values * (-1) ** np.arange(300), np.arange(300) / 30, 0 * series) == 1.0


def test_memory_grows_with_the_residuals_and_not_with_their_pairs():
    count = 12000  # 20 walks of 150 pictures with four edges
    series, t = np.arange(count) % 80, np.arange(count) // 80 * 0.13
    values = np.random.default_rng(0).standard_normal(count)
    tracemalloc.start()
    persistence.inflation_at(values, t, series)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100 * 8 * count
