"""How the studio ends, by Ctrl-C, by the system and where the line is cut: with all that it has begun, and at once."""

import os
import signal
import socket
import stat
import subprocess
import sys
import time
from contextlib import suppress

import numpy as np
import psutil
import pytest

from dior.studio import runs
from tests.check import recorded
from tests.ingest import bagfiles

# a run that has begun a job; what is sent to it alone does not reach the job
AT_WORK = "#!/bin/sh\necho a line\necho 3 words of it\nsleep 100\n"


@pytest.fixture
def at_work(project, monkeypatch):
    """The runs of the pages, of which one is at work, and its job."""
    # tests that a shell began in the background ignore it, and so would what they begin; the studio does not
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    program = project / "program"
    program.write_text(AT_WORK)
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(runs.sys, "executable", str(program))
    found = runs.Runs()
    found.begin()
    yield found, until(lambda: psutil.Process(found._process.pid).children())[0]
    found.close()
    signal.signal(signal.SIGINT, before)


def until(told):
    for _ in range(400):
        if answer := told():
            return answer
        time.sleep(0.025)
    raise AssertionError("nothing has come")


def gone(process):
    with suppress(psutil.NoSuchProcess):
        return process.status() == psutil.STATUS_ZOMBIE
    return True


def test_who_ends_a_run_ends_its_jobs(at_work):
    found, job = at_work
    assert found.told().state == "running" and found.told().lines[1] == "3 words of it"
    found.end()
    until(lambda: gone(job) and found.told().state == "failed")


def test_a_run_ends_with_the_studio(at_work, monkeypatch):
    found, job = at_work
    assert found.close()
    until(lambda: gone(job))
    assert not found.close()


def test_of_a_long_run_the_last_lines_are_told(at_work, monkeypatch):
    found, _ = at_work
    monkeypatch.setattr(runs, "KEPT_BYTES", 20)
    assert found.told().lines == ("3 words of it",)


def test_a_check_is_a_process_of_its_own_and_says_why_it_told_nothing(client, monkeypatch, project):
    program = project / "program"
    program.write_text("#!/bin/sh\necho dior check: no such thing >&2\nexit 1\n")
    program.chmod(0o700)
    monkeypatch.setattr(runs.sys, "executable", str(program))
    answer = client.get("/api/check")
    assert answer.status_code == 422 and answer.json()["error"].endswith("dior check: no such thing")


@pytest.mark.parametrize(
    "ending", [signal.SIGTERM, *(pytest.param(one, marks=pytest.mark.slow) for one in (signal.SIGINT, signal.SIGHUP))]
)
def test_a_signal_ends_the_studio_also_where_somebody_has_stopped_to_read(project, tmp_path, ending):
    """Nothing is left of it: no folder, no lock."""
    if signal.getsignal(ending) is signal.SIG_IGN and ending == signal.SIGHUP:
        pytest.skip("`nohup` began these tests, and keeps SIGHUP from all that they begin")
    noise = np.random.default_rng(0).integers(0, 255, (900, 1200, 3), np.uint8)
    large = [
        bagfiles.packed(recorded.LAB, bagfiles.T0 + i * recorded.STEP, noise) for i in range(2)
    ]  # fmt: skip
    (project / "data/in_1/a.bag").unlink()
    bagfiles.write(project / "data/in_1/a", large, "ros1")
    kept = tmp_path / "kept"
    kept.mkdir()
    command = [sys.executable, "-m", "dior", "studio", str(project)]
    environment = os.environ | {"TMPDIR": str(kept)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    ) as studio:
        address, token = studio.stdout.readline().split()[1].split("/?token=")
        port = int(address.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port)) as slow:
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            wanted = "/picture?walk=in_1&camera=cam01&frame=1"
            cookie = f"Cookie: dior_studio_{port}={token}"
            slow.sendall(f"GET {wanted} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{cookie}\r\n\r\n".encode())
            assert slow.recv(15) == b"HTTP/1.1 200 OK"
            assert any(kept.iterdir())
            studio.send_signal(ending)
            try:
                rest = studio.communicate(timeout=60)[0]
            finally:
                studio.kill()
    assert studio.returncode == 128 + ending
    # what has been read with the first line is no more in it
    assert rest.strip() in ("", "Ctrl-C ends it.")
    assert [*kept.iterdir()] == []
