"""The release holds what was agreed to, under pseudonyms, and is the same bytes each time."""

import hashlib
import io
import json
import os
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.release import layout, metrics_csv, shift_stamps, walk_files
from dior.tables import tables
from dior.tables.files import written_whole
from tests.release.made import (
    CONSENT,
    PSEUDONYM,
    ROLES,
    WALKS,
    build,
    covers,
    figure,
    files,
    labels,
    pixels,
    project,
    sheets,
    walked,
)

SECRETS = ("Realname", "Secondname", "Refuser", "mango-0003", "walk_4", "walk_5", "host", "/home")


def told(name, content):
    """All that a file says, tables decoded."""
    if not name.endswith(".parquet"):
        return content.decode()
    table = pq.read_table(io.BytesIO(content))
    fields = [(field.name, field.metadata) for field in table.schema]
    return repr((table.to_pydict(), table.schema.metadata, fields, content))


def test_who_did_not_agree_is_in_no_file(built):
    found = files(built["out"])
    recordings = [("apple-0002", "walk_3"), ("zebra-0001", "walk_1"), ("zebra-0001", "walk_2")]
    expected = {f"{table}/{who}/{name}.{camera}.parquet" for table in ("labels_2d", "frames", "covers")
                for who, name in recordings for camera in ROLES}  # fmt: skip
    expected |= {f"{table}/{who}/{name}.parquet" for table in ("skeletons_3d", "gait", "gait_events", "gait_steps")
                 for who, name in recordings}  # fmt: skip
    expected |= {f"detections/{who}/{name}.{camera}.parquet" for who, name in recordings[::2] for camera in
                 ("cam01", "cam03")}  # fmt: skip
    expected |= {"boxes/zebra-0001/walk_2.cam02.parquet"}
    expected |= {f"marks/zebra-0001/{name}.parquet" for name in ("walk_1", "walk_2")}
    tables_at_the_top = ("cameras", "camera_covariance", "clocks", "sequences", "subjects", "splits")
    expected |= {f"{name}.parquet" for name in tables_at_the_top}
    expected |= {"README.md", "LICENSE", "CITATION.cff", "croissant.json", "provenance.json", "metrics.csv"}
    expected |= {f"checksums/{who}/SHA256SUMS" for who in ("apple-0002", "zebra-0001")}
    assert set(found) == expected | {"SHA256SUMS"}
    for name, content in found.items():
        said = told(name, content)
        assert not [secret for secret in SECRETS if secret in said], name


def test_tables_are_those_of_the_pipeline_but_for_the_subject(built):
    out = built["out"]
    name = "labels_2d/zebra-0001/walk_1.cam01.parquet"
    released, source = pd.read_parquet(out / name), pd.read_parquet(built["labels"][0])
    assert set(released["subject"]) == {"zebra-0001"}
    pd.testing.assert_frame_equal(released.drop(columns="subject"), source.drop(columns="subject"))
    assert pq.read_schema(out / name).field("u").metadata[b"unit"] == b"px"
    assert tables.metadata(out / name)["dior_table"] == "labels_2d"
    people = tables.read(out / "subjects.parquet", "subjects")
    assert people["subject"].tolist() == ["apple-0002", "zebra-0001"]
    np.testing.assert_array_equal(people["height_m"], [np.nan, 1.72])
    walks = tables.read(out / "sequences.parquet", "sequences")
    assert walks["sequence"].tolist() == ["walk_3", "walk_1", "walk_2"], "by pseudonym"
    assert walks["session_order"].tolist() == [2, 0, 1]


def test_detections_are_a_file_per_camera(built):
    found = tables.read(built["out"] / "detections/apple-0002/walk_3.cam03.parquet", "released_detections")
    assert set(found["subject"]) == {"apple-0002"} and set(found["sequence"]) == {"walk_3"}
    assert set(found["camera"]) == {"cam03"} and found["frame"].tolist() == [0, 1, 2]
    assert found["person"].tolist() == [0, 0, -1] and found["u"].tolist() == [3.0, 4.0, 5.0]


