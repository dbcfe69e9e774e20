"""A project that is there, called again: what of it is gone, and what its sheets name and is not there.

INPUTS   the project's config/, its rows as they are, the `Session`s that were found, called as in the sheet
OUTPUTS  texts of files that are gone, by path below config/; sentences
Files are read as far as they can be: what is wrong in them `dior check` says.
"""

import glob
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.init import cameras, written
from dior.init.sessions import Session
from dior.init.walks import listed
from dior.project import bumps, todos
from dior.project.contents import bags_of
from dior.project.schema_check import Row, read_yaml

# columns of sequences.tsv that name files; `bags` apart, which has several
FILES = ("videos", "stamps", "mocap", "detections", "trigger_log", "truth")


def session_files(folder: Path, sessions: Sequence[Session], lenses: Mapping[str, str] | None) -> dict[str, str]:
    """Text by path below config/ of the YAML files of some sessions that are not there: of a session without
    session.yaml all, of another one those of the cameras that it lists."""
    files: dict[str, str] = {}
    for session in _one_each(sessions):
        there = _camera_files(folder, session.name)
        content = _content(folder / f"config/sessions/{session.name}/session.yaml")
        if content is None:
            session = _called_as_their_files(session, there)
        texts = written.session_files(session, lenses)
        if content is not None:
            listed = content.get("cameras") or []
            texts = {path: text for path, text in texts.items() if Path(path).stem in listed}
        files |= {path: text for path, text in texts.items() if not os.path.lexists(folder / "config" / path)}
    return files


def _one_each(sessions: Iterable[Session]) -> list[Session]:
    """Sessions that have one name in the sheet as one, each walk and camera once."""
    found: dict[str, Session] = {}
    for session in sessions:
        first = found.get(session.name, replace(session, taken=(), cameras=(), roles={}, lenses={}))
        walks, names = {one.name for one in first.taken}, {one.name for one in first.cameras}
        found[session.name] = replace(
            first,
            taken=(*first.taken, *{one.name: one for one in session.taken if one.name not in walks}.values()),
            cameras=tuple(sorted((*first.cameras, *(one for one in session.cameras if one.name not in names)),
                                 key=lambda one: one.name)),
            roles={**session.roles, **first.roles},
            lenses={**session.lenses, **first.lenses},
        )  # fmt: skip
    return list(found.values())


def _camera_files(folder: Path, session: str) -> dict[str, dict[str, Any]]:
    """By camera the content of its YAML file, of all that a session has, those of bumps apart."""
    paths = sorted((folder / "config/sessions" / session).glob("*.yaml"))
    of = {path.stem: _content(path) for path in paths if path.name != "session.yaml" and bumps.MARK not in path.stem}
    return {name: content for name, content in of.items() if content is not None}


def _content(path: Path) -> dict[str, Any] | None:
    """What is in a YAML file, None where there is none, nothing where it is broken."""
    if not os.path.lexists(path):
        return None
    try:
        content = read_yaml(path, path)
    except DiorError:
        return {}
    return content if isinstance(content, dict) else {}


def _called_as_their_files(session: Session, there: Mapping[str, Mapping[str, Any]]) -> Session:
    """The session with the names that a person has given to its cameras: those of the files with their topics."""
    of_topics = {(of.get("topic"), of.get("bag", "")): name for name, of in there.items() if of.get("topic")}
    changed = {one.name: of_topics.get((one.topic, one.bag), one.name) for one in session.cameras}
    anew = cameras.called_anew(session.cameras, changed)
    if [one.name for one in anew] == [one.name for one in session.cameras]:
        return session
    return replace(
        session,
        cameras=tuple(anew),
        roles={changed[name]: role for name, role in session.roles.items()},
        lenses={changed[name]: lens for name, lens in session.lenses.items()},
    )


