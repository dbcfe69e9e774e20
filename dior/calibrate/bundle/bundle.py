"""The initial solution of an adjustment: camera poses and points with fixed intrinsics, by GTSAM.

INPUTS   cameras with start poses, ideal pixels and points, priors on the poses
OUTPUTS  cameras and points with the least robust cost

GTSAM's lens models lack k3, so it works on ideal pixels: recorded pixels undistorted once by `dior.geometry.camera`,
mapped back with K, and Cal3_S2. World in metres. Costs are GTSAM's: half the sum of squared whitened residuals, Huber
beyond 1.345 sigma.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dior.arrays import Floats
from dior.errors import DiorError
from dior.geometry.camera import Camera, Intrinsics, undistort

# Huber's constant: 95 % efficient for Gaussian residuals (Huber and Ronchetti, Robust Statistics, 2009)
HUBER = 1.345
POINT = 1 << 32  # keys of the points: above any number of cameras
MOST_ITERATIONS = 100  # GTSAM's default


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of a camera beforehand: position (3,) m and rotation wRc (3, 3), each with its sigma (m, rad)."""

    position: Floats
    sigma_m: float
    wRc: Floats
    sigma_rad: float


@dataclass(frozen=True)
class Optimum:
    """GTSAM values with the least cost, the cost before and after, and the number of accepted iterations."""

    values: Any
    before: float
    after: float
    iterations: int


def ideal_pixels(intrinsics: Intrinsics, uv: Floats) -> Floats:
    """Recorded pixels (..., 2) to the pixels (..., 2) of a lens without distortion and the same K."""
    return undistort(intrinsics, uv) * (intrinsics.fx, intrinsics.fy) + (intrinsics.cx, intrinsics.cy)


def robust(sigma: float) -> Any:
    """GTSAM noise of a detection with `sigma` (px, both axes) that counts linearly beyond 1.345 sigma (Huber)."""
    import gtsam

    huber = gtsam.noiseModel.mEstimator.Huber.Create(HUBER)
    return gtsam.noiseModel.Robust.Create(huber, gtsam.noiseModel.Isotropic.Sigma(2, sigma))


def build(
    cameras: Sequence[Camera], uv: Floats, points: Floats, priors: Sequence[Prior], sigma_px: Sequence[float] | Floats
) -> tuple[Any, Any]:
    """GTSAM graph and start values of V cameras and N points.

    `uv` (V, N, 2) recorded px, NaN where not seen; `points` (N, 3) m; `priors` one per camera; `sigma_px` (V,). Keys:
    the camera's index, and POINT plus the point's index.
    """
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for view, camera in enumerate(cameras):
        lens = camera.intrinsics
        K = gtsam.Cal3_S2(lens.fx, lens.fy, 0.0, lens.cx, lens.cy)
        noise = robust(sigma_px[view])
        ideal = ideal_pixels(lens, uv[view])
        for j in np.flatnonzero(np.isfinite(ideal).all(axis=1)).tolist():
            graph.push_back(gtsam.GenericProjectionFactorCal3_S2(ideal[j], noise, view, POINT + j, K))
        prior = priors[view]
        graph.push_back(
            gtsam.PoseTranslationPrior3D(view, prior.position, gtsam.noiseModel.Isotropic.Sigma(3, prior.sigma_m))
        )
        graph.push_back(
            gtsam.PoseRotationPrior3D(view, gtsam.Rot3(prior.wRc), gtsam.noiseModel.Isotropic.Sigma(3, prior.sigma_rad))
        )
        values.insert(view, gtsam.Pose3(camera.wTc))
    for j, point in enumerate(points):
        values.insert(POINT + j, point)
    return graph, values


def optimise(graph: Any, values: Any, where: str, tolerance: float = 1e-5) -> Optimum:
    """Levenberg-Marquardt from `values`, to an `Optimum`.

    Raises DiorError, beginning with `where`: no accepted iteration, or a final cost not below the start, unless the
    start is a minimum already; a problem that does not determine its unknowns.
    """
    import gtsam

    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(tolerance)
    params.setMaxIterations(MOST_ITERATIONS)
    params.setOrdering(_ordering(values))
    before = graph.error(values)
    if not np.isfinite(before):
        raise DiorError(f"{where}: the cost of the start is not finite; check the placed cameras")
    try:
        optimiser = gtsam.LevenbergMarquardtOptimizer(graph, values, params)
        best = optimiser.optimize()
    except RuntimeError as error:
        said = str(error).strip().splitlines()[:1]
        raise DiorError(
            f"{where}: the adjustment cannot be solved ({said[0] if said else 'an undetermined system'}); are the "
            "cameras placed and aimed roughly right and do they see the same person?"
        ) from None
    after, iterations = graph.error(best), optimiser.iterations()
    if (iterations == 0 or not after < before) and not is_minimum(graph, values):
        reason = "no iteration was accepted" if iterations == 0 else "the final cost is not below the start"
        raise DiorError(
            f"{where}: the adjustment made no progress, {reason} (cost {before:.6g} to {after:.6g}); place the cameras "
            "better (tape.position_m, tape.target_m)"
        )
    return Optimum(best, before, after, iterations)


def _ordering(values: Any) -> Any:
    """Points first, then cameras: the Schur complement, in half the time of a general ordering.

    GTSAM 4.3's SfmLevenbergMarquardtOptimizer is a quarter faster, but gives up (or crashes in METIS) on starts from
    which this one converges.
    """
    import gtsam

    ordering = gtsam.Ordering()
    for key in sorted(values.keys(), reverse=True):
        ordering.push_back(key)
    return ordering


def is_minimum(graph: Any, values: Any) -> bool:
    """Whether a Gauss-Newton step promises less than a millionth of the cost (or nothing next to one residual)."""
    import gtsam

    linear = graph.linearize(values)
    try:
        step = linear.optimize()
    except RuntimeError:
        return False
    start = linear.error(gtsam.VectorValues.Zero(step))
    promised = start - linear.error(step)
    return bool(promised <= 1e-6 * start + 1e-9)


def poses(values: Any, count: int) -> Floats:
    """wTc (count, 4, 4) of the cameras in an optimum's values."""
    return np.array([values.atPose3(view).matrix() for view in range(count)])


def points(values: Any, count: int) -> Floats:
    """World points (count, 3) m of an optimum's values."""
    return np.array([values.atPoint3(POINT + j) for j in range(count)]).reshape(-1, 3)
