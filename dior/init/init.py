"""Write the config of a new project, filled in as far as the recordings tell.

INPUTS   a folder for the project; with `--from` the folder of the recordings
OUTPUTS  `<folder>/config/`: config.yaml, the sheets, a folder for each session with a YAML file for each camera. Every
         guess has its reason as a comment; what nobody but the lab knows is TODO (dior/project/todos.py).
Called again with more recordings it adds their rows and sessions, and names rows whose files are gone. Nothing that is
there is overwritten, and no recording is copied.
"""

import os
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dior.errors import DiorError, many
from dior.init import again, copies, names, written
from dior.init import capture as captures
from dior.init.capture import Capture
from dior.init.found import NONE_OF_THEM, Found, look
from dior.init.sessions import Session, Taken
from dior.init.walks import listed
from dior.project import init as empty
from dior.project import todos
from dior.project.contents import bags_of
from dior.project.plain_text import rows_of
from dior.project.project import read_config
from dior.project.schema_check import Row
from dior.tables.files import write_text

SHEETS = {"sequences": written.WALKS, "subjects": written.PEOPLE}
# chosen: what a screen shows
MOST_ASIDE = 30
# chosen: of what is alike but for its numbers as many are shown one by one
MOST_ALIKE = 3
# chosen: a path with more steps up says less than the whole one
MOST_UP = 3


@dataclass(frozen=True)
class Sheet:
    """A sheet that is there: its text, columns, and rows as they are, not checked."""

    text: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


def run(folder: Path, *, as_from: Path | None = None, dry_run: bool = False) -> None:
    """Write the config of a project into `folder`, print what was found and what to do next.

    `folder`: it may be there; `as_from`: folder of the recordings, which are looked through, without it the config
    holds nothing yet; `dry_run`: write nothing, show the table.
    Raises DiorError where there is nothing to make a project of, and, without `as_from`, where there is a config.
    """
    empty.check_folder(folder)
    if as_from is None:
        if dry_run:
            raise DiorError("--dry-run shows what is found in recordings; name their folder by --from")
        empty.run(folder)
        return
    recordings = as_from.resolve()
    if recordings.is_file():
        raise DiorError(f"{as_from}: is a file; name the folder that the recordings are in")
    if not recordings.is_dir():
        raise DiorError(f"{as_from}: there is no such folder; name the one that the recordings are in")
    root = _data_root(folder, recordings)
    lenses = read_config(folder).get("lenses") if (folder / "config/config.yaml").exists() else None
    there = {kind: _sheet(folder, kind) for kind in SHEETS}
    below = look(root, recordings)
    copies.without_copies(root, below, _recordings_of(there["sequences"]))
    found = captures.of(root, below, sorted(lenses or {}))
    if not found.sessions:
        raise DiorError(
            f"{as_from}: no recording with pictures of a walk is below it{_some_aside(below, found.aside)}; bags, "
            "videos and folders of pictures are read (docs/bags.md, docs/videos.md)"
        )
    found, new = _beside(folder, root, found, there["sequences"])
    files = _files(folder, root, found, new, there)
    print(written.table(found, new))
    _tell_doubts(found)
    _tell_aside(found)
    _tell_changes(folder, root, found, new, there["sequences"], files)
    if dry_run:
        print(f"Nothing was written; it would be {_listed(files)}.")
        return
    for path, text in files.items():
        write_text(folder / "config" / path, text)
    _tell_next(folder, found, files, new)


def _data_root(folder: Path, recordings: Path) -> Path:
    """What the paths of the sheets are relative to: as config.yaml says where there is one, else the recordings.

    Raises DiorError where the recordings are not below the one that is there.
    """
    if not (folder / "config/config.yaml").exists():
        return recordings
    root = (folder / str(read_config(folder).get("data_root", "data"))).resolve()
    if recordings != root and root not in recordings.parents:
        raise DiorError(
            f"{folder / 'config/config.yaml'}: 'data_root' is {root}, and {recordings} is not in it; name that folder "
            "or one in it, or make another project of the others"
        )
    return root


