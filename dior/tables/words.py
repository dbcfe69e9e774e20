"""The words that a column may have, where they are few: the vocabularies of `dior.tables.schemas`. And the columns that
tables of several stages have."""

LABEL_STATUS = ("ok", "out_of_frame", "behind_camera", "missing_3d", "occluded", "suspect")
# of labels_2d: what has no pixel because there is no 3D
WITHOUT_3D = ("missing_3d", "suspect")
SWAPPED_PART = ("all", "legs", "rest")
LABEL_SOURCE = ("mocap", "triangulated", "interpolated")
IS_SUBJECT = ("yes", "no", "unknown")
SKELETON_STATUS = ("ok", "too_few_views", "rejected", "gap_filled", "suspect")
OFFSET_SOURCE = ("estimated", "manual", "reference", "assumed_zero")
CLOCK_METHOD = ("", "detections", "marks", "pictures", "cameras", "boxes")
DROP_REASON = ("not_sent", "recorder_behind", "between_bags", "same_stamp", "same_picture", "not_decoded", "cut_off")
# chosen: above this share of pictures lost, whatever the reason, a person would want to see it. A recorder that is well
# loses one of a hundred, which in a walk of some seconds may be two or three
MOST_LOST = 0.03
HEAD_STATUS = ("ok", "out_of_frame", "unknown", "uncertain", "red", "unseen", "beside")
NO_IMAGE = (
    *("no_consent", "head_unknown", "head_uncertain", "head_red", "head_unseen", "head_beside", "not_readable"),
)
COVER = ("head", "other")
MARK_KIND = ("mark", "check")
SPLITS = {"subject": ("train", "val", "test"), "range": ("gallery", "probe"), "outfit": ("gallery", "probe")}
FOOT = ("left", "right")
GAIT_EVENT = ("heel_strike", "toe_off")
SIDE = (*FOOT, "both")
GAIT_LEFT_OUT = ("turn", "standing", "end")
GAIT_MISSING = ("no_events", "no_steps", "running", "no_treadmill", "suspect")
SEVERITY = ("info", "warning", "error")
# of tables about everybody in a sequence, whose rows are
WHO = (
    ("sequence", "text"),
    ("person", "text", "", "person_1, ... in the order of first appearance, in this sequence alone"),
    ("is_subject", IS_SUBJECT, "", "unknown: it cannot be told who is the subject"),
)
