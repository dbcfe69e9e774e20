"""The files of one walk in a release, by pseudonym and with nothing that names a machine, a file or a person.

INPUTS   of each step the tables of the walk: `labels_2d`, `skeletons_3d`, gait, `frames`, `detections`, `marks`,
         pictures and what is covered in them (by pseudonym already), boxes and checks as CSV
OUTPUTS  <table>/<subject>/<sequence>[.<camera>].parquet; where nobody marked, drew or detected there is no file
Units as in dior/tables/schemas/. Metadata is made anew, so that nothing else slips through.
"""

import os
import shutil
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from dior.arrays import Table
from dior.errors import DiorError
from dior.evaluate import checks as hand_checks
from dior.project import boxes as hand_boxes
from dior.release import layout, shift_stamps, suspect
from dior.tables import buffers, tables
from dior.tables.files import written_whole
from dior.tables.schemas import SCHEMAS

# the table of each part about gait
GAIT = {part.name: part.table for part in layout.PARTS if part.table.startswith("gait_")}


@dataclass(frozen=True)
class Sources:
    """The files about one walk: paths, or by camera; `gait`: by part of the release (layout.py); `marks`: tables of the
    session, in which it may be named."""

    labels: dict[str, Path]
    pixels: dict[str, Path]
    covers: dict[str, Path]
    skeleton: Path
    gait: dict[str, Path]
    frames: Path
    detections: Path | None = None
    boxes: dict[str, Path] = field(default_factory=dict)
    checks: dict[str, Path] = field(default_factory=dict)
    marks: tuple[Path, ...] = ()


def write(folder: Path, walk: dict[str, Any], sources: Sources, without_place: Collection[str] = ()) -> None:
    """Write what the release folder `folder` has of one walk (see people_tables.py).

    `without_place`: cameras whose labels are suspect, "" for the 3D and the labels of all (suspect.py).
    """
    who, name = walk["subject"], walk["sequence"]
    index = tables.read(sources.frames, "frames", ["camera", "frame", "stamp_ns"])
    index["stamp_ns"] = shift_stamps.shifted_stamps(index["stamp_ns"], walk["shift_ns"])
    stamps = {camera: _stamps(index, camera) for camera in walk["cameras"]}
    joints = {}
    for camera in walk["cameras"]:
        recording = f"{who}/{name}.{camera}.parquet"
        labels = _own(tables.read_arrow(sources.labels[camera], "labels_2d"), sources.labels[camera], walk)
        joints[camera] = labels["joint"].combine_chunks().dictionary.to_pylist()
        if camera in without_place or "" in without_place:
            labels = suspect.hidden(labels)
        tables.write_arrow(folder / "labels_2d" / recording, labels)
        _check_pictures(sources.pixels[camera], walk, camera, stamps[camera])
        link(sources.pixels[camera], folder / "frames" / recording)
        link(sources.covers[camera], folder / "covers" / recording)
    skeleton = tables.read_arrow(sources.skeleton, "skeletons_3d")
    out = folder / "skeletons_3d" / who / f"{name}.parquet"
    skeleton = _own(skeleton, sources.skeleton, walk)
    tables.write_arrow(out, suspect.hidden(skeleton) if "" in without_place else skeleton)
    for part, path in sources.gait.items():
        table = _own(tables.read_arrow(path, GAIT[part]), path, walk)
        out = folder / part / who / f"{name}.parquet"
        write_gait(out, suspect.without_gait(table) if "" in without_place else table)
    if sources.detections:
        _write_detections(sources.detections, walk, folder)
    for camera, path in sources.boxes.items():
        _write_boxes(path, walk, camera, stamps[camera], folder)
    _write_marks(sources, walk, stamps, joints, folder)


def _stamps(index: Table, camera: str) -> dict[int, int]:
    """Stamp by frame of one camera."""
    mine = tables.of_camera(index, camera)
    return dict(zip(mine["frame"].tolist(), mine["stamp_ns"].tolist(), strict=True))


def _own(table: pa.Table, path: Path, walk: dict[str, Any]) -> pa.Table:
    """The table with the release's stamps and metadata, once it is sure whose it is."""
    for column, expected in (("subject", walk["subject"]), ("sequence", walk["sequence"])):
        names = pc.unique(table[column].cast(pa.string())).to_pylist()
        if names not in ([expected], []):
            raise DiorError(
                f"{path}: the {column} is {names[0]}, but the sheet says {expected}; delete it and run again"
            )
    kind = tables.kind_of(table)
    if walk["shift_ns"] and "stamp_ns" in table.column_names:
        table = shift_stamps.shifted(table, walk["shift_ns"])
    return table.replace_schema_metadata(tables.own_metadata(kind))


def _repeated(word: str, length: int) -> pa.DictionaryArray:
    """A text column that holds one word."""
    return pa.DictionaryArray.from_arrays(pa.array(np.zeros(length, np.int32)), pa.array([word]))


