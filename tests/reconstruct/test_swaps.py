import itertools

import numpy as np
import pytest

from benchmarks import scene
from dior.body.names import LIMBS, MLKIT_33, is_leg, swap_index
from dior.geometry import camera as cam
from dior.reconstruct import swaps
from dior.reconstruct.detector_noise import estimated
from dior.reconstruct.swaps import combinations, exchange, find_exchanged, find_mistaken_limbs, find_swaps
from tests.rig import ring

FPS = 30.0


def walker(count, seed=0):
    """A rigid-limbed body of 33 joints, left and right half a metre apart, walking along x."""
    rng = np.random.default_rng(seed)
    body = rng.uniform([-0.1, 0, 0], [0.1, 0.05, 1.7], (33, 3))
    side = np.array([0.25 if "left" in j else -0.25 if "right" in j else 0 for j in MLKIT_33])
    body[:, 1] += side
    path = np.linspace(-1, 1, count)[:, None, None] * [1, 0, 0]
    return body + path


def observed(cameras, points, noise, seed=1):
    uv = np.stack([cam.project(c, points)[0] for c in cameras])
    return uv + np.random.default_rng(seed).normal(0, noise, uv.shape)


def test_exchange_is_its_own_inverse_and_keeps_the_nose():
    index = swap_index(MLKIT_33)
    assert (index[index] == np.arange(33)).all() and index[0] == 0
    values = np.random.default_rng(0).normal(size=(2, 4, 33, 2))
    swapped = np.array([[1, 0, 0, 1], [0, 0, 0, 0]], bool)
    once = exchange(values, swapped, MLKIT_33)
    assert (once[0, 0, MLKIT_33.index("left_hip")] == values[0, 0, MLKIT_33.index("right_hip")]).all()
    assert (exchange(once, swapped, MLKIT_33) == values).all()


def test_runs_of_swaps_in_one_view_are_found_without_false_ones():
    cameras = ring(3)
    uv = observed(cameras, walker(90), 2.0)
    true = np.zeros((3, 90), bool)
    true[1, 20:45] = True
    true[2, 60:66] = True
    found = find_swaps(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33, FPS)
    assert (found == true).all()


def test_two_of_three_views_exchanged_together_are_told_by_continuity():
    """In one picture two exchanged views look like the third being exchanged."""
    cameras = ring(3)
    uv = observed(cameras, walker(80), 2.0)
    true = np.zeros((3, 80), bool)
    true[:2, 30:40] = True
    found = find_swaps(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33, FPS)
    assert (found == true).all()


def test_missing_instants_and_views_do_not_matter():
    cameras = ring(3)
    uv = observed(cameras, walker(60), 2.0)
    true = np.zeros((3, 60), bool)
    true[0, 10:50] = True
    uv = exchange(uv, true, MLKIT_33)
    uv[:, 25:28] = np.nan
    uv[2, 40:] = np.nan
    found = find_swaps(cameras, uv, np.isfinite(uv[..., 0]).astype(float), MLKIT_33, FPS)
    seen = np.ones(60, bool)
    seen[25:28] = False
    assert (found[:, seen] == true[:, seen]).all()


def test_nothing_to_exchange():
    cameras = ring(2)
    uv = observed(cameras, walker(5), 1.0)
    assert not find_swaps(cameras[:1], uv[:1], np.ones((1, 5, 33)), MLKIT_33, FPS).any()
    assert not find_swaps(cameras, uv[:, :, :1], np.ones((2, 5, 1)), MLKIT_33[:1], FPS).any()
    assert len(combinations(3)) == 8 and combinations(7).sum(axis=1).max() == 2


def test_legs_alone_are_exchanged_back():
    cameras = ring(3)
    uv = observed(cameras, walker(80), 2.0)
    legs = np.array([is_leg(name) for name in MLKIT_33])
    true = np.zeros((3, 80, 33), bool)
    true[1, 20:40] = legs & (swap_index(MLKIT_33) != np.arange(33))
    found = find_exchanged(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33, FPS)
    assert (found == true).all() and legs.sum() == 10


def test_legs_that_are_right_in_an_exchanged_body_are_left_as_they_are():
    cameras, legs = ring(3), np.array([is_leg(name) for name in MLKIT_33])
    uv = observed(cameras, walker(60), 2.0)
    true = np.zeros((3, 60, 33), bool)
    true[1, 20:40] = ~legs & (swap_index(MLKIT_33) != np.arange(33))
    found = find_exchanged(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33, FPS)
    assert (found == true).all()


def test_a_limb_that_two_views_take_for_the_other_is_left_out_in_both():
    cameras = ring(3)
    uv = observed(cameras, walker(60), 2.0)
    own, others = ([MLKIT_33.index(name) for name in side if name in MLKIT_33] for side in LIMBS[2])
    taken = uv.copy()
    taken[:2, 20:32, own] = observed(cameras, walker(60), 2.0, seed=9)[:2, 20:32, others]
    score, sigma = np.ones(uv.shape[:3]), np.full(uv.shape[:3], 2.0)
    found = find_mistaken_limbs(cameras, taken, score, sigma, MLKIT_33, FPS)
    assert found[:2, 20:32, own].all() and found.sum() == 2 * 12 * len(own)
    assert not find_mistaken_limbs(cameras, uv, score, sigma, MLKIT_33, FPS).any()


