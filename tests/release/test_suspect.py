"""What a red light says is wrong has no place in a release, in its exports, its counts and its figures, unless somebody
accepts it, which is told."""

import csv
import json

import numpy as np
import pytest

from dior.evaluate import metrics as metrics_csv
from dior.release import exports, layout, suspect
from dior.release.suspect import NO_PLACE
from dior.tables import tables
from tests.release import small
from tests.release.made import FRAMES, JOINTS, build, files

NUMBERS = {kind: [name for name in names if name != "source"] for kind, names in NO_PLACE.items()}
WHY = "labels drawn over the pictures lie on the body (A. P.)"


def labelled(status):
    """Columns of `labels_2d`, everything known but where the status says otherwise."""
    count = len(status)
    known = np.where(np.isin(status, ("missing_3d", "suspect")), np.nan, 1.5)
    return {
        "subject": ["zebra-0001"] * count, "sequence": ["walk_1"] * count, "camera": ["cam01"] * count,
        "joint": [f"j{i}" for i in range(count)], "frame": [0] * count, "stamp_ns": [7] * count, "status": status,
        **dict.fromkeys(NUMBERS["labels_2d"], known), "source": np.where(np.isnan(known), "", "triangulated"),
    }  # fmt: skip


def test_labels_without_a_place_keep_their_rows_and_what_says_more():
    before = ["ok", "occluded", "out_of_frame", "behind_camera", "missing_3d", "suspect"]
    table = suspect.hidden(tables.to_arrow("labels_2d", labelled(before)))
    assert table.schema.equals(tables.to_arrow("labels_2d", labelled(before)).schema, check_metadata=True)
    assert table["status"].to_pylist() == ["suspect"] * 4 + ["missing_3d", "suspect"]
    for name in NO_PLACE["labels_2d"]:
        assert table[name].null_count == 6, name
    assert table["joint"].to_pylist() == [f"j{i}" for i in range(6)] and table["stamp_ns"].to_pylist() == [7] * 6


def test_points_without_a_place_keep_how_many_views_disagree():
    before = ["ok", "gap_filled", "too_few_views", "rejected", "suspect"]
    columns = {
        "subject": ["p"] * 5,
        "sequence": ["w"] * 5,
        "joint": list("abcde"),
        "instant": [0] * 5,
        "status": before,
    }
    columns |= {"stamp_ns": [3] * 5, "n_views": [2] * 5, "residual_px": [9.0] * 5}
    columns |= dict.fromkeys(NUMBERS["skeletons_3d"], [1.0] * 5)
    table = suspect.hidden(tables.to_arrow("skeletons_3d", columns))
    assert table["status"].to_pylist() == ["suspect", "suspect", "too_few_views", "rejected", "suspect"]
    assert all(table[name].null_count == 5 for name in NO_PLACE["skeletons_3d"])
    assert table["n_views"].to_pylist() == [2] * 5 and table["residual_px"].to_pylist() == [9.0] * 5
    left = set(tables.columns_of("skeletons_3d")) - set(NO_PLACE["skeletons_3d"])
    assert left == {"subject", "sequence", "joint", "instant", "stamp_ns", "n_views", "residual_px", "status"}
    left = set(tables.columns_of("labels_2d")) - set(NO_PLACE["labels_2d"])
    assert left == {"subject", "sequence", "camera", "joint", "frame", "stamp_ns", "status"}, (
        "a new column is thought of"
    )


@pytest.fixture
def red(made, tmp_path):
    """The build of `made`, whose walk_2 has a red camera cam02, and whose walk_3 has an impossible 3D."""
    (path,) = [one for one in made["metrics"] if one.name == "walk_2.parquet"]
    names = ("coverage", "in_box_share", "success_share", "detected_share")
    columns = {"metric": names, "subject": ["zebra-0001"] * 4, "sequence": ["walk_2"] * 4, "camera": ["cam02"] * 4,
               "role": ["long_range"] * 4, "value": [0.9, 0.06, 0.5, 0.7], "unit": ["share"] * 4, "n": [10] * 4,
               "tool": ["", "", "mlkit", "mlkit"]}  # fmt: skip
    tables.write(path, "metrics", columns)
    noticed = tmp_path / "world.parquet"
    tables.write_findings(
        noticed, [("walk_3", "error", "world_scale", "taller than Secondname"), ("walk_4", "error", "x", "")]
    )
    return made | {"findings": [noticed]}


def accept(given, text, session="field"):
    path = given["project"] / f"config/sessions/{session}/session.yaml"
    path.write_text(path.read_text() + f"labels_accepted: {text}\n")


def status_of(out, name):
    (path,) = out.glob(f"labels_2d/*/{name}.parquet")
    return tables.read(path, "labels_2d")["status"].tolist()


