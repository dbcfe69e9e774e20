"""What the pages know of a project, and that a full disk, a second studio and a taken port are said."""

import errno
import os
import socket

import numpy as np
import pytest

from dior.calibrate import intrinsics
from dior.errors import DiorError
from dior.geometry.camera_tables import unplaced
from dior.ingest import frames
from dior.studio import app, studio
from dior.studio.workspace import Workspace
from dior.tables import tables
from tests.project.test_project import edit


def test_tables_are_those_of_the_steps(project):
    """Of all cameras together, as a run makes them, and of each alone, as the pages do."""
    bags = [project / "data/out_1" / name for name in ("a.bag", "b.bag")]
    with Workspace() as workspace:
        topics = workspace.project().topics("out_1")
        frames.run(sequence="out_1", bags=bags, data_root=project / "data", topics=topics, out=project / "f.parquet")
        whole = tables.read(project / "f.parquet", "frames")
        for camera in topics:
            own = workspace.frames("out_1", camera)
            for name, column in tables.of_camera(whole, camera).items():
                assert np.array_equal(column, own[name], equal_nan=column.dtype.kind == "f"), name


def test_a_lens_is_that_of_the_step(project):
    with Workspace() as workspace:
        settings = workspace.project().cameras("field")["cam01"]
        lens = workspace.lens("field", "cam01")
        tables.write(project / "f.parquet", "frames", workspace.frames("out_1", "cam01"))
    intrinsics.run(
        session="field", camera="cam01", role="close", topic=settings["topic"], source="camera_info", board={},
        distortion_model=settings.get("distortion_model", ""), sigma=str(settings.get("intrinsics_sigma", "")),
        frames=project / "f.parquet", sequence="out_1", data_root=project / "data", out=project / "lens.parquet",
        findings=project / "lens.findings.parquet",
    )  # fmt: skip
    assert repr(unplaced(project / "lens.parquet", "cam01")) == repr(lens)


def test_markers_are_read_before_anything_is_run(project):
    with Workspace() as workspace:
        motion = workspace.motion("in_1")
        assert "LASI" in motion.joints and motion.xyz.shape[1] == len(motion.joints)
        assert workspace.motion("in_1") is motion
        with pytest.raises(DiorError, match="no motion capture"):
            workspace.motion("out_1")


def test_a_second_studio_knows_of_the_first(project):
    with Workspace() as first:
        assert not first.others
        with Workspace() as second:
            assert second.others
    with Workspace() as third:
        assert not third.others


def test_a_full_disk_is_said_and_nothing_is_lost(client, project, monkeypatch):
    path = project / "config/sessions/lab/cam01.yaml"
    path.write_text(path.read_text() + "distortion_model: TODO\n")
    before, line = path.read_text(), len(path.read_text().splitlines())

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "x")

    told = {"path": "config/sessions/lab/cam01.yaml", "line": line, "key": "distortion_model", "value": "plumb_bob"}
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        answer = client.post("/api/fill", json=told)
    assert answer.status_code == 422 and "room" in answer.json()["error"] and path.read_text() == before
    assert client.post("/api/fill", json=told).status_code == 200 and "plumb_bob" in path.read_text()


def test_what_is_answered_is_sent_at_once():
    """asyncio turns Nagle's algorithm off only for sockets that say TCP."""
    with studio._listening(0) as listening, socket.create_connection(listening.getsockname()):
        with listening.accept()[0] as accepted:
            assert accepted.proto == socket.IPPROTO_TCP


def test_a_port_that_is_taken_is_named_and_the_next_is_looked_for(monkeypatch):
    with socket.socket() as taken:
        taken.bind((studio.HOST, 0))
        taken.listen()
        number = taken.getsockname()[1]
        with pytest.raises(DiorError, match=f"port {number} cannot be used"):
            studio._listening(number)
        with pytest.raises(DiorError, match="port 99999 cannot be used"):
            studio._listening(99999)
        monkeypatch.setattr(studio, "PORT", number)
        with studio._listening(0) as found:
            assert found.getsockname()[1] > number


def test_a_folder_without_a_project_is_named(tmp_path):
    with pytest.raises(DiorError, match="there is no config/config.yaml in it"):
        studio.run(tmp_path)


def test_a_folder_that_is_a_link_is_looked_into(project):
    (project / "config/sessions/lab").rename(project / "elsewhere")
    (project / "config/sessions/lab").symlink_to(project / "elsewhere")
    with Workspace() as workspace:
        assert not workspace.read().faults
        (project / "elsewhere/cam01.yaml").write_text("role: [")
        assert "cam01.yaml" in str(workspace.read().faults[0])


def test_who_is_not_to_be_processed_any_more_is_shown_no_more(client, project):
    own = {"walk": "out_2", "camera": "cam01", "frame": 3, "u": 1, "v": 1}
    assert client.get("/picture", params=own).status_code == 200
    edit(project, "subjects.tsv", "no\tyes", "no\tno")
    paths = [route.path for route in app.ROUTES if "GET" in (route.methods or ()) and "long-range" not in route.path]
    for path in paths:
        answer = client.get(path, params=own)
        assert "out_2" not in answer.text.replace("walk is 'out_2', which the project does not have", ""), path
        # the report has a key of its own in its address
        fine = (404,) if path.startswith("/report/") else (200, 422)
        assert answer.status_code in fine and not answer.headers["content-type"].startswith("image"), path


@pytest.mark.parametrize("damage", [lambda text: text.replace(b",", b";"), lambda text: text + b"# K\xe4the\n"])
def test_a_file_that_cannot_be_read_is_named_where_its_walk_is_asked_for(client, project, damage):
    path = project / "config/sessions/lab/cam01.marks.csv"
    path.write_bytes(damage(path.read_bytes()))
    answer = client.get("/picture", params={"walk": "in_1", "camera": "cam01", "frame": 0})
    assert answer.status_code == 422 and "config/sessions/lab/cam01.marks.csv" in answer.json()["error"]
    assert client.get("/picture", params={"walk": "out_1", "camera": "cam01", "frame": 0}).status_code == 200


def test_of_what_is_large_the_last_are_kept(project, monkeypatch):
    monkeypatch.setattr("dior.studio.workspace.LAST", {"scene": 2})
    made = []
    with Workspace() as workspace:
        for name in "abacb":
            workspace._kept(("scene", name), 1, lambda name=name: made.append(name) or name)
            workspace._kept(("other", name), 1, lambda name=name: made.append(name.upper()) or name)
        assert "".join(made) == "aAbBcCb"
        assert [key[1] for key in workspace._made if key[0] == "scene"] == ["c", "b"]
        # what cannot be made is asked for again
        for _ in range(2):
            with pytest.raises(ZeroDivisionError):
                workspace._kept(("scene", "d"), 1, lambda: 1 / 0)
