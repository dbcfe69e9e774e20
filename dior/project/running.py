"""One run at a time in a project folder, and who is at it.

OUTPUTS  .snakemake/run.lock: process, computer and beginning of the last run, which locks it while it lives;
         .snakemake/jobs.lock: locked, together, by the jobs that are at work
These are locks of the operating system on open files. They end with the process however that ends, so nobody has to
remove one, and what a killed run left of Snakemake's own lock counts for nothing. Where a system or a file system knows
no locks, only Snakemake's is left.
"""

import os
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

from dior.errors import DiorError
from dior.paths import AnyPath

RUN, JOBS = ".snakemake/run.lock", ".snakemake/jobs.lock"
# set for the jobs of a run; who types `dior <step>` holds nothing
OF_A_JOB = "DIOR_JOBS"
# locked until this process ends
_held: dict[Path, ExitStack] = {}


def begin(root: AnyPath) -> bool:
    """Hold the project folder `root` until this process ends.

    Returns whether nobody else can be at work: the last run was on this computer, whose locks are known to work.
    Raises DiorError where a run is at work, or jobs of one that was killed.
    """
    path = (Path(root) / RUN).absolute()
    if path in _held:
        return False
    path.parent.mkdir(exist_ok=True)
    with ExitStack() as open_files:
        stream = open_files.enter_context(open(path, "a+", encoding="utf-8"))
        try:
            if not locked(stream):
                raise DiorError(f"{_who(path)}; wait until it has ended, or end it there with `kill -INT <process>`")
            with open(Path(root) / JOBS, "a", encoding="utf-8") as jobs:
                if not locked(jobs):
                    raise DiorError(
                        "jobs of a run that was killed are still at work in this folder; wait until they have ended "
                        "(`pgrep -af dior` shows them)"
                    )
        except OSError:
            return False
        last = path.read_text(encoding="utf-8").split()
        stream.truncate(0)
        stream.write(f"{os.getpid()} {socket.gethostname()} {time.strftime('%Y-%m-%d %H:%M')}\n")
        stream.flush()
        _held[path] = open_files.pop_all()
    return last[1:2] == [socket.gethostname()]


def at_work(root: AnyPath) -> str:
    """A sentence that names the run that holds the project folder, "" where none does."""
    path = Path(root) / RUN
    if not path.exists():
        return ""
    try:
        # network file systems lock only what is open for writing
        with open(path, "a", encoding="utf-8") as stream:
            return "" if locked(stream) else _who(path)
    except OSError:
        # no locks here, or somebody else's folder
        return ""


@contextmanager
def job() -> Iterator[None]:
    """Count among the jobs at work, where a run has begun this process."""
    path = os.environ.get(OF_A_JOB)
    if path is None or not os.path.exists(path):
        yield
        return
    with open(path, "a", encoding="utf-8") as stream:
        try:
            locked(stream, together=True)
        except OSError:
            # no locks here
            pass
        yield


def locked(stream: IO[str] | int, together: bool = False) -> bool:
    """Whether a lock on an open file or folder was got, alone or `together` with others; another process may have it.
    OSError: no locks here."""
    try:
        import fcntl
    except ImportError:
        raise OSError("this system has no flock") from None
    try:
        fcntl.flock(stream, (fcntl.LOCK_SH if together else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _who(path: Path) -> str:
    words = path.read_text(encoding="utf-8").split(maxsplit=2)
    if len(words) < 3:
        return "another run is at work in this folder"
    process, computer, since = words
    return f"another run is at work in this folder: process {process} on {computer} since {since.strip()}"
