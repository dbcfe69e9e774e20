"""What differs between two releases is measured right, and the inputs that can be the reason are named."""

import json
import shutil

import cv2
import numpy as np
import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.release import suspect
from dior.release.diff import diff, diff_text
from dior.tables import tables
from tests.release import made_up

WALK_2 = "labels_2d/zebra-0001/walk_2.{}.parquet"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made_up.release(tmp_path_factory.mktemp("first") / "dior-0.1.0")


@pytest.fixture
def later(whole, tmp_path):
    """A copy that a test changes."""
    shutil.copytree(whole, tmp_path / "dior-0.2.0")
    return tmp_path / "dior-0.2.0"


def provenance(later, *changes):
    content = made_up.provenance()
    for change in changes:
        change(content)
    (later / "provenance.json").write_text(json.dumps(content))
    made_up.remade(later)


def labels(later, camera="cam01", walk="walk_2", /, **changed):
    name = WALK_2.format(camera).replace("walk_2", walk).replace("zebra-0001", made_up.WALKS[walk][0])
    made_up.write(later, name, "labels_2d", made_up.labels(walk, camera, **changed))


def moved_by(du, dv, camera="cam01", walk="walk_2"):
    was = made_up.labels(walk, camera)
    return {"u": was["u"] + du, "v": was["v"] + dv}


