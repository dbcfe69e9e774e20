"""Points from the views of a rig by weighted linear equations in ideal coordinates, many at once.

World in metres; pixels are recorded ones. Weights are 1/px, 0 for a view without a say.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints
from dior.geometry import camera as cam

BLOCK = 4096  # points at once: they stay in the cache of a processor


@dataclass(frozen=True, eq=False)
class Rig:
    """`linear` and `origin` of `_equations`; `rows` (V, 3, 4): cTw from that origin; `cameras`."""

    cameras: tuple[cam.Camera, ...]
    linear: Floats
    origin: Floats
    rows: Floats


@dataclass(frozen=True, eq=False)
class Views:
    """What the views of a rig say, flat: coordinates x, y and weights w (V, N); 1/w is the noise of x and y."""

    rig: Rig
    x: Floats
    y: Floats
    w: Floats

    def at(self, columns: Ints | Bools | slice) -> "Views":
        """The views of some points."""
        return Views(self.rig, self.x[:, columns], self.y[:, columns], self.w[:, columns])


def rig_of(cameras: Sequence[cam.Camera]) -> Rig:
    """The `Rig` of placed cameras."""
    return rig_of_poses([cam.inverse_pose(c.wTc) for c in cameras], cameras)


def rig_of_poses(cTw: ArrayLike, cameras: Sequence[cam.Camera] = ()) -> Rig:
    """The `Rig` of poses cTw (V, 4, 4); without `cameras` for ideal coordinates only (`views_of_ideal`)."""
    cTw = np.asarray(cTw, float)
    linear, origin = _equations(cTw)
    rows = cTw[:, :3].copy()
    rows[..., 3] += rows[..., :3] @ origin
    return Rig(tuple(cameras), linear, origin, rows)


def views_of(rig: Rig, uv: Floats, weights: Floats) -> Views:
    """`Views` of pixels (V, ..., 2) with weights (V, ...) in 1/px; a missing one has weight 0."""
    xy = [cam.undistort(c.intrinsics, view).reshape(-1, 2) for c, view in zip(rig.cameras, uv, strict=True)]
    x, y = (np.stack([view[:, i] for view in xy]) for i in range(2))
    focal = np.array([c.intrinsics.fx for c in rig.cameras])
    return views_of_ideal(rig, x, y, weights.reshape(len(xy), -1) * focal[:, None])


def views_of_ideal(rig: Rig, x: Floats, y: Floats, w: Floats) -> Views:
    """`Views` of ideal normalised coordinates and weights (V, N); a missing one has weight 0."""
    seen = np.isfinite(x + y) & (w > 0)
    if not seen.all():
        x, y, w = (np.where(seen, values, 0.0) for values in (x, y, w))
    return Views(rig, x, y, w)


def meet_unscaled(views: Views) -> tuple[Floats, Floats]:
    """Points (3, N) from the rig's origin, the equations weighted as they are, and their sum of squares (N,).

    NaN with fewer than two views and where the rays are parallel.
    """
    points, left, fine = _least_squares(views.rig.linear, views.x, views.y, views.w * views.w)
    fine &= (views.w > 0).sum(axis=0) >= 2
    points[:, ~fine] = np.nan
    return points, left


def meet(views: Views) -> tuple[Floats, Floats]:
    """Points (3, N) from the rig's origin and their chi squared (N,); NaN where they meet nowhere.

    The equations are weighted by the depths of a first solution, which makes them the reprojection's own. A point
    behind a view that has a say is nowhere.
    """
    axes, shift = views.rig.rows[:, 2, :3], views.rig.rows[:, 2, 3:]
    says = views.w > 0
    with np.errstate(all="ignore"):
        first, _, _ = _least_squares(views.rig.linear, views.x, views.y, views.w * views.w)
        w2 = views.w / (axes @ first + shift)
        w2 *= w2
        points, chi2, fine = _least_squares(views.rig.linear, views.x, views.y, w2)
        fine &= ((axes @ points + shift > 0) | ~says).all(axis=0) & (says.sum(axis=0) >= 2)
    points[:, ~fine] = np.nan
    chi2[~fine] = np.nan
    return points, np.maximum(chi2, 0.0, out=chi2)


def in_blocks(solve: Callable[[Views], tuple[Floats, Floats]], views: Views) -> tuple[Floats, Floats]:
    """`meet` or `meet_unscaled` of many points, in blocks that stay in the processor's cache."""
    count = views.x.shape[1]
    points, left = np.empty((3, count)), np.empty(count)
    for start in range(0, count, BLOCK):
        block = slice(start, start + BLOCK)
        points[:, block], left[block] = solve(views.at(block))
    return points, left


