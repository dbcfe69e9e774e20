"""Figures of the hand checks, the hand boxes and the other detectors: what is drawn, from the rows of metrics.csv.

INPUTS   rows of metrics.csv as `dior.evaluate.metrics.read` gives them
OUTPUT   `Drawing`s: what plots.marks and plots.bars draw, with title, caption and the text for who cannot see it
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dior.report import plots
from dior.report.key_figures import Row

ALL = "all"
INTERVAL = "Lines are 95 % intervals over the subjects; where there is none, it is not known."
PAPER_IN_BOX = (0.9669, "96.69 % in the paper")


@dataclass(frozen=True)
class Drawing:
    """A figure to be drawn as `draw(path, *args, **options)` into `<name>.svg`."""

    name: str
    draw: Callable[..., None]
    args: tuple[Any, ...]
    title: str
    caption: str
    alt: str
    options: dict[str, Any]


def indoor(rows: list[Row]) -> list[Drawing]:
    """Distances of the labels from hand checks, by camera and by subject."""
    series = {
        "median": "check_error_median",
        "mean": "check_error",
        "95th percentile": "check_error_p95",
    }
    text = "Points marked by hand for this purpose only; half of them are nearer than the median."
    return [
        *_marks("check_error_camera", rows, "camera", series, "distance, px", "Hand checks against labels, by camera",
                text),
        *_marks("check_error_subject", rows, "subject", series, "distance, px",
                "Hand checks against labels, by subject", text),
    ]  # fmt: skip


def long_range(rows: list[Row]) -> list[Drawing]:
    """Labels against hand boxes, by subject."""
    return [
        *_marks("in_box_subject", rows, "subject", {"labels": "in_box_share", "perfect labels": "in_box_expected"},
                "labels in the box, %", "Labels in the hand boxes, by subject", in_box_words(rows), percent=True,
                limit=PAPER_IN_BOX),
        *_marks("box_iou_subject", rows, "subject", {"overlap": "box_iou"}, "common area / area of either, %",
                "Overlap of label box and hand box, by subject",
                "Intersection over union; the label box is tight around the labels of the picture.", percent=True),
        *_marks("box_offset_subject", rows, "subject", {"right": "box_offset_u", "down": "box_offset_v"},
                "centre of the label box minus that of the hand box, px", "Offset of the labels, by subject",
                "Labels that are off as a whole show here. A hand box with the whole head has its centre above that "
                "of the landmarks."),
        *_marks("box_size_subject", rows, "subject",
                {"width": "box_width_difference", "height": "box_height_difference"},
                "size of the label box minus that of the hand box, px", "Size of the boxes, by subject",
                "Negative: drawn larger than tight, which is what raises the share in the box."),
    ]  # fmt: skip


def in_box_words(rows: list[Row]) -> str:
    """What the share in hand boxes is to be compared with in this capture."""
    pooled = {
        row["metric"]: row["value"]
        for row in rows
        if row["metric"] in ("in_box_share", "in_box_expected") and _only(row, "role") and row["role"] == "long_range"
    }
    if len(pooled) < 2:
        return "The share says as much of the boxes as of the labels: large boxes hold any label."
    share, expected = 100 * pooled["in_box_share"], 100 * pooled["in_box_expected"]
    return (
        f"The share says as much of the boxes as of the labels: perfect labels would score {expected:.1f} % in boxes "
        f"drawn like these, which is good to about 4 percentage points with 30 boxes; these labels score {share:.1f} %."
    )


def detectors(rows: list[Row]) -> list[Drawing]:
    """The paper's tables 2 and 3: what other detectors find at long range, by tool, raw and zoomed."""
    found = []
    for name, metric, title, text in (
        ("detected_tool", "detected_share", "Pictures in which other detectors find anybody",
         "The paper's table 2; n are pictures."),
        ("success_tool", "success_share", "Pictures in which other detectors find the subject",
         "The paper's table 3: at least 20 % of the keypoints of somebody lie in the label box; n are pictures."),
    ):  # fmt: skip
        own = [row for row in rows if row["metric"] == metric and row["tool"] and _only(row, "role", "tool")]
        several = len({row["role"] for row in own}) > 1
        bars = {
            row["tool"] + (f", {row['role'].replace('_', ' ')}" if several else ""): _of(row)
            for row in sorted(own, key=lambda r: (r["role"] != "long_range", r["tool"]))
        }
        if bars:
            said = "; ".join(f"{tool} {100 * bar[0]:.1f} %, n {bar[3]}" for tool, bar in bars.items())
            found.append(
                Drawing(name, plots.bars, (bars, "share of the pictures, %"), title, f"{text} {INTERVAL}",
                        f"{title}: {said}", {"percent": True})
            )  # fmt: skip
    return found


def interval(rows: list[Row], metric: str, n: int, **where: str) -> tuple[float, float]:
    """(low, high) of the pooled row of `metric` with the columns `where` if it is of the same `n` values, else NaN.

    What is drawn may be of one environment; a row that pools more is not its interval.
    """
    for row in rows:
        if row["metric"] == metric and row["n"] == n and _only(row, "role", *where):
            if all(row[key] == value for key, value in where.items()):
                return row["low"], row["high"]
    return np.nan, np.nan


def whole(rows: list[Row], metric: str, n: int) -> plots.Value | None:
    """(value, low, high, n) of everything of a metric, if the row is of the same `n` values and has an interval."""
    for row in rows:
        if row["metric"] == metric and row["n"] == n and _only(row) and np.isfinite(row["low"]):
            return _of(row)
    return None


def _only(row: Row, *columns: str) -> bool:
    """Whether a row is pooled over everything but these columns."""
    return not any(row[key] for key in ("tool", "subject", "sequence", "camera", "role", "joint") if key not in columns)


def _of(row: Row) -> plots.Value:
    return row["value"], row["low"], row["high"], row["n"]


def _marks(
    name: str, rows: list[Row], group: str, series: Mapping[str, str], label: str, title: str, text: str, **options: Any
) -> list[Drawing]:
    """`plots.marks` of the metrics `series` (name -> metric) by camera or subject, and of all; [] without rows."""
    by_metric = {metric: shown for shown, metric in series.items()}
    members: dict[str, dict[str, list[Row]]] = {shown: {} for shown in series}
    for row in rows:
        shown = by_metric.get(row["metric"])
        if shown and not row["tool"] and row["role"] and row[group] and _only(row, group, "role"):
            members[shown].setdefault(row[group], []).append(row)
        elif shown and not row["tool"] and row["role"] and _only(row, "role"):
            members[shown].setdefault(ALL, []).append(row)
    # a camera's name may have two roles in two sessions: the row with more values counts
    values = {
        shown: {at: _of(max(own, key=lambda r: r["n"])) for at, own in by_group.items()}
        for shown, by_group in members.items()
    }
    groups = sorted({at for by_group in values.values() for at in by_group if at != ALL})
    if not groups:
        return []
    groups += [ALL] if any(ALL in by_group for by_group in values.values()) else []
    alt = f"{title}: {', '.join(series)} of {len(groups)} rows"
    return [Drawing(name, plots.marks, (groups, values, label), title, f"{text} {INTERVAL}", alt, options)]
