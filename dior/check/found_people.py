"""Whether what a detector found is of the recordings, and whole.

INPUTS   a `Project` (paths as seen from the working directory); what was recorded (`recordings.Recorded`)
OUTPUTS  faults in `Notes`
Which tool wrote them, for which frames and when, is told by the names of a folder's files, or by the two ends of a file
with a line per picture; whether a file was cut off, by its end.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dior.check.notes import Notes
from dior.check.recordings import AllRecorded, Recorded, side_by_side
from dior.errors import DiorError
from dior.ingest import detections
from dior.ingest.readers import READERS
from dior.ingest.readers.common import INTERRUPTED, files_by_frame, from_json
from dior.ingest.readers.mediapipe import TEXT, stamp_ns_of
from dior.project.contents import Project
from dior.project.missing import SEQUENCES, can_be_read
from dior.project.plain_text import unmarked, unreadable

# chosen: some pictures of a detector's output
END_BYTES = 1 << 16
# how the files of a folder end, where it is not in .json
SUFFIXES = {"yolo": ".txt"}
# what writes a JSON object per line and picture
LINES = ("mlkit", "mediapipe")
# chosen, in periods of the pictures: a network may swap those at an end; another walk is further away
SWAPPED = 2


@dataclass(frozen=True)
class Ends:
    """A detector's output: its `kind`, the first and last of its `frames` and of its `stamps` (ns), None where they are
    not told by its ends."""

    kind: str
    frames: tuple[int, int] | None = None
    stamps: tuple[int, int] | None = None


def of_walks(project: Project, lines: Mapping[str, int], recorded: AllRecorded, notes: Notes) -> None:
    """Look at the detections of all walks that bring theirs; `lines` of the walks in the sheet."""
    wanted = project.config["detector"]["format"]
    # the simulation counts from 0
    begin = 0 if "simulate" in project.config else project.config["detector"]["first_frame"]
    brought = [
        (walk, camera, path, wanted)
        for walk in project.sequences
        if (pattern := project.detections_pattern(walk)) and not project.detected_here(walk)
        for camera in project.close(project.session_of(walk))
        if can_be_read(".", path := pattern.format(camera=camera))
    ]
    for (walk, camera, path, _), found in zip(brought, side_by_side(_looked_into, brought), strict=True):
        line, there = lines[walk], recorded[walk].get(camera)
        if isinstance(found, DiorError):
            notes.fault(SEQUENCES, line, str(found), walk)
            continue
        with notes.kept(SEQUENCES, line, walk):
            close, pattern = project.close(project.session_of(walk)), project.detections_pattern(walk)
            detections.check_pattern(walk, pattern, close, READERS[found.kind])
        if there is None:
            continue
        told = _other_frames(found.frames, begin, there.count)
        if not told and camera not in project.filmed(walk):
            told = _other_time(found.stamps, there)
        if told:
            notes.fault(SEQUENCES, line, f"{walk}, {camera}: {path} {told}", walk)


def _other_frames(found: tuple[int, int] | None, begin: int, count: int) -> str:
    """What to say of frames that were not recorded, "" where they were."""
    if found is None or 0 <= found[0] - begin and found[1] - begin < count:
        return ""
    fix = "are they of another walk?"
    if found == (1, count):
        fix = f"are they counted from 1? Then {detections.SETTING} should be 1"
    frames = f"has frames {found[0]} to {found[1]}, and the recording has frames {begin} to {count - 1 + begin}"
    return f"{frames}; {fix}"


def _other_time(found: tuple[int, int] | None, there: Recorded) -> str:
    """What to say of stamps at which nothing was recorded, "" where something was."""
    if found is None or there.first_ns is None or there.last_ns is None:
        return ""
    most_ns = SWAPPED * (there.last_ns - there.first_ns) / max(there.count - 1, 1)
    early_ns, late_ns = there.first_ns - found[0], found[1] - there.last_ns
    if max(early_ns, late_ns) <= most_ns:
        return ""
    apart_ns, where = (early_ns, "before the first") if early_ns > most_ns else (late_ns, "after the last")
    return f"has a stamp {apart_ns / 1e9:.1f} s {where} picture of the recording; are they of another walk?"


def _looked_into(brought: tuple[str, str, str, str]) -> Ends | DiorError:
    """The ends of detections (walk, camera, path, format), or what is wrong with them."""
    walk, camera, path, wanted = brought
    try:
        return _ends(Path(path), detections.format_of(Path(path), wanted, f"{walk}, {camera}"))
    except DiorError as error:
        return error
    except OSError as error:
        shown = str(error.filename or path)
        return unreadable(shown, shown, error)


def _ends(path: Path, kind: str) -> Ends:
    """Raises DiorError for a file that is cut off."""
    if path.is_dir():
        files = files_by_frame(path, SUFFIXES.get(kind, ".json"))
        if not files:
            return Ends(kind)
        frames = list(files)
        _check_end(path / files[frames[-1]], kind, *_head_and_tail(path / files[frames[-1]]))
        return Ends(kind, (frames[0], frames[-1]))
    head, tail = _head_and_tail(path)
    if kind in LINES and head.startswith(b"{") and not path.name.lower().endswith(TEXT):
        return _of_lines(path, kind, head.split(b"\n"), tail.split(b"\n"))
    _check_end(path, kind, head, tail)
    return Ends(kind)


def _head_and_tail(path: Path) -> tuple[bytes, bytes]:
    """Both ends of a file, the whole of a small one."""
    with open(path, "rb") as stream:
        head = unmarked(stream.read(END_BYTES), path).strip()
        size = os.path.getsize(path)
        if size <= END_BYTES:
            return head, head
        stream.seek(size - END_BYTES)
        return head, stream.read().rstrip()


def _check_end(path: Path, kind: str, head: bytes, tail: bytes) -> None:
    """Refuse JSON whose end is missing, and a table whose last row is another than those before it."""
    tool, closing = READERS[kind].tool, {b"[": b"]", b"{": b"}"}.get(head[:1])
    if closing and not tail.endswith(closing):
        raise DiorError(f"{path}: not the JSON of {tool} (its end is missing); {INTERRUPTED}")
    last = tail.split(b"\n")
    if closing or kind == "mediapipe" or len(last) < 3:
        return
    before, end = (len(line.split(b"," if b"," in line else None)) for line in last[-2:])
    if before != end:
        raise DiorError(f"{path}: the last line has {end} columns, and that before it {before}; {INTERRUPTED}")


def _of_lines(path: Path, kind: str, head: list[bytes], tail: list[bytes]) -> Ends:
    """Of a file with the JSON of a picture on each line, by its first and last lines. Raises DiorError where one is
    none."""
    if len(tail) < 2 and tail != head:
        # longer than what is looked at
        return Ends(kind)
    tool = READERS[kind].tool
    pictures = [from_json(head[0], f"{path}: line 1", tool)] if len(head) > 1 else []
    pictures.append(from_json(tail[-1], f"{path}: the last line", tool))
    frames, stamps = [_whole(one, "frame") for one in pictures], [_stamp_ns(one, kind) for one in pictures]
    return Ends(kind, _span(frames), _span(stamps))


def _span(numbers: list[int | None]) -> tuple[int, int] | None:
    known = [number for number in numbers if number is not None]
    return (min(known), max(known)) if len(known) == len(numbers) else None


def _whole(picture: Any, key: str) -> int | None:
    value = picture.get(key) if isinstance(picture, dict) else None
    return value if isinstance(value, int) and value >= 0 else None


def _stamp_ns(picture: Any, kind: str) -> int | None:
    """The stamp of a picture's detections where the step compares it."""
    if kind == "mlkit":
        return _whole(picture, "stamp_ns")
    return None if "frame" in picture else stamp_ns_of(picture)
