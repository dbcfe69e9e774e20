"""What `python -m benchmarks.gait` counts, on one walk."""

import numpy as np
import pytest

from benchmarks import gait
from dior.gait import events, parameters


def test_parameters_are_held_against_those_of_the_contacts():
    made = gait.walk("treadmill", 16)
    t = gait.indoors("ideal", 16, made)
    found = events.find(t)
    each, means = gait.errors_of_rows(*parameters.of_walk(t, found), gait.true_rows(made, found))
    assert set(gait.FIGURES) <= set(each) and set(gait.FIGURES) <= set(means)
    assert np.median([error for error, _ in each["step_time"]]) == pytest.approx(0, abs=0.002)
