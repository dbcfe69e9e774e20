"""How uncertain cameras move what they see: Jacobians of the projection and of a triangulated point.

A camera's error is a vector of six numbers: a turn about its own axes (rad), then a shift of its centre in the world
(m). `wTc` with the error `step` is `(wRc exp(step[:3]), centre + step[3:])`. The covariance of V cameras is (6V, 6V),
six rows a camera. With the lenses it is (9V, 9V), nine rows a camera: after the pose's error those of the focal length,
cx and cy, all relative to the focal length. Vocabulary of calibrate, reconstruct and label.
"""

from collections.abc import Sequence

import numpy as np

from dior.arrays import Floats, Table
from dior.geometry import camera as cam
from dior.geometry.rotation import cross, from_rotvec


def moved(camera: cam.Camera, step: Floats) -> cam.Camera:
    """The camera with the error `step` (6,)."""
    wRc = camera.wRc @ from_rotvec(step[:3])
    return camera.at(cam.pose(wRc, camera.centre + step[3:]))


def projection(camera: cam.Camera, points: Floats) -> tuple[Floats, Floats]:
    """Derivatives of the recorded pixel by the world point (..., 2, 3) px/m and by the camera's error (..., 2, 6).

    `points` (..., 3) m; NaN behind the camera and where the lens model has no answer.
    """
    p = (np.asarray(points, float) - camera.centre) @ camera.wRc
    z = p[..., 2]
    with np.errstate(all="ignore"):
        z = np.where(z > 0, z, np.nan)
        xy = p[..., :2] / z[..., None]
        lens = _lens(camera.intrinsics, xy)
        by_axes = np.zeros((*z.shape, 2, 3))  # of the ideal coordinates, by the point in the camera's axes
        by_axes[..., 0, 0] = by_axes[..., 1, 1] = 1 / z
        by_axes[..., :, 2] = -xy / z[..., None]
    by_axes = lens @ by_axes
    by_point = by_axes @ camera.wRc.T
    # p(w) = exp(-w) p = p - w x p = p + [p]x w
    turn = by_axes @ cross(p)
    return by_point, np.concatenate([turn, -by_point], axis=-1)


def by_lens(camera: cam.Camera, points: Floats) -> Floats:
    """Derivative of the recorded pixel by the error of the lens (..., 2, 3): focal length, cx, cy over focal length.

    `points` (..., 3) m; NaN where there is no pixel.
    """
    lens = camera.intrinsics
    uv = cam.project(camera, points)[0]
    out = np.zeros((*uv.shape, 3))
    out[..., 0] = uv - (lens.cx, lens.cy)
    out[..., 0, 1] = out[..., 1, 2] = lens.fx
    known = np.all(np.isfinite(uv), axis=-1)
    return np.where(np.asarray(known)[..., None, None], out, np.nan)


def joined(poses: Floats, across: Floats, lenses: Floats) -> Floats:
    """(9V, 9V) of V cameras from that of their poses (6V, 6V), of poses and lenses (6V, 3V), and of lenses (3V, 3V)."""
    count = len(lenses) // 3
    out = np.zeros((count, 9, count, 9))
    out[:, :6, :, :6] = poses.reshape(count, 6, count, 6)
    out[:, :6, :, 6:] = across.reshape(count, 6, count, 3)
    out[:, 6:, :, :6] = across.T.reshape(count, 3, count, 6)
    out[:, 6:, :, 6:] = lenses.reshape(count, 3, count, 3)
    return out.reshape(9 * count, 9 * count)


def _lens(intrinsics: cam.Intrinsics, xy: Floats) -> Floats:
    """Derivative (..., 2, 2) px of the recorded pixel by the ideal normalised coordinates (..., 2)."""
    step = 1e-6
    columns = [
        (cam.distort(intrinsics, xy + d) - cam.distort(intrinsics, xy - d)) / (2 * step)
        for d in (np.array([step, 0.0]), np.array([0.0, step]))
    ]
    return np.stack(columns, axis=-1)


def triangulated(
    cameras: Sequence[cam.Camera], points: Floats, information: Floats, with_lenses: bool = False
) -> tuple[Floats, Floats]:
    """What points (..., 3) inherit: covariance (..., 3, 3) of the pixels, derivative (..., 3, 6V) by the cameras.

    `information` (V, ..., 2, 2) 1/px^2 of each view's pixel, zero where a view had no say. The derivative is that
    by the errors of the V cameras that the point was made with (implicit function theorem at the least squares
    solution), (..., 3, 9V) with those of their lenses. NaN with fewer than two views.
    """
    by_point, by_camera = zip(*(projection(camera, points) for camera in cameras), strict=True)
    if with_lenses:
        lenses = [by_lens(camera, points) for camera in cameras]
        by_camera = tuple(np.concatenate(pair, axis=-1) for pair in zip(by_camera, lenses, strict=True))
    say = np.asarray(information, float)
    used = say[..., 0, 0] > 0
    J = [np.where(u[..., None, None], j, 0.0) for u, j in zip(used, by_point, strict=True)]
    C = [np.where(u[..., None, None], c, 0.0) for u, c in zip(used, by_camera, strict=True)]
    weighted = [np.swapaxes(j, -1, -2) @ w for j, w in zip(J, say, strict=True)]
    N = sum(wj @ j for wj, j in zip(weighted, J, strict=True))
    enough = used.sum(axis=0) >= 2
    N = np.where(enough[..., None, None], N, np.eye(3))
    noise = np.linalg.inv(N)
    by_cameras = -noise @ np.concatenate([wj @ c for wj, c in zip(weighted, C, strict=True)], axis=-1)
    missing = ~enough[..., None, None]
    return np.where(missing, np.nan, noise), np.where(missing, np.nan, by_cameras)


def point_covariance(table: Table, shape: tuple[int, ...]) -> Floats:
    """Covariance (*shape, 3, 3) m^2 from the sigma and rho columns of a `skeletons_3d` table."""
    sigmas, rhos = (
        np.stack([table[key].reshape(shape).astype(float) for key in keys], axis=-1)
        for keys in (("sigma_x", "sigma_y", "sigma_z"), ("rho_xy", "rho_xz", "rho_yz"))
    )
    return of_sigmas(sigmas, rhos)


def of_sigmas(sigmas: Floats, rhos: Floats) -> Floats:
    """Covariance (..., 3, 3) of standard errors in x, y, z (..., 3) with the correlations xy, xz, yz (..., 3)."""
    x, y, z, xy, xz, yz = (values[..., i] for values in (sigmas, rhos) for i in range(3))
    out = np.stack([x * x, xy * x * y, xz * x * z, xy * x * y, y * y, yz * y * z, xz * x * z, yz * y * z, z * z], -1)
    return out.reshape(*x.shape, 3, 3)
