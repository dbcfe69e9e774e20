"""Each export is read again by the tool it is for, or by its documented format, and says what the release says."""

import csv
import glob
import io
import json
import pickle
import shutil
import subprocess
import tarfile
from contextlib import redirect_stdout

import numpy as np
import pytest

import dior
from dior.body.names import COCO_17, PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.ingest import mocap
from dior.release import exports, package
from dior.release.exports import fixed_rate, recordings, trc
from dior.tables import tables
from tests.release import small
from tests.release.made import run_by_a_spreadsheet


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A release and all of its exports."""
    root = tmp_path_factory.mktemp("release")
    release = small.build(root / "dior-0.1.0")
    out = root / "dior-0.1.0-exports"
    exports.run(release=release, formats=list(exports.FORMATS), out=out)
    return release, out


def test_no_cell_is_a_formula_and_numbers_stay_numbers(made, tmp_path):
    assert len([path for folder in made for path in folder.rglob("*.?sv")]) > 5
    assert [run_by_a_spreadsheet(folder) for folder in made] == [[], []]
    (tmp_path / "a.tsv").write_text("a\t=1\n-0.5\t@x\n")
    assert run_by_a_spreadsheet(tmp_path) == [("a.tsv", "=1"), ("a.tsv", "@x")], "it would find one"


def coco_of(out, part):
    from pycocotools.coco import COCO

    with redirect_stdout(io.StringIO()):
        return COCO(str(out / f"coco/person_keypoints_{part}.json"))


def annotation_of(coco, sequence, camera, frame):
    (image,) = (
        image
        for image in coco.dataset["images"]
        if (image["sequence"], image["camera"], image["frame"]) == (sequence, camera, frame)
    )
    return image, coco.loadAnns(coco.getAnnIds(imgIds=image["id"]))[0]


@pytest.mark.parametrize(
    ("part", "sequence", "environment", "camera"),
    [
        ("train", "walk_1", "indoor", "cam01"),
        ("train", "walk_2", "outdoor", "cam01"),
        ("test", "walk_3", "indoor", "cam02"),
        ("test", "walk_4", "outdoor", "cam02"),
    ],
)
def test_coco_has_the_joints_where_they_are_at_each_pictures_time(made, part, sequence, environment, camera):
    coco = coco_of(made[1], part)
    uv, status = small.truth(environment, camera)
    derived = set()
    for frame in range(small.PICTURES):
        image, annotation = annotation_of(coco, sequence, camera, frame)
        keypoints = np.array(annotation["keypoints"]).reshape(17, 3)
        inside = np.isin(status[frame], ("ok", "occluded"))
        # 0.003 px: the labels are stored as float32, and COCO's numbers are rounded
        np.testing.assert_allclose(keypoints[inside, :2], uv[frame][inside], atol=3e-3)
        if environment == "indoor":
            np.testing.assert_array_equal(keypoints[:, 2], np.where(inside, 2 - (status[frame] == "occluded"), 0))
        assert not keypoints[~inside].any()
        assert annotation["num_keypoints"] == inside.sum()
        x, y, width, height = annotation["bbox"]
        assert (keypoints[inside, :2] >= (x - 1e-3, y - 1e-3)).all()
        assert (keypoints[inside, :2] <= (x + width, y + height)).all()
        assert 0 <= x and x + width <= 1280 and 0 <= y and y + height <= 720
        derived |= set(annotation["derived"])
        assert image["stamp_ns"] == small.stamps()[frame]
        assert image.get("no_image") == ("no_consent" if sequence == "walk_4" else None)
    assert derived == (set(range(17)) if environment == "indoor" else set())
    if sequence == "walk_3":
        assert (status == "out_of_frame").any(), "the near camera must cut the body for this test to mean something"


def test_coco_sigma_is_that_of_the_markers_and_null_where_it_is_not_known(made):
    coco = coco_of(made[1], "train")
    _, known = annotation_of(coco, "walk_1", "cam01", 3)
    _, unknown = annotation_of(coco, "walk_1", "cam02", 3)
    assert known["sigma"] == [0.5, 0.25] * 17
    assert unknown["sigma"] == [None, 0.25] * 17


def test_coco_evaluates_its_own_labels_as_perfect(made):
    from pycocotools.cocoeval import COCOeval

    coco = coco_of(made[1], "test")
    results = [
        {"image_id": a["image_id"], "category_id": 1, "keypoints": a["keypoints"], "score": 1.0}
        for a in coco.dataset["annotations"]
    ]
    with redirect_stdout(io.StringIO()):
        evaluation = COCOeval(coco, coco.loadRes(results), "keypoints")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    assert len(results) == 2 * 2 * small.PICTURES
    assert evaluation.stats[0] == pytest.approx(1.0)


def test_parts_of_coco_share_no_subject_and_no_id(made):
    train, test = coco_of(made[1], "train"), coco_of(made[1], "test")
    assert {image["subject"] for image in train.dataset["images"]} == {"pa11"}
    assert {image["subject"] for image in test.dataset["images"]} == {"pb22"}
    assert not {image["file_name"] for image in train.dataset["images"]} & {
        image["file_name"] for image in test.dataset["images"]
    }
    assert train.getImgIds() == list(range(1, 2 * 2 * small.PICTURES + 1))


def casia_b(path):
    """The rows as GaitGraph's loader of CASIA-B takes them: (subject, status, number, view) -> frame -> (17, 3)."""
    found = {}
    with open(path, newline="") as stream:
        header, *rows = csv.reader(stream)
    assert len(header) == 52 and header[:4] == ["image_name", "nose_x", "nose_y", "nose_conf"]
    for name, *numbers in rows:
        _, sequence, frame = name.split("/")
        subject, status, number, view = sequence.split("-")
        key = int(subject), {"nm": 0, "bg": 1, "cl": 2}[status], int(number), int(view)
        found.setdefault(key, {})[int(frame[:-4])] = np.array(numbers, np.float32).reshape(17, 3)
    return found


