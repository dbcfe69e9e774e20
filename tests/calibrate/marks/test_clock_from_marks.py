"""Pose and clocks from marks alone: exact without noise, honest with it, and silent where the marks cannot tell."""

import numpy as np
import pytest

from benchmarks import clocks_marks
from dior.calibrate import locate
from dior.calibrate.marks import clock_from_marks
from dior.calibrate.marks.marks import Marks, Motion
from dior.clocks.clock import DRIFT_SD_PPM
from dior.errors import DiorError
from dior.geometry.camera import pose, project
from dior.geometry.covariance import moved
from dior.geometry.multiview import rotation_z
from tests.cases import some
from tests.rig import ring

T0, FPS = 1_708_000_000_000_000_000, 30
NAMES = [f"M{i:02d}" for i in range(16)]
SPEED, STRIDE_HZ = 1.2, 1.0
VIEW = ring(1)[0]


def walker(t, turning=True, still=False):
    """Markers (T, 16, 3) m: a body that walks in a spiral or straight, half of them on swinging limbs.

    In a spiral, since one part of a circle is like the other.
    """
    rng = np.random.default_rng(7)
    at = rng.uniform((-0.2, -0.3, 0.1), (0.2, 0.3, 1.8), (16, 3))
    swing = np.where(np.arange(16) % 2, 0.3, 0.0) * np.where(np.arange(16) % 4 > 1, 1, -1)
    t = np.zeros_like(t) if still else np.asarray(t, float)
    along = at[:, 0] + swing * np.sin(2 * np.pi * STRIDE_HZ * t)[:, None]
    up = at[:, 2] + np.abs(swing) * 0.2 * (1 + np.cos(2 * np.pi * STRIDE_HZ * t))[:, None]
    angle = 0.25 * t**2 * turning
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    side = np.broadcast_to(at[:, 1], along.shape)
    middle = np.stack([SPEED * np.sin(t), 0.7 * t - 1.4] if turning else [SPEED * (t - 2.0), 0.0 * t], axis=-1)
    x, y = along * cos - side * sin, along * sin + side * cos
    return np.stack([x + middle[:, :1], y + middle[:, 1:], up], axis=-1)


def motion(**how):
    t = np.arange(500) / 100
    return Motion(t, T0, walker(t, **how), NAMES)


def marked(frames, offset_s, sequence="walk_1", noise_px=0.0, seed=0, drift_ppm=0.0, **how):
    """Marks of all markers on some frames of a sequence, whose stamps are `frame / FPS` after T0."""
    t = np.asarray(frames) / FPS
    uv = project(VIEW, walker(t * (1 + 1e-6 * drift_ppm) + offset_s, **how))[0]
    uv = uv + noise_px * np.random.default_rng(seed).standard_normal(uv.shape)
    count = uv.shape[0] * 16
    return Marks(
        np.full(count, sequence, object), np.repeat(frames, 16), np.tile(np.array(NAMES, object), len(frames)),
        np.arange(2, 2 + count), uv.reshape(-1, 2), np.full((count, 3), np.nan),
    )  # fmt: skip


def both(a, b):
    line = np.arange(2, 2 + len(a) + len(b))
    parts = {name: np.concatenate([getattr(a, name), getattr(b, name)]) for name in Marks.__dataclass_fields__}
    return Marks(**(parts | {"line": line}))


def solve(marks, manual=None, **how):
    sequences = set(marks.sequence)
    stamps = {name: (np.arange(200), T0 + np.round(np.arange(200) / FPS * 1e9).astype(int)) for name in sequences}
    clock = {name: (0.0, 0.0, "assumed_zero") for name in sequences} | (manual or {})
    motions = dict.fromkeys(sequences, motion(**how))
    return locate.with_clocks(VIEW, marks, "cam01.marks.csv", motions, stamps, clock, 8.0, "lab/cam01")


def codes(solved):
    return [code for _, _, code, _ in solved.findings]


@pytest.mark.parametrize("offset_s", some([-0.613, 0.0, 0.4137, 1.05], -0.613, 0.4137))
def test_exact_marks_give_pose_and_clock(offset_s):
    first = max(0, int(-offset_s * FPS) + 1)
    solved = solve(marked([first + 3, first + 40, first + 77], offset_s))
    found = solved.clocks["walk_1"]
    # the markers are on lines between ticks that are 10 ms apart
    assert found.offset_s == pytest.approx(offset_s, abs=2e-4)
    assert (found.source, found.method, found.drift_ppm) == ("estimated", "marks", 0.0)
    np.testing.assert_allclose(solved.located.wTc, VIEW.wTc, atol=2e-3)
    assert codes(solved) == ["clock_from_marks"] and solved.clock["walk_1"][2] == "estimated"


