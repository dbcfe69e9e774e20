"""What the gait of one walker is measured from: pelvis, heels and toes over time, at any frame rate.

INPUTS   joints or markers (T, J, 3) m by name, their covariance and the share of it that lasts, times (T,) s
OUTPUTS  `Tracks`; values and velocities at any times between the frames
World with Z up, metres, seconds. Feet stand in the order left, right.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dior.arrays import Bools, Floats

SIDES = ("left", "right")
# the first of which all are there is taken; markers of Plug-in-Gait, then what detectors name
PELVIS = (
    ("LASI", "RASI", "LPSI", "RPSI"),
    ("LASI", "RASI"),
    ("LPSI", "RPSI"),
    ("left_hip", "right_hip"),
    ("mid_hip",),
)
HEEL = ({"left": "LHEE", "right": "RHEE"}, {"left": "left_heel", "right": "right_heel"})
TOE = (
    {"left": "LTOE", "right": "RTOE"},
    {"left": "left_foot_index", "right": "right_foot_index"},
    {"left": "left_big_toe", "right": "right_big_toe"},
)
# of a marker whose error nobody knows, along an axis: ten times a motion capture's noise, and how far the skin beneath
# it is off at the same moment of every stride; chosen: skin moves by 5 to 10 mm (Leardini et al., Gait & Posture 21
# (2005) 212-225), on a foot rather less
MARKER_SIGMA_M, SKIN_SIGMA_M = 0.002, 0.005
# s, in which the error of a refined joint forgets; chosen by benchmarks.gait
REFINED_S = 0.12
# over this a track is bridged; chosen: a tenth of a stride, in which no foot leaves the floor and comes down again
BRIDGED_S = 0.1
# and the pelvis, which goes on as it went; chosen: about a step
PELVIS_BRIDGED_S = 0.5
# velocities are differences over twice this; chosen: shorter is noise, longer blurs a foot that lands
HALF_S = 0.02
# of the inverse of the matrix with rows (1, 4, 1): the entry n beside the diagonal is this to the power n, times
# 1 / sqrt(12); after so many the rest is below 1e-17
SPLINE_POLE, SPLINE_REACH = 3**0.5 - 2, 30


@dataclass(frozen=True, eq=False)
class Tracks:
    """Of one walker: `seconds` (T,), evenly spaced; `pelvis` (T, 3), `heel` and `toe` (T, 2, 3) m, NaN where unknown.

    `heel_covariance`, `toe_covariance` (T, 2, 3, 3) m^2 of their errors; `heel_lasting`, `toe_lasting` (T, 2): which
    share of it lasts for a second and more. `noise_time_s`: in which the correlation of the rest falls to exp(-1/2), 0
    for white noise.
    """

    seconds: Floats
    pelvis: Floats
    heel: Floats
    toe: Floats
    heel_covariance: Floats
    toe_covariance: Floats
    heel_lasting: Floats
    toe_lasting: Floats
    noise_time_s: float = 0.0

    def on_belt(self, belt: Floats) -> "Tracks":
        """The same in the axes of a treadmill's belt that moves with `belt` (2,) m/s: there the walker goes forward."""
        gone = np.zeros((len(self.seconds), 3))
        gone[:, :2] = np.outer(self.seconds - self.seconds[:1], belt)
        feet = gone[:, None]
        return replace(self, pelvis=self.pelvis - gone, heel=self.heel - feet, toe=self.toe - feet)


def of_joints(
    seconds: Floats,
    points: Floats,
    names: Sequence[str],
    covariance: Floats | None = None,
    lasting: Floats | None = None,
    noise_time_s: float = 0.0,
) -> Tracks | None:
    """`Tracks` from joints or markers `points` (T, J, 3) m; None where there is no pelvis, heel or toe among `names`.

    `covariance` (T, J, 3, 3) m^2 and `lasting` (T, J) as in `Tracks`; NaN or None: a marker's.
    """
    pelvis = next((group for group in PELVIS if set(group) <= set(names)), None)
    heel, toe = (next((k for k in kinds if set(k.values()) <= set(names)), None) for kinds in (HEEL, TOE))
    if pelvis is None or heel is None or toe is None:
        return None
    at = {name: j for j, name in enumerate(names)}

    def both(which: dict[str, str]) -> tuple[Floats, Floats, Floats]:
        index = [at[which[side]] for side in SIDES]
        shape = (len(points), len(index))
        C = np.full((*shape, 3, 3), np.nan) if covariance is None else covariance[:, index]
        share = np.zeros(shape) if lasting is None else np.nan_to_num(lasting[:, index])
        unknown: Bools = np.asarray(~np.isfinite(C).all(axis=(-1, -2)))
        marker = MARKER_SIGMA_M**2 + SKIN_SIGMA_M**2
        C = np.where(unknown[..., None, None], marker * np.eye(3), C)
        return points[:, index], C, np.where(unknown, SKIN_SIGMA_M**2 / marker, share)

    heels, toes = both(heel), both(toe)
    middle = points[:, [at[name] for name in pelvis]].mean(axis=1)
    return Tracks(seconds, middle, heels[0], toes[0], heels[1], toes[1], heels[2], toes[2], noise_time_s)


