"""Changing the small files of config/ that people also edit by hand: rows of a CSV or TSV file, values of a YAML file.

A change says what it found and what it puts there. Other rows, their order and comments stay as they are, and so does
what somebody else wrote meanwhile: where that is at the same row or key, nothing is written and both are told.
"""

import csv
import io
import os
import re
import stat
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.project import todos
from dior.project.plain_text import COMMENT, UTF_8_MARK, rows_of, text_of
from dior.project.yaml_file import MOST_BYTES, read_yaml, scalar_nodes, yaml_of
from dior.tables.files import write_text

# one change at a time, of all files of the project
_lock = threading.Lock()
Cells = Sequence[str]


@dataclass(frozen=True)
class Change:
    """Of one row: the cells of its `key`, and its other cells `before` and `after`; None where there is no row."""

    key: tuple[str, ...]
    before: tuple[str, ...] | None
    after: tuple[str, ...] | None


class Conflict(DiorError):
    """Somebody else has changed the same. `rows`: for each its key, `theirs` that is in the file, and `mine`."""

    def __init__(self, path: str, rows: list[dict[str, Any]]) -> None:
        super().__init__(f"{path}: somebody else has changed the same meanwhile; nothing is written yet")
        self.rows = rows


def change_rows(
    path: str,
    keys: Cells,
    others: Cells,
    changes: Iterable[Change],
    check: Callable[[Path], Any],
    columns: Cells = (),
) -> bool:
    """Change rows of a CSV or TSV file, found by the columns `keys`; whether that made a difference.

    `others`: the other columns that changes are about; columns besides stay as they are in rows that are there. A file
    that is not there is begun, with `columns` or these; one that lacks some of `columns` gets them, empty.
    `check` reads the file as it will be, in another place, and raises DiorError where it is refused. Raises Conflict,
    and DiorError for a file that may not be written or has no such columns.
    """
    with _lock:
        text = _text(path)
        lines, between, end = _lines(text), "\t" if path.endswith(".tsv") else ",", _end(text)
        at = next((i for i, line in enumerate(lines) if _is_row(line, between)), None)
        if at is None:
            lines = _closed(lines, end)
            lines.append(between.join(columns or [*keys, *others]) + end)
            at = len(lines) - 1
        lines = _with_columns(lines, at, columns, between, end)
        header = [name.strip() for name in _cells(lines[at], between)]
        missing = [name for name in [*keys, *others] if name not in header]
        if missing:
            raise DiorError(f"{path}: column '{missing[0]}' is missing; the first line must name it")
        found: dict[tuple[str, ...], tuple[int, dict[str, str]]] = {}
        for i, line in enumerate(lines[at + 1 :], at + 1):
            if _is_row(line, between):
                row = dict(zip(header, map(str.strip, _cells(line, between)), strict=False))
                found[tuple(row.get(name, "") for name in keys)] = i, row
        clashes: list[dict[str, Any]] = []
        added: list[str] = []
        for change in changes:
            i, row = found.get(change.key, (-1, {}))
            theirs = None if i < 0 else tuple(row.get(name, "") for name in others)
            if _same(theirs, change.after):
                continue
            if not _same(theirs, change.before):
                clashes.append({"key": change.key, "theirs": theirs, "mine": change.after})
                continue
            named = dict(zip([*keys, *others], [*change.key, *(change.after or ())], strict=False))
            line = _line([named.get(name, row.get(name, "")) for name in header], between) + end
            if i < 0:
                added.append(line)
            else:
                lines[i] = line if change.after is not None else ""
        if clashes:
            raise Conflict(path, clashes)
        lines = [line for line in lines if line]  # without rows that are taken away
        if added:
            lines = _closed(lines, end)
        return _write(path, text, "".join(lines + added), check)


def cells_of(uv: Sequence[float] | None) -> tuple[str, ...] | None:
    """Cells of u and v, px: empty ones for a point that cannot be seen, None for no row."""
    return None if uv is None else tuple(f"{one:.2f}" for one in uv) or ("", "")


def _with_columns(lines: list[str], at: int, columns: Cells, between: str, end: str) -> list[str]:
    """The lines of a file with its header in line `at`, with what its header lacks of `columns` as further ones."""
    header = [name.strip() for name in _cells(lines[at], between)]
    more = [name for name in columns if name not in header]
    if not more:
        return lines
    out = lines[:at]
    for i, line in enumerate(lines[at:]):
        cells = [line.rstrip("\r\n"), *(more if i == 0 else [""] * len(more))]
        out.append(between.join(cells) + end if _is_row(line, between) else line)
    return out


def change_value(path: str, key: str, before: Any, after: Any, check: Callable[[Path], Any]) -> bool:
    """`change_values` of one key."""
    return change_values(path, [(key, before, after)], check)


