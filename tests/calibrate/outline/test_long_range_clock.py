"""The clock of a camera by the edges of boxes around a walker: its time at t0, what widens it, when it is refused."""

from dataclasses import replace

import numpy as np
import pytest

from dior.calibrate.outline import boxes_fit, long_range_clock, tracks
from dior.calibrate.outline.seen_edges import EdgeObservations, Freedom
from dior.clocks import lag
from dior.geometry.camera import project
from tests.calibrate.outline.test_boxes_fit import boxes, true_camera

LATE_S, FASTEST_M_S = 0.2, 2.0


def walked(t):
    """Points (T, 5, 3) m of a stiff body that goes to and fro along X, at 2 m/s in the middle."""
    x = FASTEST_M_S / 0.8 * np.sin(0.8 * t)
    parts = [(0.0, 1.7), (0.25, 0.8), (-0.25, 0.8), (0.1, 0.05), (-0.1, 0.05)]
    return np.stack([np.stack([x + aside, 0 * t, 0 * t + up], axis=-1) for aside, up in parts], axis=1)


def watched(begin_s=0.0, late_s=LATE_S):
    """Boxes at every 0.3 s of 12, of a camera whose stamps are `late_s` too small; the walk begins at `begin_s`."""
    t, seconds = np.arange(-2, 15, 0.01), np.arange(0.5, 11.5, 0.3)
    edges = boxes(project(true_camera(), walked(seconds + late_s))[0], 2.0, 0.3, seed=1)
    track = tracks.BodyTrack(t + begin_s, walked(t))
    nothing = np.full((len(seconds), 5, 2), np.nan)
    return EdgeObservations(
        track.at(seconds + begin_s), edges, nothing, seconds + begin_s, np.zeros(len(seconds), int), 0.0, 0.0, (track,)
    )


def test_the_offset_is_that_at_t0_however_long_ago_that_is():
    soon, late = (long_range_clock.estimate(true_camera(), watched(begin), "boxes").clock for begin in (0.0, 1e5))
    assert soon.source == late.source == "estimated" and late.middle_s == pytest.approx(1e5 + soon.middle_s)
    assert abs(soon.drift_ppm) > 0.1
    for clock in (soon, late):
        assert clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s == pytest.approx(LATE_S, abs=0.01)


def test_a_clock_further_off_is_found_where_it_is_looked_for():
    near = long_range_clock.estimate(true_camera(), watched(late_s=2.6), "boxes")
    wide = long_range_clock.estimate(true_camera(), replace(watched(late_s=2.6), most_s=3.5), "boxes")
    assert near.refused and not wide.refused
    assert wide.clock.offset_s + 1e-6 * wide.clock.drift_ppm * wide.clock.middle_s == pytest.approx(2.6, abs=0.01)
    assert len(long_range_clock.lags_of(wide.costs_px)) == len(wide.costs_px)
    assert long_range_clock.lags_of(wide.costs_px)[-1] == pytest.approx(3.52), "in steps of 40 ms"


def test_an_outline_that_trails_widens_the_time_by_what_it_takes_to_walk_so_far():
    plain, trails = (
        long_range_clock.estimate(true_camera(), watched(), "pictures", trails_m=m).clock.given for m in (0.0, 0.06)
    )
    # an instant counts by its speed: the mean of v^2 over that of |v| is pi / 4 of the fastest
    assert np.sqrt(trails[0] ** 2 - plain[0] ** 2) == pytest.approx(0.06 / (np.pi / 4 * FASTEST_M_S), rel=0.1)
    assert trails[1] == plain[1]


def test_a_clock_that_leaves_boxes_without_a_body_costs_what_they_would():
    """The walk is known from -2 to 15 s; the last boxes are drawn at 11.3."""
    reading = boxes_fit.Reading(true_camera(), Freedom(clock_s=(1.0,), drift_ppm=(100.0,)), watched(), "")
    assert reading._lost() == 0
    reading.clocks[0, 0] = 3.85
    # after 11.15 s there is one picture, with four edges
    assert reading._lost() == 4 * boxes_fit.COST_OF_LOSING