def _check_pictures(path: Path, walk: dict[str, Any], camera: str, stamps: dict[int, int]) -> None:
    """The pictures must be of this recording, under the pseudonym and with the stamps of today, and all of them."""
    table = tables.read_arrow(path, "released_frames", ["subject", "sequence", "camera", "frame", "stamp_ns"])
    for column, expected in (("subject", walk["subject"]), ("sequence", walk["sequence"]), ("camera", camera)):
        names = pc.unique(table[column].cast(pa.string())).to_pylist()
        if names not in ([expected], []):
            raise DiorError(f"{path}: the {column} is {names[0]}, not {expected}; delete it and run again")
    found = zip(table["frame"].to_pylist(), table["stamp_ns"].to_pylist(), strict=True)
    if list(found) != sorted(stamps.items()):
        raise DiorError(
            f"{path}: has {len(table)} rows, whose frames and stamps are not those of the {len(stamps)} pictures of "
            f"{walk['sequence']}, camera {camera}; delete it and run again"
        )


def link(path: Path, out: Path) -> None:
    """The file at a second place without a second copy, or with one where the disk has no links."""
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(path, out)
    except OSError:
        shutil.copyfile(path, out)


def write_gait(path: Path, table: pa.Table) -> None:
    """Write a table about the gait, of which a walk may have no row: then it has no group of rows either, as `datasets`
    stops at an empty one."""
    if table.num_rows:
        tables.write_arrow(path, table)
        return
    with written_whole(path) as part, pq.ParquetWriter(part, table.schema, compression="zstd"):
        pass


def _write_detections(path: Path, walk: dict[str, Any], folder: Path) -> None:
    """The walker's detections, a file per camera."""
    table = tables.read_arrow(path, "detections").combine_chunks()
    cameras = buffers.to_numpy(table["camera"].combine_chunks()) if len(table) else np.empty(0, object)
    name = walk["sequence"]
    for camera in walk["cameras"]:
        chosen = pa.Array.from_buffers(pa.bool_(), len(cameras), [None, buffers.bits(cameras == camera)])
        mine = table.filter(chosen)
        if not len(mine):
            continue
        words = {"subject": walk["subject"], "sequence": name, "camera": camera}
        schema = SCHEMAS["released_detections"]
        columns = [
            _repeated(words[column], len(mine)) if column in words else mine[column].combine_chunks()
            for column in schema.names
        ]
        schema = schema.with_metadata(tables.own_metadata("released_detections"))
        out = folder / "detections" / walk["subject"] / f"{name}.{camera}.parquet"
        released = pa.Table.from_arrays(columns, schema=schema)
        tables.write_arrow(out, shift_stamps.shifted(released, walk["shift_ns"]) if walk["shift_ns"] else released)


def _write_boxes(path: Path, walk: dict[str, Any], camera: str, stamps: dict[int, int], folder: Path) -> None:
    frames, edges = hand_boxes.read(path, list(stamps))
    if not len(frames):
        return
    columns = {
        **_of_walk(walk, len(frames)),
        "camera": [camera] * len(frames),
        "frame": frames,
        "stamp_ns": [stamps[frame] for frame in frames.tolist()],
        **dict(zip(("u_min", "v_min", "u_max", "v_max"), edges.T, strict=True)),
    }
    out = folder / "boxes" / walk["subject"] / f"{walk['sequence']}.{camera}.parquet"
    tables.write(out, "released_boxes", columns)


def _of_walk(walk: dict[str, Any], length: int) -> dict[str, Any]:
    return {"subject": [walk["subject"]] * length, "sequence": [walk["sequence"]] * length}


def _write_marks(
    sources: Sources,
    walk: dict[str, Any],
    stamps: dict[str, dict[int, int]],
    joints: dict[str, list[str]],
    folder: Path,
) -> None:
    """Marks that located a camera and checks that nothing used, by camera, kind, frame and joint."""
    rows = [row for path in sources.marks for row in _marks(path, walk["sequence"])]
    for camera, path in sources.checks.items():
        points = hand_checks.points(path, walk["sequence"], list(stamps[camera]), joints[camera])
        rows += [
            {"camera": camera, "kind": "check", "frame": frame, "joint": joint, "u": u, "v": v}
            for (frame, joint), (u, v) in points.items()
        ]
    if not rows:
        return
    rows.sort(key=lambda row: (row["camera"], row["kind"], row["frame"], row["joint"]))
    for row in rows:
        if row["frame"] not in stamps[row["camera"]]:
            raise DiorError(
                f"{walk['sequence']}, camera {row['camera']}: {row['joint']} is marked on frame {row['frame']}, which "
                "is not in the recording; frames count from 0"
            )
    nothing = dict.fromkeys(("x", "y", "z", "residual_px"), np.nan) | {"inlier": -1}
    columns = {
        key: [(nothing | row)[key] for row in rows]
        for key in tables.columns_of("released_marks")
        if key in nothing or key in rows[0]
    }
    columns["stamp_ns"] = [stamps[row["camera"]][row["frame"]] for row in rows]
    out = folder / "marks" / walk["subject"] / f"{walk['sequence']}.parquet"
    tables.write(out, "released_marks", {**_of_walk(walk, len(rows)), **columns})


def _marks(path: Path, sequence: str) -> list[dict[str, Any]]:
    """The rows of a `marks` table that were marked on pictures of this walk."""
    table = tables.read(path, "marks")
    table = tables.rows(table, table["sequence"] == sequence)
    keys = ("camera", "frame", "joint", "u", "v", "x", "y", "z", "residual_px", "inlier")
    cells = zip(*(table[key].tolist() for key in keys), strict=True)
    return [{**dict(zip(keys, row, strict=True)), "kind": "mark"} for row in cells]
