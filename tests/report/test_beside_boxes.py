"""By how much labels lie beside the hand boxes, and the nudge that puts them right."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dior.calibrate.align import aligned_pose
from dior.geometry.camera import Camera, Intrinsics, project
from dior.report import beside_boxes
from dior.report.beside_boxes import Offset

LENS = Intrinsics(1280, 720, 760.0, 760.0, 640.0, 360.0)
TAPE = {"position_m": [0.0, 60.0, 2.0], "target_m": [0.0, 0.0, 1.0]}


def frames(u, v):
    stamps = np.arange(len(u))
    return {"box_offset_u": (stamps, np.array(u, float), stamps), "box_offset_v": (stamps, np.array(v, float), stamps)}


def far(nudge):
    return Camera("cam04", LENS, aligned_pose("cam04.yaml", TAPE, nudge), "long_range", "align")


@given(st.floats(-1.5, 1.5), st.floats(-0.5, 0.5))
def test_the_nudge_that_is_typed_puts_the_camera_right(azimuth, elevation):
    """The camera is truly where no nudge is; `typed` is what the tool says after a wrong one."""
    now = {"azimuth_deg": azimuth, "elevation_deg": elevation, "distance_m": 0.5}
    person = np.array([[0.0, 0.0, z] for z in (0.1, 0.9, 1.6)])
    off = (project(far(now), person)[0] - project(far({"distance_m": 0.5}), person)[0]).mean(axis=0)
    typed = beside_boxes.nudge(Offset(tuple(off), (1e-6, 1e-6), 20), far(now), now)
    left = project(far(typed), person)[0] - project(far({"distance_m": 0.5}), person)[0]
    assert np.abs(left).max() < 0.05 and typed["distance_m"] == 0.5


def test_what_is_not_certain_is_not_typed():
    now = {"azimuth_deg": 0.3}
    assert beside_boxes.nudge(Offset((1.0, 5.0), (0.5, 0.5), 20), far(now), now) == {
        "azimuth_deg": 0.3, "elevation_deg": pytest.approx(-0.377, abs=1e-3),
    }  # fmt: skip


def test_the_offset_has_the_drawers_habit_in_its_interval_and_not_the_crown():
    height = 25.0
    found = beside_boxes.of_recording(frames([7.0, 8.0, 9.0], [0.5, 0.5, 0.5]), height)
    assert found.uv == pytest.approx((8.0, 0.5 - beside_boxes.BELOW * height))
    assert found.sigma[0] == pytest.approx(np.hypot(1 / np.sqrt(3), beside_boxes.HABIT_PX))
    assert found.told == (True, False)
    assert beside_boxes.words(found) == "8.0 ± 1.2 px to the right"


def test_few_boxes_say_nothing():
    assert beside_boxes.of_recording(frames([7.0, 8.0], [0.0, 0.0]), 25.0) is None
    assert beside_boxes.of_recording({}, 25.0) is None
    assert beside_boxes.together([]) is None


def test_boxes_that_were_left_out_of_the_fit_are_told_in_pixels():
    by_metric = frames([9.0] * 4, [9.0] * 4)
    for key in ("left_out_offset_u", "left_out_offset_v"):
        by_metric[key] = (np.arange(4), np.full(4, 0.1), np.arange(4))
    assert beside_boxes.of_recording(by_metric, 30.0).uv == pytest.approx((3.0, 3.0 - 0.6))


def test_a_turned_camera_is_off_alike_and_a_wrong_clock_is_not():
    turned = [Offset((7.6, 0.1), (0.3, 0.3), 20), Offset((7.4, 0.4), (0.3, 0.3), 20)]
    late = [Offset((4.0, 0.1), (0.3, 0.3), 20), Offset((-4.2, 0.4), (0.3, 0.3), 20)]
    assert beside_boxes.alike(turned) and not beside_boxes.alike(late)
