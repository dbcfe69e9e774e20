"""`dior init --from`: what a folder of recordings becomes, and what it never does."""

import os
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml

from dior.cli import main
from dior.errors import DiorError
from dior.init import init
from dior.project import project, pseudonyms, todos
from dior.project.schema_check import read_sheet
from tests.ingest.test_trigger_log import write as write_log
from tests.init import small
from tests.init.small import T0, S


def made(folder, capsys=None, **how):
    """The project of the recordings in `folder`/recordings; returns its folder, and what was printed."""
    init.run(folder / "project", as_from=folder / "recordings", **how)
    return folder / "project", capsys.readouterr().out if capsys else ""


def rows(folder, sheet="sequences"):
    return read_sheet(folder / f"config/{sheet}.tsv", sheet, sheet.removesuffix("s"))[0]


def yaml_of(folder, path):
    return yaml.safe_load((folder / f"config/{path}.yaml").read_text())


def fill(folder, **answers):
    """Write what a person knows in the place of each TODO, by the last word of its key."""
    known = {"subject": "P1", "height_m": "1.7", "height_sigma_m": "0.01", "consent_release": "yes",
             "consent_pictures": "no", "position_m": "[{}, 1, 1]", **answers}  # fmt: skip
    for i, todo in enumerate(todos.found(folder)):
        path = folder / todo.path
        lines = path.read_text().split("\n")
        answer = known[todo.key.split(".")[-1]].format(3 * i)
        lines[todo.line - 1] = re.sub(r"TODO[^\t,}]*", lambda _, answer=answer: answer, lines[todo.line - 1], count=1)
        path.write_text("\n".join(lines))
    pseudonyms.run(folder)


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("close", [2, 3])
def test_where_two_cameras_are_adjusted_no_joint_is_seen_by_three(tmp_path, close):
    small.outdoor(tmp_path / "recordings", "out_1", cameras=[f"cam0{i}" for i in range(close)], far="cam09")
    folder, _ = made(tmp_path)
    assert yaml_of(folder, "config")["adjust"]["min_views"] == close


def test_a_clock_that_is_wrong_in_all_walks_is_told_once(tmp_path, capsys):
    for i in range(5):
        small.bag(tmp_path / f"recordings/w_{i}/pc1", ["cam01"], 100 * i, count=30)
        small.bag(tmp_path / f"recordings/w_{i}/pc2", ["cam02"], 100 * i + 7213, count=30)
    _, said = made(tmp_path, capsys)
    assert said.count("Look: ") == 1
    assert "Look: w_0_2: w_0/pc2.bag began 7213 s after w_0/pc1.bag" in said and "row; and 4 more like it.\n" in said


def test_videos_that_names_and_times_put_together_otherwise_are_not_to_be_renamed(tmp_path, capsys):
    videofiles = pytest.importorskip("tests.ingest.videofiles")
    for walk in (1, 2):
        (tmp_path / f"recordings/w_{walk}").mkdir(parents=True)
        for camera in (1, 2):
            made_at = {"creation_time": f"2024-05-01T1{walk + camera}:00:00.000000Z"}
            pictures = [videofiles.numbered(i + 5 * walk + camera) for i in range(30)]
            videofiles.write(tmp_path / f"recordings/w_{walk}/cam{camera}.mp4", pictures, metadata=made_at)
    _, said = made(tmp_path, capsys)
    assert "w_2/cam1.mp4: w_1/cam2.mp4 is called as w_1/cam1.mp4, and was recorded while w_2/cam1.mp4 was" in said


def test_walks_whose_cameras_have_names_of_their_own_are_of_one_session(tmp_path):
    for walk in ("w_1", "w_2"):
        small.pictures(tmp_path / f"recordings/{walk}", ["hall", "door"])
    folder, _ = made(tmp_path)
    found = rows_of_text(folder)
    assert {name: row["session"] for name, row in found.items()} == {"w_1": "outdoor", "w_2": "outdoor"}
    assert yaml_of(folder, "sessions/outdoor/session")["cameras"] == ["door", "hall"]


