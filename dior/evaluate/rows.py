"""Rows of the `metrics` and `frame_metrics` tables from grids of values, NaN where there is nothing to measure."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dior.arrays import Floats, Table
from dior.evaluate.grids import LabelGrid


class Row(NamedTuple):
    """One figure: a mean with the number of values behind it. Empty text means all."""

    metric: str
    camera: str
    role: str
    joint: str
    value: float
    unit: str
    n: int
    tool: str = ""


def mean_row(
    metric: str, values: Floats, unit: str, camera: str = "", role: str = "", joint: str = "", tool: str = ""
) -> list[Row]:
    """The mean of what is there in `values` as a list of one `Row`; empty where nothing is."""
    known = values[np.isfinite(values)]
    return [Row(metric, camera, role, joint, float(known.mean()), unit, known.size, tool)] if known.size else []


def joint_rows(
    metric: str, values: Floats, joints: Sequence[str], unit: str, camera: str = "", role: str = ""
) -> list[Row]:
    """One `Row` per joint of `values` (F, J)."""
    return [row for i, joint in enumerate(joints) for row in mean_row(metric, values[:, i], unit, camera, role, joint)]


def frame_rows(metric: str, values: Floats, grid: LabelGrid, role: str) -> Table:
    """Columns of `frame_metrics`, one row per frame of `values` (F, J) in which anything is known."""
    known = np.isfinite(values)
    n = known.sum(axis=1)
    some = n > 0
    mean = np.where(known, values, 0.0).sum(axis=1)[some] / n[some]
    return {
        "metric": np.full(some.sum(), metric, dtype=object),
        "camera": np.full(some.sum(), grid.camera, dtype=object),
        "role": np.full(some.sum(), role, dtype=object),
        "frame": grid.frames[some],
        "stamp_ns": grid.stamp_ns[some],
        "value": mean,
        "n": n[some],
    }


def stacked(parts: Sequence[Table]) -> Table:
    """Tables of equal columns, one below the other; no columns where there is no table."""
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]} if parts else {}


def metric_columns(rows: Sequence[Row], subject: str, sequence: str) -> Table:
    """Columns of the `metrics` table; one subject has no interval."""
    columns = {key: np.array([getattr(row, key) for row in rows], dtype=object) for key in Row._fields}
    nothing = np.full(len(rows), np.nan)
    return columns | {
        "subject": np.full(len(rows), subject, dtype=object),
        "sequence": np.full(len(rows), sequence, dtype=object),
        "value": np.array([row.value for row in rows], float),
        "n": np.array([row.n for row in rows], np.int64),
        "low": nothing,
        "high": nothing,
    }
