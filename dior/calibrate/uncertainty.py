"""How well the adjusted cameras are known: their joint covariance, honest for a detector with habits.

INPUTS   the solved adjustment, which joint, moment and side of the body each pixel shows
OUTPUTS  covariance (6V, 6V) of the cameras' errors (`dior.covariance`), and what it was made of

A pose network puts a joint a little beside where it is, always the same for the same side of the body that the camera
sees (design, section 9), and its noise lasts for several frames. Frames are no independent measurements then: the
inverse of the normal matrix is too small by far. Two variances are estimated from the residuals, that of the constant
offsets of the clusters (joint, side) in metres at the body and that of the noise, whose autocorrelation over time is
measured, too; then each is carried to the cameras through what the adjustment makes of the pixels, the metric facts
included. The sigmas of the facts and an error of the intrinsics come on top (Gelb, Applied Optimal Estimation, 1974,
on consider parameters; Liang and Zeger 1986 on clusters).
"""

from dataclasses import dataclass

import numpy as np

from dior.calibrate import reduced

SIDES = 4
FEWEST = 20
LAGS = 30
FORGOTTEN = 0.05


@dataclass(frozen=True)
class Tracks:
    """Which joint, moment and sequence the points (N,) are, whole numbers from 0; `names` of the joints.

    Moments are counted in instants of the window, `moment` is unique over the sequences.
    """

    joint: np.ndarray
    moment: np.ndarray
    sequence: np.ndarray
    names: tuple

    def only(self, keep):
        """The tracks of the points of a mask or index (N,)."""
        return Tracks(self.joint[keep], self.moment[keep], self.sequence[keep], self.names)


@dataclass(frozen=True)
class Uncertainty:
    """`covariance` (6V, 6V), and what it was made of.

    `bias_m`: sigma of a cluster's offset in each axis of the picture, at the body; `noise`: the pixels' variance in
    units of the assumed one; `lasting`: how many frames make one measurement.
    """

    covariance: np.ndarray
    bias_m: float
    noise: float
    lasting: float


def grid(tracks, values):
    """Values (N, ...) by moment and joint (T, J, ...), NaN where there is none."""
    out = np.full((int(tracks.moment.max()) + 1, len(tracks.names), *values.shape[1:]), np.nan)
    out[tracks.moment, tracks.joint] = values
    return out


def sides(cameras, points, tracks):
    """Which quarter of the body (V, N) a camera sees, 0 to 3 from the front to the left; -1 where it is not known.

    From the shoulders and hips at the moment, or at the nearest moment of the sequence at which both sides are known.
    """
    names = list(tracks.names)
    if not {"left_hip", "right_hip"} <= set(names):
        return np.full((len(cameras), len(points)), -1)
    xyz = grid(tracks, points)
    pair = [
        [names.index(f"{side}_{part}") for part in ("hip", "shoulder") if f"{side}_{part}" in names]
        for side in ("left", "right")
    ]
    across = xyz[:, pair[0]] - xyz[:, pair[1]]
    across = np.where(np.isfinite(across), across, 0.0).sum(axis=1)[:, :2]
    middle = np.full((len(xyz), 2), np.nan)
    some = np.isfinite(xyz).any(axis=(1, 2))
    middle[some] = np.nanmedian(xyz[some], axis=1)[:, :2]
    known = np.flatnonzero((np.linalg.norm(across, axis=1) > 0) & some)
    if not len(known):
        return np.full((len(cameras), len(points)), -1)
    # the nearest known moment; two sequences are far apart only where one of them has none
    after = np.clip(np.searchsorted(known, np.arange(len(xyz))), 0, len(known) - 1)
    before = np.clip(after - 1, 0, None)
    moments = np.arange(len(xyz))
    nearest = np.where(abs(known[after] - moments) < abs(known[before] - moments), known[after], known[before])
    across, middle = across[nearest], middle[nearest]
    forward = np.stack([across[:, 1], -across[:, 0]], axis=-1)
    out = []
    for camera in cameras:
        toward = camera.centre[:2] - middle
        angle = np.arctan2((across * toward).sum(axis=1), (forward * toward).sum(axis=1))
        out.append(np.round(angle / (np.pi / 2)).astype(int) % SIDES)
    return np.stack(out)[:, tracks.moment]


