"""Bodies put together into paths and people: who goes on as whom, and how tall a body is."""

import numpy as np
import pytest

from dior.body import people_followed as module
from dior.body.people_followed import UNKNOWN, Path, Size, at_once, mean_size, paths_of, people_of, same, size_of
from dior.body.people_seen import Sighting

FPS = 6.0
TALL = 1.75
NONE = np.zeros((0, 3))


def sighting(t, tracks=(0, 0, 0), x=0.0, stature=TALL, longer=0.0, alone=False):
    """A body whose detection in each view is in the slot of its track."""
    members = np.array(tracks)
    return Sighting(t, np.array([x, 0.0, 1.0]), members, NONE, stature, alone, members >= 0, longer=longer)


SLOTS = np.broadcast_to(np.arange(4)[None, :, None], (3, 4, 60))


def followed(*bodies):
    found = [[] for _ in range(60)]
    for body in bodies:
        found[body.t].append(body)
    return [[body.t for body in path.sightings] for path in paths_of(found, SLOTS, FPS)]


@pytest.mark.parametrize(
    ("tracks", "goes_on"), [((0, 0, 0), True), ((1, 0, 0), True), ((1, 1, 0), False), ((1, 1, -1), False)]
)
def test_where_most_views_have_another_track_at_once_somebody_else_is_seen(tracks, goes_on):
    before = [sighting(t) for t in range(6)]
    assert len(followed(*before, sighting(6, tracks, 0.3))) == 2 - goes_on


@pytest.mark.parametrize(("stature", "goes_on"), [(TALL + 0.1, True), (TALL + 0.25, False), (TALL - 0.25, False)])
def test_two_whose_rays_meet_by_chance_are_of_another_size(stature, goes_on):
    before = [sighting(t, stature=TALL + 0.02 * (-1) ** t) for t in range(6)]
    assert len(followed(*before, sighting(6, stature=stature))) == 2 - goes_on


def test_who_varies_much_goes_on_as_tall_as_that():
    before = [sighting(t, stature=TALL + 0.1 * (-1) ** t) for t in range(6)]
    assert len(followed(*before, sighting(6, stature=TALL + 0.25))) == 1


@pytest.mark.parametrize(
    ("beside", "alone", "people"),
    [
        ((), False, 1),
        ((31,), True, 1),
        # whom several views see at another instant of half a second may be the same, but not at the same one
        ((31,), False, 1),
        ((30,), False, 2),
        ((30,), True, 1),
        ((31, 33, 35), True, 2),
    ],
)
def test_a_path_that_another_took_over_may_go_on_for_two_sightings(beside, alone, people):
    statures = TALL + 0.01 * np.random.default_rng(2).standard_normal(60)
    earlier = Path([sighting(t, x=0.1 * t, stature=statures[t]) for t in range(30)])
    earlier.sightings += [sighting(t, x=9.0, alone=alone) for t in beside]
    later = Path([sighting(t, x=0.1 * t, stature=statures[t]) for t in range(30, 60) if t not in (31, 33, 35)])
    assert len(people_of([earlier, later], FPS)) == people
    assert at_once(earlier, [later]) == at_once(later, [earlier]) == (people == 2)
    assert at_once(earlier, [earlier])


def test_a_size_is_the_mean_without_outliers_and_what_errors_made_longer():
    random = np.random.default_rng(1)
    statures = TALL + 0.02 * random.standard_normal(200)
    statures[:5] = 2.6
    size = size_of([sighting(t, stature=one, longer=0.01) for t, one in enumerate(statures)])
    longer = module.LONGER * 0.01
    assert size.longer_m == pytest.approx(longer)
    assert size.stature_m == pytest.approx(TALL - longer, abs=0.005)
    # two sightings say as much as one
    assert size.sigma_m == pytest.approx(0.02 * np.sqrt(2 / 0.95 / 200), rel=0.15)


def test_the_mean_of_sizes_is_by_their_precision_and_unknown_ones_do_not_count():
    assert mean_size([UNKNOWN]) is UNKNOWN
    one, other = Size(1.7, 0.01, 0.002), Size(1.76, 0.02, 0.012)
    mean = mean_size([UNKNOWN, one, other])
    assert mean.stature_m == pytest.approx(1.712) and mean.longer_m == pytest.approx(0.004)
    assert mean.sigma_m == pytest.approx(np.sqrt(1 / (1e4 + 2.5e3)))


def test_a_size_is_anothers_beyond_three_sigma_and_surely_the_same_where_four_centimetres_are_unlikely():
    exact, rough = Size(TALL, 0.005), Size(TALL, 0.03)
    assert same(exact, Size(TALL + 0.03, 0.005)) is None
    assert same(exact, Size(TALL + 0.01, 0.005)) is True
    assert same(exact, Size(TALL + 0.019, 0.005)) is False
    assert same(rough, Size(TALL, 0.03)) is False and same(exact, UNKNOWN) is False


def test_what_errors_make_longer_is_known_to_a_part():
    apart = Size(TALL, 0.0, 0.05).variance_to(Size(TALL, 0.0, 0.01)) - Size(TALL, 0.0).variance_to(Size(TALL, 0.0))
    assert apart == pytest.approx((module.LONGER_SHARE * 0.04) ** 2)


def test_a_path_of_one_view_alone_has_no_size_by_several():
    alone = [Sighting(t, np.zeros(3), np.array([0, -1, -1]), NONE, 1.8, True, np.zeros(3, bool)) for t in range(4)]
    path = Path([*alone, sighting(4)])
    assert path.together == [] and size_of(path.sightings) == Size(1.8, module.ALONE_SIGMA_M)
