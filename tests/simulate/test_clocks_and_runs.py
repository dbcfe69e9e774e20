"""The pieces that the simulator's errors are made of, against what they say."""

import numpy as np
import pytest

from dior.simulate.clocks import seconds
from dior.simulate.runs import runs


def test_a_slow_clock_shows_less_time_than_passed():
    """100 ppm slow: after 10 s on the camera's clock 10.001 s have passed."""
    at = seconds(np.array([0, 10_000_000_000]) + 5_000_000_000, 5_000_000_000, 0.5, 100.0)
    np.testing.assert_allclose(at, [0.5, 10.501], atol=1e-12)


@pytest.mark.parametrize("share", [0.05, 0.4, 0.7])
def test_runs_have_the_share_and_the_lengths_that_were_asked_for(share):
    found = runs(np.random.default_rng(3), 300_000, share, (5, 20))
    # about 300 000 * share / 12.5 runs; the share scatters by less than 1 % of 1
    assert abs((found >= 0).mean() - share) < 0.015
    lengths = np.bincount(found[found >= 0])[1:-1]
    assert lengths.min() == 5 and lengths.max() == 20 and abs(lengths.mean() - 12.5) < 0.2
    # runs are counted in order, with at least one sample between two
    inside = found[1:] >= 0
    assert ((found[1:] == found[:-1]) | (found[:-1] < 0) | ~inside).all()
