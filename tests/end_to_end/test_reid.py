"""`snakemake reid` on a tiny simulated capture: the baseline alone, networks, and what lacks."""

import csv
import os
import re
import shutil
import subprocess
import sys

import pytest

from dior.body.names import COCO_17
from dior.reid import protocols, recognise
from dior.simulate import config as simulated
from dior.simulate import settings
from dior.tables import tables
from tests.end_to_end.workflow import ROOT, command, edit, planned, snakemake
from tests.reid import parity

# a walk of each person in each place; the way is straight, so that there is a gait to measure
TINY = {
    "subjects": 3, "sequences": 1, "people": "different", "walks": ["straight"], "duration_s": 8.0, "width": 640,
    "height": 360, "fx": 320.0,
}  # fmt: skip
OF_REID = {"inputs", "recognise", "reid"}


def config(folder):
    simulated.write(settings.from_dict(TINY), folder / "config")
    return folder


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A finished run of the target alone, by the baseline."""
    folder = config(tmp_path_factory.mktemp("reid"))
    snakemake(folder, "reid")
    return folder


def table(folder, name="table"):
    with open(folder / f"results/reid/{name}.csv", newline="") as stream:
        return list(csv.DictReader(stream))


def without_torch(folder, *words):
    """Exit code and output of a run of Snakemake by a Python that has no PyTorch."""
    shadow = folder / "shadow"
    shadow.mkdir(exist_ok=True)
    (shadow / "sitecustomize.py").write_text("import sys\nsys.modules['torch'] = None\n")
    given = command(folder, words, ROOT)
    given["env"] = given["env"] | {"PYTHONPATH": f"{shadow}{os.pathsep}{given['env']['PYTHONPATH']}"}
    done = subprocess.run(**given, capture_output=True)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
def test_it_is_made_only_when_asked_for(tmp_path):
    """Whatever the config asks for, and whether or not it is there."""
    folder = config(tmp_path)
    edit(folder / "config/config.yaml", "gaitmixer: []", "gaitmixer: [nowhere.pt]")
    assert not OF_REID & set(planned(folder, "all", "release"))


@pytest.mark.slow
def test_what_lacks_is_said_before_the_first_job(tmp_path):
    folder = config(tmp_path)
    edit(folder / "config/config.yaml", "gaitmixer: []", "gaitmixer: [weights/ours.pt]")
    code, text = snakemake(folder, "reid", check=False)
    assert code and "'reid.networks' names weights/ours.pt, where there is no file" in text
    (folder / "weights").mkdir()
    (folder / "weights/ours.pt").write_text("x")
    code, text = without_torch(folder, "reid")
    assert code and text.count("pip install -r requirements-reid.txt") == 1
    assert not (folder / "results").exists()


@pytest.mark.slow
def test_the_baseline_needs_no_network(project):
    rows = table(project)
    assert tuple(rows[0]) == recognise.COLUMNS
    assert {row["method"] for row in rows} == {"baseline", ""}
    means = {row["protocol"]: row for row in rows if row["method"] and not row["camera"]}
    assert set(means) == {"other_recording", "other_place"}
    # 3 people x 8 cameras, each with the walk in the 4 cameras of the other place
    assert {row["n"] for row in means.values()} == {"96"} and means["other_place"]["chance"] == "0.333333"
    assert [(row["camera"], row["verdict"]) for row in rows if not row["method"]] == [("cam04", recognise.NO_OUTPUT)]
    text = (project / "results/reid/index.html").read_text()
    assert recognise.NO_OUTPUT in text and "says nothing about recognising anybody in far pictures" in text
    assert {path.name for path in (project / "results/reid/plots").iterdir() if path.suffix == ".svg"} == {
        "reid_other_recording.svg", "reid_cmc.svg",
    }  # fmt: skip
    assert not (project / "results/report").exists() and planned(project, "reid") == {}


@pytest.mark.slow
def test_labels_of_every_camera_are_coco(project):
    for name in ("indoor_01", "outdoor_01"):
        labels = tables.read(project / f"results/reid/{name}.parquet", "labels_2d")
        assert tables.ordered_unique(labels["camera"]) == ["cam01", "cam02", "cam03", "cam04"]
        uv, joints = tables.grid(tables.of_camera(labels, "cam04"), "u", "v")
        assert tuple(joints) == COCO_17 and len(uv) == 240
        ours = tables.read(project / f"results/reid/{name}.skeleton.parquet", "skeletons_3d")
        assert set(ours["joint"]) == set(COCO_17)


@pytest.mark.slow
def test_once_there_it_is_kept_up_and_in_the_report(copy):
    jobs = planned(copy)
    assert jobs["report"] == 1 and not OF_REID & set(jobs)
    snakemake(copy)
    text = (copy / "results/report/index.html").read_text()
    assert 'id="recognised">' in text and (copy / "results/report/assets/plots/reid_cmc.svg").is_file()
    assert planned(copy) == {}
    sheet = copy / "config/subjects.tsv"
    row = next(line for line in sheet.read_text().splitlines() if line.startswith("S03"))
    edit(sheet, row, row.replace("\tyes\tyes", "\tno\tno"))
    jobs = planned(copy)
    assert jobs["recognise"] == jobs["reid"] == jobs["report"] == 1


@pytest.mark.slow
def test_networks_with_the_authors_weights(copy):
    pytest.importorskip("torch", reason="networks need PyTorch")
    path = parity.weights_file("gaitgraph.pth")
    edit(copy / "config/config.yaml", "gaitgraph: []", f"gaitgraph: [{path}]")
    edit(copy / "config/config.yaml", "[as_is, scaled, canonical]", "[as_is, canonical]")
    assert planned(copy, "reid") == {"recognise": 1, "reid": 1}
    # the table that is there cannot be made without PyTorch: the rest goes on without it
    code, text = without_torch(copy, "-n")
    assert code == 0 and "recognise" not in text
    snakemake(copy, "reid")
    rows = [row for row in table(copy) if row["method"] == "gaitgraph"]
    assert {(row["weights"], row["adaptation"]) for row in rows} == {
        ("gaitgraph.pth", "as_is"), ("gaitgraph.pth", "canonical"),
    }  # fmt: skip
    assert {row["protocol"] for row in rows} == set(protocols.PROTOCOLS)
    assert planned(copy, "reid") == {}
    before = (copy / "results/reid/table.csv").read_bytes()
    shutil.rmtree(copy / "results/reid")
    snakemake(copy, "reid")
    assert (copy / "results/reid/table.csv").read_bytes() == before


@pytest.mark.slow
def test_weights_of_another_network_are_one_sentence(copy):
    pytest.importorskip("torch", reason="networks need PyTorch")
    edit(copy / "config/config.yaml", "gaitmixer: []", f"gaitmixer: [{parity.weights_file('gaitgraph.pth')}]")
    code, text = snakemake(copy, "reid", check=False)
    last = text.split("Exiting because a job execution failed")[1]
    assert code and "logs/recognise/recognise.log: dior recognise: " in last and "they fit gaitgraph" in last
    assert "Traceback" not in text


@pytest.mark.slow
def test_weights_of_ones_own_are_trained_and_compared(copy):
    pytest.importorskip("torch", reason="networks need PyTorch")
    words = ["--project", copy, "--labels", copy / "results/reid", "--network", "gaitgraph", "--steps", "2"]
    out = ["--out", copy / "weights/ours.pt"]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    dior = [sys.executable, "-m", "dior.cli.main", "train-reid", *words, *out]
    done = subprocess.run(dior, capture_output=True, text=True, env=env)
    assert done.returncode == 1 and "no subject has two walks in one session" in done.stderr
    done = subprocess.run([*dior, "--test-sessions", "lab"], capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^ours.pt: other_place rank-1 .* chance 33.3%\): at chance$", done.stdout, re.MULTILINE)
    edit(copy / "config/config.yaml", "gaitgraph: []", "gaitgraph: [weights/ours.pt]")
    edit(copy / "config/config.yaml", "[as_is, scaled, canonical]", "[canonical]")
    snakemake(copy, "reid")
    assert {row["weights"] for row in table(copy) if row["method"] == "gaitgraph"} == {"ours.pt"}
