"""The smoothed skeleton: as the whole system of equations has it, without lag, as sure of itself as it may be."""

import numpy as np
import pytest

from dior.reconstruct import refine, timeline
from dior.reconstruct.smooth import smooth
from dior.reconstruct.triangulate import columns, write_skeleton
from dior.tables import tables

FPS = 30.0


def dense(points, covariance, keep, jerk):
    """The same least squares, of one joint, by its full matrices: path (T, 3) and covariance (T, 3, 3)."""
    count = len(points)
    known = np.isfinite(points).all(axis=1)
    D = np.kron(np.diff(np.eye(count), 3, axis=0), np.eye(3)) / jerk
    N, rhs = D.T @ D, np.zeros(3 * count)
    at = np.flatnonzero(known)
    L = np.zeros((3 * len(at), 3 * len(at)))
    for i, t in enumerate(at):
        L[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = np.linalg.cholesky(covariance[t])
    noise = L @ np.kron(keep ** np.abs(at[:, None] - at[None]), np.eye(3)) @ L.T
    H = np.kron(np.eye(count)[at], np.eye(3))
    N += H.T @ np.linalg.solve(noise, H)
    rhs += H.T @ np.linalg.solve(noise, points[at].ravel())
    C = np.linalg.inv(N)
    return (C @ rhs).reshape(-1, 3), np.stack([C[3 * t : 3 * t + 3, 3 * t : 3 * t + 3] for t in range(count)])


def moving(count, seed=0):
    """A joint that swings and walks, (T, 1, 3) m."""
    t = np.arange(count) / FPS
    return np.stack([1.2 * t, 0.2 * np.sin(5 * t), 1 + 0.1 * np.cos(9 * t)], axis=-1)[:, None]


@pytest.mark.parametrize("keep", [0.0, 0.8])
@pytest.mark.parametrize("count", [8, 21])
def test_blocks_solve_the_whole_system(keep, count):
    random = np.random.default_rng(1)
    points = moving(count) + random.normal(0, 0.02, (count, 1, 3))
    A = random.normal(0, 0.01, (count, 1, 3, 3))
    covariance = A @ np.swapaxes(A, -1, -2) + 1e-4 * np.eye(3)
    points[5] = np.nan
    path, spread, _ = smooth(points, covariance, keep, np.array([0.01]))
    expected, C = dense(points[:, 0], covariance[:, 0], keep, 0.01)
    # instants without a point are held by a ridge, a thousandth of what is known of them
    assert path[:, 0] == pytest.approx(expected, abs=2e-4)
    assert spread[:, 0] == pytest.approx(C, rel=0.02, abs=1e-7)


def noisy(points, sd, time_s, random):
    noise = random.normal(size=points.shape)
    keep = np.exp(-1 / (FPS * time_s)) if time_s else 0.0
    for t in range(1, len(points)):
        noise[t] = keep * noise[t - 1] + np.sqrt(1 - keep**2) * noise[t]
    return points + sd * noise


@pytest.mark.parametrize("time_s", [0.0, 0.15])
def test_smoothing_helps_has_no_lag_and_knows_what_is_left(time_s):
    random = np.random.default_rng(2)
    truth = np.repeat(moving(300), 12, axis=1)
    points = noisy(truth, 0.02, time_s, random)
    covariance = np.broadcast_to(4e-4 * np.eye(3), (300, 12, 3, 3)).copy()
    path, spread, filled, _ = refine.refined(points, covariance, [f"j{i}" for i in range(12)], FPS, time_s, 0.0, 0.2)
    error = path - truth
    assert (error**2).mean() < (0.3 if time_s == 0 else 0.8) * ((points - truth) ** 2).mean()
    z = error / np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))
    assert 0.8 < np.sqrt((z**2).mean()) < 1.25
    assert not filled.any()
    shifts = np.arange(-3, 4)
    match = [((path[10:-10] - truth[10 - s : len(truth) - 10 - s]) ** 2).mean() for s in shifts]
    assert shifts[np.argmin(match)] == 0
    # white noise is smoothed away, noise that lasts is not, and it is not claimed to be
    assert (np.trace(spread.mean(axis=(0, 1))) < 0.3 * 12e-4) == (time_s == 0)


def test_what_stays_of_the_noise_stays_in_the_covariance():
    points = noisy(np.repeat(moving(120), 2, axis=1), 0.02, 0.0, np.random.default_rng(3))
    covariance = np.broadcast_to(4e-4 * np.eye(3), (120, 2, 3, 3)).copy()
    _, spread, _, _ = refine.refined(points, covariance, ["a", "b"], FPS, 0.0, 0.5, 0.2)
    assert (np.diagonal(spread, axis1=-2, axis2=-1) >= 2e-4).all()


