"""The release holds what was agreed to, under pseudonyms, and is the same bytes each time."""

import hashlib
import io
import subprocess
import tarfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml

from dior import tables
from dior.camera import Camera, Intrinsics
from dior.errors import DiorError
from dior.release import package, tarballs

FACTS = {
    "version": "0.1.0",
    "title": 'Walks: a "test"',
    "license": "CC-BY-NC-4.0",
    "authors": ["A. Person", "B. Other"],
}
# sequence, subject, session, environment
WALKS = (
    ("walk_1", "Realname", "lab", "indoor"),
    ("walk_2", "Realname", "field", "outdoor"),
    ("walk_3", "Secondname", "field", "outdoor"),
    ("walk_4", "Refuser", "field", "outdoor"),
)
PSEUDONYM = {"Realname": "zebra-0001", "Secondname": "apple-0002", "Refuser": "mango-0003"}
JOINTS = ("nose", "left_hip")


def sheets(root, consent, truth=""):
    config = root / "config"
    config.mkdir(parents=True, exist_ok=True)
    header = (
        "sequence session_order subject session environment outfit walk bags mocap detections trigger_log "
        "exclude_reason truth"
    ).split()
    lines = [
        [name, str(i), who, session, environment, "coat", "line", f"{name}/host.bag", "", "", "", "", truth]
        for i, (name, who, session, environment) in enumerate(WALKS)
    ]
    lines.append(["walk_5", "9", "Realname", "field", "outdoor", "", "", "x", "", "", "", "lens cap on", truth])
    (config / "sequences.tsv").write_text("\n".join("\t".join(line) for line in [header, *lines]) + "\n")
    people = [f"{who}\t{PSEUDONYM[who]}\t{'1.72' if who == 'Realname' else ''}\t\t{consent[who]}" for who in PSEUDONYM]
    columns = "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release"
    (config / "subjects.tsv").write_text("\n".join([columns, *people]) + "\n")


def labels(path, who, name, camera, frames=3):
    n = frames * len(JOINTS)
    status = np.array(["ok", "out_of_frame"] * frames, dtype=object)
    columns = {
        "subject": [who] * n,
        "sequence": [name] * n,
        "camera": [camera] * n,
        "joint": list(JOINTS) * frames,
        "frame": np.repeat(np.arange(frames), len(JOINTS)),
        "stamp_ns": np.repeat(np.arange(frames) * 10**8, len(JOINTS)),
        "u": np.arange(n, dtype=float),
        "v": np.full(n, np.nan),
        "status": status,
        "source": ["mocap"] * n,
    }
    tables.write(path, "labels_2d", columns, metadata={"made_by": f"/home/{who}"})


def skeleton(path, who, name):
    columns = {"subject": [who] * 2, "sequence": [name] * 2, "joint": list(JOINTS), "instant": [0, 0],
               "stamp_ns": [0, 0], "x": [1.0, np.nan], "status": ["ok", "too_few_views"]}  # fmt: skip
    tables.write(path, "skeletons_3d", columns)


def frames(path, name):
    columns = {"camera": ["cam01"] * 3 + ["cam02"] * 3, "frame": [0, 1, 2] * 2, "stamp_ns": [0, 10**8, 2 * 10**8] * 2,
               "receive_ns": [7, 8, 9] * 2, "bag": [f"{name}/host.bag"] * 6, "topic": ["/host/image"] * 6,
               "nth": [0] * 6, "height": [720] * 6, "width": [1280] * 6}  # fmt: skip
    tables.write(path, "frames", columns)


def figure(path, sequence, subject, value, n, metric="coverage"):
    columns = {"metric": [metric], "subject": [subject], "sequence": [sequence], "camera": ["cam01"], "role": ["close"],
               "value": [value], "unit": ["share"], "n": [n]}  # fmt: skip
    tables.write(path, "metrics", columns)


