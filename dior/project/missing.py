"""What the sheets and the cameras name and is not there: recordings, calibrations, networks.

INPUTS   a `Project`, or the sheets alone where the rest of it is wrong
OUTPUTS  `Fault`s, each with the file and line to mend
Files are looked for and not opened. What the simulation will make is not missed. Loads no numerics, as it is asked
whenever `snakemake -n` plans.
"""

import os
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from dior.errors import nearest
from dior.paths import AnyPath
from dior.project.consent import processed
from dior.project.contents import Project, bags_of
from dior.project.plain_text import rows_of, text_of
from dior.project.schema_check import Row

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


def of_sheet(root: AnyPath, data_root: str) -> list[Fault]:
    """What is missing of the recordings that sequences.tsv names, those of cameras apart, however wrong the rest of the
    project is. Raises DiorError where the sheet cannot be read."""
    if found := _no_data_root(root, data_root):
        return [found]
    people = {row["subject"]: row for _, row in _as_written(root, "config/subjects.tsv")}
    written = _as_written(root, SEQUENCES)
    walks: dict[tuple[str, ...], Row] = {
        (row["sequence"], str(line)): row for line, row in written if not row["exclude_reason"]
    }
    return [
        _absent(root, path, what, name, int(line))
        for (name, line), row in processed(walks, people)[0].items()
        for what, path in _named(row, data_root)
        if not _is(root, path)
    ]


def _as_written(root: AnyPath, shown: str) -> Iterator[tuple[int, Row]]:
    """Line and cells by column of each row of a sheet, whatever is in them."""
    (_, header), *rows = rows_of(Path(root, shown), shown, "\t") or [(1, [""])]
    for line, cells in rows:
        yield line, defaultdict(str, zip(header, cells, strict=False))


def _named(row: Row, data_root: str) -> Iterator[tuple[str, str]]:
    """(what it is, path) of the recordings of a row that need no camera's name."""
    log = row["trigger_log"].partition("#")[0].strip()
    for what, path in (*(("bag", bag) for bag in bags_of(row)), ("motion capture", row["mocap"]), ("trigger log", log)):
        if path:
            yield what, os.path.join(data_root, path)


def _no_data_root(root: AnyPath, data_root: str) -> Fault | None:
    path = os.path.join(root, data_root)
    if os.path.isdir(path):
        return None
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
            if not _is(project.root, path):
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
                if not _is(project.root, path):
                    line = line_of(project.root, shown, key)
                    yield Fault(shown, line, f"'{key}' names {path}, which is not there{_guess(project.root, path)}")


def _of_sheets(project: Project) -> Iterator[Fault]:
    for row in project.gallery.values():
        path = project.in_data((row["path"] or row["bag"]).rstrip("/"))
        if not _is(project.root, path):
            yield Fault("config/gallery.tsv", None, f"there is no {path}{_guess(project.root, path)}")
    for name in project.sequences:
        for row in project.detectors_of(name):
            if not _is(project.root, row["path"]):
                text = f"{row['path']} is not there{_guess(project.root, row['path'])}"
                yield Fault("config/detectors.tsv", None, text, name)


def _absent(root: AnyPath, path: str, what: str, walk: str, line: int) -> Fault:
    return Fault(SEQUENCES, line, f"'{walk}': {path} is not there ({what}){_guess(root, path)}", walk)


def _is(root: AnyPath, path: str) -> bool:
    return os.path.exists(os.path.join(root, path))


def _guess(root: AnyPath, path: str) -> str:
    """What is there instead: the nearest name in its folder, or the nearest folder."""
    whole = Path(root, path)
    if whole.is_symlink():
        return f"; it is a link to {os.readlink(whole)}, and that is not there"
    if whole.parent.is_dir():
        return nearest(whole.name, _names_in(str(whole.parent)))
    missing = next(one for one in reversed(whole.parents) if not one.is_dir())
    guess = nearest(missing.name, _names_in(str(missing.parent)))
    return f"; not even the folder {os.path.relpath(missing, root)}{guess}"


@cache
def _names_in(folder: str) -> tuple[str, ...]:
    return tuple(sorted(os.listdir(folder))) if os.path.isdir(folder) else ()


def line_of(root: AnyPath, shown: str, key: str) -> int | None:
    """The line of a YAML file on which a key stands that is in no other; None where it does not."""
    path = Path(root, shown)
    lines = text_of(path, shown, MOST_BYTES).splitlines() if path.is_file() else []
    return next((at for at, line in enumerate(lines, 1) if re.match(rf"{re.escape(key)}\s*:", line)), None)


def nothing_could_run(project: Project, faults: Iterable[Fault]) -> bool:
    """Whether each walk lacks something, or all of them do."""
    walks = {fault.walk for fault in faults}
    return walks >= {*project.sequences} or any(fault.file == CONFIG for fault in faults)
