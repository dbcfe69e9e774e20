"""The linear algebra of clocks: times from residuals of joints whose errors last, and how certain they are.

INPUTS   residuals (px) of B tracks (a joint in a view) at T moments, their derivatives by the unknowns
OUTPUTS  steps of the clocks, their covariance with the cameras as given, and what cameras' errors add

A detector is off by a constant for a joint and a side of the body, about 1 % of the body height, which is 15 ms of
walking. So what such constants can explain is projected out of residuals and derivatives alike, and only how a track
moves tells the time. What is left of the errors is correlated over 0.15 s: both are whitened as a first-order process.
The covariance is a sandwich, clustered both by joint (soft tissue moves with every stride) and by blocks of time.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.clocks import persistence
from dior.clocks.clock import NORMAL_95, Clock

OUTLIER = 6.0  # chosen: sigmas at which a residual is another limb or person and not noise
HUBER = 2.0  # chosen: sigmas of a coordinate at which a whitened residual starts to weigh less
ROUNDS = 3  # chosen: of leaving out outliers
MOST_FEIGNED = 0.8  # chosen: share of the information about the time, at most, that counts as noise of velocities
LEAST_SHARE = 1.0  # chosen: clusters may only widen an interval, for few of them may make a variance too small
SETTLED = 0.15  # chosen: standard errors; the choice among the detections moves a clock by as much
# chosen: errors that last longer count as if they lasted so long (a correlation of 0.95 at 30 Hz). Whitened any harder,
# hardly anything of the motion would be left either
LONGEST_S = 0.65
# chosen: a detector's errors last for 0.15 s, so pictures at a higher rate tell little more and only cost time
PICTURES_HZ = 30.0
FEWEST = 60  # chosen: usable (joint, moment)s; with fewer there are hardly more equations than constants to be found
# chosen: what the places of all joints amount to, since errors of detector and poses are alike all the time. A lag then
# counts as clearly worse (`dior.clocks.lag`) where the joints are 1.2 times as far off
POSITIONS = 45.0
MOST_SIGMA_S = 0.1  # chosen: a time that is less certain, a fifth of a step, counts as unknown


@dataclass(frozen=True, eq=False)
class ResidualTracks:
    """B tracks at T moments.

    `residual` (B, T, 2) px, NaN where unknown; `by_clock` (B, T, 2, K) and `by_camera` (B, T, 2, Q): its derivatives;
    `basis` (B, T, 2, P): what a constant error of the detector looks like; `by_point` (B, T, 2, 3) of the joint's 3D,
    which is unknown, too, where several views make it, else None. `joint` (B,); `group` (B,): tracks whose
    errors may be alike at all times; `seconds` (T,). `by_noise` (B, T, 2, K): what noise alone makes of `by_clock`,
    where velocities come from the detections; the information that it feigns is subtracted.
    """

    residual: Floats
    by_clock: Floats
    by_camera: Floats
    basis: Floats
    by_point: Floats | None
    joint: Ints
    group: Ints
    seconds: Floats
    by_noise: Floats | None = None


@dataclass(frozen=True, eq=False)
class SolvedClocks:
    """`step` (K,) of the clocks; `given` (K, K) covariance with the cameras as they are; `gain` (K, Q) by their errors.

    `sd_px` (B,) of the tracks, whitened, and `keep`, the correlation of neighbours before that.
    """

    step: Floats
    given: Floats
    gain: Floats
    sd_px: Floats
    keep: float


def constants(depth: Floats, side: Ints, extra: Floats | None = None) -> Floats:
    """What constant errors look like (B, T, 2, P): of a size in metres for each of 4 sides, in u and in v.

    `depth` (B, T) m, `side` (B, T) 0 to 3; `extra` (B, T, 2, E): further unknowns of the track.
    """
    shown = (side[..., None] == np.arange(4)) / np.where(depth > 0, depth, np.nan)[..., None]
    basis = shown[..., None, :, None] * np.eye(2)[:, None, :]
    basis = basis.reshape(*depth.shape, 2, 8)
    return basis if extra is None else np.concatenate([basis, extra], axis=-1)


def solve(tracks: ResidualTracks, value: Floats, prior: Floats) -> SolvedClocks | None:
    """`SolvedClocks`, or None where too little is known.

    `value` (K,) of the unknowns so far, each with the precision `prior` (K,) about 0.
    """
    known = np.all(np.isfinite(tracks.residual), axis=-1) & np.all(np.isfinite(tracks.by_clock), axis=(-1, -2))
    known &= np.all(np.isfinite(tracks.basis), axis=(-1, -2))
    if known.sum() < FEWEST:
        return None
    K, Q = tracks.by_clock.shape[-1], tracks.by_camera.shape[-1]
    noise = np.zeros_like(tracks.by_clock[..., :0]) if tracks.by_noise is None else tracks.by_noise
    values = np.concatenate([tracks.residual[..., None], tracks.by_clock, tracks.by_camera, noise], axis=-1)
    values = np.where(known[..., None, None], values, 0.0)
    basis = np.where(known[..., None, None], tracks.basis, 0.0)
    weight, near = known.astype(float), _neighbours(tracks.seconds)
    for _ in range(ROUNDS):
        left = without(basis, weight, values[..., :1])
        size = np.linalg.norm(left[..., 0], axis=-1)
        sd = spread(size, weight > 0)
        weight = known * (size <= OUTLIER * sd[:, None])
    keep = correlation(left[..., 0], weight, near, float(np.median(np.diff(tracks.seconds))))
    rough, pair = whitened(left, weight, near, keep)
    size = np.linalg.norm(rough[..., 0], axis=-1)
    sd = spread(size, pair > 0)
    w = pair / sd[:, None] ** 2
    w = w * np.minimum(1.0, HUBER * sd[:, None] / np.maximum(size, 1e-12))
    y, basis = (whitened(x, weight, near, keep)[0] for x in (values, basis))
    J = None if tracks.by_point is None else np.where(known[..., None, None], tracks.by_point, 0.0)[:, 1:]
    y = cleared(y, basis, J, w, tracks.joint)
    flat = (y[..., 1:] * np.sqrt(w)[..., None, None]).reshape(-1, y.shape[-1] - 1)
    N = flat.T @ flat
    g = np.einsum("bt,btai,bta->i", w, y[..., 1 : K + 1], y[..., 0]) + prior * value
    H = N[:K, :K] + np.diag(prior)
    if not np.isfinite(H).all() or (np.diagonal(H) <= 0).any():
        return None
    if noise.size:
        feigned = np.diagonal(N)[K + Q :]
        share = np.clip(feigned / np.diagonal(H), 0.0, MOST_FEIGNED)
        H = H - np.sqrt(share[:, None] * share) * H
    inverse = np.linalg.inv(H)
    scores = np.einsum("bt,btai,bta->bti", w, y[..., 1 : K + 1], y[..., 0])
    meat = two_way(scores, tracks.group, ((tracks.seconds[1:] - tracks.seconds[0]) // persistence.LASTS_S).astype(int))
    meat = meat + np.diag(prior)
    given = _no_more(inverse @ meat @ inverse, prior)
    return SolvedClocks(-inverse @ g, given, -inverse @ N[:K, K : K + Q], sd, keep)


def clock_of(value: Floats, middle: float, solved: SolvedClocks, cameras: Sequence[str], at: int = 0) -> Clock:
    """`Clock` from (time in the middle s, drift ppm); `at`: of which of several clocks, two unknowns each."""
    gain = solved.gain[2 * at : 2 * at + 2].reshape(2, -1, 6)
    sigma_s, sigma_ppm = map(float, np.sqrt(np.diagonal(solved.given))[2 * at : 2 * at + 2])
    offset = float(value[0] - 1e-6 * value[1] * middle)
    gains = {name: gain[:, i] for i, name in enumerate(cameras)}
    return Clock(offset, float(value[1]), "estimated", "detections", middle, (sigma_s, sigma_ppm), gains)


def doubt(solved: SolvedClocks, at: int = 0) -> str:
    """Why a clock cannot be trusted, or ""."""
    sigma = np.sqrt(solved.given[2 * at, 2 * at])
    if not sigma < MOST_SIGMA_S:
        return f"the joints hardly move: the time would be certain to ± {NORMAL_95 * sigma:.2f} s only"
    return ""


def disagreement(apart_s: float, most_s: float) -> str:
    """Why a clock that is far from the lag of the search cannot be trusted, or ""."""
    if abs(apart_s) <= most_s:
        return ""
    return f"where the joints are and how they move tell times {abs(apart_s):.2f} s apart"


def thinning(hz: float) -> int:
    """Every how many pictures at a rate of `hz` one takes part, so that there are about `PICTURES_HZ` of them."""
    return max(1, round(hz / PICTURES_HZ))


def runs(seconds: Floats, most_s: float, parts: int) -> Ints:
    """Indices of the moments (T,) that take part: all, or runs at the beginning, the middle and the end that last
    `most_s` together; thinned to about `PICTURES_HZ`."""
    hz = 1 / np.median(np.diff(seconds)) if len(seconds) > 1 else PICTURES_HZ
    every = thinning(hz)
    there, most = len(range(0, len(seconds), every)), round(most_s * hz / every)
    if there <= most:
        return every * np.arange(there)
    each = most // parts
    first = np.linspace(0, there - each, parts).round().astype(int)
    return every * np.unique((first[:, None] + np.arange(each)).ravel())


def settled(solved: SolvedClocks) -> bool:
    """Whether the last step was small against the standard errors of the clocks, every other unknown."""
    return bool((np.abs(solved.step) < SETTLED * np.sqrt(np.diagonal(solved.given)))[::2].all())


def _no_more(covariance: Floats, prior: Floats) -> Floats:
    """The covariance, no variance of which is more than is known before: few clusters overstate it."""
    with np.errstate(divide="ignore"):
        most = np.where(prior > 0, 1 / np.where(prior > 0, prior, 1.0), np.inf)
    scale = np.sqrt(np.minimum(1.0, most / np.diagonal(covariance)))
    return covariance * np.outer(scale, scale)


def without(basis: Floats, weight: Floats, values: Floats) -> Floats:
    """Values (B, T, 2, K) less what the basis (B, T, 2, P) explains of them, in the weighted least squares sense."""
    tracks, moments = values.shape[:2]
    flat, b = values.reshape(tracks, 2 * moments, -1), basis.reshape(tracks, 2 * moments, -1)
    weighted = np.swapaxes(b * np.repeat(weight, 2, axis=1)[..., None], 1, 2)
    G = weighted @ b
    G = G + (1e-9 * np.trace(G, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(G.shape[-1])
    return (flat - b @ np.linalg.solve(G, weighted @ flat)).reshape(values.shape)


def spread(size: Floats, known: Bools) -> Floats:
    """Standard deviation (B,) of each track's coordinates from the lengths (B, T) of its residuals, by the median."""
    # the median length of a plane normal is 1.1774 sigma
    some = known.any(axis=1)
    middle = np.full(len(size), np.nan)
    middle[some] = np.nanmedian(np.where(known, size, np.nan)[some], axis=1) / 1.1774
    usual = np.nanmedian(middle) if some.any() else 1.0
    return np.maximum(np.where(np.isfinite(middle), middle, usual), 0.2 * usual + 1e-9)


