"""Say what is wrong with a project before it is run, all of it at once, in seconds.

INPUTS   a project's config/, and at a glance the recordings that it names
OUTPUTS  lines on standard output, by file: what a run would fail with, and apart what it would go on with; or what it
         will do and take. As JSON: `faults` and `warnings` (file, line, text, walks) and `plan`.
Walks with an exclude_reason are not looked at, nor are those of people who may not be processed. What the simulation of
a project will make is looked at when it is there. Nothing is written.
"""

import json
import re
import shlex
from collections.abc import Iterable
from contextlib import chdir
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dior.check import computer, lenses, motion, named_frames, recordings
from dior.check.notes import Notes
from dior.errors import DiorError, Faults, many
from dior.project import missing
from dior.project.contents import Project
from dior.project.missing import Fault, line_of
from dior.project.project import as_far_as_it_goes, read_config, sheets

# chosen: what a screen shows of a file, and of the walks with the same fault
MOST_OF_A_FILE, MOST_WALKS = 20, 3
# how the sentences of the project's own reader begin
WHERE = re.compile(r"(config/[^\s:,]+)(?:,? line (\d+))?: (.*)", re.DOTALL)
# a key of a YAML file in such a sentence
KEY = re.compile(r"'(\w+)[\w.]*'")


def run(project: Path = Path("."), *, as_json: bool = False) -> int:
    """Look at a project and its recordings; returns 1 where a run would fail.

    `project`: its folder, where it is not the one that you are in; `as_json`: as JSON, for other programs.
    Raises DiorError where there is no project.
    """
    if not (project / "config").is_dir():
        raise DiorError(f"{project}: there is no config/ in it; name the project's folder, or make one: dior init")
    with chdir(project):
        notes, plan = look()
    faults, warnings = _together(notes.faults), _together(notes.warnings)
    if as_json:
        print(json.dumps({"faults": faults, "warnings": warnings, "plan": plan and asdict(plan)}, indent=2))
        return int(bool(faults))
    shown = shlex.quote(str(project))
    lines = _shown(faults)
    if warnings:
        lines += ["", "A run goes on with these, but look:", *_shown(warnings)] if faults else _shown(warnings)
    if faults:
        files = len({fault["file"] for fault in faults})
        lines += ["", f"{len(faults)} to mend in {many(files, 'file')}; then: dior check {shown}"]
    elif plan:
        lines += ["", *_warned(len(warnings)), f"{plan} Type", f"  dior run {shown}"]
    print("\n".join(lines).strip())
    return int(bool(faults))


def look() -> tuple[Notes, computer.Plan | None]:
    """What is found of the project in the working directory, and what a run on it takes, where that can be told."""
    notes, faults = Notes(), Faults()
    project = as_far_as_it_goes(Path("."), faults)
    for error in faults.found:
        notes.faults.append(_of_config(str(error)))
    if project is None:
        notes.faults += _of_sheet()
        return notes, None
    (_, lines), _ = sheets(".")
    notes.faults += missing.of_project(project, lines)
    plan = _look_at_recordings(project, lines, notes)
    return notes, plan if not notes.faults else None


def _look_at_recordings(project: Project, lines: dict[str, int], notes: Notes) -> computer.Plan:
    can_see_videos = computer.check_packages(project, notes)
    of_walks = {walk: [*project.bags(walk), *project.videos(walk).values()] for walk in project.sequences}
    paths = [path for named in of_walks.values() for path in named]
    if not can_see_videos:
        paths = [path for path in paths if path not in _video_files(project)]
    seen = recordings.look_at(paths)
    recorded, markers = {}, {}
    for walk in project.sequences:
        line = lines[walk]
        recorded[walk] = recordings.of_walk(project, walk, line, seen, notes)
        in_bags = [one for camera, one in recorded[walk].items() if camera not in project.filmed(walk)]
        found = motion.of_walk(project, walk, line, in_bags, notes)
        if found is not None:
            markers[walk] = found
        named_frames.of_walk(project, walk, recorded[walk], notes)
    named_frames.of_detections(project, lines, recorded, notes)
    for session in project.sessions:
        lenses.of_session(project, session, recorded, notes)
        named_frames.of_marks(project, session, recorded, markers, notes)
    plan = computer.plan(project, recorded)
    computer.check_room(project, plan, notes)
    return plan


def _video_files(project: Project) -> set[str]:
    named = (path for walk in project.sequences for path in project.videos(walk).values())
    return {path for path in named if Path(path).is_file()}


def _of_config(text: str) -> Fault:
    """A sentence of the project's reader as a fault of its file."""
    found = WHERE.match(text)
    if not found:
        return Fault("config/", None, text)
    file, line, rest = found.groups()
    key = KEY.search(rest)
    at = int(line) if line else line_of(".", file, key[1]) if key and file.endswith(".yaml") else None
    return Fault(file, at, rest)


def _of_sheet() -> list[Fault]:
    """What is missing of the recordings, where the project cannot be read but its sheet and config.yaml can."""
    try:
        data_root = read_config(".").get("data_root", "data")
        return missing.of_sheet(".", data_root) if isinstance(data_root, str) else []
    except DiorError:
        return []


def _together(faults: Iterable[Fault]) -> list[dict[str, Any]]:
    """The faults by file and line, the same of several walks once."""
    walks: dict[tuple[str, int, str], list[str]] = {}
    for fault in faults:
        of_all = walks.setdefault((fault.file, fault.line or 0, fault.text), [])
        of_all += [fault.walk] if fault.walk and fault.walk not in of_all else []
    return [
        {"file": file, "line": line or None, "text": text, "walks": of_all}
        for (file, line, text), of_all in sorted(walks.items(), key=lambda item: item[0][:2])
    ]


def _shown(faults: list[dict[str, Any]]) -> list[str]:
    """Lines for people: each file, and below it what is wrong."""
    lines = []
    for file in dict.fromkeys(fault["file"] for fault in faults):
        mine = [fault for fault in faults if fault["file"] == file]
        lines += [file, *(f"  {_sentence(fault)}" for fault in mine[:MOST_OF_A_FILE])]
        lines += [f"  and {len(mine) - MOST_OF_A_FILE} more"] if len(mine) > MOST_OF_A_FILE else []
    return lines


def _sentence(fault: dict[str, Any]) -> str:
    line = f"line {fault['line']}: " if fault["line"] else ""
    walks = [walk for walk in fault["walks"] if walk not in fault["text"]]
    more = f" and {len(walks) - MOST_WALKS} more" if len(walks) > MOST_WALKS else ""
    of_walks = f" ({', '.join(walks[:MOST_WALKS])}{more})" if walks else ""
    return f"{line}{fault['text']}{of_walks}"


def _warned(count: int) -> list[str]:
    return [f"{count} to look at, with which a run goes on."] if count else ["All is well."]
