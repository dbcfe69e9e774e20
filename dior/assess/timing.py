"""How far a camera's pictures are from the 3D in time: offset and drift, with what they are certain to.

INPUTS   a `View`, the joints in 3D (`WalkerJoints`)
OUTPUTS  `Timing`
The estimator is that of the workflow's clocks (`calibrate.clock.from_mocap`). Its drift is held by what crystals do; a
dataset may count 30 pictures a second that were 25, so the drift is told here by parts of the recording that are
looked at alone, and the offset after it was taken off.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats
from dior.assess.recording import View
from dior.calibrate.clock.from_mocap import WalkerJoints, from_detections
from dior.clocks.clock import NORMAL_95, Estimate

# chosen: a part holds two strides or more; less is hardly told from the next step, and more parts take time
PART_S, FEWEST_PARTS, MOST_PARTS = 2.5, 3, 8
# chosen: rounds after which a rate that is a quarter off has come to rest
ROUNDS = 3
# chosen: a part that is off the line by so many standard errors and half a picture is a step, not a drift
STEP = 5.0

# how a clock is found at some of the pictures, whose times are (F,) s
Estimator = Callable[[Floats, Bools], Estimate]


@dataclass(frozen=True)
class Timing:
    """`late_s` is to be added to the pictures' times in the middle of the recording, and `drift` more for each second
    from there; `sigma_s` and `sigma_drift` 1 sigma, the latter NaN where the recording is too short to tell.

    `steps_s`: by how much the time is off a straight line at most, where it is no line, else 0; `why`: why nothing is
    known, or "".
    """

    late_s: float
    sigma_s: float
    drift: float
    sigma_drift: float
    middle_s: float
    length_s: float
    steps_s: float = 0.0
    why: str = ""

    @property
    def half_s(self) -> float:
        """Half of the 95 % interval of `late_s`."""
        return NORMAL_95 * self.sigma_s

    @property
    def half_drift(self) -> float:
        return NORMAL_95 * self.sigma_drift

    def at(self, elapsed: Floats) -> Floats:
        """The pictures' times put right."""
        drift = self.drift if np.isfinite(self.sigma_drift) else 0.0
        return elapsed + self.late_s + drift * (elapsed - self.middle_s)


def of_view(view: View, walker: WalkerJoints) -> Timing:
    """`Timing` of a view whose keypoints are those of `walker.names`."""

    def estimated(times: Floats, where: Bools) -> Estimate:
        return from_detections(view.camera, walker, view.uv[where], times[where])

    return by_parts(estimated, view.elapsed, view.fps)


def by_parts(estimated: Estimator, elapsed: Floats, fps: float) -> Timing:
    """`Timing` of pictures at `elapsed` (F,) s, all of them together and part by part."""
    length, middle = float(elapsed[-1] - elapsed[0]), float((elapsed[0] + elapsed[-1]) / 2)
    every: Bools = np.ones(len(elapsed), bool)
    count = min(int(length / PART_S), MOST_PARTS)
    whole = late(estimated(elapsed, every))
    if count < FEWEST_PARTS:
        return _alone(whole, middle, length)
    total, times = np.zeros(2), elapsed
    line = None
    for _ in range(ROUNDS):
        line = _line(estimated, times, elapsed, middle, count)
        if line is None:
            break
        value, sigma, steps = line
        total = total + value
        times = elapsed + total[0] + total[1] * (elapsed - middle)
        if abs(value[1]) < sigma[1]:
            break
    if line is None:
        return _alone(whole, middle, length)
    _, sigma, steps = line
    more, sigma_s, why = late(estimated(times, every))
    if why:
        more, sigma_s = 0.0, float(sigma[0])
    off = abs(steps) > 0.5 / fps
    return Timing(
        float(total[0] + more), sigma_s, float(total[1]), float(sigma[1]), middle, length, steps if off else 0.0
    )


def of_parts(
    told: Sequence[tuple[float, float, float]],
    late_s: float,
    sigma_s: float,
    why: str,
    middle: float,
    length: float,
    fps: float,
) -> Timing:
    """`Timing` of what was found as a whole and of (time from the middle, lateness, standard error) of its parts."""
    line = _through(told)
    if line is None:
        return _alone((late_s, sigma_s, why), middle, length)
    value, sigma, steps = line
    if why:
        late_s, sigma_s = float(value[0]), float(sigma[0])
    off = abs(steps) > 0.5 / fps
    return Timing(late_s, sigma_s, float(value[1]), float(sigma[1]), middle, length, steps if off else 0.0)


def late(found: Estimate) -> tuple[float, float, str]:
    """Lateness in the middle (s), its standard error, and why it is not known or ""."""
    clock, _, _, why = found
    return clock.late_s, clock.given[0], why


def _alone(whole: tuple[float, float, str], middle: float, length: float) -> Timing:
    late, sigma, why = whole
    return Timing(late if not why else np.nan, sigma if not why else np.nan, 0.0, np.nan, middle, length, 0.0, why)


def _line(
    estimated: Estimator, times: Floats, elapsed: Floats, middle: float, count: int
) -> tuple[Floats, Floats, float] | None:
    """Lateness in the middle (s) and its slope by the parts' own, their standard errors, and how far a part is off that
    line where none would be by chance; None where too few parts tell."""
    bounds = np.linspace(elapsed[0], elapsed[-1], count + 1)
    told = []
    for first, last in zip(bounds[:-1], bounds[1:], strict=True):
        where = (elapsed >= first) & (elapsed <= last)
        value, own, why = late(estimated(times, where))
        if not why and np.isfinite(own):
            told.append((float(first + last) / 2 - middle, value, own))
    return _through(told)


def _through(told: Sequence[tuple[float, float, float]]) -> tuple[Floats, Floats, float] | None:
    """The same of (time from the middle, lateness, standard error) of the parts."""
    if len(told) < FEWEST_PARTS:
        return None
    x, y, s = np.array(told).T
    A = np.stack([np.ones(len(x)), x], axis=1) / s[:, None]
    covariance = np.linalg.inv(A.T @ A)
    value = covariance @ A.T @ (y / s)
    off = y - value[0] - value[1] * x
    scatter = float((off**2 / s**2).sum() / max(len(x) - 2, 1))
    worst = int(np.abs(off).argmax())
    step = float(off[worst]) if abs(off[worst]) > STEP * s[worst] else 0.0
    return value, np.sqrt(np.diagonal(covariance) * max(scatter, 1.0)), step
