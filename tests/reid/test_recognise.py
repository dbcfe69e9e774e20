"""The table of a small project: what is in it, what is said of what is not, and which weights are refused."""

import csv
import io
import json
import zipfile

import numpy as np
import pytest

from dior.body.names import COCO_17
from dior.errors import DiorError
from dior.reid import inputs, recognise
from dior.tables import tables
from tests.reid import parity
from tests.report.conftest import START_NS, write_project

FPS, FRAMES = 30, 90
WALKS = [("indoor_01", "S01"), ("indoor_02", "S02"), ("indoor_03", "S01"), ("indoor_04", "S02")]
WALKS += [("outdoor_01", "S01"), ("outdoor_02", "S02"), ("outdoor_03", "S01"), ("outdoor_04", "S02")]
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
WHERE = {"length": 300, "chunks": 1}
BRIDGED = "gaps up to 0.4 s bridged; 61 are needed"


def made(root, frames=FRAMES):
    """A project of two people of different height in front of four cameras: tables by walk, as the rules give them."""
    write_project(root, [(name, who, "lab" if name.startswith("in") else "field") for name, who in WALKS])
    random = np.random.default_rng(1)
    # joint by joint from the head down, each person's at other places
    people = {who: random.uniform(50, 300, (17, 2)) for who in ("S01", "S02")}
    for uv in people.values():
        uv[:, 1].sort()
    paths = {"labels": [], "skeletons": [], "frames": []}
    for name, who in WALKS:
        for kind, file in (("labels", f"{name}.parquet"), ("skeletons", f"{name}.skeleton.parquet")):
            paths[kind].append(root / "results/reid" / file)
        paths["frames"].append(root / f"results/frames/{name}.parquet")
        stamps = START_NS + np.arange(frames) * 33_333_333
        uv = people[who] + random.normal(0, 2, (len(CAMERAS), frames, 17, 2))
        count = uv[..., 0].size
        tables.write(
            paths["labels"][-1],
            "labels_2d",
            {
                **{key: np.full(count, word, object) for key, word in (("subject", who), ("sequence", name))},
                "camera": np.repeat(np.array(CAMERAS, object), frames * 17),
                "joint": np.tile(np.array(COCO_17, object), len(CAMERAS) * frames),
                "frame": np.tile(np.repeat(np.arange(frames), 17), len(CAMERAS)),
                "stamp_ns": np.tile(np.repeat(stamps, 17), len(CAMERAS)),
                "u": uv[..., 0].ravel(),
                "v": uv[..., 1].ravel(),
                "status": np.full(count, "ok", object),
                "source": np.full(count, "mocap", object),
            },
        )
        each = frames * 17
        tables.write(
            paths["skeletons"][-1],
            "skeletons_3d",
            {
                **{key: np.full(each, word, object) for key, word in (("subject", who), ("sequence", name))},
                "joint": np.tile(np.array(COCO_17, object), frames),
                "instant": np.repeat(np.arange(frames), 17),
                "stamp_ns": np.repeat(stamps, 17),
                **{axis: np.full(each, np.nan) for axis in "xyz"},
                "n_views": np.full(each, -1),
                "status": np.full(each, "too_few_views", object),
            },
        )
        tables.write(
            paths["frames"][-1],
            "frames",
            {
                "camera": np.repeat(np.array(CAMERAS, object), frames),
                "frame": np.tile(np.arange(frames), len(CAMERAS)),
                "stamp_ns": np.tile(stamps, len(CAMERAS)),
                "height": np.full(len(CAMERAS) * frames, 720),
                "width": np.full(len(CAMERAS) * frames, 1280),
            },
        )
    return paths


def run(root, paths, networks=None, adaptations=("as_is",)):
    out = {key: root / f"results/reid/{name}.csv" for key, name in OUT.items()}
    recognise.run(root=root, **paths, networks=networks or {}, adaptations=list(adaptations), **WHERE, **out)
    return [list(csv.DictReader(path.open())) for path in out.values()]


OUT = {"out": "table", "out_cmc": "cmc", "out_left_out": "left_out"}


def detections(path, uv, frames=None):
    """COCO results of one person; `uv` (F, 17, 2)."""
    found = [
        {"image_id": i, "score": 1, "keypoints": np.column_stack([one, np.full(17, 0.9)]).ravel().tolist()}
        for i, one in enumerate(uv) if frames is None or i in frames
    ]  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found))