def test_gaitgraph_is_read_as_casia_b(made):
    folder = made[1] / "gaitgraph"
    train, test = casia_b(folder / "dior_pose_train.csv"), casia_b(folder / "dior_pose_test.csv")
    assert not (folder / "dior_pose_valid.csv").exists(), "the release has no val part"
    assert casia_b(folder / "dior_pose_train_valid.csv").keys() == train.keys()
    assert {key[0] for key in train} == {1} and {key[0] for key in test} == {75}, "as CASIA-B's people"
    # the outdoor walk is the first; indoor cameras are the first two views
    assert {key[1:] for key in train} == {(0, 1, 36), (0, 1, 54), (0, 2, 0), (0, 2, 18)}
    rows = {row["name"]: row for row in csv.DictReader((folder / "sequences.csv").open())}
    assert rows["001-nm-02-018"]["sequence"] == "walk_1" and rows["001-nm-02-018"]["camera"] == "cam02"
    uv, _ = small.truth("indoor", "cam02")
    sequence = train[1, 0, 2, 18]
    assert sorted(sequence) == list(range(small.PICTURES))
    np.testing.assert_allclose(sequence[5][:, :2], uv[5], atol=3e-3)


def test_gaitgraph_leaves_out_pictures_with_an_unknown_joint(made, tmp_path):
    release = shutil.copytree(made[0], tmp_path / "r")
    path = release / "labels_2d/pa11/walk_2.cam01.parquet"
    rows = tables.read(path, "labels_2d")
    lost = (rows["frame"] == 4) & (rows["joint"] == "left_knee")
    rows["u"][lost] = rows["v"][lost] = rows["depth"][lost] = np.nan
    rows["status"][lost] = "missing_3d"
    tables.write(path, "labels_2d", rows)
    small.summed(release)
    exports.run(release=release, formats=["gaitgraph", "opengait", "coco"], out=tmp_path / "out")
    found = casia_b(tmp_path / "out/gaitgraph/dior_pose_train.csv")
    assert 4 not in found[1, 0, 1, 36] and len(found[1, 0, 1, 36]) == small.PICTURES - 1
    (kept,) = (tmp_path / "out/opengait/data/pa11/00-nm/outdoor-cam01").iterdir()
    array = pickle.loads(kept.read_bytes())
    assert len(array) == small.PICTURES and not array[4, COCO_17.index("left_knee")].any()
    _, annotation = annotation_of(coco_of(tmp_path / "out", "train"), "walk_2", "cam01", 4)
    assert annotation["keypoints"][3 * 13 : 3 * 14] == [0, 0, 0]


