"""Points of views of which some are wrong, and how well they are known."""

import numpy as np
import pytest

from dior.body.names import MLKIT_33, swap_index
from dior.geometry.triangulation import rig_of
from dior.reconstruct import robust
from dior.reconstruct.swaps import exchange
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import ring

FPS = 30.0


def test_exact_pixels_give_the_exact_points():
    cameras, points = ring(3), walker(6)
    uv = observed(cameras, points, 0.0)
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), FPS)
    assert found.points == pytest.approx(points, abs=1e-7)
    assert found.used.all() and found.residual.max() < 1e-6


def test_the_wrong_view_is_left_out_even_where_its_error_lies_along_the_epipolar_line():
    """Between two of three cameras of one height a horizontal error hides; the neighbours in time tell."""
    cameras, points = ring(3), walker(60)
    uv = observed(cameras, points, 2.0)
    random = np.random.default_rng(3)
    hit = random.random(points.shape[:2]) < 0.05
    view = random.integers(3, size=hit.shape)
    for v in range(3):
        uv[v, hit & (view == v), 0] += 60
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), FPS)
    right = (np.arange(3)[:, None, None] != view)[:, hit]
    alone = np.stack(
        [
            robust.triangulate(cameras, uv[:, [t]], np.ones((3, 1, 33)), FPS, found.sigma[:, [t]]).used[:, 0]
            for t in range(60)
        ],
        axis=1,
    )
    chosen, guessed = ((used[:, hit] == right).all(axis=0).mean() for used in (found.used, alone))
    assert chosen > 0.97 and guessed < 0.9
    assert found.used[:, ~hit].mean() > 0.999
    assert np.linalg.norm(found.points - points, axis=-1)[hit].mean() < 0.05


def test_of_four_views_two_may_be_wrong():
    cameras, points = ring(4), walker(40)
    uv = observed(cameras, points, 1.0)
    uv[1, 10, 5] += [70, 40]
    uv[3, 10, 5] += [-20, 90]
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), FPS)
    assert found.used[:, 10, 5].tolist() == [True, False, True, False]


def test_a_missing_view_and_a_score_of_zero_have_no_say():
    cameras, points = ring(3), walker(8)
    uv, score = observed(cameras, points, 0.0), np.ones((3, 8, 33))
    uv[0, 2, 3] = np.nan
    uv[1, 4, 5] += 200
    score[1, 4, 5] = 0.0
    score[1:, 6, 7] = 0.0
    found = robust.triangulate(cameras, uv, score, FPS)
    assert found.used[:, 2, 3].tolist() == [False, True, True]
    assert found.points[4, 5] == pytest.approx(points[4, 5], abs=1e-7)
    assert np.isnan(found.points[6, 7]).all()


def test_covariance_is_that_of_many_tries():
    cameras, point = ring(3), np.array([[[0.2, -0.3, 1.1]]])
    repeated = np.broadcast_to(point, (4000, 1, 3))
    uv = observed(cameras, repeated, 2.0)
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), FPS, np.full((3, 4000, 1), 2.0))
    C = robust.covariance(cameras, point, np.full((3, 1, 1), 0.5))[0, 0]
    tried = np.cov((found.points - point)[:, 0].T)
    assert tried == pytest.approx(C, abs=0.06 * np.trace(C))
    own = robust.covariance(cameras, point, np.full((3, 1, 1), 0.5), np.full(3, 0.25))[0, 0]
    assert own == pytest.approx(C / 4)
    # the first view takes no part of what is its pose's alone
    less = robust.covariance(cameras, point, np.full((3, 1, 1), 0.5), np.array([0.0, 1.0, 1.0]))[0, 0]
    assert 0.3 * np.trace(C) < np.trace(less) < np.trace(C)
    two = robust.covariance(cameras, point, np.array([0.5, 0.5, 0.0])[:, None, None])[0, 0]
    assert np.trace(two) > np.trace(C)
    assert np.isnan(robust.covariance(cameras, point, np.array([0.5, 0, 0])[:, None, None])).all()


@pytest.mark.parametrize(("time_s", "stays"), [(0.0, 0.0), (0.15, 0.0), (0.15, 0.3)])
def test_persistence_is_read_from_the_residuals(time_s, stays):
    cameras, points = ring(3), walker(900)
    uv = observed(cameras, points, 0.0)
    random = np.random.default_rng(5)
    keep = np.exp(-1 / (FPS * time_s)) if time_s else 0.0
    noise = random.normal(size=uv.shape)
    for t in range(1, 900):
        noise[:, t] = keep * noise[:, t - 1] + np.sqrt(1 - keep**2) * noise[:, t]
    noise = np.sqrt(1 - stays) * noise + np.sqrt(stays) * random.normal(size=(3, 1, 33, 2))
    uv = uv + 2 * noise
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), FPS)
    told = robust.error_correlation(cameras, uv, np.ones(uv.shape[:3]), found, FPS)
    assert told[0] == pytest.approx(time_s, abs=0.04)
    assert told[1].shape == uv.shape[1:3] and told[1].mean() == pytest.approx(stays, abs=0.08)
    assert len(MLKIT_33) == uv.shape[2]


