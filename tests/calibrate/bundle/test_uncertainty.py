"""The cameras' covariance against many tries with known errors, and the clusters that it is made of."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import null_space

from dior.calibrate.bundle import adjustment, bundle, facts, reduced, uncertainty
from dior.calibrate.bundle.uncertainty import Tracks
from dior.geometry.camera import project
from tests.calibrate.bundle.test_facts import walker
from tests.calibrate.test_adjust import HUBER, MOST, tape
from tests.rig import ring


def tried(seed, noise_px=1.0, bias_m=0.0, tape_m=0.05):
    """Errors of the cameras over their sigmas (18,), and the `Uncertainty`; joints are off by `bias_m` per cluster."""
    random = np.random.default_rng(seed)
    points, tracks = walker(40)
    cameras = ring(3)
    placed = [
        c.at(np.block([[c.wRc, (c.centre + random.normal(0, tape_m, 3))[:, None]], [np.eye(4)[3:]]])) for c in cameras
    ]
    sides = uncertainty.sides(cameras, points, tracks)
    uv = []
    for camera, side in zip(cameras, sides, strict=True):
        seen, depth = project(camera, points)
        offset = random.normal(0, bias_m, (4, len(tracks.names), 2))[side, tracks.joint]
        uv.append(seen + camera.intrinsics.fx / depth[:, None] * offset + random.normal(0, noise_px, seen.shape))
    done = adjustment.adjust(placed, np.stack(uv), tape(placed, tape_m), HUBER, 30.0, "s", tracks, (), None, 0.0)
    error = np.concatenate(
        [
            np.r_[_turn(found.wRc.T @ c.wRc), c.centre - found.centre]
            for found, c in zip(done.cameras, cameras, strict=True)
        ]
    )
    return error / np.sqrt(np.diag(done.uncertainty.covariance)), done.uncertainty


def _turn(R):
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2


@pytest.mark.slow
def test_errors_are_as_large_as_the_sigmas_with_white_noise_and_with_habits():
    for bias in (0.0, 0.01):
        each, found = zip(*(tried(seed, 1.0, bias) for seed in range(12)), strict=True)
        assert 0.75 < np.sqrt(np.mean(np.square(each))) < 1.3
        estimated = np.mean([u.bias_m for u in found])
        assert estimated < 0.002 if not bias else 0.006 < estimated < 0.013


def test_habits_of_the_detector_widen_the_covariance():
    (_, plain), (_, biased) = tried(0, 1.0, 0.0, 0.01), tried(0, 1.0, 0.02, 0.01)
    turns = [np.trace(u.covariance[:3, :3]) for u in (plain, biased)]
    assert turns[1] > 2 * turns[0]
    assert np.allclose(biased.covariance, biased.covariance.T)
    assert np.linalg.eigvalsh(biased.covariance).min() > 0


def test_cameras_move_with_a_lens_that_is_wrong_as_the_covariance_says():
    """One camera's focal length is 0.2 % too long: poses and lens are off together."""
    points, tracks = walker(40)
    cameras = ring(3)
    uv = np.stack([project(c, points)[0] for c in cameras]) + np.random.default_rng(0).normal(0, 1, (3, len(points), 2))
    lens = cameras[1].intrinsics
    wrong = [*cameras]
    wrong[1] = replace(cameras[1], intrinsics=replace(lens, fx=lens.fx * 1.002, fy=lens.fy * 1.002))
    right, off = (
        adjustment.adjust(
            given, uv, tape(cameras, 0.05), HUBER, MOST, "s", tracks, (), None, np.array([0.0, 0.003, 0.003])
        )
        for given in (cameras, wrong)
    )
    moved = np.concatenate(
        [np.r_[_turn(a.wRc.T @ b.wRc), b.centre - a.centre] for a, b in zip(right.cameras, off.cameras, strict=True)]
    )
    known = right.uncertainty
    assert not known.lenses[:3].any() and not known.across[:, :3].any()
    by_lens = known.across[:, 3:] @ np.linalg.inv(known.lenses[3:, 3:])
    np.testing.assert_allclose(0.002 * by_lens[:, 0], moved, atol=0.15 * np.abs(moved).max())
    assert np.abs(moved).max() > 1e-3


