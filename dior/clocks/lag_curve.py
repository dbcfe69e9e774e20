"""How well each lag of a clock fits: the best one, and whether another does about as well.

INPUTS   lags (L,) s and their costs (L,) px, NaN where too little overlaps
"""

import numpy as np

from dior.arrays import Floats

WINDOW_S = 2.0  # lags up to this are tried, either way
# another lag, so far from the best, that costs no more than so many times as much: the data cannot tell
APART_S, AMBIGUOUS = 0.25, 1.2


def lowest(lags: Floats, costs: Floats) -> float:
    """The lag of the least cost, by a parabola through its neighbours."""
    i = int(np.nanargmin(costs))
    if not 0 < i < len(lags) - 1 or not np.isfinite(costs[i - 1 : i + 2]).all():
        return float(lags[i])
    a, b, c = costs[i - 1 : i + 2]
    bend = a - 2 * b + c
    return float(lags[i] + (0.5 * (a - c) / bend if bend > 0 else 0.0) * (lags[1] - lags[0]))


def second_minimum(lags: Floats, costs: Floats) -> float | None:
    """Another minimum, 0.25 s away or more, that costs hardly more than the best; None where there is none.

    The flank of a broad minimum is none: within it the fit decides.
    """
    best = int(np.nanargmin(costs))
    padded = np.pad(np.where(np.isfinite(costs), costs, np.inf), 1, constant_values=np.inf)
    lowest_nearby = (costs <= padded[:-2]) & (costs <= padded[2:])
    other = np.where(lowest_nearby & (np.abs(lags - lags[best]) > APART_S), costs, np.nan)
    if not np.isfinite(other).any():
        return None
    second = int(np.nanargmin(other))
    return float(lags[second]) if other[second] < AMBIGUOUS * costs[best] else None


def disagreement(apart_s: float, most_s: float) -> str:
    """Why a clock that is far from the lag of the search cannot be trusted, or ""."""
    if abs(apart_s) <= most_s:
        return ""
    return f"where the joints are and how they move tell times {abs(apart_s):.2f} s apart"