def _sheet(folder: Path, kind: str) -> Sheet | None:
    path, shown = folder / "config" / f"{kind}.tsv", f"config/{kind}.tsv"
    if not path.exists():
        return None
    lines = rows_of(path, shown, "\t")
    if not lines:
        raise DiorError(f"{shown}: the file is empty; remove it, and it is written anew")
    (_, header), *body = lines
    rows = tuple(dict(zip(header, [*cells, *[""] * (len(header) - len(cells))], strict=False)) for _, cells in body)
    # with its line ends and byte order mark: what is there stays as it is
    return Sheet(path.read_bytes().decode(), tuple(header), rows)


def _sessions_there(folder: Path) -> set[str]:
    path = folder / "config/sessions"
    return {one.name for one in path.iterdir() if one.is_dir()} if path.is_dir() else set()


def _beside(folder: Path, root: Path, found: Capture, sheet: Sheet | None) -> tuple[Capture, list[str]]:
    """The capture with walks and sessions called as in the sheet, and the names of the walks that are not in it."""
    rows = _rows(sheet)
    owner = {_real(root, path): row for row in rows for path in again.recordings(folder, root, row)}
    taken_names = [row.get("sequence", "") for row in rows]
    names_used, new, sessions = [*_sessions_there(folder), *(row.get("session", "") for row in rows)], [], []
    for session in found.sessions:
        mine = [next(filter(None, (owner.get(_real(root, path)) for path in one.files)), None) for one in session.taken]
        # of several the one with the most walks, the first by name
        known = Counter(sorted(row["session"] for row in mine if row and row.get("session")))
        usual = known.most_common(1)[0][0] if known else names.unique(session.name, names_used)
        names_used.append(usual)
        parts: dict[str, list[Taken]] = {}
        # of the walk before, in the order of their times
        before = usual
        for one, row in zip(session.taken, mine, strict=True):
            called = row.get("sequence", one.name) if row else names.unique(one.name, taken_names)
            if row is None:
                new.append(called)
                taken_names.append(called)
                one = _doubted(one, before, list(known))
            row = row or {}
            # a person may have put the walks of a session apart
            before = row.get("session") or before
            parts.setdefault(before, []).append(
                replace(one, name=called, environment=_said(row.get("environment", "")))
            )
        sessions += [replace(session, name=name, taken=tuple(part)) for name, part in parts.items()]
    return replace(found, sessions=tuple(sessions)), new


def _doubted(one: Taken, session: str, options: Sequence[str]) -> Taken:
    """A new walk with what is to be said where the walks before it are of several sessions."""
    if len(options) < 2:
        return one
    said = f"of {listed(options)}, which have these cameras, session {session} is that of the walk before it"
    return replace(one, walk=replace(one.walk, doubts=(*one.walk.doubts, said)))


def _said(cell: str) -> str:
    return "" if cell.startswith(todos.WORD) else cell


def _real(root: Path, path: str) -> str:
    """A recording by where it is, whichever links lead there."""
    return os.path.realpath(root / path)


def _recordings_of(sheet: Sheet | None) -> list[str]:
    return [path for row in _rows(sheet) for path in _paths(row)]


def _rows(sheet: Sheet | None) -> tuple[Row, ...]:
    return sheet.rows if sheet else ()


def _paths(row: Row) -> list[str]:
    """The recordings that a row names, those of its videos for all cameras that are there."""
    return [*bags_of({"bags": row.get("bags", "")}), *filter(None, [row.get("videos", "")])]


