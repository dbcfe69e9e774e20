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


@pytest.mark.parametrize("hz", [15, 30, 60, 120])
def test_what_takes_part_is_a_time_and_no_number_of_pictures(hz):
    short, long = np.arange(20 * hz) / hz, np.arange(200 * hz) / hz
    assert np.diff(short[fit.runs(short, 80.0, 3)]).max() < 1.01 / min(hz, 30)
    taken = long[fit.runs(long, 80.0, 3)]
    gaps = np.flatnonzero(np.diff(taken) > 1.0)
    assert len(gaps) == 2 and len(taken) / min(hz, 30) == pytest.approx(80.0, abs=0.3)
    assert taken[0] == 0.0 and taken[-1] == pytest.approx(200.0, abs=0.1)
    assert taken[gaps[0] + 1] < 100 < taken[gaps[1]]
    assert fit.runs(np.zeros(1), 80.0, 3).tolist() == [0]


@pytest.mark.parametrize("hz", [15, 60, 120])
def test_noise_is_whitened_by_how_long_it_lasts_at_any_rate(hz):
    from scipy.signal import lfilter

    count, every = 200 * hz, np.ones(200 * hz - 1, bool)
    for lasts_s, expected_s in ((0.15, 0.15), (5.0, fit.LONGEST_S)):
        white = np.random.default_rng(2).standard_normal((6, count, 2))
        x = lfilter([1.0], [1.0, -np.exp(-1 / (hz * lasts_s))], white, axis=1)
        keep = fit.correlation(x, np.ones(x.shape[:2]), every, 1 / hz)
        assert -1 / (hz * np.log(keep)) == pytest.approx(expected_s, rel=0.15)


def test_pairs_across_a_gap_have_no_say_in_the_correlation():
    x = np.ones((1, 6, 2)) * np.array([1.0, 1, 1, -1, -1, -1])[None, :, None]
    near = np.array([True, True, False, True, True])
    assert fit.correlation(x, np.ones((1, 6)), near, 1 / 30) == pytest.approx(np.exp(-1 / 30 / fit.LONGEST_S))
    assert fit.correlation(x, np.ones((1, 6)), near | True, 1 / 30) == pytest.approx(3 / 5)
    assert fit.correlation(x, np.array([[1, 1, 0, 0, 0, 0.0]]), near | True, 1 / 30) > 0.9


def test_the_offset_is_that_at_t0_and_the_errors_are_those_of_the_second_clock():
    given, gain = np.diag([9.0, 9.0, 0.002**2, 7.0**2]), np.arange(48.0).reshape(4, 12)
    solved = fit.SolvedClocks(np.zeros(4), given, gain, np.zeros(0), 0.0)
    clock = fit.clock_of(np.array([0.4, 100.0]), 30.0, solved, ["cam01", "cam02"], at=1)
    assert clock.offset_s == pytest.approx(0.4 - 30 * 100e-6) and clock.drift_ppm == 100.0
    assert clock.given == pytest.approx((0.002, 7.0)) and clock.middle_s == 30.0
    assert (clock.gains["cam01"] == gain[2:, :6]).all() and (clock.gains["cam02"] == gain[2:, 6:]).all()


@pytest.mark.parametrize("blocks", [2, 4, 20])
def test_few_blocks_know_their_own_scatter_badly(blocks):
    """Scores that cancel in every group and block: their own squares, by the variance of Student's t."""
    scores = np.array([1.0, -1.0])[:, None] * np.tile([1.0, -1.0], blocks // 2)
    found = fit.two_way(scores[..., None], np.arange(2), np.arange(blocks))
    assert found[0, 0] == pytest.approx(2 * blocks * (blocks + 1) / (blocks - 1))
