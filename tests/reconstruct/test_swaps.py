import numpy as np

from dior.body.names import LIMBS, MLKIT_33, is_leg, swap_index
from dior.geometry import camera as cam
from dior.reconstruct.swaps import combinations, exchange, find_exchanged, find_swaps, find_taken
from tests.rig import ring


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
    found = find_swaps(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33)
    assert (found == true).all()


def test_two_of_three_views_exchanged_together_are_told_by_continuity():
    """In one picture two exchanged views look like the third being exchanged."""
    cameras = ring(3)
    uv = observed(cameras, walker(80), 2.0)
    true = np.zeros((3, 80), bool)
    true[:2, 30:40] = True
    found = find_swaps(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33)
    assert (found == true).all()


def test_missing_instants_and_views_do_not_matter():
    cameras = ring(3)
    uv = observed(cameras, walker(60), 2.0)
    true = np.zeros((3, 60), bool)
    true[0, 10:50] = True
    uv = exchange(uv, true, MLKIT_33)
    uv[:, 25:28] = np.nan
    uv[2, 40:] = np.nan
    found = find_swaps(cameras, uv, np.isfinite(uv[..., 0]).astype(float), MLKIT_33)
    seen = np.ones(60, bool)
    seen[25:28] = False
    assert (found[:, seen] == true[:, seen]).all()


def test_nothing_to_exchange():
    cameras = ring(2)
    uv = observed(cameras, walker(5), 1.0)
    assert not find_swaps(cameras[:1], uv[:1], np.ones((1, 5, 33)), MLKIT_33).any()
    assert not find_swaps(cameras, uv[:, :, :1], np.ones((2, 5, 1)), MLKIT_33[:1]).any()
    assert len(combinations(3)) == 8 and combinations(7).sum(axis=1).max() == 2


def test_legs_alone_are_exchanged_back():
    cameras = ring(3)
    uv = observed(cameras, walker(80), 2.0)
    legs = np.array([is_leg(name) for name in MLKIT_33])
    true = np.zeros((3, 80, 33), bool)
    true[1, 20:40] = legs & (swap_index(MLKIT_33) != np.arange(33))
    found = find_exchanged(cameras, exchange(uv, true, MLKIT_33), np.ones(uv.shape[:3]), MLKIT_33)
    assert (found == true).all() and legs.sum() == 10


def test_a_limb_that_two_views_take_for_the_other_is_left_out_in_both():
    cameras = ring(3)
    uv = observed(cameras, walker(60), 2.0)
    own, others = ([MLKIT_33.index(name) for name in side if name in MLKIT_33] for side in LIMBS[2])
    taken = uv.copy()
    taken[:2, 20:32, own] = observed(cameras, walker(60), 2.0, seed=9)[:2, 20:32, others]
    score, sigma = np.ones(uv.shape[:3]), np.full((3, 33), 2.0)
    found = find_taken(cameras, taken, score, sigma, MLKIT_33)
    assert found[:2, 20:32, own].all() and found.sum() == 2 * 12 * len(own)
    assert not find_taken(cameras, uv, score, sigma, MLKIT_33).any()
