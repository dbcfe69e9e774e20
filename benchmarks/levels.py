"""The demo with the `ideal` and the `real` simulated detector and recorders, offsets given: errors against the truth.

usage: python -m benchmarks.levels [FOLDER]      (FOLDER for ideal/ and real/: a new temporary one, removed afterwards)
"""

import csv
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.demo import pooled, run
from dior.simulate import config, settings
from dior.tables import tables

LEVELS = ("ideal", "real")
FIGURES = (
    ("error_to_truth_2d", "indoor", "close", "px"),
    ("error_to_truth_2d", "outdoor", "close", "px"),
    ("error_to_truth_2d", "outdoor", "long_range", "px"),
    ("reprojection_error", "outdoor", "close", "px"),
    ("in_box_share", "outdoor", "long_range", ""),
    ("coverage", "indoor", "close", ""),
    ("coverage", "outdoor", "close", ""),
    ("coverage", "outdoor", "long_range", ""),
)


def figures(folder):
    """What `FIGURES` names, the 3D errors and the shares of what is missing, by name, of a finished run."""
    with open(folder / "results/evaluate/metrics.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    found = {
        f"{metric}, {environment} {role}" + (f", {unit}" if unit else ""): pooled(rows, metric, environment, role)
        for metric, environment, role, unit in FIGURES
    }
    for environment in ("indoor", "outdoor"):
        for metric in ("error_to_truth_3d", "error_to_truth_3d_aligned"):
            found[f"{metric}, {environment}, mm"] = 1000 * pooled(rows, metric, environment, "")
    for table, pattern in (("labels_2d", "reproject/*.parquet"), ("skeletons_3d", "refine/outdoor_??.parquet")):
        counts = statuses(sorted((folder / "results").glob(pattern)), table)
        total = sum(counts.values())
        found |= {f"{table}, {status}": count / total for status, count in sorted(counts.items())}
    return found


def statuses(paths, table):
    """How often each status occurs in tables."""
    counts = Counter()
    for path in paths:
        words, numbers = np.unique(tables.read(path, table, ["status"])["status"], return_counts=True)
        counts.update(dict(zip(words.tolist(), numbers.tolist(), strict=True)))
    return counts


def main():
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    folder = given or Path(tempfile.mkdtemp(prefix="dior-levels-"))
    measured = {}
    for level in LEVELS:
        config.write(settings.from_dict({"preset": level}), folder / level / "config")
        first, _ = run(folder / level)
        measured[level] = {"wall time, s": first} | figures(folder / level)
    names = dict.fromkeys(name for level in LEVELS for name in measured[level])
    print(f"{'what':<48}" + "".join(f"{level:>10}" for level in LEVELS) + f"{'ratio':>8}")
    for name in names:
        ideal, real = (measured[level].get(name, 0.0) for level in LEVELS)
        print(f"{name:<48}{ideal:>10.4g}{real:>10.4g}{real / ideal if ideal else np.inf:>8.2f}")
    if given is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