def _files(
    folder: Path, root: Path, found: Capture, new: Sequence[str], there: Mapping[str, Sheet | None]
) -> dict[str, str]:
    """Text by path below config/ of what is to be written: the sheets last, as they make the rest count."""
    files: dict[str, str] = {}
    config = folder / "config/config.yaml"
    if not config.exists():
        files["config.yaml"] = written.config_yaml(_relative(root, folder), found)
    lenses = read_config(folder).get("lenses") or {} if config.exists() else None
    fresh = [
        replace(session, taken=tuple(one for one in session.taken if one.name in new)) for session in found.sessions
    ]
    fresh = [session for session in fresh if session.taken]
    excluded = {row.get("sequence", "") for row in _rows(there["sequences"]) if row.get("exclude_reason")}
    used = [replace(session, taken=tuple(one for one in session.taken if one.name not in excluded))
            for session in found.sessions]  # fmt: skip
    files |= again.session_files(folder, [session for session in used if session.taken], lenses)
    _check_columns(fresh, there["sequences"])
    people = sorted({one.subject.text for session in fresh for one in session.taken if not one.subject.asked})
    if there["subjects"] is None:
        people = sorted({*people, *(_said(row.get("subject", "")) for row in _rows(there["sequences"]))} - {""})
    if any(one.subject.asked for session in fresh for one in session.taken) and there["subjects"] is None:
        people = people or [todos.WORD]
    listed = {row.get("subject", "") for row in _rows(there["subjects"])}
    rows = {
        "subjects": lambda columns: written.people_rows([one for one in people if one not in listed], columns),
        "sequences": lambda columns: written.walk_rows(fresh, columns, _orders(fresh, there["sequences"])),
    }
    for kind, columns in SHEETS.items():
        sheet = there[kind]
        text = rows[kind](sheet.columns if sheet else columns)
        if sheet is None:
            files[f"{kind}.tsv"] = written.header(kind, columns) + text
        elif text:
            added = text if sheet.text.endswith("\n") else f"\n{text}"
            files[f"{kind}.tsv"] = sheet.text + (added.replace("\n", "\r\n") if "\r\n" in sheet.text else added)
    for kind, more in (("gallery", ("path",)), ("detectors", ())):
        if not (folder / "config" / f"{kind}.tsv").exists() and there["sequences"] is None:
            files[f"{kind}.tsv"] = empty.header(kind, *more)
    return files


def _check_columns(fresh: Iterable[Session], sheet: Sheet | None) -> None:
    """Refuse a sheet that lacks a column which a new walk needs: its header is a person's."""
    for session in fresh if sheet else ():
        for one in session.taken:
            for column, cell in written.walk_cells(session, one, 0).items():
                if cell and sheet and column not in sheet.columns:
                    raise DiorError(
                        f"config/sequences.tsv: there is no column '{column}', which '{one.name}' needs; add it to the "
                        "first line, behind a tab"
                    )


def _orders(sessions: Iterable[Session], sheet: Sheet | None) -> dict[str, int]:
    """session_order of each new walk: after those that are in the sheet."""
    last: dict[str, int] = {}
    for row in _rows(sheet):
        order = row.get("session_order", "")
        last[row.get("session", "")] = max(last.get(row.get("session", ""), 0), int(order) if order.isdecimal() else 0)
    orders = {}
    for session in sessions:
        for i, one in enumerate(session.taken, start=last.get(session.name, 0) + 1):
            orders[one.name] = i
    return orders


def _relative(root: Path, folder: Path) -> str:
    """The folder of the recordings as config.yaml is to name it: from the project's folder, if that is not far."""
    path = os.path.relpath(root, folder.resolve())
    return str(root) if path.split(os.sep).count("..") > MOST_UP else Path(path).as_posix()


def _some_aside(found: Found, aside: Sequence[tuple[str, str]]) -> str:
    """One of the reasons why there is nothing, the likeliest: a recording that cannot be read."""
    broken = dict(found.broken)
    by_use = sorted(aside, key=lambda one: (one[0] not in broken, one[1] == NONE_OF_THEM))
    return f"; {by_use[0][0]}: {by_use[0][1]}" if by_use else ""


def _tell_aside(found: Capture) -> None:
    if not found.aside:
        return
    print("These belong to no walk:")
    groups: dict[tuple[str, str, str], list[str]] = {}
    for path, reason in found.aside:
        where = Path(path)
        groups.setdefault((where.parent.as_posix(), where.suffix, reason), []).append(where.name)
    for (parent, suffix, reason), files in list(groups.items())[:MOST_ASIDE]:
        shown = files[0] if len(files) == 1 else f"{len(files)} files *{suffix}"
        print(f"  {shown if parent == '.' else f'{parent}/{shown}'}: {reason}")
    if len(groups) > MOST_ASIDE:
        print(f"  and {len(groups) - MOST_ASIDE} more kinds")
    print()


