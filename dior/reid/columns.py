"""What the files of re-identification hold (recognise.py writes them, dior/report/reid.py reads them)."""

KEYS = ("method", "weights", "adaptation", "keypoints", "protocol", "environment", "camera")
# table.csv
COLUMNS = (
    *(*KEYS, "rank1", "low", "high", "hits", "n", "chance"),
    *("null95", "p", "rank5", "rank5_low", "rank5_high", "mean_ap", "mean_ap_low", "mean_ap_high"),
    *("mean_inp", "mean_inp_low", "mean_inp_high", "tar", "tar_low", "tar_high", "verdict"),
)
# cmc.csv
CURVES = (*KEYS, "rank", "share")
# left_out.csv
LEFT_OUT = ("what", "session", "sequence", "camera", "why")

# `keypoints`: what the probes are; otherwise the name of a detector. DETECTOR: there is none, the verdict says why
LABELS, POINTS, DETECTOR = "labels", "3D", "detector"
# `verdict`
NO_TRIAL, AT_CHANCE, ABOVE_CHANCE = "no trial", "at chance", "above chance"
NO_OUTPUT = "no detector output of the long-range camera"
TOO_SHORT = "nothing in the detector's output is long enough"
NO_NETWORK = "a detector's output is compared by networks only"