def read_trc(path):
    """Rate, names and points (N, M, 3) of a TRC as OpenSim's TRCFileAdapter takes it."""
    lines = path.read_text().split("\n")
    assert lines[0].split("\t") == ["PathFileType", "4", "(X/Y/Z)", path.name]
    facts = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    assert list(facts) == trc.KEYS and facts["Units"] == "mm"
    names = [word for word in lines[3].split("\t") if word]
    assert names[:2] == ["Frame#", "Time"] and len(names) == int(facts["NumMarkers"]) + 2
    axes = [word for word in lines[4].split("\t") if word]
    assert axes == [f"{axis}{i}" for i in range(1, len(names) - 1) for axis in "XYZ"]
    assert lines[5] == "" and lines[-1] == ""
    rows = [line.split("\t")[:-1] for line in lines[6:-1]]
    assert len(rows) == int(facts["NumFrames"]) and {len(row) for row in rows} == {2 + 3 * (len(names) - 2)}
    assert [row[0] for row in rows] == [str(i) for i in range(1, len(rows) + 1)]
    points = np.array([[float(cell or "nan") for cell in row[2:]] for row in rows]).reshape(len(rows), -1, 3)
    return float(facts["DataRate"]), [float(row[1]) for row in rows], names[2:], points


def test_trc_is_in_millimetres_with_y_up_and_empty_where_missing(made):
    release, out = made
    rate, times, names, points = read_trc(out / "trc/pa11/walk_1.trc")
    assert rate == 100.0 and names == list(PLUG_IN_GAIT_39) and times[:2] == [0.0, 0.01]
    _, at = small.motion("indoor")
    true = 1000 * at(np.arange(60) / 100)
    gap = np.zeros((60, 39), bool)
    gap[small.GAP[2], names.index("RANK")] = True
    np.testing.assert_array_equal(np.isnan(points).any(axis=-1), gap)
    y_up = np.stack([true[..., 0], true[..., 2], -true[..., 1]], axis=-1)
    np.testing.assert_allclose(points[~gap], y_up[~gap], atol=2e-3)
    assert read_trc(out / "trc/pa11/walk_2.trc")[0] == 30.0


def test_c3d_is_read_by_ezc3d_and_by_dior_as_the_release_has_it(made):
    import ezc3d

    release, out = made
    c3d = ezc3d.c3d(str(out / "c3d/pa11/walk_1.c3d"))
    walk = next(walk for walk in recordings.read(release).walks if walk.sequence == "walk_1")
    body = recordings.body_of(walk)
    point = c3d["parameters"]["POINT"]
    assert point["UNITS"]["value"] == ["mm"] and point["RATE"]["value"][0] == 100.0
    assert point["LABELS"]["value"] == list(body.joints)
    missing = np.isnan(body.points).any(axis=-1)
    assert missing.sum() == 6
    np.testing.assert_array_equal(c3d["data"]["meta_points"]["residuals"][0].T == -1, missing)
    np.testing.assert_allclose(c3d["data"]["points"][:3].T[~missing], 1000 * body.points[~missing], atol=1e-3)
    again = mocap.read(out / "c3d/pa11/walk_1.c3d")
    np.testing.assert_allclose(again.points, body.points, atol=1e-6)
    assert again.rate == 100.0 and again.first_frame == 1


