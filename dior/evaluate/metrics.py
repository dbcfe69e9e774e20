"""One table of all figures: those of every sequence, and means over subjects, roles and everything.

INPUTS   `metrics` tables: of evaluate and detectors (one per sequence) and of adjust (one per session); `check_errors`
         tables, for the quantiles that means of means cannot give.
OUTPUT   results/evaluate/metrics.csv: metric, tool, subject, sequence, camera, role, joint, value, low, high, unit, n;
         an empty cell means all. `low` and `high` are the bootstrap's 95 % interval over subjects (bootstrap.py), of
         pooled rows without a subject; empty with fewer than two subjects. Sorted; numbers with six significant
         digits, so that the file is the same on every machine.
"""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Table
from dior.errors import DiorError
from dior.evaluate import bootstrap
from dior.evaluate.rows import stacked
from dior.tables import result_checksums, tables
from dior.tables.files import write_text

COLUMNS = tables.columns_of("metrics")
# a row, by COLUMNS
Figure: TypeAlias = dict[str, Any]
KEY = ("metric", "tool", "subject", "sequence", "camera", "role", "joint")
# what a pooled row keeps; the joints of a skeleton are pooled apart from its means
POOLS = (
    ("metric", "tool", "subject", "role"),
    ("metric", "tool", "subject"),
    ("metric", "tool", "role"),
    ("metric", "tool", "camera", "role"),
    ("metric", "tool"),
    ("metric", "tool", "subject", "sequence", "role"),
)
JOINT_POOLS = (("metric", "tool", "role", "joint"),)


# the quantiles of a metric whose values are all kept
QUANTILES = {"check_error_median": 0.5, "check_error_p95": 0.95}


def run(*, inputs: list[Path], checks: list[Path], out: Path) -> None:
    """Merge `metrics` tables and add the pooled rows, and the quantiles of the `check_errors` tables `checks`."""
    found = [row for path in inputs for row in _rows(tables.read(path, "metrics"))]
    parts = [tables.read(path, "check_errors") for path in checks]
    parts = [part for part in parts if len(part["error"])]
    quantiles = quantile_rows(stacked(parts)) if parts else []
    write_text(out, as_csv(in_order([*merged(found), *quantiles])))


def _rows(table: Any) -> list[Figure]:
    """The rows of a table, or of a data frame, by COLUMNS."""
    lines = zip(*(table[c].tolist() for c in COLUMNS), strict=True)
    return [dict(zip(COLUMNS, line, strict=True)) for line in lines]


def merged(rows: Sequence[Figure]) -> list[Figure]:
    """`rows` and their pooled rows, in order.

    Only rows of a sequence are pooled. The adjustment's rows are of a session, for which there is no column: where
    several sessions have the same key, their rows become one.
    """
    seen = {tuple(row[k] for k in KEY): row for row in pooled([r for r in rows if not r["sequence"]], KEY)}
    for row in (r for r in rows if r["sequence"]):
        key = tuple(row[k] for k in KEY)
        if key in seen:
            named = ", ".join(f"{k} {v}" for k, v in zip(KEY, key, strict=True) if v)
            raise DiorError(f"metrics: two inputs have the figure of {named}; is a file listed twice?")
        seen[key] = row
    for pools, with_joint in ((POOLS, False), (JOINT_POOLS, True)):
        of_sequences = [row for row in rows if row["sequence"] and bool(row["joint"]) == with_joint]
        for pool in pools:
            for row in pooled(of_sequences, pool):
                seen.setdefault(tuple(row[k] for k in KEY), row)
    return in_order(seen.values())


def in_order(rows: Iterable[Figure]) -> list[Figure]:
    """`rows` sorted by key."""
    return sorted(rows, key=lambda row: tuple(row[k] for k in KEY))


def pooled(rows: Iterable[Figure], keep: Sequence[str]) -> list[Figure]:
    """Means weighted by n of rows that agree in the columns `keep`: exactly the mean over all values behind them.

    Where subjects are pooled, with the bootstrap's interval.
    """
    import pandas as pd

    table = pd.DataFrame(rows, columns=COLUMNS).assign(sum=lambda one: one["n"] * one["value"])
    groups = table.groupby(list(keep), sort=False)
    found = groups.agg({"sum": "sum", "n": "sum", "unit": ["first", "nunique"]})
    found.columns = ["sum", "n", "unit", "units"]
    found = found.reset_index()
    for mixed in found.loc[found["units"] > 1, "metric"]:
        units = sorted(table.loc[table["metric"] == mixed, "unit"].unique())
        raise DiorError(f"metrics: {mixed} is given in {' and '.join(units)}; give it one unit")
    intervals = [bootstrap.NOTHING] * len(found)
    if "subject" not in keep:
        by_subject = table.groupby([*keep, "subject"], sort=False)[["sum", "n"]].sum()
        of_group = by_subject.groupby(list(keep), sort=False)
        intervals = [bootstrap.of_mean(one["sum"].to_numpy(), one["n"].to_numpy()) for _, one in of_group]
    found["value"] = found["sum"] / found["n"]
    found[["low", "high"]] = np.array(intervals).reshape(-1, 2)
    return _rows(found.reindex(columns=COLUMNS, fill_value=""))


def quantile_rows(checks: Table) -> list[Figure]:
    """Rows of QUANTILES of a `check_errors` table, pooled like the means."""
    import pandas as pd

    table = pd.DataFrame(checks).assign(tool="")
    found = []
    for pool in (*POOLS, KEY):
        keep = [k for k in pool if k in table and k != "joint"]
        for key, members in table.groupby(keep, sort=False):
            errors, subject = members["error"].to_numpy(float), members["subject"].to_numpy(str)
            for metric, q in QUANTILES.items():
                low, high = bootstrap.NOTHING if "subject" in keep else bootstrap.of_quantile(errors, subject, q)
                value = {
                    "value": float(np.quantile(errors, q)),
                    "low": low,
                    "high": high,
                    "unit": "px",
                    "n": len(errors),
                }
                found.append(
                    {**dict.fromkeys(COLUMNS, ""), **dict(zip(keep, key, strict=True)), "metric": metric, **value}
                )
    return found


def as_csv(rows: Iterable[Figure]) -> str:
    """The rows as CSV text."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(row[c]) for c in COLUMNS] for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return "" if np.isnan(value) else repr(float(f"{value:.6g}"))


def read(path: AnyPath) -> list[Figure]:
    """Rows of metrics.csv as dicts; value, low and high are floats (NaN: unknown), n is an int."""
    rows = list(csv.DictReader(io.StringIO(result_checksums.read_text(path), newline="")))
    if rows and tuple(rows[0]) != tuple(COLUMNS):
        raise DiorError(f"{path}: the columns are not {','.join(COLUMNS)}; delete it and run again")
    for row in rows:
        for key in ("value", "low", "high"):
            row[key] = float(row[key]) if row[key] else np.nan
        row["n"] = int(row["n"])
    return rows