def test_of_motion_capture_that_is_no_walks_a_person_is_asked(lab, capsys):
    recordings = lab / "recordings"
    (recordings / "in_1/trial.c3d").rename(recordings / "in_1/Static 01.c3d")
    folder, said = made(lab, capsys)
    row = rows_of_text(folder)["in_1"]
    assert (row["mocap"], row["environment"]) == ("TODO: in_1/Static 01.c3d", "indoor") and "Look" not in said
    assert "by its name of somebody who stands" in " ".join((folder / "config/sequences.tsv").read_text().split("\n# "))
    shutil.rmtree(folder)
    (recordings / "vicon").mkdir()
    (recordings / "in_1/Static 01.c3d").rename(recordings / "vicon/gang7.c3d")
    os.utime(recordings / "vicon/gang7.c3d", ns=(1, 1))
    _, said = made(lab, capsys)
    assert (
        "Look: out_1, out_2 and in_1: of no walk by name or time is vicon/gang7.c3d; if this was indoors, its row "
        "needs its own" in said
    )


def test_a_capture_becomes_a_project_that_loads_once_it_is_filled_in(lab, capsys):
    folder, said = made(lab, capsys)
    sheet = rows(folder)
    assert list(sheet) == ["out_1", "out_2", "in_1"]
    assert {name: row["environment"] for name, row in sheet.items()} == {
        "out_1": "outdoor", "out_2": "outdoor", "in_1": "indoor",
    }  # fmt: skip
    assert sheet["out_1"] | {} == {
        "sequence": "out_1", "session_order": "1", "subject": "TODO", "session": "outdoor", "environment": "outdoor",
        "outfit": "", "walk": "", "bags": "out_1/pc1.bag;out_1/pc2.bag", "mocap": "", "trigger_log": "",
        "detections": "out_1/mlkit/{camera}.jsonl", "exclude_reason": "", "videos": "", "stamps": "", "truth": "",
    }  # fmt: skip
    assert sheet["in_1"]["mocap"] == "in_1/trial.c3d" and sheet["in_1"]["subject"] == "Anna"
    assert yaml_of(folder, "config")["data_root"] == "../recordings"
    session = yaml_of(folder, "sessions/outdoor/session")
    assert session["cameras"] == ["cam01", "cam02", "cam03"]
    assert session["adjust"] == {name: {"first": 0, "count": 39, "step": 1} for name in ("out_1", "out_2")}
    far = yaml_of(folder, "sessions/outdoor/cam03")
    assert far["role"] == "long_range" and far["locate"] == "align" and far["topic"] == "/cam03/image_raw/compressed"
    assert far["align"] == {"from": "boxes", "sequences": ["out_1", "out_2"], "fit": "range"}
    assert "indoor/cam01, indoor/cam02: click markers" in said and "outdoor/cam03: draw boxes" in said
    assert "nothing" not in said and "notes.txt" in said and "calibration/board.bag: is no walk by its name" in said
    with pytest.raises(DiorError, match="still TODO"):
        project.load(folder)
    fill(folder)
    for name in ("out_1", "out_2"):
        (folder / "config/boxes").mkdir(exist_ok=True)
        (folder / f"config/boxes/{name}.cam03.csv").write_text("frame,u_min,v_min,u_max,v_max\n")
    for name in ("cam01", "cam02"):
        (folder / f"config/sessions/indoor/{name}.marks.csv").write_text("sequence,frame,joint,u,v\nin_1,0,LASI,1,2\n")
    text = (folder / "config/subjects.tsv").read_text()
    (folder / "config/subjects.tsv").write_text(text + "P1\tpseudonym-1\t\t\tyes\tno\n")
    loaded = project.load(folder)
    assert loaded.sequences == ("in_1", "out_1", "out_2") and loaded.close("outdoor") == ["cam01", "cam02"]
    assert all((folder / path).exists() for name in loaded.sequences for path in loaded.recordings(name).values())


def test_every_guess_has_its_reason(lab):
    folder, _ = made(lab)
    text = (folder / "config/sequences.tsv").read_text()
    for words in (
        "pc1.bag and pc2.bag were recorded at the same time for 3.9 s", "in_1/trial.c3d has its name",
        "output of ML Kit: each has its name", "with the same cameras on one day", "Anna as the labels in",
    ):  # fmt: skip
        assert words in " ".join(text.replace("\n#", "").split()), words
    camera = (folder / "config/sessions/outdoor/cam03.yaml").read_text()
    assert "# somebody was detected in 0 of 80 pictures\nrole: long_range\n" in camera
    assert "# sequence: a name of letters" in text and "64x48 px, 10.0 pictures per second" in camera


def test_the_same_recordings_are_the_same_bytes(lab):
    first = contents(made(lab)[0])
    shutil.rmtree(lab / "project")
    assert contents(made(lab)[0]) == first
    assert not any(str(lab).encode() in text for text in first.values())


