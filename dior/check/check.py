"""Say what is wrong with a project before it is run, all of it at once, in seconds.

INPUTS   a project's config/, and at a glance the recordings that it names
OUTPUTS  lines on standard output, by file: what a run would fail with, and apart what it would go on with; or what it
         will do and take. As JSON: `faults` and `warnings` (file, line, text, walks) and `plan`.
Walks with an exclude_reason are not looked at, nor are those of people who may not be processed. What the simulation of
a project will make is looked at when it is there. Nothing is written.
"""

import errno
import json
import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextlib import chdir
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from dior.check import computer, found_people, lenses, motion, named_frames, recordings
from dior.check.notes import Notes, of_sentence
from dior.errors import DiorError, Faults, many
from dior.project import missing, todos
from dior.project.contents import Project
from dior.project.missing import Fault, line_of
from dior.project.plain_text import unreadable
from dior.project.project import as_far_as_it_goes, read_config, sheets
from dior.release import citation

# chosen: what a screen shows of a file, and of the walks with the same fault
MOST_OF_A_FILE, MOST_WALKS = 20, 3
# chosen: of faults of a file that are alike but for their numbers as many are shown one by one
MOST_ALIKE = 3
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
    release = notes.before_release
    if as_json:
        told = {"faults": faults, "warnings": warnings, "plan": plan and asdict(plan), "before_release": release}
        print(json.dumps(told, indent=2))
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
        lines += ["", "Before a release:", *(f"  {line}" for line in release)] if release else []
    print("\n".join(lines).strip())
    return int(bool(faults))


def look() -> tuple[Notes, computer.Plan | None]:
    """What is found of the project in the working directory, and what a run on it takes, where that can be told."""
    notes = Notes()
    notes.faults += barred_folders()
    if notes.faults:
        return notes, None
    unfinished, faults = todos.found("."), Faults()
    project = as_far_as_it_goes(Path("."), faults, unfinished=unfinished)
    # what a value must not be that is still to be filled in need not be said
    told = [error for error in faults.found if not unfinished or todos.WORD not in str(error)]
    notes.faults += [_of_config(str(error)) for error in (*todos.errors(unfinished), *told)]
    if told or unfinished:
        notes.faults += _of_sheet()
    if project is None:
        return notes, None
    (_, lines), _ = sheets(".")
    notes.faults += missing.of_project(project, lines)
    notes.before_release += citation.lacks(project.config["release"]) if project.released_subjects else []
    plan = _look_at_recordings(project, lines, notes)
    return notes, plan if not notes.faults else None


def barred_folders() -> list[Fault]:
    """The folders of config/ in which one has no right to look: of what is in them nothing can be said."""
    faults: list[Fault] = []

    def barred(error: OSError) -> None:
        faults.append(of_sentence(str(unreadable(error.filename, error.filename, error)), error.filename))

    for folder, _, _ in os.walk("config", onerror=barred):
        if not os.access(folder, os.X_OK):
            barred(PermissionError(errno.EACCES, os.strerror(errno.EACCES), folder))
    return sorted(set(faults), key=str)


def _look_at_recordings(project: Project, lines: dict[str, int], notes: Notes) -> computer.Plan:
    can_see_videos = computer.check_packages(project, notes)
    of_walks = {walk: [*project.bags(walk), *project.videos(walk).values()] for walk in project.sequences}
    paths = [path for named in of_walks.values() for path in named]
    _check_shared(project, of_walks, lines, notes)
    if not can_see_videos:
        paths = [path for path in paths if path not in _video_files(project)]
    seen = recordings.look_at(paths)
    recorded, markers, drawn = {}, {}, {}
    for walk in project.sequences:
        line = lines[walk]
        recorded[walk] = recordings.of_walk(project, walk, line, seen, notes)
        in_bags = [one for camera, one in recorded[walk].items() if camera not in project.filmed(walk)]
        found = motion.of_walk(project, walk, line, in_bags, notes)
        if found is not None:
            markers[walk] = found
        drawn[walk] = named_frames.of_walk(project, walk, recorded[walk], notes)
    found_people.of_walks(project, lines, recorded, notes)
    _check_views(project, notes)
    for session in project.sessions:
        lenses.of_session(project, session, recorded, notes)
        named_frames.of_session(project, session, recorded, markers, drawn, notes)
    plan = computer.plan(project, recorded)
    computer.check_room(project, plan, notes)
    return plan


