"""What a person still has to fill in: cells of the sheets and values of YAML files that are TODO.

INPUTS   a project's config/: its sheets, config.yaml and the files of its sessions
OUTPUTS  a `Todo` for each, in the order of the files; a DiorError that names them all
`dior init --from` writes them where nobody but the lab knows. In a comment the word is no TODO, and the row of a walk
that is excluded may wait, but not the reason. Loads no numerics.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dior.errors import DiorError, DiorErrors
from dior.paths import AnyPath
from dior.project.plain_text import rows_of
from dior.project.yaml_file import scalars_of

WORD = "TODO"
FILES = ("*.tsv", "config.yaml", "sessions/*/*.yaml")


@dataclass(frozen=True)
class Todo:
    """A value on `line` of the file `path` (below the project's folder); `key` is its column, or its keys with dots."""

    path: str
    line: int
    key: str


def found(root: AnyPath) -> list[Todo]:
    """All of a project. What is broken in a file is left to who reads it."""
    config = Path(root) / "config"
    paths = [path for pattern in FILES for path in sorted(config.glob(pattern)) if path.is_file()]
    # nearly all files have none, and this is asked whenever the workflow is read
    holding = [path for path in paths if os.access(path, os.R_OK) and WORD.encode() in path.read_bytes()]
    return [Todo(f"config/{path.relative_to(config).as_posix()}", *at) for path in holding for at in _in_file(path)]


def check(root: AnyPath) -> None:
    """Raise a DiorError that names every TODO of a project, a line for each file."""
    if told := errors(found(root)):
        raise DiorErrors(told)


def errors(todos: Iterable[Todo]) -> list[DiorError]:
    """What is to be said of them, one for each file."""
    of_files: dict[str, list[Todo]] = {}
    for todo in todos:
        of_files.setdefault(todo.path, []).append(todo)
    return [DiorError(sentence(of_one)) for of_one in of_files.values()]


def sentence(todos: list[Todo]) -> str:
    """What is to be filled in in one file: `config/subjects.tsv: still TODO: height_m (lines 2 and 3)`."""
    lines: dict[str, list[int]] = {}
    for todo in todos:
        lines.setdefault(todo.key, []).append(todo.line)
    return f"{todos[0].path}: still {WORD}: " + ", ".join(f"{key} ({_lines(at)})" for key, at in lines.items())


def _lines(numbers: list[int]) -> str:
    """Numbers of lines in words, those that follow each other or are many shortened."""
    unique = sorted(set(numbers))
    if len(unique) == 1:
        return f"line {unique[0]}"
    if len(unique) > 2:
        return f"lines {unique[0]} to {unique[-1]}"
    return f"lines {unique[0]} and {unique[1]}"


def _in_file(path: Path) -> Iterable[tuple[int, str]]:
    try:
        if path.suffix == ".tsv":
            return list(_in_sheet(path))
        # those of a list once
        return dict.fromkeys((line, key) for line, key, value in scalars_of(path) if value.startswith(WORD))
    except DiorError:
        return []


def _in_sheet(path: Path) -> Iterator[tuple[int, str]]:
    (_, header), *rows = rows_of(path, path, "\t") or [(1, [""])]
    for line, cells in rows:
        row = dict(zip(header, cells, strict=False))
        if reason := row.get("exclude_reason"):
            row = {"exclude_reason": reason}
        yield from ((line, column) for column, cell in row.items() if cell.startswith(WORD))
