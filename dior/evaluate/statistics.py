"""What is in the dataset: pictures, keypoints, walks and people, and what is missing or was lost and why.

INPUTS   the sheets, `frames`, `labels_2d`, `skeletons_3d` and `dropped_frames` tables, `gallery` if there is one
OUTPUT   results/evaluate/statistics.csv: what, environment, role, camera, reason, value, unit; an empty cell means all,
         an empty unit that the value is a count.

| what | of | reason |
|---|---|---|
| frames | pictures | |
| keypoints_2d | labels in the picture | |
| missing_2d | (frame, joint) without one | `status` of labels_2d |
| keypoints_3d | (instant, joint) with a 3D point | gap_filled: of these |
| missing_3d | those without one | `status` of skeletons_3d |
| dropped_frames | pictures that are missing or there twice | `reason` of dropped_frames |
| sequences, subjects, outfits, walks, sessions, camera_recordings | distinct ones | |
| gallery_pictures | of the subjects from all around; the camera is the angle | |
| person_height, distance | of the subject in and from a long-range camera, the median picture's, px and m | |
"""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.errors import DiorError
from dior.progress import reporting
from dior.project import project as projects
from dior.project.bumps import session_folder
from dior.tables import result_checksums, tables
from dior.tables.files import write_text

COLUMNS = ("what", "environment", "role", "camera", "reason", "value", "unit")
# a row, by COLUMNS; environment, role and camera
Count: TypeAlias = dict[str, Any]
Place: TypeAlias = tuple[str, str, str]
THERE_3D = ("ok", "gap_filled")
THERE_2D = ("ok", "occluded")
NAMED = {"subjects": "subject", "outfits": "outfit", "walks": "walk", "sessions": "session"}


def run(
    *,
    root: Path,
    labels: list[Path],
    skeletons: list[Path],
    frames: list[Path],
    dropped: list[Path],
    gallery: Path | None,
    out: Path,
) -> None:
    """Count what is in the project in `root`: lists of the tables' files, named by sequence; `gallery` may be None."""
    project = projects.load(root)
    sheet = {name: project.sequence(name) for name in project.sequences}
    roles = {(s, camera): how["role"] for s in project.sessions for camera, how in project.cameras(s).items()}
    angles = tables.read(gallery, "gallery", ["angle"])["angle"] if gallery else ()
    write_text(out, as_csv(rows_of(sheet, roles, labels, skeletons, frames, dropped, angles)))


def rows_of(
    sheet: dict[str, dict[str, str]],
    roles: dict[tuple[str, str], str],
    labels: Sequence[AnyPath],
    skeletons: Sequence[AnyPath],
    frames: Sequence[AnyPath],
    dropped: Sequence[AnyPath] = (),
    angles: Iterable[str] = (),
) -> list[Count]:
    """Rows of statistics.csv as dicts, sorted.

    `sheet`: sequence -> its row, those that count; `roles`: (session, camera) -> role; files of other sequences are
    not looked at. `angles`: where each picture of the gallery is taken from.
    """
    counts: Counter[tuple[str, ...]] = Counter()
    measured: dict[tuple[str, ...], list[Floats]] = {}

    def place(path: AnyPath, camera: str = "") -> Place:
        row = sheet[_sequence(path)]
        return row["environment"], roles[row["session"], camera] if camera else "", camera

    def add(what: str, where: Place, reason: str, n: int) -> None:
        for key in _with_totals(*where, reason):
            counts[what, *key] += n

    for path in _of(sheet, frames):
        for camera, n in Counter(tables.read(path, "frames", ["camera"])["camera"].tolist()).items():
            add("frames", place(path, camera), "", n)
            add("camera_recordings", place(path, camera), "", 1)
    of_labels = _of(sheet, labels)
    for path in reporting(of_labels, len(of_labels), "tables of labels", "statistics"):
        where = place(path, Path(path).name.split(".")[1])
        for status, n in _words(path, "labels_2d", "status"):
            what = "keypoints_2d" if status in THERE_2D else "missing_2d"
            add(what, where, "" if status == "ok" else status, n)
        if where[1] == "long_range":
            for what, values in _seen(path).items():
                for key in _with_totals(*where, ""):
                    measured.setdefault((what, *key), []).append(values)
    for path in _of(sheet, skeletons):
        for status, n in _words(path, "skeletons_3d", "status"):
            what = "keypoints_3d" if status in THERE_3D else "missing_3d"
            add(what, place(path), "" if status == "ok" else status, n)
    for path in _of(sheet, dropped):
        table = tables.read(path, "dropped_frames", ["camera", "reason"])
        for (camera, reason), n in Counter(zip(table["camera"], table["reason"], strict=True)).items():
            add("dropped_frames", place(path, camera), reason, n)
    for row in sheet.values():
        add("sequences", (row["environment"], "", ""), "", 1)
    for environment in {"", *(row["environment"] for row in sheet.values())}:
        members = [row for row in sheet.values() if environment in ("", row["environment"])]
        for what, column in NAMED.items():
            # parts of a session that a bump splits are one session
            words = {session_folder(row[column]) if column == "session" else row[column] for row in members}
            counts[what, environment, "", "", ""] = len(words - {""})
    for angle, n in Counter(angles).items():
        add("gallery_pictures", ("", "", angle), "", n)
        counts["gallery_pictures", "", "", angle, ""] = n
    units = {"person_height": "px", "distance": "m"}
    rows = [(*key, n, "") for key, n in counts.items()]
    rows += [(*key, float(np.nanmedian(np.concatenate(v))), units[key[0]]) for key, v in measured.items()]
    return [dict(zip(COLUMNS, row, strict=True)) for row in sorted(rows)]