@pytest.mark.parametrize("roll_deg", some(range(0, 360, 30), 60, 270))
def test_every_roll_gives_pose_and_clock(roll_deg, monkeypatch):
    turned = VIEW.at(VIEW.wTc @ pose(rotation_z(np.radians(roll_deg)), np.zeros(3)))
    monkeypatch.setattr("tests.calibrate.marks.test_clock_from_marks.VIEW", turned)
    solved = solve(marked([3, 40, 77], 0.31, noise_px=0.5))
    assert solved.clocks["walk_1"].offset_s == pytest.approx(0.31, abs=0.005)
    np.testing.assert_allclose(solved.located.wTc, turned.wTc, atol=0.03)
    assert codes(solved) == ["clock_from_marks"]


def test_marks_that_put_the_camera_below_the_floor_say_so():
    marks = marked([3, 40, 77], 0.31)
    sunk = Motion(motion().t, T0, motion().xyz - (0, 0, 10.0), NAMES)
    at = clock_from_marks.places(marks, np.repeat([0.1, 4 / 3, 77 / 30], 16), {"walk_1": sunk}, {})
    found = clock_from_marks.search(VIEW, at, marks.uv, marks.frame, 8.0, "cam01")
    assert "the camera is below the floor" in found.why[0] and "floor at 0?" in found.why[0]


def test_wrong_marks_do_not_move_the_clock():
    marks = marked([3, 40, 77], 0.31, noise_px=0.5)
    wrong = np.random.default_rng(1).choice(48, 9, replace=False)
    marks.uv[wrong] += np.random.default_rng(2).choice([-1, 1], (9, 2)) * (40, 60)
    solved = solve(marks)
    assert solved.clocks["walk_1"].offset_s == pytest.approx(0.31, abs=0.01)
    assert set(np.flatnonzero(~solved.located.inlier)) == set(wrong)


def test_two_sequences_have_a_clock_each_and_one_frame_does_where_the_pose_is_known():
    solved = solve(both(marked([20], -0.42, "walk_0"), marked([3, 40, 77], 0.31)))
    assert solved.clocks["walk_0"].offset_s == pytest.approx(-0.42, abs=5e-4)
    assert solved.clocks["walk_1"].offset_s == pytest.approx(0.31, abs=5e-4)


def test_a_value_given_by_hand_stays():
    marks = both(marked([3, 40, 77], 0.31), marked([10, 60], -0.1, "walk_2"))
    solved = solve(marks, {"walk_1": (0.32, 5.0, "manual")})
    assert solved.clocks["walk_1"].offset_s == 0.32 and solved.clocks["walk_1"].source == "manual"
    assert np.isnan(solved.clocks["walk_1"].given).all() and not solved.clocks["walk_1"].gains
    assert solved.clocks["walk_2"].source == "estimated"


def test_one_frame_is_taken_at_zero_and_says_so():
    solved = solve(marked([20], 0.0))
    assert solved.clocks["walk_1"].source == "assumed_zero" and solved.clocks["walk_1"].offset_s == 0.0
    np.testing.assert_allclose(solved.located.wTc, VIEW.wTc, atol=2e-3)
    (_, severity, code, text), *_ = solved.findings
    assert (severity, code) == ("warning", "clock_assumed_zero")
    assert "all its marks are on one frame" in text and "mark 3 frames or more" in text and "walk_1.yaml" in text


def test_who_stands_still_tells_no_time():
    solved = solve(marked([3, 40, 77], 0.31, noise_px=0.5, still=True), still=True)
    assert solved.clocks["walk_1"].source == "assumed_zero" and "fit as well" in solved.findings[0][3]


def test_one_stride_like_the_other_is_refused():
    """A straight walk at constant speed is the same a stride later, for a camera that stands a stride further on."""
    with pytest.raises(DiorError, match=r"walk_1: offsets of .*0\.3[01] s.* fit the marks equally well"):
        solve(marked([43, 60, 77], 0.31, noise_px=0.5, turning=False), turning=False)


def test_marks_without_a_clock_do_not_move_a_camera_that_has_others():
    fixed = marked([3, 40, 77], 0.31)
    fixed.xyz[:] = walker(np.array([3, 40, 77]) / FPS + 0.31).reshape(-1, 3)
    few = marked([20], 0.7, "walk_2").only(np.arange(16) < 3)
    solved = solve(both(fixed, few))
    np.testing.assert_allclose(solved.located.wTc, VIEW.wTc, atol=1e-5)
    assert len(solved.used) == 48 and solved.clocks["walk_2"].source == "assumed_zero"
    assert "walk_1" not in solved.clocks and "its marks are not used" in solved.findings[0][3]


