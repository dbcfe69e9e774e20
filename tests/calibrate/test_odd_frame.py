"""Marks of a frame that are wrong as a whole: which frame it is, what is said and what the camera is then."""

import numpy as np
import pytest

from dior.calibrate import clocks
from dior.calibrate.marks import odd_frame
from dior.calibrate.marks.clock_from_marks import Places
from dior.calibrate.marks.marks import Motion
from dior.clocks.clock import Clock
from dior.geometry import camera_tables
from dior.geometry.camera import project
from tests.calibrate.test_locate import assert_at, located, session
from tests.rig import ring

PERIOD_S = 1 / 30


def shift(folder, frame, by):
    """Shift all marks of a frame by (u, v) px."""
    path = folder / "cam01.marks.csv"
    head, *lines = path.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    for row in rows:
        if row[1] == str(frame):
            row[3:] = [f"{float(value) + step:.4f}" for value, step in zip(row[3:], by, strict=True)]
    path.write_text("\n".join([head, *map(",".join, rows)]) + "\n")


@pytest.mark.parametrize("frame", [0, 4, 8])
@pytest.mark.parametrize("by", [(15, 9), (-7, 4)])
def test_a_frame_that_was_scrolled_is_left_out_and_named(tmp_path, frame, by):
    view = session(tmp_path, frames=(0, 4, 8))
    shift(tmp_path, frame, by)
    found, marks, findings = located(tmp_path)
    assert_at(found.wTc, view.wTc, 1e-4)
    assert marks["inlier"].all() and frame not in marks["frame"] and len(marks["frame"]) == 20
    assert findings["code"].tolist() == ["frame_rejected", "pose_from_marks"]
    line = {0: "2-11", 4: "12-21", 8: "22-31"}[frame]
    sides = (15, "right", 9, "below") if by == (15, 9) else (7, "left", 4, "below")
    assert f"the 10 marks of frame {frame} of indoor_01" in findings["text"][0]
    assert f"lines {line}) lie {sides[0]} px {sides[1]} of and {sides[2]} px {sides[3]}" in findings["text"][0]


def test_of_two_frames_it_cannot_be_told_and_the_camera_is_uncertain(tmp_path):
    view = session(tmp_path, frames=(0, 8))
    shift(tmp_path, 8, (15, 9))
    found, _, findings = located(tmp_path)
    assert findings["code"][0] == "frame_suspect" and "cannot be told which" in findings["text"][0]
    assert "frame 0 of indoor_01" in findings["text"][0] and "frame 8 of indoor_01" in findings["text"][0]
    spread = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam01"])[3:6, 3:6]
    off = found.centre - view.centre
    assert off @ np.linalg.solve(spread, off) < 9


def body(late_s=0.0):
    """A camera, `Places` of ten markers that move on their own on three frames, their pixels, and the frames; the
    second frame says that it is `late_s` later than it is."""
    view, random = ring(1)[0], np.random.default_rng(3)
    start = random.uniform((-0.5, -0.5, 0.1), (0.5, 0.5, 1.7), (10, 3))
    speed = random.uniform(-2, 2, (10, 3))
    t = np.arange(200) / 100
    motion = Motion(t, 0, start + t[:, None, None] * speed, [f"M{i}" for i in range(10)])
    frames, joint = np.repeat(np.arange(3), 10), np.tile(np.arange(10), 3)
    at = np.array([0.5, 0.9, 1.3])[frames]
    uv = project(view, start[joint] + at[:, None] * speed[joint])[0]
    said = at + late_s * (frames == 1)
    places = Places(np.full((30, 3), np.nan), np.zeros(30, int), said, joint, (motion,), ("walk",))
    return view, places, uv, frames


def test_a_wrong_number_of_a_frame_is_told_by_its_time():
    view, at, uv, frames = body(late_s=3 * PERIOD_S)
    (fault,) = odd_frame.faults(view, at, uv, np.zeros(1), frames, 8.0, PERIOD_S)
    assert fault.own.tolist() == (frames == 1).tolist()
    assert fault.late_s == pytest.approx(-0.1, abs=1e-6) and not fault.shift_px.any()
    assert_at(fault.camera.wTc, view.wTc, 1e-6)


def test_a_scaled_picture_is_told():
    view, at, uv, frames = body()
    grown = np.where((frames == 2)[:, None], 1.03 * uv, uv)
    (fault,) = odd_frame.faults(view, at, grown, np.zeros(1), frames, 8.0, PERIOD_S)
    assert fault.own.tolist() == (frames == 2).tolist()
    np.testing.assert_allclose(fault.shift_px, 0.03 * uv[frames == 2].mean(axis=0), atol=1e-4)
    assert 1 / (1 - fault.growth) == pytest.approx(1.03, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_frames_with_clicks_of_a_pixel_agree(seed):
    view, at, uv, frames = body()
    clicked = uv + np.random.default_rng(seed).normal(0, 1.0, uv.shape)
    assert not odd_frame.faults(view, at, clicked, np.zeros(1), frames, 8.0, PERIOD_S)


@pytest.mark.parametrize(
    ("apart_s", "asked"),
    [
        (0.0, ""),
        (0.012, ""),
        (-PERIOD_S, "count from 1? The first"),
        (PERIOD_S, "first_frame"),
        (-0.2, "these pictures"),
    ],
)
def test_the_clock_by_marks_is_compared_with_that_by_detections(apart_s, asked):
    marks = Clock(0.5 + apart_s, 0.0, "estimated", "marks", 10.0, (0.003, 5.0))
    seen = Clock(0.499, 100.0, "estimated", "detections", 8.0, (0.0006, 5.0))
    none = np.zeros(0)
    said = clocks.beside_marks("walk", {"cam03": (seen, none, none, "")}, {"cam03": marks}, ["cam03"], None, PERIOD_S)
    assert [code for _, _, code, _ in said] == (["marks_clock"] if asked else [])
    assert not asked or (said[0][:2] == ("walk/cam03", "warning") and asked in said[0][3])
