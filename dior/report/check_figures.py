"""Figures of the hand checks, the hand boxes and the other detectors: what is drawn, from the rows of metrics.csv.

INPUTS   the table metrics.csv
OUTPUT   `Drawing`s: what plots.marks and plots.bars draw, with title, caption and the text for who cannot see it
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dior.report import plots

if TYPE_CHECKING:
    import pandas as pd

ALL = "all"
# columns of metrics.csv in which an empty cell means all
POOLED = ("tool", "subject", "sequence", "camera", "role", "joint")
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


def indoor(table: "pd.DataFrame") -> list[Drawing]:
    """Distances of the labels from hand checks, by camera and by subject."""
    series = {
        "median": "check_error_median",
        "mean": "check_error",
        "95th percentile": "check_error_p95",
    }
    text = "Points marked by hand for this purpose only; half of them are nearer than the median."
    return [
        *_marks("check_error_camera", table, "camera", series, "distance, px", "Hand checks against labels, by camera",
                text),
        *_marks("check_error_subject", table, "subject", series, "distance, px",
                "Hand checks against labels, by subject", text),
    ]  # fmt: skip


def long_range(table: "pd.DataFrame") -> list[Drawing]:
    """Labels against hand boxes, by subject."""
    return [
        *_marks("in_box_subject", table, "subject", {"labels": "in_box_share", "perfect labels": "in_box_expected"},
                "labels in the box, %", "Labels in the hand boxes, by subject", in_box_words(table), percent=True,
                limit=PAPER_IN_BOX),
        *_marks("box_iou_subject", table, "subject", {"overlap": "box_iou"}, "common area / area of either, %",
                "Overlap of label box and hand box, by subject",
                "Intersection over union; the label box is tight around the labels of the picture.", percent=True),
        *_marks("box_offset_subject", table, "subject", {"right": "box_offset_u", "down": "box_offset_v"},
                "centre of the label box minus that of the hand box, px", "Offset of the labels, by subject",
                "Labels that are off as a whole show here. A hand box with the whole head has its centre above that "
                "of the landmarks."),
        *_marks("box_size_subject", table, "subject",
                {"width": "box_width_difference", "height": "box_height_difference"},
                "size of the label box minus that of the hand box, px", "Size of the boxes, by subject",
                "Negative: drawn larger than tight, which is what raises the share in the box."),
    ]  # fmt: skip


JUDGES = {
    "held_back": "In the boxes that no step has fitted to, which have the habits of who drew them, too, they score",
    "left_out": "With each box left out of the fit that gives its labels, they score",
    "other_drawer": "In the boxes of other drawers, who have habits of their own, they score",
}


def in_box_words(table: "pd.DataFrame") -> str:
    """What the share in hand boxes is to be compared with in this capture."""
    far = pooled(table, "role").query("role == 'long_range'").set_index("metric")["value"]
    if not {"in_box_share", "in_box_expected"} <= set(far.index):
        return "The share says as much of the boxes as of the labels: large boxes hold any label."
    share, expected = 100 * far["in_box_share"], 100 * far["in_box_expected"]
    text = (
        f"The share says as much of the boxes as of the labels: perfect labels would score {expected:.1f} % in boxes "
        f"drawn like these, which is good to about 4 percentage points with 30 boxes; these labels score {share:.1f} %."
    )
    for name, words in JUDGES.items():
        if {f"{name}_share", f"{name}_expected"} <= set(far.index):
            text += (
                f" {words} {100 * far[f'{name}_share']:.1f} %, perfect ones would score "
                f"{100 * far[f'{name}_expected']:.1f} %."
            )
    return text


def detectors(table: "pd.DataFrame") -> list[Drawing]:
    """The paper's tables 2 and 3: what other detectors find at long range, by tool, raw and zoomed."""
    found = []
    for name, metric, title, text in (
        ("detected_tool", "detected_share", "Pictures in which other detectors find anybody",
         "The paper's table 2; n are pictures."),
        ("success_tool", "success_share", "Pictures in which other detectors find the subject",
         "The paper's table 3: at least 20 % of the keypoints of somebody lie in the label box; n are pictures."),
    ):  # fmt: skip
        own = pooled(table, "role", "tool")
        own = own[(own["metric"] == metric) & (own["tool"] != "") & (own["role"] != "")]
        own = own.assign(close=own["role"] != "long_range", less=-own["value"]).sort_values(["close", "less", "tool"])
        several = own["role"].nunique() > 1
        bars = {row.tool + (f", {row.role.replace('_', ' ')}" if several else ""): _of(row) for row in own.itertuples()}
        if bars:
            said = "; ".join(f"{tool} {100 * bar[0]:.1f} %, n {bar[3]}" for tool, bar in bars.items())
            found.append(
                Drawing(name, plots.bars, (bars, "share of the pictures, %"), title, f"{text} {INTERVAL}",
                        f"{title}: {said}", {"percent": True})
            )  # fmt: skip
    return found


def pooled(table: "pd.DataFrame", *columns: str) -> "pd.DataFrame":
    """The rows that are pooled over everything but these columns."""
    return table[(table[[key for key in POOLED if key not in columns]] == "").all(axis=1)]


def interval(table: "pd.DataFrame", metric: str, n: int, **where: str) -> tuple[float, float]:
    """(low, high) of the pooled row of `metric` with the columns `where` if it is of the same `n` values, else NaN.

    What is drawn may be of one environment; a row that pools more is not its interval.
    """
    own = pooled(table, "role", *where)
    own = own[(own["metric"] == metric) & (own["n"] == n)]
    for key, value in where.items():
        own = own[own[key] == value]
    return (own["low"].iloc[0], own["high"].iloc[0]) if len(own) else (np.nan, np.nan)


def whole(table: "pd.DataFrame", metric: str, n: int) -> plots.Value | None:
    """(value, low, high, n) of everything of a metric, if the row is of the same `n` values and has an interval."""
    own = pooled(table)
    own = own[(own["metric"] == metric) & (own["n"] == n) & own["low"].notna()]
    return _of(next(own.itertuples())) if len(own) else None


def _of(row: Any) -> plots.Value:
    """Of a row that `itertuples` gives."""
    return row.value, row.low, row.high, row.n


def _marks(
    name: str,
    table: "pd.DataFrame",
    group: str,
    series: Mapping[str, str],
    label: str,
    title: str,
    text: str,
    **options: Any,
) -> list[Drawing]:
    """`plots.marks` of the metrics `series` (name -> metric) by camera or subject, and of all; [] without rows."""
    own = pooled(table, group, "role").query("role != ''")
    own = own[own["metric"].isin(list(series.values()))]
    if own.empty:
        return []
    own = own.assign(at=own[group].replace("", ALL))
    # a camera's name may have two roles in two sessions: the row with more values counts
    own = own.sort_values("n", ascending=False, kind="stable").drop_duplicates(["metric", "at"]).sort_index()
    values = {
        shown: {row.at: _of(row) for row in own[own["metric"] == metric].itertuples()}
        for shown, metric in series.items()
    }
    groups = sorted({*own["at"]} - {ALL})
    if not groups:
        return []
    groups += [ALL] if ALL in {*own["at"]} else []
    alt = f"{title}: {', '.join(series)} of {len(groups)} rows"
    return [Drawing(name, plots.marks, (groups, values, label), title, f"{text} {INTERVAL}", alt, options)]
