"""Tables of dior.gait: when feet strike the floor and leave it, and the parameters of gait."""

from dior.tables.gait_parameters import PARAMETERS, STEP, STRIDE
from dior.tables.words import FOOT, GAIT_EVENT, GAIT_LEFT_OUT, GAIT_MISSING, SIDE

_SPREAD = (
    ("value", "float64"),
    ("sigma", "float64", "", "1 sigma of its error, in the unit of value; null: it is a count, or there is no value"),
    ("low", "float64", "", "95 % interval of value"),
    ("high", "float64"),
)
TABLES = {
    "gait_events": (
        ("subject", "text"),
        ("sequence", "text"),
        ("foot", FOOT),
        ("event", GAIT_EVENT),
        ("stamp_ns", "int64", "ns", "when it was, on the clock of the stamps of skeletons_3d"),
        ("instant", "int32", "", "of skeletons_3d that is nearest to it"),
        ("time_s", "float64", "s", "after the first instant of the walk"),
        ("sigma_s", "float64", "s", "1 sigma on that clock; a camera's picture has the error of its own clock besides"),
        ("low_s", "float64", "s", "95 % interval of time_s"),
        ("high_s", "float64", "s"),
        (
            "reason",
            GAIT_LEFT_OUT,
            "",
            "why no parameter is made of it: turn, standing, or the end of what is known; null: it is used",
        ),
    ),
    "gait_steps": (
        ("subject", "text"),
        ("sequence", "text"),
        ("parameter", tuple(STEP | STRIDE)),
        ("foot", FOOT, "", "whose strike ends the step or stride"),
        ("start_s", "float64", "s", "after the first instant of the walk: the strike that it begins with"),
        ("end_s", "float64", "s", "the strike that it ends with"),
        *_SPREAD,
        ("unit", "text"),
    ),
    "gait_parameters": (
        ("subject", "text"),
        ("sequence", "text"),
        ("parameter", tuple(PARAMETERS)),
        ("side", SIDE, "", "both: the mean of the sides' means"),
        *_SPREAD,
        ("sd", "float64", "", "how much the steps or strides differ, errors included; null: fewer than two"),
        ("n", "int32", "", "steps or strides that it is of"),
        ("unit", "text"),
        ("reason", GAIT_MISSING, "", "why there is no value; null where there is one"),
    ),
}
