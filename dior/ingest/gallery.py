"""The gallery: pictures of the subjects from all around, per outfit and angle.

INPUTS   config/gallery.tsv (subject, outfit, angle and a folder of pictures, or a bag and its topic)
OUTPUTS  `gallery` table: a row per picture with what it takes to read it back; findings with the counts

The number in a file's name is the picture's place in its row's recording and, in a folder of pictures at equal steps,
the turn in degrees; it is not interpreted. The pixels stay where they are.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Table
from dior.errors import DiorError
from dior.ingest import bags as rosbag
from dior.ingest import messages, picture_folders
from dior.ingest.picture_folders import MOST_BYTES, SUFFIXES
from dior.project.plain_text import bytes_of
from dior.tables import tables

SHEET = "config/gallery.tsv"
KEY = ("subject", "outfit", "angle")
# chosen: fewer than this share of the median over outfits and angles is a warning
FEW_PICTURES = 0.5


def run(*, rows: list[Any], data_root: Path, out: Path, findings: Path) -> None:
    """Index the pictures of `rows`, those of the sheet as dicts; their folders and bags are below `data_root`.

    Raises DiorError for a folder or bag that is not there, holds no pictures or a broken one.
    """
    parts = []
    for row in sorted(rows, key=lambda row: tuple(row[key] for key in KEY)):
        where = f"{SHEET}, {row['subject']}, {row['outfit'] or 'no outfit'}, {row['angle']}"
        part = _of_bag(row, data_root) if row["bag"] else _of_folder(row, data_root, where)
        count = len(part["height"])
        part |= {key: np.full(count, row[key], object) for key in KEY}
        part["picture"] = np.arange(count)
        parts.append(part)
    keys = tables.columns_of("gallery")
    whole = {key: np.concatenate([part[key] for part in parts]) if parts else np.array([]) for key in keys}
    tables.write(out, "gallery", whole)
    found = [finding for subject in sorted({row["subject"] for row in rows}) for finding in counts(whole, subject)]
    tables.write_findings(findings, found)


def counts(table: Table, subject: str) -> list[tuple[str, str, str, str]]:
    """Findings about the pictures of one subject: how many per outfit and angle, and which are few or missing."""
    mine = tables.rows(table, table["subject"] == subject)
    by_pair = dict(sorted(Counter(zip(mine["outfit"], mine["angle"], strict=True)).items()))
    outfits, angles = (sorted({pair[i] for pair in by_pair}) for i in (0, 1))
    each = ", ".join(f"{outfit or 'no outfit'} {angle} {number}" for (outfit, angle), number in by_pair.items())
    found = [(subject, "info", "gallery", f"{sum(by_pair.values())} gallery pictures: {each}")]
    usual = np.median(list(by_pair.values()))
    for outfit in outfits:
        for angle in angles:
            number = by_pair.get((outfit, angle), 0)
            if number < FEW_PICTURES * usual:
                text = f"{outfit or 'no outfit'} from {angle} has {number} pictures in the gallery, others {usual:.0f}"
                found.append((subject, "warning", "gallery_incomplete", text))
    return found


def _of_folder(row: dict[str, str], data_root: Path, where: str) -> Table:
    folder = Path(data_root) / row["path"]
    if not folder.is_dir():
        raise DiorError(f"{where}: there is no folder {folder}; path is relative to data_root")
    files = picture_folders.files(folder)
    if not files:
        raise DiorError(f"{where}: {folder} holds no picture ({', '.join(SUFFIXES)})")
    sizes = np.array([_size(file, where) for file in files])
    count, empty = len(files), np.full(len(files), "", object)
    return {
        "file": np.array([f"{row['path'].rstrip('/')}/{file.name}" for file in files], object),
        "topic": empty,
        "stamp_ns": np.full(count, -1, np.int64),
        "receive_ns": np.full(count, -1, np.int64),
        "nth": np.full(count, -1),
        "height": sizes[:, 0],
        "width": sizes[:, 1],
    }


def _size(file: Path, where: str) -> tuple[int, int]:
    """(height, width) px of a picture file. Raises DiorError for one that cannot be decoded."""
    try:
        return messages.size_of_file(bytes_of(file, file, MOST_BYTES))
    except ValueError as error:
        raise DiorError(f"{where}: {file} is no readable picture ({error}); remove it or copy it again") from None


def _of_bag(row: dict[str, str], data_root: Path) -> Table:
    path = Path(data_root) / row["bag"]
    rosbag.bags_with([path], row["topic"], SHEET)
    index = rosbag.index(path, [row["topic"]])
    index = tables.rows(index, np.argsort(index["receive_ns"], kind="stable"))
    return {**index, "file": np.full(len(index["stamp_ns"]), row["bag"], object)}
