"""How runs fail: whatever it is, the last line on the terminal says the reason and what to do.

`dior run` on recordings of one's own, with the default profile and no terminal. The first run of each project is the
one that fails, up to the step that notices.
"""

import functools
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

import psutil
import pytest

from dior.simulate import config, settings, simulate, simulate_mocap
from tests.end_to_end.workflow import ENVIRONMENT, edit

SETTINGS = {"subjects": 1, "sequences": 1, "duration_s": 1.0, "width": 320, "height": 180, "fx": 160.0}
LENS = """[cam02]
name = "cam02"
size = [1920.0, 1080.0]
matrix = [[960.0, 0.0, 960.0], [0.0, 960.0, 540.0], [0.0, 0.0, 1.0]]
distortions = [0.0, 0.0, 0.0, 0.0]
rotation = [0.0, 0.0, 0.0]
translation = [0.0, 0.0, 0.0]
fisheye = false
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A project with recordings of its own, in data/, and nothing made of them yet."""
    folder = tmp_path_factory.mktemp("recorded")
    config.write(settings.from_dict(SETTINGS), folder / "config")
    path = folder / "config/config.yaml"
    path.write_text(path.read_text().split("\n# The capture is simulated.")[0] + "\n")
    edit(path, "data_root: results/simulate", "data_root: data")
    for walk in ("indoor_01", "outdoor_01"):
        simulate.run(settings=SETTINGS, sequence=walk, out=folder / "data")
    simulate_mocap.run(settings=SETTINGS, sequence="indoor_01", out=folder / "data")
    return folder


@pytest.fixture
def own(recorded, tmp_path):
    """A copy of it, to be broken."""
    return shutil.copytree(recorded, tmp_path / "own")


def begin(project, *words, **kwargs):
    command = [sys.executable, "-m", "dior", "run", project, "-j2", *words]
    return subprocess.Popen(
        list(map(str, command)), cwd=project.parent, env=ENVIRONMENT, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **kwargs,
    )  # fmt: skip


def last_line(project, *words, **kwargs):
    """Of a run that fails; nothing in what it prints is a traceback."""
    running = begin(project, *words, **kwargs)
    text = running.communicate()[1]
    assert running.returncode == 1 and "Traceback" not in text, text
    return text.strip().splitlines()[-1]


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def missing_bag(own):
    (own / "data/indoor_01/pc2.bag").unlink()


def wrong_topic(own):
    edit(own / "config/sessions/lab/cam02.yaml", "topic: /cam02/color/", "topic: /cam02/colour/")


def broken_yaml(own):
    edit(own / "config/sessions/lab/cam02.yaml", "role: close", "role: [close")


def truncated_c3d(own):
    cut(own / "data/indoor_01/mocap.c3d")


def wrong_marks(own):
    edit(own / "config/sessions/lab/cam02.marks.csv", ",LFHD,", ",LFHED,")


def no_consent(own):
    edit(own / "config/subjects.tsv", "\tyes\tyes", "\tno\tno")


def wrong_intrinsics(own):
    (own / "data/lens.toml").write_text(LENS)
    lens = "intrinsics: {file: lens.toml, name: cam02}"
    edit(own / "config/sessions/lab/cam02.yaml", "intrinsics: camera_info", lens)


BROKEN = {
    missing_bag: ("frames/indoor_01", "logs/frames/indoor_01.log: dior frames: data/indoor_01/pc2.bag: .*no such"),
    wrong_topic: ("frames/indoor_01", "dior frames: .*/cam02/colour/.*; .*/cam02/color/image_raw/compressed"),
    broken_yaml: ("frames/indoor_01", "config/sessions/lab/cam02.yaml line .*not valid YAML .*; check the indentation"),
    truncated_c3d: ("mocap/indoor_01", "dior mocap: data/indoor_01/mocap.c3d: .*(cut|truncated|copy)"),
    wrong_marks: ("locate/lab/cam02", "config/sessions/lab/cam02.marks.csv.*LFHED.*did you mean 'LFHD'"),
    no_consent: ("frames/indoor_01", "config/subjects.tsv: nobody agreed to be processed.*consent_processing is yes"),
    wrong_intrinsics: ("intrinsics/lab/cam02", "dior intrinsics: .* cam02 .*320x180 .*1920x1080; use the intrinsics"),
}


@pytest.mark.slow
@pytest.mark.parametrize("breaking", BROKEN)
def test_the_last_line_is_the_reason_and_the_fix(breaking, own):
    breaking(own)
    target, said = BROKEN[breaking]
    assert re.search(said, last := last_line(own, f"results/{target}.parquet")), last


@pytest.mark.slow
def test_every_key_of_the_config_may_be_left_out_but_for_a_release(own):
    """An empty config.yaml plans the labels; a release lacks its licence, which is said before anything runs."""
    (own / "config/config.yaml").write_text("")
    running = begin(own, "-n")
    text = running.communicate()[1]
    assert running.returncode == 0 and re.search(r"reproject +2", text), text
    assert "'release.license' is not given" in last_line(own, "release", "-n")


@pytest.mark.slow
def test_the_last_line_of_a_full_disk(own):
    """Files may not become as large as the table of the motion capture."""
    snug = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))}
    last = last_line(own, "results/mocap/indoor_01.parquet", **snug)
    assert re.search(r"dior mocap: results/mocap/.*files may not become so large.*run again", last), last


@pytest.mark.slow
def test_the_last_line_of_a_job_that_was_killed(own):
    running = begin(own, "results/frames/indoor_01.parquet")
    jobs = []
    while not jobs and running.poll() is None:
        time.sleep(0.02)
        processes = psutil.Process(running.pid).children(recursive=True)
        # the command of the step itself, by the interpreter of its script
        jobs = [one for one in processes if words(one)[2:3] == ["frames"]]
    for job in jobs:
        job.send_signal(signal.SIGKILL)
    text = running.communicate()[1]
    last = text.strip().splitlines()[-1]
    assert running.returncode == 1 and "logs/frames/indoor_01.log: ended without saying why" in last, text
    assert "memory" in last


@pytest.mark.slow
def test_the_last_line_of_a_run_that_is_ended_by_hand(own):
    """As Ctrl-C does: it goes to Snakemake and all that it has started.

    What a shell has started in the background, such as these tests, leaves SIGINT to nobody that it starts.
    """
    hearing = functools.partial(signal.signal, signal.SIGINT, signal.default_int_handler)
    running = begin(own, "--until", "intrinsics", start_new_session=True, preexec_fn=hearing)
    while not (own / "logs/frames/indoor_01.log").exists() and running.poll() is None:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)
    text = running.communicate()[1]
    assert running.returncode == 1, text
    assert text.strip().splitlines()[-1] == "The run was ended before all was done; type the same line again to go on"


def words(process):
    try:
        return process.cmdline()
    except psutil.Error:
        return []


@pytest.mark.slow
def test_the_last_lines_where_others_go_on(own):
    """Each failure has a line; the other walk is labelled."""
    cut(next((own / "data/indoor_01").glob("mlkit/*")))
    (own / "data/indoor_01/pc1.bag").rename(own / "data/indoor_01/pc3.bag")
    cut(next((own / "data/outdoor_01").glob("mlkit/*")))
    running = begin(own, "--keep-going", "--until", "detections")
    text = running.communicate()[1]
    lines = text.strip().splitlines()
    assert running.returncode == 1
    logs = {line.split(":")[0] for line in lines[-2:]}
    assert logs == {"logs/frames/indoor_01.log", "logs/detections/outdoor_01.log"}
