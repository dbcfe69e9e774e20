"""Points as they might have been: what the errors of a walk's 3D leave open, drawn with a seed.

INPUTS   points (T, J, 3) m, their covariance, the share of it that lasts, in which time the rest forgets
OUTPUTS  points (T, J, 3) m with one more error of that size
"""

import numpy as np

from dior.arrays import Bools, Floats
from dior.gait.tracks import MARKER_SIGMA_M, SKIN_SIGMA_M

# of a marker, whose error nobody knows: the skin slides to and fro with every step; chosen: a quarter of one
SKIN_S = 0.15


def drawn(
    random: np.random.Generator, rate: float, points: Floats, covariance: Floats, lasting: Floats, noise_time_s: float
) -> Floats:
    """The points of frames at `rate` Hz with errors of their `covariance` (T, J, 3, 3) m^2, joint by joint.

    `lasting` (T, J): which share of it is the same throughout. The correlation of the rest falls to exp(-1/2) in
    `noise_time_s`. Where the covariance is NaN it is a marker's.
    """
    root, share, times = _root(covariance), np.nan_to_num(lasting), (noise_time_s, SKIN_S)
    of_markers: Bools = np.asarray(~np.isfinite(covariance).all(axis=(-1, -2)))
    share = np.where(of_markers, 0.0, np.clip(share, 0.0, 1.0))[..., None]
    root = np.where(of_markers[..., None, None], np.hypot(MARKER_SIGMA_M, SKIN_SIGMA_M) * np.eye(3), root)
    constant = random.standard_normal(points.shape[1:])
    changing = [_smooth(random.standard_normal(points.shape), time_s * rate) for time_s in times]
    unit = np.sqrt(share) * constant + np.sqrt(1 - share) * np.where(of_markers[..., None], changing[1], changing[0])
    return np.asarray(points + np.einsum("tjab,tjb->tja", root, unit))


def _root(covariance: Floats) -> Floats:
    """Matrices (T, J, 3, 3) of which each times its transpose is the covariance."""
    values, axes = np.linalg.eigh(np.nan_to_num(covariance))
    return np.asarray(axes * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def _smooth(noise: Floats, frames: float) -> Floats:
    """White noise (T, ...) of variance 1 as noise of that variance whose correlation is exp(-1/2) after `frames`."""
    if frames <= 0:
        return noise
    from scipy.ndimage import gaussian_filter1d

    sigma = frames / np.sqrt(2)
    # wrapped around, so that noise near the ends is as strong as elsewhere
    smooth = gaussian_filter1d(noise, sigma, axis=0, mode="wrap")
    bell = gaussian_filter1d(np.eye(1, len(noise))[0], sigma, mode="wrap")
    return np.asarray(smooth / np.sqrt((bell**2).sum()))