@pytest.mark.parametrize("others_agree", [True, False])
def test_two_views_are_mistaken_where_the_two_others_agree(others_agree):
    cameras = ring(4)
    uv = observed(cameras, walker(60), 2.0)
    own, others = ([MLKIT_33.index(name) for name in side if name in MLKIT_33] for side in LIMBS[2])
    taken = uv.copy()
    taken[:2, 20:32, own] = observed(cameras, walker(60), 2.0, seed=9)[:2, 20:32, others]
    if not others_agree:
        taken[2, 20:32, own, 1] -= 60
    score, sigma = np.ones(uv.shape[:3]), np.full(uv.shape[:3], 2.0)
    found = find_mistaken_limbs(cameras, taken, score, sigma, MLKIT_33, FPS)
    assert found[:2, 20:32, own].all() == others_agree


def test_the_cheapest_path_is_that_of_all_paths():
    """Costs of a change that depend on its direction, against every path."""
    random = np.random.default_rng(0)
    for _ in range(20):
        unary, change = random.random((3, 5)), 2 * random.random((4, 3, 3))
        paths = np.array(list(itertools.product(range(3), repeat=5)))
        cost = unary[paths, np.arange(5)].sum(axis=1) + change[np.arange(4), paths[:, 1:], paths[:, :-1]].sum(axis=1)
        assert (swaps.cheapest_path(unary, change) == paths[cost.argmin()]).all()


def test_a_joint_moves_from_where_it_was_in_the_state_before():
    points = np.zeros((2, 2, 1, 3))
    points[:, :, 0, 0] = [[0.0, 0.2], [0.3, 0.0]]
    # from 0 in state 0 to 0 in state 1 it is no way, from 0.3 in state 1 to 0.2 in state 0 it is 10 cm
    assert swaps._movement(points)[0] == pytest.approx(np.array([[2.0, 1.0], [0.0, 3.0]]))


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_a_disagreement_counts_by_the_time_it_lasts(fps):
    """Half a usual error more for 0.2 s is worth two changes, for 0.07 s it is not: whatever the rate."""
    t = np.arange(3 * fps) / fps
    errors = np.full((4, len(t), 1), 3.0)
    long, short = (t >= 1.0) & (t < 1.2 - 1e-9), (t >= 2.0) & (t < 2.0 + 1 / 15 - 1e-9)
    errors[0], errors[1] = 1.0, 2.0
    errors[0, long | short], errors[1, long | short] = 1.5, 1.0
    found = swaps._cheapest_path(errors, np.zeros((4, len(t), 1, 3)), combinations(2), fps)
    assert (found == long).all()


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_the_same_walk_has_the_same_swaps_at_every_rate(fps):
    cameras = ring(3)
    count = 3 * fps
    uv = observed(cameras, walker(count), 2.0)
    t = np.arange(count) / fps
    true = np.zeros((3, count), bool)
    true[1, (t > 0.61) & (t < 1.49)] = True
    true[2, (t > 2.01) & (t < 2.19)] = True
    found = find_swaps(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33, fps)
    assert (found == true).all()


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_a_fast_limb_has_not_jumped(fps):
    """4 m/s is a foot in its swing; pixels so uncertain that any limb lies on the other one."""
    cameras = ring(3, 12.0)
    points = walker(fps)
    points[..., 0] *= 2.0
    uv = observed(cameras, points, 0.0)
    assert not find_mistaken_limbs(
        cameras, uv, np.ones(uv.shape[:3]), np.full(uv.shape[:3], 200.0), MLKIT_33, fps
    ).any()


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_a_limb_taken_for_the_other_counts_by_the_time_it_lasts(fps):
    """Limbs 10 cm apart in pixels good to 33: 0.4 s tell that two views are wrong, 0.07 s do not, at any rate."""
    cameras = ring(3)
    own, others = ([MLKIT_33.index(name) for name in side if name in MLKIT_33] for side in LIMBS[2])
    t = np.arange(3 * fps) / fps
    long, short = (t >= 1.0) & (t < 1.4 - 1e-9), (t >= 2.0) & (t < 2.0 + 1 / 15 - 1e-9)
    uv = observed(cameras, walker(len(t)) * [1, 0.2, 1], 0.0)
    where = np.ix_([0, 1], np.flatnonzero(long | short), own)
    uv[where] = uv[np.ix_([0, 1], np.flatnonzero(long | short), others)]
    found = find_mistaken_limbs(cameras, uv, np.ones(uv.shape[:3]), np.full(uv.shape[:3], 33.0), MLKIT_33, fps)
    assert (found[:2, :, own] == long[:, None]).all() and not found[2].any()


def test_a_table_says_which_part_was_exchanged():
    table = {
        "camera": np.array(["cam01"] * 4 + ["cam02"] * 4, object),
        "swapped": np.array([True, True, True, False, False, False, False, True]),
        "part": np.array(["all", "legs", "rest", "", "", "", "", "rest"], object),
    }
    found = swaps.in_table(table, ["cam02", "cam01"], ["left_knee", "left_wrist"])
    assert found[1].tolist() == [[True, True], [True, False], [False, True], [False, False]]
    assert found[0].tolist() == [[False, False]] * 3 + [[False, True]]


def test_legs_that_hide_each_other_are_not_both_mistaken_where_the_third_view_is_off():
    """Two views along the walkway see one leg on the other; the third has both 40 px aside. One of two is right."""
    cameras = [scene.camera(f"cam{i}", azimuth, 8.0) for i, azimuth in enumerate((0, 175, 90))]
    walk = scene.make("ideal", 1, 150, cameras, "across")
    legs = [is_leg(name) for name in MLKIT_33]
    uv = walk.uv.copy()
    uv[2][:, legs, 0] += 40
    sigma = estimated(cameras, uv, walk.score, scene.FPS, walk.names).sigma
    found = find_mistaken_limbs(cameras, uv, walk.score, sigma, MLKIT_33, scene.FPS)
    assert found.any(axis=(0, 2)).mean() < 0.03
