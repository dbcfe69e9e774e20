"""Whether what people marked, drew and pointed at is in pictures that were recorded, and enough.

INPUTS   a `Project` (paths as seen from the working directory); what was recorded (`recordings.Recorded`); the markers
         of the motion capture by walk
OUTPUTS  faults in `Notes`
The files are read by those who read them in a run; what is too little is theirs to say, too.
"""

import os
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from dior.calibrate import locate
from dior.calibrate.marks import marks as marks_of
from dior.calibrate.outline import boxes_fit
from dior.check.notes import Notes
from dior.check.recordings import AllRecorded, Recorded
from dior.errors import nearest
from dior.evaluate import checks
from dior.project import boxes
from dior.project.contents import Project
from dior.project.schema_check import read_yaml

# by walk and camera, those that are right
AllDrawn: TypeAlias = Mapping[str, Mapping[str, boxes.Boxes]]


def of_walk(project: Project, walk: str, recorded: Mapping[str, Recorded], notes: Notes) -> dict[str, boxes.Boxes]:
    """Look at the boxes, hand checks and seeds of a walk; the boxes by camera, where nothing is wrong with them."""
    drawn: dict[str, boxes.Boxes] = {}
    drawings: dict[str, str] = {}
    clicked: dict[str, str] = {}
    with notes.kept("config/boxes", None, walk):
        drawings = project.boxes(walk)
    with notes.kept("config/checks", None, walk):
        clicked = project.checks(walk)
    for camera, path in drawings.items():
        if there := recorded.get(camera):
            with notes.kept(path, None):
                drawn[camera] = boxes.read(path, range(there.count), _size(there))
    for camera, path in clicked.items():
        if there := recorded.get(camera):
            with notes.kept(path, None):
                checks.points(path, walk, range(there.count), size=_size(there))
    for path in project.seeds(walk):
        for number, seed in enumerate(read_yaml(path)["seeds"], 1):
            if (there := recorded.get(seed["camera"])) and seed["frame"] >= there.count:
                notes.fault(path, None, f"seed {number}: {_beyond(seed['frame'], there, walk)}")
    return drawn


def _size(there: Recorded) -> boxes.Size | None:
    return (there.width, there.height) if there.width else None


def _beyond(frame: int, there: Recorded, walk: str) -> str:
    return f"frame {frame} is not in '{walk}', whose frames are 0 to {there.count - 1}; is it of another walk?"


def of_session(
    project: Project,
    session: str,
    recorded: AllRecorded,
    markers: Mapping[str, frozenset[str]],
    drawn: AllDrawn,
    notes: Notes,
) -> None:
    """Look at the marks and boxes by which the cameras of a session are located; `markers`: of the walks that have
    any."""
    for camera, settings in project.cameras(session).items():
        how, aligned = settings["locate"], settings.get("align", {})
        shown = project.marks_file(session, camera)
        found = None
        if os.path.isfile(shown):
            with notes.kept(shown, None):
                found = marks_of.read(shown)
        if found is not None:
            # others may be marked at joints of the 3D
            _check_marks(found, shown, camera, recorded, markers if how == "marks" else {}, notes)
        if found is not None and how == "marks":
            with notes.kept(shown, None):
                used = np.isin(found.sequence, project.marks_sequences(session, camera))
                locate.check_enough(shown, int(used.sum()))
        if found is not None and aligned.get("from") == "marks":
            with notes.kept(shown, None):
                boxes_fit.check_enough(shown, 2 * int(np.isin(found.sequence, aligned["sequences"]).sum()))
        if aligned.get("from") == "boxes":
            _check_enough_boxes(project, camera, aligned["sequences"], drawn, notes)


def _check_enough_boxes(project: Project, camera: str, walks: list[str], drawn: AllDrawn, notes: Notes) -> None:
    """Those that are kept back place no camera. Where it is not known of each walk what is drawn, nothing is said."""
    if not all(camera in drawn.get(walk, {}) for walk in walks):
        return
    used = [~boxes.kept_back(drawn[walk][camera][0]) for walk in walks]
    path = project.boxes(walks[0])[camera]
    with notes.kept(path, None):
        boxes_fit.check_enough(path, len(boxes.COLUMNS[1:]) * int(sum(kept.sum() for kept in used)))


def _check_marks(
    found: marks_of.Marks,
    shown: str,
    camera: str,
    recorded: AllRecorded,
    markers: Mapping[str, frozenset[str]],
    notes: Notes,
) -> None:
    for i in range(len(found)):
        walk, frame, joint, line = (getattr(found, key)[i] for key in ("sequence", "frame", "joint", "line"))
        there = recorded.get(walk, {}).get(camera)
        if there and frame >= there.count:
            notes.fault(shown, int(line), _beyond(int(frame), there, walk))
        if there and there.width:
            with notes.kept(shown, int(line)):
                marks_of.check_inside(f"{shown} line {line}", found.uv[i], there.width, there.height)
        known = markers.get(walk)
        if known is not None and not (found.xyz[i] == found.xyz[i]).all() and joint not in known:
            text = f"'{joint}' is no marker of the motion capture of '{walk}'{nearest(joint, sorted(known))}"
            notes.fault(shown, int(line), text)