def test_a_dry_run_writes_nothing(lab, capsys):
    _, said = made(lab, capsys, dry_run=True)
    assert not (lab / "project").exists() and "Nothing was written" in said and "out_1/mlkit/{camera}.jsonl" in said


def test_recordings_are_left_as_they_are(lab):
    before = contents(lab / "recordings")
    made(lab)
    assert contents(lab / "recordings") == before


def test_called_again_it_adds_what_is_new_and_changes_nothing_else(lab, capsys):
    folder, _ = made(lab)
    fill(folder)
    sheet = folder / "config/sequences.tsv"
    sheet.write_text(sheet.read_text().replace("out_1\t1\tP1", "out_1\t7\tP1").replace("out_2\t2", "lawn\t8"))
    shutil.rmtree(lab / "recordings/in_1")
    small.outdoor(lab / "recordings", "out_3", 200)
    small.outdoor(lab / "recordings", "out_4", 10 * 86400)
    before = contents(folder)
    _, said = made(lab, capsys)
    after = contents(folder)
    changed = {str(path) for path in after if after[path] != before.get(path)}
    assert changed == {"config/sequences.tsv", *(
        f"config/sessions/outdoor_2/{name}.yaml" for name in ("session", "cam01", "cam02", "cam03"))}  # fmt: skip
    assert sheet.read_bytes().startswith(before[sheet.relative_to(folder)])
    found = rows(folder)
    assert list(found) == ["out_1", "lawn", "in_1", "out_3", "out_4"]
    assert (found["out_3"]["session"], found["out_3"]["session_order"]) == ("outdoor", "9")
    assert (found["out_4"]["session"], found["out_4"]["session_order"]) == ("outdoor_2", "1")
    assert "the files of in_1 are gone: bags in_1/pc1.bag, mocap in_1/trial.c3d, detections in_1/mlkit" in said
    _, said = made(lab, capsys)
    assert "Nothing is new" in said and contents(folder) == after


def test_what_was_asked_and_is_there_now_is_told(lab, capsys):
    kept = lab / "kept"
    shutil.move(lab / "recordings/out_2/mlkit", kept)
    folder, _ = made(lab)
    assert rows_of_text(folder)["out_2"]["detections"] == "TODO"
    shutil.move(kept, lab / "recordings/out_2/mlkit")
    _, said = made(lab, capsys)
    assert "detections of out_2 may be out_2/mlkit/{camera}.jsonl by now" in said


def rows_of_text(folder):
    """Rows of the sheet as they are: a TODO is no path."""
    header, *body = [line.split("\t") for line in (folder / "config/sequences.tsv").read_text().split("\n")
                     if line and not line.startswith("#")]  # fmt: skip
    return {cells[0]: dict(zip(header, cells, strict=True)) for cells in body}


def test_where_two_are_possible_it_asks(lab):
    for camera in ("cam01", "cam02", "cam03"):
        small.mlkit(lab / f"recordings/out_1/mlkit_old/{camera}.jsonl", height_px=38.0)
    small.c3d(lab / "recordings/in_1/trial_2.c3d", "Anna:", ("LASI", "RASI", "LPSI", "RPSI", "RKNE"))
    found = rows_of_text(made(lab)[0])
    assert found["out_1"]["detections"] == "TODO: out_1/mlkit/{camera}.jsonl or out_1/mlkit_old/{camera}.jsonl"
    assert found["in_1"]["mocap"] == "TODO: in_1/trial.c3d or in_1/trial_2.c3d"


def test_the_trigger_log_tells_the_motion_capture(tmp_path):
    for i, walk in enumerate(("a", "b")):
        small.outdoor(tmp_path / "recordings", walk, 100 * i, far=None)
        small.c3d(tmp_path / f"recordings/mocap/Trial{i + 7}.c3d")
    events = [(what, f"Trial{i + 7}", 100 * i + at - 0.0) for i in (0, 1) for what, at in (("start", 0.5), ("stop", 3))]
    log = write_log(tmp_path / "recordings/trigger.jsonl", *events)
    found = rows(made(tmp_path)[0])
    assert log.exists() and [found[walk]["mocap"] for walk in ("a", "b")] == ["mocap/Trial7.c3d", "mocap/Trial8.c3d"]
    assert [found[walk]["trigger_log"] for walk in ("a", "b")] == ["trigger.jsonl"] * 2


