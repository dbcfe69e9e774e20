"""What a run takes, and whether this computer has it: time, disk, memory, optional packages.

INPUTS   a `Project` (paths as seen from the working directory); what was recorded (`recordings.Recorded`)
OUTPUTS  a `Plan`; faults and warnings in `Notes`
The figures are those of the demo (`python -m benchmarks.demo`), made larger: no more than an order of magnitude.
"""

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from math import isfinite
from pathlib import Path

from dior.check.notes import Notes
from dior.check.recordings import Recorded
from dior.errors import many
from dior.project.contents import Project
from dior.project.missing import CONFIG, line_of
from dior.project.run import cores
from dior.shortage import free_memory, size

# chosen: 9 600 pictures in 8 walks take 285 CPU s by `python -m benchmarks.demo`, most of which are the same for walks
# of any length, and leave 37 MB; the largest job has 0.3 GB
WALK_S, PICTURE_S, PICTURE_BYTES, JOB_BYTES = 25.0, 0.0015, 4000, 400_000_000
# chosen: recordings are read three times (frames, audit, detections), at the rate of a plain hard disk
READ_TIMES, DISK_BYTES_PER_S = 3, 150e6
# what asks for a package: its module, the extra of dior that has it
AV, ONNX, TORCH = ("av", "video"), ("onnxruntime", "detect"), ("torch", "reid")


@dataclass(frozen=True)
class Plan:
    """What will be done: so many `walks` of `sessions`, their cameras' `recordings` and `pictures`; `minutes_walked`,
    each walk counted once; `files` with them, of `file_bytes`. What it takes, about: `minutes` on `processors`, and
    `disk_bytes`, of which `free_bytes` are left."""

    walks: int
    sessions: int
    recordings: int
    pictures: int
    minutes_walked: float
    files: int
    file_bytes: int
    minutes: float
    processors: int
    disk_bytes: int
    free_bytes: int

    def __str__(self) -> str:
        text = f"{many(self.walks, 'walk')} of {many(self.sessions, 'session')}"
        if not self.recordings:
            return f"{text}, which are simulated first."
        count = f"{self.pictures / 1e6:.1f} million" if self.pictures >= 1e6 else f"{self.pictures}"
        return (
            f"{text}, {_time(self.minutes_walked)} in all: {many(self.recordings, 'recording')} of cameras, {count} "
            f"pictures, in {many(self.files, 'file')} of {size(self.file_bytes)}. A run takes about "
            f"{_time(max(round(self.minutes), 1))} on {many(self.processors, 'processor')} and "
            f"{size(self.disk_bytes)} of disk ({size(self.free_bytes)} are free)."
        )


def _time(minutes: float) -> str:
    if minutes < 1:
        return f"{60 * minutes:.0f} s"
    return f"{minutes:.0f} min" if minutes < 100 else f"{minutes / 60:.1f} h"


def plan(project: Project, recorded: Mapping[str, Mapping[str, Recorded]]) -> Plan:
    """What a run on the walks `recorded`, by walk and camera, does and takes."""
    every = [one for cameras in recorded.values() for one in cameras.values()]
    paths = sorted({path for one in every for path in one.paths})
    file_bytes, pictures = sum(map(_bytes, paths)), sum(one.count for one in every)
    seconds = (WALK_S * len(recorded) + PICTURE_S * pictures) / cores() + READ_TIMES * file_bytes / DISK_BYTES_PER_S
    return Plan(
        walks=len(recorded),
        sessions=len(project.sessions),
        recordings=len(every),
        pictures=pictures,
        minutes_walked=sum(map(_lasts_s, recorded.values())) / 60,
        files=len(paths),
        file_bytes=file_bytes,
        minutes=seconds / 60,
        processors=cores(),
        disk_bytes=PICTURE_BYTES * pictures,
        free_bytes=shutil.disk_usage(project.root).free,
    )


def _lasts_s(cameras: Mapping[str, Recorded]) -> float:
    """How long the longest recording of a walk is, 0 where none tells."""
    return max((one.lasts_s for one in cameras.values() if isfinite(one.lasts_s)), default=0.0)


def _bytes(path: str) -> int:
    if os.path.isdir(path):
        return sum(entry.stat().st_size for entry in os.scandir(path) if entry.is_file())
    return os.path.getsize(path)


def check_room(project: Project, plan: Plan, notes: Notes) -> None:
    """Look whether disk and memory are enough."""
    needed, free = plan.disk_bytes, plan.free_bytes
    if needed > free / 2:
        text = f"the results take about {size(needed)}, and {size(free)} are free; make room"
        # some of it may be there from an earlier run
        tell = notes.fault if needed > free and not Path("results").exists() else notes.warn
        tell("results/", None, text)
    memory = free_memory()
    if 0 < memory < JOB_BYTES * plan.processors:
        jobs = max(memory // JOB_BYTES, 1)
        text = (
            f"{plan.processors} jobs at once may take {size(JOB_BYTES * plan.processors)} of memory, and "
            f"{size(memory)} are free; end other programs, or type `dior run -j{jobs}`"
        )
        notes.warn("this computer", None, text)


def check_packages(project: Project, notes: Notes) -> bool:
    """Look whether the packages are there that the project asks for; whether videos can be looked into."""
    videos = [path for walk in project.sequences for path in project.videos(walk).values() if os.path.isfile(path)]
    lacking = {package: find_spec(package[0]) is None for package in (AV, ONNX, TORCH)}
    if videos and lacking[AV]:
        notes.fault("config/sequences.tsv", None, f"{videos[0]} is a video, which needs PyAV; {_install(AV)}")
    if any(map(project.detected_here, project.sequences)) and lacking[ONNX]:
        line = line_of(project.root, CONFIG, "detector")
        notes.fault(CONFIG, line, f"`detections: detect` needs onnxruntime; {_install(ONNX)}")
    # a re-identification that is there is made anew with the rest
    if project.config["reid"]["networks"] and Path("results/reid").exists() and lacking[TORCH]:
        line = line_of(project.root, CONFIG, "reid")
        notes.fault(CONFIG, line, f"the networks of results/reid need torch; {_install(TORCH)}")
    return not lacking[AV]


def _install(package: tuple[str, str]) -> str:
    return f"install it: pip install -e '.[{package[1]}]'"
