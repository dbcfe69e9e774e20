"""What the report says of re-identification, from a made-up table."""

import hashlib
import re

import numpy as np
import pytest

from dior.reid import recognise
from dior.reid.protocols import PROTOCOLS, Item
from dior.report import reid
from dior.tables.files import write_text

VIEWS = [(place, f"cam{i:02d}") for place in ("indoor", "outdoor") for i in range(1, 5)]
METHODS = [("gaitgraph", "gaitgraph.pth"), ("gaitmixer", "gaitmixer.pt"), ("gaitmixer", "ours.pt")]
FAR = ("outdoor", "cam04")


def row(method, weights, adaptation, protocol, view, rank1, keypoints="labels", n=392):
    good = rank1 > 0.12
    share = np.linspace(rank1, 1, 20)
    return dict(zip(recognise.KEYS, (method, weights, adaptation, keypoints, protocol, *view), strict=True)) | {
        "rank1": rank1, "low": max(rank1 - 0.04, 0.0), "high": rank1 + 0.04, "hits": round(rank1 * n), "n": n,
        "chance": 0.0714, "null95": 0.11, "p": 0.001 if good else 0.4, "rank5": share[4], "mean_ap": rank1,
        **{f"{key}_{end}": rank1 for key in ("rank5", "mean_ap", "mean_inp", "tar") for end in ("low", "high")},
        "mean_inp": rank1 / 2, "tar": rank1 / 4,
        "verdict": "above chance" if good else "at chance", "cmc": tuple(share.tolist()),
    }  # fmt: skip


def table(detected=True, networks=True):
    rows = []
    for protocol in ("other_recording", "other_place"):
        for i, view in enumerate([("", ""), *VIEWS]):
            rows.append(row("baseline", "", "", protocol, view, 0.92 - 0.005 * i, "3D", 56))
    for k, (method, weights) in enumerate(METHODS if networks else []):
        for a, adaptation in enumerate(("as_is", "scaled", "canonical")):
            for protocol in PROTOCOLS:
                for i, view in enumerate([("", ""), *VIEWS]):
                    rows.append(row(method, weights, adaptation, protocol, view, 0.07 + 0.01 * i + 0.05 * a * k))
            if detected:
                rows.append(row(method, weights, adaptation, "per_camera", FAR, 0.08, "mlkit 4x", 21))
    if not detected:
        rows += recognise.of_silence([FAR], {}, set(), networks)
    return rows


def written(folder, rows, left_out=(("labels", "field", "outdoor_07", "cam04", "45 pictures; 61 are needed"),)):
    folder.mkdir(parents=True, exist_ok=True)
    texts = (recognise.as_csv(rows), recognise.curves_csv(rows), recognise._csv(recognise.LEFT_OUT, left_out))
    paths = [folder / f"{name}.csv" for name in ("table", "cmc", "left_out")]
    for path, text in zip(paths, texts, strict=True):
        write_text(path, text)
    return paths


def page(folder, rows):
    paths = written(folder, rows)
    reid.run(title="A & B", **dict(zip(("table", "cmc", "left_out"), paths, strict=True)), out=folder)
    return " ".join((folder / "index.html").read_text().split())


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reid")
    return folder, page(folder, table())


def test_it_says_above_the_table_where_far_labels_come_from(full):
    _, text = full
    before = text.split("<table>")[0]
    assert "come from the close cameras, as in the paper" in before
    assert "It says nothing about recognising anybody in far pictures." in before
    assert "Chance is what a gallery in random order gives." in before and "at chance" in before
    assert "A &amp; B" in text


def test_every_protocol_has_a_table_with_every_camera(full):
    _, text = full
    tables = text.split("<table>")[1:]
    assert len(tables) == 6  # four protocols, the detector, what was left out
    for one, (title, _) in zip(tables, reid.PROTOCOLS.values(), strict=False):
        assert all(f">{place} {camera}</th>" in one for place, camera in VIEWS), title
        assert one.count("<tr><td>") == (10 if "3D" in one else 9)
    # a rate at chance says so, in its cell and in the last column
    assert "7.0 % <small>at chance</small>" not in tables[0].split("all in all")[0]
    assert "8.0 % <small>at chance</small>" in tables[0] and "<td>at chance</td>" in tables[0]
    assert "<td>baseline</td><td>3D</td>" in tables[2] and "92.0 %" in tables[2] and "baseline" not in tables[0]
    assert "<td>gaitmixer ours.pt</td>" in tables[0] and "<td>gaitgraph</td>" in tables[0]
    assert "45 pictures; 61 are needed" in tables[5]


def test_how_much_is_at_chance_is_counted(full):
    told = reid.read(*(full[0] / f"{name}.csv" for name in ("table", "cmc", "left_out")))
    means = [r for r in table() if not r["camera"] and r["keypoints"] != "mlkit 4x"]
    chance = sum(r["verdict"] == "at chance" for r in means)
    assert reid.in_words(told).startswith(f"{chance} of {len(means)} means over the probe cameras are at chance.")
    assert "baseline (3D)" in reid.in_words(told) and "gaitgraph" not in reid.in_words(told)


def test_a_detectors_own_output_is_beside_it(full):
    _, text = full
    own = text.split("Detectors' own output at long range")[1]
    assert "this does tell something about far pictures" in own and own.count("<td>mlkit 4x</td>") == 9
    assert reid.NO_OUTPUT not in text


@pytest.mark.slow
def test_without_it_the_page_says_so(tmp_path):
    text = page(tmp_path, table(detected=False))
    assert f"outdoor cam04: {reid.NO_OUTPUT}." in text and "config/detectors.tsv" in text


def test_the_baseline_alone(tmp_path):
    text = page(tmp_path, table(detected=False, networks=False))
    assert "All 2 means over the probe cameras are above chance." in text
    assert sorted(path.name for path in (tmp_path / "plots").iterdir()) == ["reid_cmc.svg", "reid_other_recording.svg"]


def test_nothing_compared_is_said(tmp_path):
    items = [Item(who, who, "lab", "indoor", "cam01") for who in ("S01", "S02")]
    rows = recognise.rows_of({"method": "baseline", "keypoints": "3D"}, np.ones((2, 2)), items, ["other_recording"])
    assert {one["verdict"] for one in rows} == {"no trial"}
    text = page(tmp_path, rows)
    assert "Nothing could be compared." in text and "There is no long-range camera." in text
    assert list((tmp_path / "plots").iterdir()) == []


@pytest.mark.slow
def test_pictures_are_there_and_the_same_again(full, tmp_path):
    folder, text = full
    names = {path.name for path in (folder / "plots").iterdir()}
    kinds = [f"reid_{p}_{a}.svg" for p in ("per_camera", "other_recording") for a in ("as_is", "scaled", "canonical")]
    assert names == {*kinds, "reid_cmc.svg"}
    assert set(re.findall(r'src="plots/([^"]+)"', text)) == names
    page(tmp_path, table())
    for path in (folder / "plots").iterdir():
        again = tmp_path / "plots" / path.name
        assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(again.read_bytes()).digest()
