"""Everybody who is seen: whose detections are whose, and where that is not known."""

import numpy as np
import pytest

from dior.body import people_followed, people_seen, which_person
from dior.body import whose_detections as module
from dior.body.names import MLKIT_33
from dior.body.people_followed import Path
from dior.body.people_seen import Sighting
from dior.body.which_person import Seed, Seen
from dior.body.whose_detections import everyone
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import ring

FPS, COUNT = 30.0, 90


def seen_of(*people):
    """Cameras and `Seen` of people (T, 33, 3) m, the first in slot 0; all of them stay in their slots and tracks."""
    cameras = ring(3)
    uv = np.stack([observed(cameras, points, 1.0) for points in people], axis=1)
    track = np.broadcast_to(np.arange(len(people))[None, :, None], uv.shape[:3]).copy()
    return cameras, Seen(uv, np.ones(uv.shape[:4]), track, MLKIT_33, FPS)


def beside(metres):
    """A walker, and somebody `metres` (T,) to the left of them."""
    points = walker(COUNT)
    aside = np.zeros((COUNT, 1, 3))
    aside[:, 0, 1] = metres
    return points, points + aside


def found(cameras, seen):
    choice = which_person.choose(cameras, seen, seeds=[Seed(0, 2, 0)])
    return everyone(cameras, seen, choice)


def test_two_who_are_apart_are_who_they_are_all_the_time():
    subject, other = found(*seen_of(*beside(np.full(COUNT, 1.2))))
    assert (subject.is_subject, other.is_subject) == ("yes", "no") and subject.first == other.first == 0
    # one camera looks along the line between them for a while
    assert set(np.unique(subject.pick)) <= {-1, 0} and set(np.unique(other.pick)) <= {-1, 1}
    assert ((subject.pick == 0).sum(axis=0) >= 2).all() and ((other.pick == 1).sum(axis=0) >= 2).all()
    assert [one for one in ((subject.pick < 0).any(axis=1), (other.pick < 0).any(axis=1)) if one.sum() != 1] == []
    assert not subject.unsure.any() and not other.unsure.any()


def test_who_comes_later_has_the_later_number():
    cameras, seen = seen_of(*beside(np.full(COUNT, 1.2)))
    seen.uv[:, 0, :40], seen.score[:, 0, :40], seen.track[:, 0, :40] = np.nan, 0.0, -1
    choice = which_person.choose(cameras, seen, seeds=[Seed(0, 60, 0)])
    other, subject = everyone(cameras, seen, choice)
    assert (other.is_subject, subject.is_subject) == ("no", "yes") and (other.first, subject.first) == (0, 40)


def test_where_two_are_too_close_together_it_is_not_known_who_is_whose():
    """From 1.2 m to 0.05 m in all pictures and back: nobody is given the other's detections, and that is said."""
    metres = 0.05 + 1.15 * np.abs(np.linspace(-1, 1, COUNT))
    people = found(*seen_of(*beside(metres)))
    assert sorted({one.is_subject for one in people}) != ["yes"] and people[0].is_subject == "yes"
    for one in people:
        mine = 0 if one.is_subject == "yes" else 1
        assert set(np.unique(one.pick)) <= {-1, mine}
    near = metres < 0.1
    assert all((one.pick[:, near] == -1).all() for one in people)
    assert np.any([one.unsure[near] for one in people], axis=0).mean() > 0.9


def test_only_who_is_tracked_through_two_views_is_somebody():
    cameras, seen = seen_of(*beside(np.full(COUNT, 1.2)))
    seen.uv[1:, 1], seen.score[1:, 1], seen.track[1:, 1] = np.nan, 0.0, -1
    assert [one.is_subject for one in found(cameras, seen)] == ["yes"]