def test_boxes_are_those_that_were_drawn(built):
    found = tables.read(built["out"] / "boxes/zebra-0001/walk_2.cam02.parquet", "released_boxes")
    assert found["frame"].tolist() == [1, 2] and found["stamp_ns"].tolist() == [10**8, 2 * 10**8]
    edges = np.column_stack([found[key] for key in ("u_min", "v_min", "u_max", "v_max")])
    assert edges.tolist() == [[5, 6, 7, 8], [1, 2, 3, 4.5]]


def test_marks_and_checks_are_of_the_walk(built):
    out = built["out"]
    marks = tables.read(out / "marks/zebra-0001/walk_2.parquet", "released_marks")
    assert marks["kind"].tolist() == ["mark"] * 2 and marks["frame"].tolist() == [0, 2]
    assert marks["u"].tolist() == [3.5, 1.5] and marks["inlier"].tolist() == [1, 0]
    assert marks["stamp_ns"].tolist() == [0, 2 * 10**8]
    checks = tables.read(out / "marks/zebra-0001/walk_1.parquet", "released_marks")
    assert [checks[key].tolist() for key in ("kind", "camera", "frame", "joint", "u", "v", "inlier")] == [
        ["check"], ["cam01"], [1], ["nose"], [10.0], [20.5], [-1],
    ]  # fmt: skip
    assert np.isnan(checks["x"]).all() and np.isnan(checks["residual_px"]).all()


def test_clocks_are_those_of_released_walks_by_pseudonym(built):
    found = tables.read(built["out"] / "clocks.parquet", "released_clocks")
    rows = list(zip(*(found[key].tolist() for key in ("subject", "sequence", "camera", "offset_s")), strict=True))
    assert rows[:3] == [("apple-0002", "walk_3", camera, s) for camera, s in zip(ROLES, (0, 0.02, -0.01), strict=True)]
    assert [row[1] for row in rows] == ["walk_3"] * 3 + ["walk_1"] * 3 + ["walk_2"] * 3
    assert np.isnan(found["sigma_s"][1]) and found["source"][1] == "estimated" and found["method"][1] == "boxes"


def test_cameras_have_their_own_and_the_joint_covariance(built):
    out = built["out"]
    rig = tables.read(out / "cameras.parquet", "released_cameras")
    names = list(zip(rig["session"], rig["camera"], strict=True))
    assert names == [(session, camera) for session in ("field", "lab") for camera in ROLES]
    own = rig["covariance"].reshape(6, 6, 6)
    np.testing.assert_array_equal(own[0], np.diag(np.arange(1.0, 7.0)))
    np.testing.assert_array_equal(own[2], np.diag(np.arange(7.0, 13.0)))
    assert np.isnan(own[1]).all(), "nobody knows it of cam02"
    joint = camera_tables.read_camera_covariance(out / "camera_covariance.parquet", ["cam01", "cam03"])
    assert joint[0, 6] == 0.5 and joint[11, 11] == 12


def test_pictures_are_the_same_file_at_a_second_place(built):
    out = built["out"]
    shard = out / "frames/zebra-0001/walk_1.cam01.parquet"
    assert os.path.samefile(shard, built["pixels"][0])
    assert tables.metadata(shard) == tables.own_metadata("released_frames")


def test_pictures_are_copied_where_there_are_no_links(made, built, monkeypatch, tmp_path):

    def refused(*_):
        raise OSError("no links here")

    monkeypatch.setattr(walk_files.os, "link", refused)
    out = build(made, out=tmp_path / "elsewhere/dior-0.1.0")
    assert not os.path.samefile(out / "frames/zebra-0001/walk_1.cam01.parquet", made["pixels"][0])
    assert files(out) == files(built["out"])


