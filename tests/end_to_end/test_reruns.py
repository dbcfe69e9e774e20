"""What runs again, and what does not: a capture of recordings that no rule makes, as a lab has them.

A step that failed fails again until it is mended; what was replaced is noticed whatever its time; what was touched,
copied or moved runs nothing; what was deleted is made again; two runs do not work in one folder.
"""

import csv
import os
import shutil
import signal
import socket
import time

import pytest

from dior.cli import main
from dior.project import replaced, running
from dior.simulate import config, settings, simulate, simulate_mocap
from tests.end_to_end.results import contents
from tests.end_to_end.workflow import ROOT, edit, planned, snakemake, start
from tests.project.test_replaced import flip

SMALL = {"subjects": 1, "sequences": 1, "duration_s": 3.0, "width": 640, "height": 360, "fx": 320.0}
DATA = "recordings"
OUTDOOR, INDOOR = f"{DATA}/outdoor_01", f"{DATA}/indoor_01"
LAB, FIELD = "config/sessions/lab", "config/sessions/field"


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A finished run with a release, and with a file of each kind that a person may write."""
    folder = tmp_path_factory.mktemp("recorded") / "gait"
    config.write(settings.from_dict(SMALL), folder / "config")
    for walk in ("indoor_01", "outdoor_01"):
        simulate.run(settings=SMALL, sequence=walk, out=folder / DATA)
    simulate_mocap.run(settings=SMALL, sequence="indoor_01", out=folder / DATA)
    path = folder / "config/config.yaml"
    text = path.read_text().split("\n# The capture is simulated.")[0] + "\n"
    text = text.replace("data_root: results/simulate", f"data_root: {DATA}")
    path.write_text(text.replace("clip_seconds: 4.0", "clip_seconds: 0.5"))
    for name, text in {
        "offsets/indoor_01.yaml": "cam03: {offset_s: 0.010, drift_ppm: 0.0, sigma_s: 0.005}\n",
        "checks/outdoor_01.cam01.csv": "sequence,frame,joint,u,v\noutdoor_01,30,nose,320.5,100.5\n",
        "detectors.tsv": "sequence\tcamera\ttool\tzoom\tpath\noutdoor_01\tcam04\tyolo\t1\toutdoor_01/yolo.json\n",
        "effort.tsv": "what\tminutes\nclicking marks\t30\n",
        "markers.tsv": "name\tmarker\nhip 7\tLASI\n",
    }.items():
        (folder / "config" / name).parent.mkdir(exist_ok=True)
        (folder / "config" / name).write_text(text)
    (folder / OUTDOOR / "yolo.json").write_text("[]\n")
    snakemake(folder, "all", "release")
    return folder


def gone(path):
    path.unlink()


def cut(path):
    """As a full disk leaves it."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def replaced_by(old, new):
    return lambda path: edit(path, old, new)


def bad_number(path):
    """The last number of the last line is none."""
    path.write_text(path.read_text().rstrip("\n").rpartition(",")[0] + ",12o.5\n")


def bad_marker(path):
    """A marker that no C3D has."""
    lines = path.read_text().splitlines()
    cells = lines[1].split(",")
    lines[1] = ",".join([*cells[:2], f"{cells[2]}X", *cells[3:]])
    path.write_text("\n".join(lines) + "\n")


# target; what is broken, how, and the steps that say so. Each breaks another part, as what follows a failure waits
BROKEN = {
    "bag cut, C3D gone": ("all", {
        f"{OUTDOOR}/pc2.bag": (cut, "frames/outdoor_01"),
        f"{INDOOR}/mocap.c3d": (gone, "mocap/indoor_01", "provenance/indoor_01"),
    }),
    "bag gone, detections cut": ("release", {
        f"{INDOOR}/pc1.bag": (gone, "frames/indoor_01", "provenance/indoor_01"),
        f"{OUTDOOR}/mlkit/cam02.jsonl": (cut, "detections/outdoor_01"),
    }),
    "marks, boxes": ("report", {
        f"{LAB}/cam01.marks.csv": (bad_marker, "locate/lab.cam01"),
        f"{LAB}/cam02.marks.csv": (bad_number, "locate/lab.cam02"),
        "config/boxes/outdoor_01.cam04.csv": (bad_number, "align/field.cam04"),
    }),
    "C3D cut, checks, another detector's file gone": ("report", {
        f"{INDOOR}/mocap.c3d": (cut, "mocap/indoor_01"),
        "config/checks/outdoor_01.cam01.csv": (bad_number, "evaluate/outdoor_01"),
        f"{OUTDOOR}/yolo.json": (gone, "detectors/outdoor_01"),
    }),
    "somebody's target": ("subject_S01", {
        f"{LAB}/cam01.marks.csv": (bad_marker, "locate/lab.cam01"),
        "config/checks/outdoor_01.cam01.csv": (bad_number, "evaluate/outdoor_01"),
    }),
}  # fmt: skip