@pytest.fixture
def made(tmp_path):
    """Arguments of a build over four walks of three people, one of whom did not agree."""
    sheets(tmp_path, {"Realname": "yes", "Secondname": "TRUE", "Refuser": "no"})
    results = tmp_path / "results"
    found = {"labels": [], "skeletons": [], "frames": [], "metrics": [], "cameras": []}
    for i, (name, who, _, _) in enumerate(WALKS):
        for camera in ("cam01", "cam02"):
            found["labels"].append(results / f"reproject/{name}.{camera}.parquet")
            labels(found["labels"][-1], who, name, camera)
        found["skeletons"].append(results / f"mocap/{name}.parquet")
        skeleton(found["skeletons"][-1], who, name)
        found["frames"].append(results / f"frames/{name}.parquet")
        frames(found["frames"][-1], name)
        found["metrics"].append(results / f"evaluate/{name}.parquet")
        figure(found["metrics"][-1], name, who, (0.5, 0.8, 0.9, 0.0)[i], (10, 10, 20, 1000)[i])
    lens = Intrinsics(1280, 720, 640.0, 640.0, 639.5, 359.5)
    for session in ("lab", "field"):
        found["cameras"].append(results / f"adjust/{session}.parquet")
        rig = [
            Camera("cam02", lens, np.eye(4), "long_range", "align"),
            Camera("cam01", lens, np.eye(4), "close", "tape"),
        ]
        tables.write_cameras(found["cameras"][-1], rig, session)
    found["metrics"].append(results / "adjust/field.metrics.parquet")
    figure(found["metrics"][-1], "", "", 8.0, 5, "adjust_error_after")
    return {"project": tmp_path, **FACTS, **found, "gallery": None, "out": results / "release/dior-0.1.0"}


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_who_did_not_agree_is_in_no_file(made):
    package.run(**made)
    found = files(made["out"])
    assert sorted(found) == [
        "README.md", "SHA256SUMS", "cameras.parquet", "frames/apple-0002/walk_3.parquet",
        "frames/zebra-0001/walk_1.parquet", "frames/zebra-0001/walk_2.parquet",
        "labels_2d/apple-0002/walk_3.cam01.parquet", "labels_2d/apple-0002/walk_3.cam02.parquet",
        "labels_2d/zebra-0001/walk_1.cam01.parquet", "labels_2d/zebra-0001/walk_1.cam02.parquet",
        "labels_2d/zebra-0001/walk_2.cam01.parquet", "labels_2d/zebra-0001/walk_2.cam02.parquet",
        "metrics.csv", "sequences.parquet", "skeletons_3d/apple-0002/walk_3.parquet",
        "skeletons_3d/zebra-0001/walk_1.parquet", "skeletons_3d/zebra-0001/walk_2.parquet", "subjects.parquet",
    ]  # fmt: skip
    for name, content in found.items():
        told = content
        if name.endswith(".parquet"):
            table = pq.read_table(io.BytesIO(content))
            told += repr((table.to_pydict(), table.schema.metadata)).encode()
        for secret in (b"Realname", b"Secondname", b"Refuser", b"mango-0003", b"walk_4", b"walk_5", b"host", b"/home"):
            assert secret not in told, (name, secret)


def test_tables_are_those_of_the_pipeline_but_for_the_subject(made):
    package.run(**made)
    name = "labels_2d/zebra-0001/walk_1.cam01.parquet"
    released, source = pd.read_parquet(made["out"] / name), pd.read_parquet(made["labels"][0])
    assert set(released["subject"]) == {"zebra-0001"}
    pd.testing.assert_frame_equal(released.drop(columns="subject"), source.drop(columns="subject"))
    assert pq.read_schema(made["out"] / name).field("u").metadata[b"unit"] == b"px"
    assert tables.metadata(made["out"] / name)["dior_table"] == "labels_2d"
    index = pd.read_parquet(made["out"] / "frames/zebra-0001/walk_1.parquet")
    assert "bag" not in index and len(index) == 6
    people = tables.read(made["out"] / "subjects.parquet", "subjects")
    assert people["subject"].tolist() == ["apple-0002", "zebra-0001"]
    np.testing.assert_array_equal(people["height_m"], [np.nan, 1.72])
    walks = tables.read(made["out"] / "sequences.parquet", "sequences")
    assert walks["sequence"].tolist() == ["walk_3", "walk_1", "walk_2"], "by pseudonym"
    assert walks["session_order"].tolist() == [2, 0, 1]
    rig = tables.read(made["out"] / "cameras.parquet", "cameras")
    assert list(zip(rig["session"], rig["camera"], strict=True)) == [
        ("field", "cam01"), ("field", "cam02"), ("lab", "cam01"), ("lab", "cam02"),
    ]  # fmt: skip