def test_figures_are_pooled_over_released_walks_only(built):
    """(0.5 * 10 + 0.8 * 10 + 0.9 * 20) / 40; with the walk of the one who refused it would be 0.03."""
    rows = pd.read_csv(built["out"] / "metrics.csv")
    assert set(rows["subject"].dropna()) == {"zebra-0001", "apple-0002"}
    overall = rows[
        (rows["metric"] == "coverage") & rows[["subject", "sequence", "camera", "role", "joint"]].isna().all(axis=1)
    ]
    assert overall[["metric", "value", "n"]].values.tolist() == [["coverage", 0.775, 40]]
    adjusted = rows[rows["metric"] == "adjust_error_after"]
    assert adjusted[["value", "n"]].values.tolist() == [[8.0, 5]], "only who agreed shapes the poses"


def test_a_figure_of_a_person_without_a_sequence_is_not_released(tmp_path):
    """Only an adjustment's figures are of no walk; whose a person's are, and whether it agreed, nothing says."""
    for name, sequence, who in (("all", "", ""), ("person", "", "mango-0003"), ("refused", "walk_4", "mango-0003")):
        figure(tmp_path / f"{name}.parquet", sequence, who, 1.0, 1)
    rows = metrics_csv.released(sorted(tmp_path.glob("*.parquet")), {"walk_1": {"subject": "zebra-0001"}})
    assert [(row["sequence"], row["subject"]) for row in rows] == [("", "")]


def test_the_same_input_gives_the_same_bytes(made, built, tmp_path):
    turned = {key: value[::-1] for key, value in made.items() if isinstance(value, list)}
    assert files(build(made, **turned, out=tmp_path / "elsewhere/dior-0.1.0")) == files(built["out"])


KILLED = """
import os, pathlib, signal
from dior.release import package
from tests.release import made as project

def killed(*_):
    os.kill(os.getpid(), signal.SIGKILL)

given = project.project(pathlib.Path({root!r}))
{where} = killed
project.build(given)
"""


@pytest.mark.slow
@pytest.mark.parametrize("where", ["package.checksums.write", "os.replace"])
def test_a_build_that_was_killed_and_run_again_is_the_same(built, tmp_path, where):
    code = KILLED.format(root=str(tmp_path), where=where)
    done = subprocess.run([sys.executable, "-c", code])
    assert done.returncode == -signal.SIGKILL
    release = tmp_path / "results/release"
    (half,) = release.iterdir()
    assert half.name.startswith(".dior-0.1.0.") and half.name.endswith(".part"), "half of it is beside its place"
    again = {key: [tmp_path / path.relative_to(built["project"]) for path in value] for key, value in built.items()
             if isinstance(value, list)}  # fmt: skip
    out = build(built, **again, project=tmp_path, out=release / "dior-0.1.0")
    assert files(out) == files(built["out"])
    assert [path.name for path in release.iterdir()] == ["dior-0.1.0"]


