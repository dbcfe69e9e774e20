"""The files of a session: session.yaml, its cameras and their marks, without what may not be used.

INPUTS: config/sessions/<session>/ of a `dior.project.project.Project` whose sheets are read. OUTPUTS: the project's
`session_files`, `camera_files` and `marks`, and in `left_out` what is not used for want of consent. A DiorError where
nothing is left without it, so that a person has to name something else. Loads no numerics.
"""

import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

from dior.errors import DiorError, Faults, nearest
from dior.paths import AnyPath
from dior.project import bumps, cross_checks
from dior.project.contents import Project
from dior.project.marks_file import MarkedLines, read_marks
from dior.project.schema_check import as_written, check, read_yaml


def read(project: Project, session: str) -> None:
    """Read the files of a session into the project. Raises DiorError for all of its cameras together."""
    shown = project.session_file(session)
    content = check(read_yaml(project.root / shown, shown), "session", shown)
    repeated = [name for name in content["cameras"] if content["cameras"].count(name) > 1]
    if repeated:
        raise DiorError(f"{shown}: camera '{repeated[0]}' is listed twice")
    elsewhere = _elsewhere(project, session)
    window = {name: part for name, part in content["adjust"].items() if name not in elsewhere}
    used = _agreed(project, session, session, window, f"{shown}: 'adjust'", "window of the adjustment")
    content["adjust"] = {name: window[name] for name in used}
    if "tag" in content:
        content["tag"] = _tag(project, session, content["tag"], elsewhere, shown)
    if "keypoint_distance" in content:
        content["keypoint_distance"] = _facts(project, session, content["keypoint_distance"])
    project.session_files[session] = content
    faults = Faults()
    cameras = project.camera_files[session] = {}
    for name in content["cameras"]:
        with faults.kept():
            cameras[name] = _read_camera(project, session, name)
            if cameras[name]["locate"] == "marks":
                project.marks[session, name] = _marks(project, session, name)
    faults.tell()


def check_alone(root: AnyPath, faults: Faults) -> None:
    """Keep what is wrong in the files of the sessions of walks that are not excluded, each looked at alone, where the
    sheets are wrong already."""
    for folder in _named(root):
        shown = f"config/sessions/{folder}/session.yaml"
        if Path(root, shown).is_file():
            with faults.kept():
                check(read_yaml(Path(root, shown), shown), "session", shown)
        check_cameras_alone(root, folder, faults)


def check_cameras_alone(root: AnyPath, folder: str, faults: Faults) -> None:
    """The same of the cameras of the session in a folder of config/sessions/, where its session.yaml is wrong."""
    for path in sorted(Path(root, "config/sessions", folder).glob("*.yaml")):
        if path.name == "session.yaml":
            continue
        shown = path.relative_to(root).as_posix()
        with faults.kept():
            cross_checks.check_camera(check(read_yaml(path, shown), "camera", shown), shown)


def _named(root: AnyPath) -> list[str]:
    """Folders of the sessions of the walks that are not excluded; of all, where the sheet cannot be read."""
    shown = "config/sequences.tsv"
    try:
        rows = as_written(Path(root, shown), shown)
    except DiorError:
        return sorted(path.name for path in Path(root).glob("config/sessions/*"))
    named = {row["session"] for _, row in rows if not row["exclude_reason"]}
    return sorted(name for name in named if name and "/" not in name)


def _elsewhere(project: Project, session: str) -> set[str]:
    """Sequences, but excluded ones, of the other parts of a session that a bump splits."""
    folder, rows = bumps.session_folder(session), {**project.rows, **project.withheld}
    return {
        name
        for name, row in rows.items()
        if row["session"] != session and bumps.session_folder(row["session"]) == folder and not row["exclude_reason"]
    }


def _agreed(project: Project, session: str, scope: str, listed: Collection[str], where: str, what: str) -> list[str]:
    """The sequences of `listed` that may shape the poses of the session; how many others there are is noted.

    `where` and `what` say what lists them. Raises DiorError where none is left.
    """
    barred = project.barred(session)
    used = [name for name in listed if name not in barred]
    if listed and not used:
        raise DiorError(
            f"{where} of session '{session}' names {', '.join(listed)}, which may not be used: no consent (config/"
            f"subjects.tsv); name a sequence of somebody who agreed, such as {', '.join(project.shaping(session))}"
        )
    if count := len(listed) - len(used):
        project.left_out.append((scope, f"{count} {what}{'s are' if count > 1 else ' is'} not used: no consent"))
    return used


