"""Covariances of labels: what must cancel, and against many tries."""

import numpy as np
import pytest

from dior.clocks.clock import Clock
from dior.geometry import camera as cam
from dior.geometry import covariance as cov
from dior.geometry import triangulation
from dior.label import uncertainty
from tests.rig import camera, ring

POINTS = np.array([[0.3, -0.2, 1.1], [-0.5, 0.4, 0.1]])
NONE = np.zeros((2, 3, 3))
TRIES = 3000


def test_a_shift_of_the_whole_world_moves_no_label():
    rig = ring(3)
    names = [c.name for c in rig]
    together = np.zeros((18, 3))
    for i in range(3):
        together[6 * i + 3 : 6 * i + 6] = np.eye(3)
    joint = 0.1**2 * together @ together.T
    for c in rig:
        spread = uncertainty.of_labels(c, POINTS, NONE, rig, names, joint)
        assert np.abs(spread).max() < 1e-12
        alone = uncertainty.of_labels(c, POINTS, NONE, [], names, joint)
        assert np.sqrt(alone[:, 0, 0]).min() > 5  # 10 cm at 5 m and fx 640


def test_a_turn_of_the_whole_world_moves_no_label():
    rig = ring(3)
    about_up = np.concatenate([[*c.wRc.T @ [0, 0, 1.0], *np.cross([0, 0, 1.0], c.centre)] for c in rig])
    joint = np.radians(1.0) ** 2 * np.outer(about_up, about_up)
    spread = uncertainty.of_labels(rig[1], POINTS, NONE, rig, [c.name for c in rig], joint)
    assert np.abs(spread).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("far", [False, True])
def test_covariance_is_that_of_many_tries(far):
    rig = ring(3)
    own = camera("cam04", (0.0, 60.0, 1.9), role="long_range") if far else rig[2]
    names = [c.name for c in rig] + ["cam04"] * far
    random = np.random.default_rng(0)
    size = np.tile(np.repeat([1e-3, 5e-3], 3), len(names))
    mix = 0.5 * random.standard_normal((len(size), len(size))) + np.eye(len(size))
    joint = size[:, None] * (mix @ mix.T) / 3 * size
    joint = joint / (30 if far else 1)
    say = np.broadcast_to(np.eye(2) / 2.0**2, (3, 2, 2, 2))
    noise, _ = cov.triangulated(rig, POINTS, say)
    wanted = uncertainty.of_labels(own, POINTS, noise, rig, names, joint)

    uv = np.stack([cam.project(c, POINTS)[0] for c in rig])
    weights = 1 / np.stack([cam.project(c, POINTS)[1] for c in rig])
    true, errors = cam.project(own, POINTS)[0], []
    seen = uv + 2.0 * random.standard_normal((TRIES, *uv.shape))
    xy = np.stack([cam.undistort(c.intrinsics, seen[:, view]) for view, c in enumerate(rig)], axis=1)
    steps = random.multivariate_normal(np.zeros(len(size)), joint, TRIES).reshape(TRIES, -1, 6)
    for step, seen_xy in zip(steps, xy, strict=True):
        moved = [cov.moved(c, s) for c, s in zip([*rig, own] if far else rig, step, strict=True)]
        points = triangulation.triangulate([cam.inverse_pose(c.wTc) for c in moved[:3]], seen_xy, weights)
        errors.append(cam.project(moved[-1], points)[0] - true)
    errors = np.array(errors)
    found = np.einsum("nij,nik->ijk", errors, errors) / len(errors)
    scale = np.sqrt(np.einsum("ij,ik->ijk", *[np.diagonal(wanted, axis1=1, axis2=2)] * 2))
    np.testing.assert_allclose(found / scale, wanted / scale, atol=0.12)


def test_unknown_cameras_or_points_have_no_sigma():
    rig = ring(2)
    names = [c.name for c in rig]
    unknown = np.full((12, 12), np.nan)
    sigma_u, sigma_v, rho = uncertainty.columns(uncertainty.of_labels(rig[0], POINTS, NONE, rig, names, unknown))
    assert np.isnan([sigma_u, sigma_v, rho]).all()
    lost = np.full((2, 3, 3), np.nan)
    assert np.isnan(uncertainty.of_labels(rig[0], POINTS, lost, rig, names, np.eye(12))).all()


