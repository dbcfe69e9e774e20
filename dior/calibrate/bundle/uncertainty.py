"""How well the adjusted cameras are known: their joint covariance, with systematic and correlated errors of a detector.

INPUTS   the solved adjustment, which joint, moment and side of the body each pixel shows
OUTPUTS  covariance (6V, 6V) of the cameras' errors (`dior.geometry.covariance`), and what it was made of

A pose network puts a joint a little beside where it is, always the same for the same side of the body that the camera
sees (design, section 9), and its noise lasts for several frames. Frames are no independent measurements then: the
inverse of the normal matrix is too small by far. Two variances are estimated from the residuals, that of the constant
offsets of the clusters (joint, side) in metres at the body and that of the noise, whose autocorrelation over time is
measured, too; then each is carried to the cameras through what the adjustment makes of the pixels, the metric facts
included. The sigmas of the facts and an error of the intrinsics come on top (Gelb, Applied Optimal Estimation, 1974,
on consider parameters; Liang and Zeger 1986 on clusters).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.calibrate.bundle import reduced
from dior.clocks import persistence
from dior.geometry.camera import Camera
from dior.geometry.multiview import side_seen

SIDES = 4


@dataclass(frozen=True, eq=False)
class Tracks:
    """Which joint, moment and sequence the points (N,) are, whole numbers from 0; `names` of the joints.

    Moments are counted in instants of the window, `step_s` apart; `moment` is unique over the sequences.
    """

    joint: Ints
    moment: Ints
    sequence: Ints
    names: tuple[str, ...]
    step_s: float = 1 / 30

    def only(self, keep: Bools | Ints) -> "Tracks":
        """The tracks of the points of a mask or index (N,)."""
        return replace(self, joint=self.joint[keep], moment=self.moment[keep], sequence=self.sequence[keep])


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """`covariance` (6V, 6V), and what it was made of.

    `bias_m`: sigma of a cluster's offset in each axis of the picture, at the body; `noise`: the pixels' variance in
    units of the assumed one; `autocorrelation_time`: the noise's integrated one in frames, so many are one measurement.
    `across` (6V, 3V) and `lenses` (3V, 3V) are those of poses and lenses and of the lenses (`covariance.joined`).
    """

    covariance: Floats
    across: Floats
    lenses: Floats
    bias_m: float
    noise: float
    autocorrelation_time: float


def grid(tracks: Tracks, values: Floats) -> Floats:
    """Values (N, ...) by moment and joint (T, J, ...), NaN where there is none."""
    out = np.full((int(tracks.moment.max()) + 1, len(tracks.names), *values.shape[1:]), np.nan)
    out[tracks.moment, tracks.joint] = values
    return out


def sides(cameras: Sequence[Camera], points: Floats, tracks: Tracks) -> Ints:
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
    return np.stack([side_seen(camera.centre, across, middle) for camera in cameras])[:, tracks.moment]


def autocorrelation_sum(residuals: Floats, observed: Bools, cluster: Ints, tracks: Tracks) -> float:
    """Integrated autocorrelation time of the residuals, 1 + 2 sum of the correlations: the frames of one measurement.

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
    return persistence.inflation(by_time, 1 / tracks.step_s, axis=1, stretch=sequence)


@dataclass(frozen=True, eq=False)
class Considered:
    """What parameters that are not adjusted do to those that are, with the points eliminated.

    `cross` (6V, Q) with the cameras, `own` (Q, Q) with each other, of the pixels alone; `through` (6V, Q): what they
    do to the cameras in all, the facts included. `gradient` (Q,) of the cost at the solution.
    """

    cross: Floats
    own: Floats
    through: Floats
    gradient: Floats

    def part(self, keep: slice | Ints) -> tuple[Floats, Floats, Floats]:
        """`cross`, `through`, `gradient` of some of the parameters."""
        return self.cross[:, keep], self.through[:, keep], self.gradient[keep]