def test_a_view_of_somebody_else_is_left_out_as_a_whole_and_exchanged_sides_are_not():
    cameras, points = ring(3), walker(60)
    uv = observed(cameras, points, 2.0)
    uv[1, 20:30] = observed(cameras, points * [1, 1, 0.75] + [0.9, 0.7, 0.0], 2.0)[1, 20:30]
    exchanged = np.zeros((3, 60), bool)
    exchanged[2, 40:50] = True
    uv = exchange(uv, exchanged, MLKIT_33)
    other = robust.strangers(cameras, uv, np.ones(uv.shape[:3]), FPS, swap_index(MLKIT_33))
    assert other[1, 20:30].all() and other.sum() == 10


def test_a_joint_is_predicted_on_the_line_between_the_good_instants_around_it():
    points, good = np.zeros((3, 40, 1)), np.ones((40, 1), bool)
    points[0, :, 0] = np.arange(40.0)
    points[1, ::2, 0] = 0.01
    good[11:13] = good[20:] = False
    points[0, 11:13, 0] = 100.0
    expected, spread = robust.predicted(points, good, np.array([11, 12, 20]), FPS)
    assert expected[0, :2] == pytest.approx([11, 12]) and np.isnan(expected[:, 2]).all()
    assert np.isfinite(spread[:2]).all() and np.isnan(spread[2])


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_a_joint_is_predicted_from_a_fifth_of_a_second_on_either_side(fps):
    reach, count = fps // 5, 2 * fps
    points, good = np.zeros((3, count, 1)), np.ones((count, 1), bool)
    points[0, :, 0] = np.arange(count)
    points[1, ::2, 0] = 0.01
    for before, there in ((reach, True), (reach + 1, False)):
        some = good.copy()
        some[fps - before + 1 : fps + 1] = False
        expected, _ = robust.predicted(points, some, np.array([fps]), float(fps))
        assert np.isfinite(expected).all() == there and (not there or expected[0, 0] == pytest.approx(fps))


@pytest.mark.parametrize("fps", [15, 60])
def test_how_long_errors_last_is_a_time_at_any_rate(fps):
    cameras, points = ring(3), np.repeat(walker(1)[:, :8], 40 * fps, axis=0)
    uv, keep = observed(cameras, points, 0.0), np.exp(-1 / (fps * 0.15))
    noise = np.random.default_rng(5).normal(size=uv.shape)
    for t in range(1, uv.shape[1]):
        noise[:, t] = keep * noise[:, t - 1] + np.sqrt(1 - keep**2) * noise[:, t]
    uv = uv + 2 * noise
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), fps, np.full(uv.shape[:3], 2.0))
    assert robust.error_correlation(cameras, uv, np.ones(uv.shape[:3]), found, fps)[0] == pytest.approx(0.15, abs=0.04)


@pytest.mark.parametrize("views", [3, 4])
def test_a_person_is_strange_from_the_disagreement_per_equation_to_spare(views):
    """Each view has two equations, a point three unknowns."""
    used = np.ones((views, robust.FEW_JOINTS), bool)
    limit = robust.DROP_FACTOR**2 * (2 * views - 3)
    for chi2, strange in ((0.99 * limit, []), (1.01 * limit, [0])):
        shape = (1, robust.FEW_JOINTS)
        assert robust._strange(np.full(robust.FEW_JOINTS, chi2), used, shape).tolist() == strange


def test_those_left_agree_up_to_a_disagreement_per_equation_to_spare():
    """Of four views one is far off, and another as far as three views may disagree, or a little farther."""
    cameras, points, ones = ring(4), walker(1), np.ones((4, 1, 33))
    uv = observed(cameras, points, 0.0)
    moved = uv + np.array([0, 0, 1, 0])[:, None, None, None] * [0, 1]
    chi2 = robust.with_every_view(rig_of(cameras[1:]), moved[1:], ones[1:])[1].reshape(33)
    limit = robust.DROP_FACTOR * np.sqrt(3 / chi2)
    for factor, left in ((0.97, 3), (1.03, 2)):
        moved = uv.copy()
        moved[0] += [150, 90]
        moved[2, 0, :, 1] += factor * limit
        used = robust.triangulate(cameras, moved, ones, FPS, ones).used
        assert (used.sum(axis=0) == left).all(), factor


def test_at_a_few_pictures_a_second_the_next_one_alone_predicts():
    points, good = np.zeros((3, 12, 1)), np.ones((12, 1), bool)
    points[0, :, 0], points[1, ::2, 0] = np.arange(12), 0.01
    good[5] = False
    assert np.isfinite(robust.predicted(points, good, np.array([5]), 3.0)[0]).all()
    good[6] = False
    assert np.isnan(robust.predicted(points, good, np.array([5]), 3.0)[0]).all()