def test_without_networks_and_3d_nothing_can_be_compared(tmp_path):
    with pytest.raises(DiorError, match="no walk can be compared; indoor_01: "):
        run(tmp_path, made(tmp_path))


def test_short_walks_are_told(tmp_path):
    with pytest.raises(DiorError, match="no walk can be compared; indoor_01, cam01: 40 pictures; 61 are needed"):
        run(tmp_path, made(tmp_path, frames=40))


def test_two_people_are_needed(tmp_path):
    paths = made(tmp_path)
    sheet = tmp_path / "config/subjects.tsv"
    sheet.write_text(
        sheet.read_text().replace(
            "\t1.7\t0.01\tyes\nS02\tpseudonymS02\t1.7\t0.01\tyes", "\t1.7\t0.01\tyes\nS02\tpseudonymS02\t1.7\t0.01\tno"
        )
    )
    with pytest.raises(DiorError, match="two people or more"):
        run(tmp_path, paths)


def test_the_table_of_a_network_and_what_a_detector_saw(tmp_path):
    """Two people whose joints lie elsewhere are found. The detector's probes are some walks of them."""
    torch = pytest.importorskip("torch", reason="networks need PyTorch")
    from dior.reid import networks

    paths = made(tmp_path)
    torch.manual_seed(1)
    torch.save(networks.build("gaitgraph").state_dict(), tmp_path / "ours.pt")
    sheet = "sequence\tcamera\ttool\tzoom\tpath\n"
    for name, _ in WALKS[4:]:
        sheet += f"{name}\tcam04\tmlkit\t1\tfound/{name}.json\n"
        uv = inputs.camera_walks(tmp_path / f"results/reid/{name}.parquet", dict.fromkeys(CAMERAS, 1280))["cam04"].uv
        uv = uv if name != "outdoor_02" else 600 - uv
        detections(tmp_path / f"data/found/{name}.json", uv, range(70 if name != "outdoor_03" else 30))
    (tmp_path / "config/detectors.tsv").write_text(sheet)
    rows, curves, left_out = run(tmp_path, paths, {"gaitmixer": [], "gaitgraph": ["ours.pt"]}, ("as_is", "canonical"))
    assert tuple(rows[0]) == recognise.COLUMNS
    assert {(row["method"], row["weights"]) for row in rows} == {("gaitgraph", "ours.pt")}
    means = {(r["adaptation"], r["protocol"]): r for r in rows if not r["camera"]}
    assert len(means) == 8 and means["as_is", "per_camera"]["n"] == str(8 * 7 * 4)
    assert float(means["as_is", "other_recording"]["rank1"]) == 1
    own = [row for row in rows if row["keypoints"] == "mlkit"]
    assert {(row["environment"], row["camera"]) for row in own} == {("outdoor", "cam04")} and len(own) == 8
    # two walks are long enough, and 7 other cameras have a gallery of labels
    assert {row["n"] for row in own if row["protocol"] == "per_camera"} == {"14"}
    assert not [row for row in rows if row["keypoints"] == "detector"]
    assert [tuple(row.values())[2:] for row in left_out if row["what"] == "mlkit"] == [
        ("outdoor_03", "cam04", f"at most 30 pictures in a row with all joints, {BRIDGED}"),
        ("outdoor_02", "cam04", "the nose that it found is not above the ankles"),
    ]
    assert {row["why"] for row in left_out if row["what"] == "3D"} != set()
    of_mean = [r for r in curves if r["adaptation"] == "as_is" and r["protocol"] == "pooled" and not r["camera"]]
    assert [int(r["rank"]) for r in of_mean] == list(range(1, 21)) and float(of_mean[-1]["share"]) == 1
    first = {path.name: path.read_bytes() for path in (tmp_path / "results/reid").glob("*.csv")}
    run(tmp_path, paths, {"gaitmixer": [], "gaitgraph": ["ours.pt"]}, ("as_is", "canonical"))
    assert first == {path.name: path.read_bytes() for path in (tmp_path / "results/reid").glob("*.csv")}


