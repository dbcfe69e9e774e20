"""The adjustment with the points eliminated: 6 unknowns a camera, every metric fact a measurement of the cameras.

INPUTS   cameras near the optimum, ideal pixels with their sigmas, points, facts (`dior.calibrate.facts`)
OUTPUTS  cameras and points with the least robust cost, the normal equations at it

A point is the least squares point of the pixels that see it, hence a function of the cameras, and a length between
joints is one, too: a fact that is measured once weighs once, however many frames show it. Cameras' errors are those
of `dior.covariance` (turn about the camera's own axes, shift in the world); pixels are ideal (undistorted, same K),
residuals are divided by their sigma, with Huber weights. World in metres.
"""

from dataclasses import dataclass, replace

import numpy as np

from dior import covariance
from dior.calibrate.bundle import HUBER

MOST_ITERATIONS = 30
SETTLED = 2e-3  # of the cost, half the square of how far the cameras still move in their (too small) sigmas
NEAREST_M = 0.05


@dataclass(frozen=True)
class Observed:
    """`ideal` (V, N, 2) px, NaN where not seen; `sigma_px` (V, N)."""

    ideal: np.ndarray
    sigma_px: np.ndarray


@dataclass(frozen=True)
class Linear:
    """The problem at some cameras and points: derivatives and residuals divided by their sigmas, Huber weighted.

    By the point `J` (V, N, 2, 3) and by its camera `C` (V, N, 2, 6), residuals (predicted less seen) `r` (V, N, 2),
    zeros where not seen. `root` (V, N): what a pixel is multiplied with. `focal_px` and `depth` (V, N) of the points;
    `pixel` (V, N, 2): predicted, from the principal point. `noise` (N, 3, 3): covariance of a point by the pixels'
    sigmas, `factor` (N, 3, 3) with `factor^T factor = noise`. `cost`: robust.
    """

    J: np.ndarray
    C: np.ndarray
    r: np.ndarray
    root: np.ndarray
    focal_px: np.ndarray
    depth: np.ndarray
    pixel: np.ndarray
    noise: np.ndarray
    factor: np.ndarray
    cost: float


@dataclass(frozen=True)
class Solved:
    """Adjusted `cameras`, `points` (N, 3), the `Linear` problem there, its `normal` matrix (6V, 6V), `iterations`."""

    cameras: list
    points: np.ndarray
    linear: Linear
    normal: np.ndarray
    facts: list
    iterations: int


def linearise(cameras, observed, points):
    """The pixels' part of the problem at these cameras and points (N, 3), as `Linear`."""
    R = np.stack([c.wRc for c in cameras])
    f = np.array([[c.intrinsics.fx, c.intrinsics.fy] for c in cameras])
    middle = np.array([[c.intrinsics.cx, c.intrinsics.cy] for c in cameras])
    p = np.stack([(points - c.centre) @ c.wRc for c in cameras])
    z = p[..., 2]
    seen = np.isfinite(observed.ideal).all(axis=-1) & (z > NEAREST_M)
    z = np.where(seen, z, 1.0)
    pixel = p[..., :2] / z[..., None] * f[:, None]
    r = np.where(seen[..., None], pixel + middle[:, None] - observed.ideal, 0.0) / observed.sigma_px[..., None]
    norm = np.linalg.norm(r, axis=-1)
    weight = np.where(norm > HUBER, HUBER / np.maximum(norm, HUBER), 1.0) * seen
    cost = np.where(norm > HUBER, HUBER * (norm - HUBER / 2), norm**2 / 2).sum()
    root = np.sqrt(weight) / observed.sigma_px
    axes = np.zeros((*z.shape, 2, 3))
    axes[..., 0, 0], axes[..., 1, 1] = f[:, None, 0] / z, f[:, None, 1] / z
    axes[..., 2] = -pixel / z[..., None]
    axes *= root[..., None, None]
    J = axes @ np.swapaxes(R, 1, 2)[:, None]
    C = np.concatenate([axes @ covariance.cross(np.where(seen[..., None], p, 0.0)), -J], axis=-1)
    N = np.einsum("vnia,vnib->nab", J, J)
    enough = seen.sum(axis=0) >= 2
    N = np.where(enough[:, None, None], N, np.eye(3) * 1e12)
    noise = np.linalg.inv(N + 1e-9 * np.trace(N, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3))
    factor = np.swapaxes(np.linalg.cholesky(noise), -1, -2)
    r = r * np.sqrt(weight)[..., None]
    return Linear(
        J, C, r, root, f.mean(axis=1)[:, None] + 0 * z, z, np.where(seen[..., None], pixel, 0.0), noise, factor, cost
    )


