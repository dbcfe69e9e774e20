"""How uncertain a label is: what the detections, the close cameras and its own camera leave open, carried to the pixel.

INPUTS   world points with their covariance given the cameras, the cameras that they were made with, the label's camera,
         and the joint covariance of all of them
OUTPUTS  covariance (..., 2, 2) px^2 of the labels
A point moves with the cameras that it was triangulated from, and the label's own camera moves with them, too: a world
that is turned or shifted as a whole moves no label of a close camera. Therefore the joint covariance is carried, and
not each camera's own. Errors of intrinsics and of the motion capture itself are not counted.
"""

import numpy as np

from dior import camera as cam
from dior import covariance as cov


def of_labels(camera, points, noise, makers, names, joint):
    """Covariance (..., 2, 2) px^2 of the labels of `camera` at world points (..., 3) m; NaN where it is not known.

    `noise` (..., 3, 3) m^2 given the cameras. `makers`: cameras that the points were triangulated from, none for
    motion capture. `joint` (6N, 6N): covariance of the errors of the cameras called `names`, in which are the makers
    and `camera`.
    """
    by_point, by_camera = cov.projection(camera, points)
    by_all = np.zeros((*points.shape[:-1], 2, len(names), 6))
    by_all[..., names.index(camera.name), :] = by_camera
    if makers:
        seen = np.stack([cam.in_frame(c.intrinsics, cam.project(c, points)[0]) for c in makers])
        _, moves = cov.triangulated(makers, points, seen[..., None, None] * np.eye(2))
        moves = (by_point @ moves).reshape(*points.shape[:-1], 2, len(makers), 6)
        for i, maker in enumerate(makers):
            by_all[..., names.index(maker.name), :] += moves[..., i, :]
    by_all = by_all.reshape(*points.shape[:-1], 2, 6 * len(names))
    return by_point @ noise @ np.swapaxes(by_point, -1, -2) + by_all @ joint @ np.swapaxes(by_all, -1, -2)


def columns(covariance):
    """sigma_u, sigma_v (px) and rho_uv, each (...,), of covariances (..., 2, 2)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
        rho = covariance[..., 0, 1] / (sigma[..., 0] * sigma[..., 1])
    return sigma[..., 0], sigma[..., 1], rho