def _neighbours(seconds: Floats) -> Bools:
    """Mask (T-1,) of moments that follow the one before at once."""
    step = np.diff(seconds)
    usual = np.median(step)
    return (step < 1.5 * usual) & (step > 0.3 * usual)


def correlation(residual: Floats, weight: Floats, neighbours: Bools, step_s: float) -> float:
    """Correlation of a residual (B, T, 2) with the next, `step_s` later, pooled; not below 0."""
    known = np.where(weight[..., None] > 0, residual, np.nan)
    stretch = np.concatenate([[0], np.cumsum(~neighbours)])
    return float(np.clip(persistence.autocorrelation(known, 1, 1, stretch), 0.0, np.exp(-step_s / LONGEST_S)))


def whitened(values: Floats, weight: Floats, neighbours: Bools, keep: float) -> tuple[Floats, Floats]:
    """Values (B, T-1, 2, K) less `keep` times those before, and the weight (B, T-1) of the pair."""
    pair = weight[:, 1:] * weight[:, :-1] * neighbours
    return (values[:, 1:] - keep * values[:, :-1]) * pair[..., None, None], pair


def cleared(y: Floats, basis: Floats, J: Floats | None, w: Floats, joint: Ints) -> Floats:
    """Values y (B, T, 2, K) less what constants, basis (B, T, 2, P), and the joint's place explain, weights w (B, T).

    Tracks of one `joint` (B,) share its place, which is another at every moment; `J` (B, T, 2, 3) by it, None where it
    is known. The constants of one view show in all of them once the place has followed.
    """
    out = np.zeros_like(y)
    for j in np.unique(joint):
        mine = np.flatnonzero(joint == j)
        views, moments = len(mine), y.shape[1]
        # each view has constants of its own
        own = np.zeros((views, moments, 2, views, basis.shape[-1]))
        own[np.arange(views), :, :, np.arange(views)] = basis[mine]
        both = np.concatenate([y[mine], own.reshape(views, moments, 2, -1)], axis=-1)
        rows = np.swapaxes(both, 0, 1).reshape(moments, 2 * views, -1)
        weight = np.repeat(w[mine].T, 2, axis=1)
        if J is not None:
            place = np.swapaxes(J[mine], 0, 1).reshape(moments, 2 * views, 3)
            rows = _follow(rows, place, weight) * ((w[mine] > 0).sum(axis=0) >= 2)[:, None, None]
        flat, weight = rows.reshape(2 * views * moments, -1), weight.ravel()
        b = flat[:, y.shape[-1] :]
        weighted = (b * weight[:, None]).T
        G = weighted @ b
        G = G + (1e-9 * np.trace(G) + 1e-12) * np.eye(len(G))
        left = flat[:, : y.shape[-1]] - b @ np.linalg.solve(G, weighted @ flat[:, : y.shape[-1]])
        out[mine] = np.swapaxes(left.reshape(moments, views, 2, -1), 0, 1)
    return out