def bridged(seconds: Floats, values: Floats, longest_s: float = BRIDGED_S) -> tuple[Floats, Bools]:
    """Values (T, 3) without NaN, and which of them are known or within a gap of at most `longest_s` (T,).

    What is longer is filled too, by a line, and not to be used.
    """
    known: Bools = np.asarray(np.isfinite(values).all(axis=-1))
    if known.sum() < 2:
        return np.zeros_like(values), np.zeros(len(values), bool)
    rows = np.flatnonzero(known)
    filled = np.stack([np.interp(seconds, seconds[rows], values[rows, i]) for i in range(values.shape[-1])], axis=-1)
    after = np.searchsorted(rows, np.arange(len(values)))
    before = np.clip(after - (~known), 0, len(rows) - 1)
    inside = known | ((after > 0) & (after < len(rows)))
    after = np.minimum(after, len(rows) - 1)
    gap = seconds[rows[after]] - seconds[rows[before]]
    return filled, inside & (known | (gap <= longest_s + 1e-9))


def known_at(seconds: Floats, known: Bools, times: Floats) -> Bools:
    """Whether a track is known in the frames on either side of `times` (...)."""
    return np.asarray(np.interp(times, seconds, known.astype(float)) > 0.999)


def curve(seconds: Floats, values: Floats) -> Callable[[Floats], Floats]:
    """The natural cubic spline through `values` (T, C) at evenly spaced `seconds` (T,): values (..., C) at times (...)
    between the first and the last.

    Its own, as scipy.interpolate takes longer to import than all else that a walk's gait needs.
    """
    bends = _bends(values)

    def at(times: Floats) -> Floats:
        k = np.clip(np.searchsorted(seconds, times, side="right") - 1, 0, len(seconds) - 2)
        after = ((times - seconds[k]) / (seconds[k + 1] - seconds[k]))[..., None]
        before = 1 - after
        line = before * values[k] + after * values[k + 1]
        return np.asarray(line + ((before**3 - before) * bends[k] + (after**3 - after) * bends[k + 1]) / 6)

    return at


def _bends(values: Floats) -> Floats:
    """Second derivatives (T, C) of a natural cubic spline through values (T, C), per square of the spacing.

    They solve (1, 4, 1) b = 6 * second differences. Where the values go on point-symmetric to their ends, the inverse
    is the same in every row, and the bends at the ends are 0 by themselves.
    """
    along = np.pad(values, ((SPLINE_REACH + 1,) * 2, (0, 0)), "reflect", reflect_type="odd")
    differences = along[2:] - 2 * along[1:-1] + along[:-2]
    kernel = SPLINE_POLE ** np.abs(np.arange(-SPLINE_REACH, SPLINE_REACH + 1)) / 12**0.5
    bends = np.stack([np.convolve(6 * column, kernel, "valid") for column in differences.T], axis=-1)
    bends[[0, -1]] = 0.0
    return bends


def velocity(seconds: Floats, values: Floats, times: Floats, half_s: float = HALF_S) -> Floats:
    """Velocities (..., C) at `times` (...): differences over `half_s` to either side, less where the track ends."""
    first = np.clip(times - half_s, seconds[0], seconds[-1])
    last = np.clip(times + half_s, seconds[0], seconds[-1])
    along = curve(seconds, values)
    return np.asarray((along(last) - along(first)) / (last - first)[..., None])


def velocity_variance(variance: Floats, noise_time_s: float, half_s: float = HALF_S) -> Floats:
    """Variance (m/s)^2 of `velocity` along an axis in which positions have `variance` m^2, without what lasts."""
    alike = np.exp(-0.5 * (2 * half_s / noise_time_s) ** 2) if noise_time_s > 0 else 0.0
    return 2 * variance * (1 - alike) / (2 * half_s) ** 2
