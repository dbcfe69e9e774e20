"""Which moments the clocks of the adjustment are fitted to, and how far their turns go."""

import numpy as np
import pytest

from dior.calibrate.bundle import in_adjustment
from dior.calibrate.bundle.window import Recorded
from dior.calibrate.clock.from_cameras import TimedDetections


def sequences(hz, lasts_s=60.0):
    """One sequence of two cameras, of which the window has 5 s about the middle; cam02 drifts by 100 ppm."""
    elapsed = np.arange(int(lasts_s * hz)) / hz
    seen = TimedDetections(elapsed, np.zeros((len(elapsed), 1, 2)), 2.5 / hz)
    window = {"first": int(27.5 * hz), "step": 1, "count": int(5 * hz)}
    given = [[(0.0, 0.0, "assumed_zero"), (0.25, 100.0, "manual")]]
    return in_adjustment.of([Recorded((seen, seen), ("nose",), float(hz))], [window], ["cam01", "cam02"], given, 2)


@pytest.mark.parametrize("hz", [15, 30, 60, 120])
def test_clocks_are_fitted_to_the_same_stretch_at_any_rate(hz):
    timed = sequences(hz)
    for most_s in (in_adjustment.QUICK_S, in_adjustment.MOST_S):
        grid = timed.grid(0, most_s)
        assert grid[-1] - grid[0] == pytest.approx(most_s, abs=0.1) and np.diff(grid) == pytest.approx(1 / min(hz, 30))
        assert (grid[0] + grid[-1]) / 2 == pytest.approx(30.0, abs=0.1)
    short = sequences(hz, 33.0).grid(0, in_adjustment.MOST_S)
    assert short[-1] == pytest.approx(33.0, abs=0.2) and short[0] == pytest.approx(13.0, abs=0.2)


def test_times_and_offsets_have_the_drift_from_the_middle_on():
    timed = sequences(30)
    middle, value = timed.middle(0), np.array([[[0.0, 0.0], [0.4, 100.0]]])
    times = timed.times(0, 1, value[0, 1])
    assert np.interp(middle, timed.recorded[0].seen[1].elapsed, times) == pytest.approx(middle + 0.4)
    assert times[-1] - times[0] == pytest.approx((60 - 1 / 30) * (1 + 100e-6), abs=1e-9)
    assert timed.at_t0(value)[0, 1] == pytest.approx([0.4 - 100e-6 * middle, 100.0])
    assert times[0] == pytest.approx(timed.at_t0(value)[0, 1, 0])


def test_the_first_camera_by_name_and_those_given_by_hand_are_held():
    timed = sequences(30)
    assert timed.held.tolist() == [[True, True]] and timed.freed().held.tolist() == [[True, False]]


def test_turns_that_fall_short_are_lengthened():
    """A fit that goes half of the way: the second step is twice as long as the fit wants, so that it arrives."""
    true, value = np.array([[0.03, 20.0]]), np.zeros((1, 2))
    walked = in_adjustment.Walked().on((true - value) / 2)
    assert walked.went == pytest.approx((true - value) / 2)
    value = value + walked.went
    walked = walked.on((true - value) / 2)
    assert value + walked.went == pytest.approx(true)
    # and a step is never longer than what is allowed
    assert in_adjustment.Walked().on(np.array([[3.0, -900.0]])).went.tolist() == [[0.1, -100.0]]
