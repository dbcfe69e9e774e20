"""A baseline that needs no training: the 3D's proportions and gait, weighed by how well each is known.

INPUTS   `features.Gait` of every recording, and which subject, session and environment it is of
OUTPUTS  distances (R, R) between recordings
A session's own errors (its scale, its detector's offsets as its cameras see them) are the same for everybody in it. So
every session is centred on its own people, without knowing who they are, before recordings of different ones are
compared; where a session has fewer than LEAST_SUBJECTS people that would take away the people, and only what knows no
scale is used of it. Then two recordings are as near as they are likelier of one person than of two (the two-covariance
model of Brummer and de Villiers 2010): what varies from walk to walk counts little, what varies between people much.
Both are learned from the other people, never from the two who are compared, so that nobody is measured by his own
noise; where there are too few of them, by the standard errors.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints, Texts
from dior.reid.features import FEATURES, Gait

# a name for each recording (R,)
Words: TypeAlias = Sequence[str] | Texts
# chosen: the mean of two people takes away all that tells them apart
LEAST_SUBJECTS = 3
# recordings beyond one per person from which a scatter is learned; below, only the standard errors count (chosen)
LEAST_LEARNED = 10
SIZE = FEATURES.index("size")
# no feature is the same in two walks of a person, however well it is measured; radians, logarithms (chosen: 1 %)
FLOOR = 0.01
# variance between people, with the noise of a recording as 1: at least, and where it cannot be learned (chosen: as much
# as the noise, so that neither decides)
LEAST_BETWEEN, UNKNOWN_BETWEEN = 0.01, 1.0
# chosen: a recording is not trusted more than three times as much as usual
LEAST_NOISE = 0.3


def centred(values: ArrayLike, sessions: Words, subjects: Words) -> tuple[Floats, list[str]]:
    """Values (R, D) minus their session's mean, and the names of the sessions with too few people for that.

    In these the size is set to what is usual; a mean over recordings, so that nobody needs to be known.
    """
    values, sessions, subjects = np.array(values, float), np.asarray(sessions), np.asarray(subjects)
    small = []
    for day in sorted(set(sessions.tolist())):
        own = sessions == day
        if len(set(subjects[own].tolist())) >= LEAST_SUBJECTS:
            values[own] -= values[own].mean(axis=0)
        else:
            small.append(day)
    alone = np.isin(sessions, small)
    if small:
        values[alone] -= values[alone].mean(axis=0)
        values[:, SIZE] = 0.0
    return values, small


def distances(gaits: Sequence[Gait], subjects: Words, sessions: Words) -> tuple[Floats, list[str]]:
    """Distances (R, R) of recordings, and the sessions that could not be centred.

    A distance is how much likelier two recordings are of two people than of one (a logarithm, so it may be negative).
    """
    values, small = centred([gait.values for gait in gaits], sessions, subjects)
    own = np.maximum(np.stack([gait.sigma for gait in gaits]), FLOOR) ** 2
    names = sorted(set(np.asarray(subjects).tolist()))
    who = np.array([names.index(subject) for subject in subjects])
    out = np.zeros((len(who), len(who)))
    for a in range(len(names)):
        for b in range(a, len(names)):
            rows, columns = np.flatnonzero(who == a), np.flatnonzero(who == b)
            whiten, between = _learned(values, who, (who != a) & (who != b), own.mean(axis=0))
            # each recording's noise beyond the usual, in the same coordinates
            noise = np.maximum(1 + (own - own.mean(axis=0)) @ (whiten.T**2), LEAST_NOISE)
            z = values @ whiten.T
            found = _unlike(z[rows], noise[rows], z[columns], noise[columns], between)
            out[np.ix_(rows, columns)] = found
            out[np.ix_(columns, rows)] = found.T
    return out, small


def _learned(values: Floats, who: Ints, learn: Bools, errors: Floats) -> tuple[Floats, Floats]:
    """What makes the scatter of one person's recordings white (D, D), and the variance (D,) between people in these
    coordinates, from the recordings `learn` (R,); where they are too few, from the squared standard errors (D,)."""
    people = sorted(set(who[learn].tolist()))
    means = np.array([values[who == p].mean(axis=0) for p in people]).reshape(-1, values.shape[1])
    rest = np.concatenate([values[who == p] for p in people]) if people else values[:0]
    rest = rest - np.repeat(means, [(who == p).sum() for p in people], axis=0)
    free = len(rest) - len(people)
    if free < LEAST_LEARNED or len(people) < LEAST_SUBJECTS:
        return np.diag(1 / np.sqrt(errors)), np.full(values.shape[1], UNKNOWN_BETWEEN)
    scale = np.sqrt((rest**2).sum(axis=0) / free + FLOOR**2 / 4)
    z = rest / scale
    correlation = z.T @ z / free
    correlation *= 1 - _shrinkage(z, correlation, free)
    np.fill_diagonal(correlation, 1.0)
    size, axes = np.linalg.eigh(correlation)
    # the symmetric root leaves every feature nearest to itself
    whiten = (axes / np.sqrt(size)) @ axes.T / scale
    noise = np.mean([1 / (who == p).sum() for p in people])
    return whiten, np.maximum((means @ whiten.T).var(axis=0, ddof=1) - noise, LEAST_BETWEEN)


def _unlike(x: Floats, noise_x: Floats, y: Floats, noise_y: Floats, between: Floats) -> Floats:
    """Minus the log likelihood ratio (A, B) of one person against two, for recordings x (A, D) and y (B, D) around 0.

    Two recordings of a person share a draw of the variance `between` (D,) and differ by their own noise.
    """
    x, y = x[:, None], y[None]
    own, other = noise_x[:, None] + between, noise_y[None] + between
    both = own * other - between**2
    one = (other * x**2 - 2 * between * x * y + own * y**2) / both + np.log(both)
    two = x**2 / own + y**2 / other + np.log(own * other)
    return (one - two).sum(axis=-1) / 2


def _shrinkage(z: Floats, correlation: Floats, free: int) -> float:
    """How much of the correlations (D, D) of z (N, D) is chance (Schaefer and Strimmer 2005), 0 to 1."""
    products = z[:, :, None] * z[:, None, :]
    variance = products.var(axis=0) * len(z) / free**2 * len(z) / max(len(z) - 1, 1)
    off = ~np.eye(len(correlation), dtype=bool)
    return float(np.clip(variance[off].sum() / max((correlation[off] ** 2).sum(), 1e-12), 0.0, 1.0))