def test_stamps_in_detections_win_over_their_names(tmp_path):
    for i, walk in enumerate(("a", "b")):
        small.bag(tmp_path / f"recordings/{walk}/pc1", ["cam01", "cam02"], 100 * i)
        for camera in ("cam01", "cam02"):
            other = {"a": "b", "b": "a"}[walk]
            small.mlkit(tmp_path / f"recordings/mlkit/{other}/{camera}.jsonl", first_ns=T0 + 100 * i * S)
    found = rows(made(tmp_path)[0])
    assert found["a"]["detections"] == "mlkit/b/{camera}.jsonl"


def test_names_with_blanks_capitals_and_umlauts(tmp_path):
    folder = tmp_path / "recordings/Gang Süd/Läufer 1"
    small.bag(folder / "PC1", ["Kamera_1", "Kamera_2"])
    for i in (1, 2):
        small.mlkit(folder / f"Posen/Kamera {i}.JSONL")
    root, _ = made(tmp_path)
    found = rows(root)["Laeufer_1"]
    assert found["bags"] == "Gang Süd/Läufer 1/PC1.bag" and found["session"] == "Gang_Sued"
    assert found["detections"] == "Gang Süd/Läufer 1/Posen/Kamera {camera}.JSONL"
    assert yaml_of(root, "sessions/Gang_Sued/session")["cameras"] == ["1", "2"]
    assert yaml_of(root, "sessions/Gang_Sued/2")["topic"] == "/Kamera_2/image_raw/compressed"
    fill(root)
    assert project.load(root).detections_pattern("Laeufer_1").endswith("Posen/Kamera {camera}.JSONL")


def test_people_in_folders_are_who_walks_and_are_in_no_name(tmp_path):
    for i, person in enumerate(("S01", "S02")):
        small.outdoor(tmp_path / "recordings", f"{person}/walk_1", 100 * i)
    root, _ = made(tmp_path)
    found = rows(root)
    assert {name: (row["subject"], row["session"]) for name, row in found.items()} == {
        "walk_1": ("S01", "outdoor"), "walk_1_2": ("S02", "outdoor"),
    }  # fmt: skip
    assert list(rows_of_people(root)) == ["S01", "S02"]


def rows_of_people(folder):
    lines = [line.split("\t") for line in (folder / "config/subjects.tsv").read_text().split("\n")
             if line and not line.startswith("#")]  # fmt: skip
    return {cells[0]: cells for cells in lines[1:]}


def test_a_lens_that_a_bag_cannot_tell_is_asked_once_for_each_device(tmp_path):
    for session, start in (("a", 0), ("b", 864000)):
        small.outdoor(tmp_path / "recordings", session, start, topic="/{}/color/image_raw/compressed",
                      d=(0.1, 0.0, 0.0, 0.0, 0.0))  # fmt: skip
    root, _ = made(tmp_path)
    asked = [todo for todo in todos.found(root) if "lens" in todo.key or "distortion" in todo.key]
    assert [todo.key for todo in asked] == ["lenses.realsense_64x48_f600"]
    for session in ("outdoor", "outdoor_2"):
        assert yaml_of(root, f"sessions/{session}/cam01")["lens"] == "realsense_64x48_f600"


@pytest.mark.parametrize("form", ["mcap", "db3"])
def test_folders_of_ros_2_are_bags(tmp_path, form):
    small.bag(tmp_path / "recordings/w/pc1", ["cam01", "cam02"], form=form)
    assert rows_of_text(made(tmp_path)[0])["w"]["bags"] == "w/pc1"


def test_an_empty_folder_and_none_are_one_sentence(tmp_path, capsys):
    with pytest.raises(DiorError, match="recordings: there is no such folder"):
        made(tmp_path)
    (tmp_path / "recordings").mkdir()
    with pytest.raises(DiorError, match="no recording with pictures of a walk is below it; bags, videos"):
        made(tmp_path)
    (tmp_path / "recordings/pc1.bag").write_bytes(b"#ROSBAG V2.0\nxx")
    assert main.main(["init", str(tmp_path / "project"), "--from", str(tmp_path / "recordings")]) == 1
    assert "pc1.bag: the bag is truncated" in capsys.readouterr().err and not (tmp_path / "project").exists()


def test_recordings_elsewhere_are_another_project(lab, tmp_path):
    folder, _ = made(lab)
    shutil.copytree(lab / "recordings", tmp_path / "others")
    with pytest.raises(DiorError, match=r"'data_root' is .*recordings, and .*others is not in it"):
        init.run(folder, as_from=tmp_path / "others")
    init.run(folder, as_from=lab / "recordings/out_1")


