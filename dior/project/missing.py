"""What the sheets and the cameras name and is not there: recordings, calibrations, networks.

INPUTS   a `Project`, or the sheets alone where the rest of it is wrong
OUTPUTS  `Fault`s, each with the file and line to mend
Files are looked for and not opened. What the simulation will make is not missed. Loads no numerics, as it is asked
whenever `snakemake -n` plans.
"""

import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from dior.errors import nearest
from dior.paths import AnyPath
from dior.project.consent import processed
from dior.project.contents import Project, bags_of
from dior.project.cross_checks import no_session
from dior.project.plain_text import barred_by, right_to, text_of
from dior.project.schema_check import Row, as_written

SEQUENCES, CONFIG = "config/sequences.tsv", "config/config.yaml"
# chosen: no file of config/ whose lines are told is longer
MOST_BYTES = 1 << 20


@dataclass(frozen=True)
class Fault:
    """What is wrong, in a sentence with the likely fix; the file of the project, and its line (None: the whole file),
    where it can be mended; the walk that it is about, empty where it is about no single one."""

    file: str
    line: int | None
    text: str
    walk: str = ""

    def __str__(self) -> str:
        return f"{self.file}{f' line {self.line}' if self.line else ''}: {self.text}"


def of_project(project: Project, lines: dict[str, int]) -> list[Fault]:
    """What is missing of a project; `lines` of the rows of sequences.tsv."""
    if "simulate" in project.config:
        return []
    if found := _no_data_root(project.root, project.data_root):
        return [found]
    return [*_of_walks(project, lines), *_of_cameras(project), *_of_sheets(project)]


def of_sheet(root: AnyPath, data_root: str | None) -> list[Fault]:
    """What is missing of the sessions and recordings that sequences.tsv names, those of cameras apart, however wrong
    the rest of the project is; without `data_root` of the sessions alone. Raises DiorError where a sheet cannot be
    read."""
    subjects = "config/subjects.tsv"
    people = {row["subject"]: row for _, row in as_written(Path(root, subjects), subjects)}
    written = as_written(Path(root, SEQUENCES), SEQUENCES)
    walks: dict[tuple[str, ...], Row] = {
        (row["sequence"], str(line)): row for line, row in written if not row["exclude_reason"]
    }
    rows = [(int(line), row) for (_, line), row in processed(walks, people)[0].items()]
    without = [(line, row, told) for line, row in rows if row["session"] and (told := no_session(root, row))]
    faults = [Fault(SEQUENCES, line, told, row["sequence"]) for line, row, told in without]
    if data_root is None:
        return faults
    if found := _no_data_root(root, data_root):
        return [*faults, found]
    return faults + [
        _absent(root, path, what, row["sequence"], line)
        for line, row in rows
        for what, path in _named(row, data_root)
        if not can_be_read(root, path)
    ]


def _named(row: Row, data_root: str) -> Iterator[tuple[str, str]]:
    """(what it is, path) of the recordings of a row that need no camera's name."""
    log = row["trigger_log"].partition("#")[0].strip()
    for what, path in (*(("bag", bag) for bag in bags_of(row)), ("motion capture", row["mocap"]), ("trigger log", log)):
        if path:
            yield what, os.path.join(data_root, path)


def _no_data_root(root: AnyPath, data_root: str) -> Fault | None:
    path = os.path.join(root, data_root)
    if os.path.isdir(path) and os.access(path, os.X_OK):
        return None
    if barred_by(path):
        return Fault(CONFIG, line_of(root, CONFIG, "data_root"), f"data_root: {_why_not(root, data_root, '')}")
    above = Path(os.path.abspath(path)).parent
    there = [name for name in _names_in(str(above)) if (above / name).is_dir()]
    guess = nearest(os.path.basename(data_root.rstrip("/")), there)
    fix = "it is where the recordings are, and relative to the folder that holds config/"
    text = f"data_root is '{data_root}', where there is no folder{guess}; {fix}"
    return Fault(CONFIG, line_of(root, CONFIG, "data_root"), text)


