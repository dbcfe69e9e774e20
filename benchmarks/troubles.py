"""Trouble is made in a capture that is right, what the report says first is typed, and it is run again: is it mended?

usage: python -m benchmarks.troubles [FOLDER] [CASE ...]      (all; each is two runs of a small capture)

FOLDER, which has a "/", keeps each project twice, as it was and `<case>.typed`; benchmarks.report_pages looks at them.

by_eye          the long-range camera is placed by eye, 0.3 degrees beside the person
clock_indoors   a clock given by hand is off by a picture, indoors
clock_outdoors  the same of a close camera outdoors
clock_adjusted  the same in the walk that the session is adjusted with
marks_from_1    the frames of an indoor camera's marks count from 1
bump            a close camera is turned by half a degree after the second of four walks outdoors
stranger        in one walk somebody else of the subject's size walks beside, and the detector gives both

What is typed is read from the first trouble of the report's first page, and typed as it stands; for the subject's
pixel, for which it has letters, that of the truth. `before`, `after`: the mean distance of the labels from the truth,
px, of the camera and walk where they are worst, and the share of joints with a label where they are fewest; those of
the capture without trouble are in the first line.
"""

import csv
import html
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import yaml

from dior.body.names import MLKIT_33
from dior.calibrate.align import aligned_pose
from dior.geometry import covariance
from dior.geometry.camera import project
from dior.simulate import bystander, config, scene, simulate
from dior.simulate import settings as levels
from dior.simulate.body import Body
from dior.simulate.clocks import clocks_of
from dior.simulate.motion import motion_of
from dior.tables import tables

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = levels.from_dict({"subjects": 1, "sequences": 2, "duration_s": 5})
A_PICTURE = 1 / SETTINGS.fps
OFF_DEG = 0.3
BUMP_DEG = 0.5
OUTDOORS = {"subjects": 1, "duration_s": 5, "environments": ["outdoor"]}
BUMPED = levels.from_dict(OUTDOORS | {"sequences": 4})
FOLLOWED = levels.from_dict(OUTDOORS | {"sequences": 2, "detector": {"everybody": True}})
HIPS = [MLKIT_33.index(f"{side}_hip") for side in ("left", "right")]
# a trouble of the first page, and what it says to type: the file, "" for a command, what, and how
TROUBLE = re.compile(r'<div class="trouble.*?</div>', re.S)
FIX = re.compile(
    r'<p class="fix">(?:<span class="file">(.*?)</span>|in a shell)(?: ([^<]*?))? <(?:code|b)>(.*?)</(?:code|b)>'
)


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


def bump(folder):
    """A project of its own: cam02 stands elsewhere from the third walk on."""
    config.write(BUMPED, folder / "config")
    placed = scene._placed

    def turned(settings, session, name):
        one = placed(settings, session, name)
        about_y = np.r_[0, np.radians(BUMP_DEG), 0, 0, 0, 0]
        return replace(one, camera=covariance.moved(one.camera, about_y)) if name == "cam02" else one

    for i, walk in enumerate(levels.sequences(BUMPED)):
        with mock.patch.object(scene, "_placed", turned if i >= 2 else placed):
            simulate.record(BUMPED, walk, folder / "results/simulate")


def stranger(folder):
    """A project of its own: in the second walk somebody of the subject's height walks, too."""
    config.write(FOLLOWED, folder / "config")
    first, second = levels.sequences(FOLLOWED)
    simulate.record(FOLLOWED, first, folder / "results/simulate")
    height = motion_of(FOLLOWED, second).height
    with mock.patch.object(bystander, "Body", lambda _: Body(height)):
        two = replace(FOLLOWED, bystander=1.0, bystander_walks=True)
        simulate.record(two, second, folder / "results/simulate")


CASES = {
    "by_eye": by_eye,
    "clock_indoors": clock("indoor_02"),
    "clock_outdoors": clock("outdoor_02"),
    "clock_adjusted": clock("outdoor_01"),
    "marks_from_1": lambda folder: renumbered(folder / "config/sessions/lab/cam02.marks.csv", 1),
}


# those that make a project instead of changing the one that is right
OWN = {"bump": bump, "stranger": stranger}


