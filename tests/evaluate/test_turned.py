"""A camera whose detections lie aside of those of the others is off."""

import numpy as np
import pytest

from benchmarks.turned import of_real
from dior.evaluate import turned
from dior.tables import tables


def aside(u=0.0, v=0.03):
    """Detections beside the joints of the motion capture, m, by joint, as a detector's are in all cameras; px per m."""
    return {f"joint_{i}": np.array([u + 0.01 * (-1) ** i, v]) for i in range(12)}, 130.0


def test_a_camera_whose_detections_lie_aside_of_the_others_is_named_with_the_side_of_its_labels():
    three = {"cam01": aside(), "cam02": aside(0.026), "cam03": aside(0.002)}
    [(scope, severity, code, text)] = turned.turned("walk", three)
    assert (scope, severity, code) == ("walk/cam02", "info", "camera_turned")
    assert "its labels lie 3.2 px left of what is detected, 0.025 m at the person" in text
    [(scope, severity, *_, text)] = turned.turned("walk", three | {"cam02": aside(0.08)})
    assert (scope, severity) == ("walk/cam02", "warning") and text.startswith("the pose of cam02 is off: ")
    [(scope, *_, text)] = turned.turned("walk", three | {"cam02": aside(0.0, 0.0)})
    assert scope == "walk/cam02" and "3.9 px below" in text


def test_joints_that_a_detector_has_elsewhere_in_all_cameras_turn_none():
    assert turned.turned("walk", {name: aside(0.0, 0.06) for name in ("cam01", "cam02", "cam03")}) == []
    # and with one other camera nobody knows which of them it is
    assert turned.turned("walk", {"cam01": aside(), "cam02": aside(0.1)}) == []


def test_tables_of_one_camera_each_are_those_of_all(tmp_path):
    three = {"cam01": aside(), "cam02": aside(0.026), "cam03": aside(0.002)}
    for name, (own, px_per_m) in three.items():
        by = np.array([*own.values()])
        columns = {"sequence": ["walk"] * len(by), "camera": [name] * len(by), "joint": [*own]}
        columns |= {"right_m": by[:, 0], "down_m": by[:, 1], "px_per_m": [px_per_m] * len(by)}
        tables.write(tmp_path / f"{name}.parquet", "detection_offsets", columns)
    read = turned.read(sorted(tmp_path.iterdir()))
    assert turned.turned("walk", read) == turned.turned("walk", three) != []


@pytest.mark.parametrize("tool", ["OpenPose", "ML Kit"])
def test_of_a_real_detector_and_right_poses_no_camera_is_said_to_be_off(shared, tool):
    found = turned.turned("walk", of_real(tool, shared / "real_outdoor"))
    assert [severity for _, severity, *_ in found] in ([], ["info"])