def test_a_release_has_no_place_for_what_is_red(red):
    before = files(red["project"] / "results")
    out = build(red)
    assert {
        name: content for name, content in files(red["project"] / "results").items() if "release/" not in name
    } == before
    for name, wrong in {"walk_1.cam02": False, "walk_2.cam01": False, "walk_2.cam02": True, "walk_3.cam01": True,
                        "walk_3.cam02": True}.items():  # fmt: skip
        (path,) = out.glob(f"labels_2d/*/{name}.parquet")
        table = tables.read(path, "labels_2d")
        assert len(table["frame"]) == FRAMES * len(JOINTS)
        assert (set(table["status"]) == {"suspect"}) == wrong, name
        assert np.isnan(table["u"]).all() == wrong and np.isnan(table["sigma_v"]).all() == wrong
    points = {
        walk: tables.read(next(out.glob(f"skeletons_3d/*/{walk}.parquet")), "skeletons_3d")
        for walk in ("walk_2", "walk_3")
    }
    assert points["walk_2"]["status"].tolist() == ["ok", "too_few_views"] and points["walk_2"]["x"][0] == 1.0
    assert points["walk_3"]["status"].tolist() == ["suspect", "too_few_views"] and np.isnan(points["walk_3"]["x"]).all()
    told = layout.rows_of(tables.read(out / "lights.parquet", "released_lights"))
    assert [tuple(row.values()) for row in told] == [
        ("apple-0002", "walk_3", "", "the 3D has the wrong size", ""),
        ("zebra-0001", "walk_2", "cam02", "6.0 % of the labels are in the hand boxes (limit 95.0 %)", ""),
    ]


def test_counts_figures_and_card_are_of_what_is_there(red):
    out = build(red)
    rows = {
        (row["metric"], row["sequence"], row["camera"], row["tool"]): row["value"]
        for row in metrics_csv.read(out / "metrics.csv")
    }
    assert rows["coverage", "walk_2", "cam02", ""] == 0.0 and rows["coverage", "walk_1", "cam01", ""] == 0.5
    assert rows["coverage", "walk_3", "cam01", ""] == 0.0
    assert not [key for key in rows if key[0] in ("in_box_share", "success_share")], "nor a pooled one"
    assert rows["detected_share", "walk_2", "cam02", "mlkit"] == 0.7, "it is not of the labels"
    card = " ".join((out / "README.md").read_text().split())
    assert "15 labels inside the picture on 27 frames" in card, "of 27, 3 a recording"
    assert (
        "| zebra-0001 | walk_2 | cam02 | 6.0 % of the labels are in the hand boxes (limit 95.0 %) | `suspect` | |"
        in card
    )
    assert "| apple-0002 | walk_3 | all, and the 3D | the 3D has the wrong size | `suspect` | |" in card
    assert "| lights.parquet |" not in card and "### `lights.parquet`" in card
    assert "15 labels" in json.loads((out / "croissant.json").read_text())["description"]
    splits = tables.read(out / "splits.parquet", "splits")
    assert "walk_3" in set(splits["sequence"]), "recordings stay where they are"
    told = "".join(content.decode(errors="replace") for content in files(out).values())
    assert "Secondname" not in told and "walk_4" not in told


def test_what_somebody_accepts_is_there_and_told(red):
    accept(red, f'{{walk_2/cam02: "{WHY}", walk_4: "nobody is to know it"}}')
    out = build(red)
    assert set(status_of(out, "walk_2.cam02")) == {"ok", "out_of_frame"}
    assert set(status_of(out, "walk_3.cam02")) == {"suspect"}
    assert any(row["metric"] == "in_box_share" for row in metrics_csv.read(out / "metrics.csv")), "with its red figure"
    (row,) = [row for row in layout.rows_of(tables.read(out / "lights.parquet", "released_lights")) if row["accepted"]]
    assert (row["sequence"], row["camera"], row["accepted"]) == ("walk_2", "cam02", WHY)
    assert f"| as they are | {WHY} |" in (out / "README.md").read_text()
    made_of = json.loads((out / "provenance.json").read_text())["sequences"]
    assert made_of["walk_2"]["accepted"] == {"cam02": WHY} and "accepted" not in made_of["walk_1"]


def test_a_walk_that_is_accepted_is_with_all_its_cameras(red):
    accept(red, f'{{walk_3: "{WHY}", walk_2: "{WHY}"}}')
    out = build(red)
    assert not [path for path in out.glob("labels_2d/*/*") if "suspect" in tables.read(path, "labels_2d")["status"]]
    found = layout.rows_of(tables.read(out / "lights.parquet", "released_lights"))
    assert [(row["sequence"], row["camera"], row["accepted"]) for row in found] == [
        ("walk_3", "", WHY),
        ("walk_2", "cam02", WHY),
    ]


def test_a_cameras_word_does_not_mend_the_3d(red):
    accept(red, f'{{walk_3/cam02: "{WHY}"}}')
    assert set(status_of(build(red), "walk_3.cam02")) == {"suspect"}