def change_values(path: str, changes: Iterable[tuple[str, Any, Any]], check: Callable[[Path], Any]) -> bool:
    """Put other values at keys at the top of a YAML file, all or none; whether that made a difference.

    `changes`: of each its key, what was read there, None for nothing, and what comes there, None to remove it. A file
    of which nothing is left is removed. `check` as of `change_rows`. Raises Conflict and DiorError.
    """
    with _lock:
        text = changed = _text(path)
        clashes: list[dict[str, Any]] = []
        for key, before, after in changes:
            content = yaml_of(changed, path)
            if not isinstance(content, dict):
                raise DiorError(f"{path}: is no YAML of keys with values")
            if content.get(key) == after:
                continue
            if content.get(key) != before:
                clashes.append({"key": [key], "theirs": content.get(key), "mine": after})
                continue
            wanted = {name: value for name, value in (content | {key: after}).items() if value is not None}
            changed = _with_value(changed, key, before, after)
            if not _says(changed, path, wanted):
                raise DiorError(f"{path}: '{key}' cannot be changed without changing the rest; change it by hand")
        if clashes:
            raise Conflict(path, clashes)
        if changed != text and not changed.strip():
            _check_writable(path)
            os.unlink(path)
            return True
        return _write(path, text, changed, check)


def _says(text: str, path: str, wanted: dict[str, Any]) -> bool:
    """Whether that is what a YAML text says."""
    try:
        return bool(yaml_of(text, path) == wanted)
    except DiorError:
        return False


def fill_in(
    path: str, line: int, key: str, value: str, before: str = todos.WORD, check: Callable[[Path], Any] = os.fspath
) -> None:
    """Put what a person knows in the place of a TODO (`todos.Todo`), or of `before`, in a sheet or a YAML file.

    `check` as of `change_rows`. Raises Conflict where `before` is not there any more, and DiorError for a value that
    breaks the file.
    """
    value = value.strip()
    sheet = path.endswith(".tsv")
    # splitlines knows all that ends a line, to YAML or to a spreadsheet
    if len(value.splitlines()) > 1 or "\t" in value or value.startswith(COMMENT) or not value and not sheet:
        raise DiorError(f"{path}: '{key}' is to be a line of text, without a tab and no comment")
    with _lock:
        text = _text(path)
        place = _of_cell(text, line, key) if sheet else _of_scalar(text, line, key, before)
        if place is None or text[slice(*place)] != before:
            raise Conflict(
                path, [{"key": [key], "theirs": "" if place is None else text[slice(*place)], "mine": value}]
            )
        begin, end = place

        def readable(draft: Path) -> None:
            if sheet:
                rows_of(draft, path, "\t")
            else:
                read_yaml(draft, path)
            check(draft)

        _write(path, text, text[:begin] + value + text[end:], readable)


def _of_cell(text: str, line: int, key: str) -> tuple[int, int] | None:
    """Where in the text of a sheet a cell is."""
    lines = _lines(text)
    header = next((one for one in lines if _is_row(one, "\t")), "")
    names = [name.strip() for name in header.rstrip("\r\n").split("\t")]
    cells = lines[line - 1].rstrip("\r\n").split("\t") if 0 < line <= len(lines) else []
    if key not in names or len(cells) <= names.index(key):
        return None
    before = cells[: names.index(key)]
    begin = sum(map(len, lines[: line - 1])) + sum(len(cell) + 1 for cell in before)
    return begin, begin + len(cells[len(before)])


def _of_scalar(text: str, line: int, key: str, value: str) -> tuple[int, int] | None:
    """Where in a YAML text the first value that is written so is, of those of a key (with dots) on a line."""
    for at, keys, node in scalar_nodes(text):
        begin = node.start_mark.index
        if (at, keys) != (line, key):
            continue
        if text.startswith(value, begin):
            return begin, begin + len(value)
        # of a list the first value is found
        if value.startswith("[") and text.startswith(value, text.rfind("[", 0, begin)):
            return text.rfind("[", 0, begin), text.rfind("[", 0, begin) + len(value)
    return None


def _with_value(text: str, key: str, before: Any, value: Any) -> str:
    """A YAML text with another value, in flow style, at one of its keys at the top; `before`: what is there."""
    import yaml

    line, end = "" if value is None else f"{key}: {_flow(value)}", _end(text)
    try:
        root = yaml.compose(text)
    except yaml.YAMLError:
        # what libyaml reads, PyYAML need not, such as a tab before a value
        return ""
    pairs = root.value if isinstance(root, yaml.MappingNode) else []
    at = next(((k.start_mark.index, v) for k, v in pairs if k.value == key), None)
    if at is None:
        return "".join([*_closed(_lines(text), end), line + end]) if line else text
    begin, node = at
    inside = _inside(text, node, before, value)
    if inside is not None:
        return inside
    after = node.end_mark.index
    # the end of a block is where the next thing begins, comments before that included
    block = text[begin:after].rstrip()
    kept = text[begin + len(block) :]
    while block.count("\n") and block.rsplit("\n", 1)[1].lstrip().startswith(COMMENT):
        block = block.rsplit("\n", 1)[0].rstrip()
        kept = text[begin + len(block) :]
    return text[:begin] + line + (kept if line else kept.removeprefix(end))


