"""Geometry that several stages need: look-at, triangulation of many points at once, similarity alignment.

Shapes: views first, then any leading shape `...` (frames, joints). Metres, radians, pixels; NaN is missing.
"""

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints

# points are worked on in blocks that stay in the processor's cache
BLOCK = 4096


def rotation_x(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def rotation_z(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def look_at_angles(centre: ArrayLike, target: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[float, float]:
    """Azimuth and elevation angle (rad) with which `Rz(azimuth) Rx(elevation)` looks from `centre` at `target`.

    The paper's angles (outdoor, step 2) do not look at the origin as printed; these do (design, section 3).
    """
    x, y, z = np.asarray(centre, float) - np.asarray(target, float)
    return np.arctan2(y, x) + np.pi / 2, -(np.pi / 2 + np.arctan2(z, np.hypot(x, y)))


def look_at(centre: ArrayLike, target: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """wRc (3, 3) of an upright camera at `centre` whose optical axis meets `target`."""
    azimuth, elevation = look_at_angles(centre, target)
    return rotation_z(azimuth) @ rotation_x(elevation)


def intersect_rays(origins: ArrayLike, directions: ArrayLike) -> Floats:
    """The paper's ray intersection (outdoor, step 4) for any number of views.

    `origins` (V, 3), `directions` (V, ..., 3) in the world. For every pair of views the end points
    `k + w c` should be equal; the lengths w are found by linear least squares over all pairs and the point is the
    mean of the end points. A view whose direction is NaN takes no part. Returns (..., 3), NaN with fewer than two
    views.

    With unit directions the normal equations need no pair to be written out: for view i
    `(n - 1) w_i - sum_j c_i.c_j w_j = sum_j c_i.(k_j - k_i)` over the other views j that see the point.
    """
    c = np.moveaxis(np.asarray(directions, float), 0, -2)
    k = np.asarray(origins, float)
    views = k.shape[0]
    seen = np.isfinite(c).all(axis=-1)
    c = np.where(seen[..., None], c, 0.0)
    c = c / np.where(seen, np.linalg.norm(c, axis=-1), 1.0)[..., None]
    n = seen.sum(axis=-1)

    others = seen[..., :, None] & seen[..., None, :] & ~np.eye(views, dtype=bool)
    A = -np.where(others, c @ np.swapaxes(c, -1, -2), 0.0)
    diagonal = np.where(seen, n[..., None] - 1, 1)
    A[..., np.arange(views), np.arange(views)] = diagonal
    between = k[None, :, :] - k[:, None, :]
    b = np.einsum("...ix,ijx,...ij->...i", c, between, others.astype(float))
    enough = n >= 2
    A = np.where(enough[..., None, None], A, np.eye(views))
    parallel = np.abs(np.linalg.det(A)) < 1e-12
    A = np.where(parallel[..., None, None], np.eye(views), A)
    w = np.linalg.solve(A, b[..., None])[..., 0]
    ends = k + w[..., None] * c
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (ends * seen[..., None]).sum(axis=-2) / n[..., None]
    return np.where((enough & ~parallel)[..., None], mean, np.nan)


def triangulate(cTw: ArrayLike, xy: Floats, weights: ArrayLike) -> Floats:
    """Weighted linear triangulation of many points (Hartley and Zisserman 12.2, p. 312, inhomogeneous).

    `cTw` (V, 4, 4) world to camera, `xy` (V, ..., 2) ideal normalised coordinates, `weights` (V, ...) of the
    equations. A missing coordinate or a weight of 0 leaves the view out. Returns (..., 3) m, NaN with fewer than two
    views or where the rays are parallel.
    """
    views, shape = len(xy), xy.shape[1:-1]
    xy, weights = xy.reshape(views, -1, 2), np.broadcast_to(weights, (views, *shape)).reshape(views, -1)
    linear, origin = equations(cTw)
    out = np.empty((xy.shape[1], 3))
    for start in range(0, len(out), BLOCK):
        x, y = (np.ascontiguousarray(xy[:, start : start + BLOCK, i]) for i in range(2))
        w = weights[:, start : start + BLOCK]
        seen = np.isfinite(x + y) & (w > 0)
        if not seen.all():
            x, y, w = (np.where(seen, values, 0.0) for values in (x, y, w))
        points, _, well_posed = meet(linear, x, y, w * w)
        good = (seen.sum(axis=0) >= 2) & well_posed
        out[start : start + BLOCK] = np.where(good, points, np.nan).T + origin
    return out.reshape(*shape, 3)


def equations(cTw: ArrayLike) -> tuple[Floats, Floats]:
    """What `meet` needs of the cameras `cTw` (V, 4, 4): a matrix (10, 4V), and the origin (3,) of its points, m.

    A view says `(x q3 - q1) . (P, 1) = 0` and the same of y, with q the rows of its cTw. The sums of the outer products
    of what is in the first brackets are linear in x^2 + y^2, x, y and 1, so that the normal equations of all points are
    one matrix product.
    The origin is moved between the cameras, which keeps the sums of squares exact far from the world's origin.
    """
    cTw = np.asarray(cTw, float)
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


def meet(linear: Floats, x: Floats, y: Floats, squared_weights: Floats) -> tuple[Floats, Floats, Bools]:
    """The points of least squares from coordinates x, y and weights (V, N), all finite; `linear` from `equations`.

    Returns points (3, N) from the origin of `equations`, the weighted sum of squares left (N,), and whether the
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


def similarity(source: Floats, target: Floats, scale: bool = True) -> tuple[float, Floats, Floats]:
    """Scale s, rotation R and translation t that bring `source` (N, 3) to `target` (N, 3) with least squares.

    `target = s R source + t` (Umeyama 1991); rows with a NaN are left out; `scale=False` keeps s = 1.
    """
    good = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1)
    a, b = source[good], target[good]
    if len(a) < 3:
        raise ValueError("a similarity needs at least 3 common points")
    ma, mb = a.mean(axis=0), b.mean(axis=0)
    U, S, Vt = np.linalg.svd((b - mb).T @ (a - ma))
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = U @ D @ Vt
    s = np.trace(np.diag(S) @ D) / ((a - ma) ** 2).sum() if scale else 1.0
    return s, R, mb - s * R @ ma


def side_seen(centre: Floats, left: Floats, middle: Floats) -> Ints:
    """Which side of a body a camera at `centre` (3,) sees (...,): 0 front, 1 left, 2 back, 3 right.

    `left` (..., 2): direction from its right to its left; `middle` (..., 2) of the body, on the floor.
    """
    toward = centre[:2] - middle
    forward = np.stack([left[..., 1], -left[..., 0]], axis=-1)
    angle = np.arctan2((left * toward).sum(axis=-1), (forward * toward).sum(axis=-1))
    return np.round(np.nan_to_num(angle) / (np.pi / 2)).astype(int) % 4
