"""Walking and running: joint angles over the gait cycle, and what else differs between the two.

Degrees at 0, 5, ... 95 % of the cycle from foot contact; flexion and dorsiflexion positive, the hip against the
vertical.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Floats


@dataclass(frozen=True)
class Pattern:
    """A gait.

    `toe_off`: share of the cycle during which a foot stands; `midstance`: where in the cycle the hip passes over the
    place of the ankle; `height` and `bounce`: of the hips at most, and how much lower they are at midstance, body
    heights; `clearance` (m): of a foot from the floor in the middle of its swing, at least; `arm` (degrees): middle and
    amplitude of the shoulder's flexion and of the elbow's; `lean`: of the trunk, degrees; `strides`: a function of the
    speed (m/s) and the body height (m) that gives the strides per second. `lands`: share of the
    cycle for which the heel is on the floor before it is at rest, and `rolls`: for which the toes are after the ball
    has left; `second`: when in the cycle of the left foot the right one comes down, not halfway where somebody limps.

    What people differ in, of which the curves say nothing: `quickness`: more strides than usual at a speed, a factor;
    `sway` of the hips and `feet_apart`, of each foot from the middle, body heights; `hips_turn`, `hips_drop` and
    `chest_turn`: amplitudes, and `feet_out`: degrees.
    """

    hip: tuple[float, ...]
    knee: tuple[float, ...]
    ankle: tuple[float, ...]
    toe_off: float
    midstance: float
    height: float
    bounce: float
    clearance: float
    arm: tuple[float, float, float, float]
    lean: float
    strides: Callable[[Any, float], Any]
    rolls: float
    lands: float = 0.007
    second: float = 0.5
    quickness: float = 1.0
    sway: float = 0.011
    feet_apart: float = 0.026
    hips_turn: float = 5.0
    hips_drop: float = 3.5
    chest_turn: float = 4.0
    feet_out: float = 6.0


def walking_cadence(speed: ArrayLike, height: float) -> Floats:
    """Strides per second at a speed (m/s): 64.8 v^0.57 per minute with v in statures per second, adult men.

    Grieve and Gear, Ergonomics 9 (1966) 379-399.
    """
    return 64.8 / 60.0 * (np.asarray(speed) / height) ** 0.57


def running_cadence(speed: ArrayLike, height: float) -> Floats:
    """Strides per second at a speed (m/s): runners lengthen the stride instead.

    A line through the rates of Cavanagh and Kram, Med. Sci. Sports Exerc. 21 (1989) 467-479.
    """
    return 1.25 + 0.05 * np.asarray(speed)


# `lands` and `rolls` of WALK are chosen on real walks with events (../shared/data/mocap), since bodies here have
# neither soft heels nor toes: at a real toe off the marker behind the toes has 0.9 of the walking speed. Those of RUN
# are a guess.
# Winter, The Biomechanics and Motor Control of Human Gait, 2nd ed. (1991), natural cadence, as read off its mean
# curves; they agree with Kadaba et al., J. Orthop. Res. 8 (1990) 383-392 where the hip is taken against the vertical.
# Arms: shoulder 24 degrees back to 8 forward, elbow 20-40 (Murray et al. 1967, Am. J. Phys. Med.).
WALK = Pattern(
    hip=(20, 19, 17, 14, 10, 6, 2, -3, -8, -12, -15, -14, -9, -1, 7, 14, 18.5, 21, 21.5, 20.5),
    knee=(4, 10, 16, 18, 17, 14, 11, 8, 7, 8, 12, 20, 34, 49, 60, 64, 59, 45, 26, 9),
    ankle=(0, -5, -4, 0, 3, 5.5, 7, 8.3, 9.4, 9.6, 7, -1, -14, -19, -15, -9, -4.5, -2, -1, 0),
    toe_off=0.62,
    midstance=0.21,
    height=0.53,
    bounce=0.0,
    clearance=0.012,
    arm=(-8.0, 16.0, 30.0, 10.0),
    lean=3.0,
    strides=walking_cadence,
    rolls=0.045,
)
# Novacheck, The biomechanics of running, Gait and Posture 7 (1998) 77-95, as read off its curves, for a jog
RUN = Pattern(
    hip=(27, 26, 23, 18, 12, 6, 0, -5, -9, -9, -5, 3, 12, 21, 29, 34, 36, 35, 32, 29),
    knee=(18, 28, 36, 39, 37, 31, 24, 19, 18, 24, 38, 56, 73, 84, 86, 79, 63, 42, 24, 15),
    ankle=(5, 8, 14, 19, 22, 19, 10, -4, -16, -20, -16, -10, -5, -2, 0, 2, 3, 4, 5, 5),
    toe_off=0.34,
    midstance=0.16,
    height=0.515,
    bounce=0.035,
    clearance=0.12,
    arm=(-15.0, 25.0, 90.0, 10.0),
    lean=8.0,
    strides=running_cadence,
    rolls=0.06,
)

# How people differ: standard deviations of the curves' middles and of their first two harmonics (degrees, each of sine
# and cosine), of angles, and of logarithms of what is scaled. All are assumptions of ours, chosen so that:
# - a joint's angle scatters by 2.3-2.7 degrees at any time, about half of the bands of 4-5 degrees around the mean
#   curves in Winter (1991), which also hold how markers are placed and how people vary from stride to stride;
# - the width of the steps scatters by a quarter: it is 14.0 +- 3.1 % of the leg's length between people who walk at the
#   speed they like (J. NeuroEng. Rehabil. 9 (2012) 69, table 1), the other scaled movements alike for want of a source;
# - the rest leaves a walk that looks like one; no source was found.
CURVE_SD, HARMONICS_SD = {"hip": 2.0, "knee": 1.5, "ankle": 1.5}, (1.5, 1.0)
QUICKNESS_SD, TOE_OFF_SD, SCALE_SD = 0.04, 0.01, 0.25
ARM_SD, LEAN_SD, FEET_OUT_SD = 5.0, 2.0, 3.0


def of_person(pattern: Pattern, random: np.random.Generator) -> Pattern:
    """The pattern as one person has it, drawn from the generator `random`."""

    def curve(name: str) -> tuple[float, ...]:
        turn = 2 * np.pi * np.arange(len(getattr(pattern, name))) / len(getattr(pattern, name))
        values = np.array(getattr(pattern, name)) + CURVE_SD[name] * random.standard_normal()
        for k, sd in enumerate(HARMONICS_SD, 1):
            a, b = sd * random.standard_normal(2)
            values += a * np.cos(k * turn) + b * np.sin(k * turn)
        return tuple(values.tolist())

    def scaled(value: float, sd: float = SCALE_SD) -> float:
        return float(value * np.exp(sd * random.standard_normal()))

    shoulder_at, shoulder_by, elbow_at, elbow_by = pattern.arm
    curves: dict[str, Any] = {name: curve(name) for name in CURVE_SD}
    return replace(
        pattern,
        **curves,
        toe_off=float(pattern.toe_off + TOE_OFF_SD * random.standard_normal()),
        arm=(
            float(shoulder_at + ARM_SD * random.standard_normal()),
            scaled(shoulder_by),
            float(elbow_at + ARM_SD * random.standard_normal()),
            scaled(elbow_by),
        ),
        lean=float(pattern.lean + LEAN_SD * random.standard_normal()),
        quickness=scaled(pattern.quickness, QUICKNESS_SD),
        sway=scaled(pattern.sway),
        feet_apart=scaled(pattern.feet_apart),
        hips_turn=scaled(pattern.hips_turn),
        hips_drop=scaled(pattern.hips_drop),
        chest_turn=scaled(pattern.chest_turn),
        feet_out=float(pattern.feet_out + FEET_OUT_SD * random.standard_normal()),
    )
