"""What the pages run as one would type it: `dior run`, and what it says; `dior check`.

They are processes of their own, in groups of their own: what is sent to one reaches the jobs that it has begun, and a
check forks, which a server with threads and open connections must not.
"""

import json
import os
import re
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from dior.errors import DiorError
from dior.project import running

# chosen: lines of a run that are shown, and the bytes that they are looked for in
KEPT, KEPT_BYTES = 400, 1 << 16
# chosen: a job that is ended takes away what it has half written, in a second or two
PATIENCE_S = 20.0
# what Snakemake's log says after each job
STEPS = re.compile(rb"(\d+) of (\d+) steps")
LOGS = Path(".snakemake/log")


@dataclass(frozen=True)
class Told:
    """Of the last run: `state` none, running, done or failed; of its steps `done` and `total`, 0 while that is not
    known; `lines`: what it has said; `dry`: it only tells what would run."""

    state: str
    done: int
    total: int
    lines: tuple[str, ...]
    dry: bool


class Runs:
    """At most one run at a time, which ends with the studio; and checks."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._said: IO[bytes] | None = None
        self._logs: set[Path] = set()
        self._dry = False
        self._lock, self._one_check = threading.Lock(), threading.Lock()
        self._checking: subprocess.Popen[str] | None = None

    def begin(self, *words: str) -> None:
        """Begin `dior run . <words>`. Raises DiorError where a run is at work."""
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                raise DiorError("a run is at work already; wait for it, or end it")
            # a dry run may look while another is at work
            self._dry = "-n" in words
            if not self._dry and (told := running.at_work(".")):
                raise DiorError(told)
            self._logs = set(LOGS.glob("*.log"))
            if self._said is not None:
                self._said.close()
            # no pipe: where the studio is killed, nobody would read it, and Snakemake waits without end
            self._said = TemporaryFile()
            self._process = subprocess.Popen(
                [sys.executable, "-m", "dior", "run", ".", *words], stdout=self._said, stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip

    def end(self) -> None:
        """End the run as Ctrl-C does: what is half made is made again by the next."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                raise DiorError("no run of this page is at work")
            _send(self._process, signal.SIGINT)

    def told(self) -> Told:
        """How it goes."""
        process = self._process
        if process is None:
            return Told("none", 0, 0, (), False)
        code = process.poll()
        state = "running" if code is None else "done" if code == 0 else "failed"
        done, total = (0, 0) if self._dry else self._steps()
        return Told(state, done, total, self._lines(), self._dry)

    def check(self) -> dict[str, Any]:
        """What `dior check` tells as JSON. Raises DiorError where it tells nothing."""
        with self._one_check:
            self._checking = process = subprocess.Popen(
                [sys.executable, "-m", "dior", "check", ".", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                stdin=subprocess.DEVNULL, text=True, errors="replace", start_new_session=True,
            )  # fmt: skip
            said, error = process.communicate()
        try:
            found: dict[str, Any] = json.loads(said)
        except ValueError:
            why = (error.strip().splitlines() or [f"exit code {process.returncode}"])[-1]
            raise DiorError(f"`dior check` has told nothing: {why}") from None
        return found

    def close(self) -> bool:
        """End what is at work, and wait until it has; whether that was a run."""
        if self._checking is not None and self._checking.poll() is None:
            # it writes nothing
            _send(self._checking, signal.SIGKILL)
        with suppress(DiorError):
            self.end()
            assert self._process is not None
            try:
                self._process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                _send(self._process, signal.SIGKILL)
            return not self._dry
        return False

    def _steps(self) -> tuple[int, int]:
        new = sorted(set(LOGS.glob("*.log")) - self._logs)
        found = STEPS.findall(new[-1].read_bytes()) if new else []
        return (int(found[-1][0]), int(found[-1][1])) if found else (0, 0)

    def _lines(self) -> tuple[str, ...]:
        with self._lock:
            assert self._said is not None
            # where the run writes stays where it is
            end = os.fstat(self._said.fileno()).st_size
            said = os.pread(self._said.fileno(), KEPT_BYTES, max(end - KEPT_BYTES, 0))
        lines = said.decode(errors="replace").splitlines()
        # the first may be cut
        lines = lines[1:] if end > KEPT_BYTES else lines
        return tuple([line.rstrip() for line in lines if line.strip()][-KEPT:])


def _send(process: "subprocess.Popen[Any]", what: signal.Signals) -> None:
    """To a process and all that it has begun."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, what)