def test_checksums_are_those_of_sha256sum(built):
    out = built["out"]
    done = subprocess.run(["sha256sum", "-c", "SHA256SUMS"], cwd=out, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    listed = [line[66:] for line in (out / "SHA256SUMS").read_text().splitlines()]
    assert listed == sorted(set(files(out)) - {"SHA256SUMS"})


def test_every_table_is_in_the_layout(built):
    out = built["out"]
    by_layout = {path for part in layout.parts_of(out) for path in out.glob(part.pattern)}
    assert by_layout == set(out.rglob("*.parquet"))
    for part in layout.parts_of(out):
        assert {tables.metadata(path)["dior_table"] for path in out.glob(part.pattern)} == {part.table}


@pytest.mark.slow
def test_nothing_of_an_earlier_release_stays(made, tmp_path, capsys):
    (build(made) / "stale.parquet").touch()
    sheets(tmp_path, CONSENT | {"Secondname": "no"})
    names = set(files(build(made)))
    assert "release: 1 of 2 people of the last build are not in it any more" in capsys.readouterr().err
    assert "stale.parquet" not in names and not [name for name in names if "apple" in name]


def test_who_withdrew_is_in_nothing_beside_the_release(made):
    """Neither a tarball, whole or half-made, nor the exports; the tarballs of the others stay."""
    out = made["out"]
    mine = [f"{out.name}-zebra-0001.tar", f".{out.name}-zebra-0001.part.tar", f".{out.name}-zebra-0001.part.json"]
    theirs = [name.replace("zebra-0001", who) for name in mine for who in ("apple-0002", "metadata")]
    out.with_name(f"{out.name}-exports").mkdir(parents=True)
    for name in (*mine, *theirs, f"{out.name}-exports/README.md"):
        (out.parent / name).write_text("made of everybody")
    sheets(made["project"], CONSENT | {"Secondname": "no"})
    build(made)
    assert sorted(path.name for path in out.parent.iterdir()) == sorted([out.name, *mine])
    sheets(made["project"], dict.fromkeys(CONSENT, "no"))
    with pytest.raises(DiorError, match="no subject's consent_release is yes"):
        build(made)
    assert list(out.parent.iterdir()) == []


def test_a_build_that_fails_leaves_the_earlier_one(made):
    before = files(build(made))
    made["labels"][3].write_bytes(b"half a file")
    with pytest.raises(DiorError, match="walk_2.cam01.parquet: is not what its job wrote"):
        build(made)
    assert files(made["out"]) == before
    assert [path.name for path in made["out"].parent.iterdir()] == ["dior-0.1.0"]


def as_a_job_writes(path, content):
    with written_whole(path) as part:
        part.write_bytes(content)


@pytest.mark.slow
def test_a_part_of_a_session_is_called_after_a_released_walk(tmp_path):
    """cam01 was bumped before walk_4, which is not released, so that walk_6 after it tells the name."""
    walks = (*WALKS[:3], WALKS[3], ("walk_6", "Realname", "field", "outdoor", "coat"))
    arguments = project(tmp_path, walks[:4])
    session = tmp_path / "config/sessions/field"
    (session / "cam01@walk_4.yaml").write_text((session / "cam01.yaml").read_text())
    sheets(tmp_path, CONSENT, walks=walks)
    for kind in ("labels", "pixels", "covers", "skeletons", "frames", "clocks", "provenance"):
        for path in [path for path in arguments[kind] if path.name.startswith("walk_2.")]:
            twin = path.with_name(path.name.replace("walk_2", "walk_6"))
            if kind == "labels":
                labels(twin, "zebra-0001", "walk_6", path.stem.split(".")[1])
            elif kind == "pixels":
                pixels(twin, "zebra-0001", "walk_6", path.stem.split(".")[1])
            elif kind == "covers":
                covers(twin, "zebra-0001", "walk_6", path.stem.split(".")[1])
            elif kind in ("skeletons", "clocks"):
                name = {"skeletons": "skeletons_3d", "clocks": "offsets"}[kind]
                table = tables.read(path, name)
                tables.write(twin, name, table | {"sequence": np.array(["walk_6"] * len(table["sequence"]), object)})
            else:
                as_a_job_writes(twin, path.read_bytes())
            arguments[kind].append(twin)
    arguments["gait"] += walked(arguments["skeletons"][0].parent.parent, "zebra-0001", "walk_6")
    for kind, name in (("cameras", "cameras"), ("covariances", "camera_covariance")):
        path = next(path for path in arguments[kind] if "field" in path.name)
        table = tables.read(path, name)
        twin = path.with_name(path.name.replace("field", "field@walk_4"))
        tables.write(twin, name, table | {"session": np.array(["field@walk_4"] * len(table["session"]), object)})
        arguments[kind].append(twin)
    out = build(arguments)
    walks = tables.read(out / "sequences.parquet", "sequences")
    parts = dict(zip(walks["sequence"], walks["session"], strict=True))
    assert parts == {"walk_1": "lab", "walk_2": "field", "walk_3": "field", "walk_6": "field@walk_6"}
    for name, table in (("cameras", "released_cameras"), ("camera_covariance", "camera_covariance")):
        assert set(tables.read(out / f"{name}.parquet", table)["session"]) == {"field", "field@walk_6", "lab"}
    assert not [name for name, content in files(out).items() if "walk_4" in told(name, content)]
    assert "cam01.yaml" in json.loads((out / "provenance.json").read_text())["sessions"]["field@walk_6"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: sheets(m["project"], dict.fromkeys(PSEUDONYM, "")), "no subject's consent_release is yes"),
        (lambda m: m["skeletons"].pop(0), "'walk_1' has no table of skeletons"),
        (lambda m: m["labels"].pop(1), "'walk_1.cam02' has no table of labels"),
        (lambda m: m["pixels"].pop(1), "'walk_1.cam02' has no table of pictures"),
        (lambda m: m["provenance"].pop(1), "'walk_2' has no table of checksums"),
        (lambda m: m["frames"].append(m["frames"][0]), "'walk_1' has two tables of frames"),
        (lambda m: m["cameras"].pop(1), "camera 'cam01' of session 'lab' is in no table"),
        (lambda m: m["cameras"].append(m["cameras"][0].rename(m["cameras"][0].with_name("b.parquet"))), "no such file"),
        (
            lambda m: labels(m["labels"][0], "mango-0003", "walk_1", "cam01"),
            "the subject is mango-0003, but the sheet says zebra-0001",
        ),
        (lambda m: labels(m["labels"][0], "zebra-0001", "walk_2", "cam01"), "the sequence is walk_2, but the sheet"),
        (lambda m: m["labels"][0].unlink(), "walk_1.cam01.parquet: there is no such file"),
        (
            lambda m: pixels(m["pixels"][0], "mango-0003", "walk_1", "cam01"),
            "walk_1.cam01.parquet: the subject is mango-0003, not zebra-0001",
        ),
        (
            lambda m: pixels(m["pixels"][0], "zebra-0001", "walk_1", "cam01", count=2),
            "has 2 rows, whose frames and stamps are not those of the 3 pictures of walk_1, camera cam01",
        ),
    ],
)
def test_what_does_not_fit_is_refused(made, change, message):
    change(made)
    with pytest.raises(DiorError, match=message):
        build(made)
    assert not made["out"].exists()


