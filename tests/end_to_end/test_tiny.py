"""The whole workflow on a tiny simulated capture: results, nothing to do twice, and only what depends on an edit."""

import csv
import fcntl
import json
import os
import pty
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import termios
import time
import zipfile
from collections import Counter
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import psutil
import pytest

from dior.body.names import COCO_17
from dior.cli import main
from dior.evaluate import bootstrap, statistics
from dior.ingest import bags
from dior.project.steps import MODULES, STAGES
from dior.simulate import config as simulated
from dior.simulate import settings
from dior.tables import tables
from tests.cases import slow
from tests.end_to_end import recomputed
from tests.end_to_end.results import contents, figure, metrics
from tests.end_to_end.workflow import ENVIRONMENT, ROOT, edit, nudge, planned, snakemake, start

# steps that the capture has nothing for, or that are made only when asked for
NOT_IN_IT = {"detect", "reference", "detectors", "zoom", "to_mark", "moved", "inputs", "recognise", "reid", "sign"}
# of several walks of a subject; of everybody, where that is asked for
NOT_IN_IT |= {"bodies", "people"}
TINY = {"subjects": 1, "sequences": 1, "duration_s": 3.0, "width": 640, "height": 360, "fx": 320.0, "gallery": True}


# what is killed
KINDS = ("group", "snakemake", "job")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A finished run with a release. Tests that edit it work on a copy."""
    folder = tmp_path_factory.mktemp("tiny")
    simulated.write(settings.from_dict(TINY), folder / "config")
    snakemake(folder, "all", "release")
    return folder


def test_labels_are_near_the_truth(project):
    rows = metrics(project)
    assert figure(rows, "error_to_truth_2d", role="long_range") < 2.0
    assert figure(rows, "error_to_truth_2d", role="close") < 3.0
    assert figure(rows, "in_box_share", role="long_range") > 0.9


def test_gait_events_are_where_the_feet_touch_the_floor(project):
    """Of every walk, in the results and in the release; a few, as the capture is short."""
    for walk in ("indoor_01", "outdoor_01"):
        events = tables.read(project / f"results/gait/{walk}.events.parquet", "gait_events")
        true = tables.read(project / f"results/simulate/truth/{walk}/contacts.parquet", "contacts")
        assert len(events["time_s"]) >= 4
        off = []
        for foot, event, at, sigma in zip(*(events[k] for k in ("foot", "event", "stamp_ns", "sigma_s")), strict=True):
            own = true["stamp_ns"][(true["foot"] == foot) & (true["event"] == event)]
            off.append(np.abs(own - at).min() / 1e9)
            assert 0.002 < sigma < 0.04
        assert np.median(off) < 0.03 and np.quantile(off, 0.75) < 0.05, walk
        for kind, part in (("gait", ""), ("gait_events", ".events"), ("gait_steps", ".steps")):
            (released,) = (project / f"results/release/dior-0.1.0/{kind}").glob(f"*/{walk}.parquet")
            made = pd.read_parquet(project / f"results/gait/{walk}{part}.parquet")
            pd.testing.assert_frame_equal(pd.read_parquet(released), made)


def test_nothing_is_in_doubt_in_a_clean_capture(project):
    out = project / "results/release/dior-0.1.0"
    assert not (out / "lights.parquet").exists()
    paths = list(out.glob("labels_2d/*/*.parquet"))
    assert len(paths) == 8
    assert not [path for path in paths if "suspect" in tables.read(path, "labels_2d", ["status"])["status"]]


def test_metrics_are_those_of_an_independent_computation(project):
    """Every figure of these metrics, pooled or not, by joint or not, to the six digits of the file."""
    rows = metrics(project)
    of = {tuple(row[k] for k in ("metric", *recomputed.KEY, "joint")): row for row in rows if not row["tool"]}
    checked = Counter()
    for metric, table in recomputed.values(project).items():
        pools = dict(recomputed.POOLS)
        if metric in ("coverage", "error_to_truth_2d", "reprojection_error"):
            pools |= {"joint": ["role", "joint"], "joint of a recording": [*recomputed.KEY, "joint"]}
        for name, keep in pools.items():
            for line in recomputed.pooled(table, keep).to_dict("records"):
                row = of[(metric, *(line[k] for k in (*recomputed.KEY, "joint")))]
                assert int(row["n"]) == line["size"], (name, line)
                assert float(row["value"]) == pytest.approx(line["mean"], rel=2e-5), (name, line)
                checked[metric] += 1
                if name == "everything":
                    interval = [float(row[k]) for k in ("low", "high") if row[k]]
                    assert interval == pytest.approx(recomputed.interval(table, bootstrap.draws), rel=2e-5)
    missed = Counter(row["metric"] for row in rows if row["metric"] in checked) - checked
    assert not missed and min(checked.values()) > 5 and checked["reprojection_error"] > 100, (missed, checked)


@pytest.mark.slow
def test_detectors_and_what_is_to_mark(copy):
    """Pictures are cut out; a detector that finds the subject in some and one that finds nobody are measured."""
    snakemake(copy, "zoomed", "to_mark")
    folder = copy / "results/zoom/outdoor_01.cam04"
    index = list(csv.DictReader(folder.with_name(f"{folder.name}.csv").open()))
    assert [row["file"] for row in index] == [f"frame_{i:06d}.png" for i in range(90)]
    frames = tables.of_camera(tables.read(copy / "results/frames/outdoor_01.parquet", "frames"), "cam04")
    row, picture = next(iter(bags.read_pictures(frames, copy / "results/simulate")))
    piece = cv2.imread(str(folder / index[row]["file"]))
    assert piece.shape == (90, 160, 3) and (piece == picture[135:225, 240:400]).all()
    drawn = copy / "results/evaluate/to_mark"
    assert sum(len(path.read_text().splitlines()) - 1 for path in (drawn / "checks").glob("*.csv")) == 100
    assert len(list((drawn / "boxes").glob("*.cam04.csv"))) == 1
    labels = tables.read(copy / "results/reproject/outdoor_01.cam04.parquet", "labels_2d")
    uv, joints = tables.grid(labels, "u", "v")
    order = [joints.index(joint) for joint in COCO_17]
    found = [
        {"image_id": i, "score": 1, "keypoints": np.column_stack([one - (240, 135), np.ones(17)]).ravel().tolist()}
        for i, one in enumerate(uv[:, order]) if i % 3 and np.isfinite(one).all()
    ]  # fmt: skip
    (copy / "results/simulate/found.json").write_text(json.dumps(found))
    (copy / "results/simulate/nobody.json").write_text("[]\n")
    sheet = "sequence\tcamera\ttool\tzoom\tpath\n"
    sheet += "outdoor_01\tcam04\tyolo\t4\tfound.json\noutdoor_01\tcam04\tyolo\t1\tnobody.json\n"
    (copy / "config/detectors.tsv").write_text(sheet)
    assert planned(copy, "results/evaluate/metrics.csv") == {"detectors": 1, "metrics": 1}
    snakemake(copy, "results/evaluate/metrics.csv")
    rows = [row for row in metrics(copy) if row["tool"] and row["sequence"] and row["camera"]]
    shares = {(row["metric"], row["tool"]): (float(row["value"]), int(row["n"])) for row in rows}
    labelled = int(np.isfinite(uv).all(axis=-1).any(axis=1).sum())
    assert 80 < labelled <= 90 and 50 < len(found) <= 60
    assert shares == {
        ("detected_share", "yolo 4x"): (pytest.approx(len(found) / 90, rel=1e-5), 90),
        ("success_share", "yolo 4x"): (pytest.approx(len(found) / labelled, rel=1e-5), labelled),
        ("detected_share", "yolo"): (0.0, 90), ("success_share", "yolo"): (0.0, labelled),
    }  # fmt: skip
    later = planned(copy)
    assert later["report"] == later["package"] == 1 and not {"detectors", "reproject", "evaluate"} & set(later)


def test_every_frame_of_every_camera_has_every_joint(project):
    for sequence, joints in (("indoor_01", 39), ("outdoor_01", 33)):
        frames = tables.read(project / f"results/frames/{sequence}.parquet", "frames")
        for camera in ("cam01", "cam02", "cam03", "cam04"):
            labels = tables.read(project / f"results/reproject/{sequence}.{camera}.parquet", "labels_2d")
            mine = tables.of_camera(frames, camera)
            assert len(labels["frame"]) == 90 * joints
            assert (labels["stamp_ns"].reshape(90, joints) == mine["stamp_ns"][:, None]).all()
            missing = np.isnan(labels["u"])
            assert not (missing & (labels["status"] == "ok")).any()
            assert (labels["status"] != "").all()


@pytest.mark.slow
def test_a_run_ends_with_what_to_open(copy):
    (copy / "results/evaluate/statistics.csv").unlink()
    code, text = snakemake(copy, "--quiet", "all", "--", "results/evaluate/statistics.csv")
    assert f"Open {copy}/results/report/index.html\n" in text
    shutil.rmtree(copy / "results/report")
    (copy / "results/evaluate/statistics.csv").unlink()
    assert "Open " not in snakemake(copy, "results/evaluate/statistics.csv")[1]
    assert "Open " not in snakemake(copy, "-n")[1]


def test_report_and_release_are_there(project):
    page = (project / "results/report/index.html").read_text()
    assert "outdoor_01" in page and "http://" not in page and "https://" not in page
    wanted = {link for link in re.findall(r'(?:src|href)="([^"#]+)"', page)}
    assert len(wanted) > 12
    assert [link for link in wanted if not (project / "results/report" / link).is_file()] == []
    release = project / "results/release/dior-0.1.0"
    assert len(list(release.parent.glob("*.tar"))) == 2 and (release / "SHA256SUMS").is_file()
    (shard,) = release.glob("frames/*/outdoor_01.cam04.parquet")
    assert shard.samefile(project / "results/pixels/outdoor_01.cam04.parquet"), "pixels are there once"
    assert not list(project.rglob(".*.part*"))


def test_verify_believes_the_release(project, capsys):
    """Labels, figures and texts are computed once more; every picture is decoded."""
    assert main.main(["verify", "--decode", str(project / "results/release/dior-0.1.0")]) == 0
    assert "(decoded); not signed" in capsys.readouterr().out


def test_every_rule_left_a_log_and_a_benchmark(project):
    for step in MODULES.keys() - NOT_IN_IT:
        assert list((project / "logs" / step).glob("*.log")), step
        assert list((project / "logs" / step).glob("*.benchmark.tsv")), step


def test_every_job_left_its_cost_beside_its_log(project):
    logs, costs = (
        {str(path.relative_to(project)).removesuffix(suffix) for path in (project / "logs").glob(f"*/*{suffix}")}
        for suffix in (".log", ".timing.json")
    )
    assert logs == costs and len(logs) > 50
    with open(project / "results/timing.csv", newline="") as stream:
        rows = {row["step"]: row for row in csv.DictReader(stream)}
    # the report is written before its own job has ended, and the release may be made after it
    later = {"report", *STAGES["release"]}
    assert set(MODULES) - NOT_IN_IT - later <= set(rows) - {"all"} <= set(MODULES)
    assert rows["reproject"]["jobs"] == "2" and rows["reproject"]["frames"] == "720"
    assert 0 < float(rows["all"]["cpu_s_per_frame"]) < 1


def test_statistics_are_those_of_pandas(project):
    counted = statistics.read(project / "results/evaluate/statistics.csv")
    labels = pd.concat(map(pd.read_parquet, (project / "results/reproject").glob("*.parquet")))
    labels["environment"] = labels["sequence"].astype(str).str.split("_").str[0]
    for (environment, camera), part in labels.groupby(["environment", "camera"], observed=True):
        far = (environment, camera) == ("outdoor", "cam04")
        where = {"environment": environment, "role": "long_range" if far else "close", "camera": camera}
        pictures = part[["sequence", "frame"]].drop_duplicates()
        assert statistics.of(counted, "frames", **where) == len(pictures) == 90
        for status, n in part["status"].astype(str).value_counts().items():
            what = "keypoints_2d" if status in ("ok", "occluded") else "missing_2d"
            if status != "ok":
                assert statistics.of(counted, what, **where, reason=status) == n
        labelled = int(part["status"].isin(["ok", "occluded"]).sum())
        assert statistics.of(counted, "keypoints_2d", **where, reason="") == labelled
    steps = ("mocap", "refine")
    points = pd.concat(pd.read_parquet(p) for s in steps for p in (project / "results" / s).glob("*door_01.parquet"))
    assert statistics.of(counted, "keypoints_3d") == points["x"].notna().sum()
    assert statistics.of(counted, "missing_3d") == points["x"].isna().sum()
    gallery = pd.read_parquet(project / "results/gallery/gallery.parquet")
    assert statistics.of(counted, "gallery_pictures") == len(gallery)
    far = labels[(labels["environment"] == "outdoor") & (labels["camera"] == "cam04")].dropna(subset="v")
    tall = far.groupby(["sequence", "frame"], observed=True)["v"].agg(lambda v: v.max() - v.min())
    assert statistics.of(counted, "person_height", role="long_range") == pytest.approx(tall.median(), rel=1e-5)


def test_a_second_call_has_nothing_to_do(project):
    assert "Nothing to be done" in snakemake(project)[1]


@pytest.mark.slow
def test_without_a_target_there_is_no_release_but_one_that_is_there_is_kept_up(project, tmp_path):
    shutil.copytree(project / "config", tmp_path / "config")
    of_release = {"heads", "pixels", "provenance", "package", "exports", "tarballs"}
    jobs = planned(tmp_path)
    assert jobs["report"] == 1 and not of_release & set(jobs)
    about_somebody = tmp_path / "results/release/dior-0.1.0/frames/somebody/walk.cam01.parquet"
    about_somebody.parent.mkdir(parents=True)
    about_somebody.touch()
    jobs = planned(tmp_path)
    assert jobs["report"] == 1 and of_release <= set(jobs) and jobs["provenance"] == 2


def test_an_edited_long_range_camera_touches_only_its_own_labels(copy):
    nudge(copy / "config/sessions/field/cam04.yaml", "sigma_m")
    assert planned(copy) == {
        "align": 1, "follow": 1, "reproject": 1, "evaluate": 1, "overlays": 1, "clip": 1, "viewer": 1, "page": 1,
        "metrics": 1, "statistics": 1, "heads": 1, "pixels": 1, "report": 1, "package": 1, "exports": 1, "tarballs": 2,
    }  # fmt: skip


def test_why_it_runs_again_is_said_with_the_key_and_the_file(copy):
    """Also in what Snakemake says of each job, which prints all values before and after otherwise."""
    edit(copy / "config/config.yaml", "max_error_px: 45.0", "max_error_px: 30.0")
    nudge(copy / "config/sessions/field/cam04.yaml", "sigma_m")
    _, text = snakemake(copy, "-n")
    said, camera = "triangulate.max_error_px 45.0 -> 30.0", "config/sessions/field/cam04.yaml"
    (line,) = re.findall(r"^Runs again because of: (.*)$", text, re.MULTILINE)
    assert set(line.split("; ")) == {said, camera}
    # a job that runs because of one before it has that as its reason
    assert re.findall(r"Params have changed since last execution: (.*)$", text, re.MULTILINE) == [said]


@pytest.mark.slow
def test_a_change_of_consent_names_nobody_as_the_reason(copy):
    sheet = copy / "config/subjects.tsv"
    name, pseudonym = sheet.read_text().splitlines()[1].split("\t")[:2]
    edit(sheet, "\tyes\tyes", "\tyes\tno")
    _, text = snakemake(copy, "release")
    log = max((copy / ".snakemake/log").iterdir()).read_text()
    for said in (text, log):
        reasons = re.findall(r"^(?:Runs again because of|    reason): (.*)$", said, re.MULTILINE)
        assert any("a consent in config/subjects.tsv" in reason for reason in reasons)
        changed = [reason.split("since last execution: ", 1)[-1] for reason in reasons if "Params have" in reason]
        assert len(changed) > 1 and not [text for text in changed if name in text or pseudonym in text]


@pytest.mark.slow
def test_the_terminal_shows_bars_and_ends_with_the_verdict(copy):
    """With the default profile, 100 columns wide; a bar is drawn over the one before it."""
    shutil.rmtree(copy / "results/reproject")
    code, text = on_a_terminal(copy, "all", "-j2")
    assert code == 0 and "Workflow Progress" in text
    shown = text.count("\n") - text.count("\x1b[1A")
    assert 10 < shown < 60
    page = f"Open {copy}/results/report/index.html"
    last = re.sub(r"\x1b\[[?\d;]*\w|\r", "", text).strip().split("\n")[-1]
    assert re.fullmatch(rf"\d of 8 recordings are good\..* {page}", last)
    assert "dior reproject" not in text
    code, text = on_a_terminal(copy)
    assert code == 0 and "Nothing to be done" in text and text.rstrip().endswith(page)


def on_a_terminal(project, *words):
    """Exit code of `dior run` and all that it writes to a terminal of 100 columns."""
    main_end, end = pty.openpty()
    fcntl.ioctl(end, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 100, 0, 0))
    command = [sys.executable, "-m", "dior", "run", str(project), *words]
    env = ENVIRONMENT | {"TERM": "xterm"}
    with subprocess.Popen(command, cwd=ROOT, env=env, stdin=end, stdout=end, stderr=end) as running:
        os.close(end)
        written = b""
        with suppress(OSError):
            while piece := os.read(main_end, 65536):
                written += piece
    os.close(main_end)
    return running.returncode, written.decode()


@pytest.mark.slow
def test_off_a_terminal_a_line_now_and_then_says_that_it_lives(copy, tmp_path):
    """Here every second instead of every minute."""
    checkout = tmp_path / "checkout"
    for name in ("workflow", "profiles"):
        shutil.copytree(ROOT / name, checkout / name)
    shutil.copy(ROOT / "Snakefile", checkout)
    edit(checkout / "workflow/rules/terminal.smk", "EVERY_S = 60", "EVERY_S = 1")
    shutil.rmtree(copy / "results/reproject")
    command = [sys.executable, "-m", "dior", "run", str(copy), "--snakefile", str(checkout / "Snakefile")]
    done = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True)
    lives = re.findall(r"^\d+ min: \d+ of \d+ jobs done; at work: ([\w, ]+)$", done.stderr, re.MULTILINE)
    assert done.returncode == 0 and len(lives) > 3 and any("reproject" in line for line in lives)
    assert len(done.stderr.splitlines()) - len(lives) < 60
    assert done.stderr.rstrip().endswith(f"Open {copy}/results/report/index.html")


@pytest.mark.slow
def test_an_edited_close_camera_touches_its_session(copy):
    nudge(copy / "config/sessions/field/cam01.yaml", "sigma_m")
    assert planned(copy) == {
        "place": 1, "adjust": 1, "clocks": 1, "timeline": 1, "follow": 1, "triangulate": 1, "refine": 1, "world": 1,
        "gait": 1,
        "align": 1, "reproject": 1, "evaluate": 1,
        "overlays": 1, "clip": 1, "viewer": 1, "page": 1, "metrics": 1, "statistics": 1, "report": 1,
        "heads": 4, "pixels": 4, "package": 1, "exports": 1, "tarballs": 2,
    }  # fmt: skip


@pytest.mark.slow
def test_an_edited_indoor_mark_touches_its_camera(copy):
    path = copy / "config/sessions/lab/cam02.marks.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    jobs = planned(copy)
    assert jobs["locate"] == 1 and jobs["reproject"] == 1 and "triangulate" not in jobs and "adjust" not in jobs
    # the labels of a walk are written by one job, but only this camera's pictures have another head
    assert jobs["heads"] == 1 and jobs["pixels"] == 1


@pytest.mark.slow
def test_edited_code_of_one_step_reruns_what_depends_on_it(copy, tmp_path):
    checkout = tmp_path / "checkout"
    for name in ("dior", "workflow"):
        shutil.copytree(ROOT / name, checkout / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Snakefile", checkout)
    assert planned(copy, root=checkout) == {}
    edit(checkout / "dior/report/overlays.py", '"""', '"""Other words. ')
    assert planned(copy, root=checkout) == {}
    with open(checkout / "dior/report/overlays.py", "a") as stream:
        stream.write("\nMORE = 1\n")
    # the card's picture is drawn by it, too
    released = {"package": 1, "exports": 1, "tarballs": 2}
    assert planned(copy, root=checkout) == {"overlays": 2, "clip": 2, "viewer": 2, "page": 2, "report": 1} | released


def test_a_broken_sequence_does_not_stop_the_others(copy):
    """The bag is cut in the middle, as a full disk leaves it."""
    bag = copy / "results/simulate/indoor_01/pc2.bag"
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    shutil.rmtree(copy / "results/reproject")
    (copy / "results/frames/indoor_01.parquet").unlink()
    code, text = snakemake(copy, "--keep-going", "--until", "reproject", check=False)
    assert code != 0
    assert "dior frames: " in text and "pc2.bag" in text and "truncated" in text
    last = text.split("Exiting because a job execution failed")[1]
    assert re.search(r"^logs/frames/indoor_01.log: dior frames: .*pc2.bag.* truncated", last, re.MULTILINE)
    assert "Open " not in last
    made = {path.name.split(".")[0] for path in (copy / "results/reproject").glob("*.parquet")}
    assert made == {"outdoor_01"}
    assert not (copy / "results/frames/indoor_01.parquet").exists()
    assert not list(copy.rglob(".*.part*"))


@pytest.mark.slow
def test_a_damaged_result_is_told_and_what_is_told_makes_it_anew(copy, project):
    """One bit, with the time that the file had: Snakemake does not see it, the step that reads it does."""
    table, labels = copy / "results/mocap/indoor_01.parquet", "results/reproject/indoor_01.cam01.parquet"
    before, content = table.stat(), bytearray(table.read_bytes())
    content[len(content) // 2] ^= 4
    table.write_bytes(content)
    os.utime(table, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert planned(copy) == {}
    code, text = snakemake(copy, "--forcerun", labels, "--", labels, check=False)
    assert code != 0 and not (copy / labels).exists()
    (said,) = set(re.findall(r"^dior reproject: (.*)$", text, re.MULTILINE))
    assert said.startswith("results/mocap/indoor_01.parquet: is not what its job wrote")
    advice = re.search(r"run snakemake again with `(--forcerun \S+)`$", said)[1]
    snakemake(copy, *advice.split(), "--", labels)
    assert contents(copy) == contents(project)


@pytest.mark.slow
def test_every_result_that_a_step_reads_is_noted(project):
    """And nothing that there is not."""
    noted = {path.relative_to(project / "results/.sha256") for path in (project / "results/.sha256").rglob("*.*")}
    read = {path for kind in ("parquet", "json", "csv") for path in (project / "results").rglob(f"*.{kind}")}
    read = {path.relative_to(project / "results") for path in read}
    assert (
        noted == {path for path in read if path.parts[0] not in ("release", ".sha256", "timing.csv")}
        and len(noted) > 100
    )


@pytest.mark.slow
def test_snakemakes_own_report(project, tmp_path):
    snakemake(project, "--report", tmp_path / "report.zip")
    snakemake(project, "--report", tmp_path / "report.html")
    with zipfile.ZipFile(tmp_path / "report.zip") as packed:
        # figures of walks have the same names as those of all
        found = {(Path(name).name, packed.read(name)) for name in packed.namelist()}
    for path in (*(project / "results/report/assets/plots").glob("*.svg"), *(project / "results").glob("*/*.csv")):
        assert (path.name, path.read_bytes()) in found, path.name
    page = (tmp_path / "report.html").read_text()
    assert "metrics.csv" in page and not re.findall(r'(?:src|href)="https?://[^"]*"', page)


@pytest.mark.slow
def test_two_runs_of_the_same_input_give_the_same_bytes(project, tmp_path):
    simulated.write(settings.from_dict(TINY), tmp_path / "again/config")
    snakemake(tmp_path / "again", "all", "release")
    assert contents(tmp_path / "again") == contents(project)


def logged(folder):
    return len(list((folder / "logs").glob("*/*.log")))


@pytest.mark.slow
def test_a_run_that_is_killed_20_times_goes_on_to_the_same_bytes(project, tmp_path):
    """Everything as a power cut does, Snakemake alone, or one job and what it started; after some more jobs began."""
    folder, chance, killed = tmp_path / "killed", random.Random(17), Counter()
    shutil.copytree(project / "config", folder / "config")
    for _ in range(40):
        run = start(folder, "all", "release")
        until, wait_s, which = logged(folder) + chance.randint(1, 5), chance.uniform(0, 0.5), chance.choice(KINDS)
        while run.poll() is None and logged(folder) < until:
            time.sleep(0.02)
        time.sleep(wait_s)
        jobs = []
        with suppress(psutil.NoSuchProcess):
            jobs = psutil.Process(run.pid).children()
            if which == "group":
                os.killpg(run.pid, signal.SIGKILL)
            elif which == "snakemake":
                run.kill()
            elif jobs:
                for process in (*jobs[0].children(recursive=True), jobs[0]):
                    process.kill()
            else:
                # none at work just now: the run would go on to its end
                run.kill()
            killed[which] += bool(jobs)
        if run.wait() == 0 or sum(killed.values()) == 20:
            break
        # those of a killed Snakemake go on to their end, and until then no other begins
        psutil.wait_procs(jobs)
    assert set(killed) == set(KINDS) and sum(killed.values()) > 15, killed
    snakemake(folder, "all", "release")
    assert contents(folder) == contents(project)
    assert not list(folder.rglob(".*.part*"))


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("config.yaml", "max_error_px:", "max_eror_px:", ["config.yaml", "did you mean", "max_error_px"]),
        slow("sessions/field/cam01.yaml", "role: close", "role: closed", ["cam01.yaml", "role", "close"]),
        slow("sequences.tsv", "\tfield\t", "\tfeild\t", ["sequences.tsv", "feild", "field"]),
    ],
)
def test_a_typo_is_one_clear_sentence(copy, file, old, new, words):
    edit(copy / "config" / file, old, new)
    code, text = snakemake(copy, "-n", check=False)
    assert code != 0 and all(word in text for word in words)
    assert "Traceback" not in text