def said(text):
    """The last line of each log of a job that failed, as a run ends with them."""
    return {line.split(".log: ")[0].removeprefix("logs/"): line for line in text.splitlines() if ".log: dior " in line}


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN)
def test_what_failed_fails_again_until_it_is_mended(project, copy, name):
    target, broken = BROKEN[name]
    with open(copy / "config/subjects.tsv", newline="") as sheet:
        pseudonyms = {row["subject"]: row["pseudonym"] for row in csv.DictReader(sheet, delimiter="\t")}
    target = target.replace("S01", pseudonyms["S01"])
    for path, (how, *_) in broken.items():
        how(copy / path)
    ends = [snakemake(copy, target, "--keep-going", check=False) for _ in range(2)]
    assert [code for code, _ in ends] == [1, 1]
    first, second = (said(text) for _, text in ends)
    assert first == second and first.keys() == {step for _, *steps in broken.values() for step in steps}
    assert "Traceback" not in ends[1][1]
    assert "results/report/index.html is still that of an earlier run" in ends[1][1]
    for path in broken:
        shutil.copy(project / path, copy / path)
    snakemake(copy, target)
    snakemake(copy, "all", "release")
    assert contents(copy) == contents(project)
    assert planned(copy, "all", "release") == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "how"),
    [
        ("config/offsets/indoor_01.yaml", replaced_by("0.010", "soon")),
        (f"{FIELD}/cam01.yaml", replaced_by("role: close", "role: near")),
        (f"{FIELD}/session.yaml", replaced_by("cameras:", "camera:")),
        ("config/sequences.tsv", replaced_by("\tlab\t", "\tlap\t")),
    ],
)
def test_what_is_read_before_the_first_step_is_wrong_at_every_run(project, copy, file, how):
    how(copy / file)
    for _ in range(2):
        code, text = snakemake(copy, check=False)
        assert code == 1 and file in text and "Traceback" not in text
    shutil.copy(project / file, copy / file)
    assert planned(copy, "all", "release") == {}


# the rules that read a file themselves, by what is changed in it: a byte in the middle of the text or at one end
READ_BY = {
    f"{OUTDOOR}/pc1.bag": {"frames", "audit", "overlays", "clip", "viewer", "pixels", "provenance"},
    f"{INDOOR}/mocap.c3d": {"mocap", "provenance"},
    f"{OUTDOOR}/mlkit/cam02.jsonl": {"detections", "provenance"},
    f"{OUTDOOR}/yolo.json": {"detectors"},
    f"{LAB}/cam01.marks.csv": {"locate", "package"},
    f"{LAB}/cam01.yaml": {"locate", "package"},
    f"{FIELD}/cam01.yaml": {"place", "adjust", "package"},
    f"{FIELD}/cam04.yaml": {"align", "follow", "package"},
    f"{FIELD}/session.yaml": {"package"},
    "config/boxes/outdoor_01.cam04.csv": {"align", "follow", "evaluate", "overlays", "package"},
    "config/checks/outdoor_01.cam01.csv": {"evaluate", "package"},
    "config/offsets/indoor_01.yaml": {"locate", "clocks", "package"},
    "config/effort.tsv": {"report"},
    "config/markers.tsv": {"mocap"},
}


