"""Whether the motion capture of each walk has its markers, and whether the trigger log knows when it began.

INPUTS   a `Project` (paths as seen from the working directory); what was recorded (`recordings.Recorded`)
OUTPUTS  the markers by walk; faults in `Notes`
Of a C3D its header is read; what is wrong with its coordinates shows when the step mocap reads these.
"""

import os
from collections.abc import Iterable
from pathlib import Path

from dior.check.notes import Notes
from dior.check.recordings import Recorded
from dior.ingest import marker_names, mocap, mocap_files, trigger_log
from dior.project.contents import Project
from dior.project.missing import SEQUENCES, can_be_read

# chosen: a text of this size is read whole in a tenth of a second; a longer one takes too long for a check
MOST_TEXT_BYTES = 1 << 21


def of_walk(
    project: Project, walk: str, line: int, recorded: Iterable[Recorded], notes: Notes
) -> frozenset[str] | None:
    """The markers of a walk's motion capture; None where it has none, or they cannot be told."""
    for log in project.trigger_log(walk):
        with notes.kept(SEQUENCES, line, walk):
            _check_log(project, walk, log, list(recorded))
    found = None
    for path in project.mocap(walk):
        with notes.kept(SEQUENCES, line, walk):
            found = _markers(project, walk, path) if _is_looked_into(path) else None
    return found


def _is_looked_into(path: str) -> bool:
    if not can_be_read(".", path) or not os.path.isfile(path):
        return False
    return mocap_files.recognise(path) == mocap_files.C3D or os.path.getsize(path) < MOST_TEXT_BYTES


def _markers(project: Project, walk: str, path: str) -> frozenset[str]:
    settings = project.mocap_settings(walk)
    names = {pseudonym: name for name, pseudonym in project.pseudonyms.items()}
    sheets = project.marker_names()
    named = marker_names.sheet(Path(sheets[0]), mocap_files.recognise(path)) if sheets else {}
    kind, about, found = mocap.labelled(path, names[project.subject_of(walk)], settings["prefix"], named)
    if not settings["units"]:
        mocap.unit_of(about, path, kind)
    return frozenset(found.place)


def _check_log(project: Project, walk: str, log: str, recorded: list[Recorded]) -> None:
    stamps = [ns for one in recorded for ns in (one.first_ns, one.last_ns) if ns is not None]
    if can_be_read(".", log) and stamps:
        c3d = Path(next(iter(project.mocap(walk)), "")).name
        captures = trigger_log.read(log)
        trigger_log.choose(captures, min(stamps), max(stamps), log, name=project.capture(walk), c3d=c3d)