def meet_in_blocks(views: Views) -> tuple[Floats, Floats]:
    """`meet` of many points."""
    return in_blocks(meet, views)


def triangulate(cTw: ArrayLike, xy: Floats, weights: ArrayLike) -> Floats:
    """Weighted linear triangulation of many points (Hartley and Zisserman 12.2, p. 312, inhomogeneous).

    `cTw` (V, 4, 4) world to camera in any unit, `xy` (V, ..., 2) ideal normalised coordinates, `weights` (V, ...) of
    the equations as they are (`meet` scales them by the depths). A missing coordinate or a weight of 0 leaves the
    view out. Returns (..., 3), NaN with fewer than two views or where the rays are parallel.
    """
    shape = xy.shape[1:-1]
    rig = rig_of_poses(cTw)
    x, y = (xy[..., i].reshape(len(xy), -1) for i in range(2))
    views = views_of_ideal(rig, x, y, np.broadcast_to(weights, xy.shape[:-1]).reshape(x.shape))
    points, _ = in_blocks(meet_unscaled, views)
    return (points.T + rig.origin).reshape(*shape, 3)


def triangulated(cameras: Sequence[cam.Camera], uv: Floats) -> Floats:
    """World points (..., 3) m of recorded pixels (V, ..., 2), every view with the same noise in px; see `meet`."""
    rig = rig_of(cameras)
    points, _ = meet_in_blocks(views_of(rig, uv, np.ones(uv.shape[:-1])))
    return (points.T + rig.origin).reshape(*uv.shape[1:-1], 3)


