"""What OpenCV's FileStorage writes, written by it, under the names of its samples."""

import json

import cv2
import numpy as np
import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose
from tests.calibrate.readers import rigs

ENDINGS = ("yml", "xml", "json")


def storage(path, **entries):
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in entries.items():
        file.write(key, value)
    file.release()
    return path


def of_sample(path, **more):
    """As samples/cpp/calibration.cpp writes it."""
    return storage(
        path,
        calibration_time="Mon Nov 30 00:00:00 2026", nframes=12, image_width=rigs.SIZE[0], image_height=rigs.SIZE[1],
        board_width=9, square_size=0.025, flags=0, camera_matrix=rigs.K, distortion_coefficients=np.array([rigs.D]),
        avg_reprojection_error=0.2, image_points=np.ones((2, 5, 2), np.float32), **more,
    )  # fmt: skip


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_lens_of_the_calibration_sample(tmp_path, ending):
    path = of_sample(tmp_path / f"left.{ending}")
    assert rigs.same_lens(path, "left").model == "plumb_bob"
    with pytest.raises(DiorError, match=r"\[left\]: the file has no pose"):
        reference_pose(path, "left")


def test_a_file_of_opencv_4(tmp_path):
    """Which writes a directive that no other YAML reader takes."""
    path = of_sample(tmp_path / "left.yml")
    text = path.read_text()
    assert text.startswith("%YAML")
    path.write_text("%YAML:1.0\n" + text.split("\n", 1)[1])
    rigs.same_lens(path, "left")


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_pose_beside_a_camera_leads_from_the_world_and_its_unit_is_asked_for(tmp_path, ending):
    wTc = rigs.poses()[1]
    cTw = inverse_pose(wTc)
    for turn, shift in ((cTw[:3, :3], cTw[:3, 3:]), (cv2.Rodrigues(cTw[:3, :3])[0], cTw[:3, 3])):
        path = of_sample(tmp_path / f"left.{ending}", R=turn, T=1000 * shift)
        with pytest.raises(DiorError, match=r"the file does not say its unit; add `reference.units` \(m, cm, mm\)"):
            reference_pose(path, "left")
        rigs.same_pose(reference_pose(path, "left", units="mm"), wTc)
    with pytest.raises(DiorError, match="its convention is cTw by its format"):
        reference_pose(path, "left", convention="wTc", units="mm")


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_pair_of_the_stereo_sample(tmp_path, ending):
    """The pose of the second camera in the first one's world, in the unit of the board; no size is in the file."""
    lens = {"M1": rigs.K, "D1": np.array([rigs.D]), "M2": rigs.K, "D2": np.zeros((1, 14))}
    intrinsics = storage(tmp_path / f"intrinsics.{ending}", **lens)
    with pytest.raises(DiorError, match=r"\[2\]: the file does not say the size .*add `image_width`"):
        from_file(intrinsics, "2")
    first, second = rigs.relative()[:2]
    cTw = inverse_pose(second)
    extrinsics = storage(tmp_path / f"extrinsics.{ending}", R=cTw[:3, :3], T=cTw[:3, 3:] / 0.025, P1=np.eye(3, 4))
    for name, wTc in (("1", first), ("2", second)):
        with pytest.raises(DiorError, match="its world is that of the first camera of the pair"):
            reference_pose(extrinsics, name, units="m")
        found = reference_pose(extrinsics, name, units="m", world="from_walk")
        found[:3, 3] *= 0.025
        rigs.same_pose(found, wTc)
    in_mm = storage(tmp_path / f"mm.{ending}", R=cTw[:3, :3], T=1000 * cTw[:3, 3:], units="mm")
    rigs.same_pose(reference_pose(in_mm, "2", world="from_walk"), second)
    with pytest.raises(DiorError, match="its unit is mm by its format, and `reference.units`"):
        reference_pose(in_mm, "2", units="m", world="from_walk")
    with pytest.raises(DiorError, match="`M1` is missing"):
        from_file(extrinsics, "1")
    sized = storage(tmp_path / f"sized.{ending}", **lens, image_width=1280, image_height=720)
    rigs.same_lens(sized, "1")
    assert from_file(sized, "2").distortion == (0.0,) * 8


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"fisheye_model": 1, "distortion_coefficients": np.zeros((4, 1))},
            r"the model equidistant \(fisheye\)",
        ),
        ({"distortion_coefficients": np.full((1, 12), 0.1)}, "the model thin prism is not understood"),
        ({"distortion_coefficients": np.full((1, 14), 0.1)}, "the model tilted sensor is not understood"),
        ({"distortion_coefficients": np.zeros((1, 3))}, "must be 4, 5, 8, 12 or 14 numbers, and there is 3"),
        ({"camera_matrix": np.eye(2)}, "`camera_matrix` must be 3 x 3"),
        ({"camera_matrix": np.diag([900.0, -900.0, 1.0])}, "focal lengths .* must be positive"),
        ({"camera_matrix": np.full((3, 3), np.nan)}, "not finite|numbers"),
        ({"image_width": 0}, "pictures of 0 x 720 px cannot be"),
    ],
)
@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_refused(tmp_path, ending, change, sentence):
    entries = {"image_width": 1280, "image_height": 720, "camera_matrix": rigs.K} | {
        "distortion_coefficients": np.array([rigs.D])
    }
    path = storage(tmp_path / f"left.{ending}", **(entries | change))
    with pytest.raises(DiorError, match=sentence) as caught:
        from_file(path, "left")
    assert str(path) in str(caught.value)


def test_eight_coefficients_are_rational(tmp_path):
    eight = np.array([[0.1, -0.2, 0.001, 0.002, 0.05, 0.3, -0.1, 0.02]])
    path = storage(
        tmp_path / "a.xml", camera_matrix=rigs.K, distortion_coefficients=eight, image_width=1280, image_height=720
    )
    assert rigs.same_lens(path, "a", eight[0]).model == "rational_polynomial"


def test_matrices_as_lists_of_rows(tmp_path):
    """As json.dump of Python writes arrays that tolist() made."""
    wTc = rigs.poses()[1]
    cTw = inverse_pose(wTc)
    content = {"image_width": 1280, "image_height": 720, "camera_matrix": rigs.K.tolist()}
    content |= {"distortion_coefficients": [list(rigs.D)], "R": cTw[:3, :3].tolist(), "T": cTw[:3, 3].tolist()}
    path = tmp_path / "cam01.json"
    path.write_text(json.dumps(content))
    rigs.same_lens(path, "cam01")
    rigs.same_pose(reference_pose(path, "cam01", units="m"), wTc)
    path.write_text(json.dumps(content | {"distortion_coefficients": []}))
    rigs.same_lens(path, "cam01", distortion=np.zeros(8))
    path.write_text(json.dumps(content))
    for key, value in (("camera_matrix", rigs.K.ravel().tolist()), ("R", [[1, 0], [0, 1]]), ("T", [1, 2])):
        path.write_text(json.dumps(content | {key: value}))
        with pytest.raises(DiorError, match=rf"cam01\.json .*`{key}`"):
            from_file(path, "cam01") if key == "camera_matrix" else reference_pose(path, "cam01", units="m")