def test_nor_is_it_told_while_the_3d_is_in_doubt(red):
    """It is in no use: whoever reads it would take the labels for those that somebody has looked at."""
    tables.write_findings(red["findings"][0], [("walk_2", "error", "world_floor", "")])
    accept(red, f'{{walk_2/cam02: "{WHY}"}}')
    found = layout.rows_of(tables.read(build(red) / "lights.parquet", "released_lights"))
    assert [(row["sequence"], row["camera"], row["accepted"]) for row in found] == [
        ("walk_2", "", ""), ("walk_2", "cam02", ""),
    ]  # fmt: skip


def test_who_makes_the_release_is_told_what_has_no_place(red, capsys):
    accept(red, f'{{walk_2: "{WHY}", walk_3/cam02: "{WHY}"}}')
    build(red)
    lines = [line for line in capsys.readouterr().err.splitlines() if "suspect" in line or "accepted" in line]
    assert lines == [
        "release: walk_3: its labels are suspect and have no place: the 3D has the wrong size; mend it, or say why "
        "they are good in `labels_accepted` of session.yaml",
        "release: labels_accepted of walk_3/cam02 is not used: nothing is red that it could accept",
    ]


def test_a_release_of_good_lights_has_no_table_of_them(built):
    assert not (built["out"] / "lights.parquet").exists()
    assert "in doubt" not in (built["out"] / "README.md").read_text()


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The exports of a release whose walk_1 has a suspect cam02, and whose walk_3 is suspect whole."""
    root = tmp_path_factory.mktemp("suspect")
    release = small.build(root / "dior-0.1.0")
    for path in [release / "labels_2d/pa11/walk_1.cam02.parquet", *release.glob("labels_2d/pb22/walk_3.*")]:
        tables.write_arrow(path, suspect.hidden(tables.read_arrow(path, "labels_2d")))
    path = release / "skeletons_3d/pb22/walk_3.parquet"
    tables.write_arrow(path, suspect.hidden(tables.read_arrow(path, "skeletons_3d")))
    out = root / "dior-0.1.0-exports"
    exports.run(release=small.summed(release), formats=list(exports.FORMATS), out=out)
    return out


def test_coco_has_no_keypoints_of_suspect_labels(exported):
    for part, wrong in (("train", {("walk_1", "cam02")}), ("test", {("walk_3", "cam01"), ("walk_3", "cam02")})):
        coco = json.loads((exported / f"coco/person_keypoints_{part}.json").read_text())
        images = {image["id"]: (image["sequence"], image["camera"]) for image in coco["images"]}
        assert wrong < set(images.values())
        assert wrong.isdisjoint({images[one["image_id"]] for one in coco["annotations"]})


def test_gait_formats_leave_suspect_recordings_out(exported):
    with (exported / "gaitgraph/sequences.csv").open() as stream:
        kept = {(row["sequence"], row["camera"]): int(row["kept"]) for row in csv.DictReader(stream)}
    assert {key for key, n in kept.items() if not n} >= {("walk_1", "cam02"), ("walk_3", "cam01"), ("walk_3", "cam02")}
    assert kept["walk_1", "cam01"] > 0
    pickles = {path.name for path in exported.rglob("*.pkl")}
    assert {"03-walk_1.cam02.pkl", "03-walk_3.cam01.pkl", "03-walk_3.cam02.pkl"}.isdisjoint(
        pickles
    ) and "03-walk_1.cam01.pkl" in pickles
    with (exported / "opengait/sequences.csv").open() as stream:
        kept = {(row["sequence"], row["camera"]): int(row["kept"]) for row in csv.DictReader(stream)}
    assert kept["walk_1", "cam02"] == kept["walk_3", "cam01"] == 0


def test_shards_say_that_labels_are_suspect_and_not_where(exported):
    import tarfile

    with (exported / "webdataset/shards.csv").open() as stream:
        shards = {(row["sequence"], row["camera"]): row["shard"] for row in csv.DictReader(stream)}
    with tarfile.open(exported / "webdataset" / shards["walk_1", "cam02"]) as tar:
        (sample, *_) = [json.load(tar.extractfile(one)) for one in tar if one.name.endswith(".json")]
    assert sample["annotation"] is None
    assert set(map(tuple, sample["labels"].values())) <= {(None, None, "suspect"), (None, None, "missing_3d")}


def test_files_of_a_walk_whose_3d_is_suspect_have_no_point(exported):
    import ezc3d

    rows = (exported / "trc/pb22/walk_3.trc").read_text().splitlines()[6:]
    assert rows and all(not cell for row in rows for cell in row.split("\t")[2:])
    points = ezc3d.c3d(str(exported / "c3d/pb22/walk_3.c3d"))
    assert (points["data"]["meta_points"]["residuals"] == -1).all()
    assert not np.nan_to_num(points["data"]["points"][:3]).any()
    (motion,) = [path for path in exported.glob("bids/sub-pb22/motion/*_motion.tsv")]
    assert set(motion.read_text().split()) == {"n/a"}
    other = (exported / "trc/pa11/walk_1.trc").read_text().splitlines()[6:]
    assert any(cell for row in other for cell in row.split("\t")[2:])
