"""Jacobians against finite differences, and the covariance of a triangulated point against many tries."""

from dataclasses import replace

import numpy as np
import pytest

from dior.geometry import camera as cam
from dior.geometry import camera_tables, covariance, triangulation
from tests.rig import ring


@pytest.fixture
def rig():
    return ring(3)


POINTS = np.array([[0.3, -0.2, 1.1], [-0.5, 0.4, 0.1]])


def test_projection_matches_finite_differences(rig):
    for camera in rig:
        by_point, by_camera = covariance.projection(camera, POINTS)
        for axis in range(3):
            step = 1e-6 * np.eye(3)[axis]
            slope = (cam.project(camera, POINTS + step)[0] - cam.project(camera, POINTS - step)[0]) / 2e-6
            np.testing.assert_allclose(by_point[..., axis], slope, atol=1e-3)
        for axis in range(6):
            step = 1e-6 * np.eye(6)[axis]
            there, back = (cam.project(covariance.moved(camera, s * step), POINTS)[0] for s in (1, -1))
            np.testing.assert_allclose(by_camera[..., axis], (there - back) / 2e-6, atol=1e-3)


def test_the_pixel_follows_the_lens(rig):
    """Focal length, cx and cy, relative to the focal length; fy goes with fx."""
    for camera in rig:
        lens, slope = camera.intrinsics, covariance.by_lens(camera, POINTS)
        for axis, wrong in enumerate(_wrong_lens(lens, 1e-6 * np.eye(3)[axis]) for axis in range(3)):
            moved = cam.project(replace(camera, intrinsics=wrong), POINTS)[0] - cam.project(camera, POINTS)[0]
            np.testing.assert_allclose(slope[..., axis], moved / 1e-6, atol=1e-2)


def _wrong_lens(lens, error):
    cx, cy = lens.cx + error[1] * lens.fx, lens.cy + error[2] * lens.fx
    return replace(lens, fx=lens.fx * (1 + error[0]), fy=lens.fy * (1 + error[0]), cx=cx, cy=cy)


def test_triangulated_point_follows_the_lenses(rig):
    uv = np.stack([cam.project(c, POINTS)[0] for c in rig])
    say = np.broadcast_to(np.eye(2) / 2.0**2, (3, 2, 2, 2))
    _, by_all = covariance.triangulated(rig, POINTS, say, with_lenses=True)
    step = np.zeros((3, 9))
    step[:, 6:] = 1e-4 * np.random.default_rng(0).standard_normal((3, 3))
    wrong = [replace(c, intrinsics=_wrong_lens(c.intrinsics, s[6:])) for c, s in zip(rig, step, strict=True)]
    np.testing.assert_allclose(_points(wrong, uv) - POINTS, by_all @ step.ravel(), atol=3e-5)


def test_triangulated_point_follows_its_cameras(rig):
    uv = np.stack([cam.project(c, POINTS)[0] for c in rig])
    say = np.broadcast_to(np.eye(2) / 2.0**2, (3, 2, 2, 2))
    noise, by_cameras = covariance.triangulated(rig, POINTS, say)
    random = np.random.default_rng(0)
    step = 1e-4 * random.standard_normal(18)
    shifted = [covariance.moved(c, s) for c, s in zip(rig, step.reshape(3, 6), strict=True)]
    np.testing.assert_allclose(_points(shifted, uv) - POINTS, by_cameras @ step, atol=3e-5)

    tries = np.repeat(uv[:, None], 20000, axis=1) + 2.0 * random.standard_normal((3, 20000, 2, 2))
    error = _points(rig, tries) - POINTS
    np.testing.assert_allclose(np.einsum("nij,nik->ijk", error, error) / 20000, noise, rtol=0.05, atol=5e-6)


def test_one_view_tells_nothing(rig):
    say = np.zeros((3, 2, 2, 2))
    say[0] = np.eye(2)
    assert np.isnan(covariance.triangulated(rig, POINTS, say)[0]).all()
    say[1] = np.eye(2)
    assert np.isfinite(covariance.triangulated(rig, POINTS, say)[0]).all(), "two do"


