"""What must hold in the tables of one walk of a release.

INPUTS   the walk's `File`s by path in the release (folder_or_tarball.py). OUTPUTS: problems as (path, sentence), and
         what there is to count
Every (frame, joint) has its row, every label its frame with that stamp, every frame its label; missing is null with a
reason, pictures have the size that their row says. A problem is given once per file with how often and
where first.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dior.arrays import Bools, Floats, Ints, Table
from dior.errors import nearest
from dior.ingest import jpeg
from dior.ingest.stamps import MOST_OUT_OF_ORDER
from dior.release import layout
from dior.release.layout import IN_PICTURE, Part
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.sample import Sample
from dior.tables import buffers, tables
from dior.tables.schemas import SCHEMAS, VERSION, VOCABULARY
from dior.tables.words import WITHOUT_3D

# a path in the release, and what is wrong with it
Problem: TypeAlias = tuple[str, str]
# the distinct words of a table's text columns
Words: TypeAlias = dict[str, set[str]]
# of a column of pictures, in memory at once, and bytes read at once; chosen: they bound the memory
PICTURES_AT_ONCE = 16
BUFFER = 1 << 20
PARTS = {part.name: part for part in layout.PARTS}
# what is looked at of a walk's tables, beside the words of all columns
COLUMNS = {
    "labels_2d": ("joint", "frame", "stamp_ns", "u", "v", "depth", "status"),
    "skeletons_3d": ("joint", "instant", "stamp_ns", "x", "y", "z", "status"),
    "frames": ("frame", "stamp_ns", "height", "width", "no_image"),
    "detections": ("joint", "frame", "stamp_ns", "u", "v", "score"),
    "boxes": ("frame", "stamp_ns", "u_min", "v_min", "u_max", "v_max"),
    "covers": ("frame", "stamp_ns"),
    "gait": ("parameter", "side", "value", "sigma", "low", "high", "reason"),
    "gait_events": ("foot", "event", "stamp_ns", "instant", "time_s", "sigma_s", "low_s", "high_s", "reason"),
    "gait_steps": ("parameter", "foot", "start_s", "end_s", "value", "sigma", "low", "high"),
    "marks": ("camera", "kind", "joint", "frame", "stamp_ns", "u", "v", "x", "y", "z", "residual_px"),
}
WITHOUT_PIXEL = (*WITHOUT_3D, "behind_camera")
WITH_POINT = ("ok", "gap_filled")


class Broken(Exception):
    """A table that cannot be looked into; the text says why."""


@dataclass(eq=False)
class WalkFindings:
    """What was found in a walk: problems as (path, sentence); by camera the counts, and the path of its pictures with
    the set of their sizes (height, width).

    `tables`: by kind and camera, and `pictures`: by camera a sample (sample.py), while the walk is looked at;
    `figures`: what they give of metrics.csv (figures.py); `suspects`: by camera, recordings whose pictures may be those
    of another one, and `beside` all of a walk that has one (pictures.py); `bare`: problems of covers (cover_checks.py),
    which are wrong in no table, so that what the tables contradict is looked for all the same.
    """

    who: str
    sequence: str
    problems: list[Problem] = field(default_factory=list)
    tables: dict[str, dict[str, Table]] = field(default_factory=dict)
    figures: dict[tuple[str, str, str], Any] = field(default_factory=dict)
    pictures: dict[str, list[tuple[int, bytes]]] = field(default_factory=dict)
    suspects: dict[str, Any] = field(default_factory=dict)
    beside: dict[str, Any] = field(default_factory=dict)
    bare: list[Problem] = field(default_factory=list)
    counts: dict[str, Counter[str]] = field(default_factory=dict)
    sizes: dict[str, tuple[str, set[tuple[int, int]]]] = field(default_factory=dict)


def read(file: File, part: Part, columns: Sequence[str] | None = None) -> tuple[Table, Words]:
    """(columns as numpy, words by text column) of a table (see tables.py), of `columns` or all of them; words of all.

    Raises Broken for a table that is not what `part` should be.
    """
    try:
        with pq.ParquetFile(file.open()) as table:
            _check_schema(table.schema_arrow, part.table)
            texts = [field.name for field in SCHEMAS[part.table] if pa.types.is_dictionary(field.type)]
            columns = SCHEMAS[part.table].names if columns is None else columns
            found = table.read(columns=sorted({*columns, *texts}))
            # Arrow finds the few words of a column without a string for each row
            words = {name: {word or "" for word in found[name].unique().to_pylist()} for name in texts}
            return {name: buffers.to_numpy(found[name].combine_chunks()) for name in columns}, words
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        raise Broken(f"is not a readable Parquet file ({error})") from None


def _check_schema(schema: pa.Schema, name: str) -> None:
    metadata = schema.metadata or {}
    kind, version = (metadata.get(key, b"").decode() for key in (b"dior_table", b"dior_table_version"))
    if kind != name:
        raise Broken(f"holds the table '{kind or 'unknown'}', not '{name}'")
    if version != VERSION:
        raise Broken(f"is of version '{version}' of the tables, this dior knows {VERSION}")
    expected = SCHEMAS[name]
    for column in expected.names:
        if column not in schema.names:
            raise Broken(f"has no column '{column}'{nearest(column, set(schema.names) - set(expected.names))}")
    for column in schema:
        if column.name not in expected.names:
            raise Broken(f"has a column '{column.name}' that the table {name} does not have")
        if column.type != expected.field(column.name).type:
            raise Broken(f"column '{column.name}' is {column.type}, not {expected.field(column.name).type}")
    if schema.names != expected.names:
        raise Broken("has its columns in another order")


def unknown_words(words: Words, name: str) -> list[str]:
    """Sentences about words that a table's columns may not hold."""
    return [
        f"'{word}' is no {column}{nearest(word, VOCABULARY[name, column])}"
        for column in sorted(words)
        if (name, column) in VOCABULARY
        for word in sorted(words[column] - {"", *VOCABULARY[name, column]})
    ]


