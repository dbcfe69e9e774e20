"""What is said of clean captures, in two seeds a level; `python -m benchmarks.false_alarms` has 20."""

import pytest

from benchmarks import false_alarms, steps

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("level", "seed"), [("ideal", 1), ("ideal", 2), ("real", 1), ("real", 18)])
def test_nothing_is_said_of_a_clean_capture_but_what_is_true(level, seed, tmp_path):
    made = steps.labelled(tmp_path, preset=level, seed=seed, subjects=1, duration_s=false_alarms.SECONDS, gallery=False)
    # a light may be amber where detections are as bad as at `real`
    said = [
        one for one in false_alarms.said(made) if not one[0].startswith(("true ", "light ")[: 1 + (level == "real")])
    ]
    assert said == []
