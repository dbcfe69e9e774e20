"""Kalibr's camchain, written here by its wiki ("yaml formats"): Kalibr is in no package registry."""

import numpy as np
import pytest
import yaml

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.calibrate.readers import files
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose
from tests.calibrate.readers import rigs


def chain(folder, change=lambda cameras: None):
    """A camchain of the rig, with what Kalibr adds for an IMU; `change` edits it."""
    cTw = [inverse_pose(T) for T in rigs.poses()]
    fx, fy, cx, cy = rigs.K[0, 0], rigs.K[1, 1], rigs.K[0, 2], rigs.K[1, 2]
    cameras = {
        f"cam{i}": {
            "cam_overlaps": [j for j in range(3) if j != i],
            "camera_model": "pinhole",
            "distortion_coeffs": list(rigs.D[:4]),
            "distortion_model": "radtan",
            "intrinsics": [float(x) for x in (fx, fy, cx, cy)],
            "resolution": list(rigs.SIZE),
            "rostopic": f"/cam{i}/image_raw",
            "T_cam_imu": np.eye(4).tolist(),
        }
        for i in range(3)
    }
    for i in (1, 2):
        cameras[f"cam{i}"]["T_cn_cnm1"] = (cTw[i] @ inverse_pose(cTw[i - 1])).tolist()
    change(cameras)
    path = folder / "chain.yaml"
    path.write_text(yaml.safe_dump(cameras))
    return path


def test_a_chain_is_followed_from_camera_0(tmp_path):
    path = chain(tmp_path)
    for i, wTc in enumerate(rigs.relative()):
        rigs.same_pose(reference_pose(path, f"cam{i}", world="from_walk"), wTc)
        assert rigs.same_lens(path, f"cam{i}", rigs.D[:4]).model == "plumb_bob"


def test_the_first_camera_may_hang_on_something_itself(tmp_path):
    """mrcal-to-kalibr writes the first camera's own T_cn_cnm1."""
    cTw = inverse_pose(rigs.poses()[0])
    path = chain(tmp_path, lambda cameras: cameras["cam0"].update(T_cn_cnm1=cTw.tolist()))
    for i, wTc in enumerate(rigs.poses()):
        rigs.same_pose(reference_pose(path, f"cam{i}", world="from_walk"), wTc)


def test_its_world_is_no_floor_its_unit_and_convention_are_said(tmp_path):
    path = chain(tmp_path)
    with pytest.raises(DiorError, match=r"\[cam1\]: its world is that of camera cam0 .*`reference.world: from_walk`"):
        reference_pose(path, "cam1")
    with pytest.raises(DiorError, match=r"its unit is m by its format, and `reference.units` .* says mm; delete"):
        reference_pose(path, "cam1", units="mm", world="from_walk")
    with pytest.raises(DiorError, match="its convention is cTw by its format, and .* says wTc"):
        reference_pose(path, "cam1", convention="wTc", world="from_walk")
    rigs.same_pose(reference_pose(path, "cam1", "cTw", "m", "from_walk"), rigs.relative()[1])


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"distortion_model": "equi"}, r"the model equidistant \(fisheye\) is not understood"),
        ({"camera_model": "omni", "intrinsics": [0.8, 900, 900, 640, 360]}, "the model omni with radtan is not"),
        ({"camera_model": "ds"}, "the model ds with radtan is not"),
        ({"distortion_model": "fov", "distortion_coeffs": [0.9]}, "the model fov is not"),
    ],
)
def test_other_lenses_are_refused_by_name_and_their_poses_are_read(tmp_path, change, name):
    path = chain(tmp_path, lambda cameras: cameras["cam1"].update(change))
    with pytest.raises(DiorError, match=rf"chain\.yaml \[cam1\]: a lens of {name}"):
        from_file(path, "cam1", "plumb_bob")
    rigs.same_pose(reference_pose(path, "cam1", world="from_walk"), rigs.relative()[1])


def test_no_distortion_and_another_word_for_the_model(tmp_path):
    path = chain(tmp_path, lambda cameras: cameras["cam0"].update(distortion_model="none", distortion_coeffs=[]))
    assert from_file(path, "cam0").distortion == (0.0,) * 8
    with pytest.raises(DiorError, match="says that the lens is plumb_bob, and .* inverse_brown_conrady; delete"):
        from_file(path, "cam0", "inverse_brown_conrady")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda c: c["cam1"].pop("T_cn_cnm1"), r"\[cam1\]: `T_cn_cnm1` is missing"),
        (lambda c: c["cam1"].update(T_cn_cnm1=np.eye(3).tolist()), r"\[cam1\]: `T_cn_cnm1` must be 4 x 4"),
        (lambda c: c.pop("cam1"), r"\[cam2\]: the camera before it is cam0, and its `T_cn_cnm1` leads from cam1; put"),
        (lambda c: c["cam1"].update(T_cn_cnm1=np.transpose(c["cam1"]["T_cn_cnm1"]).tolist()), "it looks transposed"),
        (lambda c: c["cam1"].update(T_cn_cnm1=np.diag([1.0, 1, 1, 2]).tolist()), "must have the last row 0, 0, 0, 1"),
        (
            lambda c: c["cam1"].update(T_cn_cnm1=np.diag([2.0, 2, 2, 1]).tolist()),
            r"\[cam1\]: rotation is no rotation matrix",
        ),
        (lambda c: c["cam1"].update(T_cn_cnm1=np.diag([1.0, 1, -1, 1]).tolist()), "mirrors, so .* left-handed"),
        (lambda c: c.update(left=c.pop("cam1")), r"\[left\]: a camchain's cameras are called cam0"),
    ],
)
def test_a_chain_that_is_broken_says_where_it_is(tmp_path, change, sentence):
    """The cameras behind the break have no pose either."""
    path = chain(tmp_path, change)
    with pytest.raises(DiorError, match=sentence):
        reference_pose(path, "cam2", world="from_walk")


def test_a_chain_of_twelve_is_followed_by_number_and_not_by_letter(tmp_path):
    step = np.eye(4)
    step[0, 3] = -1.0
    one = {"camera_model": "pinhole", "intrinsics": [1, 1, 1, 1], "resolution": [4, 4], "T_cn_cnm1": step.tolist()}
    path = tmp_path / "chain.yaml"
    path.write_text(yaml.safe_dump({f"cam{i}": {**one} for i in range(12)}))
    assert [camera.name for camera in files.cameras(path)] == [f"cam{i}" for i in range(12)]
    assert reference_pose(path, "cam11", world="from_walk")[0, 3] == pytest.approx(12.0)