def test_figures_are_pooled_over_released_walks_only(made):
    """(0.5 * 10 + 0.8 * 10 + 0.9 * 20) / 40; with the walk of the one who refused it would be 0.03."""
    package.run(**made)
    rows = pd.read_csv(made["out"] / "metrics.csv")
    assert set(rows["subject"].dropna()) == {"zebra-0001", "apple-0002"}
    overall = rows[rows[["subject", "sequence", "camera", "role", "joint"]].isna().all(axis=1)]
    assert overall[["metric", "value", "n"]].values.tolist() == [["coverage", 0.775, 40]]
    assert "adjust_error_after" not in set(rows["metric"]), "it is about the one who refused, too"


def test_the_adjustments_figures_stay_where_all_agreed(made, tmp_path):
    sheets(tmp_path, dict.fromkeys(PSEUDONYM, "1"))
    package.run(**made)
    assert "adjust_error_after" in set(pd.read_csv(made["out"] / "metrics.csv")["metric"])


def test_the_same_input_gives_the_same_bytes(made, tmp_path):
    package.run(**made)
    first = files(made["out"])
    again = {**made, "out": tmp_path / "elsewhere/dior-0.1.0"}
    for key in ("labels", "skeletons", "frames", "metrics", "cameras"):
        again[key] = made[key][::-1]
    package.run(**again)
    assert files(again["out"]) == first


