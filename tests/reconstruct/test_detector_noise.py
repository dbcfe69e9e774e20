"""How far off a detector is: shares of the body and pixels, known in advance."""

import numpy as np
import pytest

from benchmarks import scene
from dior.geometry.covariance import moved
from dior.geometry.triangulation import meet, residuals, rig_of, views_of
from dior.reconstruct import detector_noise, robust
from dior.reconstruct.detector_noise import USUAL, Squares, estimated, fitted
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import camera, ring

FPS = 30.0
SHARE, PX = 0.01, 1.5


def fit(random, count, sizes, parts, hidden=None):
    """Shares and pixels by squared residuals of 3 views of `count` points of 2 joints, in turns."""
    size = random.uniform(*sizes, (3, count)) if len(sizes) == 2 else np.full((3, count), sizes[0])
    hidden = np.zeros((3, count), bool) if hidden is None else hidden
    joint, free, found = np.arange(count) % 2, np.ones((3, count)), np.tile(USUAL, (2, 2, 1))
    square = variance_of(parts, joint, size, hidden) * random.chisquare(1, (3, count))
    for _ in range(detector_noise.HIDDEN_ROUNDS):
        taken = variance_of(found, joint, size, hidden)
        found = fitted(Squares(joint, size, hidden, taken, square / taken, free), np.array(USUAL), 2)
    return found


def variance_of(parts, joint, size, hidden):
    each = parts[joint, hidden.astype(int)]
    return (each[..., 0] * size) ** 2 + each[..., 1] ** 2


def sd(parts, size):
    return np.hypot(parts[..., 0] * size, parts[..., 1])


def test_shares_and_pixels_are_told_apart_by_people_of_20_to_600_px():
    true = np.array([[[0.01, 1.5], [0.03, 2.0]], [[0.015, 2.0], [0.03, 2.0]]])
    random = np.random.default_rng(0)
    hidden = random.random((3, 20000)) < 0.3
    found = fit(random, 20000, (20, 600), true, hidden)
    assert found == pytest.approx(true, rel=0.1)
    for size in (20, 100, 300, 600):
        assert sd(found, size) == pytest.approx(sd(true, size), rel=0.08)


@pytest.mark.parametrize("size", [22.0, 250.0, 700.0])
def test_people_of_one_size_tell_the_sum_and_its_parts_are_the_usual_ones(size):
    true = np.broadcast_to([0.0, 4.0], (2, 2, 2))
    found = fit(np.random.default_rng(1), 20000, (size,), true)
    assert sd(found[:, 0], size) == pytest.approx(4.0, rel=0.03)
    # the usual parts, as far as their own sizes let them be
    assert (found[:, 0] >= 0).all() and np.ptp(found[:, 0, 0]) < 0.002
    assert (found[:, 0, 0] > 0).all() if size > 50 else (found[:, 0, 1] > 2).all()


def test_what_is_hidden_counts_as_what_is_seen_until_residuals_say_otherwise():
    true = np.broadcast_to([[0.0, 2.0], [0.0, 6.0]], (2, 2, 2))
    random = np.random.default_rng(2)
    for share, low, high in ((0.0, 0.99, 1.01), (0.002, 1.0, 1.8), (0.5, 2.7, 3.2)):
        hidden = random.random((3, 4000)) < share
        found = fit(random, 4000, (100, 400), true, hidden)
        assert low <= (sd(found[:, 1], 250) / sd(found[:, 0], 250)).mean() <= high


def test_without_residuals_it_is_the_usual_noise():
    assert fit(np.random.default_rng(3), 0, (100, 400), np.ones((2, 2, 2))) == pytest.approx(np.tile(USUAL, (2, 2, 1)))
    uv = np.full((2, 3, 33, 2), np.nan)
    assert np.isnan(estimated(ring(2), uv, np.zeros(uv.shape[:3]), FPS).sigma).all()


def away(count):
    """Three cameras in a row and somebody who walks away from them, from 2 to 60 m: 540 to 18 px tall."""
    cameras = [camera(f"cam{i:02d}", (x, 0.0, 1.5), target=(0, 20, 1.5)) for i, x in enumerate((-2.0, 0.0, 2.0))]
    points = walker(1) * [1, 1, 1] + np.geomspace(3.0, 60.0, count)[:, None, None] * [0, 1, 0]
    return cameras, points


