"""The parameters of gait: their names, units, and what they are.

Names as in Hollman et al., Gait & Posture 34 (2011) 111-118 and Huxham et al., Gait & Posture 23 (2006) 159-163; where
they are made and what else they go by: `dior.gait.parameters`.
"""

# (unit, what it is) by parameter, in the order of the tables: of a step, which ends with the strike of its foot
STEP = {
    "step_time": ("s", "from the strike of the other foot to that of this one"),
    "step_length": (
        "m",
        "between the prints of the heels at these strikes, along the line from the other foot's print before to that "
        "after",
    ),
    "step_length_toe": ("m", "the same of the toes' places at the strikes, as Plug-in-Gait has it"),
    "step_width": ("m", "between the prints at right angles to that line; negative: the feet cross"),
}
# of a stride, from a strike to the next one of the same foot
STRIDE = {
    "stride_time": ("s", "from a strike to the next one of the same foot"),
    "stride_length": ("m", "between the prints of the heel at these strikes"),
    "stride_length_toe": ("m", "between the toe's places at these strikes, as Plug-in-Gait has it"),
    "stride_speed": ("m/s", "walking speed: stride_length / stride_time"),
    "stance_share": ("", "of the stride in which the foot is on the floor"),
    "swing_share": ("", "of the stride in which it is not"),
    "double_support_share": ("", "of the stride in which both feet are on the floor, both times together"),
    "single_support_share": ("", "of the stride in which this foot alone is on the floor"),
    "opposite_foot_off_share": ("", "of the stride until the other foot leaves the floor"),
    "opposite_foot_contact_share": ("", "of the stride until the other foot strikes"),
}
OF_WALK = {
    "cadence": ("steps/min", "60 s / step_time"),
    "walk_ratio": ("m min", "step_length / cadence"),
}
# 2 (left - right) / (left + right); positive: the left is longer
SYMMETRY = ("step_time", "step_length", "stance_share", "single_support_share")
ASYMMETRY = {
    f"{name}_asymmetry": ("", f"2 (left - right) / (left + right) of {name}; positive: that of the left is larger")
    for name in SYMMETRY
}
COUNTED = {
    "belt_speed": ("m/s", "of the treadmill that was found below the walker"),
    "turns": ("", "times that the walker turned, whose events are left out"),
    "left_out": ("", "events of which no parameter is made (`reason` of gait_events)"),
}
PARAMETERS = STEP | STRIDE | OF_WALK | ASYMMETRY | COUNTED