def test_two_tables_of_a_camera_are_refused(made):
    twin = made["cameras"][0].with_name("twin.parquet")
    as_a_job_writes(twin, made["cameras"][0].read_bytes())
    made["cameras"].append(twin)
    with pytest.raises(DiorError, match="camera 'cam01' of session 'field' is in two tables"):
        build(made)


@pytest.mark.slow
def test_the_gallery_is_of_released_subjects_under_pseudonyms_without_files(made, tmp_path):
    who = ["mango-0003", "apple-0002", "zebra-0001", "zebra-0001"]
    table = {"subject": who, "outfit": ["coat", "", "coat", "coat"], "angle": ["frontal"] * 4, "picture": [0, 0, 0, 1],
             "file": [f"gallery/{name}/{i}.jpg" for i, name in enumerate(who)], "height": [72] * 4,
             "width": [128] * 4}  # fmt: skip
    made["gallery"] = tmp_path / "gallery.parquet"
    tables.write(made["gallery"], "gallery", table)
    out = build(made)
    found = pq.read_table(out / "gallery.parquet").to_pandas()
    assert found["subject"].tolist() == ["apple-0002", "zebra-0001", "zebra-0001"]
    assert found["picture"].tolist() == [0, 0, 1] and "file" not in found and found["stamp_ns"].isna().all()
    said = told("gallery.parquet", (out / "gallery.parquet").read_bytes())
    assert not [name for name in ("mango-0003", ".jpg") if name in said]
    card = (out / "README.md").read_text()
    assert "### `gallery.parquet`" in card and "config_name: gallery" in card
    sheet = made["project"] / "config/sequences.tsv"
    third = "mlkit/{camera}.jsonl\t\t"
    rows = sheet.read_text().splitlines()
    rows[3] = rows[3].replace(third, third + "limped")
    sheet.write_text("\n".join(rows) + "\n")
    kept = pq.read_table(build(made) / "gallery.parquet").to_pandas()
    assert kept["subject"].tolist() == ["zebra-0001"] * 2, "every sequence of apple-0002 is excluded"
    made["gallery"] = None
    out = build(made)
    assert not (out / "gallery.parquet").exists() and "gallery.parquet" not in (out / "README.md").read_text()