def lost_files(folder: Path, rows: Sequence[Row], files: Iterable[str]) -> Iterator[str]:
    """What is to be said of sessions of the sheet, and of their cameras, without YAML files; `files`: paths below
    config/ of those that are written anew."""
    anew = set(files)
    for session in sorted({_session(row) for row in rows if not row.get("exclude_reason")} - {""}):
        if session.startswith(todos.WORD):
            continue
        shown = f"sessions/{session}/session.yaml"
        walks = listed([row.get("sequence", "") for row in rows if _session(row) == session])
        content = _content(folder / "config" / shown)
        if content is None and shown not in anew:
            yield f"config/{shown} is gone, and no recording of {walks} tells its cameras; take it from a backup"
        for camera in (content or {}).get("cameras") or []:
            path = f"sessions/{session}/{camera}.yaml"
            if not os.path.lexists(folder / "config" / path) and path not in anew:
                yield (
                    f"config/{path} is gone, and no camera of {walks} is called {camera}; take it from a backup, or "
                    f"take {camera} out of config/{shown}"
                )


def _session(row: Row) -> str:
    return bumps.session_folder(row.get("session", ""))


def recordings(folder: Path, root: Path, row: Row) -> list[str]:
    """The bags of a row, and the videos of the cameras that its session has, all that fit where that is not known."""
    videos = row.get("videos", "")
    each = _each(folder, root, row, "videos") if videos and not videos.startswith(todos.WORD) else []
    if videos and not each:
        each = [os.path.relpath(path, root) for path in _fitting(root, videos)]
    return [*bags_of({"bags": row.get("bags", "")}), *each]


def unlisted(folder: Path, sessions: Iterable[Session]) -> Iterator[str]:
    """What is to be said of cameras in videos that the session.yaml which is there does not list."""
    for session in _one_each(sessions):
        shown = f"config/sessions/{session.name}/session.yaml"
        there = (_content(folder / shown) or {}).get("cameras") or []
        for camera in session.cameras if there else ():
            if camera.kind != "bag" and camera.name not in there:
                yield (
                    f"{shown} lists no {camera.name}, of which there is {camera.paths[0]}; add it if it is to be "
                    "labelled: called again, this writes its file"
                )


def gone(folder: Path, root: Path, row: Row) -> list[str]:
    """The files that a row names and that are not there, with their columns; `root`: what its paths are relative to."""
    cells = {column: row.get(column, "") for column in ("bags", *FILES)}
    lost = []
    for column, cell in cells.items():
        if not cell or cell.startswith(todos.WORD) or (column, cell) == ("detections", "detect"):
            continue
        paths = bags_of({"bags": cell}) if column == "bags" else _each(folder, root, row, column)
        # a path for any camera is left where no camera has it
        mine = [f"{path}{why}" for path in paths if (why := _why_gone(root, path)) is not None]
        lost += [f"{column} {', '.join(mine)}"] if mine else []
    return lost


def _why_gone(root: Path, path: str) -> str | None:
    """What is to be said of a path that is not there, None of one that is."""
    if "{camera}" in path:
        return ""
    try:
        os.stat(root / path)
    except (FileNotFoundError, NotADirectoryError):
        return " (a link to nothing)" if os.path.islink(root / path) else ""
    except OSError as error:
        return f" ({error.strerror})"
    return None


def _each(folder: Path, root: Path, row: Row, column: str) -> list[str]:
    """The path in a cell, for each camera that has to have it; as it is where that is none, or where none has it."""
    path = row[column].partition("#")[0].strip() if column == "trigger_log" else row[column]
    if "{camera}" not in path or not _any(root, path):
        return [path]
    there = _camera_files(folder, _session(row))
    if column == "detections":
        mine = [name for name, of in there.items() if of.get("role") == "close"]
    else:
        mine = [name for name, of in there.items() if not of.get("topic") or not row.get("bags")]
    listed = (_content(folder / f"config/sessions/{_session(row)}/session.yaml") or {}).get("cameras") or mine
    return [path.replace("{camera}", name) for name in mine if name in listed]


def _any(root: Path, path: str) -> bool:
    """Whether there is a file of any camera."""
    return bool(_fitting(root, path))


def _fitting(root: Path, path: str) -> list[str]:
    """The files that a path with {camera} in it may mean."""
    return glob.glob(os.path.join(glob.escape(str(root)), "*".join(map(glob.escape, path.split("{camera}")))))
