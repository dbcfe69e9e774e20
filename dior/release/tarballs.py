"""One tarball per subject, so that a person's data can be given out, or taken back, on its own, and one of metadata.

INPUTS   a release folder (see package.py) and the part of it: a pseudonym, or `metadata`
OUTPUT   results/release/dior-<version>-<part>.tar, below dior-<version>/: of a subject its labels, skeletons, frames
         with pixels, detections, boxes, marks and the checksums of those; of `metadata` what lies at the top of the
         release: card, cameras, sheets, splits, figures, provenance, the checksums of all files and their signature
         .dior-<version>-<part>.part.tar and .json beside it while it is made, or where that was cut short
A subject's tarball names nobody else, so that it stays as it is when another withdraws; only that of metadata does not.
Unpacked over each other all of them are the release, byte for byte. Plain tar: Parquet is compressed already.

A tarball begins with its list of checksums, and each file is compared with that in the pass that packs it. What is
packed is noted in the .json once it is surely on the disk, and a run that was killed goes on from there.
"""

import fcntl
import hashlib
import itertools
import json
import os
import tarfile
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader, FileIO
from pathlib import Path

from dior.errors import DiorError, nearest
from dior.progress import reporting
from dior.release import checksums
from dior.shortage import of_disk
from dior.tables.files import write_text

# bytes read and written at once; chosen, as are the others: AHEAD blocks in memory, and seconds of packing lost
BLOCK = 1 << 20
# blocks that are written but not hashed yet
AHEAD = 8
# bytes that a killed run may have packed in vain
CHECKPOINT = 256 << 20


@dataclass(frozen=True)
class Member:
    """A file of the release, its place in the tarball and its SHA-256."""

    path: Path
    header: bytes
    size: int
    digest: str
    start: int
    end: int


@dataclass(frozen=True)
class Note:
    """The file that tells a later run what it need not pack again. `which`: a hash of all that is to be packed."""

    path: Path
    which: str

    def write(self, tar: FileIO, done: int) -> None:
        """Note that the tarball is whole up to byte `done`, once that is on the disk."""
        os.fsync(tar.fileno())
        write_text(self.path, json.dumps({"which": self.which, "done": done}) + "\n")


def run(*, release: Path, subject: str, out: Path) -> None:
    """Pack the part of the folder `release` that is about `subject`: a pseudonym, or `metadata`. Same part, same bytes.

    Raises DiorError for a subject that is not in the release, for a file that is gone or not the one that the release
    was built with, where the disk has no room, and while another run
    packs the same; after those two, run again to go on.
    """
    release, out = Path(release), Path(out)
    packed = plan(release, subject)
    out.parent.mkdir(parents=True, exist_ok=True)
    part, state = leftovers(out)
    which = hashlib.sha256(b"".join(member.header + member.digest.encode() for member in packed)).hexdigest()
    size = size_of(packed[-1].end)
    with _alone(part) as tar:
        try:
            done = _done(part, state, which, packed)
            tar.truncate(done)
            tar.seek(done)
            _pack(tar, [member for member in packed if member.start >= done], Note(state, which), out.name)
            _write(tar, bytes(size - packed[-1].end))
            os.fsync(tar.fileno())
        except OSError as error:
            said = of_disk(error, out, tar.tell(), size) or f"{out}: cannot be written ({error.strerror})"
            raise DiorError(f"{said}; what is packed so far is kept") from None
        os.replace(part, out)
        state.unlink(missing_ok=True)


