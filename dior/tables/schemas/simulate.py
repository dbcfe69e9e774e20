"""Tables of dior.simulate: what the simulator did to a detection."""

TABLES = {
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