@pytest.mark.slow
def test_stamps_count_from_each_persons_first_picture_where_asked_for(made, built):
    config = made["config"] | {"release": made["config"]["release"] | {"shift_stamps": True}}
    with pytest.raises(DiorError, match="whose frames and stamps are not those of the 3 pictures"):
        build(made, config=config)
    for kind, name in (("pixels", "released_frames"), ("covers", "released_covers")):
        for path in made[kind]:
            table = tables.read(path, name)
            tables.write(path, name, table | {"stamp_ns": table["stamp_ns"] + shift_stamps.FIRST_NS})
    out = build(made, config=config)
    assert "walks is at 1980-01-01 00:00 UTC" in (out / "README.md").read_text()
    for path in sorted(out.rglob("*.parquet")):
        kind = tables.metadata(path)["dior_table"]
        if "stamp_ns" in tables.columns_of(kind):
            before = tables.read(built["out"] / path.relative_to(out), kind, ["stamp_ns"])["stamp_ns"]
            after = tables.read(path, kind, ["stamp_ns"])["stamp_ns"]
            assert (after - before == shift_stamps.FIRST_NS).all(), path
            assert len(after) or kind == "gait_events", f"{path}: nobody walks in these skeletons, all else has rows"


def test_provenance_tells_what_it_was_made_of_and_no_names(built):
    found = json.loads((built["out"] / "provenance.json").read_text())
    assert set(found["sequences"]) == {"walk_1", "walk_2", "walk_3"}
    bag = b"the bag of walk_2"
    assert found["sequences"]["walk_2"]["recordings"]["bag_1"] == {
        "sha256": hashlib.sha256(bag).hexdigest(), "bytes": len(bag),
    }  # fmt: skip
    by_hand = found["sequences"]["walk_2"]["by_hand"]
    drawn = (built["project"] / "config/boxes/walk_2.cam02.csv").read_bytes()
    assert by_hand == {"config/boxes/walk_2.cam02.csv": hashlib.sha256(drawn).hexdigest()}
    assert set(found["sessions"]["field"]) == {"session.yaml", "cam01.yaml", "cam02.yaml", "cam03.yaml"}
    assert found["code"] == {"label.reproject": "0123abcd"} and found["packages"]["numpy"] == np.__version__
    assert found["config"]["adjust.huber_px"] == 15.0 and "data_root" not in found["config"]


def test_provenance_names_the_setting_that_changed(made, built):
    before = json.loads((built["out"] / "provenance.json").read_text())
    config = made["config"] | {"adjust": {"huber_px": 12}, "report": {"overlay_frames": 9}, "data_root": "elsewhere"}
    after = json.loads((build(made, config=config) / "provenance.json").read_text())
    changed = {key for key, value in after["config"].items() if before["config"][key] != value}
    assert changed == {"adjust.huber_px"} and before["config_sha256"] != after["config_sha256"]
    assert {key for key in before if before[key] != after[key]} == {"config", "config_sha256"}
