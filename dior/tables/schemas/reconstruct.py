"""Tables of dior.reconstruct: common instants and 3D skeletons, of the subject and of everybody."""

from dior.tables.words import SKELETON_STATUS, SWAPPED_PART, WHO

# of somebody's 3D, whoever it is
BODY_3D = (
    ("joint", "text"),
    ("instant", "int32"),
    ("stamp_ns", "int64", "ns"),
    ("x", "float32", "m"),
    ("y", "float32", "m"),
    ("z", "float32", "m"),
    ("sigma_x", "float32", "m", "1 sigma given the cameras, whose own errors all points share"),
    ("sigma_y", "float32", "m"),
    ("sigma_z", "float32", "m"),
    ("rho_xy", "float32", "", "correlation of the errors"),
    ("rho_xz", "float32"),
    ("rho_yz", "float32"),
    ("constant_share", "float32", "", "of the variance what lasts for a second and more, null where not known"),
    ("n_views", "int8", "", "null where the views are not known (mocap)"),
    ("residual_px", "float32", "px", "mean distance to the detections used"),
    ("status", SKELETON_STATUS),
)
TABLES = {
    "bodies": (
        ("subject", "text"),
        ("sequence", "text"),
        ("stature_m", "float64", "m", "by the detector's joints; null where it is not sure that the body is his"),
        ("sigma_m", "float64", "m"),
        ("longer_m", "float64", "m", "what errors made it longer, which was taken off"),
    ),
    "timeline": (
        ("instant", "int32"),
        ("camera", "text"),
        ("stamp_ns", "int64", "ns"),
        ("frame_before", "int32", "", "null: the camera has nothing at this instant"),
        ("frame_after", "int32"),
        ("weight", "float64", "", "of frame_after; frame_before has the rest"),
    ),
    "skeletons_3d": (("subject", "text"), ("sequence", "text"), *BODY_3D),
    "people_3d": (*WHO, *BODY_3D),
    "swaps": (
        ("camera", "text"),
        ("instant", "int32"),
        ("stamp_ns", "int64", "ns"),
        ("frame", "int32", "", "the camera's picture nearest to the instant; null where there is none"),
        ("swapped", "bool", "", "left and right were exchanged in this camera's detections"),
        ("part", SWAPPED_PART, "", "of which joints: all, legs (hips included), rest; null: of none"),
    ),
}