def middle(folder, file, camera, frame):
    """The subject's middle (u, v) px in a picture of the walk that a file of config/people is of."""
    truth = tables.read(folder / f"results/simulate/truth/{Path(file).stem}/labels_2d.parquet", "labels_2d")
    here = (truth["camera"] == camera) & (truth["frame"] == frame) & np.isin(truth["joint"], np.array(MLKIT_33)[HIPS])
    return truth["u"][here].mean(), truth["v"][here].mean()


def typed(folder, file, at, what):
    """Type `what` the report says, and where `at`, into `file` of the project or a shell; False where it is no such
    line."""
    if not file:
        subprocess.run(shlex.split(what), cwd=folder, check=True)
        return True
    path = folder / file
    if asked := re.search(r"camera: (\w+), frame: (\d+), u: <u>, v: <v>", what):
        u, v = middle(folder, file, asked[1], int(asked[2]))
        path.parent.mkdir(exist_ok=True)
        path.write_text(what.replace("<u>", f"{u:.0f}").replace("<v>", f"{v:.0f}") + "\n")
        return True
    lines = path.read_text().splitlines()
    key, _, value = what.partition(": ")
    if at == "in a line more below adjust:":
        below = next(i for i, line in enumerate(lines) if line.startswith("adjust:"))
        path.write_text("\n".join([*lines[: below + 1], what, *lines[below + 1 :]]) + "\n")
    elif at == "as one more of the sequences of align:":
        path.write_text(re.sub(r"(?m)^(align:.*sequences: \[.*?)\]", rf"\1, {what}]", path.read_text()))
    elif what.startswith("remove the line of "):
        path.write_text("\n".join(line for line in lines if not line.startswith(f"{what.split()[-1]}:")) + "\n")
    elif what == "subtract 1 from every frame":
        renumbered(path, -1)
    elif value.startswith("{") and any(line.startswith(f"{key}:") for line in lines):
        path.write_text("\n".join(what if line.startswith(f"{key}:") else line for line in lines) + "\n")
    else:
        return False
    return True


def run(folder):
    """Run a project: what its report says first to type, [(file, at, what)], and in words how far off labels are where
    they are worst, the share of joints that has one where they are fewest, and how many recordings are good."""
    command = [sys.executable, "-m", "dior", "run", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, env=os.environ | {"PYTHONPATH": str(ROOT)})
    with open(folder / "results/evaluate/metrics.csv", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["sequence"] and row["camera"] and not row["joint"]]
    worst = max(float(row["value"]) for row in rows if row["metric"] == "error_to_truth_2d")
    fewest = min(float(row["value"]) for row in rows if row["metric"] == "coverage")
    first = TROUBLE.search((folder / "results/report/index.html").read_text())
    fixes = [tuple(map(html.unescape, one)) for one in FIX.findall(first[0])] if first else []
    good = (folder / "results/report/verdict.txt").read_text().partition(" recordings")[0]
    return fixes, f"{worst:.2f} px, {100 * fewest:.0f} %, {good} good"


def main():
    root, names = None, sys.argv[1:]
    if names and "/" in names[0]:
        root, names = Path(names[0]), names[1:]
    if root is None:
        with tempfile.TemporaryDirectory(prefix="dior-troubles-") as made:
            return show(Path(made), names)
    return show(root, names)


def show(root, names):
    """Print the table, with the projects below `root`."""
    config.write(SETTINGS, root / "right/config")
    print(f"without trouble: {run(root / 'right')[1]}")
    print(f"{'trouble':<16}{'before':<30}{'after':<30}typed", flush=True)
    for name in names or [*CASES, *OWN]:
        folder, after = root / name, root / f"{name}.typed"
        if name in OWN:
            OWN[name](folder)
        else:
            shutil.copytree(root / "right", folder, symlinks=True)
            CASES[name](folder)
        fixes, before = run(folder)
        shutil.copytree(folder, after, symlinks=True)
        done = [typed(after, *fix) for fix in fixes]
        told = "; ".join(f"{file or 'in a shell'}: {what}" for file, _, what in fixes)
        if done and all(done):
            print(f"{name:<16}{before:<30}{run(after)[1]:<30}{told}", flush=True)
        else:
            print(f"{name:<16}{before:<30}{'-':<30}nothing that can be typed: {told}", flush=True)


if __name__ == "__main__":
    main()