@pytest.mark.slow
def test_intervals_are_those_of_many_trials():
    ratio, shift = [], []
    for seed in range(12):
        solved = solve(marked([3, 40, 77], 0.31, noise_px=1.0, seed=seed))
        found = solved.clocks["walk_1"]
        ratio.append((found.offset_s - 0.31) / found.sigma(["cam01"], solved.covariance[:6, :6])[0])
        shift.append(
            np.linalg.norm(solved.located.wTc[:3, 3] - VIEW.centre) ** 2 / np.trace(solved.covariance[3:6, 3:6])
        )
    assert 0.6 < np.sqrt(np.mean(np.square(ratio))) < 1.4
    assert 0.4 < np.mean(shift) < 1.8


def test_a_drift_does_not_move_the_time_in_the_middle():
    """600 ppm over 2.5 s are 1.5 ms; the marks are exact but for the lines between ticks."""
    solved = solve(marked([3, 20, 40, 60, 77], 0.31, drift_ppm=600.0))
    found = solved.clocks["walk_1"]
    true = found.middle_s * (1 + 600e-6) + 0.31
    assert 3 / FPS < found.middle_s < 77 / FPS
    assert found.offset_s + found.middle_s == pytest.approx(true, abs=1e-4)
    assert found.sigma(["cam01"], solved.covariance[:6, :6])[1] == pytest.approx(DRIFT_SD_PPM)


def test_what_the_camera_owes_to_the_clock():
    """With the pose known the time is known better, and both parts make up the whole."""
    solved = solve(marked([3, 40, 77], 0.31, noise_px=1.0))
    found = solved.clocks["walk_1"]
    whole = found.sigma(["cam01"], solved.covariance[:6, :6])[0]
    assert 0 < found.given[0] < whole
    gain = found.gains["cam01"]
    part = np.sqrt(gain[0] @ solved.covariance[:6, :6] @ gain[0])
    assert np.hypot(found.given[0], part) == pytest.approx(whole)
    # a camera that is turned by hand to the left wants other times; sign and size from a fit with that pose
    step = np.linalg.cholesky(solved.covariance[:6, :6])[:, 0]
    marks = marked([3, 40, 77], 0.31, noise_px=1.0)
    at = clock_from_marks.places(marks, np.repeat(np.array([3, 40, 77]) / FPS, 16), {"walk_1": motion()}, {})
    turned = moved(VIEW.at(solved.located.wTc), step)
    J = clock_from_marks.jacobian(turned, at, np.array([found.offset_s]))[:, 6]
    miss = (project(turned, at.at(np.array([found.offset_s]))[0])[0] - marks.uv).ravel()
    assert -(J @ miss) / (J @ J) == pytest.approx(gain[0] @ step, rel=0.2, abs=2e-4)


def test_the_stamps_of_frames_are_uncertain(monkeypatch):
    """Frames taken 5 ms (1 sigma) before or after their stamps: what refining makes of them, and what is stated."""
    frames, rng, found = [3, 40, 77], np.random.default_rng(3), []
    for _ in range(60):
        t = np.array(frames) / FPS
        uv = project(VIEW, walker(t + 0.31 + 0.005 * rng.standard_normal(3)))[0].reshape(-1, 2)
        at = clock_from_marks.places(marked(frames, 0.31), np.repeat(t, 16), {"walk_1": motion()}, {})
        found.append(clock_from_marks.refine(VIEW, at, uv, np.array([0.31]))[1][0])
    J, part = clock_from_marks.jacobian(VIEW, at, np.array([0.31])), []
    for sd in (0.0, 0.005):
        monkeypatch.setattr(clock_from_marks, "STAMP_SD_S", sd)
        right = np.zeros((96, 3))
        full, *_ = clock_from_marks.uncertainty(J, at.t, np.zeros((48, 2)), np.arange(48), np.repeat(frames, 16), right)
        part.append(full[6, 6])
    assert np.std(found) == pytest.approx(np.sqrt(part[1] - part[0]), rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(("level", "seed", "roll_deg"), [("ideal", 1, 180.0), ("real", 2, 90.0)])
def test_cameras_that_hang_turned_have_clocks(level, seed, roll_deg):
    """Four cameras, located in four ways; `python -m benchmarks.rolls` has 20 seeds a level."""
    error, sigma = np.array([row[4:] for row in clocks_marks.errors(seed, level, roll_deg=roll_deg)]).T
    assert np.isfinite(error).all() and np.sqrt(np.mean((error / sigma) ** 2)) < 1.6
    assert np.median(np.abs(error)) < 0.002
