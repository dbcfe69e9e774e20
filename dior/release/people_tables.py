"""Who and what a release holds: the walks of the people who agreed, by pseudonym, the people and their gallery.

INPUTS   a `Project`, the `frames` and `gallery` tables
OUTPUTS  the released walks; columns of `sequences`, `subjects` and `released_gallery`
"""

from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import Table
from dior.project.bumps import MARK, session_folder
from dior.project.project import Project
from dior.release import shift_stamps
from dior.tables import tables

# rows of the sheet by sequence, with what `released_walks` adds
Walks: TypeAlias = dict[str, dict[str, Any]]
SHEET_COLUMNS = ("sequence", "environment", "outfit", "walk", "subject")


def released_walks(project: Project, frames: dict[str, Path]) -> Walks:
    """Rows of the sheet by sequence, sorted by pseudonym and sequence, of the walks that are released.

    `frames`: the `frames` table by sequence. `session` is the project's, `released_session` what the release calls it;
    `cameras` are the names of those that recorded it; `shift_ns` is what is subtracted from every stamp.
    """
    rows = {name: project.sequence(name) for name in project.released_sequences}
    shown, shifts = _session_names(rows), _shifts_ns(project, frames)
    walks: list[dict[str, Any]] = [
        {
            **row,
            "released_session": shown[row["session"]],
            "cameras": sorted(project.cameras_of(name)),
            "shift_ns": shifts[row["subject"]],
        }
        for name, row in rows.items()
    ]
    return {walk["sequence"]: walk for walk in sorted(walks, key=lambda walk: (walk["subject"], walk["sequence"]))}


def _shifts_ns(project: Project, frames: dict[str, Path]) -> dict[str, int]:
    """By subject, ns to take off the stamps: 0 unless the config asks for more."""
    people = project.released_subjects
    if not project.config["release"]["shift_stamps"]:
        return dict.fromkeys(people, 0)
    return {who: shift_stamps.shift_ns([frames[name] for name in project.sequences_of_subject(who)]) for who in people}


def _session_names(rows: dict[str, dict[str, str]]) -> dict[str, str]:
    """What each session is called in the release.

    A part of a session that a bump split is called after its first walk, which may be somebody's who is not released;
    it takes the first one that is.
    """
    order = sorted(rows.values(), key=lambda row: (int(row["session_order"]), row["sequence"]))
    firsts: dict[str, str] = {}
    for row in order:
        firsts.setdefault(row["session"], row["sequence"])
    return {
        session: f"{session_folder(session)}{MARK}{first}" if MARK in session else session
        for session, first in firsts.items()
    }


def sequences(walks: Walks) -> dict[str, list[Any]]:
    columns = {key: [walk[key] for walk in walks.values()] for key in SHEET_COLUMNS}
    return {
        **columns,
        "session": [walk["released_session"] for walk in walks.values()],
        "session_order": [int(walk["session_order"]) for walk in walks.values()],
    }


def subjects(walks: Walks, people: dict[str, dict[str, str]]) -> dict[str, list[Any]]:
    """Columns of `subjects`; `people`: rows of subjects.tsv by pseudonym."""
    names = sorted({walk["subject"] for walk in walks.values()})

    def metres(column: str) -> list[float]:
        return [float(people[name][column] or "nan") for name in names]

    return {"subject": names, "height_m": metres("height_m"), "height_sigma_m": metres("height_sigma_m")}


def gallery(path: Path, walks: Walks) -> Table:
    """Columns of the gallery of the released subjects, without the files, which name machines."""
    shifts = {walk["subject"]: walk["shift_ns"] for walk in walks.values()}
    table = tables.read(path, "gallery")
    table = tables.rows(table, np.array([name in shifts for name in table["subject"]], bool))
    ns = np.array([shifts[name] for name in table["subject"]], np.int64)
    table["stamp_ns"] = shift_stamps.shifted_stamps(table["stamp_ns"], ns)
    order = np.lexsort([table[key].astype(str) for key in ("angle", "outfit", "subject")])
    return {key: table[key][order] for key in tables.columns_of("released_gallery")}
