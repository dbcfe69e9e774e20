"""The adjustment with the points eliminated: 6 unknowns a camera, every metric fact a measurement of the cameras.

INPUTS   cameras near the optimum, ideal pixels with their sigmas, points, facts (`dior.calibrate.bundle.facts`)
OUTPUTS  cameras and points with the least robust cost, the normal equations at it

A point is the least squares point of the pixels that see it, hence a function of the cameras, and a length between
joints is one, too: a fact that is measured once weighs once, however many frames show it. Cameras' errors are those
of `dior.geometry.covariance` (turn about the camera's own axes, shift in the world); pixels are ideal (undistorted,
same K), residuals are divided by their sigma, with Huber weights. World in metres.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Floats, Ints
from dior.calibrate.bundle.bundle import HUBER
from dior.geometry import covariance
from dior.geometry.camera import Camera

MOST_ITERATIONS = 30  # chosen: a finding tells where they were not enough
SETTLED = 5e-4  # chosen: of the cost, half the square of how far the cameras still move in their (too small) sigmas
NEAREST_M = 0.05  # chosen: a point nearer to the camera's plane is not seen; its projection has no useful slope


@dataclass(frozen=True, eq=False)
class Row:
    """m residuals of a fact and their derivatives, all divided by the sigma.

    `by_cameras` (m, 6V) with the points fixed, `points` (k,) which points it speaks of, `by_points` (m, k, 3).
    `by_lens` (m, 3V): by a relative error of the focal length and by shifts of the principal point in focal lengths.
    """

    residual: Floats
    by_cameras: Floats
    points: Ints
    by_points: Floats
    by_lens: Floats

    @classmethod
    def of_cameras(cls, residual: ArrayLike, by_cameras: Floats, by_lens: Floats | None = None) -> "Row":
        m, n = by_cameras.shape
        lens = np.zeros((m, n // 2)) if by_lens is None else by_lens
        return cls(np.asarray(residual, float), by_cameras, np.zeros(0, int), np.zeros((m, 0, 3)), lens)


# a metric fact as `solve` takes it: (cameras, points (N, 3), noise (N, 3, 3) of the points) to its `Row`
RowOf: TypeAlias = Callable[[Sequence[Camera], Floats, Floats], Row]


@dataclass(frozen=True, eq=False)
class Observed:
    """`ideal` (V, N, 2) px, NaN where not seen; `sigma_px` (V, N).

    The first `detected` points are a detector's, their sigma is a guess; the others' (marked by hand) is right.
    """

    ideal: Floats
    sigma_px: Floats
    detected: int


@dataclass(frozen=True, eq=False)
class Linear:
    """The problem at some cameras and points: derivatives and residuals divided by their sigmas, Huber weighted.

    By the point `J` (V, 2, 3, N) and by its camera `C` (V, 2, 6, N), residuals (predicted less seen) `r` (V, 2, N),
    zeros where not seen; the points come last, which is several times as fast. `root` (V, N): what a pixel is
    multiplied with. `scale` (V, N) px/m at the point, `pixel` (V, 2, N) predicted, from the principal point. `noise`
    (N, 3, 3): covariance of a point by the pixels' sigmas; `factor` (3, 3, N) with `factor^T factor = noise`.
    `variance` (N,): by what it is to be multiplied, from the residuals.
    `mixed` (3, 6V, N) = sum J^T C and `gradient` (3, N) = sum J^T r. `cost`: robust, of the pixels.
    """

    J: Floats
    C: Floats
    r: Floats
    root: Floats
    scale: Floats
    pixel: Floats
    noise: Floats
    factor: Floats
    variance: Floats
    mixed: Floats
    gradient: Floats
    cost: float


@dataclass(frozen=True, eq=False)
class Solved:
    """Adjusted `cameras`, `points` (N, 3), the `Linear` problem there, its `normal` matrix (6V, 6V), `iterations`."""

    cameras: list[Camera]
    points: Floats
    linear: Linear
    normal: Floats
    facts: list[Row]
    iterations: int


def linearise(cameras: Sequence[Camera], observed: Observed, points: Floats) -> Linear:
    """The pixels' part of the problem at these cameras and points (N, 3), as `Linear`."""
    X, parts, cost = np.ascontiguousarray(points.T), [], 0.0
    for camera, ideal, sigma in zip(cameras, observed.ideal, observed.sigma_px, strict=True):
        one, its_cost = _view(camera, ideal.T, sigma, X)
        parts.append(one)
        cost += its_cost
    J, C, r, root, scale, pixel = (np.stack(part) for part in zip(*parts, strict=True))
    N = np.stack(
        [(J[:, :, a] * J[:, :, b]).sum(axis=(0, 1)) for a, b in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]
    )
    N[:, (root > 0).sum(axis=0) < 2] = np.array([1e12, 0, 0, 1e12, 0, 1e12])[:, None]
    noise, factor = _inverse(N)
    mixed = np.concatenate(
        [np.stack([(J[v, :, a, None] * C[v]).sum(axis=0) for a in range(3)]) for v in range(len(J))], axis=1
    )
    gradient = np.stack([(J[:, :, a] * r).sum(axis=(0, 1)) for a in range(3)])
    known, count = observed.detected, (root > 0).sum(axis=0)
    free = 2 * count[:known].sum() - 3 * (count[:known] >= 2).sum()
    usual = np.sum(r[..., :known] ** 2) / free if free > 0 else 1.0
    variance = np.where(np.arange(len(points)) < known, usual, 1.0)
    return Linear(J, C, r, root, scale, pixel, noise, factor, variance, mixed, gradient, cost)