def _check_shared(
    project: Project, of_walks: Mapping[str, Sequence[str]], lines: Mapping[str, int], notes: Notes
) -> None:
    """No bag is twice in a row. One that was copied may have the recordings of another walk still; two people who are
    told apart by seeds may be in one recording."""
    owner: dict[str, str] = {}
    for walk, paths in sorted(of_walks.items(), key=lambda one: lines[one[0]]):
        bags = project.bags(walk)
        for path in sorted({path for path in bags if bags.count(path) > 1}):
            notes.fault(missing.SEQUENCES, lines[walk], f"'{walk}': bag {path} is given twice; delete one", walk)
        shared = [(path, first) for path in paths if (first := owner.setdefault(os.path.realpath(path), walk)) != walk]
        for path, first in shared[:1]:
            two = project.subject_of(walk) != project.subject_of(first)
            if not (two and project.seeds(walk) and project.seeds(first)):
                text = f"'{walk}' has {path}, which '{first}' has, too, and both label it; is it of another walk?"
                notes.warn(missing.SEQUENCES, lines[walk], text, walk)


def _check_views(project: Project, notes: Notes) -> None:
    """No joint is seen by more close cameras than a session has."""
    least, file = project.config["adjust"]["min_views"], "config/config.yaml"
    few = {session: len(project.close(session)) for session in project.sessions if project.window(session)}
    session, count = min(few.items(), key=lambda one: one[1], default=("", least))
    if count < least:
        text = f"'adjust.min_views' is {least}, and {session} has {count} close cameras to adjust; write {count}"
        notes.fault(file, line_of(".", file, "adjust"), text)


def _video_files(project: Project) -> set[str]:
    named = (path for walk in project.sequences for path in project.videos(walk).values())
    return {path for path in named if os.path.isfile(path)}


def _of_config(text: str) -> Fault:
    """A sentence of the project's reader as a fault of its file."""
    fault = of_sentence(text, "config/")
    key = KEY.search(fault.text)
    if fault.line or not key or not fault.file.endswith(".yaml"):
        return fault
    return replace(fault, line=line_of(".", fault.file, key[1]))


def _of_sheet() -> list[Fault]:
    """What is missing of the recordings of walks that are left out, where the sheet and config.yaml can be read."""
    try:
        config = read_config(".")
        data_root = None if "simulate" in config else config.get("data_root", "data")
        return missing.of_sheet(".", data_root) if data_root is None or isinstance(data_root, str) else []
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
        mine = _folded([fault for fault in faults if fault["file"] == file])
        lines += [file, *(f"  {sentence}" for sentence in mine[:MOST_OF_A_FILE])]
        lines += [f"  and {len(mine) - MOST_OF_A_FILE} more"] if len(mine) > MOST_OF_A_FILE else []
    return lines


def _folded(faults: list[dict[str, Any]]) -> list[str]:
    """A sentence for each fault of a file, of many that are alike for the first."""
    alike: dict[str, list[dict[str, Any]]] = {}
    for fault in faults:
        alike.setdefault(_shape(fault), []).append(fault)
    sentences = []
    for fault in faults:
        same = alike[_shape(fault)]
        if len(same) <= MOST_ALIKE:
            sentences.append(_sentence(fault))
        elif fault is same[0]:
            last = f", to line {same[-1]['line']}" if same[-1]["line"] else ""
            sentences.append(f"{_sentence(fault)}; and {len(same) - 1} more like it{last}")
    return sentences


def _shape(fault: dict[str, Any]) -> str:
    return re.sub(r"\d+", "0", fault["text"])


def _sentence(fault: dict[str, Any]) -> str:
    line = f"line {fault['line']}: " if fault["line"] else ""
    walks = [walk for walk in fault["walks"] if walk not in fault["text"]]
    more = f" and {len(walks) - MOST_WALKS} more" if len(walks) > MOST_WALKS else ""
    of_walks = f" ({', '.join(walks[:MOST_WALKS])}{more})" if walks else ""
    return f"{line}{fault['text']}{of_walks}"


def _warned(count: int) -> list[str]:
    return [f"{count} to look at, with which a run goes on."] if count else ["All is well."]