def autocorrelation_sum(residuals, observed, cluster, tracks):
    """How many frames make one measurement: 1 + 2 sum of the residuals' autocorrelation over time.

    `residuals` (V, N, 2) of which each cluster's mean is taken off; `observed` (V, N), `cluster` (V, N) from 0.
    """
    count = np.bincount(cluster[observed], minlength=cluster.max() + 1)
    clean = np.where(observed[..., None], residuals, np.nan)
    for axis in range(2):
        mean = np.bincount(cluster[observed], residuals[..., axis][observed], minlength=len(count)) / np.maximum(
            count, 1
        )
        clean[..., axis] -= mean[cluster]
    by_time = np.stack([grid(tracks, view) for view in clean])
    order = grid(tracks, tracks.sequence.astype(float))
    sequence = np.nanmax(np.where(np.isfinite(order), order, -1), axis=1)
    variance, total = np.nanmean(by_time**2), 1.0
    for lag in range(1, min(LAGS, by_time.shape[1] - 1) + 1):
        product = by_time[:, lag:] * by_time[:, :-lag]
        product = product[:, sequence[lag:] == sequence[:-lag]]
        if not np.isfinite(product).any():
            break
        rho = np.nanmean(product) / variance
        if rho < FORGOTTEN:
            break
        total += 2 * rho
    return total


