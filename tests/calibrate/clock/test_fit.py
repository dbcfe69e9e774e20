import numpy as np
import pytest

from dior.calibrate.clock import fit


def tracks(late_s=0.0, offset_px=0.0, noise_px=0.0, seed=0, count=400, joints=6):
    """Joints that swing at rates of their own, seen `late_s` too late, each off by a constant."""
    random = np.random.default_rng(seed)
    t = np.arange(count) / 30
    rate, phase = random.uniform(4, 8, joints), random.uniform(0, 6, joints)

    def path(t):
        return 60 * np.sin(rate[:, None] * t + phase[:, None])

    speed = 60 * rate[:, None] * np.cos(rate[:, None] * t + phase[:, None])
    u = path(t) - path(t - late_s) + offset_px * random.standard_normal((joints, 1))
    residual = np.stack([u, 0 * u], axis=-1) + noise_px * random.standard_normal((joints, count, 2))
    by_clock = np.zeros((joints, count, 2, 2))
    by_clock[..., 0, 0], by_clock[..., 0, 1] = speed, speed * 1e-6 * (t - t.mean())
    by_camera = np.zeros((joints, count, 2, 6))
    by_camera[..., 0, 0] = 600.0
    basis = fit.constants(np.full((joints, count), 5.0), np.zeros((joints, count), int))
    index = np.arange(joints)
    return fit.ResidualTracks(residual, by_clock, by_camera, basis, None, index, index, t)


PRIOR = np.array([0.0, 1 / 50.0**2])


def test_a_lag_is_found_whatever_the_detectors_constants():
    solved = fit.solve(tracks(0.002, offset_px=20.0), np.zeros(2), PRIOR)
    assert solved.step[0] == pytest.approx(-0.002, abs=2e-5)
    # a turn of the camera is such a constant, so it does not pass for time
    assert np.abs(solved.gain[0]).max() < 1e-6


def test_the_stated_error_is_the_real_one():
    solved = [fit.solve(tracks(noise_px=3.0, offset_px=5.0, seed=s), np.zeros(2), PRIOR) for s in range(60)]
    z = [one.step[0] / np.sqrt(one.given[0, 0]) for one in solved]
    # cautious with six joints, whose scatter is badly known
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert all(one.given[1, 1] <= 50.0**2 * 1.0001 for one in solved)


def test_exchanged_sides_for_a_while_do_not_move_the_time():
    hit = tracks(noise_px=1.0)
    hit.residual[0, 100:140] += 80.0
    hit.residual[3, 200:230] -= 60.0
    solved = fit.solve(hit, np.zeros(2), PRIOR)
    assert abs(solved.step[0]) < 4 * np.sqrt(solved.given[0, 0]) < 0.002


def test_nothing_is_said_without_data():
    empty = tracks()
    empty.residual[:] = np.nan
    assert fit.solve(empty, np.zeros(2), PRIOR) is None


def test_noise_that_lasts_is_whitened():
    random = np.random.default_rng(1)
    x = np.zeros((40, 2000, 2))
    for i in range(1, 2000):
        x[:, i] = 0.8 * x[:, i - 1] + random.standard_normal((40, 2))
    every = np.ones(1999, bool)
    keep = fit.correlation(x, np.ones(x.shape[:2]), every, 1 / 30)
    assert keep == pytest.approx(0.8, abs=0.02)
    y, _ = fit.whitened(x[..., None], np.ones(x.shape[:2]), every, keep)
    assert fit.correlation(y[..., 0], np.ones(y.shape[:2]), every[1:], 1 / 30) < 0.05
