"""The workflow on a real recording: ../shared/data/real_outdoor, by its reference cameras and by adjusted ones."""

import os
import shutil
import subprocess
import sys
import tomllib

import numpy as np
import pytest

from dior.body.plausible import stature
from dior.tables import tables
from tests.cases import slow
from tests.end_to_end.workflow import ROOT, edit, snakemake

PROJECT = ROOT / "tests/projects/real_outdoor"


@pytest.fixture
def project(shared, tmp_path):
    folder = tmp_path / "real_outdoor"
    shutil.copytree(PROJECT / "config", folder / "config")
    edit(folder / "config/config.yaml", "../../../../shared/data/real_outdoor", str(shared / "real_outdoor"))
    return folder


def score(shared, labels):
    tool = shared.parent / "tools/score_real_outdoor.py"
    words = subprocess.run([sys.executable, tool, labels], capture_output=True, text=True, check=True).stdout.split()
    return {words[i]: float(words[i + 1]) for i in (0, 2, 4, 6)}


@pytest.mark.slow
def test_reference_cameras_label_the_unseen_one(project, shared):
    snakemake(project, "all", "release")
    figures = score(shared, project / "results/reproject/beam_01.cam04.parquet")
    assert figures["mean"] <= 22.5 and figures["median"] <= 19.5 and figures["coverage"] >= 0.98
    found = tables.read(project / "results/reference/beam.findings.parquet", "findings")
    assert found["code"].tolist() == ["reference_uncertainty"]
    assert not len(tables.read(project / "results/world/beam_01.findings.parquet", "findings")["code"])
    for camera in ("cam01", "cam02", "cam03", "cam04"):
        labels = tables.read(project / f"results/reproject/beam_01.{camera}.parquet", "labels_2d")
        assert np.isfinite(labels["sigma_u"][np.isfinite(labels["u"])]).all()
    swaps = tables.read(project / "results/triangulate/beam_01.swaps.parquet", "swaps")
    found = {name: tables.of_camera(swaps, name)["swapped"] for name in ("cam01", "cam02", "cam03")}
    true = np.zeros(100, bool)
    true[[*range(41, 62), 65, *range(67, 75), 77, 78, 81]] = True
    assert (found["cam02"] & true).sum() >= 30
    assert (found["cam02"] & ~true).sum() + found["cam01"].sum() + found["cam03"].sum() <= 2
    assert (project / "results/report/index.html").is_file()
    assert (project / "results/release/dior-0.1.0-beamwalker.tar").is_file()


@pytest.mark.slow
def test_who_stands_in_the_background_is_labelled_and_covered_where_all_people_are_asked_for(project):
    """OpenPose has found somebody in two of the cameras, whom the cover of the head is to hold in both."""
    edit(project / "config/config.yaml", "data_root:", "people: all\ndata_root:")
    edit(project / "config/sequences.tsv", "mlkit/{camera}.jsonl", "openpose/{camera}")
    snakemake(project, *[f"results/heads/beam_01.{camera}.parquet" for camera in ("cam01", "cam02", "cam03")])
    body = tables.read(project / "results/people/beam_01.parquet", "people_3d")
    labels = tables.read(project / "results/people/beam_01.labels.parquet", "people_2d")
    other = tables.rows(body, body["is_subject"] == "no")
    assert set(body["person"]) == {"person_1", "person_2"} and set(other["person"]) == {"person_2"}
    points, joints = tables.grid(other, "x", "y", "z")
    seen = np.isfinite(points[..., 0])
    assert seen.any(axis=1).sum() >= 95 and 1.5 < stature(points, joints) < 1.9
    # still, and metres away from the beam
    middle = np.nanmedian(points[seen.any(axis=1)], axis=1)
    assert np.ptp(middle[:, :2], axis=0).max() < 0.3 and middle[:, 0].max() < -3
    found = tables.read(project / "results/detections/beam_01.people.parquet", "detected_people")
    for camera in ("cam01", "cam02"):
        mine = tables.of_camera(tables.rows(labels, labels["person"] == "person_2"), camera)
        uv, names = tables.grid(mine, "u", "v")
        tracks = [tables.of_camera(tables.rows(found, found["track"] == number), camera) for number in (0, 1)]
        off = []
        for track in tracks:
            at, _ = tables.grid(track, "u", "v")
            off.append(np.nanmedian(np.linalg.norm(at - uv[track["frame"].reshape(at.shape[:2])[:, 0]], axis=-1)))
        assert min(off) < 15, off
        covers = tables.read(project / f"results/heads/beam_01.{camera}.covers.parquet", "other_covers")
        nose = uv[:, names.index("nose")]
        for frame in np.flatnonzero(np.isfinite(nose[:, 0])).tolist():
            here = tables.rows(covers, covers["frame"] == frame)
            (u, v) = nose[frame]
            assert ((here["u_min"] < u) & (u < here["u_max"]) & (here["v_min"] < v) & (v < here["v_max"])).any(), frame
    # who stands beside the third camera withholds none of its pictures
    heads = tables.read(project / "results/heads/beam_01.cam03.parquet", "heads")
    assert set(heads["status"]) == {"ok"}


