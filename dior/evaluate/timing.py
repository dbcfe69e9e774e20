"""What the jobs cost: each writes what it used beside its log, and the report collects what is there.

INPUTS   logs/<step>/<unit>.timing.json, written by the command `dior` when a job has succeeded; a sequence, session or
         subject, and a camera make a unit
OUTPUT   results/timing.csv: a row per step and one for all. It and the report's page of costs are the only outputs that
         differ between two runs of the same input.
Seconds. CPU seconds are those of the job's process from its start and of its finished children; wall seconds begin when
the command has started. `cores` is what Snakemake gave the job.
"""

import csv
import io
import json
import os
import resource
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.tables.files import write_text

# names the folder of the logs; the workflow sets it, so that `dior` typed by hand leaves nothing behind
FOLDER = "DIOR_TIMINGS"
_KEYS = ("step", "session", "sequence", "frames", "cores")
COLUMNS = ("step", "jobs", "frames", "cpu_s", "wall_s", "cpu_s_per_frame")
ALL = "all"
ABOUT_ALL = "metadata"  # the tarball of nobody
# what makes the recordings is no cost of labelling them
NOT_COUNTED = ("simulate", "simulate_mocap", "simulate_gallery")


def write(step: str, arguments: dict[str, Any], started: float) -> None:
    """Write what this process has used for a step, where the workflow wants it. `started`: time.monotonic() then."""
    folder = os.environ.get(FOLDER)
    if not folder:
        return
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    used = {
        "step": step,
        **{key: arguments.get(key) for key in ("session", "sequence")},
        "camera": camera_of(arguments),
        "frames": frames_of(step, arguments),
        "cpu_s": round(sum(one.ru_utime + one.ru_stime for one in (own, children)), 3),
        "wall_s": round(time.monotonic() - started, 3),
        "cores": int(os.environ.get("OMP_NUM_THREADS") or os.cpu_count() or 1),
    }
    write_text(Path(folder) / step / f"{unit(step, arguments)}.timing.json", json.dumps(used) + "\n")


def unit(step: str, arguments: dict[str, Any]) -> str:
    """What the rule calls the job in its log: what it is about and the camera."""
    about = [arguments.get(key) for key in ("session", "sequence", "subject")]
    words = [next(filter(None, about), step), camera_of(arguments)]
    return ".".join(filter(None, words))


def camera_of(arguments: dict[str, Any]) -> str | None:
    """The one camera that a job is about, or None; some steps are told its name by its role or in a list only."""
    roles = arguments.get("roles") or {}
    if arguments.get("mocap") and len(arguments.get("names") or ()) == 1:
        return arguments["names"][0]
    return arguments.get("camera") or (next(iter(roles)) if len(roles) == 1 else None)


def frames_of(step: str, arguments: dict[str, Any]) -> int | None:
    """How many pictures a job is about, None where it is not about those of one sequence."""
    table = arguments.get("out" if step == "frames" else "frames")
    if arguments.get("session") or not arguments.get("sequence") or not isinstance(table, Path):
        return None
    from dior.tables import tables

    cameras, one = tables.read(table, "frames", ["camera"])["camera"].tolist(), camera_of(arguments)
    return cameras.count(one) if one else len(cameras)


def collect(
    logs: AnyPath, sequences: Iterable[str], sessions: Iterable[str], people: Iterable[str] = ()
) -> list[dict[str, Any]]:
    """What the jobs of these `sequences`, `sessions` and `people` (pseudonyms) used, as dicts, and those that are about
    all of them; what is left of others is not counted.
    """
    found = []
    for path in sorted(Path(logs).glob("*/*.timing.json")):
        one = _read(path)
        about, known = path.name.split(".")[0], {one["step"], ABOUT_ALL, *people}
        if one["session"] or one["sequence"]:
            about, known = (one["session"], {*sessions}) if one["session"] else (one["sequence"], {*sequences})
        if about in known:
            found.append(one)
    return found


def _read(path: Path) -> dict[str, Any]:
    try:
        one = json.loads(path.read_bytes())
        if all(isinstance(one[key], (int, float)) for key in ("cpu_s", "wall_s")) and {*_KEYS} <= one.keys():
            return one
    except (ValueError, LookupError, TypeError, AttributeError):
        pass
    raise DiorError(f"{path}: is not what a job notes of its costs; delete it and run again")


def by_step(jobs: Sequence[dict[str, Any]], frames: int) -> list[dict[str, Any]]:
    """Rows of results/timing.csv, by step and at the end of all but the simulation.

    `frames`: pictures of the dataset; a step whose jobs do not all know how many they are about is about all of them.
    """
    steps: dict[str, list[dict[str, Any]]] = {}
    for job in jobs:
        steps.setdefault(job["step"], []).append(job)
    rows = [_row(step, members, frames) for step, members in sorted(steps.items())]
    labelling = [job | {"frames": None} for job in jobs if job["step"] not in NOT_COUNTED]
    return [*rows, _row(ALL, labelling, frames)]


def _row(step: str, jobs: Sequence[dict[str, Any]], frames: int) -> dict[str, Any]:
    known = [job["frames"] for job in jobs]
    about = frames if None in known else sum(known)
    return {
        "step": step,
        "jobs": len(jobs),
        "frames": about,
        "cpu_s": round(sum(job["cpu_s"] for job in jobs), 3),
        "wall_s": round(sum(job["wall_s"] for job in jobs), 3),
        "cpu_s_per_frame": _over(jobs, about),
    }


def _over(jobs: Sequence[dict[str, Any]], frames: int) -> float | str:
    return float(f"{sum(job['cpu_s'] for job in jobs) / frames:.4g}") if frames else ""


def as_csv(rows: Iterable[dict[str, Any]]) -> str:
    """The rows as CSV text."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
