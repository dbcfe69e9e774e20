"""The three nudges of the long-range camera, each by what it does to the picture."""

import numpy as np
import pytest

from dior import tables
from dior.calibrate.align import aligned_pose, run
from dior.calibrate.place import look_at_pose
from dior.camera import project
from dior.errors import DiorError
from tests.rig import ring

TAPE = {"position_m": [3.0, 60.0, 1.5], "target_m": [0.0, 0.0, 1.0]}
BODY = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.9], [0.3, 0.0, 0.1]])


def pixels(nudge):
    camera = ring(1, distortion=())[0]
    return project(camera.at(aligned_pose("cam04.yaml", TAPE, nudge)), BODY)[0]


def test_without_nudges_it_is_the_look_at():
    np.testing.assert_allclose(aligned_pose("", TAPE, {}), look_at_pose("", TAPE), atol=1e-15)
    still = {"azimuth_deg": 0.0, "elevation_deg": 0.0, "distance_m": 0.0}
    np.testing.assert_allclose(aligned_pose("", TAPE, still), look_at_pose("", TAPE), atol=1e-15)


def test_positive_azimuth_moves_the_labels_right_by_f_tan():
    shift = pixels({"azimuth_deg": 0.5}) - pixels({})
    np.testing.assert_allclose(shift[0, 0], 640 * np.tan(np.radians(0.5)), rtol=1e-3)
    np.testing.assert_allclose(shift[:, 1], 0, atol=0.01)


def test_positive_elevation_moves_the_labels_down_by_f_tan():
    shift = pixels({"elevation_deg": 0.5}) - pixels({})
    np.testing.assert_allclose(shift[0], [0, 640 * 1.001 * np.tan(np.radians(0.5))], atol=1e-6)


def test_positive_distance_shrinks_the_labels():
    height = [np.ptp(pixels({"distance_m": d})[:2, 1]) for d in (0.0, 5.0, -5.0)]
    range_m = np.hypot(3, 60)
    np.testing.assert_allclose(height[1] / height[0], range_m / (range_m + 5), rtol=1e-3)
    np.testing.assert_allclose(height[2] / height[0], range_m / (range_m - 5), rtol=1e-3)


def test_the_centre_moves_horizontally_and_the_aim_stays():
    still, moved = (aligned_pose("", TAPE, {"distance_m": d}) for d in (0.0, 2.0))
    np.testing.assert_allclose(moved[:3, :3], still[:3, :3], atol=1e-15)
    shift = moved[:3, 3] - still[:3, 3]
    np.testing.assert_allclose(shift, 2 * np.array([3, 60, 0]) / np.hypot(3, 60), atol=1e-12)


def test_nudges_are_applied_together_as_in_the_design():
    from dior.geometry import look_at_angles, rotation_x, rotation_z

    azimuth, elevation = look_at_angles(TAPE["position_m"], TAPE["target_m"])
    wTc = aligned_pose("", TAPE, {"azimuth_deg": 1.0, "elevation_deg": -2.0, "distance_m": 3.0})
    expected = rotation_z(azimuth + np.radians(1)) @ rotation_x(elevation - np.radians(2))
    np.testing.assert_allclose(wTc[:3, :3], expected, atol=1e-15)


def test_impossible_moves_are_refused():
    with pytest.raises(DiorError, match="straight above"):
        aligned_pose("cam04.yaml", {"position_m": [0, 0, 10]}, {"distance_m": 1.0})
    with pytest.raises(DiorError, match="past its target"):
        aligned_pose("cam04.yaml", TAPE, {"distance_m": -70.0})


def test_run_writes_the_aligned_camera(tmp_path):
    lens = ring(1, role="long_range")[0]
    tables.write_cameras(tmp_path / "lens.parquet", [lens.at(np.full((4, 4), np.nan))], "field")
    yaml = tmp_path / "cam01.yaml"
    yaml.write_text(
        "role: long_range\ntopic: /cam01/image\nlocate: align\n"
        "tape: {position_m: [3, 60, 1.5], target_m: [0, 0, 1]}\nnudge: {azimuth_deg: 0.3, distance_m: 1.5}\n"
    )
    run(
        session="field", camera="cam01", camera_file=yaml, intrinsics=tmp_path / "lens.parquet",
        out=tmp_path / "out.parquet",
    )  # fmt: skip
    camera = tables.read_cameras(tmp_path / "out.parquet")["cam01"]
    expected = aligned_pose("", TAPE, {"azimuth_deg": 0.3, "distance_m": 1.5})
    np.testing.assert_allclose(camera.wTc, expected, atol=1e-15)
    assert (camera.role, camera.locate) == ("long_range", "align")
