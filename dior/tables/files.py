"""Writing files so that a reader never meets half of one, also where two runs write the same file.

What is being written lies beside its place, as `.<name>.<writer>.part<suffix>`. The writer is in the name, so that no
two write into one file, and so that what a killed one left can be removed, by the next that writes into the folder.
"""

import errno
import hashlib
import itertools
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from dior.errors import DiorError
from dior.paths import AnyPath
from dior.shortage import of_disk
from dior.tables import result_checksums

# after which what another computer was writing is given up; chosen: no writer adds nothing to its file for a day
GIVEN_UP_S = 86400.0
# bytes that a file's name may have on any disk
_LONGEST = 255
# bytes; chosen: more than what is left in the last block of a file on any disk
_PROBE = 1 << 18
# <computer>-<its boot>-<process>-<when that started>-<number>
_LEFT = re.compile(r"\..+\.([0-9a-f]{6})-([0-9a-f]{6})-(\d+)-(\d+)-\d+\.(?:part|old)(?:\.[^.]+)?")
_number = itertools.count(1)


@contextmanager
def written_whole(path: AnyPath, needed: int | None = None) -> Iterator[Path]:
    """Yield a path beside `path` to write to; it takes the place of `path` only if nothing was raised.

    `needed`: bytes that will about be written, where that is known. The suffix is kept for libraries that look at it. A
    failed writer removes what it wrote; the checksum of a project's result is noted. Raises DiorError where the disk
    has no room, and where `path` is a folder.
    """
    path = Path(path)
    with _in_place_of(path, needed) as part:
        yield part
        _note(part, path)


@contextmanager
def _in_place_of(path: Path, needed: int | None = None) -> Iterator[Path]:
    if path.is_dir():
        raise DiorError(f"{path}: is a folder; give the name of the file to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_left(os.path.abspath(path.parent))
    part = _beside(path, path.stem, f"part{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise _said(error, path, part, needed) from None
    finally:
        part.unlink(missing_ok=True)


def _note(part: Path, path: Path) -> None:
    """Note the checksum of what is about to be at `path`; of a file that is no result there is none."""
    result = result_checksums.result_at(path)
    if result is None:
        return
    with _in_place_of(result.entry) as entry:
        entry.write_text(result.line(result_checksums.file_sha256(part)), encoding="utf-8")


@contextmanager
def folder_written_whole(folder: AnyPath) -> Iterator[Path]:
    """Yield an empty folder beside `folder` to write to; it takes the place of `folder` only if nothing was raised.

    Every file of an earlier `folder` is gone then. Raises DiorError where the disk has no room.
    """
    folder = Path(folder)
    if not folder.name:
        raise DiorError(f"{folder}: is not to be replaced; give the name of a folder in it")
    folder.parent.mkdir(parents=True, exist_ok=True)
    _remove_left(os.path.abspath(folder.parent))
    part, old = (_beside(folder, folder.name, kind) for kind in ("part", "old"))
    part.mkdir()
    try:
        yield part
        _exchange(part, folder, old)
    except OSError as error:
        raise _said(error, folder, part) from None
    finally:
        for left in (part, old):
            shutil.rmtree(left, ignore_errors=True)


def _exchange(part: Path, folder: Path, old: Path) -> None:
    """Put the folder `part` in the place of `folder`, and what was there to `old`; another run may do so, too."""
    while True:
        with suppress(FileNotFoundError):
            os.replace(folder, old)
        try:
            os.replace(part, folder)
            return
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            shutil.rmtree(old, ignore_errors=True)


def _said(error: OSError, path: Path, part: Path, needed: int | None = None) -> Exception:
    """The error as a sentence where the disk had no room for `path`, or else as it is."""
    written = sum(file.stat().st_size for file in (part, *part.rglob("*")) if file.is_file())
    said = of_disk(error, path, written, needed)
    return DiorError(said) if said else error


def check_written(path: AnyPath, least: int = 1) -> None:
    """Raise OSError where a library in C++, which does not tell, could not write all of a file.

    `least`: bytes that it has at the least. A disk that was full takes nothing more at the end of the file either.
    """
    with open(path, "ab") as stream:
        size = stream.tell()
        stream.write(bytes(_PROBE))
        stream.flush()
        stream.truncate(size)
    if size < least:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def write_text(path: AnyPath, text: str) -> None:
    """Write `text` as UTF-8 with Unix line ends, whole or not at all."""
    content = text.encode()
    with written_whole(path, len(content)) as part:
        part.write_bytes(content)


def _beside(path: Path, name: str, ending: str) -> Path:
    """A path that nobody else has, with the name of its writer in it."""
    pid = os.getpid()
    tail = f".{_computer()}-{_boot()}-{pid}-{_stat(pid)[1]}-{next(_number)}.{ending}"
    kept = name.encode()[: _LONGEST - len(tail.encode()) - 1].decode(errors="ignore")
    return path.with_name(f".{kept}{tail}")


@cache
def _remove_left(folder: str) -> None:
    """Remove what dead writers left in a folder, files and folders; looked for once by a process."""
    for entry in os.scandir(folder):
        found = _LEFT.fullmatch(entry.name)
        if found and _is_dead(found, Path(entry)):
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry, ignore_errors=True)
            else:
                # it may be gone by now, or somebody else's
                with suppress(OSError):
                    os.unlink(entry)


def _is_dead(writer: re.Match[str], path: Path) -> bool:
    computer, boot, pid, started = writer.groups()
    if computer != _computer():
        try:
            return time.time() - path.stat().st_mtime > GIVEN_UP_S
        except FileNotFoundError:
            return False
    return boot != _boot() or not _lives(int(pid), int(started))


@cache
def _computer() -> str:
    """Six letters for this computer and, where processes are counted apart, for the container in it."""
    try:
        counted = os.readlink("/proc/self/ns/pid")
    except OSError:
        counted = ""
    return hashlib.sha256(f"{os.uname().nodename}\0{counted}".encode()).hexdigest()[:6]


@cache
def _boot() -> str:
    """Six letters that change when the computer starts anew."""
    try:
        which = Path("/proc/sys/kernel/random/boot_id").read_bytes()
    except OSError:
        which = b""
    return hashlib.sha256(which).hexdigest()[:6]


def _lives(pid: int, started: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # somebody else's
    state, own = _stat(pid)
    return state not in ("Z", "X") and own in (0, started)


def _stat(pid: int) -> tuple[str, int]:
    """The state of a process and when it started, in ticks of the computer; 0 where that does not tell."""
    try:
        state, *fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return "", 0
    return state, int(fields[18])
