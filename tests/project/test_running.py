"""One run at a time in a folder; the lock ends with the process, and names it."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

from dior.errors import DiorError
from dior.project import running
from tests.end_to_end.workflow import ROOT

HOLDS = "from dior.project import running; running.begin('.'); print('holds', flush=True); import time; time.sleep(60)"
WORKS = "from dior.project import running\nwith running.job(): print('works', flush=True); import time; time.sleep(60)"


@pytest.fixture
def started(tmp_path):
    """A function that starts Python in the folder; what it started is killed in the end."""
    begun = []

    def start(text):
        environment = os.environ | {"PYTHONPATH": str(ROOT), running.OF_A_JOB: running.JOBS}
        process = subprocess.Popen(
            [sys.executable, "-c", text], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
        )
        begun.append(process)
        process.stdout.readline()
        return process

    yield start
    for process in begun:
        process.kill()
        process.wait()
        process.stdout.close()


def ended(process):
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.fixture
def let_go():
    """What this process holds ends with the test."""
    yield
    for stream in running._held.values():
        stream.close()
    running._held.clear()


def test_the_second_says_who_is_running_and_since_when(tmp_path, started, let_go):
    assert running.at_work(tmp_path) == ""
    first = started(HOLDS)
    who = f"process {first.pid} on {socket.gethostname()} since {time.strftime('%Y-%m-%d')}"
    assert who in running.at_work(tmp_path)
    with pytest.raises(DiorError, match=f"another run is at work in this folder: {who} .*; wait until it has ended"):
        running.begin(tmp_path)
    ended(first)
    assert running.at_work(tmp_path) == ""
    assert running.begin(tmp_path) is True


def test_a_lock_of_another_computer_may_be_alive(tmp_path, let_go):
    """What it left of Snakemake's own lock is not removed."""
    (tmp_path / ".snakemake").mkdir()
    (tmp_path / running.RUN).write_text("4711 elsewhere 2026-01-01 00:00\n")
    assert running.begin(tmp_path) is False
    assert (tmp_path / running.RUN).read_text().startswith(f"{os.getpid()} {socket.gethostname()} ")


def test_a_run_may_begin_more_than_once(tmp_path, let_go):
    running.begin(tmp_path)
    running.begin(tmp_path)


def test_jobs_that_outlived_their_run_are_waited_for(tmp_path, started, let_go):
    (tmp_path / ".snakemake").mkdir()
    (tmp_path / running.JOBS).touch()
    jobs = [started(WORKS), started(WORKS)]
    with pytest.raises(DiorError, match="jobs of a run that was killed are still at work in this folder"):
        running.begin(tmp_path)
    for job in jobs:
        ended(job)
    running.begin(tmp_path)


def test_a_step_that_a_person_types_holds_nothing(tmp_path, monkeypatch):
    monkeypatch.delenv(running.OF_A_JOB, raising=False)
    monkeypatch.chdir(tmp_path)
    with running.job():
        assert list(tmp_path.iterdir()) == []