@contextmanager
def _alone(part: Path) -> Iterator[FileIO]:
    """Yield a file to be written in which another run may have left off. Raises DiorError while one writes it."""
    while True:
        with open(part, "r+b", buffering=0, opener=lambda path, flags: os.open(path, flags | os.O_CREAT, 0o644)) as tar:
            try:
                fcntl.flock(tar, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise DiorError(f"{part}: another run is packing this tarball; wait for it, or end it") from None
            except OSError:
                pass  # a disk without locks
            # the other run may have given the file its final name since it was opened
            if part.exists() and os.path.samestat(part.stat(), os.fstat(tar.fileno())):
                yield tar
                return


def leftovers(out: Path) -> tuple[Path, Path]:
    """What a run that was cut short leaves beside the tarball `out`: its beginning, and how much of it is whole."""
    return out.with_name(f".{out.stem}.part.tar"), out.with_name(f".{out.stem}.part.json")


def members(release: Path, subject: str) -> dict[str, str]:
    """SHA-256 by path in the release of what the tarball of `subject` (or `metadata`) holds, the checksums first."""
    listed = checksums.read(release)
    parts = sorted({checksums.of_whom(name) for name in listed})
    if subject not in parts:
        raise DiorError(f"{release}: subject '{subject}' is not in the release{nearest(subject, parts)}")
    first = checksums.list_of(subject)
    # the list of all files is in no list, nor is its signature
    unlisted = (checksums.SUMS, checksums.SIGNATURE) if subject == checksums.METADATA else ()
    there = [name for name in unlisted if (release / name).is_file()]
    found = {name: checksums.digest(open(release / name, "rb")) for name in there} or {first: listed[first]}
    return found | {name: listed[name] for name in sorted(listed) if checksums.of_whom(name) == subject}


def plan(release: Path, subject: str) -> list[Member]:
    """The `Member`s of a tarball, in its order. Raises DiorError for a file that is gone."""
    found, at = [], 0
    for name, digest in members(release, subject).items():
        path = release / name
        if not path.is_file():
            raise DiorError(f"{path}: listed in {checksums.SUMS} but gone; build the release again")
        size = path.stat().st_size
        head = header(f"{release.name}/{name}", size)
        end = at + len(head) + padded(size, tarfile.BLOCKSIZE)
        found.append(Member(path, head, size, digest, at, end))
        at = end
    return found


def header(name: str, size: int) -> bytes:
    """What a tarball has before a file: nothing of its owner and time, the same rights for all."""
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = size, 0o644
    return entry.tobuf(tarfile.PAX_FORMAT)


def padded(size: int, to: int) -> int:
    """The size when filled up to whole blocks of `to` bytes."""
    return -(-size // to) * to


def size_of(end: int) -> int:
    """Bytes of a tarball whose last file ends at `end`: two blocks of zeros, filled up to whole records."""
    return padded(end + 2 * tarfile.BLOCKSIZE, tarfile.RECORDSIZE)


def _done(part: Path, state: Path, which: str, planned: list[Member]) -> int:
    """Bytes of an earlier run that can be kept: 0 where there are none of this part of this release."""
    try:
        noted = json.loads(state.read_bytes())
        there = part.stat().st_size
    except (OSError, ValueError):
        return 0
    known = noted["which"] == which and noted["done"] in {member.end for member in planned}
    return noted["done"] if known and noted["done"] <= there else 0


def _pack(tar: FileIO, planned: list[Member], note: Note, where: str) -> None:
    """Append files; what is on the disk is noted now and then, and when the packing is cut short."""
    whole = noted = tar.tell()
    noting = None
    with ThreadPoolExecutor(1) as hasher, ThreadPoolExecutor(1) as noter:
        try:
            for end in reporting(_ends(tar, planned, hasher), sum(map(_blocks, planned)), "MB", where):
                whole = max(whole, end)
                if whole - noted >= CHECKPOINT and (noting is None or noting.done()):
                    noting, noted = noter.submit(note.write, tar, whole), whole
        except BaseException:
            # the space of the file that was cut short is freed first: the disk may be full
            with suppress(OSError, DiorError):
                wait([noting] if noting else [])
                tar.truncate(whole)
                note.write(tar, whole)
            raise
    if noting is not None:
        noting.result()


def _blocks(member: Member) -> int:
    return max(1, -(-member.size // BLOCK))


def _ends(tar: FileIO, planned: list[Member], hasher: ThreadPoolExecutor) -> Iterator[int]:
    """Write files, yielding after each block where the last whole file ends, 0 where none has been written.

    Another thread hashes what is written, a few blocks behind, so that one core does nothing but the hash.
    """
    buffers, end = itertools.cycle([bytearray(BLOCK) for _ in range(AHEAD + 1)]), 0
    for member in planned:
        _write(tar, member.header)
        digest = hashlib.sha256()
        hashing: deque[Future[None]] = deque()
        with _opened(member) as stream:
            for left in range(member.size, 0, -BLOCK):
                block = memoryview(next(buffers))[: min(left, BLOCK)]
                if _read(stream, block, member) != len(block):
                    raise _changed(member)
                hashing.append(hasher.submit(digest.update, block))
                _write(tar, block)
                if len(hashing) > AHEAD:
                    hashing.popleft().result()
                if left > BLOCK:
                    yield end
            wait(hashing)
            if _read(stream, bytearray(1), member) or digest.hexdigest() != member.digest:
                raise _changed(member)
        end = member.end
        _write(tar, bytes(-member.size % tarfile.BLOCKSIZE))
        yield end


def _opened(member: Member) -> BufferedReader:
    try:
        return open(member.path, "rb")
    except OSError as error:
        raise DiorError(f"{member.path}: cannot be read ({error.strerror})") from None


def _read(stream: BufferedReader, block: bytearray | memoryview, member: Member) -> int:
    try:
        return stream.readinto(block)
    except OSError as error:
        raise DiorError(f"{member.path}: cannot be read ({error.strerror})") from None


def _write(tar: FileIO, content: bytes | memoryview) -> None:
    """All of `content`: the system writes a part of it where the disk is nearly full."""
    left = memoryview(content)
    while left:
        left = left[tar.write(left) :]


def _changed(member: Member) -> DiorError:
    return DiorError(
        f"{member.path}: its SHA-256 is not the one that {checksums.SUMS} has; a release is not edited by hand: delete "
        "its folder and build it again"
    )
