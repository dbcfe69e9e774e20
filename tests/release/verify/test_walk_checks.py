import numpy as np

from dior.release.verify.walk_checks import _goes_back

STAMPS = 33_333_333 * np.arange(40)


def test_a_picture_that_was_recorded_after_a_later_one_goes_back_to_a_place_of_its_own():
    assert not _goes_back(STAMPS[[0, 1, 3, 2, *range(4, 40)]]).any()
    # into a place that another has, and all of them
    taken = STAMPS.copy()
    taken[20] = STAMPS[10] + 1_000_000
    assert np.flatnonzero(_goes_back(taken)).tolist() == [20]
    assert _goes_back(STAMPS[::-1]).sum() == 39
