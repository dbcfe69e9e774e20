"""The workflow, run from the pages: `dior run` as one would type it, and what it says."""

import re
import signal
import subprocess
import sys
import threading
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from dior.errors import DiorError
from dior.project import running

# chosen: lines of a run that are kept to be shown
KEPT = 400
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
    """At most one run at a time. One that is at work when the studio ends goes on."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._lines: deque[str] = deque(maxlen=KEPT)
        self._logs: set[Path] = set()
        self._dry = False
        self._lock = threading.Lock()

    def begin(self, *words: str) -> None:
        """Begin `dior run . <words>`. Raises DiorError where a run is at work."""
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                raise DiorError("a run is at work already; wait for it, or end it")
            # a dry run may look while another is at work
            self._dry = "-n" in words
            if not self._dry and (told := running.at_work(".")):
                raise DiorError(told)
            self._lines.clear()
            self._logs = set(LOGS.glob("*.log"))
            self._process = subprocess.Popen(
                [sys.executable, "-m", "dior", "run", ".", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL, text=True, errors="replace", start_new_session=True,
            )  # fmt: skip
            threading.Thread(target=self._hear, args=(self._process,), daemon=True).start()

    def end(self) -> None:
        """End the run as Ctrl-C does: what is half made is made again by the next."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                raise DiorError("no run of this page is at work")
            self._process.send_signal(signal.SIGINT)

    def told(self) -> Told:
        """How it goes."""
        process = self._process
        if process is None:
            return Told("none", 0, 0, (), False)
        code = process.poll()
        state = "running" if code is None else "done" if code == 0 else "failed"
        done, total = (0, 0) if self._dry else self._steps()
        return Told(state, done, total, tuple(self._lines), self._dry)

    def _steps(self) -> tuple[int, int]:
        new = sorted(set(LOGS.glob("*.log")) - self._logs)
        found = STEPS.findall(new[-1].read_bytes()) if new else []
        return (int(found[-1][0]), int(found[-1][1])) if found else (0, 0)

    def _hear(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip():
                self._lines.append(line.rstrip())
        process.wait()
