"""Placement by tape and look-at and from other people's calibrations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dior.calibrate import place
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import inverse_pose, project
from dior.geometry.tape import look_at_pose
from dior.project.camera_file import camera_settings
from dior.tables import tables
from tests.rig import ring

YAML = "role: close\ntopic: /cam01/image\ndistortion_model: plumb_bob\n"


def toml(folder, **entries):
    path = folder / "calibration.toml"
    path.write_text("\n".join(f"[{key}]\n{text}" for key, text in entries.items()))
    return path


@pytest.mark.parametrize("azimuth", np.radians(range(0, 360, 45)))
@pytest.mark.parametrize("target", [(0, 0, 0), (0.5, -1, 1.2)])
def test_the_target_is_at_the_principal_point_and_up_is_up(azimuth, target):
    centre = [6 * np.cos(azimuth), 6 * np.sin(azimuth), 1.5]
    wTc = look_at_pose("cam01.yaml", {"position_m": centre, "target_m": list(target)})
    camera = ring(1, distortion=())[0].at(wTc)
    uv, depth = project(camera, np.array([target, np.add(target, (0, 0, 0.5))]))
    lens = camera.intrinsics
    np.testing.assert_allclose(uv[0], (lens.cx, lens.cy), atol=1e-9)
    assert uv[1, 1] < uv[0, 1] and abs(uv[1, 0] - uv[0, 0]) < 1e-9 and depth[0] > 0
    np.testing.assert_allclose(wTc[:3, 3], centre)


def test_a_camera_at_its_target_or_below_the_floor_is_refused():
    with pytest.raises(DiorError, match="same point"):
        look_at_pose("cam01.yaml", {"position_m": [1, 2, 3], "target_m": [1, 2, 3]})
    with pytest.raises(DiorError, match="1.50 m below the floor"):
        look_at_pose("cam01.yaml", {"position_m": [1, 2, -1.5]})


def test_rodrigues_and_matrix_and_both_conventions_agree(tmp_path):
    wTc = ring(3)[1].wTc
    entries = {}
    for key, T in (("cTw", inverse_pose(wTc)), ("wTc", wTc)):
        entries[f"{key}_vector"] = (
            f"rotation = {Rotation.from_matrix(T[:3, :3]).as_rotvec().tolist()}\ntranslation = {T[:3, 3].tolist()}"
        )
        entries[f"{key}_matrix"] = f"rotation = {T[:3, :3].tolist()}\ntranslation = {T[:3, 3].tolist()}"
    path = toml(tmp_path, **entries)
    for name in entries:
        np.testing.assert_allclose(place.reference_pose(path, name, name[:3]), wTc, atol=1e-12)


def test_a_camera_is_found_by_key_last_key_and_name(tmp_path):
    path = tmp_path / "array.toml"
    path.write_text('[cameras.0]\nname = "left"\nrotation = [0, 0, 0]\ntranslation = [1, 2, 3]\n')
    for name in ("cameras.0", "0", "left"):
        np.testing.assert_allclose(place.reference_pose(path, name, "wTc")[:3, 3], [1, 2, 3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("translation = [1, 2, 3]", "`rotation` is missing"),
        ("rotation = [0, 0, 0]", "`translation` is missing"),
        ("rotation = [0, 0]\ntranslation = [1, 2, 3]", "`rotation` must be 3 or 3 x 3 numbers, and there is 2"),
        ("rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 2]]\ntranslation = [1, 2, 3]", "no rotation matrix"),
        ("rotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\ntranslation = [1, 2, 3]", "mirrors, so .* is left-handed"),
        ("rotation = [0, 0, nan]\ntranslation = [1, 2, 3]", "not finite"),
        ("rotation = [0, 0, 0]\ntranslation = [1, 2]", "3 numbers"),
        ("rotation = [0, 90, 45]\ntranslation = [1, 2, 3]", "vector of 101 rad, .*in degrees, multiply it by pi / 180"),
    ],
)
def test_broken_references_are_named(tmp_path, text, message):
    with pytest.raises(DiorError, match=message) as error:
        place.reference_pose(toml(tmp_path, cam_01=text), "cam_01")
    assert "calibration.toml [cam_01]" in str(error.value)


def test_an_unknown_reference_gives_the_nearest(tmp_path):
    path = toml(tmp_path, cam_01="rotation = [0, 0, 0]\ntranslation = [1, 2, 3]")
    with pytest.raises(DiorError, match="no camera 'cam01'.*did you mean 'cam_01'"):
        place.reference_pose(path, "cam01")
    with pytest.raises(DiorError, match="no such file"):
        place.reference_pose(tmp_path / "other.toml", "cam_01")


def test_the_reference_of_the_real_recording(shared):
    path = shared / "real_outdoor/reference/calibration.toml"
    centres = np.array([place.reference_pose(path, f"cam_0{i}")[:3, 3] for i in range(1, 5)])
    # cameras on all sides of the beam, at the height of a tripod
    assert ((centres[:, 2] > 1.5) & (centres[:, 2] < 2.5)).all()
    assert np.linalg.norm(centres[0] - centres[2]) > 5


def test_run_writes_the_placed_camera(tmp_path):
    lens = ring(1)[0]
    camera_tables.write_cameras(tmp_path / "lens.parquet", [lens.at(np.full((4, 4), np.nan))], "field")
    yaml = tmp_path / "cam01.yaml"
    yaml.write_text(YAML + "locate: tape\ntape: {position_m: [3, 1, 1.5], target_m: [0, 0, 1]}\n")
    place.run(
        session="field", camera="cam01", camera_file=yaml, tag={}, intrinsics=tmp_path / "lens.parquet",
        frames=None, data_root=tmp_path, out=tmp_path / "tape.parquet", out_marks=tmp_path / "marks.parquet",
        findings=tmp_path / "findings.parquet",
    )  # fmt: skip
    placed = camera_tables.read_cameras(tmp_path / "tape.parquet")["cam01"]
    np.testing.assert_allclose(placed.centre, [3, 1, 1.5])
    assert placed.locate == "tape" and placed.intrinsics == lens.intrinsics
    assert not len(tables.read(tmp_path / "marks.parquet", "marks")["joint"])

    wTc = ring(3)[1].wTc
    toml(tmp_path, left=f"rotation = {wTc[:3, :3].T.tolist()}\ntranslation = {inverse_pose(wTc)[:3, 3].tolist()}")
    yaml.write_text(YAML + "locate: reference\nreference: {file: calibration.toml, name: left}\n")
    place.run(
        session="field", camera="cam01", camera_file=yaml, tag={}, intrinsics=tmp_path / "lens.parquet",
        frames=None, data_root=tmp_path, out=tmp_path / "reference.parquet", out_marks=tmp_path / "marks.parquet",
        findings=tmp_path / "findings.parquet",
    )  # fmt: skip
    np.testing.assert_allclose(camera_tables.read_cameras(tmp_path / "reference.parquet")["cam01"].wTc, wTc, atol=1e-12)


def test_the_step_refuses_other_ways_of_locating(tmp_path):
    yaml = tmp_path / "cam01.yaml"
    yaml.write_text(YAML + "locate: marks\n")
    with pytest.raises(DiorError, match="`locate` is marks, this step is for tape or reference"):
        camera_settings(yaml, "tape|reference")
    yaml.write_text(YAML + "locate: tape\n")
    with pytest.raises(DiorError, match="needs the section `tape`"):
        camera_settings(yaml)