def considered(
    solved: reduced.Solved, derivative: Floats, at: Ints, size: int, by_facts: Sequence[Floats]
) -> Considered:
    """`Considered` of `size` parameters.

    `derivative` (V, 2, q, N) of the pixels (divided by their sigmas) by the parameters `at` (V, q, N); `by_facts`:
    the facts' own derivatives [(m, Q)].
    """
    from scipy import sparse

    linear = solved.linear
    views, q, count = derivative.shape[0], derivative.shape[2], derivative.shape[3]
    F = reduced.eliminated(linear.factor, linear.mixed)
    rows = np.broadcast_to(np.arange(3)[:, None] * count + np.arange(count), (q, 3, count))
    G, cross, own = sparse.csr_matrix((3 * count, size)), np.zeros((6 * views, size)), np.zeros((size, size))
    gradient = np.zeros(size)
    for v in range(views):
        D = derivative[v]
        E = np.stack([(linear.J[v, :, a, None] * D).sum(axis=0) for a in range(3)])
        values = reduced.eliminated(linear.factor, E)
        columns = np.broadcast_to(at[v][:, None], (q, 3, count))
        G = G + sparse.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=G.shape)
        for a in range(q):
            use = linear.root[v] > 0
            where = at[v, a][use]
            gradient += np.bincount(where, (D[:, a] * linear.r[v]).sum(axis=0)[use], minlength=size)
            for i in range(6):
                cross[6 * v + i] += np.bincount(where, (linear.C[v, :, i] * D[:, a]).sum(axis=0)[use], minlength=size)
            for b in range(q):
                pair = where * size + at[v, b][use]
                own += np.bincount(pair, (D[:, a] * D[:, b]).sum(axis=0)[use], minlength=size**2).reshape(size, size)
    cross -= (G.T @ F.T).T
    own -= (G.T @ G).toarray()
    through = cross.copy()
    for row, its_own in zip(solved.facts, by_facts, strict=True):
        h, by_parameter = reduced.total(row, linear), its_own
        if len(row.points):
            # its points follow the parameters as noise E = factor^T G
            T = np.einsum("mka,bak->mbk", row.by_points, linear.factor[:, :, row.points])
            pick = (np.arange(3)[:, None] * count + row.points).ravel()
            by_parameter = by_parameter - (G[pick].T @ T.reshape(len(T), -1).T).T
        through += h.T @ by_parameter
    return Considered(cross, own, through, gradient)


def of(solved: reduced.Solved, tracks: Tracks, lens_sigma: float | Floats = 0.0) -> Uncertainty:
    """`Uncertainty` of an adjustment; `tracks` of its first points, more points (marked ones) have no clusters.

    `lens_sigma`: 1 sigma of the focal length and principal point, both relative to the focal length, before the
    pixels are used; one for all cameras or (V,).
    """
    linear, views, count = solved.linear, len(solved.cameras), solved.linear.r.shape[-1]
    people = len(tracks.joint)
    side = sides(solved.cameras, solved.points[:people], tracks)
    cluster = np.zeros((views, count), int)
    cluster[:, :people] = np.where(side >= 0, tracks.joint * SIDES + side, tracks.joint * SIDES)
    size, lenses = 2 * SIDES * len(tracks.names), 3 * views
    derivative, at = np.zeros((views, 2, 5, count)), np.zeros((views, 5, count), int)
    derivative[:, 0, 0, :people] = derivative[:, 1, 1, :people] = linear.scale[:, :people]
    derivative[:, :, 2] = linear.pixel * linear.root[:, None]
    derivative[:, 0, 3] = derivative[:, 1, 4] = linear.root * np.array([[c.intrinsics.fx] for c in solved.cameras])
    at[:, 0], at[:, 1] = 2 * cluster, 2 * cluster + 1
    at[:, 2:] = size + 3 * np.arange(views)[:, None, None] + np.arange(3)[:, None]
    own_facts = [np.hstack([np.zeros((len(row.residual), size)), row.by_lens]) for row in solved.facts]
    whole = considered(solved, derivative, at, size + lenses, own_facts)

    inverse = np.asarray(np.linalg.inv(solved.normal), float)
    bias, noise, autocorrelation_time = variances(linear, whole, slice(0, size), inverse, cluster[:, :people], tracks)
    rows = [(row, reduced.total(row, linear)) for row in solved.facts]
    variance = np.where(np.arange(count) < people, noise * autocorrelation_time, 1.0)
    of_facts = np.zeros_like(solved.normal)
    for row, h in rows:
        of_facts += h.T @ _fact_noise(row, linear, variance) @ h
    pixels = autocorrelation_time * noise * (solved.normal - sum(h.T @ h for _, h in rows))
    through = whole.through[:, :size]
    middle = bias * through @ through.T + pixels + of_facts
    sigma = np.repeat(np.broadcast_to(lens_sigma, views), 3)
    wrong = sigma > 0
    moment = np.zeros((lenses, lenses))
    if wrong.any():
        M = lens_moment(
            whole, size + np.flatnonzero(wrong), size, inverse, middle, bias, noise * autocorrelation_time, sigma[wrong]
        )
        moment[np.ix_(wrong, wrong)] = M
    L = whole.through[:, size:]
    covariance = inverse @ (middle + L @ moment @ L.T) @ inverse
    return Uncertainty(
        (covariance + covariance.T) / 2, -inverse @ L @ moment, moment, float(np.sqrt(bias)), float(noise),
        float(autocorrelation_time),
    )  # fmt: skip