def test_short_gaps_are_bridged_with_more_doubt_and_long_ones_are_not():
    truth = np.repeat(moving(200), 2, axis=1)
    points = noisy(truth, 0.01, 0.0, np.random.default_rng(4))
    points[50:55, 0] = points[100:110, 0] = points[:3, 0] = np.nan
    covariance = np.where(np.isfinite(points)[..., None], 1e-4 * np.eye(3), np.nan)
    path, spread, filled, _ = refine.refined(points, covariance, ["a", "b"], FPS, 0.0, 0.0, 0.2)
    assert np.flatnonzero(filled[:, 0]).tolist() == [50, 51, 52, 53, 54] and not filled[:, 1].any()
    assert np.isnan(path[100:110, 0]).all() and np.isnan(path[:3, 0]).all() and np.isnan(spread[100:110, 0]).all()
    assert np.linalg.norm(path[50:55, 0] - truth[50:55, 0], axis=-1).max() < 0.05
    assert np.trace(spread[52, 0]) > 1.5 * np.trace(spread[40, 0])


def test_bones_get_their_length_back():
    random = np.random.default_rng(5)
    hip = np.repeat(moving(200), 1, axis=1)
    swing = 0.4 * np.sin(np.arange(200) / 8)[:, None]
    knee = hip + 0.45 * np.stack([np.sin(swing), 0 * swing, -np.cos(swing)], axis=-1)
    truth = np.concatenate([hip, knee], axis=1)
    path = truth + random.normal(0, 0.01, truth.shape)
    spread = np.broadcast_to(1e-4 * np.eye(3), (200, 2, 3, 3)).copy()
    after, less = refine.with_bones(path, spread, 0 * spread, ["left_hip", "left_knee"])

    def scatter(p):
        return np.linalg.norm(p[:, 1] - p[:, 0], axis=-1).std()

    assert scatter(after) < 0.4 * scatter(path)
    assert ((after - truth) ** 2).mean() < ((path - truth) ** 2).mean()
    assert np.trace(less.mean(axis=(0, 1))) < np.trace(spread.mean(axis=(0, 1)))


def test_the_step_keeps_every_row(tmp_path):
    random = np.random.default_rng(6)
    points = noisy(np.repeat(moving(60), 2, axis=1), 0.01, 0.0, random)
    status = np.full((60, 2), "ok", object)
    points[20:23, 0], status[20:23, 0] = np.nan, "rejected"
    points[:, 1], status[:, 1] = np.nan, "too_few_views"
    points[4:9, 1], status[4:9, 1] = 1.0, "ok"
    covariance = np.where(np.isfinite(points)[..., None], 1e-4 * np.eye(3), np.nan)
    stamps = 10**18 + np.arange(60) * 33_333_333
    views, residual = np.full((60, 2), 3), np.where(np.isfinite(points[..., 0]), 1.0, np.nan)
    about = {"noise_time_s": "0.1"}
    share = np.where(np.isfinite(covariance[..., 0, 0]), 0.2, np.nan)
    names = ["left_knee", "left_ankle"]
    known = columns(names, stamps, points, status, views, residual, covariance, share)
    write_skeleton(tmp_path / "t.parquet", "S", "w", known, about)
    refine.run(
        sequence="w", subject="S", skeleton=tmp_path / "t.parquet", max_gap_s=0.2,
        out=tmp_path / "r.parquet", findings=tmp_path / "f.parquet",
    )  # fmt: skip
    table = tables.read(tmp_path / "r.parquet", "skeletons_3d")
    after, joints = tables.grid(table, "x", "y", "z")
    assert joints == names and after.shape == points.shape
    # the noise is as triangulate says
    wanted, _, _, stays = refine.refined(points, covariance, names, timeline.rate(stamps), 0.1, 0.2, 0.2)
    assert after[:, 0] == pytest.approx(wanted[:, 0], abs=1e-6)
    for other in ((0.0, 0.2), (0.1, 0.0)):
        unlike, _, _, _ = refine.refined(points, covariance, names, timeline.rate(stamps), *other, 0.2)
        assert np.abs(unlike - wanted)[:, 0].max() > 1e-4
    assert table["constant_share"].reshape(60, 2)[:, 0] == pytest.approx(stays[:, 0], abs=1e-6)
    words = table["status"].reshape(60, 2)
    assert (words[20:23, 0] == "gap_filled").all() and np.isfinite(after[20:23, 0]).all()
    # a joint that was hardly seen is left as it is
    assert (words[:, 1] == status[:, 1]).all() and after[4:9, 1] == pytest.approx(np.ones((5, 3)))
    assert np.isfinite(table["sigma_x"].reshape(60, 2)[:, 0]).all()
    assert "bridged" in tables.read(tmp_path / "f.parquet", "findings")["text"][0]


