"""The best path of joints through noisy points, from all instants before and after: no lag.

A path is the least squares of two kinds of equations: third differences that are small (jerk), and points that are
near, whose noise is autoregressive (AR(1)) with the covariance of each point. The normal equations are block
tridiagonal, so that a forward and a backward sweep give the path and its covariance, for all joints at once.
Shapes (T, J, ...); metres; NaN is missing.
"""

import numpy as np

from dior.arrays import Bools, Floats

# instants in a block; the noise of points further apart is taken as independent; chosen: at least
# the 3 that third differences reach, and the work grows with its square
B = 4
S = 3 * B
# how near an instant without a point is to the line between its neighbours, where nothing else says so; chosen: weak,
# and enough for the equations to have one solution
RIDGE_M = 1.0


def smooth(points: Floats, covariance: Floats, ar1: float, jerk: Floats) -> tuple[Floats, Floats, Floats]:
    """Path (T, J, 3) m, its covariance (T, J, 3, 3), and the log likelihood (J,) of the points.

    `points` (T, J, 3), `covariance` (T, J, 3, 3) of their noise, `ar1`: its correlation from one instant to the next,
    `jerk` (J,) m: standard deviation of third differences. A joint needs three points.
    """
    count, joints = points.shape[:2]
    blocks = -(-count // B)
    D, E, rhs, constant = _equations(points, covariance, ar1, jerk, blocks)
    W = np.empty((blocks, joints, S, S))
    z = np.empty((blocks, joints, S))
    log_det = np.zeros(joints)
    square = np.zeros(joints)
    # forward: eliminate block after block
    for k in range(blocks):
        if k:
            G = np.swapaxes(E[k - 1], -1, -2) @ W[k - 1]
            D[k] -= G @ E[k - 1]
            rhs[k] -= (G @ rhs[k - 1][..., None])[..., 0]
        W[k] = np.linalg.inv(D[k])
        log_det += np.linalg.slogdet(D[k])[1]
        z[k] = (W[k] @ rhs[k][..., None])[..., 0]
        square += (rhs[k] * z[k]).sum(axis=-1)
    likelihood = constant - 0.5 * log_det + 0.5 * square
    # backward: the path, and the blocks of the inverse on the diagonal
    for k in range(blocks - 2, -1, -1):
        G = W[k] @ E[k]
        z[k] -= (G @ z[k + 1][..., None])[..., 0]
        W[k] += G @ W[k + 1] @ np.swapaxes(G, -1, -2)
    path = np.moveaxis(z.reshape(blocks, joints, B, 3), 1, 2).reshape(-1, joints, 3)[:count]
    P = W.reshape(blocks, joints, B, 3, B, 3)[:, :, np.arange(B), :, np.arange(B), :]  # (B, blocks, joints, 3, 3)
    P = np.moveaxis(P, 0, 1).reshape(-1, joints, 3, 3)[:count]
    return path + _offset(points), P, likelihood


def _offset(points: Floats) -> Floats:
    """A point (J, 3) near each joint's path: numbers stay small."""
    known = np.all(np.isfinite(points), axis=-1)
    return np.where(known[..., None], points, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)[:, None]


def _equations(
    points: Floats, covariance: Floats, ar1: float, jerk: Floats, blocks: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Normal equations: D (K, J, S, S) on the diagonal, E (K-1, J, S, S) right of it, right-hand side (K, J, S), and
    what of the log likelihood does not depend on the path (J,)."""
    count, joints = points.shape[:2]
    length = blocks * B
    known = np.zeros((length, joints), bool)
    known[:count] = np.isfinite(points).all(axis=-1)
    y = np.zeros((length, joints, 3))
    y[:count] = np.where(known[:count, :, None], points - _offset(points), 0.0)
    weight = np.zeros((length, joints, 3, 3))  # upper triangular: whitens the noise
    C = np.where(known[:count, :, None, None], covariance, np.eye(3))
    weight[:count] = np.where(known[:count, :, None, None], np.linalg.inv(np.linalg.cholesky(C)), 0.0)
    # band[i][t]: what instant t has to do with t + i
    band = [np.zeros((length, joints, 3, 3)) for _ in range(B + 1)]
    rhs = np.zeros((length, joints, 3))
    constant = np.zeros(joints)
    difference = np.array([-1.0, 3.0, -3.0, 1.0])
    information = np.eye(3) / jerk[:, None, None] ** 2
    steps = length - 3
    for i in range(4):
        for j in range(i, 4):
            band[j - i][i : i + steps] += difference[i] * difference[j] * information
    constant -= 3.0 * steps * np.log(jerk)
    # a point that follows one at most B instants before shares its noise
    last = np.maximum.accumulate(np.where(known, np.arange(length)[:, None], -length), axis=0)
    before = np.vstack([np.full((1, joints), -length), last[:-1]])
    lag = np.arange(length)[:, None] - before
    white = weight @ y[..., None]
    constant += np.log(
        np.where(known, np.abs(np.linalg.det(np.where(known[..., None, None], weight, np.eye(3)))), 1)
    ).sum(axis=0)
    for step in range(1, B + 1):
        t, joint = np.nonzero(known & (lag == step) & (ar1 > 0))
        a = ar1**step
        now, then = weight[t, joint], weight[t - step, joint]
        scale = 1 / (1 - a * a)
        w = (white[t, joint] - a * white[t - step, joint]) * scale
        np.add.at(band[0], (t, joint), scale * np.swapaxes(now, -1, -2) @ now)
        np.add.at(band[0], (t - step, joint), scale * a * a * np.swapaxes(then, -1, -2) @ then)
        band[step][t - step, joint] -= scale * a * np.swapaxes(then, -1, -2) @ now
        np.add.at(rhs, (t, joint), (np.swapaxes(now, -1, -2) @ w)[..., 0])
        np.add.at(rhs, (t - step, joint), -a * (np.swapaxes(then, -1, -2) @ w)[..., 0])
        np.add.at(constant, joint, -1.5 * np.log(1 - a * a) - 0.5 * ((1 - a * a) * (w * w).sum(axis=(-1, -2))))
    t, joint = np.nonzero(known & ((lag > B) | (ar1 <= 0)))
    now, w = weight[t, joint], white[t, joint]
    np.add.at(band[0], (t, joint), np.swapaxes(now, -1, -2) @ now)
    np.add.at(rhs, (t, joint), (np.swapaxes(now, -1, -2) @ w)[..., 0])
    np.add.at(constant, joint, -0.5 * (w * w).sum(axis=(-1, -2)))
    ridge = np.where(known, 0.0, 1 / RIDGE_M**2)
    ridge[count:] = 1e-6 / RIDGE_M**2  # only there to fill the last block
    band[0] += ridge[..., None, None] * np.eye(3)
    rhs += ridge[..., None] * _line(y, known)
    return (*_blocks(band, rhs, blocks), constant)


def _line(y: Floats, known: Bools) -> Floats:
    """Points (T, J, 3) where `known`, and the line between them elsewhere."""
    out = y.copy()
    at = np.arange(len(y))
    for j in range(y.shape[1]):
        on = known[:, j]
        if on.any() and not on.all():
            for axis in range(3):
                out[~on, j, axis] = np.interp(at[~on], at[on], y[on, j, axis])
    return out


def _blocks(band: list[Floats], rhs: Floats, blocks: int) -> tuple[Floats, Floats, Floats]:
    joints = rhs.shape[1]
    D = np.zeros((blocks, joints, B, 3, B, 3))
    E = np.zeros((max(blocks - 1, 0), joints, B, 3, B, 3))
    for step, values in enumerate(band):
        split = values.reshape(blocks, B, joints, 3, 3)
        for i in range(B):
            j = i + step
            if j < B:
                D[:, :, i, :, j] = split[:, i]
                if step:
                    D[:, :, j, :, i] = np.swapaxes(split[:, i], -1, -2)
            else:
                E[:, :, i, :, j - B] = split[:-1, i]
    right = np.moveaxis(rhs.reshape(blocks, B, joints, 3), 1, 2).reshape(blocks, joints, S)
    return D.reshape(blocks, joints, S, S), E.reshape(-1, joints, S, S), right.copy()