def walk(who: str, sequence: str, files: dict[str, File], listed: Sequence[str], decode: bool = False) -> WalkFindings:
    """Look into the tables of one walk.

    `files`: by path, those whose checksum is right; `listed`: all that should be there. `decode`: look at every
    pixel, too.
    """
    found = WalkFindings(who, sequence)
    # of a camera whose frames cannot be looked at nothing more is said
    frames: dict[str, Table | None] = {
        name.split(".")[1]: None for name in listed if name.startswith("frames/") and name.count(".") == 2
    }
    for path, file in sorted(files.items(), key=lambda item: not item[0].startswith("frames/")):
        kind, _, name = path.split("/")
        part = PARTS.get(kind)
        try:
            if part is None or part.path == part.pattern:
                raise Broken(f"lies in a folder that a release does not have{nearest(kind, PARTS)}")
            camera = _camera(name, part)
            table, words = read(file, part, COLUMNS[kind])
            found.tables.setdefault(kind, {})[camera] = table
            counts = found.counts.setdefault(camera, Counter())
            sentences = unknown_words(words, part.table) + _whose(words, who, sequence, camera)
            if kind == "frames":
                frames[camera] = table
                found.sizes[camera] = (path, set(zip(table["height"].tolist(), table["width"].tolist(), strict=True)))
                sample = Sample(len(table["frame"]))
                sentences += _frames(table, file, decode, counts, sample)
                found.pictures[camera] = sample.pictures()
            elif kind == "skeletons_3d":
                sentences += _skeleton(table, counts)
            elif not kind.startswith("gait"):
                sentences += _about_frames(table, kind, camera, frames, counts)
            found.problems += [(path, text) for text in sentences]
        except Broken as error:
            found.problems.append((path, str(error)))
    return found


def _camera(name: str, part: Part) -> str:
    """The camera that a file's name tells, "" for a table of all cameras."""
    words = name.removesuffix(".parquet").split(".")
    if len(words) != (2 if "<camera>" in part.path else 1) or not name.endswith(".parquet"):
        raise Broken(f"is not called as {part.path}")
    return words[1] if "<camera>" in part.path else ""


def _whose(words: Words, who: str, sequence: str, camera: str) -> list[str]:
    expected = {"subject": who, "sequence": sequence} | ({"camera": camera} if camera else {})
    return [
        f"{column} '{word}' in a file of '{right}'"
        for column, right in expected.items()
        for word in sorted(words[column] - {right})
    ]


