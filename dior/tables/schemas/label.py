"""Tables of dior.label: the 2D labels of the subject, and of everybody where all people are labelled."""

from dior.tables.words import LABEL_SOURCE, LABEL_STATUS, WHO

# of somebody's labels in a camera, whoever it is
BODY_2D = (
    ("camera", "text"),
    ("joint", "text"),
    ("frame", "int32"),
    ("stamp_ns", "int64", "ns", "the picture's header stamp"),
    ("u", "float32", "px"),
    ("v", "float32", "px"),
    ("sigma_u", "float32", "px"),
    ("sigma_v", "float32", "px"),
    ("rho_uv", "float32"),
    ("depth", "float32", "m"),
    ("status", LABEL_STATUS),
    ("source", LABEL_SOURCE),
)
TABLES = {
    "labels_2d": (("subject", "text"), ("sequence", "text"), *BODY_2D),
    "people_2d": (*WHO, *BODY_2D),
}
