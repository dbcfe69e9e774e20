"""The cameras of a release: intrinsics, poses and how sure those are; their clocks in each walk.

INPUTS   `cameras` and `camera_covariance` tables of the sessions, `offsets` tables of the sequences
OUTPUTS  columns of `released_cameras` and `camera_covariance`, sorted by session and camera, and of `released_clocks`
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Table
from dior.errors import DiorError
from dior.release.layout import rows_of
from dior.release.people_tables import Walks
from dior.tables import tables


def released(
    paths: Iterable[Path], covariances: Iterable[Path], walks: Walks, checked: Mapping[str, Mapping[str, str]]
) -> Table:
    """Columns of the final cameras of the released sessions, with each one's own covariance where it is known.

    `checked`: session -> camera -> who has looked at its pictures.
    """
    shown = {walk["session"]: walk["released_session"] for walk in walks.values()}
    wanted = {(walk["session"], camera) for walk in walks.values() for camera in walk["cameras"]}
    table = _of_sessions(paths, "cameras", shown)
    names = list(zip(table["session"], table["camera"], strict=True))
    for session, camera in sorted(set(names)):
        if names.count((session, camera)) > 1:
            raise DiorError(f"release: camera '{camera}' of session '{session}' is in two tables of cameras")
    for session, camera in sorted(wanted - set(names)):
        raise DiorError(f"release: camera '{camera}' of session '{session}' is in no table of cameras; run its steps")
    own = {
        (pair["session"], pair["camera"]): pair["covariance"]
        for pair in rows_of(_of_sessions(covariances, "camera_covariance", shown))
        if pair["camera"] == pair["other"]
    }
    table["covariance"] = np.array([own.get(name, np.full(36, np.nan)) for name in names])
    table["heads_checked"] = np.array([checked.get(s, {}).get(camera, "") for s, camera in names], object)
    return _sorted({key: table[key] for key in tables.columns_of("released_cameras")}, shown)


def covariance(paths: Iterable[Path], walks: Walks) -> Table:
    """Columns of the joint covariance of the released sessions' cameras: a row for each pair that is known."""
    shown = {walk["session"]: walk["released_session"] for walk in walks.values()}
    return _sorted(_of_sessions(paths, "camera_covariance", shown), shown)


def clocks(paths: Iterable[Path], walks: Walks) -> dict[str, list[Any]]:
    """Columns of the clocks of the released recordings, by pseudonym, walk and camera."""
    found = {
        (row["sequence"], row["camera"]): row
        for path in dict.fromkeys(map(str, paths))
        for row in rows_of(tables.read(path, "offsets"))
        if row["sequence"] in walks
    }
    rows = []
    for name, walk in walks.items():
        for camera in walk["cameras"]:
            if (name, camera) not in found:
                raise DiorError(f"release: camera '{camera}' of '{name}' is in no table of clocks; run its steps")
            rows.append({**found[name, camera], "subject": walk["subject"]})
    return {key: [row[key] for row in rows] for key in tables.columns_of("released_clocks")}


def _of_sessions(paths: Iterable[Path], name: str, sessions: dict[str, str]) -> Table:
    """The rows of some sessions of several tables of one kind."""
    parts = [tables.read(path, name) for path in dict.fromkeys(map(str, paths))]
    if not parts:
        return tables.empty(name)
    table = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return tables.rows(table, np.array([session in sessions for session in table["session"]], bool))


def _sorted(table: Table, shown: dict[str, str]) -> Table:
    """The rows by the session's name in the release, then by camera."""
    table = {**table, "session": np.array([shown[session] for session in table["session"]], object)}
    keys = list(zip(*(table[key] for key in ("session", "camera", "other") if key in table), strict=True))
    return tables.rows(table, np.array(sorted(range(len(keys)), key=keys.__getitem__), np.int64))