def first(wrong: Bools, what: str, table: Table, keys: Sequence[str] = ("frame",)) -> list[str]:
    """[how often, what and where first] of the rows where `wrong`, [] where there are none."""
    if not wrong.any():
        return []
    row = int(np.argmax(wrong))
    return [
        f"{int(wrong.sum())} {what}, first " + ", ".join(f"{key} {table[key][row]}" for key in keys if key in table)
    ]


def _frames(table: Table, file: File, decode: bool, counts: Counter[str], sample: Sample) -> list[str]:
    counts["frames"] += len(table["frame"])
    counts["camera_recordings"] += 1
    sentences = first(np.r_[False, np.diff(table["frame"]) <= 0], "frames out of order or twice", table)
    sentences += first(_goes_back(table["stamp_ns"]), "stamps that go back", table)
    there = np.zeros(len(table["frame"]), bool)
    wrong: dict[str, list[int]] = {}
    size = list(zip(table["height"].tolist(), table["width"].tolist(), strict=True))
    for row, data in pictures_in(file):
        there[row] = True
        sample.add(row, data)
        try:
            _check_picture(data, size[row], decode)
        except ValueError as error:
            wrong.setdefault(str(error), []).append(row)
    counts["pictures"] += int(there.sum())
    sentences += first(~there & (table["no_image"] == ""), "rows with neither a picture nor a reason", table)
    sentences += first(there & (table["no_image"] != ""), "rows with a picture and a reason for none", table)
    return sentences + [
        f"{len(rows)} pictures: {why}, first frame {table['frame'][rows[0]]}" for why, rows in sorted(wrong.items())
    ]


def pictures_in(file: File) -> Iterator[tuple[int, bytes]]:
    """Yield (row, bytes) of the pictures, a few in memory at a time."""
    start = 0
    with pq.ParquetFile(file.open(), buffer_size=BUFFER) as table:
        for batch in table.iter_batches(PICTURES_AT_ONCE, columns=["image"], use_threads=False):
            data = batch.column(0).field("bytes")
            there = [column.is_valid().to_numpy(zero_copy_only=False) for column in (batch.column(0), data)]
            for row in np.flatnonzero(there[0] & there[1]).tolist():
                yield start + row, data[row].as_py()
            start += len(batch)


def _check_picture(data: bytes, size: tuple[int, int], decode: bool) -> None:
    """ValueError for what is no JPEG of `size` (height, width), or tells more than the picture."""
    found = jpeg_size(data)
    if found != size:
        raise ValueError(f"{found[1]}x{found[0]} px where the row says {size[1]}x{size[0]}")
    if not decode:
        return
    import cv2

    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if picture is None or picture.shape[:2] != size:
        raise ValueError("cannot be decoded")


def jpeg_size(data: bytes) -> tuple[int, int]:
    """(height, width) px by the header of a JPEG. Raises ValueError for another file, one that is cut off or one with
    a comment or application segment, which may tell a place, a machine or a person.

    Source: ITU-T T.81, B.1.1.3 and B.2.2.
    """
    if data[-2:] != jpeg.EOI:
        raise ValueError("no JPEG, or one that is cut off")
    for marker, _ in jpeg.segments(data):
        if marker in jpeg.FRAMES:
            break
        if marker == 0xFE or 0xE1 <= marker <= 0xEF:
            raise ValueError(f"more than the picture is in it (JPEG segment {marker:#x})")
    return jpeg.frame_size(data)


def _goes_back(stamp_ns: Ints) -> Bools:
    """Mask (F,) of pictures whose stamps go back, but for a few that were recorded after a later one: these have a
    place of their own among the others."""
    back = np.r_[False, np.diff(stamp_ns) < 0]
    if not back.any() or back.mean() > MOST_OUT_OF_ORDER:
        return back
    ordered = np.sort(stamp_ns)
    steps = np.diff(ordered)
    at = np.searchsorted(ordered, stamp_ns)
    far = np.iinfo(np.int64).max
    nearest = np.minimum(np.r_[far, steps], np.r_[steps, far])[at]
    return back & (nearest < np.median(steps) / 2)