def _tag(project: Project, session: str, tag: dict[str, Any], elsewhere: set[str], shown: str) -> dict[str, Any]:
    if tag.get("sequence") in elsewhere:
        tag = tag | {"sequence": project.shaping(session)[0]}
    if tag.get("sequence") in project.barred(session):
        raise DiorError(
            f"{shown}: 'tag.sequence' is '{tag['sequence']}', which may not be used: no consent (config/subjects.tsv); "
            f"name one in which the tag lies, too, of {', '.join(project.shaping(session))}"
        )
    return tag


def _facts(project: Project, session: str, facts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The distances between joints but those of people who may not shape the poses; subjects by pseudonym."""
    facts = [
        fact | {"subject": project.pseudonyms.get(fact["subject"], fact["subject"])} if "subject" in fact else fact
        for fact in facts
    ]
    folder, rows = bumps.session_folder(session), {**project.rows, **project.withheld}
    here = {name: row["subject"] for name, row in rows.items() if bumps.session_folder(row["session"]) == folder}
    barred = {here[name] for name in project.barred(session)}
    used = [fact for fact in facts if fact.get("subject") not in barred]
    if count := len(facts) - len(used):
        what = "distances between joints are" if count > 1 else "distance between joints is"
        project.left_out.append((session, f"{count} {what} not used: no consent"))
    return used


def _read_camera(project: Project, session: str, name: str) -> dict[str, Any]:
    shown = project.camera_file(session, name)
    _check_first(project, session, shown)
    if not (project.root / shown).is_file():
        there = [file.removesuffix(".yaml") for file in sorted(os.listdir((project.root / shown).parent))]
        meant = nearest(name, [n for n in there if n not in ("session", *project.session_files[session]["cameras"])])
        raise DiorError(
            f"{project.session_file(session)}: camera '{name}' has no file {shown}"
            f"{meant or '; copy that of another camera there and change it'}"
        )
    camera = check(read_yaml(project.root / shown, shown), "camera", shown)
    cross_checks.check_camera(camera, shown)
    if "lens" in camera:
        camera["distortion_model"] = cross_checks.lens_model(camera.pop("lens"), project.config["lenses"], shown)
    if "align" in camera:
        # the close cameras of each part have a world of their own
        elsewhere, listed = _elsewhere(project, session), camera["align"]["sequences"]
        here = [sequence for sequence in listed if sequence not in elsewhere]
        if not here:
            raise DiorError(
                f"{shown}: align.sequences has {', '.join(listed)}, none of session '{session}'; add a walk of that "
                "part of the session"
            )
        scope, what = f"{session}/{name}", "sequence of align.sequences"
        camera["align"]["sequences"] = _agreed(project, session, scope, here, f"{shown}: align.sequences", what)
    return camera


def _check_first(project: Project, session: str, shown: str) -> None:
    """The file of a bumped camera must not be called after a sequence that may not be named any more."""
    camera, _, first = os.path.basename(shown).removesuffix(".yaml").partition(bumps.MARK)
    if first in project.withheld:
        later = [name for name in project.whole_session(session) if project.order(name) > project.order(first)]
        raise DiorError(
            f"{shown}: '{first}' is not used any more: no consent (config/subjects.tsv); call this file (and its "
            f"marks) {camera}{bumps.MARK}{(later or project.sequences_of(session))[0]}.yaml after the next sequence"
        )


def _marks(project: Project, session: str, camera: str) -> MarkedLines:
    path = project.marks_file(session, camera)
    if not (project.root / path).is_file():
        raise cross_checks.NotMarked(
            f"{project.camera_file(session, camera)}: 'locate: marks' needs the file {path} with the columns "
            "sequence,frame,joint,u,v: 10-20 markers clicked on each of 3-10 frames"
        )
    lines = read_marks(project.root / path, path)
    shown = f"{path} line {min((first for first, _ in lines.values()), default=1)}: the marks"
    used = _agreed(project, session, f"{session}/{camera}", lines, shown, "marked sequence")
    return {name: lines[name] for name in used}
