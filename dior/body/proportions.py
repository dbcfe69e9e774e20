"""Proportions of an adult's body, said once for the package; the simulator keeps its own numbers as a check.

Lengths of segments are shares of the stature: Drillis and Contini (1966), in Winter, Biomechanics and Motor Control of
Human Movement, 4th ed., fig. 4.1: hip to knee 0.245, knee to ankle 0.246, shoulder (0.818) to hip (0.530).
"""

SIDES = ("left", "right")
THIGH, SHANK, TRUNK = 0.245, 0.246, 0.288
SEGMENTS = {("hip", "knee"): THIGH, ("knee", "ankle"): SHANK, ("shoulder", "hip"): TRUNK}
# what these three add up to: the part of the stature that the joints of a detector tell
STATURE_SHARE = THIGH + SHANK + TRUNK
# the same sum of joints: a segment joins the middles of two sets of joints, and counts by its weight, so that of thighs
# and of shanks it is the mean of both sides
STATURE_SEGMENTS = (
    *(((f"{side}_{a}",), (f"{side}_{b}",), 0.5) for a, b in (("hip", "knee"), ("knee", "ankle")) for side in SIDES),
    (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"), 1.0),
)
# height of the heel and of the ball of a standing foot above the floor, m; chosen: a shoe's sole and half the flesh
# above it. An error of it is an error of the floor of the same size, which is allowed 2 cm (`facts.Floor.sigma_m`).
SOLE_M = 0.03