def _of_walks(project: Project, lines: dict[str, int]) -> Iterator[Fault]:
    words = {"bag": "bag", "video": "video", "stamps": "file with stamps", "mocap": "motion capture"}
    words |= {"trigger": "trigger log", "detections": "detections"}
    for name in project.sequences:
        for key, path in project.recordings(name).items():
            if not can_be_read(project.root, path):
                kind, _, camera = key.partition(".")
                what = words[kind.partition("_")[0]] + (f" of {camera}" if camera else "")
                yield _absent(project.root, path, what, name, lines[name])


def _of_cameras(project: Project) -> Iterator[Fault]:
    for session in project.sessions:
        for name, camera in project.cameras(session).items():
            shown = project.camera_file(session, name)
            lens = camera["intrinsics"]
            named = {"reference": camera["reference"]["file"]} if camera["locate"] == "reference" else {}
            if isinstance(lens, dict):
                board = lens.get("chessboard") or lens.get("charuco")
                named["intrinsics"] = board["path"] if board else lens["file"]
            for key, path in named.items():
                path = project.in_data(path)
                if not can_be_read(project.root, path):
                    line = line_of(project.root, shown, key)
                    yield Fault(shown, line, f"'{key}': {_why_not(project.root, path, '')}")


def _of_sheets(project: Project) -> Iterator[Fault]:
    for row in project.gallery.values():
        path = project.in_data((row["path"] or row["bag"]).rstrip("/"))
        if not can_be_read(project.root, path):
            yield Fault("config/gallery.tsv", None, _why_not(project.root, path, ""))
    for name in project.sequences:
        for row in project.detectors_of(name):
            if not can_be_read(project.root, row["path"]):
                yield Fault("config/detectors.tsv", None, _why_not(project.root, row["path"], ""), name)


def _absent(root: AnyPath, path: str, what: str, walk: str, line: int) -> Fault:
    return Fault(SEQUENCES, line, f"'{walk}': {_why_not(root, path, what)}", walk)


def can_be_read(root: AnyPath, path: str) -> bool:
    """Whether a recording is there and one has the right to look into it."""
    there = os.path.join(root, path)
    return os.path.exists(there) and os.access(there, os.R_OK | (os.X_OK if os.path.isdir(there) else 0))


def _why_not(root: AnyPath, path: str, what: str) -> str:
    """What to say of a recording that cannot be read."""
    there, of = os.path.join(root, path), f" ({what})" if what else ""
    if around := barred_by(there):
        return f"you have no right to look into {path}{of}; {right_to(around)}"
    if os.path.islink(there):
        return f"{path}{of} is a link to {os.readlink(there)}, which is not there; copy the file here, or mend the link"
    return f"{path} is not there{of}{_guess(root, path)}"


def _guess(root: AnyPath, path: str) -> str:
    """What is there instead: the nearest name in its folder, or the nearest folder."""
    # what is in a folder is asked once, and that of another project may be called the same
    whole = Path(os.path.abspath(os.path.join(root, path)))
    if whole.parent.is_dir():
        return nearest(whole.name, _names_in(str(whole.parent)))
    missing = next(one for one in reversed(whole.parents) if not one.is_dir())
    guess = nearest(missing.name, _names_in(str(missing.parent)))
    return f"; not even the folder {os.path.relpath(missing, root)}{guess}"


@cache
def _names_in(folder: str) -> tuple[str, ...]:
    return tuple(sorted(os.listdir(folder))) if os.path.isdir(folder) and os.access(folder, os.R_OK) else ()


def line_of(root: AnyPath, shown: str, key: str) -> int | None:
    """The line of a YAML file on which a key stands that is in no other; None where it does not."""
    path = Path(root, shown)
    lines = text_of(path, shown, MOST_BYTES).splitlines() if path.is_file() else []
    return next((at for at, line in enumerate(lines, 1) if re.match(rf"{re.escape(key)}\s*:", line)), None)


def nothing_could_run(project: Project, faults: Iterable[Fault]) -> bool:
    """Whether each walk lacks something, or all of them do."""
    walks = {fault.walk for fault in faults}
    return walks >= {*project.sequences} or any(fault.file == CONFIG for fault in faults)
