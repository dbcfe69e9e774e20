"""Room on a disk and memory, each really short: one sentence, exit code 1, nothing half-written."""

import errno
import re
import resource
import shutil
import subprocess
import sys

import numpy as np
import pytest

from dior import shortage
from tests.cases import slow
from tests.end_to_end.workflow import ROOT

SETTINGS = '{"duration_s": 1, "width": 320, "height": 180, "fx": 160.0}'
SIMULATE = ["simulate", "--settings", SETTINGS, "--sequence", "indoor_01", "--out"]
MOCAP = ["simulate_mocap", "--settings", '{"duration_s": 1}', "--sequence", "indoor_01", "--out"]


def run(words, limit=None, most=0, before="", within=()):
    """A command of `dior` in a process with a limit of resources: exit code and what it said."""
    limits = f"import resource; resource.setrlimit(resource.{limit}, ({most}, {most}))\n" if limit else ""
    code = f"import sys\n{before}\n{limits}from dior.cli.main import main\nsys.exit(main({list(map(str, words))!r}))"
    done = subprocess.run([*within, sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    return done.returncode, done.stderr


def files(folder):
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


@pytest.mark.slow
def test_a_file_that_may_not_become_so_large(tmp_path):
    code, said = run([*SIMULATE, tmp_path], "RLIMIT_FSIZE", 20_000)
    assert code == 1 and said.count("\n") == 1, said
    assert said.startswith(f"dior simulate: {tmp_path}/indoor_01/mlkit/cam01.jsonl: cannot be written: files may not ")
    assert "20.0 kB of about " in said and "limit of a file is 20.0 kB; raise it (`ulimit -f`)" in said
    assert files(tmp_path) == []


@pytest.mark.slow
def test_a_library_that_does_not_tell_that_it_could_not_write(tmp_path):
    """ezc3d leaves the beginning of a file, without a word."""
    code, said = run([*MOCAP, tmp_path], "RLIMIT_FSIZE", 3000)
    assert code == 1 and said.count("\n") == 1 and "mocap.c3d: cannot be written: files may not" in said, said
    assert files(tmp_path) == []


@pytest.mark.slow
def test_a_film_that_could_not_be_written_whole(tmp_path):
    before = (
        "import numpy as np; from pathlib import Path; from dior.report import clip\n"
        "from dior.project import init\n"
        f"film = np.random.default_rng(0).integers(0, 255, (20, 360, 640, 3), np.uint8)\n"
        f"init.run = lambda folder: clip._write(Path({str(tmp_path)!r}) / 'a.webm', film, (640, 360), 10.0, 'walk_1')\n"
        "init.run.__annotations__ = {'folder': Path}\n"
    )
    code, said = run(["init", "x"], "RLIMIT_FSIZE", 20_000, before)
    assert (
        code == 1 and "a.webm: cannot be written: files may not become so large: it takes more than 20.0 kB" in said
    ), said
    assert files(tmp_path) == []


@pytest.fixture
def full(tmp_path):
    """(a folder, what is before a command that sees a small disk there): a tmpfs in a namespace of its own."""
    (tmp_path / "disk").mkdir()
    mount = f'mount -t tmpfs -o size=100k tmpfs {tmp_path}/disk && exec "$@"'
    within = ["unshare", "-r", "-m", "sh", "-c", mount, "sh"]
    if not shutil.which("unshare") or subprocess.run([*within, "true"], capture_output=True).returncode:
        pytest.skip("a small disk cannot be mounted here (no user namespaces)")
    return tmp_path / "disk", within


@pytest.mark.slow
@pytest.mark.parametrize("words, most", [(SIMULATE, "100k"), (MOCAP, "4k")])
def test_a_full_disk(full, words, most):
    folder, within = full
    code, said = run([*words, folder], within=[word.replace("100k", most) for word in within])
    assert code == 1 and said.count("\n") == 1, said
    assert re.search(r"(mlkit/cam0\d.jsonl|mocap.c3d): cannot be written: the disk is full: [\d.]+ kB of about ", said)
    assert f"; left are 0 B in {folder}/indoor_01" in said and said.endswith("; make room there and run again\n")


WORK = {
    "np.ones(10**9)": "8.0 GB more are needed beside the ",
    "__import__('pyarrow').allocate_buffer(3 * 10**9)": "3.0 GB more are needed beside the ",
    "cv2.resize(np.zeros((9, 9), np.uint8), (50000, 50000))": "2.5 GB more are needed beside the ",
    "bytearray(10**10)": "the memory is short: more is needed than the ",
    '(_ for _ in ()).throw(RuntimeError("can\'t start new thread"))': "the memory is short: more is needed",
}


@pytest.mark.parametrize("work", [next(iter(WORK)), *(slow(one) for one in [*WORK][1:])])
def test_memory_that_is_short(work):
    before = (
        "import numpy as np, cv2; from pathlib import Path; from dior.project import init\n"
        f"def run(folder: Path): {work}\n"
        "init.run = run\n"
    )
    code, said = run(["init", "x"], "RLIMIT_AS", 2_000_000_000, before)
    assert code == 1 and said.count("\n") == 1 and said.startswith("dior init: the memory is short: "), said
    assert WORK[work] in said and "2.0 GB of address space" in said and "ulimit -v" in said
    if "beside" in said:
        assert " in all; " in said


@pytest.mark.slow
def test_a_step_without_enough_memory(tmp_path):
    """Whatever library it meets first, from the loading of libraries on; OpenBLAS alone speaks for itself."""
    code, said = run([*SIMULATE, tmp_path], "RLIMIT_AS", 420_000_000)
    assert code == 1 and files(tmp_path) == []
    assert said.startswith("dior simulate: the memory is short: ") or said.startswith("OpenBLAS error: Memory"), said


def test_what_is_told_without_a_limit():
    try:
        np.ones(2**50)
    except MemoryError as error:
        said = shortage.sentence(error)
    assert "9.2e" not in said and "TB more are needed beside" in said and said.count(";") == 1
    if resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY:
        assert "this computer has" in said or "cgroup" in said


def test_a_full_disk_of_which_the_error_tells_no_file(tmp_path):
    said = shortage.sentence(OSError(errno.ENOSPC, "No space left on device"))
    assert said.startswith("cannot write: the disk is full; left are ") and said.count("B in /") == 2
    said = shortage.sentence(OSError(errno.EDQUOT, "Disk quota exceeded", str(tmp_path / "a")))
    assert said == f"{tmp_path}/a: cannot be written: the quota on this disk is used up; make room there and run again"


def test_other_errors_are_not_about_room_or_memory():
    for error in (OSError(2, "No such file"), RuntimeError("memorable"), ValueError(), OSError("torn"), KeyError("a")):
        assert shortage.sentence(error) == "" and shortage.of_disk(error, "a", 1) == ""
    assert shortage.size(0) == "0 B" and shortage.size(999) == "999 B" and shortage.size(2.5e13) == "25.0 TB"


@pytest.mark.parametrize(
    "last", ["dior frames: walk.bag: is truncated", "ValueError: no", "numpy.exceptions.AxisError: 3"]
)
def test_a_log_that_says_why_is_quoted(last):
    assert shortage.last_words(f"frames 12\n{last}\n") == last


@pytest.mark.parametrize("log", ["", "\n", "indoor_01, cam01: warning: 3 pictures are lost\n"])
def test_a_job_that_was_killed_says_nothing_and_the_end_of_the_run_does(log):
    said = shortage.last_words(log)
    assert "ended without saying why, as a job does that the system kills because the memory is short; " in said
    assert said.startswith(log.strip()) and "fewer jobs at once" in said
