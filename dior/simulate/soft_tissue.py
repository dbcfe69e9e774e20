"""Skin and cloth: how markers move against the skeleton, in step with the gait.

Soft tissue moves markers by 5-10 mm at the shank and more at the thigh, mostly at the step's and the stride's
frequency (Leardini et al., Gait & Posture 21 (2005) 212-225).
"""

from collections.abc import Callable

import numpy as np

from dior.arrays import Floats

# chosen: shares of the stride's frequency, of the step's and of three times the stride's
HARMONICS = (1.0, 0.6, 0.3)


def movement(
    random: np.random.Generator, markers: int, rms_m: tuple[float, float], stride_hz: float
) -> Callable[[Floats], Floats]:
    """A function of times (T,) s that gives displacements (T, markers, 3) m.

    The rms length of each marker's displacement is drawn from the range `rms_m`; `stride_hz` strides per second.
    """
    phase = random.uniform(0, 2 * np.pi, (len(HARMONICS), markers, 3))
    share = random.standard_normal((len(HARMONICS), markers, 3)) * np.array(HARMONICS)[:, None, None]
    # a sine of amplitude a has the mean square a^2 / 2
    low, high = rms_m
    share *= random.uniform(low, high, markers)[:, None] / np.sqrt((share**2).sum(axis=(0, 2)) / 2)[:, None]

    def at(t: Floats) -> Floats:
        turn = 2 * np.pi * stride_hz * np.asarray(t, float)[:, None, None]
        return sum(share[k] * np.sin((k + 1) * turn + phase[k]) for k in range(len(HARMONICS)))

    return at
