"""The table of key figures on the index: every metric by environment, role and tool.

INPUTS   rows of metrics.csv
OUTPUT   its lines in words; nothing is drawn or written here
"""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from dior.evaluate import bootstrap
from dior.evaluate.metrics import QUANTILES
from dior.report.numbers import count, show

# a row of metrics.csv by column, as dior.evaluate.metrics.read gives it
Row: TypeAlias = dict[str, Any]


def _interval(members: list[Row]) -> str:
    """The bootstrap's interval over the subjects of rows, in words; empty with one subject."""
    _, index = np.unique([row["subject"] for row in members], return_inverse=True)
    n = np.array([row["n"] for row in members])
    sums = n * np.array([row["value"] for row in members])
    low, high = bootstrap.of_mean(np.bincount(index, sums), np.bincount(index, n))
    if not np.isfinite(low):
        return ""
    unit = members[0]["unit"]
    return f"{show(low, unit).split(' ')[0]} to {show(high, unit)}"


def table_of(rows: list[Row], environment: Mapping[str, str]) -> list[dict[str, str]]:
    """Rows of the key figures: dicts metric, where, value, interval, n; means weighted by n over the sequences.

    `environment`: sequence -> indoor | outdoor. Rows of no sequence (the adjustment's) are taken as they are.
    """
    whole = [row for row in rows if not row["joint"]]
    # the mean of quantiles is no quantile
    means = [row for row in whole if row["metric"] not in QUANTILES]
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in means:
        if row["sequence"] and (row["camera"] or not row["role"]):
            key = (row["metric"], environment.get(row["sequence"], ""), row["role"], row["tool"])
            groups.setdefault(key, []).append(row)
    lines = [
        {
            "metric": metric,
            "where": " ".join(word for word in (env, role.replace("_", " "), tool) if word),
            "value": show(np.dot([r["n"] for r in members], [r["value"] for r in members]) / n, members[0]["unit"]),
            "interval": _interval(members),
            "n": count(n),
        }
        for (metric, env, role, tool), members in sorted(groups.items())
        if (n := sum(r["n"] for r in members))
    ]
    pooled = {row["metric"] for row in means if row["sequence"]}
    lines += [
        {
            "metric": row["metric"],
            "where": "all",
            "value": show(row["value"], row["unit"]),
            "interval": "",
            "n": count(row["n"]),
        }
        for row in whole
        if row["metric"] not in pooled and not row["camera"] and not row["subject"] and not row["role"]
    ]
    return lines