def _tell_doubts(found: Capture) -> None:
    """What a person should look at, of several walks once, of many that are alike but for their numbers the first; the
    comments of the rows have them all."""
    walks: dict[str, list[str]] = {}
    for session in found.sessions:
        for one in session.taken:
            for doubt in one.doubts:
                walks.setdefault(doubt, []).append(one.name)
    alike: dict[str, list[str]] = {}
    for doubt in walks:
        alike.setdefault(re.sub(r"\d+", "0", doubt), []).append(doubt)
    for same in alike.values():
        shown = same if len(same) <= MOST_ALIKE else same[:1]
        more = f"; and {len(same) - len(shown)} more like it" if len(same) > len(shown) else ""
        for doubt in shown:
            print(f"Look: {listed(walks[doubt])}: {doubt}{more}.\n")


def _tell_changes(
    folder: Path, root: Path, found: Capture, new: Sequence[str], sheet: Sheet | None, files: Mapping[str, str]
) -> None:
    """Say which rows lack files, what could be filled in by now, and which files of the project are gone."""
    if sheet is None:
        return
    for row in sheet.rows:
        if lost := again.gone(folder, root, row):
            print(f"config/sequences.tsv: the files of {row.get('sequence')} are gone: {', '.join(lost)}")
    rows = {row.get("sequence", ""): row for row in sheet.rows}
    named = {_real(root, path) for path in _recordings_of(sheet)}
    for session in found.sessions:
        for one in session.taken:
            if one.name in new:
                continue
            cells = written.walk_cells(session, one, 0)
            for column in ("mocap", "detections", "stamps", "trigger_log"):
                said, now = rows[one.name].get(column, ""), cells[column]
                if now and not now.startswith(todos.WORD) and (not said or said.startswith(todos.WORD)):
                    print(f"config/sequences.tsv: {column} of {one.name} may be {now} by now")
            more = [path for path in one.paths if _real(root, path) not in named]
            if more:
                print(
                    f"config/sequences.tsv: {listed(more)} may be of {one.name}, too; put it into that row, and its "
                    f"cameras into config/sessions/{session.name}/session.yaml: called again, this writes their files"
                )
    for said in (*again.unlisted(folder, found.sessions), *again.lost_files(folder, sheet.rows, files)):
        print(said)
    known = {row.get("session", "") for row in sheet.rows}
    anew = [f"config/{path}" for path in files if path.startswith("sessions/") and path.split("/")[1] in known]
    if anew:
        print(f"Gone, so made anew from the recordings, with what was filled in asked again: {', '.join(anew)}")


def _tell_next(folder: Path, found: Capture, files: Mapping[str, str], new: Sequence[str]) -> None:
    if not files:
        print("Nothing is new.")
    else:
        print(f"Wrote {_listed(files)} in {folder / 'config'}" + (f", with {many(len(new), 'walk')}." if new else "."))
    for how, what in written.BY_HAND.items():
        if asking := written.located(found, how):
            print(f"{', '.join(asking)}: {what}.")
    left = todos.found(folder)
    where = shlex.quote(str(folder.resolve()))
    if left:
        are = "is" if len(left) == 1 else "are"
        config = shlex.quote(str(folder / "config"))
        print(f"{many(len(left), 'value')} {are} TODO, which only you know: `grep -rn TODO {config}`. Then type")
    else:
        print("Type")
    print(f"  dior pseudonyms {where}\n  dior check {where}\n  dior studio {where}")


def _listed(files: Mapping[str, str]) -> str:
    shown = [path for path in files if "/" not in path]
    cameras = sum(path.startswith("sessions/") and not path.endswith("/session.yaml") for path in files)
    sessions = sum(path.endswith("/session.yaml") for path in files)
    if sessions or cameras:
        shown.append(" with ".join(many(*one) for one in ((sessions, "session"), (cameras, "camera")) if one[0]))
    return ", ".join(shown) or "nothing"