def test_webdataset_gives_the_released_pictures_with_their_labels(made):
    import webdataset

    release, out = made
    shards = sorted(glob.glob(str(out / "webdataset/*.tar")))
    assert len(shards) == 6, "a walk without pictures has no shard"
    samples = list(webdataset.WebDataset(shards, shardshuffle=False).decode().to_tuple("__key__", "jpg;raw", "json"))
    assert len(samples) == 6 * small.PICTURES
    for shard in shards:
        with tarfile.open(shard) as tar:
            for entry in tar:
                assert (entry.uid, entry.gid, entry.uname, entry.mtime, entry.mode) == (0, 0, "", 0, 0o644)
    raw = {key: label for key, _, label in samples}
    label = raw["pa11/walk_1_cam02_000003"]
    rows = tables.read(release / "labels_2d/pa11/walk_1.cam02.parquet", "labels_2d")
    assert list(label["labels"]) == list(PLUG_IN_GAIT_39)
    i = 3 * 39 + PLUG_IN_GAIT_39.index("LKNE")
    np.testing.assert_allclose(label["labels"]["LKNE"][:2], [rows["u"][i], rows["v"][i]], atol=1e-3)
    assert label["labels"]["LKNE"][2] == rows["status"][i]
    assert label["annotation"]["num_keypoints"] <= 17 and label["image"]["frame"] == 3
    with tarfile.open(shards[0]) as tar:
        content = tar.extractfile("pa11/walk_2_cam01_000004.jpg").read()
    assert content == small.picture("walk_2", "cam01", 4)


def test_bids_has_what_the_specification_requires(made):
    root = made[1] / "bids"
    about = json.loads((root / "dataset_description.json").read_text())
    assert about["Name"] and about["BIDSVersion"]
    people = (root / "participants.tsv").read_text().splitlines()
    assert people == ["participant_id\theight", "sub-pa11\t1.72", "sub-pb22\tn/a"]
    assert (root / "README").is_file()
    stem = root / "sub-pa11/motion/sub-pa11_task-line_tracksys-omc_acq-shirt_run-01"
    sidecar = json.loads(stem.with_name(stem.name + "_motion.json").read_text())
    assert {"TaskName", "SamplingFrequency", "TrackingSystemName"} <= set(sidecar)
    assert sidecar["SamplingFrequency"] == 100.0 and sidecar["TrackedPointsCount"] == 39
    channels = list(csv.DictReader(stem.with_name(stem.name + "_channels.tsv").open(), delimiter="\t"))
    assert list(channels[0])[:5] == ["name", "component", "type", "tracked_point", "units"]
    rows = [line.split("\t") for line in stem.with_name(stem.name + "_motion.tsv").read_text().splitlines()]
    assert {len(row) for row in rows} == {len(channels)} == {117} and len(rows) == 60
    at = [channel["name"] for channel in channels].index("RANK_x")
    assert rows[20][at : at + 3] == ["n/a"] * 3 and "n/a" not in rows[19]
    _, motion = small.motion("indoor")
    np.testing.assert_allclose(np.array(rows[7], float).reshape(39, 3), motion(np.array([0.07]))[0], atol=2e-6)
    events = list(csv.DictReader(stem.with_name(stem.name + "_events.tsv").open(), delimiter="\t"))
    assert list(events[0])[:4] == ["onset", "duration", "trial_type", "sample"]
    assert [list(row.values()) for row in events] == [
        ["0.1230", "0", "heel_strike_left", "12", "0.0100", "0.1030", "0.1430", "n/a"],
        ["0.4560", "0", "heel_strike_right", "46", "0.0200", "0.4160", "0.4960", "turn"],
    ]
    meaning = json.loads(stem.with_name(stem.name + "_events.json").read_text())
    assert set(meaning) == set(events[0]) - {"onset", "duration"}
    assert {row["trial_type"] for row in events} <= set(meaning["trial_type"]["Levels"])
    scans = list(csv.DictReader((root / "sub-pa11/sub-pa11_scans.tsv").open(), delimiter="\t"))
    assert [row["sequence"] for row in scans] == ["walk_1"], "walk_2 was not captured with markers"
    assert (root / "sub-pa11" / scans[0]["filename"]).is_file()