def of_same_length(path):
    """Change what is in a file but neither its length nor its times."""
    times = path.stat()
    if path.suffix in (".bag", ".c3d"):
        flip(path, -1)
    elif path.suffix in (".jsonl", ".json"):
        path.write_text(path.read_text()[:-1] + " ")
    else:
        # a comment, or the last digit of the last number
        text = path.read_text()
        at = max(i for i, letter in enumerate(text) if letter.isdigit())
        digit = text[:at] + str((int(text[at]) + 1) % 10) + text[at + 1 :]
        path.write_text(text.replace("# the", "# The", 1) if "# the" in text else digit)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert path.stat().st_size == times.st_size


@pytest.mark.slow
@pytest.mark.parametrize("file", READ_BY)
def test_what_was_replaced_is_noticed_whatever_its_time(copy, file):
    of_same_length(copy / file)
    assert READ_BY[file] <= planned(copy, "all", "release").keys()


@pytest.mark.slow
def test_the_middle_of_a_recording_is_looked_at_when_asked(copy, capsys):
    assert main.main(["verify", "--inputs", str(copy)]) == 0
    assert "12 recordings are what the labels were made from" in capsys.readouterr().out
    bag = copy / OUTDOOR / "pc1.bag"
    assert bag.stat().st_size > 3 * replaced.END
    flip(bag, bag.stat().st_size // 2)
    assert planned(copy, "all", "release") == {}
    assert main.main(["verify", "--inputs", str(copy)]) == 1
    out = capsys.readouterr().out
    assert out.startswith("outdoor_01, bag_1: ") and "pc1.bag is not what the labels were made from" in out
    for step in ("frames", "detections", "provenance"):
        for path in (copy / "results" / step).glob("outdoor_01.*"):
            path.unlink()
    assert {"frames", "detections", "provenance", "package"} <= planned(copy, "all", "release").keys()


def other_times(folder):
    """Times as a copy leaves them that keeps none: one after the other, in no order of how things were made."""
    begun = time.time() - 10_000
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and ".snakemake/log" not in str(path))
    for number, path in enumerate(paths):
        os.utime(path, (begun, begun + (number * 7919) % len(paths)), follow_symlinks=False)


@pytest.mark.slow
def test_a_copy_runs_nothing_again_wherever_it_and_its_recordings_are(copy, tmp_path):
    other_times(copy)
    assert planned(copy, "all", "release") == {}
    shutil.move(copy / DATA, tmp_path / "on another disk")
    edit(copy / "config/config.yaml", f"data_root: {DATA}", f"data_root: {tmp_path}/on another disk")
    assert planned(copy, "all", "release") == {}


@pytest.mark.slow
def test_nothing_that_is_made_tells_where_the_recordings_are(project, copy, tmp_path):
    shutil.move(copy / DATA, tmp_path / "elsewhere")
    edit(copy / "config/config.yaml", f"data_root: {DATA}", f"data_root: {tmp_path}/elsewhere")
    shutil.rmtree(copy / "results")
    snakemake(copy, "all", "release")
    assert contents(copy) == contents(project)


@pytest.mark.slow
def test_without_snakemakes_notes_times_tell_until_results_are_adopted(copy):
    shutil.rmtree(copy / ".snakemake")
    assert planned(copy, "all", "release") == {}
    other_times(copy)
    assert planned(copy, "all", "release")
    snakemake(copy, "--touch", "all", "release")
    assert planned(copy, "all", "release") == {}
    of_same_length(copy / LAB / "cam01.marks.csv")
    assert planned(copy, "all", "release")["locate"] == 1


@pytest.mark.slow
def test_what_is_deleted_is_made_again(project, copy):
    release = copy / "results/release/dior-0.1.0"
    lost = [
        next(release.glob("frames/*/outdoor_01.cam01.parquet")),
        next(release.glob("boxes/*/*.parquet")),
        release / "README.md",
        next(release.with_name("dior-0.1.0-exports").rglob("*.json")),
        release.with_name("dior-0.1.0-metadata.tar"),
        copy / "results/frames/outdoor_01.parquet",
        copy / "results/report/cost.html",
        next((copy / "results/report/sequences").glob("*.html")),
    ]
    for path in lost:
        path.unlink()
    jobs = planned(copy, "release")
    assert {"frames", "package", "exports", "tarballs", "report"} <= planned(copy, "all", "release").keys()
    assert {"frames", "package", "exports", "tarballs"} <= jobs.keys() and "mocap" not in jobs
    snakemake(copy, "all", "release")
    assert contents(copy) == contents(project)