def test_of_a_project_among_its_recordings_only_these_are_looked_at(lab):
    folder = lab / "recordings"
    init.run(folder, as_from=folder)
    before = contents(folder / "config")
    (folder / "results").mkdir()
    shutil.copy(folder / "out_1/pc1.bag", folder / "results/made.bag")
    init.run(folder, as_from=folder)
    assert contents(folder / "config") == before and yaml_of(folder, "config")["data_root"] == "."


def test_five_hundred_files_are_quick(tmp_path):
    small.outdoor(tmp_path / "recordings", "w")
    for i in range(500):
        (tmp_path / f"recordings/picture_{i}.txt").write_text("notes")
    began = time.process_time()
    made(tmp_path)
    # chosen: ten times what it takes
    assert time.process_time() - began < 5


def test_what_no_sheet_can_hold_is_told(lab, capsys):
    for name in ("a;b", "{x}", 'say "hello"', " blank", "back\x08"):
        shutil.copytree(lab / "recordings/out_1", lab / f"recordings/{name}")
    folder, said = made(lab, capsys)
    assert list(rows(folder)) == ["out_1", "out_2", "in_1"] and said.count("no sheet can hold; rename it") == 10


def test_a_dry_run_of_nothing_is_refused(tmp_path):
    with pytest.raises(DiorError, match="name their folder by --from"):
        init.run(tmp_path, dry_run=True)


