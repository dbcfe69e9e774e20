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
from dior.geometry.rotation import from_rotvec


def moved(camera: cam.Camera, step: Floats) -> cam.Camera:
    """The camera with the error `step` (6,)."""
    wRc = camera.wRc @ from_rotvec(step[:3])
    return camera.at(cam.pose(wRc, camera.centre + step[3:]))


def linear(camera: cam.Camera, points: Floats, with_lens: bool = False) -> tuple[Floats, Floats, Floats]:
    """The recorded pixels (2, ...) of points (3, ...) m, and how they move with the point and with the camera.

    Derivatives (2, 3, ...) px/m by the point and (2, 6, ...) by the camera's error, (2, 9, ...) with that of its lens.
    NaN behind the camera and where the lens model has no answer. The points are the last axes here: numpy goes through
    long rows many times as fast as through as many small matrices.
    """
    lens, R = camera.intrinsics, camera.wRc
    p = np.tensordot(R, np.stack([along - at for along, at in zip(points, camera.centre, strict=True)]), (0, 0))
    with np.errstate(all="ignore"):
        z = np.where(p[2] > 0, p[2], np.nan)
        xy = np.moveaxis(p[:2] / z, 0, -1)
        uv = np.moveaxis(cam.distort(lens, xy), -1, 0)
        z = np.where(np.isfinite(uv).all(axis=0), z, np.nan)
        # of the pixel, by the point in the camera's axes
        by_axes = np.stack(
            [[x / z, y / z, -(x * xy[..., 0] + y * xy[..., 1]) / z] for x, y in cam.slopes(lens, xy, uv)]
        )
    by_point = product(by_axes, R.T)
    # p(w) = exp(-w) p = p - w x p = p + [p]x w
    turn = np.stack([by_axes[:, i - 2] * p[i - 1] - by_axes[:, i - 1] * p[i - 2] for i in range(3)], axis=1)
    by_camera = [turn, -by_point]
    if with_lens:
        by_lens = np.zeros_like(by_point) + 0 * z
        by_lens[:, 0] = uv[0] - lens.cx, uv[1] - lens.cy
        by_lens[0, 1] = by_lens[1, 2] = lens.fx + 0 * z
        by_camera.append(by_lens)
    return uv, by_point, np.concatenate(by_camera, axis=1)


def product(A: Floats, B: Floats) -> Floats:
    """Matrices (a, b, ...) times matrices (b, c, ...): their product at each point."""
    return np.einsum("ab...,bc...->ac...", A, B)


def matrices(rows: Floats) -> Floats:
    """Rows (a, b, ...) as matrices (..., a, b)."""
    return np.ascontiguousarray(np.moveaxis(rows, (0, 1), (-2, -1)))


def projection(camera: cam.Camera, points: Floats) -> tuple[Floats, Floats]:
    """Derivatives of the recorded pixel by the world point (..., 2, 3) px/m and by the camera's error (..., 2, 6).

    `points` (..., 3) m; NaN behind the camera and where the lens model has no answer.
    """
    _, by_point, by_camera = linear(camera, np.moveaxis(np.asarray(points, float), -1, 0))
    return matrices(by_point), matrices(by_camera)


def by_lens(camera: cam.Camera, points: Floats) -> Floats:
    """Derivative of the recorded pixel by the error of the lens (..., 2, 3): focal length, cx, cy over focal length.

    `points` (..., 3) m; NaN where there is no pixel.
    """
    return matrices(linear(camera, np.moveaxis(np.asarray(points, float), -1, 0), with_lens=True)[2][:, 6:])


def joined(poses: Floats, across: Floats, lenses: Floats) -> Floats:
    """(9V, 9V) of V cameras from that of their poses (6V, 6V), of poses and lenses (6V, 3V), and of lenses (3V, 3V)."""
    count = len(lenses) // 3
    out = np.zeros((count, 9, count, 9))
    out[:, :6, :, :6] = poses.reshape(count, 6, count, 6)
    out[:, :6, :, 6:] = across.reshape(count, 6, count, 3)
    out[:, 6:, :, :6] = across.T.reshape(count, 3, count, 6)
    out[:, 6:, :, 6:] = lenses.reshape(count, 3, count, 3)
    return out.reshape(9 * count, 9 * count)


def triangulated(
    cameras: Sequence[cam.Camera], points: Floats, information: Floats, with_lenses: bool = False
) -> tuple[Floats, Floats]:
    """What points (..., 3) inherit: covariance (..., 3, 3) of the pixels, derivative (..., 3, 6V) by the cameras.

    `information` (V, ..., 2, 2) 1/px^2 of each view's pixel, zero where a view had no say. The derivative is that
    by the errors of the V cameras that the point was made with (implicit function theorem at the least squares
    solution), (..., 3, 9V) with those of their lenses. NaN with fewer than two views.
    """
    along = np.moveaxis(np.asarray(points, float), -1, 0)
    views = [linear(camera, along, with_lenses)[1:] for camera in cameras]
    say = np.moveaxis(np.asarray(information, float), (-2, -1), (0, 1))
    noise, pulls = inherited([by_point for by_point, _ in views], np.moveaxis(say, 2, 0))
    used = say[0, 0] > 0
    moves = [product(pull, np.where(u, by, 0.0)) for pull, (_, by), u in zip(pulls, views, used, strict=True)]
    return matrices(noise), matrices(np.concatenate(moves, axis=1))


def inherited(by_point: Sequence[Floats], information: Floats) -> tuple[Floats, list[Floats]]:
    """What triangulated points inherit of the pixels that they were made of: covariance (3, 3, ...), and how they move,
    (3, 2, ...) a view, with an error of what its camera shows of them.

    `by_point` (2, 3, ...) of each view (`linear`), `information` (V, 2, 2, ...) as of `triangulated`. NaN with fewer
    than two views.
    """
    used = information[:, 0, 0] > 0
    J = [np.where(u, j, 0.0) for u, j in zip(used, by_point, strict=True)]
    weighted = [product(np.swapaxes(j, 0, 1), w) for j, w in zip(J, information, strict=True)]
    N = sum((product(wj, j) for wj, j in zip(weighted, J, strict=True)), np.zeros(()))
    # its inverse by cofactors
    a, b, c = (np.cross(N[i - 2], N[i - 1], axis=0) for i in range(3))
    noise = np.stack([a, b, c]) / np.where(used.sum(axis=0) >= 2, (N[0] * a).sum(axis=0), np.nan)
    return noise, [-product(noise, wj) for wj in weighted]


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
