"""Following the subject: against all paths tried out, and in scenes whose answer is plain."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from dior.body.names import COCO_17
from dior.ingest import people as module
from dior.ingest.people import People, follow
from tests.cases import some

BODY = np.stack([np.linspace(-20, 20, 17) * np.cos(np.arange(17)), np.linspace(-90, 90, 17)], axis=-1)
SIZE = np.hypot(*np.ptp(BODY, axis=0))


def stamps(count, rate=30.0):
    return 1_708_000_000_000_000_000 + np.rint(np.arange(count) * 1e9 / rate).astype(np.int64)


def people(found, count=None):
    """`found` is (frame, person, (u, v) of the middle, scale, score) tuples."""
    found = sorted(found, key=lambda one: one[:2])
    uv = np.array([scale * BODY + middle for _, _, middle, scale, _ in found]).reshape(-1, 17, 2)
    score = np.array([np.full(17, one[4]) for one in found]).reshape(-1, 17)
    frame = np.array([one[0] for one in found], int)
    ran = np.arange(count if count is not None else frame.max() + 1)
    return People(COCO_17, frame, np.array([one[1] for one in found], int), uv, score, ran, np.full(len(ran), -1))


def chosen(track, all_people):
    """Person index per frame, -1 for nobody."""
    return np.append(all_people.person, -1)[track.row].tolist()


def energy(path, all_people, seconds):
    """Cost of a path (row or -1 per frame that has people), by the definition in `follow`."""
    frames = np.unique(all_people.frame)
    extent = np.hypot(*(np.ptp(all_people.uv, axis=1)).T)
    total, last = 0.0, None
    for row in path:
        if row < 0:
            total += module.SKIP
            continue
        largest = extent[all_people.frame == all_people.frame[row]].max()
        total += 2 - all_people.score[row].mean() - extent[row] / largest
        if last is not None:
            distance = min(
                np.linalg.norm(all_people.uv[row] - all_people.uv[last], axis=-1).mean(),
                np.linalg.norm(all_people.uv[row] - all_people.uv[last][module.swap_index(COCO_17)], axis=-1).mean(),
            )
            passed = seconds[all_people.frame[row]] - seconds[all_people.frame[last]]
            reach = module.REACH + module.SPEED * max(passed / module.PERIOD_S, 1.0)
            reach *= max(extent[row], extent[last])
            total += min((distance / reach) ** 2, module.JUMP)
        last = row
    return total if len(path) == len(frames) else np.inf


@pytest.mark.parametrize("seed", some(range(12), *range(4)))
def test_the_path_is_the_cheapest_of_all(seed):
    """Every path through 6 frames of 1 to 3 people; the margin is to the best path through another person."""
    rng = np.random.default_rng(seed)
    found = [
        (frame, person, rng.uniform(0, 250, 2), rng.uniform(0.6, 1.4), rng.uniform(0.1, 1))
        for frame in (0, 1, 3, 4, 5, 8)
        for person in range(rng.integers(1, 4))
    ]
    everybody, when = people(found), stamps(9)
    seconds = (when - when[0]) / 1e9
    rows = [np.append(np.flatnonzero(everybody.frame == f), -1) for f in (0, 1, 3, 4, 5, 8)]
    paths = [path for path in product(*rows) if max(path) >= 0]
    costs = np.array([energy(path, everybody, seconds) for path in paths])
    best = paths[int(np.argmin(costs))]
    track = follow(everybody, when)
    assert track.row[[0, 1, 3, 4, 5, 8]].tolist() == list(best)
    for i, frame in enumerate((0, 1, 3, 4, 5, 8)):
        others = [cost for path, cost in zip(paths, costs, strict=True) if path[i] not in (best[i], -1)]
        near = best[i] >= 0 and others and min(others) - costs.min() < module.AMBIGUOUS
        assert track.ambiguous[frame] == bool(near)


def test_a_walker_is_followed_past_a_bystander_in_any_order_of_people():
    rng = np.random.default_rng(1)
    found, truth = [], []
    for frame in range(60):
        walker, bystander = (4.0 * frame, 100.0), (120.0, 90.0)
        first = rng.integers(2)
        found += [(frame, first, walker, 1.0, 0.7), (frame, 1 - first, bystander, 0.7, 0.6)]
        truth.append(first)
    everybody = people(found)
    track = follow(everybody, stamps(60))
    assert chosen(track, everybody) == truth
    assert track.several.all() and not track.left_out.any()


def test_a_gap_and_a_lone_bystander_do_not_break_it():
    found = [(f, 0, (3.0 * f, 0.0), 1.0, 0.7) for f in range(40) if f not in (10, 11, 12, 20, 21)]
    found += [(f, 1, (900.0, 0.0), 1.0, 0.9) for f in (10, 11, 12)]
    everybody = people(found, 40)
    track = follow(everybody, stamps(40))
    missing = np.isin(np.arange(40), (10, 11, 12, 20, 21))
    assert chosen(track, everybody) == np.where(missing, -1, 0).tolist()
    assert np.flatnonzero(track.left_out).tolist() == [10, 11, 12]
    assert not track.several.any() and not track.ambiguous.any()


def test_a_bystander_found_instead_for_two_thirds_of_a_second_is_left_out():
    """Leaving out the pictures around would make the two jumps cheap if reach grew with the root of the time passed."""
    found = [(f, 0, (4.0 * f, 0.0), 1.0, 0.9) for f in range(90) if not 30 <= f < 50]
    size = np.hypot(*np.ptp(people(found[:1]).uv[0], axis=0))
    found += [(f, 0, (4.0 * 40 + 1.7 * size, 0.0), 1.0, 0.9) for f in range(30, 50)]
    track = follow(people(found), stamps(90))
    assert np.flatnonzero(track.left_out).tolist() == list(range(30, 50))


def test_a_subject_missed_in_a_third_of_the_frames_is_not_given_up_for_a_bystander():
    found = [(f, 0, (3.0 * f, 0.0), 1.0, 0.6) for f in range(90) if f % 3]
    found += [(f, 1, (900.0, 0.0), 0.6, 0.4) for f in range(90)]
    everybody = people(found)
    assert chosen(follow(everybody, stamps(90)), everybody) == [0 if f % 3 else -1 for f in range(90)]


def lost_for(gap_s, aside, rate, throughout, noise=0.01):
    """The subject walks 1.2 body sizes a second and is lost from 2 s on; somebody else is found then, or `throughout`.

    `aside`: how far from there, body sizes.
    """
    rng, found = np.random.default_rng(0), []
    for frame in range(round(6 * rate)):
        second = frame / rate
        lost = 2 <= second < 2 + gap_s
        if not lost:
            found.append((frame, 0, (SIZE * (1.2 * second + rng.normal(0, noise)), 0.0), 1.0, 0.8))
        if lost or throughout:
            found.append((frame, 1, (SIZE * (2.4 + aside), 20.0), 0.8, 0.6))
    return people(found, round(6 * rate))


@pytest.mark.parametrize("rate", [15, 60, 120])
@pytest.mark.parametrize(
    "gap_s, aside, throughout, meanwhile",
    [(0.3, 1.0, True, -1), (0.6, 4.0, True, -1), (0.6, 1.7, False, -1), (1.3, 4.0, False, -1), (1.3, 1.0, False, 1)],
)
def test_the_same_scene_gives_the_same_choice_at_every_rate(rate, gap_s, aside, throughout, meanwhile):
    """The costs are per second; only around the moment of a change may a rate leave a few pictures more out."""
    everybody = lost_for(gap_s, aside, rate, throughout)
    count = len(everybody.ran)
    who, second = np.array(chosen(follow(everybody, stamps(count, rate)), everybody)), np.arange(count) / rate
    edge = gap_s / 3
    assert (who[second < 2 - edge] == 0).all() and (who[second > 2 + gap_s + edge] == 0).all()
    assert (who[(second > 2 + edge) & (second < 2 + gap_s - edge)] == meanwhile).all()


@pytest.mark.parametrize("rate, share", [(15, 2.0), (30, 1.0), (120, 0.25)])
def test_noise_costs_by_the_second_and_a_change_of_person_once(rate, share):
    """0.09 body sizes at 30 Hz are half of the reach, 0.9 five times the reach: 1/4 a period, and 24 more than 1."""
    walk = 0.09 * max(share, 1.0)
    everybody = people(
        [(0, 0, (0.0, 0.0), 1.0, 0.5), (1, 0, (walk * SIZE, 0.0), 1.0, 0.5), (2, 0, (0.9 * SIZE, 0.0), 1.0, 0.5)]
    )
    ahead = np.array([0.0, 1 / rate, 1 / rate])
    cost = module._steps(everybody, ahead, share, np.array([1, 2]), np.array([0, 0]))
    far = share * min((0.9 / 0.18 / max(share, 1.0)) ** 2, 1.0) + 24
    np.testing.assert_allclose(cost, [share / 4, far], rtol=1e-9)


def test_a_detector_run_on_every_second_picture_chooses_as_one_of_half_the_rate():
    every = lost_for(1.3, 4.0, 30, False)
    half = people([(2 * f, p, *rest) for f, p, *rest in rows_of(every)], 2 * len(every.ran))
    half = replace(half, ran=np.arange(0, len(half.ran), 2))
    assert follow(half, stamps(2 * len(every.ran), 60)).row[::2].tolist() == follow(every, stamps(180, 30)).row.tolist()


def rows_of(everybody):
    for row in range(len(everybody.frame)):
        extent = np.ptp(everybody.uv[row], axis=0)[1] / np.ptp(BODY, axis=0)[1]
        middle = everybody.uv[row].mean(axis=0) - extent * BODY.mean(axis=0)
        yield everybody.frame[row], everybody.person[row], middle, extent, everybody.score[row, 0]


def test_one_person_who_comes_back_elsewhere_is_the_subject():
    """A jump costs less than to leave 90 frames out."""
    everybody = people([(f, 0, (0.0 if f < 90 else 4000.0, 0.0), 1.0, 0.5) for f in range(180)])
    assert (follow(everybody, stamps(180)).row >= 0).all()


def test_left_and_right_exchanged_is_the_same_person():
    found = [(f, 0, (3.0 * f, 0.0), 1.0, 0.2) for f in range(10)]
    everybody = people(found)
    everybody.uv[5] = everybody.uv[5][module.swap_index(COCO_17)]
    assert (follow(everybody, stamps(10)).row >= 0).all()


def test_two_equal_people_are_ambiguous_throughout():
    found = [(f, p, (1000.0 * p, 0.0), 1.0, 0.5) for f in range(20) for p in range(2)]
    track = follow(people(found), stamps(20))
    assert track.ambiguous.all()
    assert len(set(track.row % 2)) == 1


def test_nobody_at_all_and_one_single_person():
    none, three = np.empty(0, int), np.arange(3)
    nobody = People(COCO_17, none, none, np.empty((0, 17, 2)), np.empty((0, 17)), three, three)
    assert follow(nobody, stamps(3)).row.tolist() == [-1, -1, -1]
    alone = people([(1, 0, (0.0, 0.0), 1.0, 0.5)], 3)
    assert follow(alone, stamps(3)).row.tolist() == [-1, 0, -1]


def test_missing_joints_and_no_common_joint():
    found = [(f, 0, (2.0 * f, 0.0), 1.0, 0.5) for f in range(6)]
    everybody = people(found)
    everybody.uv[2, :8] = np.nan
    everybody.uv[3, 8:] = np.nan
    assert (follow(everybody, stamps(6)).row >= 0).all()


def test_the_short_cut_for_one_person_agrees_with_the_full_search():
    rng = np.random.default_rng(3)
    found = [(f, 0, (3.0 * f + rng.normal(0, 2), 0.0), 1.0, rng.uniform(0.3, 1)) for f in range(50)]
    alone = people(found)
    # somebody far away in one frame is enough to search
    searched = follow(people([*found, (25, 1, (5000.0, 0.0), 0.3, 0.1)]), stamps(50))
    assert np.delete(searched.row, range(25, 50)).tolist() == follow(alone, stamps(50)).row[:25].tolist()
    assert (searched.row >= 0).all() and searched.several.sum() == 1


def test_a_track_goes_on_over_a_gap_and_ends_where_somebody_else_is_taken():
    walk = [(t, 0, (100 + 4 * t, 200), 1.0, 0.9) for t in range(60) if not 10 <= t < 20]
    assert not module.tracks(people(walk), stamps(60)).any()
    # from 30 to 44 the detector of one person gives somebody who stands aside
    taken = [(t, 0, (500, 200), 1.0, 0.9) if 30 <= t < 45 else one for t, *_ in walk for one in walk if one[0] == t]
    number = module.tracks(people(taken), stamps(60))
    expected = [1 if 30 <= t < 45 else 0 for t, *_ in walk]
    assert number.tolist() == expected


def test_who_passes_where_another_was_lost_keeps_his_track():
    """Somebody who stands is not found from 10 on; who walks by passes there half a second later."""
    walk = [(t, 0, (100 + 4 * t, 200), 1.0, 0.9) for t in range(40)]
    stands = [(t, 1, (200, 200), 1.0, 0.9) for t in range(10)]
    found = people(sorted(walk + stands))
    number = module.tracks(found, stamps(40))
    assert len(set(number[found.person == 0].tolist())) == 1 and len(set(number.tolist())) == 2


def test_sizes_are_measured_once_however_many_pictures_there_are(monkeypatch):
    """Of all people for each picture an hour would take a day."""
    walk = [(t, 0, (100 + 4 * t, 200), 1.0, 0.9) for t in range(40)]
    measured, extent = [], module._extent
    monkeypatch.setattr(module, "_extent", lambda uv: measured.append(len(uv)) or extent(uv))
    found = people(sorted(walk + [(t, 1, (900, 200), 1.0, 0.9) for t in range(20)]))
    module.tracks(found, stamps(40))
    assert sum(measured) == len(found.frame)


def test_two_people_have_a_track_each_whatever_their_order():
    found = []
    for t in range(30):
        a, b = (100 + 4 * t, 200), (600 - 4 * t, 260)
        found += [(t, 0, a, 1.0, 0.9), (t, 1, b, 1.0, 0.9)] if t % 2 else [(t, 0, b, 1.0, 0.9), (t, 1, a, 1.0, 0.9)]
    all_people = people(found)
    number = module.tracks(all_people, stamps(30))
    left = all_people.uv[:, :, 0].mean(axis=1) < 350
    assert len(set(number[left].tolist())) == 1 and len(set(number[~left].tolist())) == 1