def lenses(path, x=0.0, pose=True):
    """A calibration of cam_1 to cam_3 as Pose2Sim writes it; `x`: m, where the first camera is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = ""
    for i in (1, 2, 3):
        text += f'[cam_{i}]\nname = "cam_{i}"\nsize = [64.0, 48.0]\nfisheye = false\n'
        text += "matrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]\ndistortions = [0.1, 0.0, 0.0, 0.0]\n"
        text += f"rotation = [1.57, 0.0, 0.0]\ntranslation = [{x + i}, 0.0, 0.0]\n" if pose else ""
    path.write_text(text)


def test_a_calibration_that_knows_the_cameras_has_their_poses(lab):
    lenses(lab / "recordings/reference/cal.toml")
    folder, _ = made(lab)
    camera = yaml_of(folder, "sessions/outdoor/cam03")
    assert camera["locate"] == "reference" and camera["role"] == "long_range" and camera["intrinsics"] == "camera_info"
    assert camera["reference"] == {"file": "reference/cal.toml", "name": "cam_3"}
    assert yaml_of(folder, "sessions/outdoor/session") == {"cameras": ["cam01", "cam02", "cam03"]}


def test_other_poses_are_another_session_and_the_nearest_file_counts(lab):
    lenses(lab / "recordings/cal.toml", 7)
    lenses(lab / "recordings/out_1/cal.toml")
    folder, _ = made(lab)
    assert [rows_of_text(folder)[name]["session"] for name in ("out_1", "out_2")] == ["outdoor", "outdoor_2"]
    assert yaml_of(folder, "sessions/outdoor/cam01")["reference"]["file"] == "out_1/cal.toml"
    assert yaml_of(folder, "sessions/outdoor_2/cam01")["reference"]["file"] == "cal.toml"


def test_the_same_poses_in_two_files_are_one_session(lab):
    for walk in ("out_1", "out_2"):
        lenses(lab / f"recordings/{walk}/cal.toml")
    folder, _ = made(lab)
    assert [rows_of_text(folder)[name]["session"] for name in ("out_1", "out_2")] == ["outdoor"] * 2


def test_of_two_calibrations_one_is_asked_for(lab):
    lenses(lab / "recordings/a.toml")
    lenses(lab / "recordings/b.toml", 7)
    folder, _ = made(lab)
    text = (folder / "config/sessions/outdoor/cam01.yaml").read_text()
    assert "which of {file: a.toml, name: cam_1} or {file: b.toml, name: cam_1}?\nreference:\n  file: TODO\n" in text


def test_folders_of_pictures_have_lenses_from_a_file_and_are_asked_for_their_rate(tmp_path):
    small.pictures(tmp_path / "recordings/w", ("cam1", "cam2"))
    lenses(tmp_path / "recordings/cal.toml", pose=False)
    root, _ = made(tmp_path)
    camera = yaml_of(root, "sessions/outdoor/cam1")
    assert camera["intrinsics"] == {"file": "cal.toml", "name": "cam_1"} and camera["video"] == {"fps": "TODO"}
    assert "topic" not in camera and camera["locate"] == "tape"
    assert rows_of_text(root)["w"]["videos"] == "w/{camera}" and rows_of_text(root)["w"]["bags"] == ""


def test_few_pictures_are_no_walk_and_a_skeleton_is_no_motion_capture(lab, capsys):
    small.bag(lab / "recordings/out_1/test", ["cam01"], count=29)
    depth = [small.bagfiles.raw("/cam01/image", T0 + i * S, np.zeros((4, 4, 2), np.uint8), "16UC1") for i in range(40)]
    small.bagfiles.write(lab / "recordings/out_2/depth", depth, "ros1")
    small.c3d(lab / "recordings/out_1/skeleton.c3d", labels=("RHip", "RKnee", "RAnkle", "LHip", "LKnee"))
    small.c3d(lab / "recordings/out_2/own.c3d", labels=("hip_r", "mark 2", "mark 3", "mark 4", "x"))
    folder, said = made(lab, capsys)
    assert "out_1/test.bag: 29 pictures are no walk" in said
    assert "out_2/depth.bag: its pictures cannot be read: of /cam01/image, encoding '16UC1'" in said
    assert "out_1/skeleton.c3d: holds the joints of a skeleton" in said
    found = rows_of_text(folder)
    assert found["out_1"]["mocap"] == "" and found["out_2"]["mocap"] == "out_2/own.c3d"
    assert "config/markers.tsv says which is which" in " ".join((folder / "config/sequences.tsv").read_text().split())


def test_motion_capture_that_was_saved_right_after_a_walk_is_its(tmp_path):
    for i, walk in enumerate(("a", "b")):
        small.outdoor(tmp_path / "recordings", walk, 100 * i, far=None)
        small.c3d(tmp_path / f"recordings/mocap/take {i + 7}.c3d")
        os.utime(tmp_path / f"recordings/mocap/take {i + 7}.c3d", ns=(T0, T0 + (100 * i + 20) * S))
    small.c3d(tmp_path / "recordings/mocap/take 9.c3d")
    found = rows(made(tmp_path)[0])
    assert [found[walk]["mocap"] for walk in ("a", "b")] == ["mocap/take 7.c3d", "mocap/take 8.c3d"]


def test_two_kinds_of_a_device_are_asked_for_and_a_new_one_in_its_cameras(tmp_path):
    how = {"topic": "/{}/color/image_raw/compressed", "d": (0.1, 0.0, 0.0, 0.0, 0.0), "far": None}
    small.outdoor(tmp_path / "recordings", "a", **how)
    root, _ = made(tmp_path)
    small.outdoor(tmp_path / "recordings", "b", 864000, **how, focal_px=625)
    small.outdoor(tmp_path / "recordings", "c", 2 * 864000, **how, focal_px=640)
    made(tmp_path)
    assert yaml_of(root, "sessions/outdoor_2/cam01")["lens"] == "realsense_64x48_f600"
    other = yaml_of(root, "sessions/outdoor_3/cam01")
    assert other["distortion_model"] == "TODO" and "lens" not in other


def test_names_of_people_in_labels_are_in_no_name(tmp_path):
    small.outdoor(tmp_path / "recordings", "day_1/Anna_walk_1", far=None)
    small.c3d(tmp_path / "recordings/day_1/Anna_walk_1/x.c3d", "Anna:")
    (found,) = rows(made(tmp_path)[0]).values()
    assert (found["sequence"], found["subject"], found["session"]) == ("walk_1", "Anna", "day_1")


def test_a_sheet_without_a_column_that_is_needed_is_not_added_to(tmp_path):
    small.pictures(tmp_path / "recordings/w", ("cam1", "cam2"))
    init.run(tmp_path / "project")
    config = tmp_path / "project/config/config.yaml"
    config.write_text(config.read_text().replace("data_root: data", "data_root: ../recordings"))
    before = contents(tmp_path / "project")
    with pytest.raises(DiorError, match="there is no column 'videos', which 'w' needs; add it"):
        made(tmp_path)
    assert contents(tmp_path / "project") == before
    small.outdoor(tmp_path / "recordings", "rosbag2_2024_05_01-10_30_00")
    shutil.rmtree(tmp_path / "recordings/w")
    assert list(rows_of_text(made(tmp_path)[0])) == ["outdoor_01"]


def test_days_in_folders_are_sessions_and_in_no_name(tmp_path):
    for day in ("2024-05-01", "2024-05-02"):
        small.pictures(tmp_path / f"recordings/{day}/walk_1", ("cam1", "cam2"))
    found = rows_of_text(made(tmp_path)[0])
    assert {name: row["session"] for name, row in found.items()} == {"walk_1": "outdoor", "walk_1_2": "outdoor_2"}


def test_names_that_yaml_would_take_for_numbers_stay_names(tmp_path):
    for i, walk in enumerate(("1", "007", "off")):
        small.outdoor(tmp_path / "recordings", walk, 100 * i)
    root, _ = made(tmp_path)
    assert list(yaml_of(root, "sessions/outdoor/session")["adjust"]) == ["1", "007", "off"]
    assert yaml_of(root, "sessions/outdoor/cam03")["align"]["sequences"] == ["1", "007"]


def test_videos_and_line_ends_of_a_spreadsheet_are_known_again(tmp_path, capsys):
    small.pictures(tmp_path / "recordings/w", ("cam1", "cam2"))
    folder, _ = made(tmp_path)
    sheet = folder / "config/sequences.tsv"
    sheet.write_bytes(b"\xef\xbb\xbf" + sheet.read_bytes().replace(b"\n", b"\r\n"))
    before = sheet.read_bytes()
    assert "Nothing is new" in made(tmp_path, capsys)[1] and sheet.read_bytes() == before
    small.pictures(tmp_path / "recordings/v", ("cam1", "cam2"))
    made(tmp_path)
    after = sheet.read_bytes()
    assert after.startswith(before) and after.count(b"\n") == after.count(b"\r\n") > before.count(b"\n")


def test_a_session_whose_recordings_are_gone_keeps_its_name(lab):
    folder, _ = made(lab)
    for walk in ("out_1", "out_2"):
        shutil.rmtree(lab / "recordings" / walk)
    small.outdoor(lab / "recordings", "out_1", 10 * 86400)
    shutil.move(lab / "recordings/out_1", lab / "recordings/out_9")
    made(lab)
    assert {name: row["session"] for name, row in rows_of_text(folder).items()} == {
        "out_1": "outdoor", "out_2": "outdoor", "in_1": "indoor", "out_9": "outdoor_2",
    }  # fmt: skip


def test_real_recordings_of_others(shared, tmp_path, capsys):
    init.run(tmp_path, as_from=shared / "real_outdoor")
    said = capsys.readouterr().out
    (row,) = rows_of_text(tmp_path).values()
    assert row["bags"] == "pc1.bag;pc2.bag" and row["environment"] == "outdoor" and row["mocap"] == ""
    assert row["detections"] == "TODO: mlkit/{camera}.jsonl or openpose/{camera} or openpose_single/{camera}"
    assert "reference/skeleton.trc: holds the joints of a skeleton" in said
    for camera in ("cam01", "cam02", "cam03", "cam04"):
        found = yaml_of(tmp_path, f"sessions/outdoor/{camera}")
        assert found["role"] == "close" and found["locate"] == "reference"
        # the poses are the same in both files, the lenses are not
        assert found["reference"] == {"file": "reference/calibration.toml", "name": f"cam_{camera[3:]}"}


def test_motion_capture_that_cannot_be_read_is_no_walk_outdoors(lab, capsys):
    for i, content in enumerate((b"", b"\0" * 600, (lab / "recordings/in_1/trial.c3d").read_bytes()[:600], None)):
        path = lab / "recordings/in_1/trial.c3d"
        path.unlink()
        if content is None:
            path.symlink_to("elsewhere.c3d")
        else:
            path.write_bytes(content)
        init.run(lab / f"project_{i}", as_from=lab / "recordings")
        said = capsys.readouterr().out
        found = rows_of_text(lab / f"project_{i}")["in_1"]
        assert (found["environment"], found["mocap"]) == ("indoor", "TODO: in_1/trial.c3d")
        assert "Look: in_1: in_1/trial.c3d could not be read: " in said and "no motion capture belongs" not in said
        text = " ".join((lab / f"project_{i}/config/sequences.tsv").read_text().replace("\n#", "").split())
        assert "trial.c3d could not be read: " in text.partition("in_1: ")[2]
        assert yaml_of(lab / f"project_{i}", "sessions/indoor/cam01")["locate"] == "marks"


def test_of_two_files_with_motion_capture_the_broken_one_is_told(lab):
    (lab / "recordings/in_1/trial_2.c3d").write_bytes(b"")
    found = rows_of_text(made(lab)[0])["in_1"]
    assert found["mocap"] == "TODO: in_1/trial.c3d or in_1/trial_2.c3d"
    text = " ".join((lab / "project/config/sequences.tsv").read_text().replace("\n#", "").split())
    assert "in_1/trial_2.c3d could not be read (is empty)" in text


def test_detections_that_cannot_be_read_make_no_camera_far_away(lab, capsys):
    shutil.rmtree(lab / "recordings/out_2")
    mlkit = lab / "recordings/out_1/mlkit"
    (mlkit / "cam02.jsonl").write_text("")
    (mlkit / "cam03.jsonl").write_text((mlkit / "cam03.jsonl").read_text()[:-3])
    folder, said = made(lab, capsys)
    assert "Look: out_1: out_1/mlkit/cam02.jsonl: is empty" in said
    for camera, words in (("cam02", "is empty"), ("cam03", "line 40")):
        text = (folder / f"config/sessions/outdoor/{camera}.yaml").read_text()
        assert "role: TODO" in text and words in " ".join(text.replace("\n#", "").split())
    assert yaml_of(folder, "sessions/outdoor/cam01")["role"] == "close"


def test_cameras_without_a_recording_are_named_and_nothing_is_to_be_renamed(tmp_path, capsys):
    for i, walk in enumerate(("a", "b")):
        small.bag(tmp_path / f"recordings/{walk}/pc1", ("camera_1", "camera_2"), 100 * i)
        for camera in ("cam01", "cam02", "cam03", "cam04"):
            small.mlkit(tmp_path / f"recordings/{walk}/mlkit/{camera}.jsonl")
    folder, said = made(tmp_path, capsys)
    assert "Look: a and b: no recording of cam03, cam04 was found; detections of them are there." in said
    assert rows_of_text(folder)["a"]["detections"] == "a/mlkit/{camera}.jsonl" and "rename" not in said
    assert yaml_of(folder, "sessions/outdoor/session")["cameras"] == ["cam01", "cam02"]
    assert yaml_of(folder, "sessions/outdoor/cam01")["role"] == "close"


def test_a_recording_that_cannot_be_read_is_told_of_its_walk(lab, capsys):
    (lab / "recordings/out_1/pc2.bag").write_bytes(b"#ROSBAG V2")
    (lab / "recordings/out_2/pc2.bag").unlink()
    (lab / "recordings/out_2/pc2.bag").symlink_to("pc3.bag")
    _, said = made(lab, capsys)
    assert "Look: out_1: out_1/pc2.bag could not be read (the bag ends after 10 bytes; copy it again" in said
    assert "Look: out_2: out_2/pc2.bag could not be read (is a link to a file or folder that is not there)" in said
    assert "Look: out_1 and out_2: no recording of cam03 was found" in said


@pytest.mark.parametrize("place", ["kf", "kf/config", "kf/deeper/project"])
@pytest.mark.parametrize("recordings", [True, False])
def test_a_file_in_the_place_of_the_project_is_one_sentence(lab, place, recordings):
    (lab / place).parent.mkdir(exist_ok=True, parents=True)
    file = lab / place if place == "kf/config" else lab / "kf"
    if place == "kf/deeper/project":
        shutil.rmtree(file)
    file.write_text("mine")
    folder = lab / "kf" if place == "kf/config" else lab / place
    with pytest.raises(DiorError, match=rf"{file}: is a file, and a project is a folder"):
        init.run(folder, as_from=lab / "recordings" if recordings else None)
    with pytest.raises(DiorError, match="kf: is a file; name the folder|config: is a file; name the folder"):
        init.run(lab / "project", as_from=file)


def test_what_may_not_be_looked_at_is_named_with_the_fix(lab):
    """Told by another process: who runs the tests may look at everything."""
    recordings = lab / "recordings"
    (recordings / "out_2").chmod(0)
    (recordings / "out_1/pc2.bag").chmod(0)
    (recordings / "out_1/mlkit").chmod(0o444)
    command = [sys.executable, "-m", "dior.cli.main", "init", str(lab / "project"), "--from", str(recordings)]
    if os.geteuid() == 0:
        command = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", *command]
        if shutil.which("setpriv") is None:
            pytest.skip("there is no setpriv, and root may look at everything")
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    finally:
        for path in ("out_2", "out_1/pc2.bag", "out_1/mlkit"):
            (recordings / path).chmod(0o755)
    assert done.returncode == 0, done.stderr
    assert "out_2: Permission denied; try `chmod u+rx out_2`" in done.stdout
    assert "out_1/pc2.bag could not be read (Permission denied; try `chmod u+r out_1/pc2.bag`)" in done.stdout
    assert "out_1/mlkit/3 files *.jsonl: Permission denied; try `chmod u+rx out_1/mlkit`" in done.stdout