def with_every_view(rig: Rig, uv: Floats, weights: Floats) -> tuple[Floats, Floats, Bools, Floats, Floats]:
    """Points of pixels (V, T, J, 2) and weights (V, T, J) 1/px, whether their views agree or not; N = T J.

    Points (3, N) from the rig's origin, chi squared (N,), views used (V, N), and both `mean_errors`.
    """
    joints = uv.shape[2]
    count = uv.shape[1] * joints
    points, left, used = np.empty((3, count)), np.empty((3, count)), np.empty((len(uv), count), bool)
    step = max(1, BLOCK // joints)
    for start in range(0, uv.shape[1], step):
        block = slice(start * joints, (start + step) * joints)
        some = uv[:, start : start + step]
        views = views_of(rig, some, weights[:, start : start + step])
        points[:, block], left[0, block] = meet(views)
        used[:, block] = views.w > 0
        left[1:, block] = mean_errors(rig, points[:, block], some.reshape(len(uv), -1, 2), used[:, block])
    return points, left[0], used, left[1], left[2]


def mean_errors(rig: Rig, points: Floats, uv: Floats, used: Bools) -> tuple[Floats, Floats]:
    """Mean distance (N,) of recorded pixels uv (V, N, 2) used (V, N) from the projected points: px, and at fx 1680."""
    pixels, scaled = np.zeros((2, len(used[0])))
    for camera, rows, view, say in zip(rig.cameras, rig.rows, uv, used, strict=True):
        p = rows[:, :3] @ points + rows[:, 3:]
        with np.errstate(all="ignore"):
            off = cam.distort(camera.intrinsics, (p[:2] / p[2]).T).T
            du, dv = off[0] - view[:, 0], off[1] - view[:, 1]
            error = np.sqrt(du * du + dv * dv)
        error[~say] = 0.0
        pixels += error
        scaled += error * (cam.REFERENCE_FX / camera.intrinsics.fx)
    count = np.maximum(used.sum(axis=0), 1)
    return pixels / count, scaled / count


def residuals(views: Views, points: Floats) -> tuple[Floats, Floats]:
    """Whitened residuals (V, 2, N) of points (3, N), and their share (V, N) of 2 that the view's own say left over."""
    p = views.rig.rows[..., :3] @ points + views.rig.rows[..., 3:]
    scale = views.w / p[:, 2]
    left = np.stack([views.x * p[:, 2] - p[:, 0], views.y * p[:, 2] - p[:, 1]], axis=1) * scale[:, None]
    third = views.rig.rows[:, 2, :3, None]
    J = np.stack(
        [c[:, None] * third - views.rig.rows[:, i, :3, None] for i, c in enumerate((views.x, views.y))], axis=1
    )
    J = np.moveaxis(J * scale[:, None, None], -1, 0)  # (N, V, 2, 3)
    C = np.linalg.inv(np.einsum("nvai,nvaj->nij", J, J))
    return left, 2.0 - np.einsum("nvai,nij,nvaj->vn", J, C, J)


def _equations(cTw: Floats) -> tuple[Floats, Floats]:
    """What `_least_squares` needs of the poses `cTw` (V, 4, 4): a matrix (10, 4V), and the origin (3,) of its points.

    A view says `(x q3 - q1) . (P, 1) = 0` and the same of y, with q the rows of its cTw. The sums of the outer products
    of what is in the first brackets are linear in x^2 + y^2, x, y and 1, so that the normal equations of all points are
    one matrix product.
    The origin is moved between the cameras, which keeps the sums of squares exact far from the world's origin.
    """
    origin = np.mean([-T[:3, :3].T @ T[:3, 3] for T in cTw], axis=0)
    columns = []
    for T in cTw:
        # the last column with the other sign, so that the sums give the right-hand side of the normal equations
        q = np.column_stack([T[:3, :3], -(T[:3, :3] @ origin + T[:3, 3])])
        pair = [-(np.outer(q[i], q[2]) + np.outer(q[2], q[i])) for i in range(2)]
        both = np.outer(q[0], q[0]) + np.outer(q[1], q[1])
        columns += [np.outer(q[2], q[2]), *pair, both]
    rows, at = (0, 0, 0, 1, 1, 2, 0, 1, 2, 3), (0, 1, 2, 1, 2, 2, 3, 3, 3, 3)
    return np.stack(columns, axis=-1)[rows, at], origin


def _least_squares(linear: Floats, x: Floats, y: Floats, squared_weights: Floats) -> tuple[Floats, Floats, Bools]:
    """The points of least squares from coordinates x, y and weights (V, N), all finite; `linear` from `_equations`.

    Returns points (3, N) from the origin of `_equations`, the weighted sum of squares left (N,), and whether the
    equations are well posed (N,).
    """
    w2 = squared_weights
    features = np.stack([w2 * (x * x + y * y), w2 * x, w2 * y, w2], axis=1)
    sums = linear @ features.reshape(4 * len(x), x.shape[1])
    points, well_posed = _solve_symmetric(sums[:6], sums[6:9])
    with np.errstate(invalid="ignore"):
        left = sums[9] - (sums[6] * points[0] + sums[7] * points[1] + sums[8] * points[2])
    return points, left, well_posed


def _solve_symmetric(N: Floats, b: Floats) -> tuple[Floats, Bools]:
    """Solve 3x3 symmetric systems by the adjugate: N (6, n) upper triangle, b (3, n) to (3, n) and a mask (n,).

    A batched SVD costs twenty times as much and gives the same point to 1e-9 m at the ranges of a capture.
    """
    a, d, e, f, g, h = N
    A00, A01, A02 = f * h - g * g, e * g - d * h, d * g - e * f
    A11, A12, A22 = a * h - e * e, d * e - a * g, a * f - d * d
    det = a * A00 + d * A01 + e * A02
    x = np.empty_like(b)
    with np.errstate(all="ignore"):
        x[0] = A00 * b[0] + A01 * b[1] + A02 * b[2]
        x[1] = A01 * b[0] + A11 * b[1] + A12 * b[2]
        x[2] = A02 * b[0] + A12 * b[1] + A22 * b[2]
        x /= det
        trace = (a + f + h) / 3
        well_posed = det > 1e-12 * trace * trace * trace
    return x, well_posed