def _view(camera: Camera, ideal: Floats, sigma: Floats, X: Floats) -> tuple[tuple[Floats, ...], float]:
    """One camera's part of `Linear` and its cost, from its pixels (2, N), their sigma (N,) and points (3, N)."""
    lens, R = camera.intrinsics, camera.wRc
    p = R.T @ (X - camera.centre[:, None])
    seen = np.isfinite(ideal).all(axis=0) & (p[2] > NEAREST_M)
    p = np.where(seen, p, np.array([[0.0], [0.0], [1.0]]))
    x, y, inverse = p[0] / p[2], p[1] / p[2], 1 / p[2]
    pixel = np.stack([lens.fx * x, lens.fy * y])
    r = np.where(seen, pixel + np.array([[lens.cx], [lens.cy]]) - ideal, 0.0) / sigma
    norm = np.hypot(*r)
    far = norm > HUBER
    cost = np.where(far, HUBER * (norm - HUBER / 2), norm**2 / 2).sum()
    turned_down = np.sqrt(np.where(far, HUBER / np.maximum(norm, HUBER), 1.0)) * seen
    root = turned_down / sigma
    a, b = lens.fx * root, lens.fy * root
    zero = np.zeros_like(x)
    axes = np.stack([np.stack([a * inverse, zero, -a * x * inverse]), np.stack([zero, b * inverse, -b * y * inverse])])
    J = np.stack([R @ one for one in axes])
    # a turn w about the camera's axes makes p x w of p
    turn = np.stack([np.stack([a * x * y, -a * (1 + x * x), a * y]), np.stack([b * (1 + y * y), -b * x * y, -b * x])])
    return (J, np.concatenate([turn, -J], axis=1), r * turned_down, root, root * lens.fx * inverse, pixel), cost