def test_a_camera_in_front_sees_the_front():
    """The walker's left is +y, so that it faces +x."""
    points, tracks = walker(2)
    cameras = ring(1)
    for azimuth, side in ((0, 0), (90, 1), (180, 2), (270, 3)):
        a = np.radians(azimuth)
        at = np.array([50 * np.cos(a), 50 * np.sin(a), 1.5])
        camera = cameras[0].at(np.block([[cameras[0].wRc, at[:, None]], [np.eye(4)[3:]]]))
        assert (uncertainty.sides([camera], points, tracks) == side).all()


def test_how_long_noise_lasts():
    random = np.random.default_rng(0)
    keep, count = 0.6, 3000
    noise = random.normal(size=(count, 2))
    for i in range(1, count):
        noise[i] = keep * noise[i - 1] + np.sqrt(1 - keep**2) * noise[i]
    tracks = Tracks(np.zeros(count, int), np.arange(count), np.zeros(count, int), ("nose",))
    shape = np.ones((1, count), bool), np.zeros((1, count), int)
    lasting = uncertainty.autocorrelation_sum(noise[None], *shape, tracks)
    assert abs(lasting - (1 + keep) / (1 - keep)) < 0.8
    white = random.normal(size=(1, count, 2))
    assert uncertainty.autocorrelation_sum(white, *shape, tracks) < 1.2


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_how_long_noise_lasts_is_a_matter_of_seconds(fps):
    """Noise with a time constant of 0.3 s makes one measurement of 0.6 s, however many pictures these have."""
    from scipy.signal import lfilter

    keep, count = np.exp(-1 / (0.3 * fps)), 400 * fps
    noise = lfilter([1.0], [1.0, -keep], np.random.default_rng(1).normal(size=(count, 2)), axis=0)
    tracks = Tracks(np.zeros(count, int), np.arange(count), np.zeros(count, int), ("nose",), 1 / fps)
    lasting = uncertainty.autocorrelation_sum(noise[None], np.ones((1, count), bool), np.zeros((1, count), int), tracks)
    assert lasting / fps == pytest.approx(0.6, rel=0.15)


def test_the_scale_of_a_rig_held_by_its_tape():
    """Centres that are each known to 5 cm: the scale to 5 cm over the root of the sum of squared distances."""
    cameras = ring(3)
    C = np.kron(np.eye(3), np.diag([1e-6] * 3 + [0.05**2] * 3))
    assert np.isclose(uncertainty.scale_sigma(cameras, C), 0.05 / np.sqrt(3 * 5**2))


def test_a_known_length_narrows_the_scale():
    points, tracks = walker(40)
    cameras = ring(3)
    uv = np.stack([project(c, points)[0] for c in cameras]) + np.random.default_rng(0).normal(0, 1, (3, len(points), 2))
    sigma = []
    for known in ([], [facts.KeypointDistance(("left_shoulder", "left_ankle"), 0.779 * 1.75, 0.005)]):
        done = adjustment.adjust(cameras, uv, tape(cameras, 0.1), HUBER, MOST, "s", tracks, known, None, 0.0)
        sigma.append(uncertainty.scale_sigma(done.cameras, done.uncertainty.covariance))
    assert sigma[0] > 0.009 and abs(sigma[1] - 0.005 / (0.779 * 1.75)) < 0.001


