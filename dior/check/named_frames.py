"""Whether what people marked, drew and pointed at, and what a detector found, is of frames that were recorded.

INPUTS   a `Project` (paths as seen from the working directory); what was recorded (`recordings.Recorded`); the markers
         of the motion capture by walk
OUTPUTS  faults and warnings in `Notes`
Of detections it is looked which tool wrote them, and for which frames, as far as the names of a folder's files, or the
two ends of a file with a line per picture, tell it.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from dior.calibrate.marks import marks as marks_of
from dior.check.notes import Notes
from dior.check.recordings import Recorded, side_by_side
from dior.errors import DiorError, nearest
from dior.ingest import detections
from dior.ingest.readers.common import files_by_frame
from dior.project import boxes
from dior.project.contents import Project
from dior.project.missing import SEQUENCES
from dior.project.schema_check import read_yaml

# chosen: some pictures of a detector's output
END_BYTES = 1 << 16
# how the files of a folder end, where it is not in .json
SUFFIXES = {"yolo": ".txt"}
_FRAME = re.compile(rb'"frame"\s*:\s*(\d{1,9})\b')
# by walk and camera
AllRecorded = Mapping[str, Mapping[str, Recorded]]


def of_marks(
    project: Project, session: str, recorded: AllRecorded, markers: Mapping[str, frozenset[str]], notes: Notes
) -> None:
    """Look at the marks by which the cameras of a session are located; `markers`: of the walks that have any."""
    for camera, settings in project.cameras(session).items():
        shown = project.marks_file(session, camera)
        if not os.path.isfile(shown):
            continue
        found = None
        with notes.kept(shown, None):
            found = marks_of.read(shown)
        if found is not None:
            # others may be marked at joints of the 3D
            known = markers if settings["locate"] == "marks" else {}
            _check_marks(found, shown, camera, recorded, known, notes)


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
        known = markers.get(walk)
        if known is not None and not (found.xyz[i] == found.xyz[i]).all() and joint not in known:
            text = f"'{joint}' is no marker of the motion capture of '{walk}'{nearest(joint, sorted(known))}"
            notes.fault(shown, int(line), text)


def _beyond(frame: int, there: Recorded, walk: str) -> str:
    return f"frame {frame} is not in '{walk}', whose frames are 0 to {there.count - 1}; is it of another walk?"


def of_walk(project: Project, walk: str, recorded: Mapping[str, Recorded], notes: Notes) -> None:
    """Look at the boxes, hand checks and seeds of a walk."""
    for camera, path in project.boxes(walk).items():
        if there := recorded.get(camera):
            with notes.kept(path, None):
                boxes.read_drawers(path, range(there.count))
    for camera, path in project.checks(walk).items():
        if there := recorded.get(camera):
            with notes.kept(path, None):
                found = marks_of.read(path)
                for frame, at in zip(found.frame.tolist(), found.line.tolist(), strict=True):
                    if frame >= there.count:
                        notes.fault(path, at, _beyond(frame, there, walk))
    for path in project.seeds(walk):
        for number, seed in enumerate(read_yaml(path)["seeds"], 1):
            if (there := recorded.get(seed["camera"])) and seed["frame"] >= there.count:
                notes.fault(path, None, f"seed {number}: {_beyond(seed['frame'], there, walk)}")


def of_detections(project: Project, lines: Mapping[str, int], recorded: AllRecorded, notes: Notes) -> None:
    """Look at the detections of all walks that bring theirs; `lines` of the walks in the sheet."""
    wanted = project.config["detector"]["format"]
    # the simulation counts from 0
    begin = 0 if "simulate" in project.config else project.config["detector"]["first_frame"]
    brought = [
        (walk, camera, path, wanted)
        for walk in project.sequences
        if (pattern := project.detections_pattern(walk)) and not project.detected_here(walk)
        for camera in project.close(project.session_of(walk))
        if os.path.exists(path := pattern.format(camera=camera))
    ]
    for (walk, camera, path, _), found in zip(brought, side_by_side(_looked_into, brought), strict=True):
        there = recorded[walk].get(camera)
        if isinstance(found, DiorError):
            notes.fault(SEQUENCES, lines[walk], str(found), walk)
        elif found is not None and there is not None and not 0 <= found[0] - begin <= found[1] - begin < there.count:
            text = f"{walk}, {camera}: {path} {_of_others(found, begin, there.count)}"
            notes.fault(SEQUENCES, lines[walk], text, walk)


def _of_others(found: tuple[int, int], begin: int, count: int) -> str:
    fix = "are they of another walk?"
    if found == (1, count):
        fix = f"are they counted from 1? Then {detections.SETTING} should be 1"
    frames = f"has frames {found[0]} to {found[1]}, and the recording has frames {begin} to {count - 1 + begin}"
    return f"{frames}; {fix}"


def _looked_into(brought: tuple[str, str, str, str]) -> tuple[int, int] | None | DiorError:
    """The first and last frame of detections (walk, camera, path, format), None where that takes reading them, or what
    is wrong with them."""
    walk, camera, path, wanted = brought
    try:
        return _frames_of(Path(path), detections.format_of(Path(path), wanted, f"{walk}, {camera}"))
    except DiorError as error:
        return error


def _frames_of(path: Path, kind: str) -> tuple[int, int] | None:
    """The first and last frame of a detector's output, None where that takes reading it."""
    if path.is_dir():
        frames = list(files_by_frame(path, SUFFIXES.get(kind, ".json")))
        return (frames[0], frames[-1]) if frames else None
    if path.suffix != ".jsonl":
        return None
    with open(path, "rb") as stream:
        head = stream.read(END_BYTES)
        stream.seek(max(os.path.getsize(path) - END_BYTES, 0))
        tail = stream.read()
    first, last = _FRAME.findall(head), _FRAME.findall(tail)
    return (int(first[0]), int(last[-1])) if first and last else None
