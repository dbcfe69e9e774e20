"""Lag search: which lag of a clock costs least, and whether another one is about as good.

INPUTS   lags (L,) s in regular steps and what each costs (L,), NaN or infinite where too little overlaps
OUTPUTS  the lag of the least cost, to a fraction of the step; rivals; the lags of several cameras that fit together

The cost is the caller's: px of joints, edges or marks, angles of rays. Walking repeats itself: a step or a stride on,
the limbs are nearly at the same places. So a lag only counts where no other minimum of its curve is about as good. The
flank of a broad minimum is no rival: within it the fit and its standard error decide.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from dior.arrays import Bools, Floats, Ints

WINDOW_S = 2.0  # chosen: clocks started on a count or kept by the network differ by less; a longer search costs time
# chosen: less than half of a step, and steps are 0.3 s (running) to 0.6 s apart: what is nearer is the same minimum
APART_S = 0.2
CLEARLY = 20.0  # chi2 by which a rival has to fit worse; at even odds it is exp(10) = 22 000 times less likely then
# chosen: of a recording: recordings that share less have hardly a walk in common
MOST_SHARE = 0.6
FURTHEST_S = 12.0  # chosen: beyond what is said of a start; further it costs time and memory, and walks repeat
BEAM = 400  # chosen: exact for three cameras at up to 100 Hz; more cameras keep that many of their combinations

# of each pair of cameras (a, b): the cost (2R + 1,) of b's lag less a's, -R to R steps
PairCosts: TypeAlias = Mapping[tuple[int, int], Floats]


def steps(most: int) -> Ints:
    """-most, ..., most."""
    return np.arange(-most, most + 1)


def window(hz: float, most_s: float = WINDOW_S) -> Floats:
    """Lags (L,) s at `hz` steps per second up to `most_s` either way."""
    return steps(round(most_s * hz)) / hz


def curve(cost: Callable[[float], float], lags: Floats) -> Floats:
    """Cost (L,) of each lag."""
    return np.array([cost(lag) for lag in lags.tolist()])


def mean_cost(total: Floats, count: Ints) -> Floats:
    """Mean (L,) of `count` (L,) costs that add up to `total`; NaN at a lag at which little overlaps: it may not win by
    that."""
    return np.where((count > 0.5 * np.max(count)) & (count > 0), total / np.maximum(count, 1), np.nan)


def minima(costs: Floats) -> Ints:
    """Indices of the local minima, those at the ends of the window among them."""
    padded = np.pad(np.where(np.isfinite(costs), costs, np.inf), 1, constant_values=np.inf)
    own = padded[1:-1]
    return np.flatnonzero((own <= padded[:-2]) & (own <= padded[2:]) & np.isfinite(own))


def lowest(lags: Floats, costs: Floats, at: int | None = None) -> float:
    """The lag (s) of the least cost, or near index `at`, by a parabola through it and its neighbours."""
    i = int(np.nanargmin(costs)) if at is None else at
    if not 0 < i < len(lags) - 1 or not np.isfinite(costs[i - 1 : i + 2]).all():
        return float(lags[i])
    before, here, after = costs[i - 1 : i + 2]
    bend = before - 2 * here + after
    aside = np.clip(0.5 * (before - after) / bend, -0.5, 0.5) if bend > 0 else 0.0
    return float(lags[i] + aside * (lags[1] - lags[0]))


def worse(costs: Floats, measurements: float, sd: float = 0.0) -> Floats:
    """Chi2 (L,) by which lags fit worse than the best one, from costs that are rms errors or mean distances.

    `measurements`: how many independent ones the cost is made of; `sd`: the least that one of them errs by.
    """
    least = np.nanmin(costs)
    return measurements * (costs**2 - least**2) / max(least, sd, 1e-12) ** 2


def rivals(lags: Floats, chi2: Floats, best_s: float, apart_s: float = APART_S, clearly: float = CLEARLY) -> Floats:
    """Lags (R,) s, the best first, that are other minima of `chi2` (L,), as of `worse`, and not clearly worse.

    `best_s`: the lag that was found; what is within `apart_s` of it is no other. A minimum whose chi2 is `clearly` or
    more is no rival.
    """
    at = minima(chi2)
    at = at[(np.abs(lags[at] - best_s) > apart_s) & (chi2[at] < clearly)]
    return lags[at[np.argsort(chi2[at], kind="stable")]]


def furthest(length_s: float) -> float:
    """How far (s) lags are searched at most, beyond what is said of the clocks, in recordings that last `length_s`."""
    return min(MOST_SHARE * length_s, FURTHEST_S)


def further(most_s: float, length_s: float) -> float:
    """How far (s) lags are searched next where the best one up to `most_s` was at an end, in recordings that last
    `length_s`; `most_s` where that is all."""
    return max(most_s, min(2 * most_s, furthest(length_s)))


def at_an_end(lags: Floats, costs: Floats, best_s: float) -> bool:
    """Whether a lag is the first or the last that could be compared, so that one beyond may be better."""
    first, last = lags[np.isfinite(costs)][[0, -1]]
    return not first + APART_S / 2 < best_s < last - APART_S / 2


def doubt(lags: Floats, chi2: Floats, best_s: float, apart_s: float = APART_S, clearly: float = CLEARLY) -> str:
    """Why the lag that was found cannot be trusted, or ""; arguments as of `rivals`."""
    if at_an_end(lags, chi2, best_s):
        first, last = lags[np.isfinite(chi2)][[0, -1]]
        return f"the best lag is at the end of the {first:+.1f} to {last:+.1f} s that were tried"
    others = rivals(lags, chi2, best_s, apart_s, clearly)
    return f"a lag of {others[0]:+.2f} s fits about as well as {best_s:+.2f} s" if len(others) else ""


def total(costs: PairCosts, at: Ints) -> float:
    """Cost of the lags `at` (V,), in steps, of all cameras."""
    return float(sum(pair[at[b] - at[a] + len(pair) // 2] for (a, b), pair in costs.items()))


def along(costs: PairCosts, at: Ints, view: int, most: int) -> Floats:
    """Cost (2 most + 1,) of the lags of one camera in its pairs, those of the others as in `at` (V,)."""
    out, lags = np.zeros(2 * most + 1), steps(most)
    for (a, b), pair in costs.items():
        if view in (a, b):
            out += pair[(lags - at[a] if view == b else at[b] - lags) + len(pair) // 2]
    return out


def together(costs: PairCosts, held: Sequence[bool] | Bools, most: int) -> Ints:
    """Lags (V,) in steps with the least total cost; those of the cameras `held` (V,) are 0.

    Cameras come one after the other, and of their combinations the best `BEAM` are kept at every turn: two cameras may
    fit best a stride from each other, but hardly with a third one.
    """
    order = sorted(range(len(held)), key=lambda view: not held[view])
    chosen, sums = np.zeros((1, 0), int), np.zeros(1)
    for i, view in enumerate(order):
        own = np.zeros(1, int) if held[view] else steps(most)
        more = np.repeat(sums[:, None], len(own), axis=1)
        for j, other in enumerate(order[:i]):
            pair = costs.get((min(view, other), max(view, other)))
            if pair is not None:
                lag = own[None] - chosen[:, j, None]
                more += pair[(lag if other < view else -lag) + len(pair) // 2]
        best = np.argsort(more, axis=None, kind="stable")[:BEAM]
        before, now = np.unravel_index(best, more.shape)
        chosen, sums = np.column_stack([chosen[before], own[now]]), more[before, now]
    at = np.zeros(len(held), int)
    at[order] = chosen[0]
    return at


def profile(costs: PairCosts, at: Ints, view: int, most: int) -> Floats:
    """Total cost (2 most + 1,) of each lag of one camera, the others moved to where they then fit best.

    `at` (V,): the lags that they start from; the first camera is the reference and stays.
    """
    return np.array([total(costs, _settled(costs, at, view, step, most)) for step in steps(most).tolist()])


def _settled(costs: PairCosts, at: Ints, view: int, lag: int, most: int) -> Ints:
    at = at.copy()
    at[view] = lag
    for _ in range(len(at)):
        before = at.copy()
        for other in range(1, len(at)):
            if other != view:
                at[other] = along(costs, at, other, most).argmin() - most
        if (at == before).all():
            break
    return at