def test_a_walk_from_near_to_far_tells_both():
    cameras, points = away(400)
    uv, random = observed(cameras, points, 0.0), np.random.default_rng(4)
    noise = detector_noise.bodies(cameras, uv, np.ones(uv.shape[:3]), FPS)[0]
    assert noise.max() > 350 and noise.min() < 20
    true = np.hypot(SHARE * noise, PX)
    uv = uv + true[..., None, None] * random.normal(size=uv.shape)
    found = estimated(cameras, uv, np.ones(uv.shape[:3]), FPS)
    assert found.parts[:, 0].mean(axis=0) == pytest.approx([SHARE, PX], rel=0.1)
    assert found.sigma.mean(axis=2) == pytest.approx(true, rel=0.06)
    assert found.by_size.mean(axis=2) == pytest.approx(1 - (PX / true) ** 2, abs=0.1)


def test_noise_is_what_was_added_though_residuals_are_smaller():
    cameras, points = ring(3), walker(400)
    uv = observed(cameras, points, 2.0)
    sigma = estimated(cameras, uv, np.ones(uv.shape[:3]), FPS).sigma
    assert sigma.shape == uv.shape[:3] and sigma.mean() == pytest.approx(2.0, rel=0.03)
    # a score of a half is twice the noise
    half = estimated(cameras, uv, np.full(uv.shape[:3], 0.5), FPS).sigma
    assert np.allclose(half, sigma / 2, rtol=0.01)


def test_a_view_that_is_worse_is_told():
    cameras, points = ring(3), walker(400)
    uv, exact = observed(cameras, points, 2.0), observed(cameras, points, 0.0)
    uv[1] += uv[1] - exact[1]
    sigma = estimated(cameras, uv, np.ones(uv.shape[:3]), FPS).sigma.mean(axis=(1, 2))
    assert sigma == pytest.approx([2.0, 4.0, 2.0], rel=0.12)


def test_errors_of_poses_are_no_noise_of_the_detections():
    """They are in the cameras' own covariance; here three times the noise's variance, of which half is left at most."""
    cameras, points = ring(3), walker(200)
    uv, random = observed(cameras, points, 2.0), np.random.default_rng(8)
    own = []
    for off in (0.0, 1.0):
        steps = off * random.normal(size=(3, 6)) * np.array([np.radians(0.4)] * 3 + [0.02] * 3)
        found = estimated([moved(c, s) for c, s in zip(cameras, steps, strict=True)], uv, np.ones(uv.shape[:3]), FPS)
        whole = (found.sigma**2).mean(axis=(1, 2))
        own.append(((found.own * whole).mean(), whole.mean()))
    assert own[0] == pytest.approx((4.0, 4.0), rel=0.06)
    assert own[1][1] > 12 and own[1][0] < 0.5 * own[1][1]


def test_poses_that_were_fitted_to_the_detections_took_their_share_of_the_residuals():
    """With constant offsets an adjustment takes a good part; the noise is told as large as it was."""
    cameras, points = ring(3), walker(12)
    exact, random = observed(cameras, points, 0.0), np.random.default_rng(9)
    told, left_over = [], []
    for _ in range(20):
        uv = exact + 2.0 * random.normal(size=(3, 1, 33, 2)) + 0.2 * random.normal(size=exact.shape)
        views = views_of(rig_of(cameras), uv, np.full(uv.shape[:3], 0.5))
        where, _ = meet(views)
        left, free = residuals(views, where)
        after, taken = detector_noise.without_poses(views, where, left)
        assert 8 < taken <= 3 * 6 - 6.9
        left_over.append((after**2).sum() / (left**2).sum())
        own = detector_noise._own(views, where, left, free / 12, 1 / 12)
        told.append(own.mean())
    assert np.mean(left_over) < 0.95
    assert np.mean(told) == pytest.approx(1.0, abs=0.03)


def test_neighbours_in_time_say_little_new_of_a_joints_own_noise():
    """At 3 instants a second each residual counts; at 30 they are correlated, and the joint is more like the rest."""
    cameras, points = ring(3), walker(60)
    uv = observed(cameras, points, 2.0)
    uv[:, :, 7] += 2 * (uv[:, :, 7] - observed(cameras, points, 0.0)[:, :, 7])
    fast, slow = (estimated(cameras, uv, np.ones(uv.shape[:3]), fps).sigma for fps in (30.0, 3.0))
    own, rest = slow[:, :, 7].mean(), np.delete(slow, 7, axis=2).mean()
    assert own > 2 * rest
    assert fast[:, :, 7].mean() - rest < 0.7 * (own - rest)


