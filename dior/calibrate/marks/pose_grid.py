"""The best pose of a camera for each of many sets of points that the same pixels may show: all lags of a clock at once.

INPUTS   world points (L, N, 3) m, NaN where missing; pixels (N, 2)
OUTPUTS  poses (L, 4, 4), robust costs (L,) px^2
World in metres, Z up; a pose's error is that of `dior.geometry.covariance`. Pixels are compared as ideal coordinates
times the focal length, so that the lens is undone once: good enough for a start, `clock_from_marks.refine` works in
recorded pixels.
"""

import numpy as np

from dior.arrays import Bools, Floats
from dior.geometry.camera import Intrinsics, inverse_pose, pose, undistort
from dior.geometry.rotation import cross, from_rotvec

FEWEST = 4  # points that PnP wants for one solution
SHARE_OF_CONSENSUS = 0.5  # chosen: of the markers, at least, have to be there and agree
ROUNDS = 12  # chosen: steps from the start by SQPnP; what wins is refined anyway


def grid(
    intrinsics: Intrinsics, xyz: Floats, uv: Floats, limit_px: float, start: Floats | None = None
) -> tuple[Floats, Floats]:
    """Best pose wTc (L, 4, 4) for each of L sets of points (L, N, 3) and its cost (L,) px^2, robust.

    With `start` (4, 4) the pose is that.
    """
    focal = np.sqrt(intrinsics.fx * intrinsics.fy)
    xy = undistort(intrinsics, uv)
    there: Bools = np.all(np.isfinite(xyz), axis=2) & np.all(np.isfinite(xy), axis=1)
    if start is not None:
        wTc = np.tile(start, (len(xyz), 1, 1))
        return wTc, cost(_miss(wTc, xyz, xy)[0] * focal, there, limit_px)
    wTc = np.stack([_start(points[keep], xy[keep]) for points, keep in zip(xyz, there, strict=True)])
    for _ in range(ROUNDS):
        miss, J = _miss(wTc, xyz, xy)
        miss, J = np.nan_to_num(miss * focal), np.nan_to_num(J * focal)
        square = (miss**2).sum(axis=2)
        # Geman-McClure, its width that of the residuals as long as these are wide
        middle = np.nanmedian(np.where(there | ~np.any(there, axis=1)[:, None], square, np.nan), axis=1)
        width = np.maximum(limit_px**2 / 4, 2 * middle)[:, None]
        weight = there * (width / (width + square)) ** 2
        N = np.einsum("ln,lnij,lnik->ljk", weight, J, J)
        N += (1e-9 * np.einsum("ljj->l", N) + 1e-12)[:, None, None] * np.eye(6)
        step = -np.linalg.solve(N, np.einsum("ln,lnij,lni->lj", weight, J, miss)[..., None])[..., 0]
        wTc = _moved(wTc, step)
    return wTc, cost(_miss(wTc, xyz, xy)[0] * focal, there, limit_px)


def _start(xyz: Floats, xy: Floats) -> Floats:
    """wTc (4, 4) of marks by SQPnP; at the origin where there is none."""
    import cv2

    if len(xyz) < FEWEST:
        return np.eye(4)
    found, rotation, translation = cv2.solvePnP(xyz, xy, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    if not found or not np.isfinite(rotation).all():
        return np.eye(4)
    return inverse_pose(pose(cv2.Rodrigues(rotation)[0], translation.ravel()))


def _miss(wTc: Floats, xyz: Floats, xy: Floats) -> tuple[Floats, Floats]:
    """Residuals (L, N, 2) in ideal coordinates and derivatives (L, N, 2, 6) by the poses wTc (L, 4, 4).

    NaN behind the camera.
    """
    R, centre = wTc[:, :3, :3], wTc[:, None, :3, 3]
    p = (xyz - centre) @ R
    with np.errstate(invalid="ignore", divide="ignore"):
        z = np.where(p[..., 2] > 0.05, p[..., 2], np.nan)
        seen = p[..., :2] / z[..., None]
        by_axes = np.zeros((*z.shape, 2, 3))
        by_axes[..., 0, 0] = by_axes[..., 1, 1] = 1 / z
        by_axes[..., :, 2] = -seen / z[..., None]
    by_centre = -by_axes @ np.swapaxes(R, 1, 2)[:, None]
    return seen - xy, np.concatenate([by_axes @ cross(p), by_centre], axis=-1)


def _moved(wTc: Floats, step: Floats) -> Floats:
    """Poses (L, 4, 4) with the errors `step` (L, 6) of `dior.geometry.covariance`."""
    out = wTc.copy()
    out[:, :3, :3] = wTc[:, :3, :3] @ from_rotvec(step[:, :3])
    out[:, :3, 3] += step[:, 3:]
    return out


def cost(miss: Floats, there: Bools, limit_px: float) -> Floats:
    """Sum (...,) px^2 of squared residuals (..., N, 2), none above the limit's; a missing marker counts as the mean.

    Infinite where fewer than half of the markers are there.
    """
    square = np.minimum(np.nan_to_num((miss**2).sum(axis=-1), nan=np.inf), limit_px**2)
    number = there.sum(axis=-1)
    mean = np.where(there, square, 0.0).sum(axis=-1) / np.maximum(number, 1)
    return np.where(number >= max(FEWEST, SHARE_OF_CONSENSUS * there.shape[-1]), mean * there.shape[-1], np.inf)