def test_what_stays_is_not_smoothed_and_the_rest_is_as_if_it_were_alone():
    points = noisy(np.repeat(moving(120), 2, axis=1), 0.02, 0.0, np.random.default_rng(3))
    C = np.broadcast_to(4e-4 * np.eye(3), (120, 2, 3, 3)).copy()
    path, spread, _, stays = refine.refined(points, C, ["a", "b"], FPS, 0.1, 0.36, 0.2)
    alone, less, _, _ = refine.refined(points, 0.64 * C, ["a", "b"], FPS, 0.1, 0.0, 0.2)
    assert path == pytest.approx(alone, abs=1e-12) and spread == pytest.approx(less + 0.36 * C, abs=1e-12)
    # smoothed, more of what is left is constant
    assert stays == pytest.approx(0.36 * 12e-4 / np.trace(spread, axis1=-2, axis2=-1)) and (stays >= 0.36).all()


def test_noise_that_lasts_is_not_taken_for_white():
    points = noisy(np.repeat(moving(120), 2, axis=1), 0.02, 0.15, np.random.default_rng(3))
    C = np.broadcast_to(4e-4 * np.eye(3), (120, 2, 3, 3)).copy()
    (path, spread, _, _), (white, less, _, _) = (
        refine.refined(points, C, ["a", "b"], FPS, time_s, 0.0, 0.2) for time_s in (0.15, 0.0)
    )
    keep = np.exp(-1 / (FPS * 0.15))
    expected, C0 = dense(points[:, 0], C[:, 0], keep, refine.learned(points, C, keep, FPS)[0])
    # noise between points more than four instants apart is taken as independent
    assert path[:, 0] == pytest.approx(expected, abs=1e-3) and spread[:, 0] == pytest.approx(C0, rel=0.05, abs=1e-6)
    assert np.trace(spread.mean(axis=(0, 1))) > 3 * np.trace(less.mean(axis=(0, 1)))


def test_a_gap_is_short_up_to_its_limit_and_has_two_ends():
    known = np.array([[c == "1" for c in row] for row in ("0110011000110", "1101000011011")]).T
    filled = refine._short_gaps(known, 2)
    assert ["".join("x" if f else "." for f in column) for column in filled.T] == ["...xx........", "..x.......x.."]


@pytest.mark.parametrize("fps", [15, 30, 60, 120])
def test_gaps_are_bridged_by_their_time(fps):
    """A gap of 0.2 s is bridged, whatever the rate and also where it is read from stamps; an instant more is not."""
    step_ns = round(1e9 / fps)
    most = round(0.2 * fps)
    points = np.repeat(moving(2 * fps), 1, axis=1)
    points[20 : 20 + most] = np.nan
    after = 25 + most
    points[after : after + most + 1] = np.nan
    C = np.where(np.isfinite(points)[..., None], 1e-4 * np.eye(3), np.nan)
    for rate in (1e9 / step_ns, float(fps)):
        _, _, filled, _ = refine.refined(points, C, ["a"], rate, 0.0, 0.0, 0.2)
        assert np.flatnonzero(filled[:, 0]).tolist() == list(range(20, 20 + most))


def test_covariances_are_averaged_over_the_known_ones_around():
    known = np.array([True, True, False, True, True, False, False, False])[:, None]
    C = np.array([1.0, 3.0, 99.0, 5.0, 1.0, 99.0, 99.0, 99.0])[:, None, None, None] * np.eye(3)
    steady = refine._steady(C, known, 1)[:, 0, 0, 0]
    assert steady[:6] == pytest.approx([2, 2, 4, 3, 3, 1]) and np.isnan(steady[6:]).all()
    assert refine._steady(C, known, 0)[known] == pytest.approx(C[known])


def test_a_bone_whose_ends_have_a_constant_error_pulls_less():
    random = np.random.default_rng(5)
    path = np.broadcast_to([[0.0, 0, 0], [0, 0, 0.45]], (200, 2, 3)) + random.normal(0, 0.01, (200, 2, 3))
    spread = np.broadcast_to(1e-4 * np.eye(3), (200, 2, 3, 3)).copy()
    names = ["left_hip", "left_knee"]
    free, held = (refine.with_bones(path, spread, c * spread, names)[0] for c in (0.0, 10.0))
    # the innovation's variance is 2 + (0.09, the least of a bone) and 2 + 0.09 + 20, all times 1e-4
    assert np.abs(held - path).mean() == pytest.approx(2.09 / 22.09 * np.abs(free - path).mean(), rel=0.2)


def test_scores_that_change_from_picture_to_picture_do_not_move_the_path():
    """Errors that last are the same in neighbours: what scores make of their size counts by its mean over 0.45 s."""
    points = noisy(np.repeat(moving(120), 2, axis=1), 0.02, 0.15, np.random.default_rng(3))
    mean = np.broadcast_to(4e-4 * np.eye(3), (120, 2, 3, 3))
    by_score = mean * np.array([0.2, 1.0, 1.8])[np.arange(120) % 3, None, None, None]
    path, steady = (refine.refined(points, C.copy(), ["a", "b"], FPS, 0.15, 0.0, 0.2)[0] for C in (by_score, mean))
    assert np.abs(path - steady)[20:-20].max() < 1e-4