def by_all_cameras(linear):
    """What the points share with the cameras, `sum J^T C` (N, 3, 6V)."""
    return np.concatenate([np.swapaxes(J, -1, -2) @ C for J, C in zip(linear.J, linear.C, strict=True)], axis=-1)


def equations(linear, facts):
    """Normal equations of the cameras, H (6V, 6V) and g (6V,), and what eliminates the points.

    `facts`: `facts.Row` at the same cameras and points. The step is `-H^-1 g`. Also returns the mixed blocks
    (N, 3, 6V) and the gradient (N, 3) of the points.
    """
    views = len(linear.C)
    B = by_all_cameras(linear)
    b = np.einsum("vnia,vni->na", linear.J, linear.r)
    H, g = np.zeros((6 * views, 6 * views)), np.zeros(6 * views)
    for v in range(views):
        C = linear.C[v].reshape(-1, 6)
        H[6 * v : 6 * v + 6, 6 * v : 6 * v + 6] = C.T @ C
        g[6 * v : 6 * v + 6] = C.T @ linear.r[v].ravel()
    F = (linear.factor @ B).reshape(-1, 6 * views)
    H -= F.T @ F
    g -= F.T @ (linear.factor @ b[..., None]).ravel()
    for row in facts:
        h = total(row, linear, B)
        moved = -np.einsum("kab,kb->ka", linear.noise[row.points], b[row.points])
        residual = row.residual + np.einsum("mka,ka->m", row.by_points, moved)
        H += h.T @ h
        g += h.T @ residual
    return H, g, B, b


def total(row, linear, B):
    """Derivative (m, 6V) of a fact by the cameras, with the points that follow them."""
    if not len(row.points):
        return row.by_cameras
    follow = np.einsum("kab,kbc->kac", linear.noise[row.points], B[row.points])
    return row.by_cameras - np.einsum("mka,kac->mc", row.by_points, follow)


def solve(cameras, observed, points, facts):
    """Levenberg-Marquardt on the cameras from a start near the optimum, to `Solved`.

    `facts`: functions of (cameras, points, noise) to a `facts.Row`. Costs may only fall.
    """
    cameras, points = list(cameras), np.asarray(points, float)

    def at(cameras, points):
        linear = linearise(cameras, observed, points)
        rows = [fact(cameras, points, linear.noise) for fact in facts]
        return linear, rows, linear.cost + sum(0.5 * row.residual @ row.residual for row in rows)

    linear, rows, cost = at(cameras, points)
    damping, iteration = 0.0, 0
    while iteration < MOST_ITERATIONS:
        iteration += 1
        H, g, B, b = equations(linear, rows)
        for _ in range(12):
            step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            tried = [covariance.moved(c, s) for c, s in zip(cameras, step.reshape(-1, 6), strict=True)]
            followed = points - np.einsum("nab,nb->na", linear.noise, b + B @ step)
            new_linear, new_rows, new_cost = at(tried, followed)
            if new_cost <= cost * (1 + 1e-12):
                break
            damping = max(10 * damping, 1e-6)
        else:
            break
        promised = -0.5 * g @ step
        cameras, points, linear, rows, cost = tried, followed, new_linear, new_rows, new_cost
        damping = damping / 10 if damping > 1e-9 else 0.0
        if promised < SETTLED:
            break
    return Solved(cameras, points, linear, equations(linear, rows)[0], rows, iteration)


def only(observed, keep):
    """The observations of the points of a mask or index (N,)."""
    return replace(observed, ideal=observed.ideal[:, keep], sigma_px=observed.sigma_px[:, keep])
