"""How much a recognition rate is worth: counts, chance, a permutation null and an interval over subjects.

INPUTS   `protocols.Trials` and their items. OUTPUTS  `Score`
Chance is the expected rate of a gallery in random order. The null exchanges the recordings' subjects within their
session, all cameras of a recording together: what it still reaches comes from sessions and from cameras that show one
walk at the same time, not from people. `p`: the share of exchanges that reach the rate. The interval is the bootstrap's
over the probes' subjects (dior/evaluate/bootstrap.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints
from dior.evaluate import bootstrap
from dior.reid import protocols
from dior.reid.columns import ABOVE_CHANCE, AT_CHANCE, NO_TRIAL

# exchanges, so that p is a multiple of 1/1000; the seed is chosen, the level is the usual one of tests
RESAMPLES, SEED, LEVEL = 999, 20240105, 0.05
# ranks of the curves; chosen
CMC = 20
# share of pairs of two people that are taken for one, at which TAR is told; chosen: the least of the usual ones that a
# lab's gallery has pairs for
FAR = 0.01


@dataclass(frozen=True)
class Score:
    """`hits` of `n` trials at rank 1, with the 95 % interval of their share; `chance` of that share; `null` the 95th
    percentile of the null and `p`; `cmc` (CMC,) shares at rank 1, 2, ...; `mean_ap`, `mean_inp`; `tar`: share of the
    pairs of one person that are accepted where FAR of those of two people are, NaN with fewer of these than 1 / FAR;
    `*_range`: 95 % intervals (low, high)."""

    hits: int
    n: int
    low: float
    high: float
    chance: float
    null: float
    p: float
    cmc: tuple[float, ...]
    rank5_range: tuple[float, float]
    mean_ap: float
    mean_ap_range: tuple[float, float]
    mean_inp: float
    mean_inp_range: tuple[float, float]
    tar: float
    tar_range: tuple[float, float]

    @property
    def rank1(self) -> float:
        return self.hits / self.n if self.n else np.nan

    @property
    def verdict(self) -> str:
        """What a reader may conclude."""
        if not self.n:
            return NO_TRIAL
        return ABOVE_CHANCE if self.p < LEVEL else AT_CHANCE


def score(found: protocols.Trials, items: Sequence[protocols.Item], exchanges: Ints | None = None) -> Score:
    """`Score` of trials. `exchanges`: what `exchanged` gives, where many scores share it."""
    if not len(found.probe):
        no, ends = np.nan, bootstrap.NOTHING
        return Score(0, 0, *ends, no, no, no, (no,) * CMC, ends, no, ends, no, ends, no, ends)
    match = protocols.matches(found, items)
    curve = protocols.hits(match, CMC)
    first = curve[:, 0]
    subject = protocols.numbered([item.subject for item in items])[found.probe]
    each = np.ones(len(first))
    low, high = _interval(first, each, subject)
    precision, inverse = protocols.average_precision(match), protocols.inverse_precision(match)
    tar, tar_range = _tar(found, match, subject)
    null = _null(found, exchanged(items) if exchanges is None else exchanges)
    return Score(
        hits=int(first.sum()),
        n=len(first),
        low=low,
        high=high,
        chance=float((match.sum(axis=1) / (found.ranked >= 0).sum(axis=1)).mean()),
        null=float(np.quantile(null, 1 - LEVEL)),
        p=float((1 + (null >= first.mean()).sum()) / (1 + len(null))),
        cmc=tuple(curve.mean(axis=0).tolist()),
        rank5_range=_interval(curve[:, 4], each, subject),
        mean_ap=float(precision.mean()),
        mean_ap_range=_interval(precision, each, subject),
        mean_inp=float(inverse.mean()),
        mean_inp_range=_interval(inverse, each, subject),
        tar=tar,
        tar_range=tar_range,
    )


def _interval(sums: ArrayLike, n: ArrayLike, subject: Ints) -> tuple[float, float]:
    """95 % interval of sum(sums) / sum(n) over the people `subject` (R,) of whom the values (R,) are."""
    total, of = np.bincount(subject, n), np.bincount(subject, sums).astype(float)
    return bootstrap.of_mean(of[total > 0], total[total > 0])


def _tar(found: protocols.Trials, match: Bools, subject: Ints) -> tuple[float, tuple[float, float]]:
    """True acceptance at FAR and its interval; the threshold is that of all people, whoever is drawn."""
    try:
        taken, own = protocols.accepted(found, match, FAR).sum(axis=1), match.sum(axis=1)
    except ValueError:
        return np.nan, bootstrap.NOTHING
    return float(taken.sum() / own.sum()), _interval(taken, own, subject)


def exchanged(items: Sequence[protocols.Item], resamples: int = RESAMPLES) -> Ints:
    """Subjects (resamples, N) of the items, as numbers, when recordings of a session exchange theirs."""
    random = np.random.default_rng(SEED)
    recordings = sorted({(item.session, item.recording, item.subject) for item in items})
    subject = protocols.numbered([who for _, _, who in recordings])
    session = protocols.numbered([day for day, _, _ in recordings])
    where = {name: i for i, (_, name, _) in enumerate(recordings)}
    index = np.array([where[item.recording] for item in items], int)
    out = np.empty((resamples, len(items)), int)
    for row in out:
        mixed = subject.copy()
        for day in range(session.max() + 1):
            own = np.flatnonzero(session == day)
            mixed[own] = subject[random.permutation(own)]
        row[:] = mixed[index]
    return out


def _null(found: protocols.Trials, exchanges: Ints) -> Floats:
    """Rank-1 shares (resamples,) of the trials with exchanged subjects; the nearest stays the nearest."""
    return (exchanges[:, found.ranked[:, 0]] == exchanges[:, found.probe]).mean(axis=1)
