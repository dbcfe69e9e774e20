"""Walking and running: joint angles over the gait cycle, and what else differs between the two.

Degrees at 0, 5, ... 95 % of the cycle from foot contact; flexion and dorsiflexion positive, the hip against the
vertical.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pattern:
    """A gait.

    `toe_off`: share of the cycle during which a foot stands; `midstance`: where in the cycle the hip passes over the
    place of the ankle; `height` and `bounce`: of the hips at most, and how much lower they are at midstance, body
    heights; `clearance` (m): of a foot from the floor in the middle of its swing, at least; `arm` (degrees): middle and
    amplitude of the shoulder's flexion and of the elbow's; `lean`: of the trunk, degrees; `strides`: a function of the
    speed (m/s) and the body height (m) that gives the strides per second.
    """

    hip: tuple
    knee: tuple
    ankle: tuple
    toe_off: float
    midstance: float
    height: float
    bounce: float
    clearance: float
    arm: tuple
    lean: float
    strides: object


def walking_cadence(speed, height):
    """Strides per second at a speed (m/s): 64.8 v^0.57 per minute with v in statures per second, adult men.

    Grieve and Gear, Ergonomics 9 (1966) 379-399.
    """
    return 64.8 / 60.0 * (np.asarray(speed) / height) ** 0.57


def running_cadence(speed, height):
    """Strides per second at a speed (m/s): runners lengthen the stride instead.

    A line through the rates of Cavanagh and Kram, Med. Sci. Sports Exerc. 21 (1989) 467-479.
    """
    return 1.25 + 0.05 * np.asarray(speed)


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
)
