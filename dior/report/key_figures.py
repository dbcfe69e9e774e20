"""The table of key figures on the index: every metric by environment, role and tool.

INPUTS   rows of metrics.csv
OUTPUT   its lines in words; nothing is drawn or written here
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dior.evaluate import bootstrap
from dior.evaluate.metrics import COLUMNS, QUANTILES
from dior.report.numbers import count, show

if TYPE_CHECKING:
    import pandas as pd

# a row of metrics.csv by column, as dior.evaluate.metrics.read gives it
Row: TypeAlias = dict[str, Any]


def table_of(rows: list[Row], environment: Mapping[str, str]) -> list[dict[str, str]]:
    """Rows of the key figures: dicts metric, where, value, interval, n; means weighted by n over the sequences.

    `environment`: sequence -> indoor | outdoor. Rows of no sequence (the adjustment's) are taken as they are.
    """
    import pandas as pd

    whole = pd.DataFrame(rows, columns=COLUMNS).query("joint == ''")
    # the mean of quantiles is no quantile
    means = whole[~whole["metric"].isin(QUANTILES)]
    lone = means.query("sequence != '' and (camera != '' or role == '')")
    lone = lone.assign(place=lone["sequence"].map(environment).fillna(""), sum=lone["n"] * lone["value"])
    lines = []
    for _, own in lone.groupby(["metric", "place", "role", "tool"]):
        n, first = int(own["n"].sum()), own.iloc[0]
        if n:
            words = first["place"], first["role"].replace("_", " "), first["tool"]
            value = show(own["sum"].sum() / n, first["unit"])
            lines.append(_line(first["metric"], " ".join(filter(None, words)), value, _interval(own), n))
    of_sequences = means.query("sequence != ''")["metric"]
    alone = whole[~whole["metric"].isin(of_sequences)].query("camera == '' and subject == '' and role == ''")
    for row in alone.to_dict("records"):
        lines.append(_line(row["metric"], "all", show(row["value"], row["unit"]), "", row["n"]))
    return lines


def _line(metric: str, where: str, value: str, interval: str, n: int) -> dict[str, str]:
    return {"metric": metric, "where": where, "value": value, "interval": interval, "n": count(n)}


def _interval(own: "pd.DataFrame") -> str:
    """The bootstrap's interval over the subjects of rows, in words; empty with one subject."""
    by_subject = own.groupby("subject")[["sum", "n"]].sum()
    low, high = bootstrap.of_mean(by_subject["sum"].to_numpy(), by_subject["n"].to_numpy())
    if not np.isfinite(low):
        return ""
    unit = own["unit"].iloc[0]
    return f"{show(low, unit).split(' ')[0]} to {show(high, unit)}"
