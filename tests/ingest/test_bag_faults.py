"""Two seeds of each fault of a recording; `python -m benchmarks.bag_faults` has 20."""

import numpy as np
import pytest

from benchmarks import bag_faults as benchmark

pytestmark = pytest.mark.slow
SEEDS = (1, 2)


@pytest.mark.parametrize("level", ["ideal", "real"])
@pytest.mark.parametrize("kind", benchmark.STAMPS)
def test_a_header_clock_that_is_off_is_named(kind, level):
    found = [benchmark.of_stamps(level, kind, seed) for seed in SEEDS]
    # at an end of a bag it may be for too long
    fine = {"named", "refused"} if kind.startswith(("first", "last")) else {"named"}
    assert {how for how, _ in found} <= fine, found


@pytest.mark.parametrize("kind", benchmark.LENSES)
def test_what_a_camera_info_says_of_its_pictures_holds_or_is_refused(kind):
    change, words = benchmark.LENSES[kind]
    for seed in SEEDS:
        draw = np.random.default_rng([seed, 15])
        said = benchmark.lens(draw)
        assert benchmark.of_lens(said | change(draw, said), words)[0] == "named"


@pytest.mark.parametrize("kind", benchmark.RECORDERS)
def test_recorders_that_do_not_overlap_are_named(kind):
    found = [benchmark.of_recorders(kind, seed) for seed in SEEDS]
    assert {how for how, _ in found} == {"named"}, found