def _points(cameras, uv):
    xy = np.stack([cam.undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    # divided by the depth, the linear equations' residuals are those of the pixels
    depth = np.stack([cam.project(c, np.broadcast_to(POINTS, (*uv.shape[1:-1], 3)))[1] for c in cameras])
    return triangulation.triangulate([cam.inverse_pose(c.wTc) for c in cameras], xy, 1 / depth)


def test_camera_covariance_is_read_as_written_and_joined(tmp_path):
    A = np.random.default_rng(1).standard_normal((18, 18))
    S = A @ A.T
    names = ["cam01", "cam02", "cam03"]
    camera_tables.write_camera_covariance(tmp_path / "close.parquet", names[:2], S[:12, :12], "field")
    camera_tables.write_camera_covariance(tmp_path / "far.parquet", names, S, "field", own=["cam03"])
    both = [tmp_path / "close.parquet", tmp_path / "far.parquet"]
    np.testing.assert_array_equal(camera_tables.read_camera_covariance(both, names), S)
    turned = camera_tables.read_camera_covariance(both, ["cam03", "cam01"])
    np.testing.assert_array_equal(turned[:6, 6:], S[12:, :6])
    alone = camera_tables.read_camera_covariance(both[0], names)
    assert np.isnan(alone[12:]).all() and np.isnan(alone[:, 12:]).all() and np.isfinite(alone[:12, :12]).all()


@pytest.mark.parametrize("with_lenses", [False, True])
def test_cameras_of_which_no_table_has_a_pair_are_independent(tmp_path, with_lenses):
    S, names = np.diag(np.arange(1.0, 7.0)), ["cam01", "cam02"]
    paths = [tmp_path / f"{name}.parquet" for name in names]
    for path, name, factor in zip(paths, names, (1, 3), strict=True):
        camera_tables.write_camera_covariance(path, [name], factor * S, "lab")
    found = camera_tables.read_camera_covariance(paths, names, with_lenses)
    each = 9 if with_lenses else 6
    assert found.shape == (2 * each, 2 * each)
    np.testing.assert_array_equal(found[each : each + 6, each : each + 6], 3 * S)
    assert not found[:each, each:].any() and not found[6:each].any()


def test_the_covariance_with_lenses_is_read_as_written(tmp_path):
    A = np.random.default_rng(1).standard_normal((18, 18))
    S, names = A @ A.T, ["cam01", "cam02"]
    camera_tables.write_camera_covariance(tmp_path / "a.parquet", names, S, "lab")
    np.testing.assert_array_equal(camera_tables.read_camera_covariance(tmp_path / "a.parquet", names, True), S)
    turned = camera_tables.read_camera_covariance(tmp_path / "a.parquet", names[::-1], True)
    np.testing.assert_array_equal(turned[:9, 9:], S[9:, :9])
    poses = camera_tables.read_camera_covariance(tmp_path / "a.parquet", names)
    np.testing.assert_array_equal(poses[:6, 6:], S[:6, 9:15])
    blocks = S.reshape(2, 9, 2, 9)
    parts = [blocks[:, a, :, b] for a, b in ((slice(6), slice(6)), (slice(6), slice(6, 9)), (slice(6, 9), slice(6, 9)))]
    flat = [part.reshape(part.shape[0] * part.shape[1], -1) for part in parts]
    np.testing.assert_array_equal(covariance.joined(*flat), S)
    # without lenses they are right
    camera_tables.write_camera_covariance(tmp_path / "b.parquet", names, np.eye(12), "lab")
    assert np.diag(camera_tables.read_camera_covariance(tmp_path / "b.parquet", names, True)).sum() == 12


def test_point_covariance_is_read_from_its_columns():
    A = np.random.default_rng(2).standard_normal((3, 3))
    S = A @ A.T
    sd = np.sqrt(np.diag(S))
    table = {f"sigma_{axis}": np.array([s]) for axis, s in zip("xyz", sd, strict=True)}
    for key, (i, j) in {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}.items():
        table[f"rho_{key}"] = np.array([S[i, j] / sd[i] / sd[j]])
    np.testing.assert_allclose(covariance.point_covariance(table, (1, 1))[0, 0], S)
