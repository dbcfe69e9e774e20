"""Tables of dior.simulate: what the simulator did to a detection, when feet touch the floor, and joint angles."""

from dior.tables.words import FOOT, GAIT_EVENT

TABLES = {
    "contacts": (
        ("subject", "text"),
        ("sequence", "text"),
        ("foot", FOOT),
        ("event", GAIT_EVENT),
        ("stamp_ns", "int64", "ns"),
        ("x", "float64", "m", "where the heel rests in that stance"),
        ("y", "float64", "m"),
    ),
    "simulated_angles": (
        ("subject", "text"),
        ("sequence", "text"),
        ("stamp_ns", "int64", "ns"),
        ("angle", "text", "", "by the name and sign of OpenSim's gait models"),
        ("value", "float64", "deg"),
    ),
    "simulated_detections": (
        ("camera", "text"),
        ("frame", "int32"),
        ("stamp_ns", "int64", "ns"),
        ("person", "int32"),
        ("joint", "text"),
        ("noise_u", "float32", "px", "added to the true pixel; null: not the subject's"),
        ("noise_v", "float32", "px"),
        ("bias_u", "float32", "px", "constant offset of the landmark, and of a hidden one that of the guess; added"),
        ("bias_v", "float32", "px"),
        ("missed", "bool", "", "nobody was found in this picture"),
        ("swapped", "bool", "", "has the pixel of the same landmark of the other side"),
        ("guessed", "bool", "", "the landmark was hidden"),
        ("wrong_together", "bool", "", "lies on the other limb, as in a second camera"),
        ("bystander", "bool", "", "somebody else was found instead of the subject"),
    ),
}
