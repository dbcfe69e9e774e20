"""What no body does is found, by name and frame, and nothing else is."""

import numpy as np
import pytest

from dior.body import marker_checks
from dior.body.names import PLUG_IN_GAIT_39
from tests.ingest.c3d_files import PLACES, person

NAMES = list(PLACES)
WALK = person(NAMES, 50)


def test_every_pair_is_of_markers_and_has_its_mirror_image():
    pairs = {frozenset(pair) for pair in marker_checks.RIGID}
    assert len(pairs) == len(marker_checks.RIGID) == 23
    assert {name for pair in pairs for name in pair} <= set(PLUG_IN_GAIT_39)


@pytest.mark.parametrize("power", range(-3, 4))
def test_the_power_of_ten_of_anyone(power):
    for stature in (0.6, 1.0, 1.3):
        assert marker_checks.power_of_ten(WALK * stature * 10.0**power, NAMES) == power
    assert marker_checks.power_of_ten(WALK[:, :1], NAMES[:1]) == 0
    mixed = WALK.copy()
    mixed[:, NAMES.index("LKNE")] *= 1000
    assert marker_checks.power_of_ten(mixed, NAMES) is None


@pytest.mark.parametrize("axis", range(3))
def test_up_is_from_the_feet_to_the_head_whatever_is_missing(axis):
    turned = np.roll(WALK, axis - 2, axis=-1)
    turned[:25, NAMES.index("LFHD")] = turned[10:, NAMES.index("LTOE")] = np.nan
    np.testing.assert_allclose(marker_checks.axis_up(turned, NAMES)[axis], 1.0, atol=0.01)
    legs = [i for i, name in enumerate(NAMES) if name[1:] in ("ANK", "KNE")]
    assert marker_checks.axis_up(turned[:, legs], [NAMES[i] for i in legs])[axis] > 0.95
    assert np.isnan(marker_checks.axis_up(turned[:, :4], NAMES[:4])).all()


def test_a_pair_that_stretches_is_named_with_its_worst_frame():
    assert marker_checks.stretched(WALK, NAMES) is None
    walk = WALK.copy()
    walk[7, NAMES.index("RANK"), 1] -= 0.9
    walk[8, NAMES.index("RANK"), 1] -= 0.6
    odd = marker_checks.stretched(walk, NAMES)
    assert (odd.frame, odd.frames) == (7, 2) and odd.text.startswith("R") and "RANK" in odd.text
    walk[7:9, NAMES.index("RANK")] = np.nan
    assert marker_checks.stretched(walk, NAMES) is None


def test_a_marker_that_flies_is_named_also_across_a_gap():
    assert marker_checks.flying(WALK, NAMES, 100.0) is None
    walk = WALK.copy()
    walk[20:, 0, 0] += 0.3
    assert marker_checks.flying(walk, NAMES, 100.0) == ("LFHD moves at 31 m/s, as no body does,", 20, 1)
    walk[18:20, 0] = np.nan
    assert marker_checks.flying(walk, NAMES, 100.0) is None
    assert marker_checks.flying(walk, NAMES, 300.0).frame == 20