def known(seed, noise_px=1.0, keep=0.0, bias_m=0.0):
    """Errors over their sigmas (11,) of what no motion and scale of the world does, and the `Uncertainty`.

    The noise of a pixel is autoregressive over time by `keep`; each cluster (joint, side) in a camera has an offset of
    its own. Detections are assumed to be right to 2 px.
    """
    random = np.random.default_rng(seed)
    points, tracks = walker(60)
    cameras, moments, joints = ring(3), 60, len(tracks.names)
    sides = uncertainty.sides(cameras, points, tracks)
    noise = random.normal(0, noise_px, (moments, 3, joints, 2))
    for t in range(1, moments):
        noise[t] = keep * noise[t - 1] + np.sqrt(1 - keep**2) * noise[t]
    uv = []
    for v, (camera, side) in enumerate(zip(cameras, sides, strict=True)):
        seen, depth = project(camera, points)
        offset = random.normal(0, bias_m, (4, joints, 2))[side, tracks.joint]
        seen = seen + camera.intrinsics.fx / depth[:, None] * offset + noise[:, v].reshape(-1, 2)
        uv.append(bundle.ideal_pixels(camera.intrinsics, seen))
    priors = [bundle.Prior(c.centre + random.normal(0, 0.05, 3), 0.05, c.wRc, 3.0) for c in cameras]
    stated = [facts.placed(v, prior) for v, prior in enumerate(priors)]
    observed = reduced.Observed(np.stack(uv), np.full((3, len(points)), 2.0), len(points))
    solved = reduced.solve(cameras, observed, points, stated)
    found = uncertainty.of(solved, tracks)
    error = [
        np.r_[_turn(one.wRc.T @ c.wRc), c.centre - one.centre] for one, c in zip(solved.cameras, cameras, strict=True)
    ]
    free = null_space(uncertainty.gauge(solved.cameras).T)
    values, axes = np.linalg.eigh(free.T @ found.covariance @ free)
    return axes.T @ free.T @ np.concatenate(error) / np.sqrt(values), found


def mean(found, key):
    return np.mean([getattr(one, key) for one in found])


def test_the_variances_of_noise_and_of_offsets_are_those_that_the_pixels_were_made_with():
    _, found = zip(*(known(seed, 1.0, 0.0, 0.01) for seed in range(6)), strict=True)
    assert mean(found, "bias_m") == pytest.approx(0.01, abs=0.0006)
    assert mean(found, "noise") == pytest.approx(1 / 2**2, rel=0.1)
    # the offsets are no noise that lasts, except for what a point of two sides' offsets keeps of them
    assert mean(found, "autocorrelation_time") < 2


def test_noise_that_lasts_is_not_taken_for_offsets_and_widens_the_covariance():
    errors, found = zip(*(known(seed, 1.0, 0.6, 0.0) for seed in range(10)), strict=True)
    # 1 + 2 sum of 0.6^k is 4; of some of the lags nothing is left in residuals that the points have fitted
    assert 2.5 < mean(found, "autocorrelation_time") < 4.5
    assert mean(found, "bias_m") < 0.0015
    assert 0.8 < np.sqrt(np.mean(np.square(errors))) < 1.05


def test_intrinsics_that_are_not_sure_widen_the_covariance():
    points, tracks = walker(20)
    cameras = ring(3)
    uv = np.stack([bundle.ideal_pixels(c.intrinsics, project(c, points)[0]) for c in cameras])
    uv = uv + np.random.default_rng(2).normal(0, 1.0, uv.shape)
    stated = [facts.placed(v, bundle.Prior(c.centre, 0.005, c.wRc, 0.5)) for v, c in enumerate(cameras)]
    observed = reduced.Observed(uv, np.full(uv.shape[:2], 2.0), len(points))
    solved = reduced.solve(cameras, observed, points, stated)
    sure, unsure = (uncertainty.of(solved, tracks, sigma).covariance for sigma in (0.0, 0.01))
    assert np.linalg.eigvalsh(unsure - sure).min() > -1e-6 * np.trace(sure)
    # a principal point that is off by a hundredth of the focal length turns the camera by as much
    assert np.sqrt(np.diagonal(unsure)[[0, 1]]).min() > 2 * np.sqrt(np.diagonal(sure)[[0, 1]]).max()