@pytest.mark.slow
def test_of_two_runs_the_second_says_who_is_running(project, copy):
    shutil.rmtree(copy / "results")
    first = start(copy)
    while not (copy / "results/frames").exists():
        assert first.poll() is None
        time.sleep(0.05)
    who = f"another run is at work in this folder: process {first.pid} on {socket.gethostname()} since "
    for words in ([], ["--unlock"], ["--nolock"]):
        code, text = snakemake(copy, *words, check=False)
        assert code == 1 and who in text and "Traceback" not in text, words
        assert "cannot be locked" not in text
    assert snakemake(copy, "-n")[0] == 0
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    # Snakemake's own lock is still there, and nobody has to remove it
    assert list((copy / ".snakemake/locks").iterdir()) and running.at_work(copy) == ""
    snakemake(copy, "all", "release")
    assert contents(copy) == contents(project)


# the planning of dior, on rules of its own
PLANNED = """
import os
import sys

from snakemake.exceptions import WorkflowError

from dior.errors import DiorError


# terminal.smk has them
LAST_LINES = []


def tell_what_is_missing(started):
    pass


def tell_why(dag):
    pass


include: "{root}/workflow/rules/runs.smk"
"""
TOY = """


rule all:
    input:
        "c/SHA256SUMS",


rule a:
    output:
        "a",
    shell:
        "touch {output}"


rule b:
    input:
        "a",
    output:
        "b",
    shell:
        "touch {output}"


rule c:
    input:
        "b",
    output:
        "c/SHA256SUMS",
    shell:
        "touch {output}"
"""


OLD = """


rule a:
    output:
        "a",
    params:
        word=os.environ["A"],
    shell:
        "touch {output}"


rule b:
    input:
        ancient("a"),
    output:
        "b",
    params:
        word=os.environ["B"],
    shell:
        "touch {output}"


rule c:
    input:
        "b",
    output:
        "c",
    shell:
        "touch {output}"
"""


@pytest.mark.slow
def test_what_changed_is_made_again_where_an_input_that_counts_as_old_is_made_again(tmp_path, monkeypatch):
    (tmp_path / "Snakefile").write_text(PLANNED.format(root=ROOT) + OLD)
    (tmp_path / "dior").symlink_to(ROOT / "dior")

    def with_words(run, a, b):
        monkeypatch.setenv("A", a)
        monkeypatch.setenv("B", b)
        return run(tmp_path, "c", root=tmp_path)

    with_words(snakemake, "1", "1")
    assert with_words(planned, "1", "1") == {}
    assert with_words(planned, "2", "1") == {"a": 1}
    assert with_words(planned, "1", "2") == {"b": 1, "c": 1}
    assert with_words(planned, "2", "2") == {"a": 1, "b": 1, "c": 1}


@pytest.fixture
def toy(tmp_path):
    """A chain of three steps that have run: results that are there, and no notes of how they were made."""
    (tmp_path / "Snakefile").write_text(PLANNED.format(root=ROOT) + TOY)
    (tmp_path / "dior").symlink_to(ROOT / "dior")
    (tmp_path / "c").mkdir()
    for name in ("a", "b", "c/b"):
        (tmp_path / name).write_text(name)
        os.utime(tmp_path / name, (1000 + ord(name[-1]), 1000 + ord(name[-1])))
    (tmp_path / "c/SHA256SUMS").write_text(f"{'0' * 64}  b\n")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(("lost", "jobs"), [("", {}), ("a", {"a": 1, "b": 1, "c": 1}), ("c/b", {"c": 1})])
def test_what_lacks_below_a_target_that_is_there_is_asked_for(toy, lost, jobs):
    if lost:
        (toy / lost).unlink()
    assert planned(toy, root=toy) == jobs