def test_checksums_are_those_of_sha256sum(made):
    package.run(**made)
    done = subprocess.run(["sha256sum", "-c", "SHA256SUMS"], cwd=made["out"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    listed = [line[66:] for line in (made["out"] / "SHA256SUMS").read_text().splitlines()]
    assert listed == sorted(set(files(made["out"])) - {"SHA256SUMS"})


def test_nothing_of_an_earlier_release_stays(made, tmp_path):
    package.run(**made)
    (made["out"] / "labels_2d/stale.parquet").touch()
    sheets(tmp_path, {"Realname": "yes", "Secondname": "no", "Refuser": "no"})
    package.run(**made)
    names = set(files(made["out"]))
    assert "labels_2d/stale.parquet" not in names and not [name for name in names if "apple" in name]


def test_a_build_that_fails_leaves_the_earlier_one(made):
    package.run(**made)
    before = files(made["out"])
    made["labels"][2].write_bytes(b"half a file")
    with pytest.raises(DiorError, match="walk_2.cam01.parquet: not a readable Parquet"):
        package.run(**made)
    assert files(made["out"]) == before
    assert [path.name for path in made["out"].parent.iterdir()] == ["dior-0.1.0"]


def test_what_a_killed_build_left_is_removed(made):
    left = made["out"].with_name(".dior-0.1.0.part")
    (left / "labels_2d").mkdir(parents=True)
    (left / "labels_2d/half").touch()
    package.run(**made)
    assert not left.exists() and "labels_2d/half" not in files(made["out"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: sheets(m["project"], dict.fromkeys(PSEUDONYM, "")), "no subject's consent_release is yes"),
        (lambda m: m["skeletons"].pop(0), "sequence 'walk_1' has 0 tables of skeleton"),
        (lambda m: m["labels"].__delitem__(slice(0, 2)), "sequence 'walk_1' has 0 tables of labels"),
        (lambda m: m["frames"].append(m["frames"][0]), "sequence 'walk_1' has 2 tables of frames"),
        (lambda m: m["cameras"].pop(0), "session 'lab' has no table of cameras"),
        (lambda m: m["cameras"].append(m["cameras"][0]), "camera 'cam02' of session 'lab' is in two tables"),
        (lambda m: m["cameras"].clear(), "no table of cameras is given"),
        (
            lambda m: labels(m["labels"][0], "Refuser", "walk_1", "cam01"),
            "the subject is Refuser, but the sheet says Rea",
        ),
        (lambda m: labels(m["labels"][0], "Realname", "walk_2", "cam01"), "the sequence is walk_2, but the sheet"),
        (lambda m: m["labels"][0].unlink(), "walk_1.cam01.parquet: there is no such file"),
    ],
)
def test_what_does_not_fit_is_refused(made, change, message):
    change(made)
    with pytest.raises(DiorError, match=message):
        package.run(**made)
    assert not made["out"].exists()


def test_the_card(made):
    package.run(**made)
    text = (made["out"] / "README.md").read_text()
    _, front, body = text.split("---\n", 2)
    card = yaml.safe_load(front)
    assert card["pretty_name"] == FACTS["title"] and card["license"] == "cc-by-nc-4.0"
    assert card["size_categories"] == ["n<1K"]
    for part in card["configs"]:
        assert list(made["out"].glob(part["data_files"])), part
    assert (
        "3 walks of 2 subjects (1 indoor, 2 outdoor):\n18 labels inside the picture on 18 frames. Some cameras" in body
    )
    assert "| indoor | cam01 | close | 1 | 3 | 3 | 0.500 |" in body
    assert "| outdoor | cam02 | long-range | 2 | 6 | 6 | 0.500 |" in body
    assert "| Multi-view | yes | 2 cameras |" in body and "| 2D pose | yes | 18 keypoints |" in body
    assert "| MoCap pose | yes | 6 of 18 pictures |" in body and "| Gallery from all around | no | 0 pictures |" in body
    assert "| coverage |  | all | 0.775 | share | 40 |" in body
    assert "A. Person, B. Other" in body and "hold for the cameras as given" in body
    for name in ("labels_2d", "skeletons_3d", "released_frames", "cameras", "sequences", "subjects"):
        for column in tables.columns_of(name):
            assert f"| {column} |" in body
    assert "| u | float32 | px |" in body and "| wTc | 16 x float64 | m |" in body
    assert "| status | string |  | ok, out_of_frame, behind_camera, missing_3d, occluded |" in body
    assert "simulated" not in body.split("## What is in it")[0]


def test_the_cards_lines_of_python_run(made, monkeypatch):
    package.run(**made)
    code = (made["out"] / "README.md").read_text().split("```python\n")[1].split("```")[0]
    assert len(code.splitlines()) == 3
    monkeypatch.chdir(made["out"])
    scope = {}
    exec(code, scope)
    assert scope["seen"]["u"]["nose"].tolist() == [0.0, 2.0, 4.0]


def test_a_simulated_capture_says_so(made, tmp_path):
    sheets(tmp_path, dict.fromkeys(PSEUDONYM, "yes"), truth="truth/walk")
    package.run(**made)
    assert "**These recordings are simulated.**" in (made["out"] / "README.md").read_text()


def test_the_tarballs_together_are_the_release(made, tmp_path):
    package.run(**made)
    for who in ("zebra-0001", "apple-0002"):
        out = made["out"].with_name(f"dior-0.1.0-{who}.tar")
        tarballs.run(release=made["out"], subject=who, out=out)
        with tarfile.open(out) as tar:
            members = tar.getmembers()
            assert [m.name for m in members] == sorted(m.name for m in members)
            assert {(m.mtime, m.uid, m.gid, m.uname, m.gname, m.mode) for m in members} == {(0, 0, 0, "", "", 0o644)}
            other = {"zebra-0001": "apple-0002", "apple-0002": "zebra-0001"}[who]
            assert not [m.name for m in members if other in m.name]
            tar.extractall(tmp_path / "unpacked", filter="data")
        checked = subprocess.run(
            ["sha256sum", "-c", "--ignore-missing", "--quiet", "SHA256SUMS"], cwd=tmp_path / "unpacked/dior-0.1.0"
        )
        assert checked.returncode == 0
    assert files(tmp_path / "unpacked/dior-0.1.0") == files(made["out"])


def test_a_tarball_is_the_same_bytes_whenever_it_is_made(made):
    package.run(**made)
    sums = []
    for stamp in (0, 10**9):
        for path in made["out"].rglob("*"):
            path.touch()
            path.chmod(0o755 if path.is_dir() or stamp else 0o600)
        out = made["out"].with_name("subject.tar")
        tarballs.run(release=made["out"], subject="zebra-0001", out=out)
        sums.append(hashlib.sha256(out.read_bytes()).hexdigest())
    assert sums[0] == sums[1]


def test_what_no_tarball_can_be_made_of(made, tmp_path):
    out = Path(tmp_path / "x.tar")
    with pytest.raises(DiorError, match="build the release first"):
        tarballs.run(release=made["out"], subject="zebra-0001", out=out)
    package.run(**made)
    with pytest.raises(DiorError, match=r"'zebra-001' is not in the release \(did you mean 'zebra-0001'"):
        tarballs.run(release=made["out"], subject="zebra-001", out=out)
    (made["out"] / "frames/zebra-0001/walk_1.parquet").unlink()
    with pytest.raises(DiorError, match="walk_1.parquet: listed in SHA256SUMS but gone"):
        tarballs.run(release=made["out"], subject="zebra-0001", out=out)
    assert not out.exists()


def test_the_gallery_is_of_released_subjects_under_pseudonyms_without_files(made, tmp_path):
    who = ["Refuser", "Secondname", "Realname", "Realname"]
    table = {"subject": who, "outfit": ["coat", "", "coat", "coat"], "angle": ["frontal"] * 4, "picture": [0, 0, 0, 1],
             "file": [f"gallery/{name}/{i}.jpg" for i, name in enumerate(who)], "height": [72] * 4,
             "width": [128] * 4}  # fmt: skip
    tables.write(tmp_path / "gallery.parquet", "gallery", table)
    package.run(**made | {"gallery": tmp_path / "gallery.parquet"})
    found = pq.read_table(made["out"] / "gallery.parquet").to_pandas()
    assert found["subject"].tolist() == ["apple-0002", "zebra-0001", "zebra-0001"]
    assert found["picture"].tolist() == [0, 0, 1] and "file" not in found and found["stamp_ns"].isna().all()
    content = (made["out"] / "gallery.parquet").read_bytes()
    assert not [name for name in (b"Refuser", b"Realname", b"mango-0003") if name in content]
    card = (made["out"] / "README.md").read_text()
    assert "### `gallery.parquet`" in card and "config_name: gallery" in card
    names = tarballs.members(made["out"], "zebra-0001")
    assert "gallery.parquet" in names
    sheet = made["project"] / "config/sequences.tsv"
    third = "walk_3/host.bag\t\t\t\t"
    assert third in sheet.read_text()
    sheet.write_text(sheet.read_text().replace(third, third + "limped"))
    package.run(**made | {"gallery": tmp_path / "gallery.parquet"})
    kept = pq.read_table(made["out"] / "gallery.parquet").to_pandas()
    assert kept["subject"].tolist() == ["zebra-0001"] * 2, "every sequence of apple-0002 is excluded"
    sheet.write_text(sheet.read_text().replace("limped", ""))
    package.run(**made)
    assert not (made["out"] / "gallery.parquet").exists()
    assert "gallery" not in (made["out"] / "README.md").read_text()
