"""What a person has to mark so that the labels are measured: indoor labels to click, long-range frames to box.

INPUTS   `labels_2d` files <sequence>.<camera>.parquet: of indoor sequences, and of long-range cameras
OUTPUTS  <out>/checks/<sequence>.<camera>.csv   `sequence,frame,joint,u,v`, u and v left empty
         <out>/boxes/<sequence>.<camera>.csv    `frame,u_min,v_min,u_max,v_max`, the edges left empty

Copy a file to the folder of the same name in config/ and fill it in; rows left empty do not count. No pixel of a label
is in them, or the hand would follow it. The draw has a fixed seed, and every file its own lots: a sequence more or
less changes as little of it as can be.
"""

import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias
from zlib import crc32

import numpy as np

from dior.arrays import AnyPath, Ints, Table
from dior.evaluate import checks
from dior.project import boxes
from dior.tables import tables
from dior.tables.files import write_text

# lot, (subject, camera), path, frame, row, joint
Lot: TypeAlias = tuple[float, tuple[str, str], Path, int, int, str]

SEED = 20240104
LABELS = 100  # chosen: the sigma of their median is an eighth of their scatter
FRAMES = 20  # chosen; of each long-range camera and sequence; the paper drew 14245 of 211798


def run(*, indoor: list[Path], long_range: list[Path], out: Path) -> None:
    """Draw LABELS labels of the files `indoor`, and FRAMES frames of each of the files `long_range`."""
    out = Path(out)
    shutil.rmtree(out, ignore_errors=True)
    (out / "checks").mkdir(parents=True)
    (out / "boxes").mkdir()
    for path, rows in labels(indoor).items():
        sequence = path.stem.split(".")[0]
        lines = [f"{sequence},{frame},{joint},," for frame, joint in rows]
        _write(out / "checks" / f"{path.stem}.csv", checks.REQUIRED, lines)
    for path in sorted(map(Path, long_range)):
        lines = [f"{frame},,,," for frame in frames(path)]
        if lines:
            _write(out / "boxes" / f"{path.stem}.csv", boxes.COLUMNS, lines)


def labels(paths: Iterable[AnyPath], count: int = LABELS) -> dict[Path, list[tuple[int, str]]]:
    """(frame, joint) pairs by path: `count` labels of status ok, as many as can be of each subject and camera.

    A marker that a body or the picture's edge hides cannot be clicked, so that only `ok` ones are drawn.
    """
    drawn = [row for path in sorted(map(Path, paths)) for row in _lots(path, count)]
    by_cell: dict[tuple[str, str], list[Lot]] = {}
    for row in sorted(drawn):
        by_cell.setdefault(row[1], []).append(row)
    turns = sorted((turn, *row) for cell in by_cell.values() for turn, row in enumerate(cell))
    found: dict[Path, list[tuple[int, int, str]]] = {}
    for _, _, _, path, frame, number, joint in turns[:count]:
        found.setdefault(path, []).append((frame, number, joint))
    return {path: [(frame, joint) for frame, _, joint in sorted(rows)] for path, rows in sorted(found.items())}


def _lots(path: Path, count: int) -> Iterator[Lot]:
    """(lot, (subject, camera), path, frame, row, joint) of the `count` lowest lots of a file."""
    table = tables.read(path, "labels_2d", ["subject", "camera", "joint", "frame", "status"])
    ok = np.flatnonzero(table["status"] == "ok")
    lot = _generator(path.stem).random(len(table["status"]))[ok]
    for i in np.argsort(lot, kind="stable")[:count]:
        row = ok[i]
        cell = (table["subject"][row], table["camera"][row])
        yield float(lot[i]), cell, path, int(table["frame"][row]), int(row), table["joint"][row]


def frames(path: Path, count: int = FRAMES) -> list[int]:
    """`count` frames of a label file, as `spread` draws them among those that have a label in them."""
    return spread(labelled(tables.read(path, "labels_2d", ["frame", "status"])), path.stem, count)


def labelled(labels: Table) -> Ints:
    """Frames (F,) in which something of the body is labelled, ascending, by the columns frame and status."""
    return np.unique(labels["frame"][(labels["status"] == "ok") | (labels["status"] == "occluded")])


def spread(among: Ints, name: str, count: int = FRAMES, had: Iterable[int] = ()) -> list[int]:
    """Of the frames `among` (F,), ascending, one of each of `count` equal parts; and those that somebody `had` before,
    which take the place of the lot of their part. `name`: <sequence>.<camera>, whose lots they are.
    """
    kept = set(had)
    parts = np.array_split(among, min(count, len(among))) if len(among) else []
    generator = _generator(name)
    lots = [int(part[int(generator.random() * len(part))]) for part in parts]
    free = [lot for lot, part in zip(lots, parts, strict=True) if not any(part[0] <= one <= part[-1] for one in kept)]
    return sorted(kept.union(free))


def _generator(name: str) -> np.random.Generator:
    return np.random.default_rng([SEED, crc32(name.encode())])


def _write(path: Path, columns: Sequence[str], lines: Sequence[str]) -> None:
    write_text(path, "\n".join([",".join(columns), *lines]) + "\n")