def perturbed(text, seed, metres=0.05, degrees=2.0):
    """The TOML with every camera moved and turned by that much, each in a random direction."""
    import cv2

    from dior.geometry.camera import inverse_pose, pose

    rng = np.random.default_rng(seed)
    lines = []
    for name, entry in tomllib.loads(text).items():
        if "matrix" not in entry:
            continue
        wTc = inverse_pose(pose(cv2.Rodrigues(np.array(entry["rotation"]))[0], entry["translation"]))
        step, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        turn = cv2.Rodrigues(axis * np.radians(degrees))[0]
        cTw = inverse_pose(pose(wTc[:3, :3] @ turn, wTc[:3, 3] + metres * step))
        lines += [f"[{name}]", f'name = "{entry["name"]}"']
        lines += [f"rotation = {cv2.Rodrigues(cTw[:3, :3])[0].ravel().tolist()}"]
        lines += [f"translation = {cTw[:3, 3].tolist()}", ""]
    return "\n".join(lines)


def adjusted_project(project, shared, metres, degrees):
    """OpenPose, all four cameras close, adjusted on frames 1, 3, ... 99 from perturbed reference cameras."""
    data = shared / "real_outdoor"
    moved = project / "moved.toml"
    moved.write_text(perturbed((data / "reference/calibration_qualisys.toml").read_text(), 1, metres, degrees))
    edit(project / "config/sequences.tsv", "mlkit/{camera}.jsonl", "openpose_single/{camera}")
    for i in range(1, 5):
        path = project / f"config/sessions/beam/cam0{i}.yaml"
        edit(
            path,
            "reference: {file: reference/calibration_qualisys.toml",
            f"reference: {{file: {os.path.relpath(moved, data)}",
        )
    edit(project / "config/sessions/beam/cam04.yaml", "role: long_range", "role: close")
    with open(project / "config/sessions/beam/session.yaml", "a") as stream:
        stream.write("adjust:\n  beam_01: {first: 1, count: 50, step: 2}\n")


@pytest.mark.parametrize(
    ("metres", "degrees", "start"),
    [slow(0.0, 0.0, (13.7, 14.2)), slow(0.05, 2.0, (30.0, 150.0))],
    ids=["reference", "perturbed"],
)
def test_adjusted_cameras(project, shared, metres, degrees, start):
    adjusted_project(project, shared, metres, degrees)
    snakemake(project)
    rows = tables.read(project / "results/adjust/beam.metrics.parquet", "metrics")
    value = {(m, c): v for m, c, v in zip(rows["metric"], rows["camera"], rows["value"], strict=True)}
    assert start[0] <= value["adjust_error_before", ""] <= start[1]
    assert value["adjust_error_after", ""] <= 9.0
    for camera in ("cam01", "cam02", "cam03", "cam04"):
        labels = tables.read(project / f"results/reproject/beam_01.{camera}.parquet", "labels_2d")
        assert np.isin(labels["status"], ("ok", "occluded")).mean() > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "right", "wrong", "step", "words"),
    [
        ("sequences.tsv", "pc2.bag", "pc3.bag", "frames", ["pc3.bag", "no such bag"]),
        ("sequences.tsv", "mlkit/", "mlkt/", "detections", ["beam_01", "mlkt/cam01.jsonl"]),
        ("sequences.tsv", "mlkit/{camera}.jsonl", "openpose/{camera}", "detections", ["OpenPose", "mlkit"]),
        ("sessions/beam/cam02.yaml", "/cam02/color/image_raw", "/cam02/colour/image_raw", "frames", ["/cam02/color/"]),
        (
            "sessions/beam/cam02.yaml",
            "name: cam_02",
            "name: cam_20",
            "intrinsics",
            ["cam_20", "it has cam_01, cam_02"],
        ),
        (
            "sessions/beam/cam02.yaml",
            "reference: {file: ref",
            "reference: {file: refr",
            "place",
            ["refrerence/calibration_q"],
        ),
    ],
)
def test_a_mistake_is_one_clear_sentence(project, file, right, wrong, step, words):
    edit(project / "config/config.yaml", "report:", "detector: {format: mlkit}\nreport:")
    edit(project / "config" / file, right, wrong)
    code, text = snakemake(project, check=False)
    said = [line for line in text.splitlines() if line.startswith(f"dior {step}: ")]
    assert code != 0 and len(said) == 1 and all(word in said[0] for word in words), text[-3000:]
    assert "Traceback" not in text