def test_the_same_release_is_the_same(whole, tmp_path, capsys):
    shutil.copytree(whole, tmp_path / "copy")
    assert main.main(["diff", str(whole), str(tmp_path / "copy")]) == 0
    assert capsys.readouterr().out == "dior-0.1.0 and copy are the same\n"
    assert main.main(["diff", str(whole), str(tmp_path / "copy"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["same"] is True


def test_trouble_is_exit_code_2(whole, later, tmp_path, capsys):
    assert main.main(["diff", str(whole), str(tmp_path / "nothing")]) == 2
    assert "nothing: there is no such folder" in capsys.readouterr().err
    (later / "README.md").write_text("other")
    (later / "provenance.json").write_text("{")
    made_up.remade(later)
    assert main.main(["diff", str(whole), str(later)]) == 2
    assert "provenance.json: cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize("name", [*diff.READ, WALK_2.format("cam01")])
def test_a_file_that_is_not_what_the_release_was_built_with_is_not_compared(whole, later, name):
    labels(later, **moved_by(3, 4))
    content = bytearray((later / name).read_bytes())
    content[len(content) // 2] ^= 4
    (later / name).write_bytes(content)
    with pytest.raises(DiorError, match=f"{name}: its SHA-256 is not the one that SHA256SUMS has.*dior verify"):
        diff.compared(whole, later)
    (later / name).unlink()
    with pytest.raises(DiorError, match=f"{name}: cannot be read.*dior verify"):
        diff.compared(whole, later)


def test_labels_that_all_moved_by_a_3_4_5_triangle(whole, later):
    labels(later, **moved_by(3, 4))
    found = diff.compared(whole, later)
    (one,) = found["recordings"]
    assert (one["sequence"], one["camera"], one["change"]) == ("walk_2", "cam01", "changed")
    assert one["labels_2d"] == {
        "rows": 12, "rows_added": 0, "rows_removed": 0, "moved_px": {"median": 5.0, "p95": 5.0, "max": 5.0},
        "moved_share": 1.0, "status_changed_share": 0.0, "suspect": [0, 0], "stamps_moved_ms": 0.0, "sigma_ratio": None,
    }  # fmt: skip
    assert not found["skeletons"] and not found["cameras"]
    assert found["files"] == {"added": [], "removed": [], "changed": []}


def test_only_labels_in_the_picture_count_and_quantiles_are_those_of_numpy(whole, later):
    """Of 12 labels 10 are in the picture; they move by 1 to 10 px, and the others by a lot."""
    was = made_up.labels("walk_2", "cam01")
    du = np.r_[1000.0, 1000.0, np.arange(1, 11)]
    labels(later, u=was["u"] + du)
    (one,) = diff.compared(whole, later)["recordings"]
    expected = {"median": 5.5, "p95": float(np.percentile(np.arange(1, 11), 95)), "max": 10.0}
    assert one["labels_2d"]["moved_px"] == pytest.approx(expected, rel=1e-3)


def test_status_sigma_stamps_and_frames(whole, later):
    status = made_up.labels("walk_2", "cam01")["status"]
    status[2:5] = "occluded"
    each = {key: np.full(12, value) for key, value in (("sigma_u", 1.0), ("sigma_v", 1.0))}
    labels(later, status=status, stamp_ns=np.repeat(made_up.stamps() + 2_500_000, 3), **each)
    labels(later, "cam02", sigma_v=np.full(12, 0.5))
    kept = {key: np.array(values)[3:] for key, values in made_up.labels("walk_3", "cam01").items()}
    labels(later, "cam01", "walk_3", **kept)
    found = {(one["sequence"], one["camera"]): one["labels_2d"] for one in diff.compared(whole, later)["recordings"]}
    changed = found["walk_2", "cam01"]
    assert changed["status_changed_share"] == 0.25 and changed["stamps_moved_ms"] == 2.5
    assert changed["moved_px"] == {"median": 0.0, "p95": 0.0, "max": 0.0} and changed["moved_share"] == 0.0
    shorter = found["walk_3", "cam01"]
    assert (shorter["rows"], shorter["rows_added"], shorter["rows_removed"]) == (9, 0, 3)


def test_sigma_is_compared_where_both_have_it(tmp_path, whole, later):
    twice = {"sigma_u": np.full(12, 0.6), "sigma_v": np.full(12, 0.8)}
    first = tmp_path / "first/dior-0.1.0"
    shutil.copytree(whole, first)
    labels(first, **twice)
    labels(later, **{key: 2 * values for key, values in twice.items()})
    (one,) = diff.compared(first, later)["recordings"]
    assert one["labels_2d"]["sigma_ratio"] == 2.0


def test_the_3d_moves_in_mm(whole, later):
    was = made_up.skeleton("walk_2")
    shift = np.zeros(12)
    shift[2:] = 0.002 * np.arange(1, 11)
    moved = made_up.skeleton("walk_2", x=was["x"] + shift, z=was["z"] + np.where(shift > 0, 0.0, 1.0))
    made_up.write(later, "skeletons_3d/zebra-0001/walk_2.parquet", "skeletons_3d", moved)
    (one,) = diff.compared(whole, later)["skeletons"]
    told = one["skeletons_3d"]["moved_mm"]
    assert told["max"] == 1000.0, "the first point, up by 1 m"
    assert told["median"] == pytest.approx(np.median([1000, *2 * np.arange(1, 11)]), rel=1e-3)
    assert "recordings" not in one and one["sequence"] == "walk_2"


@pytest.mark.parametrize("angle", [1e-5, 0.5, 90.0, 179.9])
def test_a_camera_moved_and_turned(angle):
    turn, shift = np.eye(4), np.eye(4)
    axis = np.array([1, 2, 2]) / 3
    turn[:3, :3] = cv2.Rodrigues(np.deg2rad(angle) * axis)[0]
    shift[:3, 3] = 0.003, 0.004, 0
    start = np.eye(4)
    start[:3, :3] = cv2.Rodrigues(np.array([0.3, -1.0, 2.0]))[0]
    start[:3, 3] = 5, 6, 7
    found = diff.pose_change(start, shift @ start @ turn)
    assert found == pytest.approx({"moved_mm": 5.0, "turned_deg": angle}, rel=1e-3)


def test_cameras_that_changed_came_or_went(whole, later):
    wTc = np.tile(np.eye(4), (4, 1, 1))
    wTc[1, 0, 3] = 0.25
    changed = made_up.cameras(wTc=wTc.reshape(4, 16), fx=[20.0, 20.0, 21.5, 20.0])
    changed["camera"] = ["cam01", "cam02", "cam01", "cam03"]
    made_up.write(later, "cameras.parquet", "released_cameras", changed)
    assert diff.compared(whole, later)["cameras"] == [
        {"session": "field", "camera": "cam02", "change": "changed", "moved_mm": 250.0, "turned_deg": 0.0},
        {"session": "lab", "camera": "cam01", "change": "changed", "fx": [20.0, 21.5]},
        {"session": "lab", "camera": "cam02", "change": "removed"},
        {"session": "lab", "camera": "cam03", "change": "added"},
    ]


def test_a_camera_without_a_pose_is_json(whole, later):
    wTc = np.tile(np.eye(4).ravel(), (4, 1))
    wTc[0] = np.nan
    made_up.write(later, "cameras.parquet", "released_cameras", made_up.cameras(wTc=wTc))
    (one,) = json.loads(json.dumps(diff.compared(whole, later), allow_nan=False))["cameras"]
    assert one == {
        "session": "field", "camera": "cam01", "change": "changed", "moved_mm": None, "turned_deg": None,
    }  # fmt: skip


def test_clocks_that_changed(whole, later):
    changed = made_up.clocks(offset_s=[0.5, 0.5125, 0.5, 0.5, 0.5, 0.5], drift_ppm=[0, 0, -7.5, 0, 0, 0])
    changed["source"][5], changed["method"][5] = "manual", ""
    made_up.write(later, "clocks.parquet", "released_clocks", changed)
    assert diff.compared(whole, later)["clocks"] == [
        {"sequence": "walk_1", "camera": "cam02", "change": "changed", "offset_ms": 12.5, "drift_ppm": 0.0},
        {"sequence": "walk_2", "camera": "cam01", "change": "changed", "offset_ms": 0.0, "drift_ppm": -7.5},
        {"sequence": "walk_3", "camera": "cam02", "change": "changed", "offset_ms": 0.0, "drift_ppm": 0.0,
         "source": ["estimated", "manual"], "method": ["cameras", ""]},
    ]  # fmt: skip


def test_pictures_that_changed(whole, later):
    image = made_up.frames("walk_2", "cam02")["image"]
    image[:] = [image[0], made_up.jpeg(99), None, made_up.jpeg(3)]
    changed = made_up.frames("walk_2", "cam02", image=image, no_image=["", "", "no_consent", ""])
    made_up.write(later, "frames/zebra-0001/walk_2.cam02.parquet", "released_frames", changed)
    (one,) = diff.compared(whole, later)["recordings"]
    assert one["frames"] == {
        "frames_added": 0, "frames_removed": 0, "stamps_changed": 0, "pictures": 2, "pictures_changed": 1,
        "pictures_added": 1, "pictures_removed": 1, "no_image": {"head_unknown": [1, 0], "no_consent": [0, 1]},
    }  # fmt: skip


def test_walks_of_a_person_who_came_or_left(whole, tmp_path):
    fewer = made_up.release(tmp_path / "dior-0.2.0", who=("zebra-0001",))
    found = diff.compared(whole, fewer)
    assert found["sequences"] == {"added": [], "removed": ["walk_3"]}
    gone = [(one["sequence"], one.get("camera"), one["change"]) for one in found["recordings"] + found["skeletons"]]
    assert gone == [("walk_3", "cam01", "removed"), ("walk_3", "cam02", "removed"), ("walk_3", None, "removed")]
    assert {"README.md", "sequences.parquet", "splits.parquet"} <= set(found["files"]["changed"])
    assert diff.compared(fewer, whole)["sequences"] == {"added": ["walk_3"], "removed": []}


def session_file(session, name):
    return lambda content: content["sessions"][session].update({name: "other"})


def recording(sequence, name):
    return lambda content: content["sequences"][sequence]["recordings"].update({name: {"sha256": "other", "bytes": 1}})


def by_hand(sequence, path):
    return lambda content: content["sequences"][sequence]["by_hand"].update({path: "other"})


def setting(key, value="other", section="config"):
    return lambda content: content[section].update({key: value})


EVERYWHERE = {(walk, camera) for walk in made_up.WALKS for camera in made_up.CAMERAS}
OUTDOORS = {(walk, camera) for walk in ("walk_2", "walk_3") for camera in made_up.CAMERAS}
INDOORS = EVERYWHERE - OUTDOORS


@pytest.fixture(scope="module")
def moved(whole, tmp_path_factory):
    """Every label moves, and no pose."""
    folder = tmp_path_factory.mktemp("moved") / "dior-0.2.0"
    shutil.copytree(whole, folder)
    for walk, camera in EVERYWHERE:
        path = folder / f"labels_2d/{made_up.WALKS[walk][0]}/{walk}.{camera}.parquet"
        tables.write(path, "labels_2d", made_up.labels(walk, camera, **moved_by(1, 0, camera, walk)))
    return folder


def accepted(sequence, camera):
    return lambda content: content["sequences"][sequence].update(accepted={camera: "it is right"})


@pytest.mark.parametrize(
    ("change", "text", "touched"),
    [
        (accepted("walk_2", "cam02"), 'acceptance of camera cam02 of walk_2: not there -> "it is right"',
         {("walk_2", "cam02")}),
        (accepted("walk_2", ""), 'acceptance of walk_2: not there -> "it is right"',
         {("walk_2", "cam01"), ("walk_2", "cam02")}),
        (setting("evaluate.evaluate", section="code"), "code of evaluate.evaluate", OUTDOORS),
        (by_hand("walk_3", "config/checks/walk_3.cam02.csv"), "config/checks/walk_3.cam02.csv (new)",
         {("walk_3", "cam02")}),
    ],
)  # fmt: skip
def test_what_tells_of_a_red_light_is_the_reason_where_labels_lose_their_place(
    whole, moved, tmp_path, change, text, touched
):
    """The walks outdoors lose it; indoors labels move."""
    later = shutil.copytree(moved, tmp_path / "dior-0.2.0")
    for walk, camera in OUTDOORS:
        path = later / f"labels_2d/{made_up.WALKS[walk][0]}/{walk}.{camera}.parquet"
        tables.write_arrow(path, suspect.hidden(tables.read_arrow(path, "labels_2d")))
    provenance(later, change)
    found = diff.compared(whole, later)
    assert {(one["sequence"], one["camera"]) for one in found["recordings"] if one["because"]} == touched
    assert {tuple(one["because"]) for one in found["recordings"]} <= {(), (text,)}
    assert "status of 91.7 % changed, suspect 0 -> 11" in diff_text.of(found)


@pytest.mark.parametrize(
    ("change", "text", "touched"),
    [
        (session_file("field", "cam01.yaml"), "config/sessions/field/cam01.yaml", OUTDOORS),
        (session_file("field", "cam02.yaml"), "config/sessions/field/cam02.yaml",
         {("walk_2", "cam02"), ("walk_3", "cam02")}),
        (session_file("field", "session.yaml"), "config/sessions/field/session.yaml", OUTDOORS),
        (session_file("lab", "cam01.marks.csv"), "config/sessions/lab/cam01.marks.csv", {("walk_1", "cam01")}),
        (session_file("lab", "cam03.yaml"), "config/sessions/lab/cam03.yaml (new)", set()),
        (recording("walk_2", "bag_1"), "bag_1 of walk_2", {("walk_2", "cam01"), ("walk_2", "cam02")}),
        (recording("walk_2", "detections.cam01"), "detections.cam01 of walk_2",
         {("walk_2", "cam01"), ("walk_2", "cam02")}),
        (recording("walk_1", "mocap"), "mocap of walk_1", INDOORS),
        (by_hand("walk_2", "config/boxes/walk_2.cam02.csv"), "config/boxes/walk_2.cam02.csv", {("walk_2", "cam02")}),
        (by_hand("walk_2", "config/offsets/walk_2.yaml"), "config/offsets/walk_2.yaml (new)",
         {("walk_2", "cam01"), ("walk_2", "cam02")}),
        (by_hand("walk_2", "config/checks/walk_2.cam02.csv"), "config/checks/walk_2.cam02.csv (new)", set()),
        (setting("refine.method", "none"), 'setting refine.method: "spline" -> "none"', OUTDOORS),
        (setting("release.title", "x"), 'setting release.title: "made up" -> "x"', set()),
        (setting("release.faces", "fill"), 'setting release.faces: not there -> "fill"', set()),
        (setting("calibrate.locate", section="code"), "code of calibrate.locate", INDOORS),
        (setting("label.reproject", section="code"), "code of label.reproject", EVERYWHERE),
        (setting("numpy", "2", section="packages"), 'package numpy: "1" -> "2"', EVERYWHERE),
    ],
)  # fmt: skip
def test_a_changed_input_is_named_where_it_can_be_the_reason(whole, moved, change, text, touched):
    """A changed input is the reason of those that it can touch, and of no other."""
    provenance(moved, change)
    found = diff.compared(whole, moved)
    assert found["inputs"] == [text]
    assert {(one["sequence"], one["camera"]) for one in found["recordings"] if one["because"]} == touched
    assert {tuple(one["because"]) for one in found["recordings"]} <= {(), (text,)}


def test_inputs_of_another_walk_are_a_reason_through_the_poses_only(whole, later):
    for walk, camera in OUTDOORS:
        labels(later, camera, walk, **moved_by(1, 0, camera, walk))
    provenance(later, recording("walk_2", "bag_1"), by_hand("walk_2", "config/boxes/walk_2.cam02.csv"))
    wTc = np.tile(np.eye(4), (4, 1, 1))
    wTc[1, 0, 3] = 0.25
    made_up.write(later, "cameras.parquet", "released_cameras", made_up.cameras(wTc=wTc.reshape(4, 16)))
    because = {(one["sequence"], one["camera"]): one["because"] for one in diff.compared(whole, later)["recordings"]}
    both = ["bag_1 of walk_2", "config/boxes/walk_2.cam02.csv"]
    assert because == {
        ("walk_2", "cam01"): both[:1], ("walk_2", "cam02"): both, ("walk_3", "cam01"): both[:1],
        ("walk_3", "cam02"): both,
    }  # fmt: skip


def test_pictures_and_marks_have_reasons_of_their_own(whole, later):
    image = made_up.frames("walk_2", "cam02")["image"]
    image[0] = made_up.jpeg(99)
    changed = made_up.frames("walk_2", "cam02", image=image)
    made_up.write(later, "frames/zebra-0001/walk_2.cam02.parquet", "released_frames", changed)
    made_up.write(later, "marks/zebra-0001/walk_2.parquet", "released_marks", made_up.marks("walk_2", u=[9.0]))
    provenance(later, setting("release.faces"), by_hand("walk_2", "config/checks/walk_2.cam02.csv"))
    found = diff.compared(whole, later)
    assert found["recordings"][0]["because"] == ['setting release.faces: not there -> "other"']
    assert found["skeletons"][0]["because"] == ["config/checks/walk_2.cam02.csv (new)"]
    assert found["skeletons"][0]["marks"] == "changed"


def test_the_text_says_it_all(whole, later, capsys):
    labels(later, **moved_by(3, 4))
    provenance(later, session_file("field", "cam01.yaml"))
    made_up.write(later, "cameras.parquet", "released_cameras", made_up.cameras(fx=[21.0, 20, 20, 20]))
    made_up.write(later, "clocks.parquet", "released_clocks", made_up.clocks(offset_s=[0.501, *[0.5] * 5]))
    assert main.main(["diff", str(whole), str(later)]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "dior-0.1.0 -> dior-0.2.0",
        "",
        "cameras",
        "  field  cam01  fx 20.0 -> 21.0",
        "",
        "clocks",
        "  walk_1  cam01  offset by 1 ms, drift by 0 ppm",
        "",
        "labels and pictures",
        "  walk_2  cam01  labels_2d moved median 5, p95 5, max 5 px  because of [1]",
        "",
        "files changed: cameras.parquet, clocks.parquet, croissant.json, provenance.json",
        "",
        "inputs and settings that changed",
        "  [1] config/sessions/field/cam01.yaml",
    ]
    assert main.main(["diff", str(whole), str(later), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["recordings"][0]["because"] == ["config/sessions/field/cam01.yaml"]


def test_paths_that_are_no_release_are_one_sentence(whole, tmp_path, capsys):
    (tmp_path / "file").write_text("no release")
    (tmp_path / "empty").mkdir()
    for path, expected in (
        ("gone", "gone: there is no such folder; build the release first"),
        ("file", "file: is a file, not the folder of a release; tarballs are to be unpacked first"),
        (
            "empty",
            "empty/SHA256SUMS: there is no such file, so this is no whole release; build it again",
        ),
    ):
        for paths in ((whole, tmp_path / path), (tmp_path / path, whole)):
            assert main.main(["diff", *map(str, paths)]) == 2
            assert capsys.readouterr().err.splitlines() == [f"dior diff: {tmp_path}/{expected}"]


def test_a_release_of_a_newer_version_is_one_sentence(whole, later, capsys):
    provenance(later, lambda content: content.update(provenance_version=2))
    assert main.main(["diff", str(whole), str(later)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said == [
        f"dior diff: {later}/provenance.json: is of version 2, this dior knows 1; take the dior that made it"
    ]
    made_up.of_version(later, b"99")
    assert main.main(["diff", str(whole), str(later)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said == [
        f"dior diff: {later}: its tables are of version '99', this dior knows 1; take the dior that made it"
    ]