def _with_totals(environment: str, role: str, camera: str, reason: str) -> set[tuple[str, str, str, str]]:
    """The keys that a count goes to: its own and those of everything it is part of. Each once."""
    wheres = {
        (environment, role, camera), (environment, role, ""), (environment, "", ""), ("", role, ""), ("", "", "")
    }  # fmt: skip
    return {(*where, why) for where in wheres for why in (reason, "")}


def _sequence(path: AnyPath) -> str:
    return Path(path).name.split(".")[0]


def _of(sheet: dict[str, dict[str, str]], paths: Sequence[AnyPath]) -> list[AnyPath]:
    return [path for path in paths if _sequence(path) in sheet]


def _words(path: AnyPath, name: str, column: str) -> list[tuple[str, int]]:
    """How often each word is in a column; Arrow counts millions of rows without a string for each."""
    counts = tables.read_arrow(path, name, [column])[column].value_counts()
    return [(one["values"] or "", one["counts"]) for one in counts.to_pylist()]


def _seen(path: AnyPath) -> dict[str, Floats]:
    """Height of the person's labels (F,) px and distance (F,) m by picture of one camera, where there are any."""
    values, _ = tables.grid(tables.read(path, "labels_2d", ["joint", "frame", "v", "depth"]), "v", "depth")
    there = values[np.any(np.isfinite(values).all(axis=2), axis=1)]
    if not len(there):
        return {}
    return {
        "person_height": np.nanmax(there[..., 0], axis=1) - np.nanmin(there[..., 0], axis=1),
        "distance": np.nanmedian(there[..., 1], axis=1),
    }


def as_csv(rows: Iterable[Count]) -> str:
    """The rows as CSV text; measured values with six significant digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        value = f"{row['value']:.6g}" if row["unit"] else row["value"]
        writer.writerow([*(row[c] for c in COLUMNS[:-2]), value, row["unit"]])
    return text.getvalue()


def read(path: AnyPath) -> list[Count]:
    """Rows of statistics.csv as dicts; a count is an int, a measured value a float."""
    rows = list(csv.DictReader(io.StringIO(result_checksums.read_text(path), newline="")))
    if rows and tuple(rows[0]) != COLUMNS:
        raise DiorError(f"{path}: the columns are not {','.join(COLUMNS)}; delete it and run again")
    return [row | {"value": float(row["value"]) if row["unit"] else int(row["value"])} for row in rows]


def of(
    rows: Iterable[Count], what: str, environment: str = "", role: str = "", camera: str = "", reason: str = ""
) -> Any:
    """One value of the rows; 0 where nothing was counted."""
    key = (what, environment, role, camera, reason)
    return next((row["value"] for row in rows if tuple(row[c] for c in COLUMNS[:5]) == key), 0)


def properties(rows: Iterable[Count]) -> list[tuple[str, bool, str]]:
    """The paper's table of dataset properties (its Table 1) for this dataset: (property, whether, how much) rows."""
    mocap, far = of(rows, "frames", "indoor"), of(rows, "frames", role="long_range")
    views = of(rows, "camera_recordings") / max(of(rows, "sequences"), 1)
    height, distance = of(rows, "person_height", role="long_range"), of(rows, "distance", role="long_range")
    gallery, flat, deep = (of(rows, what) for what in ("gallery_pictures", "keypoints_2d", "keypoints_3d"))
    return [
        ("MoCap pose", mocap > 0, f"{_thousands(mocap)} of {_thousands(of(rows, 'frames'))} pictures"),
        ("Gallery from all around", gallery > 0, f"{_thousands(gallery)} pictures"),
        ("Multi-view", views >= 2, f"{views:.3g} cameras"),
        ("2D pose", flat > 0, f"{_thousands(flat)} keypoints"),
        ("3D pose", deep > 0, f"{_thousands(deep)} keypoints"),
        ("Long range", far > 0, f"{_thousands(far)} pictures from {distance:.3g} m" if far else ""),
        ("Less than 25 px tall", 0 < height < 25, f"{height:.3g} px, lowest to highest keypoint" if far else ""),
    ]


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", "\u202f")