@pytest.mark.parametrize(
    ("given", "there", "compared", "verdict"),
    [
        ([], {}, True, recognise.NO_OUTPUT),
        ([("outdoor", "cam04")], {}, True, recognise.TOO_SHORT),
        ([("outdoor", "cam04")], {"mlkit": [("outdoor", "cam04")]}, False, recognise.NO_NETWORK),
        ([("outdoor", "cam04")], {"mlkit": [("outdoor", "cam04")]}, True, None),
        ([("indoor", "cam04")], {"mlkit": [("indoor", "cam04")]}, True, recognise.NO_OUTPUT),
    ],
)
def test_a_long_range_camera_without_a_detectors_score_says_so(given, there, compared, verdict):
    tools = {
        tool: recognise.Gallery(tuple(recognise.Item("S01", "walk", "field", *view) for view in views), (), (), ())
        for tool, views in there.items()
    }
    rows = recognise.of_silence([("outdoor", "cam04")], tools, set(given), compared)
    assert [row["verdict"] for row in rows] == ([verdict] if verdict else [])
    if verdict:
        (line,) = list(csv.DictReader(io.StringIO(recognise.as_csv(rows))))
        assert line["keypoints"] == "detector" and line["rank1"] == "" and line["n"] == "0"


def test_a_detector_without_coco_joints_is_told(tmp_path):
    from dior.reid import detected

    paths = made(tmp_path)
    rows = np.full((FRAMES, 18, 3), 0.9)
    rows[..., :2] = 100 + np.arange(18)[:, None]
    found = [{"image_id": i, "score": 1, "keypoints": one.ravel().tolist()} for i, one in enumerate(rows)]
    (tmp_path / "found.json").write_text(json.dumps(found))
    given = [{"camera": "cam04", "tool": "openpose", "zoom": "1", "path": str(tmp_path / "found.json")}]
    own, lacking = detected.camera_walks(given, paths["frames"][4], "outdoor_01")
    assert not lacking and own[0][2].uv.shape == (FRAMES, 17, 2) and own[0][0] == "openpose"
    assert np.isfinite(own[0][2].uv).all()


def weights(path, content):
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("weights/data.pkl", content)
        file.writestr("weights/byteorder", "little")
    return path.name


def test_weights_that_are_none_end_with_one_sentence(tmp_path):
    """Before anything else is read: the paths of the tables do not exist."""
    torch = pytest.importorskip("torch", reason="networks need PyTorch")
    from dior.reid import networks

    nothing = dict.fromkeys(("labels", "skeletons", "frames"), [tmp_path / "no.parquet"])
    torch.save(networks.build("gaitgraph").state_dict(), tmp_path / "graph.pth")
    whole = (tmp_path / "graph.pth").read_bytes()
    (tmp_path / "cut.pth").write_bytes(whole[: len(whole) // 2])
    evil = weights(tmp_path / "evil.pth", b"cos\nsystem\n(S'touch " + str(tmp_path).encode() + b"/ran'\ntR.")
    for networks_given, words in (
        ({"gaitmixer": ["nowhere.pt"]}, "'reid.networks.gaitmixer' names nowhere.pt, where there is no file"),
        ({"gaitmixer": ["graph.pth"]}, "graph.pth: not weights of gaitmixer: .*they fit gaitgraph"),
        ({"gaitgraph": ["cut.pth"]}, "cut.pth: .*truncated"),
        ({"gaitgraph": [evil]}, "evil.pth: refused, .*it names os.system"),
    ):
        with pytest.raises(DiorError, match=words):
            run(tmp_path, nothing, networks_given)
    assert not (tmp_path / "ran").exists()


def test_without_pytorch_networks_say_what_to_install(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "torch", None)
    (tmp_path / "graph.pth").write_bytes(b"x")
    with pytest.raises(DiorError, match="pip install -r requirements-reid.txt"):
        run(tmp_path, dict.fromkeys(("labels", "skeletons", "frames"), []), {"gaitgraph": ["graph.pth"]})


def test_weights_are_called_by_their_file(tmp_path):
    pytest.importorskip("torch", reason="networks need PyTorch")
    path = parity.weights_file("gaitmixer.pt")
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "gaitmixer.pt").symlink_to(path)
    found = recognise.load({"gaitmixer": [str(path)]}, tmp_path)
    assert [one[:2] for one in found] == [("gaitmixer", "gaitmixer.pt")]
    found = recognise.load({"gaitmixer": ["a/gaitmixer.pt", "b/gaitmixer.pt"]}, tmp_path)
    assert [one[1] for one in found] == ["a/gaitmixer.pt", "b/gaitmixer.pt"]
