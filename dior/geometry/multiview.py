"""Geometry that several stages need: look-at, triangulation of many points at once, similarity alignment.

Shapes: views first, then any leading shape `...` (frames, joints). Metres, radians, pixels; NaN is missing.
"""

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Floats, Ints


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
