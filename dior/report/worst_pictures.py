"""The pictures at which a figure is worst, so that the index can lead to them.

INPUTS   a `frame_metrics` table, or what each sequence left of it
OUTPUTS  per section of the index: words and the worst picture of each of a few recordings
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dior.arrays import Table
from dior.report.numbers import show
from dior.tables import tables

# by section of the index: metric, sign (+1: large is bad), unit, words
SECTIONS = {
    "Outdoor, close range": ("reprojection_error", 1, "px", "Furthest from the detections"),
    "Long range": ("in_box_share", -1, "share", "Fewest labels in the hand box"),
    "Against the known truth": ("error_to_truth_2d", 1, "px", "Furthest from the truth"),
}
# recordings per section; chosen: a list that is read to its end
MOST = 5


def by_recording(table: Table, metric: str, sign: int) -> dict[tuple[str, str], tuple[float, int]]:
    """(sequence, camera) -> value and frame of the picture that is worst by a metric of the `frame_metrics` of one
    sequence; `sign` +1: large is bad."""
    rows = tables.rows(table, (table["metric"] == metric) & np.isfinite(table["value"]))
    found = {}
    for camera in tables.ordered_unique(rows["camera"]):
        mine = tables.of_camera(rows, camera)
        i = int(np.argmax(sign * mine["value"]))
        found[mine["sequence"][i], camera] = (float(mine["value"][i]), int(mine["frame"][i]))
    return found


def of_sections(worst: Mapping[tuple[str, str], Mapping[str, tuple[float, int]]]) -> dict[str, dict[str, Any] | None]:
    """Section -> dict words, pictures: the worst picture of each of the MOST worst recordings.

    `worst`: (sequence, camera) -> metric -> value and frame of its worst picture.
    """
    found: dict[str, dict[str, Any] | None] = {}
    for section, (metric, sign, unit, words) in SECTIONS.items():
        own = [(key, by_metric[metric]) for key, by_metric in worst.items() if metric in by_metric]
        ordered = sorted(own, key=lambda item: (-sign * item[1][0], item[0]))[:MOST]
        pictures = [
            {"sequence": sequence, "camera": camera, "frame": frame, "value": show(value, unit)}
            for (sequence, camera), (value, frame) in ordered
        ]
        found[section] = {"words": words, "pictures": pictures} if pictures else None
    return found