def test_a_constant_offset_is_one_measurement_however_long_it_is_looked_at():
    """Joints whose offsets are of one kind get alike sigmas, though each has other residuals throughout."""
    cameras, points = ring(3), walker(300)
    random = np.random.default_rng(6)
    exact = observed(cameras, points, 0.0)
    lasting = exact + 3.0 * random.normal(size=(3, 1, 33, 2)) + 0.3 * random.normal(size=exact.shape)
    sigma = estimated(cameras, lasting, np.ones(exact.shape[:3]), FPS).sigma.mean(axis=(0, 1))
    assert sigma.std() / sigma.mean() < 0.08 and sigma.mean() == pytest.approx(3.0, rel=0.2)


@pytest.mark.parametrize("views", [2, 3])
def test_one_detection_in_twenty_that_is_wrong_hardly_moves_the_noise(views):
    cameras, random = ring(4)[:views], np.random.default_rng(0)
    uv = observed(cameras, walker(300), 2.0)
    hit = random.random(uv.shape[:3]) < 0.05
    uv[hit] += random.normal(0, 20.0, (hit.sum(), 2))
    assert estimated(cameras, uv, np.ones(uv.shape[:3]), FPS).sigma.mean() == pytest.approx(2.0, rel=0.15)


def test_the_size_is_the_bodys_and_what_it_hides_is_hidden():
    walk = scene.make("ideal", 0, 60)
    score = np.ones(walk.uv.shape[:3])
    size, hidden = detector_noise.bodies(walk.cameras, walk.uv, score, scene.FPS, walk.names)
    depth = [(np.median(walk.points, axis=1) - c.centre) @ c.wRc[:, 2] for c in walk.cameras]
    assert size == pytest.approx(scene.FX * walk.height_m / np.array(depth), rel=0.05)
    assert (hidden == (walk.status == "occluded")).mean() > 0.85 and hidden.any()


def test_hidden_joints_that_are_guessed_get_more():
    walk = scene.make("ideal", 0, 240)
    score, random = np.ones(walk.uv.shape[:3]), np.random.default_rng(5)
    hidden = detector_noise.bodies(walk.cameras, walk.true_uv, score, scene.FPS, walk.names)[1]
    uv = walk.uv + np.where(hidden[..., None], 7.0, 0.0) * random.normal(size=walk.uv.shape)
    found = estimated(walk.cameras, uv, score, scene.FPS, walk.names)
    seen, guessed = (np.sqrt((found.sigma[found.hidden == what] ** 2).mean()) for what in (False, True))
    true = [np.sqrt(((uv - walk.true_uv)[found.hidden == what] ** 2).mean()) for what in (False, True)]
    assert seen == pytest.approx(true[0], rel=0.15) and 0.7 * true[1] < guessed < 1.1 * true[1]
    assert not estimated(walk.cameras, uv, score, scene.FPS).hidden.any()


def test_shares_that_last_and_pixels_that_do_not_are_told_apart():
    """A learned offset grows with the body, noise of the picture does not: what is constant is more for near people."""
    cameras, points = away(600)
    random = np.random.default_rng(7)
    uv = observed(cameras, points, 0.0)
    size = detector_noise.bodies(cameras, uv, np.ones(uv.shape[:3]), FPS)[0][..., None, None]
    uv = uv + 0.02 * size * random.normal(size=(3, 1, 33, 2)) + 1.5 * random.normal(size=uv.shape)
    noise = estimated(cameras, uv, np.ones(uv.shape[:3]), FPS)
    found = robust.triangulate(cameras, uv, np.ones(uv.shape[:3]), FPS, noise.sigma)
    stays = robust.error_correlation(cameras, uv, np.ones(uv.shape[:3]), found, FPS, noise)[1].mean(axis=1)
    true = ((0.02 * size) ** 2 / ((0.02 * size) ** 2 + 1.5**2)).mean(axis=(0, 2, 3))
    assert stays[:50].mean() == pytest.approx(true[:50].mean(), abs=0.12)
    assert stays[-50:].mean() == pytest.approx(true[-50:].mean(), abs=0.12)