def _inverse(N: Floats) -> tuple[Floats, Floats]:
    """Inverse (N, 3, 3) of symmetric matrices, upper triangles (6, N), and (3, 3, N) with `F^T F` = the inverse."""
    a, d, e, f, g, h = N
    A = np.stack([f * h - g * g, e * g - d * h, d * g - e * f, a * h - e * e, d * e - a * g, a * f - d * d])
    A = A / np.maximum(a * A[0] + d * A[1] + e * A[2], 1e-300)
    F = np.zeros((3, 3, N.shape[1]))
    F[0, 0] = np.sqrt(A[0])
    F[0, 1], F[0, 2] = A[1] / F[0, 0], A[2] / F[0, 0]
    F[1, 1] = np.sqrt(np.maximum(A[3] - F[0, 1] ** 2, 1e-30))
    F[1, 2] = (A[4] - F[0, 1] * F[0, 2]) / F[1, 1]
    F[2, 2] = np.sqrt(np.maximum(A[5] - F[0, 2] ** 2 - F[1, 2] ** 2, 1e-30))
    return np.moveaxis(A[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])], -1, 0), F


def eliminated(factor: Floats, values: Floats) -> Floats:
    """`factor` (3, 3, N) times values (3, Q, N), as (Q, 3N): its products are what the points take away."""
    F = factor
    out = np.stack(
        [F[0, 0] * values[0] + F[0, 1] * values[1] + F[0, 2] * values[2], F[1, 1] * values[1] + F[1, 2] * values[2],
         F[2, 2] * values[2]],
        axis=1,
    )  # fmt: skip
    return out.reshape(len(out), -1)


def equations(linear: Linear, facts: Sequence[Row]) -> tuple[Floats, Floats]:
    """Normal equations of the cameras, H (6V, 6V) and g (6V,): the step is `-H^-1 g`.

    `facts`: `Row`s at the same cameras and points.
    """
    views = len(linear.C)
    H, g = np.zeros((6 * views, 6 * views)), np.zeros(6 * views)
    for v in range(views):
        C = np.swapaxes(linear.C[v], 0, 1).reshape(6, -1)
        H[6 * v : 6 * v + 6, 6 * v : 6 * v + 6] = C @ C.T
        g[6 * v : 6 * v + 6] = C @ linear.r[v].ravel()
    F = eliminated(linear.factor, linear.mixed)
    H -= F @ F.T
    g -= F @ eliminated(linear.factor, linear.gradient[:, None])[0]
    for row in facts:
        h = total(row, linear)
        moved = -(linear.noise[row.points] @ linear.gradient.T[row.points][..., None])[..., 0]
        residual = row.residual + np.einsum("mka,ka->m", row.by_points, moved)
        H += h.T @ h
        g += h.T @ residual
    return H, g


def total(row: Row, linear: Linear) -> Floats:
    """Derivative (m, 6V) of a fact by the cameras, with the points that follow them."""
    if not len(row.points):
        return row.by_cameras
    follow = linear.noise[row.points] @ np.moveaxis(linear.mixed[..., row.points], -1, 0)
    return row.by_cameras - np.einsum("mka,kac->mc", row.by_points, follow)


def solve(cameras: Sequence[Camera], observed: Observed, points: Floats, facts: Sequence[RowOf]) -> Solved:
    """Levenberg-Marquardt on the cameras from a start near the optimum, to `Solved`.

    `facts`: functions of (cameras, points, noise) to a `Row`s. Costs may only fall.
    """
    cameras, points = list(cameras), np.asarray(points, float)

    def at(cameras: list[Camera], points: Floats) -> tuple[Linear, list[Row], float]:
        linear = linearise(cameras, observed, points)
        rows = [fact(cameras, points, linear.noise * linear.variance[:, None, None]) for fact in facts]
        return linear, rows, linear.cost + sum(float(0.5 * row.residual @ row.residual) for row in rows)

    linear, rows, cost = at(cameras, points)
    damping, iteration = 0.0, 0
    while iteration < MOST_ITERATIONS:
        iteration += 1
        H, g = equations(linear, rows)
        for _ in range(12):
            step = np.asarray(-np.linalg.solve(H + damping * np.diag(np.diag(H)), g), float)
            tried = [covariance.moved(c, s) for c, s in zip(cameras, step.reshape(-1, 6), strict=True)]
            moved = linear.gradient + np.einsum("acn,c->an", linear.mixed, step)
            followed = points - (linear.noise @ moved.T[..., None])[..., 0]
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