def _skeleton(table: Table, counts: Counter[str]) -> list[str]:
    sentences = _grid(table, "instant")
    if sentences:
        return sentences
    where = ("instant", "joint")
    sentences = first(np.r_[False, np.diff(table["stamp_ns"]) < 0], "stamps that go back", table, where)
    there = np.isfinite(np.stack([table[axis] for axis in "xyz"])).all(axis=0)
    with_point = np.isin(table["status"], WITH_POINT)
    counts["points_3d"] += int(there.sum())
    sentences += first(
        with_point & ~there, "points that are missing although their status says otherwise", table, where
    )
    sentences += first(table["status"] == "", "rows without a status", table, where)
    return sentences + first(
        ~with_point & there, "points that are there although their status says otherwise", table, where
    )


def _about_frames(
    table: Table, kind: str, camera: str, frames: dict[str, Table | None], counts: Counter[str]
) -> list[str]:
    """A table that names frames, each with its stamp."""
    sentences = []
    for name in [camera] if camera else sorted(set(table["camera"])):
        mine = tables.of_camera(table, name) if not camera else table
        if name not in frames:
            sentences.append(f"is about camera '{name}', of which there is no table of frames")
        if (pictures := frames.get(name)) is None:
            continue
        sentences += _in_frames(mine, pictures, name)
        if kind == "labels_2d":
            sentences += _labels(mine, pictures, counts)
    return sentences


def _in_frames(table: Table, frames: Table, camera: str) -> list[str]:
    where = ("frame", "joint")
    at = np.searchsorted(frames["frame"], table["frame"]).clip(max=max(len(frames["frame"]) - 1, 0))
    if not len(frames["frame"]):
        known = np.zeros(len(table["frame"]), bool)
        same = known
    else:
        known = frames["frame"][at] == table["frame"]
        same = frames["stamp_ns"][at] == table["stamp_ns"]
    return first(~known, f"rows in frames that camera {camera} does not have", table, where) + first(
        known & ~same, f"rows whose stamp is not that of the frame of camera {camera}", table, where
    )


def _labels(table: Table, frames: Table, counts: Counter[str]) -> list[str]:
    sentences = _grid(table, "frame")
    if sentences:
        return sentences
    where = ("frame", "joint")
    counts["labels"] += len(table["frame"])
    inside = np.isin(table["status"], IN_PICTURE)
    counts["keypoints_2d"] += int(inside.sum())
    without = ~np.isin(frames["frame"], table["frame"])
    sentences += first(without, "frames without labels", frames)
    pixels = np.stack([table["u"], table["v"]], axis=-1)
    there = np.isfinite(pixels).all(axis=-1)
    none = np.isin(table["status"], WITHOUT_PIXEL)
    sentences += first(table["status"] == "", "rows without a status", table, where)
    sentences += first(~none & ~there, "labels without a pixel although their status says otherwise", table, where)
    sentences += first(none & there, "labels with a pixel although their status says otherwise", table, where)
    outside = inside & there & ~in_picture(pixels, frames)
    return sentences + first(outside, "labels outside the picture although their status says otherwise", table, where)


def in_picture(pixels: Floats, frames: Table) -> Bools:
    """Which pixels (N, 2) lie in pictures of the size that the frames' rows say; pixel (0, 0) is a centre."""
    size = np.array([[frames[key].max(initial=0) for key in ("width", "height")]])
    # float32 labels that were in_frame as float64 may be rounded to the border
    return np.all((pixels >= -0.501) & (pixels <= size - 0.499), axis=-1)


def _grid(table: Table, key: str) -> list[str]:
    """Whether there is a row for each joint of each frame or instant, in order."""
    joints = tables.ordered_unique(table["joint"])
    count, rest = divmod(len(table["joint"]), max(len(joints), 1))
    if rest or "" in joints or (table["joint"].reshape(count, -1) != np.array(joints, dtype=object)).any():
        return [f"is not complete: every {key} must have a row for each of its {len(joints)} joints, in one order"]
    numbers = table[key].reshape(count, -1)
    if (numbers != numbers[:, :1]).any() or (np.diff(numbers[:, 0]) <= 0).any():
        return [f"is not complete or not sorted by {key}"]
    return []
