"""What is short when a step cannot go on: room on a disk or memory, how much there is and about how much it takes.

The functions of an error return "" where it is about neither. Imports nothing but the standard library, since where
memory is short nothing more can be loaded; asks the system as far as it tells (Linux: /proc and cgroups) and leaves out
what it does not.
"""

import errno
import math
import os
import re
import resource
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from dior.paths import AnyPath

_FULL = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the quota on this disk is used up",
    errno.EFBIG: "files may not become so large",
}
# what libraries say of memory in errors that are no MemoryError: OpenCV, threads, C++, the loader of libraries
_NO_MEMORY = re.compile(
    r"Insufficient memory|Cannot allocate memory|can't start new thread|bad_alloc|failed to map segment|out of memory",
    re.IGNORECASE,
)
# how much was asked for: OpenCV, Arrow
_ASKED = re.compile(r"(?:allocate|of size) (\d+)")
# how a line begins that says why: one of dior, or the last of a traceback
_REASON = re.compile(r"dior \S+: |\w[\w.]*(Error|Exception|Interrupt|Exit)\b")
_GROUPS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def size(count: float) -> str:
    """A number of bytes as people say it.

    >>> size(0), size(1536), size(7.25e9)
    ('0 B', '1.5 kB', '7.2 GB')
    """
    if count < 1000:
        return f"{count:.0f} B"
    power = min(int(math.log10(count) / 3), 4)
    return f"{count / 1000**power:.1f} {('kB', 'MB', 'GB', 'TB')[power - 1]}"


def of_disk(error: BaseException, path: AnyPath, written: int, needed: int | None = None) -> str:
    """What to say where writing `path` failed after `written` bytes (which are deleted) of about `needed`."""
    if not isinstance(error, OSError) or error.errno not in _FULL:
        return ""
    done = f"it takes more than {size(written)}"
    if needed and needed > written:
        done = f"{size(written)} of about {size(needed)} were written"
    return f"{path}: cannot be written: {_FULL[error.errno]}: {done}{_room(error, [path])}"


def _room(error: OSError, paths: Sequence[AnyPath]) -> str:
    """How much room there is, and what to do."""
    if error.errno == errno.EFBIG:
        limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
        known = f", and the limit of a file is {size(limit)}" if limit != resource.RLIM_INFINITY else ""
        return f"{known}; raise it (`ulimit -f`), or take another disk, and run again"
    if error.errno != errno.ENOSPC:
        return "; make room there and run again"
    left = [f"{size(shutil.disk_usage(folder).free)} in {folder}" for folder in map(_folder, paths)]
    return f"; left are {' and '.join(left)}; make room there and run again"


def _folder(path: AnyPath) -> Path:
    """The nearest folder that is there."""
    whole = Path(os.path.abspath(path))
    return next((one for one in (whole, *whole.parents) if one.is_dir()), Path("/"))


def sentence(error: BaseException) -> str:
    """What to say of an error that ended a step, "" where nothing was short."""
    if isinstance(error, OSError) and error.errno in _FULL:
        known = isinstance(error.filename, str)
        places = [error.filename] if known else [os.getcwd(), tempfile.gettempdir()]
        what = f"{error.filename}: cannot be written" if known else "cannot write"
        return f"{what}: {_FULL[error.errno]}{_room(error, places)}"
    short = isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
    return of_memory(error) if short or _NO_MEMORY.search(str(error)) else ""


def last_words(log: str) -> str:
    """Why a job failed, by the last line of its log; of one that was killed, which cannot say so, that it probably was.

    >>> last_words("reading\\ndior frames: walk.bag: is truncated\\n")
    'dior frames: walk.bag: is truncated'
    """
    last = (log.strip().splitlines() or [""])[-1]
    if _REASON.match(last):
        return last
    return (
        f"{last}{'; ' if last else ''}ended without saying why, as a job does that the system kills because the memory "
        f"is short; {_limit()}"
    )


def of_memory(error: BaseException) -> str:
    """What to say where memory was short: how much was asked for, how much the process has and may have."""
    limited = resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
    asked, used = _asked(error), _status("VmPeak" if limited else "VmHWM")
    more = f"{size(asked)} more are needed" if asked else "more is needed"
    beside = f" than the {size(used)} that this step has used" if used else ""
    if asked and used:
        beside = f" beside the {size(used)} that this step uses, {size(asked + used)} in all"
    return f"the memory is short: {more}{beside}; {_limit()}"


def _asked(error: BaseException) -> int:
    """Bytes that could not be had, 0 where the error does not say."""
    total = getattr(error, "_total_size", 0)  # numpy's
    found = _ASKED.search(str(error))
    return int(total) or (int(found[1]) if found else 0)


def _limit() -> str:
    """How much there may be, and what to do."""
    soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    if soft != resource.RLIM_INFINITY:
        return f"a process may take {size(soft)} of address space here (`ulimit -v`): raise that and run again"
    total, free, group = _meminfo("MemTotal"), _meminfo("MemAvailable"), _group()
    if group and group < total:
        return f"the job may take {size(group)} (its cgroup, for example of Slurm): give it more and run again"
    has = f"this computer has {size(total)}, of which {size(free)} are free: " if total else ""
    return f"{has}end other programs, run fewer jobs at once (`snakemake -j1`), or take a computer with more memory"


def free_memory() -> int:
    """Bytes of memory that programs may still take, by the system and by the cgroup; 0 where it does not tell."""
    known = [count for count in (_meminfo("MemAvailable"), _group()) if count]
    return min(known, default=0)


def _status(key: str) -> int:
    return _kilobytes(Path("/proc/self/status"), key)


def _meminfo(key: str) -> int:
    return _kilobytes(Path("/proc/meminfo"), key)


def _kilobytes(path: Path, key: str) -> int:
    """Bytes of a `key: n kB` line; 0 where there is none."""
    try:
        found = re.search(rf"^{key}:\s+(\d+) kB", path.read_text(), re.MULTILINE)
    except OSError:
        return 0
    return int(found[1]) * 1024 if found else 0


def _group() -> int:
    """The most memory that the cgroup may have; 0 where nothing limits it."""
    for path in _GROUPS:
        try:
            text = Path(path).read_text().strip()
        except OSError:
            continue
        return int(text) if text.isdigit() else 0
    return 0