def test_a_clock_moves_a_label_along_its_motion_and_the_more_the_longer_its_drift_has_run():
    """An offset that is known to 10 ms and a drift to 20 ppm, of points that move 2 m/s at right angles to the view."""
    own = camera("cam01", (0.0, 5.0, 1.0))
    points = np.broadcast_to([0.0, 0.0, 1.0], (2, 1, 3))
    velocity = np.broadcast_to([2.0, 0.0, 0.0], points.shape)
    speed_px = np.linalg.norm(cov.projection(own, points)[0] @ velocity[..., None], axis=(-1, -2))
    timing = uncertainty.Timing(
        {"cam01": Clock(0.0, middle_s=30.0, given=(0.01, 20.0))}, velocity, np.array([30.0, 930.0])
    )
    spread = uncertainty.of_labels(own, points, np.zeros((2, 1, 3, 3)), [], ["cam01"], np.zeros((6, 6)), timing)
    late = np.hypot(0.01, 20e-6 * np.array([0.0, 900.0]))
    assert np.sqrt(np.trace(spread, axis1=-2, axis2=-1)) == pytest.approx(late[:, None] * speed_px, rel=1e-9)


def test_a_stamp_that_was_restored_adds_its_own_error_to_its_picture():
    own = camera("cam01", (0.0, 5.0, 1.0))
    points = np.broadcast_to([0.0, 0.0, 1.0], (2, 1, 3))
    velocity = np.broadcast_to([2.0, 0.0, 0.0], points.shape)
    speed_px = np.linalg.norm(cov.projection(own, points)[0] @ velocity[..., None], axis=(-1, -2))
    clock, restored = {"cam01": Clock(0.0, given=(0.003, 0.0))}, np.array([0.0, 0.004])
    timing = uncertainty.Timing(clock, velocity, np.zeros(2), restored)
    spread = uncertainty.of_labels(own, points, np.zeros((2, 1, 3, 3)), [], ["cam01"], np.zeros((6, 6)), timing)
    late = np.array([0.003, 0.005])
    assert np.sqrt(np.trace(spread, axis1=-2, axis2=-1)) == pytest.approx(late[:, None] * speed_px, rel=1e-9)


def test_what_a_clock_owes_to_a_pose_grows_with_its_drift():
    """The clock's own camera is turned: its label moves by the pose and, in time, by what the clock took from it."""
    own = camera("cam01", (0.0, 5.0, 1.0))
    points = np.broadcast_to([0.0, 0.0, 1.0], (2, 1, 3))
    velocity = np.broadcast_to([2.0, 0.0, 0.0], points.shape)
    gain = np.zeros((2, 6))
    gain[:, 1] = 0.5, 300.0  # s and ppm per rad about the camera's y axis
    clock = Clock(0.0, middle_s=30.0, given=(0.0, 0.0), gains={"cam01": gain})
    joint = np.zeros((6, 6))
    joint[1, 1] = 0.01**2
    timing = uncertainty.Timing({"cam01": clock}, velocity, np.array([30.0, 930.0]))
    spread = uncertainty.of_labels(own, points, np.zeros((2, 1, 3, 3)), [], ["cam01"], joint, timing)
    by_point, by_camera = cov.projection(own, points)
    by_turn = (
        by_camera[..., 1]
        + (0.5 + 300e-6 * np.array([0.0, 900.0]))[:, None, None] * (by_point @ velocity[..., None])[..., 0]
    )
    assert np.diagonal(spread, axis1=-2, axis2=-1) == pytest.approx((0.01 * by_turn) ** 2, rel=1e-9, abs=1e-12)


def test_the_noise_of_a_point_is_seen_in_the_pixel():
    own, A = ring(1)[0], np.random.default_rng(4).normal(0, 0.01, (1, 2, 3, 3))
    noise = A @ np.swapaxes(A, -1, -2)
    spread = uncertainty.of_labels(own, POINTS[None], noise, [], ["cam01"], np.zeros((6, 6)))
    J, _ = cov.projection(own, POINTS[None])
    assert spread == pytest.approx(J @ noise @ np.swapaxes(J, -1, -2)) and spread[0, 0, 0, 0] > 0.1
