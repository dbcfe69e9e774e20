"""What the report says of the stamps of a sequence, from the audit's tables.

INPUTS   its `stamp_audit`, `dropped_frames` and `frames` tables
OUTPUT   a `SequenceStamps`: numbers to draw and rows of text
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Table
from dior.ingest import video_starts
from dior.report.numbers import count, show
from dior.tables import tables

REPEATED = ("same_stamp", "same_picture")


@dataclass(frozen=True, eq=False)
class SequenceStamps:
    """`lags`: camera -> (times (F,) s, lag beyond its median (F,) ms); `dropped`: camera -> reason -> times s.

    `rows`: what the page's table shows, a dict per camera and bag.
    """

    lags: dict[str, tuple[Floats, Floats]]
    dropped: dict[str, dict[str, list[float]]]
    rows: tuple[dict[str, str], ...]


def read(sequence: str, audit: Path, dropped: Path, frames: Path) -> SequenceStamps:
    """`SequenceStamps` of a sequence from its tables `stamp_audit`, `dropped_frames` and `frames`."""
    table = tables.read(frames, "frames", ["camera", "stamp_ns", "receive_ns"])
    start = table["stamp_ns"].min()
    lags, films = {}, video_starts.told(frames)
    for camera in tables.ordered_unique(table["camera"]):
        own = tables.of_camera(table, camera)
        # a video's pictures were received as they were taken
        received = own["stamp_ns" if camera in films else "receive_ns"]
        lag = (received - own["stamp_ns"]) / 1e6
        lags[camera] = (own["stamp_ns"] - start) / 1e9, lag - np.median(lag)
    lost = tables.read(dropped, "dropped_frames")
    reasons: dict[str, dict[str, list[float]]] = {}
    for camera, stamp, reason in zip(lost["camera"], lost["stamp_ns"].tolist(), lost["reason"], strict=True):
        reasons.setdefault(camera, {}).setdefault(reason, []).append((stamp - start) / 1e9)
    rows = tables.read(audit, "stamp_audit")
    return SequenceStamps(lags, reasons, tuple(_row(sequence, rows, i) for i in range(len(rows["camera"]))))


def _row(sequence: str, table: Table, i: int) -> dict[str, str]:
    one = {key: values[i] for key, values in table.items()}
    return {
        "sequence": sequence,
        "camera": one["camera"],
        "bag": one["bag"],
        "pictures": count(one["pictures"]),
        "rate": f"{one['rate_hz']:.2f}" if np.isfinite(one["rate_hz"]) else "unknown",
        "jitter": show(one["jitter_ms"], "ms"),
        "lost": count(one["lost"]),
        "repeated": count(sum(one[key] for key in REPEATED)),
        "lag": f"{show(one['lag_ms'], 'ms')} (+{show(one['lag_max_ms'], 'ms')})",
        "drift": f"{one['drift_ppm']:.0f} ppm" if np.isfinite(one["drift_ppm"]) else "unknown",
    }
