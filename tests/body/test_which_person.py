"""Two people in the pictures of three cameras: who is the subject, and who is not labelled."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks import two_walkers
from benchmarks import which_person as benchmark
from dior.body import people_seen, plausible, which_person
from dior.body.which_person import OWN, STRANGER, UNDECIDED, Seed, Seen
from dior.geometry.camera import pose
from dior.geometry.multiview import rotation_z
from dior.ingest import people as tracking
from tests.cases import slow
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import camera as facing
from tests.rig import ring

FPS = 30.0


def seen_of(capture):
    """`Seen` of a capture and whose (0, 1) each place is, (V, K, T)."""
    views, count = len(capture.cameras), len(capture.seconds)
    uv, score = np.full((views, 2, count, 33, 2), np.nan), np.zeros((views, 2, count, 33))
    track, owner = np.full((views, 2, count), -1), np.full((views, 2, count), -1)
    for view, (found, whose) in enumerate(zip(capture.people, capture.owner, strict=True)):
        at = view, found.person, found.frame
        uv[at], score[at], owner[at] = found.uv, found.score, whose
        track[at] = tracking.tracks(found, two_walkers.stamps(capture))
    return Seen(uv, score, track, capture.names, FPS), owner


@cache
def made(kind, seed=0, taller=0.07):
    capture = two_walkers.make(kind, "ideal", seed, taller=taller)
    return capture, *seen_of(capture)


def picked(owner, choice):
    """Whose detection was chosen, (V, T): 0 the subject, 1 the other, -1 none."""
    return np.where(choice.pick >= 0, np.take_along_axis(owner, np.maximum(choice.pick, 0)[:, None], axis=1)[:, 0], -1)


def test_one_person_is_nobody_to_choose():
    cameras, points = ring(3), walker(60)
    uv = observed(cameras, points, 1.0)[:, None]
    track = np.zeros(uv.shape[:3], int)
    names = two_walkers.MLKIT_33
    assert which_person.choose(cameras, Seen(uv, np.ones(uv.shape[:4]), track, names, FPS)) is None


@pytest.mark.slow
def test_the_height_tells_two_people_apart():
    capture, seen, owner = made("together")
    for height, who in ((capture.height_m, 0), (capture.height_m + 0.07, 1)):
        choice = which_person.choose(capture.cameras, seen, which_person.by_tape(height, 0.01))
        assert (choice.state == OWN).all() and choice.people == 2
        assert (picked(owner, choice) == who).mean() > 0.99


def test_without_a_height_nobody_is_chosen():
    capture, seen, _ = made("together")
    choice = which_person.choose(capture.cameras, seen)
    assert (choice.state == UNDECIDED).all()
    assert [(one.first, one.last) for one in choice.stretches] == [(0, 299)]


@pytest.mark.slow
def test_two_of_one_height_are_left_open():
    capture, seen, _ = made("same_build")
    choice = which_person.choose(capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01))
    assert (choice.state == UNDECIDED).all()


@pytest.mark.parametrize("who", [0, 1])
def test_a_seed_by_hand_goes_before_everything(who):
    capture, seen, owner = made("together")
    person = int(np.flatnonzero(owner[1, :, 150] == who)[0])
    choice = which_person.choose(
        capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01), [Seed(1, 150, person)]
    )
    assert (choice.state == OWN).all() and (picked(owner, choice) == who).mean() > 0.99


@pytest.mark.slow
def test_who_walks_in_while_the_subject_is_away_is_rejected():
    capture, seen, owner = made("another")
    choice = which_person.choose(capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01))
    assert ((choice.state == STRANGER) == capture.there[1]).mean() > 0.98
    assert not (picked(owner, choice) == 1).any()
    assert ((picked(owner, choice) == 0).all(axis=0) == capture.there[0]).mean() > 0.98
    (one,) = choice.stretches
    assert one.taller_m == pytest.approx(0.07, abs=0.02) and 0.5 < one.off_m < 3.0


@pytest.mark.slow
def test_one_camera_that_follows_another_is_left_out_and_not_the_others():
    capture, seen, owner = made("mostly_one_camera")
    choice = which_person.choose(capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01))
    assert (choice.state == OWN).all()
    chosen = picked(owner, choice)
    assert ((chosen == 0) == (owner[:, 0] == 0)).mean() > 0.99 and (chosen == 1).mean() < 0.02


def test_that_two_cameras_of_three_agree_is_no_proof():
    capture, seen, _ = made("two_cameras", taller=0.0)
    choice = which_person.choose(capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01))
    assert (choice.state == UNDECIDED).all()


def test_a_passer_by_does_not_make_the_subject_doubtful():
    """Somebody is there beside the subject for a quarter of the time, of the same height, and no height is known."""
    capture, seen, owner = made("together")
    late = np.arange(300) >= 75
    gone = (owner == 1) & late
    track = np.where(gone, -1, seen.track)
    part = replace(
        seen,
        track=track,
        uv=np.where(gone[..., None, None], np.nan, seen.uv),
        score=np.where(gone[..., None], 0.0, seen.score),
    )
    choice = which_person.choose(capture.cameras, part)
    assert (choice.state == OWN).all() and (picked(owner, choice) == 0).mean() > 0.99


def test_who_stands_beside_the_walkway_is_not_the_subject():
    """As in `together`, but the other stays where he was in the first picture; no height is known."""
    capture, seen, owner = made("together")
    uv, score = seen.uv.copy(), seen.score.copy()
    for view in range(3):
        mine = owner[view] == 1
        (first,) = np.flatnonzero(mine[:, 0])
        person, t = np.nonzero(mine)
        uv[view, person, t] = seen.uv[view, first, 0]
        score[view, person, t] = seen.score[view, first, 0]
    choice = which_person.choose(capture.cameras, replace(seen, uv=uv, score=score))
    assert (choice.state == OWN).all() and (picked(owner, choice) == 0).mean() > 0.95


def test_bodies_are_where_they_are_and_as_tall():
    capture, seen, owner = made("together")
    known = seen.score[:, :, ::30] > 0
    found = people_seen.sightings(capture.cameras, seen.uv[:, :, ::30], known, seen.names)
    assert [len(bodies) for bodies in found] == [2] * 10
    hips = capture.points[:, ::30, 23:25].mean(axis=2)
    for t, bodies in enumerate(found):
        for body in bodies:
            who = owner[0, body.members[0], t * 30]
            assert (owner[[0, 1, 2], body.members, t * 30] == who).all() and not body.alone
            assert np.linalg.norm(body.place - hips[who, t]) < 0.06  # 2 px are 16 mm at 5 m
    for who in (0, 1):
        size = [b.stature for t, bodies in enumerate(found) for b in bodies if owner[0, b.members[0], t * 30] == who]
        assert np.median(size) == pytest.approx(capture.height_m + 0.07 * who, abs=0.03)


def test_errors_make_bones_longer_from_cameras_that_face_each_other():
    """To second order, and without what triangulation itself makes shorter; around there is hardly any."""
    points, names = made("together")[0].points[0, ::12], two_walkers.MLKIT_33
    true = plausible.stature(points, names)
    around = ring(3)
    x, y, z = around[0].centre
    for cameras, least, most in ((around, 0.0, 0.01), ([around[0], facing("cam02", (-x, 1.0 - y, z))], 0.03, 0.1)):
        uv = observed(cameras, points, 3.0)[:, None]
        found = people_seen.sightings(cameras, uv, np.isfinite(uv).all(axis=-1), names)
        more, said = np.mean([[body.stature - true, body.longer] for (body,) in found], axis=0)
        assert least < more < most and more - 0.003 < said < 2 * more + 0.003


@pytest.mark.parametrize("seed", [1, slow(2)])
def test_two_cameras_that_face_each_other_choose_nobody_by_a_few_centimetres(seed):
    capture = two_walkers.make("facing", "real", seed, taller=-0.05)
    seen, _ = seen_of(capture)
    choice = which_person.choose(capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01))
    assert (choice.state == UNDECIDED).all()


def test_one_view_alone_tells_where_somebody_stands_also_upside_down():
    capture, seen, owner = made("two_cameras", taller=0.0)
    (view,) = np.flatnonzero((owner[:, 0] == 0).all(axis=1))
    uv, there = seen.uv[[view]][:, :1, ::30], seen.score[[view]][:, :1, ::30] > 0
    camera, lens = capture.cameras[view], capture.cameras[view].intrinsics
    turned = camera.at(pose(camera.wRc @ rotation_z(np.pi), camera.centre))
    upright, other = (
        np.array([bodies[0].place for bodies in people_seen.sightings([one], pixels, there, seen.names)])
        for one, pixels in ((camera, uv), (turned, 2 * np.array([lens.cx, lens.cy]) - uv))
    )
    hips = capture.points[0, ::30, 23:25].mean(axis=1)
    assert np.median(np.linalg.norm((upright - hips)[:, :2], axis=1)) < 0.4
    # a lens is not quite the same turned by 180 degrees
    np.testing.assert_allclose(other, upright, atol=0.02)


CASES = [(kind, level) for kind in two_walkers.KINDS for level in ("ideal", "real")]
OPEN = pytest.mark.xfail(reason="who comes back is left open in some walks at `real`, and in one of these two")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "level"), [pytest.param(*case, marks=[OPEN] if case == ("another", "real") else []) for case in CASES]
)
def test_the_step_labels_the_subject_and_nobody_else(kind, level):
    """Two seeds of each kind; `python -m benchmarks.which_person` has 20."""
    each = [benchmark.one(kind, level, seed) for seed in (0, 1)]
    ok, right, in_two, kept, strange, suspect = sum(counts for counts, _, _ in each)
    said = {code for _, codes, _ in each for code in codes} & set(benchmark.WARNINGS)
    if kind in ("same_build", "two_cameras"):
        assert ok == 0 and suspect > 0 and said == {"who_is_subject"}
    elif kind in ("proportions", "facing"):
        # a height may say too little, but never the wrong one; where two cameras alone see two people overlap, some
        # joints are of both
        assert right >= 0.98 * ok and said <= {"who_is_subject"}
        assert kind == "facing" or strange <= 0.0005 * ok
    else:
        assert right >= 0.98 * ok and strange <= 0.0005 * ok and kept >= 0.9 * in_two
        assert said == ({"somebody_else"} if kind == "another" else set())


@pytest.mark.slow
def test_a_fourth_camera_is_no_obstacle():
    capture = two_walkers.make("mostly_one_camera", "ideal", 0, views=4, taller=0.07)
    seen, owner = seen_of(capture)
    choice = which_person.choose(capture.cameras, seen, which_person.by_tape(capture.height_m, 0.01))
    assert (choice.state == OWN).all() and ((picked(owner, choice) == 0) == (owner[:, 0] == 0)).mean() > 0.98
