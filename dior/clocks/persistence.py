"""Errors that last: how many residuals, one after the other, make one independent measurement.

INPUTS   residuals of series over time (a joint in a view, a side of a box) less their means, px
OUTPUTS  correlations in time, and by how much the variance of a mean is larger than that of independent residuals

A detector's errors last for 0.15 s and more, whatever the rate of the pictures: at 120 Hz the next picture says nearly
the same once more. So times are in seconds, never in pictures. With correlations rho_k of residuals k pictures apart
the variance of a mean is 1 + 2 sum rho_k times that of as many independent ones (Bayley and Hammersley, J. R. Stat.
Soc. Suppl. 8 (1946) 184-197, on the effective number of independent observations in an autocorrelated time series).
"""

from itertools import count

import numpy as np

from dior.arrays import Floats, Ints

LASTS_S = 1.0  # chosen: six times what detectors' errors last; what is alike for longer stays with the side of the body
FORGOTTEN = 0.05  # chosen: of 400 residuals, smaller correlations are chance


def autocorrelation(values: Floats, apart: int, axis: int = 0, stretch: Ints | None = None) -> float:
    """Correlation of residuals that are `apart` moments apart along the `axis` of time, pooled over all others; 0
    without such pairs.

    `values` are regular in time, NaN where unknown; `stretch` (T,): pairs count where it is the same, all where None.
    """
    series = np.moveaxis(values, axis, 0)
    if not 0 < apart < len(series):
        return 0.0
    later, earlier = series[apart:], series[:-apart]
    both = np.isfinite(later) & np.isfinite(earlier)
    if stretch is not None:
        both &= (stretch[apart:] == stretch[:-apart]).reshape(-1, *(1,) * (series.ndim - 1))
    later, earlier = np.where(both, later, 0.0), np.where(both, earlier, 0.0)
    power = (later**2 + earlier**2).sum() / 2
    return float((later * earlier).sum() / max(power, 1e-12))


def inflation(
    values: Floats, hz: float, axis: int = 0, stretch: Ints | None = None, within_s: float = LASTS_S
) -> float:
    """How many residuals make one measurement, 1 + 2 sum of the autocorrelations, from regular series at `hz`.

    The sum ends where the correlation is forgotten, at `within_s` at the latest; arguments as of `autocorrelation`.
    """
    out = 1.0
    for apart in range(1, round(within_s * hz) + 1):
        rho = autocorrelation(values, apart, axis, stretch)
        if rho < FORGOTTEN:
            break
        out += 2 * rho
    return out


def inflation_at(values: Floats, seconds: Floats, series: Ints, within_s: float = LASTS_S) -> float:
    """The same from residuals (N,) at any times `seconds` (N,) of several `series` (N,), at least 1.

    All pairs of one series up to `within_s` apart count. Takes memory for N numbers, whatever the number of pairs.
    """
    order = np.lexsort((seconds, series))
    values, seconds, series = values[order], seconds[order], series[order]
    pairs = 0.0
    for apart in count(1):
        near = (series[apart:] == series[:-apart]) & (seconds[apart:] - seconds[:-apart] <= within_s)
        if not near.any():
            break
        pairs += (values[apart:] * values[:-apart])[near].sum()
    return float(max(1.0, 1.0 + 2 * pairs / max((values**2).sum(), 1e-12)))
