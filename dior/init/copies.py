"""What is there twice: the same recording under another name or in another folder, the same files in two sets.

INPUTS   `found.Found`
OUTPUTS  the same with each recording once, the others put aside with the name of the one that is used
Pictures of two cameras, or of two walks, never agree to the bit: what does is a copy, whatever its name, its format or
the order of its messages. Of files without pictures, such as detections of nobody, that is not so: these are compared
only where two are of one walk and one camera.
"""

import os
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from dior.errors import DiorError
from dior.ingest import glance, messages
from dior.ingest.bag_reader import Message
from dior.init.found import Found, Recording

# chosen: the index of a bag or a video begins or ends within, and two that differ have differed by then
END_BYTES = 1 << 16
# what people and computers call a copy
_COPY = re.compile(
    r"(?<![a-z])(?:back[ _-]?up|bak|cop(?:y|ies)|kopien?|sicherung|duplicate|old|alt)(?![a-z])|\([0-9]+\)",
    re.IGNORECASE,
)


def without_copies(root: Path, found: Found, used: Collection[str]) -> None:
    """Put the recordings of `found` aside that are in others. `used`: paths, or paths with {camera}, of the sheet."""
    beside = [*(one.path for one in found.mocap), *(one.path for one in found.detections), *found.stamps]

    def key(one: Recording) -> tuple[bool | int | str, ...]:
        return not _is_used(one.path, used), -len(one.topics), *_likely(root, one.path, beside)

    kept: list[Recording] = []
    order = [one.path for one in found.recordings]
    for one in sorted(found.recordings, key=key):
        again = [
            (stream.topic, other.path) for stream in one.streams for other in kept if _has(root, other, one, stream)
        ]
        if len({topic for topic, _ in again}) < len(one.streams):
            kept.append(replace(one, again=tuple(again)))
            continue
        of = sorted({path for _, path in again})
        alike = len(of) == 1 and PurePosixPath(of[0]).name == PurePosixPath(one.path).name
        where = f"that in {PurePosixPath(of[0]).parent.as_posix()}" if alike else " and ".join(of)
        found.aside.append((one.path, f"is the same recording as {where}, which is used"))
    found.recordings[:] = sorted(kept, key=lambda one: order.index(one.path))


def in_order(root: Path, paths: Iterable[str]) -> list[str]:
    """Paths of the same content, the one that is least likely a copy first."""
    return sorted(paths, key=lambda path: _likely(root, path, ()))


def _likely(root: Path, path: str, beside: Sequence[str]) -> tuple[bool | int | str, ...]:
    """Sorts what is used before its copies: not called a copy; with things that belong to it (`beside`) in its folder,
    the one that holds little else; no link; nearer to the top; by name."""
    folder = PurePosixPath(path).parent.as_posix()
    around = len(beside) if folder == "." else sum(other.startswith(f"{folder}/") for other in beside)
    is_link = os.path.realpath(root / path) != os.path.join(os.path.realpath(root), path)
    return bool(_COPY.search(path)), not around, around, is_link, path.count("/"), path


def _is_used(path: str, used: Collection[str]) -> bool:
    whole = (one.split("{camera}") for one in used)
    return any(path.startswith(parts[0]) and path.endswith(parts[-1]) for parts in whole)


def _has(root: Path, one: Recording, other: Recording, stream: glance.Stream) -> bool:
    """Whether `one` has the pictures of a stream of `other`."""
    if one.kind != other.kind or stream not in one.streams:
        return False
    first, second = root / one.path, root / other.path
    if os.path.samefile(first, second):
        return True
    if one.kind != "bag":
        return same_files(first, second)
    a, b = (glance.first_message(path, stream.topic) for path in (first, second))
    return a is not None and b is not None and a.receive_ns == b.receive_ns and _says(a) == _says(b)


def _says(message: Message) -> object:
    try:
        return messages.content(message.kind, message.raw, message.wire)
    except ValueError:
        # a packet of a video
        return bytes(message.raw)


def same_files(first: Path, second: Path) -> bool:
    """Whether two files, or folders of files, are of the same size and begin and end alike; of a folder's files the
    sizes of all, and the bytes of the first and the last."""
    try:
        mine, theirs = _contents(first), _contents(second)
        if [one.stat().st_size for one in mine] != [one.stat().st_size for one in theirs]:
            return False
        return all(_ends(a) == _ends(b) for a, b in zip(mine[:1] + mine[-1:], theirs[:1] + theirs[-1:], strict=True))
    except (OSError, DiorError):
        return False


def _contents(path: Path) -> list[Path]:
    return sorted(one for one in path.iterdir() if one.is_file()) if path.is_dir() else [path]


def _ends(path: Path) -> tuple[bytes, bytes]:
    with open(path, "rb") as stream:
        first = stream.read(END_BYTES)
        stream.seek(max(os.fstat(stream.fileno()).st_size - END_BYTES, 0))
        return first, stream.read()
