"""A camera that was bumped within a session: `<camera>@<first sequence>.yaml` says what holds from that sequence on.

INPUTS   rows of sequences.tsv, the names of the files in config/sessions/<session>/
OUTPUTS  rows in which the sequences after a bump are of a session of their own, named `<session>@<first sequence>`
Everything about a camera depends on its session, so that a part of a session is treated as one: it is located or
adjusted by itself, and the sequences before the bump stay as they are. A camera without a file of its own for the part
has the same file as before. Loads no numerics.
"""

import os

from dior.errors import DiorError, nearest
from dior.paths import AnyPath
from dior.project.schema_check import Rows

MARK = "@"


def session_folder(session: str) -> str:
    """Name of the folder in config/sessions/ of a session or a part of one."""
    return session.partition(MARK)[0]


def in_parts(root: AnyPath, rows: Rows) -> Rows:
    """The rows of sequences.tsv with the sessions that bumps split. Raises DiorError for a file with a wrong name."""
    out = dict(rows)
    for session in sorted({row["session"] for row in rows.values()}):
        firsts = _firsts(root, session, rows)
        part = session
        for name in _in_order(session, rows):
            part = f"{session}{MARK}{name}" if name in firsts else part
            out[name] = {**rows[name], "session": part}
    return out


def file_of(root: AnyPath, session: str, camera: str, suffix: str, rows: Rows) -> str:
    """Path below `root` of a camera's file (`.yaml`, `.marks.csv`) in a session or a part of one."""
    folder, _, first = session.partition(MARK)
    plain = f"config/sessions/{folder}/{camera}{suffix}"
    if not first:
        return plain
    order = _in_order(folder, {name: {**row, "session": session_folder(row["session"])} for name, row in rows.items()})
    for name in reversed(order[: order.index(first) + 1]):
        own = f"config/sessions/{folder}/{camera}{MARK}{name}"
        # the marks of a bumped camera are its own, too: those from before are of another pose
        if os.path.exists(os.path.join(root, f"{own}.yaml")):
            return own + suffix
    return plain


def _in_order(session: str, rows: Rows) -> list[str]:
    mine = [row for row in rows.values() if row["session"] == session]
    mine.sort(key=lambda row: (int(row["session_order"]), row["sequence"]))
    return [row["sequence"] for row in mine]


def _firsts(root: AnyPath, session: str, rows: Rows) -> set[str]:
    """Sequences from which on a camera of the session has a file of its own."""
    folder = os.path.join(root, "config/sessions", session)
    order, firsts = _in_order(session, rows), set()
    files = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    for file in (file for file in files if MARK in file and not file.startswith(".")):
        shown = f"config/sessions/{session}/{file}"
        camera, _, rest = file.partition(MARK)
        suffix = next((end for end in (".marks.csv", ".yaml") if rest.endswith(end)), None)
        if suffix is None:
            raise DiorError(
                f"{shown}: is called neither <camera>@<first sequence>.yaml nor <camera>@<first sequence>.marks.csv"
            )
        first = rest.removesuffix(suffix)
        if first not in order:
            raise DiorError(
                f"{shown}: '{first}' is no sequence of session '{session}' in config/sequences.tsv"
                f"{nearest(first, order)}; the name is <camera>@<first sequence after the bump>{suffix}"
            )
        for before in (f"{camera}.yaml", f"{camera}@{first}.yaml"):
            if before not in files:
                there = [name.removesuffix(".yaml") for name in files if MARK not in name and name != "session.yaml"]
                raise DiorError(
                    f"{shown}: config/sessions/{session}/{before} is missing beside it{nearest(camera, there)}"
                )
        if first == order[0]:
            raise DiorError(f"{shown}: {first} is the first sequence of the session; edit {camera}.yaml itself")
        firsts.add(first)
    return firsts
