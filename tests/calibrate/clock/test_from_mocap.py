from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.calibrate.clock import from_mocap
from dior.clocks.clock import Clock
from dior.geometry.camera import project
from dior.simulate import settings
from dior.simulate.motion import motion_of
from tests.cases import some
from tests.rig import camera

CAMERA = camera("cam01", (4.5, 0.6, 1.5), target=(0, 0, 1))


@pytest.fixture(scope="module")
def walk():
    made = settings.from_dict({"subjects": 1, "duration_s": 12.0, "clocks": {"apart_s": 1.5}})
    motion = motion_of(made, settings.sequences(made)[0])
    ticks = np.arange(1600) / 100
    walker = from_mocap.walker_of(ticks, motion.at(ticks)[1], list(motion.names), list(MLKIT_33))
    return motion, walker


def seen(motion, walker, elapsed, offset_s, drift_ppm=0.0, noise_px=2.0, seed=0):
    t = elapsed * (1 + 1e-6 * drift_ppm) + offset_s
    landmarks = motion.at(t)[0][:, [MLKIT_33.index(name) for name in walker.names]]
    return project(CAMERA, landmarks)[0] + noise_px * np.random.default_rng(seed).standard_normal((len(t), 33, 2))


@pytest.mark.parametrize("offset_s", some((-1.3, 0.004, 0.87), -1.3))
def test_a_clock_is_found_in_the_window_to_less_than_a_millisecond(walk, offset_s):
    elapsed = 1.5 + np.arange(300) / 30
    clock, lags, costs, why = from_mocap.from_detections(CAMERA, walk[1], seen(*walk, elapsed, offset_s), elapsed)
    assert why == "" and clock.source == "estimated" and clock.method == "detections"
    error = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - offset_s
    assert abs(error) < 0.0015 and abs(error) < 4 * clock.given[0] < 0.003
    assert abs(lags[np.nanargmin(costs)] - offset_s) < 0.04


def test_a_clock_further_off_is_found_where_it_is_looked_for(walk):
    elapsed = np.arange(300) / 30
    uv = seen(*walk, elapsed, 3.1)
    clock, lags, *_, why = from_mocap.from_detections(CAMERA, walk[1], uv, elapsed, most_s=4.0)
    assert why == "" and clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s == pytest.approx(3.1, abs=0.0015)
    assert lags[-1] == -lags[0] == 4.0


def test_a_clock_beyond_the_window_is_looked_for_further(walk):
    elapsed = np.arange(300) / 30
    clock, lags, *_, why = from_mocap.from_detections(CAMERA, walk[1], seen(*walk, elapsed, 2.3), elapsed)
    assert why == "" and clock.offset_s == pytest.approx(2.3, abs=0.0015) and lags[-1] == 4.0
    # and is not known where the recording ends before it
    few = elapsed[:100]
    clock, lags, *_, why = from_mocap.from_detections(CAMERA, walk[1], seen(*walk, few, 2.3), few)
    assert clock.source == "assumed_zero" and lags[-1] == 2.0 and "at the end of the -1.6 to +2.0 s" in why


def test_a_constant_error_of_the_detector_is_no_time(walk):
    elapsed = np.arange(300) / 30
    uv = seen(*walk, elapsed, 0.3)
    off = uv + 12 * np.random.default_rng(1).standard_normal((1, 33, 2))
    clock, *_, why = from_mocap.from_detections(CAMERA, walk[1], off, elapsed)
    assert why == "" and abs(clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - 0.3) < 0.0015


def test_a_drift_is_found(walk):
    elapsed = np.arange(360) / 30
    clock, *_ = from_mocap.from_detections(CAMERA, walk[1], seen(*walk, elapsed, 0.3, 150.0, 0.5), elapsed)
    assert abs(clock.drift_ppm - 150.0) < 4 * clock.given[1] < 160


def test_someone_who_stands_tells_nothing(walk):
    motion, walker = walk
    still = replace(walker, points=np.broadcast_to(walker.points[:1], walker.points.shape))
    elapsed = np.arange(300) / 30
    uv = seen(motion, walker, 0 * elapsed, 0.0)
    clock, *_, why = from_mocap.from_detections(CAMERA, still, uv, elapsed)
    assert clock.source == "assumed_zero" and np.isnan(clock.given[0])
    assert "fits about as well" in why or "hardly move" in why


def test_nobody_detected_is_a_reason(walk):
    elapsed = np.arange(30) / 30
    clock, *_, why = from_mocap.from_detections(CAMERA, walk[1], np.full((30, 33, 2), np.nan), elapsed)
    assert "no joint is both detected and known" in why and clock.source == "assumed_zero"


@pytest.mark.parametrize("hz", [15, 60, 120])
def test_a_clock_is_as_certain_at_any_rate(walk, hz):
    elapsed = np.arange(10 * hz) / hz
    # errors of the detector that last for 0.15 s say nothing new in the next picture
    from scipy.signal import lfilter

    uv = seen(*walk, elapsed, 0.3, noise_px=0.0)
    keep = np.exp(-1 / (0.15 * hz))
    white = np.random.default_rng(5).standard_normal(uv.shape)
    uv = uv + 2.0 * np.sqrt(1 - keep**2) * lfilter([1.0], [1.0, -keep], white, axis=0)
    clock, _, _, why = from_mocap.from_detections(CAMERA, walk[1], uv, elapsed)
    error = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - 0.3
    assert why == "" and abs(error) < 4 * clock.given[0]
    assert 0.0004 < clock.given[0] < 0.0025


def test_somebody_else_costs_no_more_than_a_limb_that_is_out_of_reach(walk):
    elapsed = 1.5 + np.arange(60) / 30
    _, costs = from_mocap.search(CAMERA, walk[1], seen(*walk, elapsed, 0.2) + 400.0, elapsed)
    depth = project(CAMERA, walk[1].points)[1]
    assert np.nanmax(costs) < CAMERA.intrinsics.fx * from_mocap.REACH_M / np.nanmin(depth) < 400


def test_how_far_detections_are_from_the_joints_at_the_best_of_some_lags(walk):
    elapsed = 1.5 + np.arange(150) / 30
    uv = seen(*walk, elapsed, 0.5, noise_px=0.0) + (6.0, 8.0)
    # 10 px beside at fx 640 and 4 to 6 m, and landmarks are not the centres of joints
    assert 0.05 < from_mocap.off_m(CAMERA, walk[1], uv, elapsed, [-1.0, 0.5]) < 0.13
    assert from_mocap.off_m(CAMERA, walk[1], uv, elapsed, [-1.0]) > 0.2
    assert np.isnan(from_mocap.off_m(CAMERA, walk[1], np.full_like(uv, np.nan), elapsed, [0.5]))


def test_how_far_aside_a_turned_camera_sees_each_joint(walk):
    elapsed = 1.5 + np.arange(150) / 30
    uv = seen(*walk, elapsed, 0.5)
    clock = Clock(0.5, source="estimated")
    right, px_per_m = from_mocap.aside_m(CAMERA, walk[1], uv, elapsed, clock)
    off, _ = from_mocap.aside_m(CAMERA, walk[1], uv + (3.35, 0.0), elapsed, clock)
    assert 100 < px_per_m < 180 and set(off) == set(walk[1].names)
    apart = np.array([off[name] - right[name] for name in off])
    assert apart[:, 0] == pytest.approx(3.35 / px_per_m, abs=0.006) and apart[:, 1] == pytest.approx(0, abs=0.001)
    assert from_mocap.aside_m(CAMERA, walk[1], np.full_like(uv, np.nan), elapsed, clock)[0] == {}
