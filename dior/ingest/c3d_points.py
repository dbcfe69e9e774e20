"""The coordinates in a C3D file, read by ezc3d in a child process: on a damaged file ezc3d may crash, hang, or take
12 GB for 600 kB, and then only the child ends.

INPUTS   a path and the indices of the points.
OUTPUTS  their coordinates, in the file's unit; a ValueError says how the child ended.
The child is a fork (25 ms of CPU; an interpreter of its own takes 0.2 s) that only runs ezc3d and numpy's copying, so
that no lock of another thread holds it up.
"""

import contextlib
import faulthandler
import multiprocessing
import os
import resource
import signal
import warnings
from collections.abc import Sequence
from multiprocessing.connection import Connection

import numpy as np

from dior.arrays import AnyPath, Floats

# chosen: ten times what ezc3d takes for an ordinary file (0.14 s per MB), and three times its memory (4-22 bytes of it
# per byte, most where the numbers are integers)
SECONDS, SECONDS_PER_MB = 10, 1.5
MEMORY_MB, MEMORY_PER_MB = 256, 64


def read_points(path: AnyPath, index: Sequence[int]) -> Floats:
    """Coordinates (frames, points, 3) of the points `index`, in the file's unit, NaN where a point is missing.

    Raises ValueError where ezc3d refuses the file, crashes, or takes more than an ordinary file needs.
    """
    # loaded once, for all children
    import ezc3d  # noqa: F401

    megabytes = os.path.getsize(path) / 1e6
    seconds, memory = round(SECONDS + SECONDS_PER_MB * megabytes), round(MEMORY_MB + MEMORY_PER_MB * megabytes)
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_send, args=(theirs, str(path), list(index), seconds, memory), daemon=True)
    with warnings.catch_warnings():
        # Python 3.12 warns of any fork beside other threads; see the docstring
        warnings.simplefilter("ignore", DeprecationWarning)
        child.start()
    theirs.close()
    try:
        problem, shape = ours.recv()
        content = b"" if problem else ours.recv_bytes()
    except EOFError:
        problem, shape, content = "", (), b""
    child.join()
    if content:
        return np.frombuffer(content, np.float64).reshape(shape)
    if child.exitcode == -signal.SIGXCPU:
        problem = f"to read its {megabytes:.1f} MB takes ezc3d more than {seconds} s"
    if not problem or "bad_alloc" in problem:
        problem = f"ezc3d, which reads it, crashes, or needs more than {memory} MB for its {megabytes:.1f} MB"
    raise ValueError(problem)


def _send(answer: Connection, path: str, index: list[int], seconds: int, memory_mb: int) -> None:
    """In the child: send what is wrong, "" for nothing, and the shape; then the coordinates."""
    import ezc3d

    faulthandler.disable()
    _limit(seconds, memory_mb)
    try:
        points = ezc3d.c3d(path)["data"]["points"]
        found = np.ascontiguousarray(points[:3, index].transpose(2, 1, 0), np.float64)
    except MemoryError:
        answer.send(("bad_alloc", ()))
    except Exception as error:
        # whatever it is, the parent says it in one line
        answer.send(((str(error).splitlines() or [type(error).__name__])[0], ()))
    else:
        answer.send(("" if found.size else "ezc3d finds no frame in it", found.shape))
        if found.size:
            answer.send_bytes(found.data.cast("B"))


def _limit(seconds: int, memory_mb: int) -> None:
    """Limit this process to CPU seconds from its start and to MB above what it has; no core dump."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    # the second number kills without a reason
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, most) if most < 0 or most > seconds else (most, most))
    # macOS has neither /proc nor a working RLIMIT_AS; the limit of time holds there
    with contextlib.suppress(OSError, ValueError):
        with open("/proc/self/statm", encoding="ascii") as stream:
            pages = int(stream.read().split()[0])
        limit = pages * resource.getpagesize() + memory_mb * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
