"""Why a recording differs between two releases: which of the inputs and settings that changed can touch it.

INPUTS   provenance.json of both releases (provenance_json.py). OUTPUTS: `Change`s, and for a recording those that can
         touch it

An input touches what the steps of the workflow make of it. What reaches other walks does so through the poses of the
cameras, so that it is a reason there only where a pose of the session did change. Where several can be the reason, all
are given: which one it was only another run can tell.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.release.provenance_json import VERSION

PROVENANCE = "provenance.json"
INDOOR, OUTDOOR = "indoor", "outdoor"
# what nothing but these tables is made of, and what is about no recording
PICTURES, MARKS, FILES = "frames", "marks", "files"
# what tells whether a red light takes the place of labels away; of a recording: that it did in one release only
LIGHTS = "lights"
# what a setting or a step's code is about, by how its name begins; all others touch everything
SETTINGS = {
    "locate.": INDOOR,
    "adjust.": OUTDOOR,
    "physics.": OUTDOOR,
    "triangulate.": OUTDOOR,
    "refine.": OUTDOOR,
    "release.faces": PICTURES,
    "release.": FILES,
}
STEPS = {
    "ingest.mocap": INDOOR,
    "calibrate.locate": INDOOR,
    "calibrate.place": OUTDOOR,
    "calibrate.adjust": OUTDOOR,
    "reconstruct.": OUTDOOR,
    "ingest.gallery": FILES,
    "evaluate.": LIGHTS,
    "release.package": LIGHTS,
    "release.heads": PICTURES,
    "release.pixels": PICTURES,
    "release.": FILES,
}


@dataclass(frozen=True)
class Change:
    """An input or setting that changed.

    `about`: INDOOR, OUTDOOR, PICTURES, MARKS, LIGHTS, FILES or "" for everything; `session`, `sequence` and `camera`
    are those that it belongs to, "" for all.
    """

    text: str
    about: str = ""
    session: str = ""
    sequence: str = ""
    camera: str = ""


@dataclass(frozen=True)
class ChangedRecording:
    """One camera, or "" for the 3D and the marks, of a walk that differs.

    `tables`: those that differ, and LIGHTS; `close`: names of the session's close cameras; `posed`: cameras whose pose
    differs.
    """

    session: str
    sequence: str
    camera: str
    environment: str
    tables: frozenset[str]
    close: frozenset[str]
    posed: frozenset[str]


def read(folder: Path) -> dict[str, Any]:
    """The content of provenance.json. Raises DiorError where there is none of this version that can be read."""
    path = folder / PROVENANCE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        version = content["provenance_version"]
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise DiorError(f"{path}: cannot be read ({error}); is it a release that dior made?") from None
    if version != VERSION:
        raise DiorError(f"{path}: is of version {version}, this dior knows {VERSION}; take the dior that made it")
    return content


def changes(first: dict[str, Any], second: dict[str, Any], session_of: dict[str, str]) -> list[Change]:
    """`Change`s between two contents of provenance.json, sorted by text. `session_of`: sequence -> session."""
    found = [Change(_said("setting", *row), _about(SETTINGS, row[0])) for row in _differing(first, second, "config")]
    found += [Change(f"code of {row[0]}", _about(STEPS, row[0])) for row in _differing(first, second, "code")]
    found += [Change(_said("package", *row)) for row in _differing(first, second, "packages")]
    for session in sorted(first["sessions"].keys() & second["sessions"].keys()):
        for row in _differing(first["sessions"], second["sessions"], session):
            camera = row[0].split(".")[0] if row[0] != "session.yaml" else ""
            found.append(Change(_file(f"config/sessions/{session}/{row[0]}", *row), "", session, "", camera))
    for sequence in sorted(first["sequences"].keys() & second["sequences"].keys()):
        where = (session_of.get(sequence, ""), sequence)
        one, other = first["sequences"][sequence], second["sequences"][sequence]
        for row in _differing(one, other, "recordings"):
            camera = row[0].partition("detections.")[2]
            found.append(Change(_file(f"{row[0]} of {sequence}", *row), "", *where, camera))
        for row in _differing(one, other, "by_hand"):
            folder, file = row[0].split("/")[-2:]
            camera = file.split(".")[1] if folder in ("boxes", "checks") else ""
            found.append(Change(_file(row[0], *row), MARKS if folder == "checks" else "", *where, camera))
        for row in _differing(one, other, "accepted"):
            what = f"of camera {row[0]} of {sequence}" if row[0] else f"of {sequence}"
            found.append(Change(_said("acceptance", what, *row[1:]), LIGHTS, *where, row[0]))
    return sorted(found, key=lambda change: change.text)


def _differing(first: dict[str, Any], second: dict[str, Any], key: str) -> list[tuple[str, Any, Any]]:
    """(name, value before, value after) of what differs in two dicts of dicts; None where it is not there."""
    one, other = first.get(key, {}), second.get(key, {})
    return [(n, one.get(n), other.get(n)) for n in sorted(one.keys() | other.keys()) if one.get(n) != other.get(n)]


def _said(what: str, name: str, before: Any, after: Any) -> str:
    words = ["not there" if value is None else json.dumps(value, ensure_ascii=False) for value in (before, after)]
    return f"{what} {name}: {' -> '.join(words)}"


def _file(text: str, _: str, before: Any, after: Any) -> str:
    return text + (" (new)" if before is None else " (gone)" if after is None else "")


def _about(table: dict[str, str], name: str) -> str:
    return next((about for start, about in table.items() if name.startswith(start)), "")


def can_touch(change: Change, where: ChangedRecording) -> bool:
    """Whether a `Change` can be a reason why a `ChangedRecording` differs."""
    if change.about in (INDOOR, OUTDOOR) and change.about != where.environment:
        return False
    # a check is among the marks, and a yardstick of labels
    reached = {change.about, LIGHTS} if change.about == MARKS else {change.about}
    if change.about in (PICTURES, MARKS, LIGHTS, FILES) and not reached & where.tables:
        return False
    if change.session not in ("", where.session) or not _of_camera(change, where):
        return False
    through_pose = where.posed & {change.camera} if change.camera else where.posed
    return change.sequence in ("", where.sequence) or bool(through_pose)


def _of_camera(change: Change, where: ChangedRecording) -> bool:
    """What belongs to a camera touches it; outdoors all close cameras see the walker together, and what they see is the
    3D that every camera is labelled with. The marks of all cameras of a walk are one table.
    """
    if change.camera in ("", where.camera) or (not where.camera and MARKS in where.tables):
        return True
    return where.environment == OUTDOOR and change.camera in where.close
