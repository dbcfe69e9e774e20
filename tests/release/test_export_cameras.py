"""Cameras as other tools read them: the same when read back, by dior and by OpenCV."""

import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.cli import main
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import Intrinsics, inverse_pose, project
from dior.release import export_cameras
from tests.calibrate.readers import rigs
from tests.project.test_project import root  # noqa: F401
from tests.rig import ring

K1_TO_P2 = (-0.05, 0.12, 0.0005, -1e-05)
LENSES = {
    "four": ("plumb_bob", K1_TO_P2),
    "five": ("plumb_bob", (*K1_TO_P2, 0.01)),
    "eight": ("rational_polynomial", (*K1_TO_P2, 0.01, 0.3, -0.1, 0.02)),
    "inverse": ("inverse_brown_conrady", K1_TO_P2),
}
SAID = {"four": {"pose2sim", "kalibr", "opencv"}, "five": {"pose2sim", "opencv"}, "eight": {"opencv"}, "inverse": set()}


def rig(kind="four"):
    model, distortion = LENSES[kind]
    lens = Intrinsics(1280, 720, 900.25, 1e3 / 3, 640.5, 355.125, model, distortion)
    return [replace(camera, intrinsics=lens, name=name) for camera, name in zip(ring(3), "abc", strict=True)]


@pytest.fixture
def placed(root):  # noqa: F811
    """A project whose session `field` has been placed, its cameras with the lens of a kind."""

    def made(kind="four"):
        names = export_cameras.projects.load(root).cameras("field")
        cameras = [replace(camera, name=name) for camera, name in zip([*rig(kind), *rig(kind)], names, strict=False)]
        for camera in cameras:
            path = root / export_cameras.projects.load(root).final_cameras("field", camera.name)
            path.parent.mkdir(parents=True, exist_ok=True)
            several = [other for other in cameras if "adjust" in str(path) or other is camera]
            camera_tables.write_cameras(path, several, "field")
        return cameras

    return made


@pytest.mark.parametrize("kind", LENSES)
def test_each_format_says_a_lens_or_refuses_it_by_name(kind):
    found = {name: export_cameras.unspoken(name, rig(kind)) for name in export_cameras.COEFFICIENTS}
    assert {name for name, problem in found.items() if not problem} == SAID[kind]
    assert all(f"{name}: has no words for the lens of a, which " in text for name, text in found.items() if text)
    assert not export_cameras.unspoken("kalibr", [replace(c, intrinsics=plain(c)) for c in rig(kind)])


def plain(camera):
    return replace(camera.intrinsics, distortion=())


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in SAID.items() for name in sorted(names)])
def test_what_is_written_reads_back(tmp_path, kind, name):
    cameras = rig(kind)
    for path, text in export_cameras.texts(name, cameras, {"a": "/a's/image"}).items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)
    for i, camera in enumerate(cameras):
        file = {"pose2sim": "pose2sim.toml", "kalibr": "kalibr.yaml", "opencv": f"opencv/{camera.name}.yml"}[name]
        called = f"cam{i}" if name == "kalibr" else camera.name
        assert from_file(tmp_path / file, called) == camera.intrinsics
        if name == "kalibr":
            first = inverse_pose(cameras[0].wTc)
            rigs.same_pose(reference_pose(tmp_path / file, called, world="from_walk"), first @ camera.wTc)
        else:
            rigs.same_pose(reference_pose(tmp_path / file, called), camera.wTc)


@pytest.mark.parametrize("kind", ["five", "eight"])
def test_opencv_reads_it_and_projects_as_dior_does(tmp_path, kind):
    camera = rig(kind)[1]
    path = tmp_path / "b.yml"
    path.write_text(export_cameras.opencv(camera))
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    K, D, R, T = (file.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients", "R", "T"))
    assert file.getNode("image_width").real() == 1280 and file.getNode("units").string() == "m"
    points = np.random.default_rng(1).uniform([-1, -1, 0], [1, 1, 2], (20, 3))
    theirs = cv2.projectPoints(points, cv2.Rodrigues(R)[0], T, K, D)[0][:, 0]
    np.testing.assert_allclose(theirs, project(camera, points)[0], atol=1e-6)


def test_the_files_are_what_their_readers_elsewhere_expect():
    """TOML and YAML of anybody's; numbers stay numbers, a small one without a point would be a text."""
    cameras = rig()
    toml = tomllib.loads(export_cameras.pose2sim(cameras))
    assert list(toml) == ["a", "b", "c", "metadata"] and toml["a"]["distortions"] == list(K1_TO_P2)
    chain = yaml.safe_load(export_cameras.kalibr(cameras, {"a": "/a's/image"}))
    assert chain["cam0"]["rostopic"] == "/a's/image" and "T_cn_cnm1" not in chain["cam0"]
    assert chain["cam2"]["distortion_coeffs"] == list(K1_TO_P2)
    assert np.shape(chain["cam2"]["T_cn_cnm1"]) == (4, 4)
    numbers = [0.0, -1e-05, 1e22, 1 / 3, -2.5e-300, 640.0]
    assert yaml.safe_load(f"[{', '.join(map(export_cameras._number, numbers))}]") == numbers


def test_the_command_writes_a_new_folder(placed, root, tmp_path, capsys):  # noqa: F811
    cameras = placed()
    out = tmp_path / "out"
    words = ["export-cameras", str(root), "--session", "field", "--out", str(out)]
    assert main.main(words) == 0
    assert {path.relative_to(out).as_posix() for path in out.rglob("*.*")} == {
        "pose2sim.toml", "kalibr.yaml", *(f"opencv/{camera.name}.yml" for camera in cameras),
    }  # fmt: skip
    for camera in cameras:
        rigs.same_pose(reference_pose(out / "pose2sim.toml", camera.name), camera.wTc)
    assert "not written" not in capsys.readouterr().out
    assert main.main(words) == 1 and "is there already; name a folder that is not" in capsys.readouterr().err


def test_a_lens_without_words_is_left_out_and_said_or_refused_where_it_is_named(placed, root, tmp_path, capsys):  # noqa: F811
    placed("five")
    out = tmp_path / "out"
    words = ["export-cameras", str(root), "--session", "field", "--out", str(out)]
    assert main.main([*words, "--formats", "kalibr"]) == 1 and not out.exists()
    assert "kalibr: has no words for the lens of cam01, which has more than k1 k2 p1 p2" in capsys.readouterr().err
    assert main.main(words) == 0
    assert "not written: kalibr: has no words" in capsys.readouterr().out
    assert (out / "pose2sim.toml").is_file() and not (out / "kalibr.yaml").exists()
    placed("inverse")
    with pytest.raises(DiorError, match="opencv: has no words .* inverse_brown_conrady"):
        export_cameras.run(root, session="field", out=tmp_path / "none")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"session": "fields"}, r"no session 'fields' \(did you mean 'field'\?\)"),
        ({"formats": ["tom"]}, "there is no format 'tom'.*; there are pose2sim, kalibr, opencv"),
        ({}, r"results/.*\.parquet: is not there, so cam01 has no pose yet; run the workflow first"),
    ],
)
def test_what_is_refused(root, tmp_path, change, sentence):  # noqa: F811
    with pytest.raises(DiorError, match=sentence):
        export_cameras.run(root, **{"session": "field", "out": tmp_path / "out"} | change)


def test_a_project_that_is_none_is_named(tmp_path):
    with pytest.raises(DiorError, match="nope: there is no config/config.yaml in it"):
        export_cameras.run(tmp_path / "nope", session="field", out=tmp_path / "out")