def of(solved, tracks, lens_sigma=0.0, fact_sigma=()):
    """`Uncertainty` of an adjustment; `tracks` of its first points, more points (marked ones) have no clusters.

    `lens_sigma`: 1 sigma of the focal length and principal point, both relative to the focal length.
    """
    from scipy import sparse

    linear, views = solved.linear, len(solved.cameras)
    count = linear.r.shape[1]
    seen = linear.root > 0
    B = reduced.by_all_cameras(linear)
    F = linear.factor @ B
    H = solved.normal
    inverse = np.linalg.inv(H)
    facts = [(row, reduced.total(row, linear, B)) for row in solved.facts]

    def considered(columns):
        """Blocks of parameters whose pixels' derivatives (V, N, 2, q) go to columns (V, N, q): with the cameras
        (6V, Q), with each other (Q, Q), and the facts' own derivatives [(m, Q)]."""
        (derivative, at, size) = columns
        q = derivative.shape[-1]
        rows = 3 * np.arange(count)[:, None, None] + np.arange(3)[:, None]
        data, row_index, column_index = [], [], []
        cross, own = np.zeros((6 * views, size)), np.zeros((size, size))
        for v in range(views):
            use = seen[v]
            E = np.swapaxes(linear.J[v], -1, -2) @ derivative[v]
            G = linear.factor @ E
            data.append(G[use].ravel())
            row_index.append(np.broadcast_to(rows, (count, 3, q))[use].ravel())
            column_index.append(np.broadcast_to(at[v][:, None, :], (count, 3, q))[use].ravel())
            W = np.swapaxes(linear.C[v], -1, -2) @ derivative[v]
            for a in range(6):
                for b in range(q):
                    cross[6 * v + a] += np.bincount(at[v][use, b], W[use, a, b], minlength=size)
            D = np.swapaxes(derivative[v], -1, -2) @ derivative[v]
            for a in range(q):
                for b in range(q):
                    np.add.at(own, (at[v][use, a], at[v][use, b]), D[use, a, b])
        G = sparse.csr_matrix(
            (np.concatenate(data), (np.concatenate(row_index), np.concatenate(column_index))), shape=(3 * count, size)
        )
        cross -= (G.T @ F.reshape(-1, 6 * views)).T
        own -= (G.T @ G).toarray()
        by_fact = []
        for row, _ in facts:
            # a fact's points follow the parameter: -noise E, and noise E = factor^T G
            if not len(row.points):
                by_fact.append(np.zeros((len(row.residual), size)))
                continue
            T = np.einsum("mka,kba->mkb", row.by_points, linear.factor[row.points])
            pick = (3 * row.points[:, None] + np.arange(3)).ravel()
            by_fact.append(-(G[pick].T @ T.reshape(len(T), -1).T).T)
        return cross, own, by_fact

    # the cameras' score by a parameter, and what of it comes through the facts
    joint, side = np.full((views, count), -1), sides(solved.cameras, solved.points[: len(tracks.joint)], tracks)
    joint[:, : len(tracks.joint)] = np.where(side >= 0, tracks.joint * SIDES + side, tracks.joint * SIDES)
    size = SIDES * len(tracks.names)
    scale = np.where(joint >= 0, linear.focal_px / linear.depth, 0.0) * linear.root
    by_bias = scale[..., None, None] * np.eye(2)
    at = 2 * np.maximum(joint, 0)[..., None] + np.arange(2)
    cross, own, by_fact = considered((by_bias, at, 2 * size))
    straight = own - cross.T @ inverse @ cross
    full = cross + sum(h.T @ d for (_, h), d in zip(facts, by_fact, strict=True))

    # moments: what the clusters' sums and the residuals' sum should be, against what they are
    gradient = np.zeros(2 * size)
    part = slice(0, len(tracks.joint))
    for v in range(views):
        for axis in range(2):
            gradient += np.bincount(
                at[v, :, axis][seen[v]], (scale[v] * linear.r[v, :, axis])[seen[v]], minlength=2 * size
            )
    residuals, observed, cluster = linear.r[:, part], seen[:, part], np.maximum(joint[:, part], 0)
    degrees = 2 * observed.sum() - 3 * (observed.sum(axis=0) >= 2).sum()
    lasting = autocorrelation_sum(residuals, observed, cluster, tracks)
    trace, squares = np.trace(straight), np.sum(straight * straight)
    A = np.array([[squares, lasting * trace], [trace, degrees]])
    found = np.linalg.solve(A, [gradient @ gradient, np.sum(residuals**2)])
    bias, noise = max(found[0], 0.0), max(found[1], 0.0)
    if not found[1] > 0 or not found[0] > 0:
        noise = np.sum(residuals**2) / degrees

    middle = bias * full @ full.T
    pixels = H - sum(h.T @ h for _, h in facts)
    middle += lasting * noise * pixels
    for row, h in facts:
        own_noise = np.eye(len(row.residual))
        if len(row.points):
            C = linear.noise[row.points]
            own_noise = own_noise + noise * lasting * np.einsum("mka,kab,nkb->mn", row.by_points, C, row.by_points)
        middle += h.T @ own_noise @ h
    if lens_sigma:
        by_lens = np.zeros((views, count, 2, 3))
        f = np.array([c.intrinsics.fx for c in solved.cameras])[:, None]
        by_lens[..., 0] = linear.pixel * linear.root[..., None]
        by_lens[..., 0, 1] = by_lens[..., 1, 2] = f * linear.root
        at = np.broadcast_to(3 * np.arange(views)[:, None, None] + np.arange(3), (views, count, 3))
        cross, _, by_fact = considered((by_lens, at, 3 * views))
        full = cross + sum(h.T @ (d + row.by_lens) for (row, h), d in zip(facts, by_fact, strict=True))
        middle += lens_sigma**2 * full @ full.T
    covariance = inverse @ middle @ inverse
    return Uncertainty((covariance + covariance.T) / 2, float(np.sqrt(bias)), float(noise), float(lasting))


def gauge(cameras):
    """(6V, 7) the cameras' errors that a rigid motion (turn rad, shift m) and scale about their middle make."""
    middle = np.mean([c.centre for c in cameras], axis=0)
    out = np.zeros((len(cameras), 6, 7))
    for view, camera in enumerate(cameras):
        away = camera.centre - middle
        out[view, :3, :3] = camera.wRc.T
        out[view, 3:, :3] = -np.array([[0, -away[2], away[1]], [away[2], 0, -away[0]], [-away[1], away[0], 0]])
        out[view, 3:, 3:6] = np.eye(3)
        out[view, 3:, 6] = away
    return out.reshape(-1, 7)


def scale_sigma(cameras, covariance):
    """1 sigma of the scale of the world, relative: how much larger than true the cameras' distances are.

    The distances between the cameras, each as well as it is known, are compared with themselves: what remains of the
    cameras' errors in the direction of a change of scale.
    """
    away = gauge(cameras)[:, 6]
    along = away / (away @ away)
    return float(np.sqrt(along @ covariance @ along))
