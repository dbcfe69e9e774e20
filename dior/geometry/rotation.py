"""Rotations as matrices, rotation vectors and quaternions, without the half second that SciPy's take to import.

Formulas: Rodrigues' and its inverse by the quaternion with the largest part (Shepperd 1978), which holds up to half a
turn.
"""

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Floats


def cross(v: Floats) -> Floats:
    """Matrices (..., 3, 3) with `cross(v) @ w = v x w`."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = np.moveaxis(v, -1, 0)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*v.shape[:-1], 3, 3)


def from_rotvec(turn: ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad."""
    turn = np.asarray(turn, float)
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    K = cross(turn)
    # sin(a) / a and (1 - cos(a)) / a^2, also where a is 0
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + np.sinc(angle / (2 * np.pi)) ** 2 / 2 * (K @ K))


def rotvec(R: Floats) -> Floats:
    """The rotation vector (3,), rad, of at most half a turn, of a rotation matrix (3, 3)."""
    # four times the products of the quaternion's parts x, y, z, w with the largest of them
    parts = np.array([R[0, 0], R[1, 1], R[2, 2], np.trace(R)])
    i = int(np.argmax(parts))
    if i == 3:
        q = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1 + parts[3]])
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.zeros(4)
        q[i] = 1 - parts[3] + 2 * parts[i]
        q[j], q[k], q[3] = R[j, i] + R[i, j], R[k, i] + R[i, k], R[k, j] - R[j, k]
    q /= np.linalg.norm(q) * (1 if q[3] >= 0 else -1)
    size = np.linalg.norm(q[:3])
    # of a small angle twice the vector, as the quotient is 0 / 0
    return np.asarray(q[:3] * (2 * np.arctan2(size, q[3]) / size if size > 1e-12 else 2.0))


def from_quaternion(q: Floats) -> Floats:
    """The rotation matrix (3, 3) of a quaternion (4,) x, y, z, w, of any length but 0."""
    q = q / np.linalg.norm(q)
    K = cross(q[:3])
    return np.asarray(np.eye(3) + 2 * q[3] * K + 2 * K @ K)


def nearest_rotation(matrix: Floats) -> Floats:
    """The rotation matrix (3, 3) that is nearest to one that is nearly a rotation (Kabsch)."""
    U, _, V = np.linalg.svd(matrix)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V)
