"""Geometry that several stages need: look-at, triangulation of many points at once, similarity alignment.

Shapes: views first, then any leading shape `...` (frames, joints). Metres, radians, pixels; NaN is missing.
"""

import numpy as np


def rotation_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def rotation_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def look_at_angles(centre, target=(0.0, 0.0, 0.0)):
    """Azimuth and elevation angle (rad) with which `Rz(azimuth) Rx(elevation)` looks from `centre` at `target`.

    The paper's angles (outdoor, step 2) do not look at the origin as printed; these do (design, section 3).
    """
    x, y, z = np.asarray(centre, float) - np.asarray(target, float)
    return np.arctan2(y, x) + np.pi / 2, -(np.pi / 2 + np.arctan2(z, np.hypot(x, y)))


def look_at(centre, target=(0.0, 0.0, 0.0)):
    """wRc (3, 3) of an upright camera at `centre` whose optical axis meets `target`."""
    azimuth, elevation = look_at_angles(centre, target)
    return rotation_z(azimuth) @ rotation_x(elevation)


def intersect_rays(origins, directions):
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


def triangulate(cTw, xy, weights):
    """Weighted linear triangulation of many points (Hartley and Zisserman 12.2, p. 312, inhomogeneous).

    `cTw` (V, 4, 4) world to camera, `xy` (V, ..., 2) ideal normalised coordinates, `weights` (V, ...) of the
    equations. A missing coordinate or a weight of 0 leaves the view out. Returns (..., 3) m, NaN with fewer than two
    views or where the rays are parallel.

    The 3x3 normal equations are accumulated view by view and solved in closed form: a batched SVD costs twenty times
    as much and gives the same point to 1e-9 m at the ranges of a capture.
    """
    seen = np.isfinite(xy).all(axis=-1) & (weights > 0)
    shape = xy.shape[1:-1]
    N = np.zeros((6, *shape))
    b = np.zeros((3, *shape))
    for view in range(len(cTw)):
        w2 = np.where(seen[view], weights[view], 0.0) ** 2
        R, t = cTw[view][:3, :3], cTw[view][:3, 3]
        for axis in range(2):
            coordinate = np.where(seen[view], xy[view, ..., axis], 0.0)
            a = [coordinate * R[2, i] - R[axis, i] for i in range(3)]
            r = t[axis] - coordinate * t[2]
            wa = [w2 * ai for ai in a]
            N[0] += wa[0] * a[0]
            N[1] += wa[0] * a[1]
            N[2] += wa[0] * a[2]
            N[3] += wa[1] * a[1]
            N[4] += wa[1] * a[2]
            N[5] += wa[2] * a[2]
            for i in range(3):
                b[i] += wa[i] * r
    point, well_posed = _solve_symmetric(N, b)
    return np.where(((seen.sum(axis=0) >= 2) & well_posed)[..., None], point, np.nan)


def _solve_symmetric(N, b):
    """Solve 3x3 symmetric systems by the adjugate: N (6, ...) upper triangle, b (3, ...) to (..., 3) and a mask."""
    a, d, e, f, g, h = N
    A00, A01, A02 = f * h - g * g, e * g - d * h, d * g - e * f
    A11, A12, A22 = a * h - e * e, d * e - a * g, a * f - d * d
    det = a * A00 + d * A01 + e * A02
    with np.errstate(all="ignore"):
        x = np.stack(
            [
                (A00 * b[0] + A01 * b[1] + A02 * b[2]) / det,
                (A01 * b[0] + A11 * b[1] + A12 * b[2]) / det,
                (A02 * b[0] + A12 * b[1] + A22 * b[2]) / det,
            ],
            axis=-1,
        )
        well_posed = det > 1e-12 * ((a + f + h) / 3) ** 3
    return x, well_posed


def similarity(source, target, scale=True):
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
