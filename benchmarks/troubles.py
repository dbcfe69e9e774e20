"""Trouble is made in a capture that is right, what the report says first is typed, and it is run again: is it mended?

usage: python -m benchmarks.troubles [CASE ...]      (all; each is two runs of a small capture)

by_eye          the long-range camera is placed by eye, 0.3 degrees beside the person
clock_indoors   a clock given by hand is off by a picture, indoors
clock_outdoors  the same of a close camera outdoors
clock_adjusted  the same in the walk that the session is adjusted with
marks_from_1    the frames of an indoor camera's marks count from 1

What is typed is read from the sentence that a run ends with, and typed as it stands. `before`, `after`: the mean
distance of the labels from the truth, px, of the camera and walk where they are worst; that of the capture without
trouble is in the first line.
"""

import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml

from dior.calibrate.align import aligned_pose
from dior.geometry.camera import project
from dior.simulate import config, scene
from dior.simulate import settings as levels
from dior.simulate.clocks import clocks_of

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = levels.from_dict({"subjects": 1, "sequences": 2, "duration_s": 5})
A_PICTURE = 1 / SETTINGS.fps
OFF_DEG = 0.3
# "...; in config/offsets/walk.yaml: remove the line of cam02."
TYPED = re.compile(r"; in (config/\S+): (.+?)\.?(?: \d+ more (?:is|are) in the report\.)?$")


def by_eye(folder):
    """The camera's file, without the boxes that it is fitted to, with the nudge that is right but for OFF_DEG."""
    path = folder / "config/sessions/field/cam04.yaml"
    kept = [line for line in path.read_text().splitlines() if not line.startswith(("align:", "#"))]
    placed = scene.cameras_of(SETTINGS, "field")["cam04"]
    target, tape = np.array([placed.target]), yaml.safe_load("\n".join(kept))["tape"]
    right, nudge = project(placed.camera, target)[0][0], np.zeros(2)
    for _ in range(5):
        eye = placed.camera.at(
            aligned_pose(path, tape, dict(zip(("azimuth_deg", "elevation_deg"), nudge, strict=True)))
        )
        nudge += np.degrees((right - project(eye, target)[0][0]) / placed.camera.intrinsics.fx)
    kept.append(f"nudge: {{azimuth_deg: {nudge[0] + OFF_DEG:.3f}, elevation_deg: {nudge[1]:.3f}}}")
    path.write_text("\n".join(kept) + "\n")


def clock(walk):
    """cam02's clock in a walk by hand, a picture off."""

    def make(folder):
        [sequence] = [one for one in levels.sequences(SETTINGS) if one.name == walk]
        late = clocks_of(SETTINGS, sequence)[0]["cam02"].offset_s + A_PICTURE
        path = folder / f"config/offsets/{walk}.yaml"
        path.parent.mkdir()
        path.write_text(f"cam02: {{offset_s: {late:.4f}}}\n")

    return make


def renumbered(path, by):
    """The frames of a file of marks with so much added."""
    head, *rows = path.read_text().splitlines()
    each = [row.split(",") for row in rows]
    lines = [",".join([walk, str(int(frame) + by), *rest]) for walk, frame, *rest in each]
    path.write_text("\n".join([head, *lines]) + "\n")


CASES = {
    "by_eye": by_eye,
    "clock_indoors": clock("indoor_02"),
    "clock_outdoors": clock("outdoor_02"),
    "clock_adjusted": clock("outdoor_01"),
    "marks_from_1": lambda folder: renumbered(folder / "config/sessions/lab/cam02.marks.csv", 1),
}


def typed(folder, file, what):
    """Type `what` the report says into `file` of the project; False where it is no such sentence."""
    path = folder / file
    lines = path.read_text().splitlines()
    key, _, value = what.partition(": ")
    if what.startswith("remove the line of "):
        path.write_text("\n".join(line for line in lines if not line.startswith(f"{what.split()[-1]}:")) + "\n")
    elif what == "subtract 1 from every frame":
        renumbered(path, -1)
    elif value.startswith("{") and any(line.startswith(f"{key}:") for line in lines):
        path.write_text("\n".join(what if line.startswith(f"{key}:") else line for line in lines) + "\n")
    else:
        return False
    return True


def run(folder):
    """Run a project; the sentence that it ends with, and how far off (px) labels are where they are worst."""
    command = [sys.executable, "-m", "dior", "run", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, env=os.environ | {"PYTHONPATH": str(ROOT)})
    with open(folder / "results/evaluate/metrics.csv", newline="") as stream:
        worst = max(
            float(row["value"])
            for row in csv.DictReader(stream)
            if row["metric"] == "error_to_truth_2d" and row["sequence"] and row["camera"] and not row["joint"]
        )
    return (folder / "results/report/verdict.txt").read_text().strip(), worst


def main():
    names = sys.argv[1:] or list(CASES)
    root = Path(tempfile.mkdtemp(prefix="dior-troubles-"))
    config.write(SETTINGS, root / "right/config")
    said, worst = run(root / "right")
    print(f"without trouble: {said} {worst:.2f} px where it is worst")
    print(f"{'trouble':<16}{'before':>8}{'after':>8}  typed", flush=True)
    for name in names:
        folder = root / name
        shutil.copytree(root / "right", folder, symlinks=True)
        CASES[name](folder)
        said, before = run(folder)
        found = TYPED.search(said)
        if found and typed(folder, *found.groups()):
            _, after = run(folder)
            print(f"{name:<16}{before:>8.2f}{after:>8.2f}  {found[1]}: {found[2]}", flush=True)
        else:
            print(f"{name:<16}{before:>8.2f}{'-':>8}  nothing that can be typed: {said}", flush=True)
        shutil.rmtree(folder)
    shutil.rmtree(root)


if __name__ == "__main__":
    main()