def _follow(rows: Floats, place: Floats, weight: Floats) -> Floats:
    """Rows (T, R, K) less what a shift of the joint, `place` (T, R, 3) by it, explains at every moment."""
    weighted = np.swapaxes(place * weight[..., None], 1, 2)
    G = weighted @ place
    G = G + (1e-9 * np.trace(G, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(3)
    return rows - place @ np.linalg.solve(G, weighted @ rows)


def two_way(scores: Floats, group: Ints, block: Ints) -> Floats:
    """Covariance (K, K) of the sum of scores (B, T, K), alike within a group of tracks (B,) and within a block (T,).

    Cameron, Gelbach and Miller, J. Bus. Econ. Stat. 29 (2011) 238-249.
    """
    groups, g = np.unique(group, return_inverse=True)
    blocks, b = np.unique(block, return_inverse=True)
    cells = np.zeros((len(groups), len(blocks), scores.shape[-1]))
    np.add.at(cells, (g[:, None], b[None]), scores)

    def of(sums: Floats) -> Floats:
        flat = sums.reshape(-1, scores.shape[-1])
        return flat.T @ flat

    alone, by_group = of(cells), cells.sum(axis=1)
    both = of(by_group) * _few(by_group) + of(cells.sum(axis=0)) - alone
    # few clusters give a noisy answer, which may not even be positive
    share = np.diagonal(both) / np.maximum(np.diagonal(alone), 1e-300)
    scale = np.sqrt(np.maximum(share, LEAST_SHARE) * _student(len(blocks)))
    return alone * np.outer(scale, scale)


def _student(count: float) -> float:
    """By how much clusters, so many, know their own scatter badly: Student's t, whose variance is above 1."""
    return (count + 1) / max(count - 1, 0.5)


def _few(sums: Floats) -> float:
    """The same of groups (G, K) of which few count: the legs tell most of the time. By the first unknown."""
    power = sums[:, 0] ** 2
    return _student(power.sum() ** 2 / max((power**2).sum(), 1e-300))
