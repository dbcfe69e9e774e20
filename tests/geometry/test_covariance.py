"""Jacobians against finite differences, and the covariance of a triangulated point against many tries."""

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


def test_point_covariance_is_read_from_its_columns():
    A = np.random.default_rng(2).standard_normal((3, 3))
    S = A @ A.T
    sd = np.sqrt(np.diag(S))
    table = {f"sigma_{axis}": np.array([s]) for axis, s in zip("xyz", sd, strict=True)}
    for key, (i, j) in {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}.items():
        table[f"rho_{key}"] = np.array([S[i, j] / sd[i] / sd[j]])
    np.testing.assert_allclose(covariance.point_covariance(table, (1, 1))[0, 0], S)
