"""Reading the results of a run."""

import csv
import hashlib


def metrics(folder):
    with open(folder / "results/evaluate/metrics.csv", newline="") as stream:
        return list(csv.DictReader(stream))


def figure(rows, metric, **where):
    keys = {"subject": "", "sequence": "", "camera": "", "role": "", "joint": ""} | where
    found = [row for row in rows if row["metric"] == metric and all(row[k] == v for k, v in keys.items())]
    assert len(found) == 1, f"{len(found)} rows of {metric} {where}"
    return float(found[0]["value"])


# what the jobs cost is the only output that differs between two runs
COSTS = ("timing.csv", "report/cost.html")


def contents(folder):
    """Hashes of all results but the costs, by path."""
    costs = [folder / "results" / name for name in COSTS]
    files = sorted(path for path in (folder / "results").rglob("*") if path.is_file() and path not in costs)
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}