def cited(folder):
    """The settings of a release that has authors, as its provenance.json has them."""
    settings = {"title": "Walks", "version": "0.1.0", "license": "CC-BY-4.0", "authors": ["A, B.", "The Lab"],
                "doi": "10.5281/zenodo.1"}  # fmt: skip
    content = {"config": {f"release.{key}": value for key, value in settings.items()}}
    (folder / "provenance.json").write_text(json.dumps(content))
    return small.summed(folder)


def test_bids_names_authors_licence_and_what_made_it(made, tmp_path):
    release = cited(shutil.copytree(made[0], tmp_path / "r"))
    exports.run(release=release, formats=["bids"], out=tmp_path / "out")
    found = json.loads((tmp_path / "out/bids/dataset_description.json").read_text())
    assert (found["Name"], found["Authors"], found["License"]) == ("Walks", ["A, B.", "The Lab"], "CC-BY-4.0")
    assert found["DatasetDOI"] == "doi:10.5281/zenodo.1"
    assert found["GeneratedBy"][0]["Name"] == "dior" and found["GeneratedBy"][0]["Version"] == dior.__version__
    assert found["SourceDatasets"] == [{"DOI": "doi:10.5281/zenodo.1", "Version": "0.1.0"}]
    sidecar = next((tmp_path / "out/bids/sub-pa11/motion").glob("*_motion.json"))
    assert json.loads(sidecar.read_text())["TaskDescription"] == "Walking, by the pattern that the lab calls 'line'"
    without = json.loads((made[1] / "bids/dataset_description.json").read_text())
    assert without["Name"] == "dior-0.1.0" and not {"Authors", "License", "SourceDatasets"} & set(without)


def validators():
    """Commands that check a BIDS dataset: the one of PyPI and that of npm, where they are installed."""
    names = ("bids-validator-deno", "bids-validator")
    return [path for path in map(shutil.which, names) if path]


@pytest.mark.slow
@pytest.mark.skipif(
    not validators(), reason="no BIDS validator: pip install bids-validator-deno, or npm install -g bids-validator"
)
@pytest.mark.parametrize("program", validators())
def test_bids_validators_find_no_error(made, tmp_path, program):
    release = cited(shutil.copytree(made[0], tmp_path / "r"))
    exports.run(release=release, formats=["bids"], out=tmp_path / "out")
    done = subprocess.run([program, "--json", tmp_path / "out/bids"], capture_output=True, text=True)
    issues = json.loads(done.stdout)["issues"]
    found = issues["issues"] if "issues" in issues else [*issues["errors"], *issues["warnings"]]
    assert [issue for issue in found if issue["severity"] == "error"] == [], done.stderr
    codes = {str(issue.get("key") or issue["code"]) for issue in found}
    assert codes.isdisjoint({"NO_AUTHORS", "TOO_FEW_AUTHORS", "README_FILE_SMALL"})
    missing = tmp_path / "out/bids/dataset_description.json"
    missing.write_text(json.dumps({"Name": "no version"}))
    assert subprocess.run([program, "--json", tmp_path / "out/bids"], capture_output=True).returncode, "it would say so"


def test_two_builds_are_the_same_and_the_checksums_are_of_every_file(made, tmp_path):
    release, out = made
    exports.run(release=release, formats=list(exports.FORMATS), out=tmp_path / "again")
    assert (tmp_path / "again/SHA256SUMS").read_bytes() == (out / "SHA256SUMS").read_bytes()
    listed = {line.split("  ", 1)[1] for line in (out / "SHA256SUMS").read_text().splitlines()}
    assert listed | {"SHA256SUMS"} == {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    subprocess.run(["sha256sum", "--quiet", "-c", "SHA256SUMS"], cwd=out, check=True)
    readme = (out / "README.md").read_text()
    assert all(f"## {name}\n" in readme for name in exports.FORMATS)


def test_a_build_that_fails_leaves_the_one_before(made, tmp_path):
    release = shutil.copytree(made[0], tmp_path / "r")
    exports.run(release=release, formats=["trc"], out=tmp_path / "out")
    before = (tmp_path / "out/SHA256SUMS").read_bytes()
    path = release / "skeletons_3d/pb22/walk_3.parquet"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(DiorError, match=r"walk_3\.parquet: its SHA-256 is not the one that SHA256SUMS has"):
        exports.run(release=release, formats=["trc", "c3d"], out=tmp_path / "out")
    assert (tmp_path / "out/SHA256SUMS").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "r"]