def _inside(text: str, node: Any, before: Any, value: Any) -> str | None:
    """The same where only entries of a mapping change or come to it: how the others are written, and comments between
    them, stay. None where that cannot be, as entries go or what changes is no plain value."""
    import yaml

    if not (isinstance(node, yaml.MappingNode) and node.value and isinstance(value, dict)):
        return None
    there = {k.value: v for k, v in node.value}
    if any(name not in value for name in there):
        return None
    last = node.value[-1][1]
    # of a mapping in lines of its own, the end of the line has the last entry's comment
    end = last.end_mark.index if node.flow_style else text.find(_end(text), last.end_mark.index)
    end = len(text) if end < 0 else end
    gap = ", " if node.flow_style else _end(text) + " " * node.start_mark.column
    edits = [(end, end, "".join(f"{gap}{name}: {_flow(new)}" for name, new in value.items() if name not in there))]
    for name, old in there.items():
        if value[name] == before[name]:
            continue
        if not isinstance(old, yaml.ScalarNode):
            return None
        edits.append((old.start_mark.index, old.end_mark.index, _flow(value[name])))
    if not isinstance(last, yaml.ScalarNode) and not last.flow_style:
        return None
    for start, stop, new in sorted(edits, reverse=True):
        text = text[:start] + new + text[stop:]
    return text


def _flow(value: Any) -> str:
    """A value in YAML, on one line."""
    import yaml

    # of a plain word the end of the document is written, too
    written = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10**6).strip()
    return written.removesuffix("...").rstrip()


def _lines(text: str) -> list[str]:
    """The lines of a text with their ends, as csv has them: `str.splitlines` knows more, which may be in a comment."""
    return re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+", text)


def _end(text: str) -> str:
    """What ends the lines of a text."""
    found = re.search(r"\r\n|\r|\n", text)
    return found[0] if found else "\n"


def _closed(lines: list[str], end: str) -> list[str]:
    """The lines, the last of which has its end, too."""
    return [*lines[:-1], lines[-1].rstrip("\r\n") + end] if lines else []


def _is_row(line: str, between: str) -> bool:
    """Whether a line is one of a table (`plain_text.rows_of`)."""
    return bool(line.strip().strip(between + " ")) and not line.lstrip().startswith(COMMENT)


def _text(path: str) -> str:
    return text_of(path, path, MOST_BYTES) if os.path.lexists(path) else ""


def _cells(line: str, between: str) -> list[str]:
    return next(csv.reader([line.rstrip("\r\n")], delimiter=between), [])


def _line(cells: Cells, between: str) -> str:
    stream = io.StringIO()
    csv.writer(stream, delimiter=between, lineterminator="").writerow(cells)
    return stream.getvalue()


def _same(one: Cells | None, other: Cells | None) -> bool:
    """Whether two rows say the same, however their numbers are written."""
    if one is None or other is None:
        return one is other
    return len(one) == len(other) and all(map(_alike, one, other))


def _alike(one: str, other: str) -> bool:
    try:
        return one == other or float(one) == float(other)
    except ValueError:
        return False


def _write(path: str, before: str, after: str, check: Callable[[Path], Any]) -> bool:
    """Write what is checked, where it is another; a link stays one."""
    if after == before:
        return False
    place = _check_writable(path)
    _check(path, after, check)
    if _text(path) != before:
        raise DiorError(f"{path}: is being changed elsewhere at this moment; try again")
    mode = stat.S_IMODE(place.stat().st_mode) if place.exists() else None
    # without the mark, Excel takes it for Latin-1 the next time
    marked = mode is not None and place.read_bytes().startswith(UTF_8_MARK)
    try:
        write_text(place, UTF_8_MARK.decode() + after if marked else after)
    except PermissionError as error:
        # it names a temporary file beside it
        raise DiorError(f"{path}: cannot be written ({error.strerror}); it or its folder is read-only") from None
    if mode is not None:
        # who may read and write it stays: others of a group may work in the same folder
        os.chmod(place, mode)
    return True


def _check_writable(path: str) -> Path:
    """Where the file is, which may be a link. Raises DiorError where it is read-only."""
    place = Path(os.path.realpath(path))
    if place.exists() and not place.stat().st_mode & 0o222:
        raise DiorError(f"{path}: is read-only; `chmod u+w {path}` lets it be changed")
    return place


def _check(path: str, text: str, check: Callable[[Path], Any]) -> None:
    """Let `check` read the text from a file of the same name, and say what it says of that of the file itself."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="dior_studio_") as folder:
        draft = Path(folder) / os.path.basename(path)
        write_text(draft, text)
        try:
            check(draft)
        except DiorError as error:
            raise DiorError(str(error).replace(str(draft), path)) from None
