"""Bootstrap intervals over subjects: how much a pooled figure would move with other people.

INPUTS   values or their sums by subject. OUTPUTS  (low, high): the 2.5th and 97.5th percentile of the figure over
RESAMPLES draws of as many subjects, with replacement (Efron's percentile interval); NaN with fewer than two subjects.

Frames of a walk and walks of a person are alike, so that a resampling of frames would promise far too much. The same
draws serve every figure of as many subjects. Subjects are ordered by what they contribute, not by name, so that a
release under pseudonyms has the same intervals.
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats, Ints

# chosen: 2000 draws put the ends of a 95 % interval on 50 figures each
SEED, RESAMPLES, LEVEL = 20240104, 2000, 0.95
NOTHING = (np.nan, np.nan)


@cache
def draws(subjects: int) -> Ints:
    """How often each of `subjects` is drawn, (RESAMPLES, subjects)."""
    return np.random.default_rng(SEED).multinomial(subjects, np.full(subjects, 1 / subjects), RESAMPLES)


def of_mean(sums: Floats, n: Floats | Ints) -> tuple[float, float]:
    """Interval of sum(sums) / sum(n); `sums` and `n` (S,) of the subjects' values, n > 0."""
    if len(n) < 2:
        return NOTHING
    order = np.lexsort((sums, n))
    times = draws(len(n))
    return _percentiles((times @ sums[order]) / (times @ n[order]))


def of_quantile(values: Floats, subject: NDArray[Any], q: float) -> tuple[float, float]:
    """Interval of the q-quantile of `values` (N,), those of a subject `subject` (N,) of anything that can be sorted."""
    _, index, n = np.unique(subject, return_inverse=True, return_counts=True)
    if len(n) < 2:
        return NOTHING
    order = np.lexsort((np.bincount(index, values), n))
    rank = np.empty(len(n), int)
    rank[order] = np.arange(len(n))
    by_value = np.argsort(values, kind="stable")
    times = draws(len(n))[:, rank[index[by_value]]]
    return _percentiles(_repeated_quantile(values[by_value], times, q))


def _repeated_quantile(ordered: Floats, times: Ints, q: float) -> Floats:
    """`np.quantile(np.repeat(ordered, times[i]), q)` of every row i of `times` (R, N); `ordered` (N,) ascending."""
    until = times.cumsum(axis=1)
    place = q * (until[:, -1] - 1)
    below = np.floor(place)
    low, high = (ordered[(until <= at[:, None]).sum(axis=1)] for at in (below, np.minimum(below + 1, until[:, -1] - 1)))
    return low + (place - below) * (high - low)


def _percentiles(figures: Floats) -> tuple[float, float]:
    outside = 50 * (1 - LEVEL)
    low, high = np.percentile(figures, [outside, 100 - outside])
    return float(low), float(high)
