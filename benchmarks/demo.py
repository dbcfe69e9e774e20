"""Run the demo as a newcomer does, in a folder of its own, and print what it took and how near the truth it is.

usage: python -m benchmarks.demo [FOLDER]      (FOLDER: a new temporary one, removed afterwards)
"""

import csv
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from dior.project.steps import MODULES

ROOT = Path(__file__).resolve().parents[1]
LIMITS = (
    ("wall time, s", "", 180),
    ("on disk, GB", "", 1.0),
    ("error_to_truth_2d", "indoor", 1.0),
    ("error_to_truth_2d", "outdoor close", 3.0),
    ("error_to_truth_2d", "outdoor long_range", 2.0),
    ("1 - in_box_share", "outdoor long_range", 1 - 0.967),
)


def run(folder):
    """(wall time, CPU seconds) of a first and a second `snakemake -j2` in `folder`, jobs included.

    Python keeps what it compiles, as it does unless that is forbidden: each of some hundred jobs would compile anew.
    """
    times = []
    own = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    for _ in range(2):
        start, before = time.perf_counter(), cpu_of_children()
        command = [sys.executable, "-m", "snakemake", "-j2", "--quiet", "all", "--directory", folder]
        subprocess.run(command, cwd=ROOT, check=True, env=own | {"PYTHONPATH": str(ROOT)})
        times.append((time.perf_counter() - start, cpu_of_children() - before))
    return times


def cpu_of_children():
    """CPU seconds of the processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def start_up(step):
    """CPU seconds in which a job of a step starts: Python, its flags, and its module with all that this imports."""
    code = f"from dior.cli import flags, main; flags.flags_of({step!r}); import dior.evaluate.timing, os"
    code += f"; import dior.{MODULES[step]}; os._exit(0)"
    each = []
    for _ in range(3):
        before = cpu_of_children()
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
        each.append(cpu_of_children() - before)
    return min(each)


def around(folder, cpu_s):
    """What surrounds the work of the steps in a run that took `cpu_s`: the start of its jobs, and Snakemake."""
    with open(folder / "results/timing.csv", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["step"] in MODULES]
    return {
        "CPU of the run, s": cpu_s,
        "of which jobs start, s": sum(int(row["jobs"]) * start_up(row["step"]) for row in rows),
        "of which Snakemake, shells, exits, s": cpu_s - sum(float(row["cpu_s"]) for row in rows),
    }


def taken(folder):
    """What the steps took and left in `folder`, those of the simulation and its recordings left out."""
    with open(folder / "results/timing.csv", newline="") as stream:
        seconds = [float(row["cpu_s"]) for row in csv.DictReader(stream) if not row["step"].startswith("simulate")]
    left = [path for path in (folder / "results").rglob("*") if path.is_file()]
    left = [path for path in left if folder / "results/simulate" not in path.parents]
    rows = [path.read_text().splitlines()[1].split("\t") for path in (folder / "logs").rglob("*.benchmark.tsv")]
    return {
        "CPU, s": sum(seconds),
        "on disk, MB": sum(path.stat().st_size for path in left) / 1e6,
        # its third column is max_rss
        "memory of the largest job, MB": max(float(row[2]) for row in rows if row[2] not in ("NA", "-")),
    }


def pooled(rows, metric, environment, role):
    """Mean of a metric weighted by its count, from the rows by sequence (and camera, where it has a role)."""
    mine = [
        (float(row["value"]), int(row["n"]))
        for row in rows
        if row["metric"] == metric
        and row["role"] == role
        and row["sequence"].startswith(environment)
        and bool(row["camera"]) == bool(role)
        and row["sequence"]
        and not row["joint"]
    ]
    return sum(value * n for value, n in mine) / sum(n for _, n in mine)


def main():
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    folder = given or Path(tempfile.mkdtemp(prefix="dior-demo-"))
    shutil.copytree(ROOT / "config", folder / "config", dirs_exist_ok=True)
    (first, cpu_s), (second, _) = run(folder)
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    with open(folder / "results/evaluate/metrics.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    measured = (
        first,
        size / 1e9,
        pooled(rows, "error_to_truth_2d", "indoor", "close"),
        pooled(rows, "error_to_truth_2d", "outdoor", "close"),
        pooled(rows, "error_to_truth_2d", "outdoor", "long_range"),
        1 - pooled(rows, "in_box_share", "outdoor", "long_range"),
    )
    print(f"{'what':<40}{'measured':>10}{'at most':>10}{'ratio':>8}")
    for (what, where, limit), value in zip(LIMITS, measured, strict=True):
        print(f"{f'{what} {where}':<40}{value:>10.3f}{limit:>10.3f}{value / limit:>8.2f}")
    print(f"{'a second call, s':<40}{second:>10.3f}")
    print("without the simulation (dior/check/computer.py scales these)")
    for what, value in taken(folder).items():
        print(f"  {what:<38}{value:>10.1f}")
    print("with the simulation (what a job imports later, as scipy, is its work)")
    for what, value in around(folder, cpu_s).items():
        print(f"  {what:<38}{value:>10.1f}")
    if given is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
