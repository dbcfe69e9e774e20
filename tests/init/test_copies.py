"""What is there twice is used once, and two cameras are never one file."""

import os
import shutil

import pytest

from dior.errors import DiorError
from dior.init import init
from tests.ingest import bagfiles
from tests.init import small
from tests.init.test_init import T0, S, made, rows_of_text, yaml_of


def aside(said):
    """Lines about what belongs to no walk."""
    return [line.strip() for line in said.rpartition("These belong to no walk:\n")[2].split("\n\n")[0].split("\n")]


@pytest.mark.parametrize(
    ("copy", "of"),
    [
        ("backup/out_1_pc1.bag", "out_1/pc1.bag"), ("out_1/pc1 (1).bag", "out_1/pc1.bag"),
        ("out_1/Kopie von pc1.bag", "out_1/pc1.bag"), ("a/x.bag", "out_1/pc1.bag"), ("x.bag", "out_1/pc1.bag"),
        ("out_3/pc1.bag", "that in out_1"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("link", [False, True])
def test_a_recording_that_is_there_twice_is_used_once(lab, capsys, copy, of, link):
    path = lab / "recordings" / copy
    path.parent.mkdir(exist_ok=True)
    if link:
        path.symlink_to(lab / "recordings/out_1/pc1.bag")
    else:
        shutil.copy(lab / "recordings/out_1/pc1.bag", path)
    folder, said = made(lab, capsys)
    found = rows_of_text(folder)
    assert list(found) == ["out_1", "out_2", "in_1"] and found["out_1"]["bags"] == "out_1/pc1.bag;out_1/pc2.bag"
    assert yaml_of(folder, "sessions/outdoor/session")["cameras"] == ["cam01", "cam02", "cam03"]
    assert f"{copy}: is the same recording as {of}, which is used" in aside(said)


def test_a_whole_folder_that_is_there_twice_is_used_once(lab, capsys):
    shutil.copytree(lab / "recordings/in_1", lab / "recordings/old/first")
    shutil.copytree(lab / "recordings/out_1", lab / "recordings/out_1 copy")
    (lab / "recordings/latest").symlink_to("out_2")
    folder, said = made(lab, capsys)
    found = rows_of_text(folder)
    assert {name: row["detections"] for name, row in found.items()} == {
        name: f"{name}/mlkit/{{camera}}.jsonl" for name in ("out_1", "out_2", "in_1")
    }
    assert found["in_1"]["mocap"] == "in_1/trial.c3d"
    assert "old/first/pc1.bag: is the same recording as that in in_1, which is used" in aside(said)
    assert "out_1 copy/2 files *.bag: is the same recording as that in out_1, which is used" in aside(said)
    assert "latest/2 files *.bag: is the same recording as that in out_2, which is used" in aside(said)


def test_copies_of_what_belongs_to_a_walk_are_told(lab, capsys):
    shutil.copytree(lab / "recordings/out_1/mlkit", lab / "recordings/out_1/mlkit_old")
    shutil.copy(lab / "recordings/in_1/trial.c3d", lab / "recordings/in_1/trial_copy.c3d")
    folder, said = made(lab, capsys)
    found = rows_of_text(folder)
    assert found["out_1"]["detections"] == "out_1/mlkit/{camera}.jsonl" and found["in_1"]["mocap"] == "in_1/trial.c3d"
    assert "in_1/trial_copy.c3d: is a copy of in_1/trial.c3d, which is used" in aside(said)
    assert "out_1/mlkit_old/3 files *.jsonl: is a copy of that of out_1/mlkit/{camera}.jsonl, which is used" in aside(
        said
    )


def test_what_the_sheet_has_is_used_whatever_it_is_called(lab, capsys):
    (lab / "recordings/out_1").rename(lab / "recordings/backup")
    folder, _ = made(lab)
    shutil.copytree(lab / "recordings/backup", lab / "recordings/out_1")
    _, said = made(lab, capsys)
    assert "Nothing is new" in said
    assert "out_1/2 files *.bag: is the same recording as that in backup, which is used" in aside(said)


@pytest.mark.parametrize("form", ["mcap", "db3"])
def test_a_bag_that_was_converted_is_the_same(lab, capsys, form):
    small.bag(lab / "recordings/out_1/ros2", ("cam01", "cam02"), form=form)
    folder, said = made(lab, capsys)
    assert rows_of_text(folder)["out_1"]["bags"] == "out_1/pc1.bag;out_1/pc2.bag"
    assert "out_1/ros2: is the same recording as out_1/pc1.bag, which is used" in aside(said)


def test_bags_of_which_one_holds_the_other(tmp_path, capsys):
    for name, cameras in (
        ("all", ("cam01", "cam02", "cam03")),
        ("pc1", ("cam01", "cam02")),
        ("pc2", ("cam03", "cam04")),
    ):
        small.bag(tmp_path / f"recordings/w/{name}", cameras)
    folder, said = made(tmp_path, capsys)
    assert rows_of_text(folder)["w"]["bags"] == "w/all.bag;w/pc2.bag"
    assert "w/pc1.bag: is the same recording as w/all.bag, which is used" in aside(said)
    assert "w/pc2.bag has the pictures of /cam03/image_raw/compressed that w/all.bag has" in said
    session = f"sessions/{rows_of_text(folder)['w']['session']}"
    assert yaml_of(folder, f"{session}/session")["cameras"] == ["cam01", "cam02", "cam03", "cam04"]
    assert yaml_of(folder, f"{session}/cam03")["bag"] == "all" and "bag" not in yaml_of(folder, f"{session}/cam04")


def test_other_pictures_at_the_same_time_are_another_camera(tmp_path):
    """As of two computers whose cameras a signal triggers: the topics and the stamps are the same."""
    for i, computer in enumerate(("pc1", "pc2")):
        jpeg = bagfiles.encoded(bagfiles.picture(50 + 100 * i), ".jpg")
        sent = [
            bagfiles.Sent("/camera/image/compressed", T0 + n * S // 10, T0 + n * S // 10, bagfiles.PACKED,
                          {"format": "x", "data": jpeg}) for n in range(40)
        ]  # fmt: skip
        (tmp_path / "recordings/w").mkdir(parents=True, exist_ok=True)
        bagfiles.write(tmp_path / f"recordings/w/{computer}", sent, "ros1")
    folder, _ = made(tmp_path)
    assert rows_of_text(folder)["w"]["bags"] == "w/pc1.bag;w/pc2.bag"


def test_two_computers_with_the_same_topics_are_as_many_cameras(tmp_path):
    for i, computer in enumerate(("pc1", "pc2")):
        small.bag(tmp_path / f"recordings/w/{computer}", ("cam01", "cam02"), 0.013 * i)
    folder, _ = made(tmp_path)
    names = ["cam01_pc1", "cam01_pc2", "cam02_pc1", "cam02_pc2"]
    assert yaml_of(folder, "sessions/outdoor/session")["cameras"] == names
    told = {name: yaml_of(folder, f"sessions/outdoor/{name}") for name in names}
    assert {name: (of["topic"].split("/")[1], of["bag"]) for name, of in told.items()} == {
        name: tuple(name.split("_")) for name in names
    }


def test_a_camera_that_is_called_session_does_not_take_its_file(tmp_path, capsys):
    small.bag(tmp_path / "recordings/w/pc1", ("session", "cam02"))
    folder, _ = made(tmp_path)
    assert yaml_of(folder, "sessions/outdoor/session")["cameras"] == ["cam02", "session_2"]
    shutil.rmtree(tmp_path / "recordings/w")
    shutil.rmtree(folder)
    small.pictures(tmp_path / "recordings/w", ("session", "door"))
    with pytest.raises(DiorError, match=r"outdoor/session.yaml would be written twice: the camera in w/session"):
        made(tmp_path)
    assert not folder.exists()


def test_pictures_of_a_camera_that_is_in_a_bag_are_left_out(tmp_path, capsys):
    small.bag(tmp_path / "recordings/w/pc1", ("cam01", "cam02"))
    small.pictures(tmp_path / "recordings/w", ("cam01", "cam02"))
    folder, said = made(tmp_path, capsys)
    assert (rows_of_text(folder)["w"]["videos"], rows_of_text(folder)["w"]["bags"]) == ("", "w/pc1.bag")
    assert "w/cam01: cam01 is in w/pc1.bag, and that is used" in said
    shutil.rmtree(folder)
    small.pictures(tmp_path / "recordings/w", ("cam03",))
    made(tmp_path)
    assert rows_of_text(folder)["w"]["videos"] == "w/{camera}"
    assert [yaml_of(folder, f"sessions/outdoor/cam0{i}").get("topic", "") for i in (1, 2, 3)] == [
        "/cam01/image_raw/compressed", "/cam02/image_raw/compressed", "",
    ]  # fmt: skip


def test_links_in_a_circle_end(lab, capsys):
    recordings = lab / "recordings"
    for name, to in (("loop", "."), ("self", "self"), ("up", "..")):
        (recordings / name).symlink_to(to)
    for name, to in (("a", "b"), ("b", "a")):
        os.mkdir(recordings / name)
        (recordings / name / "other").symlink_to(f"../{to}")
    folder, said = made(lab, capsys)
    assert list(rows_of_text(folder)) == ["out_1", "out_2", "in_1"] and len(aside(said)) < 5


def test_a_link_to_a_hidden_file_is_a_recording(lab):
    """As git-annex keeps them."""
    store = lab / "recordings/.git/annex"
    store.mkdir(parents=True)
    shutil.move(lab / "recordings/out_1/pc1.bag", store / "SHA256-1.bag")
    (lab / "recordings/out_1/pc1.bag").symlink_to("../.git/annex/SHA256-1.bag")
    init.run(lab / "project", as_from=lab / "recordings")
    assert rows_of_text(lab / "project")["out_1"]["bags"] == "out_1/pc1.bag;out_1/pc2.bag"