def by_parameters(solved: reduced.Solved, derivative: Floats, at: Ints, size: int) -> Floats:
    """(6V, Q): how the solution's cameras move with parameters of the pixels; arguments as of `considered`."""
    own_facts = [np.zeros((len(row.residual), size)) for row in solved.facts]
    through = considered(solved, derivative, at, size, own_facts).through
    return np.asarray(-np.linalg.solve(solved.normal, through), float)


def _fact_noise(row: reduced.Row, linear: reduced.Linear, noise: Floats) -> Floats:
    """Covariance (m, m) of a fact's residuals: its own sigma and the noise of the points that it speaks of.

    `noise` (N,): variance of the points' pixels in assumed ones, hand marks' is 1.
    """
    own = np.eye(len(row.residual))
    if not len(row.points):
        return own
    C = linear.noise[row.points] * noise[row.points, None, None]
    return own + np.einsum("mka,kab,nkb->mn", row.by_points, C, row.by_points)


def variances(
    linear: reduced.Linear, whole: Considered, clusters: slice, inverse: Floats, cluster: Ints, tracks: Tracks
) -> tuple[float, float, float]:
    """Variance of the clusters' offsets (m^2) and of the noise (in assumed ones), and how long the noise lasts.

    By moments: what the squares of the clusters' sums and of all residuals should be, against what they are.
    """
    people = len(tracks.joint)
    residuals, observed = np.moveaxis(linear.r[..., :people], 1, -1), linear.root[:, :people] > 0
    autocorrelation_time = autocorrelation_sum(residuals, observed, cluster, tracks)
    degrees = 2 * observed.sum() - 3 * (observed.sum(axis=0) >= 2).sum()
    cross, _, gradient = whole.part(clusters)
    straight = whole.own[clusters, clusters] - cross.T @ inverse @ cross
    A = np.array([[np.sum(straight**2), autocorrelation_time * np.trace(straight)], [np.trace(straight), degrees]])
    sums = gradient @ gradient, np.sum(residuals**2)
    bias, noise = np.linalg.solve(A, sums)
    if bias > 0 and noise > 0:
        return bias, noise, autocorrelation_time
    return max(bias, 0.0), sums[1] / degrees, autocorrelation_time


def lens_moment(
    whole: Considered, k: Ints, size: int, inverse: Floats, middle: Floats, bias: float, noise: float, sigma: Floats
) -> Floats:
    """Second moment (L, L) of the errors of intrinsics, parameters `k` (L,), given what the pixels say of them.

    `sigma` (L,): how large they are before. They are not adjusted. With white noise many pixels tell that there is
    hardly any error; where a detector's systematic errors hide it, what was assumed remains.
    """
    b = slice(0, size)
    cross, through, gradient = whole.part(k)
    gain = cross.T @ inverse
    T = whole.own[np.ix_(k, k)] - gain @ through
    with_cameras = noise * cross.T + bias * whole.own[k, b] @ whole.through[:, b].T
    M = noise * whole.own[np.ix_(k, k)] + bias * whole.own[k, b] @ whole.own[b][:, k]
    M = M - with_cameras @ gain.T - gain @ with_cameras.T + gain @ middle @ gain.T
    M = (M + M.T) / 2 + 1e-9 * np.trace(M) / len(M) * np.eye(len(M))
    weighted = np.linalg.solve(M, T)
    P = np.linalg.inv(T.T @ weighted + np.diag(1 / sigma**2))
    mean = -P @ weighted.T @ gradient
    return P + np.outer(mean, mean)


def gauge(cameras: Sequence[Camera]) -> Floats:
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


def scale_sigma(cameras: Sequence[Camera], covariance: Floats) -> float:
    """1 sigma of the scale of the world, relative: how much larger than true the cameras' distances are.

    The distances between the cameras, each as well as it is known, are compared with themselves: what remains of the
    cameras' errors in the direction of a change of scale.
    """
    away = gauge(cameras)[:, 6]
    along = away / (away @ away)
    return float(np.sqrt(along @ covariance @ along))