def test_free_text_of_the_sheet_makes_no_folders_and_breaks_no_list(made, tmp_path):
    """Two outfits whose names differ in nothing that a folder's name may have are two walks of one."""
    release = shutil.copytree(made[0], tmp_path / "r")
    rows = tables.read(release / "sequences.parquet", "sequences")
    texts = {"walk_1": ("rain/coat, long", "8, twice"), "walk_2": ("rain coat long", ""), "walk_4": ("", "a b")}
    for i, name in enumerate(rows["sequence"]):
        rows["outfit"][i], rows["walk"][i] = texts.get(name, ("", ""))
    rows["environment"][:] = "outdoor"
    tables.write(release / "sequences.parquet", "sequences", rows)
    small.summed(release)
    exports.run(release=release, formats=["opengait", "gaitgraph", "bids"], out=tmp_path / "out")
    kinds = sorted(path.name for path in (tmp_path / "out/opengait/data/pa11").iterdir())
    assert kinds == ["00-nm", "01-cl"]
    listed = list(csv.DictReader((tmp_path / "out/gaitgraph/sequences.csv").open()))
    assert {(row["sequence"], row["outfit"], row["walk"]) for row in listed if row["subject"] == "pa11"} == {
        ("walk_1", *texts["walk_1"]),
        ("walk_2", *texts["walk_2"]),
    }
    assert (
        tmp_path / "out/bids/sub-pa11/motion/sub-pa11_task-8twice_tracksys-omc_acq-raincoatlong_run-01_motion.tsv"
    ).is_file()
    assert (tmp_path / "out/bids/sub-pb22/motion/sub-pb22_task-walk_tracksys-omc_run-01_motion.tsv").is_file()


def test_a_new_release_takes_the_exports_of_the_old_one_away(tmp_path):
    (tmp_path / "dior-0.1.0-exports").mkdir()
    (tmp_path / "dior-0.1.0-exports/README.md").write_text("of somebody who has withdrawn since")
    package._withdraw(tmp_path / "dior-0.1.0", kept={"pa11"})
    assert not list(tmp_path.iterdir())


def test_an_unknown_format_and_a_folder_that_is_no_release_are_refused(made, tmp_path):
    with pytest.raises(DiorError, match=r"no format 'opengate' \(did you mean 'opengait'\?\)"):
        exports.run(release=made[0], formats=["coco", "opengate"], out=tmp_path / "out")
    with pytest.raises(DiorError, match="no release"):
        exports.run(release=tmp_path, formats=["coco"], out=tmp_path / "out")
    assert not list(tmp_path.iterdir())


def body(stamps):
    stamps = np.asarray(stamps, np.int64)
    points = np.arange(len(stamps), dtype=float)[:, None, None] * np.ones((1, 2, 3))
    return recordings.Body(("a", "b"), stamps, points)


def test_a_lost_instant_is_a_frame_without_points():
    rate, points = fixed_rate.regular(body([0, 10_000_000, 30_000_000, 40_000_000]), "walk")
    assert rate == 100.0
    np.testing.assert_array_equal(points[:, 0, 0], [0, 1, np.nan, 2, 3])


def test_a_rate_beside_a_standard_one_is_kept_where_it_shows():
    count = 20000
    rate, points = fixed_rate.regular(body(np.rint(np.arange(count) * 1e9 / 100.03)), "walk")
    assert rate == pytest.approx(100.03, abs=1e-4)
    assert len(points) == count and np.isfinite(points).all()


def test_stamps_on_no_grid_are_refused():
    with pytest.raises(DiorError, match=r"walk\.parquet: its stamps are not on a grid"):
        fixed_rate.regular(body([0, 10_000_000, 14_000_000, 30_000_000]), "walk.parquet")