@pytest.mark.parametrize(
    ("members", "chosen", "meeting", "sure"),
    [
        ((0, 0), [(0, 0), (1, 1)], [], True),
        ((0, 0), [(0, 0), (1, 1)], [(0, 1)], False),  # exchanged in the second view they meet as well
        ((0, 0, 0), [(0, 0, 0), (1, 1, 1)], [(0, 0, 1)], True),  # two views tell, whoever is in the third
        ((0, 0, 0), [(0, 0, 0), (1, 1, 1)], [(0, 0, 1), (0, 1, 0)], False),
        ((0, 0, 0), [(0, 0, 0), (1, 1, 1)], [(0, 1, -1)], True),  # fewer views
        ((0, 0, -1), [(1, 1, 1), (0, 0, -1)], [(0, 1, -1)], True),  # three views know whose that is
        ((0, 0), [(0, 0), (1, 1)], [(1, 1)], True),  # has nobody in common
    ],
)
def test_a_body_is_sure_where_no_other_pair_of_detections_meets(members, chosen, meeting, sure):
    assert people_seen._sure(members, chosen, [*chosen, *meeting]) is sure


def sighting(t, tracks, x=0.0, sure=True):
    """A body whose detection in each view is in the slot of its track."""
    members = np.array(tracks)
    return Sighting(t, np.array([x, 0.0, 1.0]), members, np.zeros((0, 3)), np.nan, False, members >= 0, sure)


SLOTS = np.broadcast_to(np.arange(6)[None, :, None], (2, 6, 10))


@pytest.mark.parametrize(
    ("second", "other", "parts"),
    [
        ((0, 0), ((1, 1), (1, 1)), 1),
        ((1, 1), ((1, 1), (0, 0)), 2),  # both views say that they were exchanged
        ((1, 0), ((1, 1), (0, 1)), 2),  # one says so, one does not
        ((2, 0), ((1, 1), (1, 1)), 1),  # a new track in one view
        ((2, 3), ((1, 1), (1, 1)), 2),  # in both, and somebody is near
        ((2, 3), ((1, 1), (1, 1), 3.0), 1),  # in both, and nobody is near
        ((1, 1), ((1, 1), (0, 0), 3.0), 1),  # nobody is near who could be taken for them
    ],
)
def test_a_path_is_cut_where_the_cameras_tracks_do_not_say_that_one_person_goes_on(second, other, parts):
    path = Path([sighting(0, (0, 0)), sighting(1, (0, 1), sure=False), sighting(2, second)])
    at = (*other, 0.5)[2]
    others = [{0: sighting(0, other[0], at), 2: sighting(2, other[1], at)}]
    found = module._parts(path, others, SLOTS)
    assert len(found) == parts and sum(len(part.sightings) for part in found) == 3


def test_where_detections_of_two_meet_as_well_when_they_are_exchanged_nothing_is_certain(monkeypatch):
    monkeypatch.setattr(people_seen, "_sure", lambda members, chosen, meeting: False)
    for one in found(*seen_of(*beside(np.full(COUNT, 1.2)))):
        assert (one.pick == -1).all() and one.unsure.all()
    path = Path([sighting(1, (0, 0)), sighting(2, (0, 0), sure=False)])
    assert np.flatnonzero(module._doubtful([path], 5, 100)).tolist() == list(range(6, 15))


def test_whoever_goes_on_after_a_meeting_that_the_tracks_do_not_tell_apart_is_somebody_new(monkeypatch):
    """The cameras exchange their tracks while two are 0.6 m apart, and statures tell nothing."""
    monkeypatch.setattr(people_followed, "size_of", lambda bodies: people_followed.UNKNOWN)
    cameras, seen = seen_of(*beside(np.full(COUNT, 0.6)))
    seen.track[:, :, 45:] = seen.track[:, ::-1, 45:]
    choice = which_person.choose(cameras, seen, seeds=[Seed(0, 2, 0)])
    people = everyone(cameras, seen, choice)
    numbers = [set(np.unique(one.pick[:, :45])) | set(np.unique(one.pick[:, 45:])) for one in people]
    assert [one.is_subject for one in people][0] == "yes" and len(people) > 2
    for one in people[1:]:
        assert not ((one.pick[:, :40] >= 0).any() and (one.pick[:, 50:] >= 0).any()), numbers


def test_nobody_is_there_where_each_is_seen_by_one_view_alone():
    cameras, seen = seen_of(*beside(np.full(COUNT, 1.2)))
    for view, gone in ((0, 1), (1, 0), (2, 0), (2, 1)):
        seen.uv[view, gone], seen.score[view, gone], seen.track[view, gone] = np.nan, 0.0, -1
    choice = which_person.choose(cameras, seen)
    assert choice is None or everyone(cameras, seen, choice) == []