def test_residuals_to_which_much_was_fitted_are_smaller_than_errors():
    J = np.random.default_rng(0).standard_normal((40, 10))
    none = np.zeros((10, 10))
    assert long_range_clock._grown(J.T @ J, none, 40.0) == pytest.approx(np.sqrt(40 / 30))
    # what is known beforehand is not fitted
    held = 1e9 * np.eye(10)
    assert long_range_clock._grown(J.T @ J + held, held, 40.0) == pytest.approx(1.0, abs=1e-6)


def swinging(t, lead_m=0.0):
    """Points (T, 5, 3) m of a walker to and fro along X whose feet swing, `lead_m` ahead of where they are."""
    x, way = 1.25 * np.sin(0.8 * t), np.sign(np.cos(0.8 * t))
    swing = 0.35 * np.sin(5.5 * t)
    parts = [(0 * t, 1.7), (0.25 + 0 * t, 0.8), (-0.25 + 0 * t, 0.8), (swing, 0.05), (-swing, 0.05)]
    return np.stack([np.stack([x + aside + way * lead_m, 0 * t, 0 * t + up], axis=-1) for aside, up in parts], axis=1)


def test_an_outline_that_is_always_ahead_is_told_from_time_by_the_gait():
    """Toes 3 cm ahead of where they are known to be: 40 ms by the place of the walker alone."""
    t, seconds = np.arange(-2, 15, 0.01), np.arange(0.5, 11.5, 0.1)
    edges = boxes(project(true_camera(), swinging(seconds + LATE_S, 0.03))[0], 2.0, 0.02, seed=1)
    track, nothing = tracks.BodyTrack(t, swinging(t)), np.full((len(seconds), 5, 2), np.nan)
    off = {}
    for outline_m in (0.0, 0.02):
        seen = EdgeObservations(
            track.at(seconds), edges, nothing, seconds, np.zeros(len(seconds), int), 0.0, 0.0, (track,), outline_m
        )
        clock = long_range_clock.estimate(true_camera(), seen, "boxes").clock
        off[outline_m] = abs(clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - LATE_S)
    assert off[0.02] < 0.006 < 0.02 < off[0.0]


def test_a_body_that_stands_goes_nowhere():
    velocity = np.zeros((2, 3, 3))
    velocity[1] = (0.0, -1.5, 0.3)
    np.testing.assert_allclose(long_range_clock.ahead(velocity), [[0, 0, 0], [0, -1, 0]])


@pytest.mark.parametrize(("sd_px", "least", "most"), [(0.3, 0.0, 0.005), (1e4, 0.115, 0.12)])
def test_lags_that_fit_alike_widen_the_time(sd_px, least, most):
    reading = boxes_fit.Reading(true_camera(), Freedom((0, 0, 0), (0, 0, 0), clock_s=(1.0,)), watched(), "")
    reading.clocks[0, 0] = LATE_S
    kept = reading.values.copy()
    assert least <= long_range_clock.width(reading, 5.0, sd_px) < most
    np.testing.assert_array_equal(reading.values, kept)


def test_few_clusters_know_their_own_scatter_badly():
    score = np.array([[1.0], [1.0], [2.0], [0.0], [-1.0], [3.0]])
    assert long_range_clock._clustered(score, np.array([0, 0, 1, 1, 2, 2]))[0, 0] == pytest.approx(3 * 4 * 3 / (3 - 2))


@pytest.mark.parametrize(
    ("offset", "sigma_s", "said"),
    [(0.2, 0.01, ""), (1.85, 0.01, ""), (1.95, 0.01, "end of the"), (-1.95, 0.01, "end of the"), (0.2, 0.149, ""),
     (0.2, 0.151, "leaves ± 0.30 s open"), (0.2, np.nan, "open")],
)  # fmt: skip
def test_a_clock_is_refused_at_the_end_of_the_search_and_where_the_motion_leaves_it_open(offset, sigma_s, said):
    costs = 1 + (lag.window(long_range_clock.LAGS_HZ) - offset) ** 2
    why = long_range_clock._doubt(costs, np.array([sigma_s, 5.0]), offset, 1.0, 100)
    assert said in why and bool(said) == bool(why)
