from dataclasses import replace

import numpy as np
import pytest

from benchmarks import scene
from dior.body.names import MLKIT_33
from dior.calibrate.clock import from_cameras
from dior.calibrate.clock.from_cameras import TimedDetections
from dior.geometry.camera import project
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of
from tests.cases import some
from tests.rig import ring


@pytest.fixture(scope="module")
def walk():
    return scene.make("ideal", seed=3, frames=300)


def shifted(made, late_s):
    """Each camera's pictures with stamps that are `late_s` too small."""
    return [TimedDetections(made.seconds - late, uv, 2.5 / scene.FPS) for uv, late in zip(made.uv, late_s, strict=True)]


def found(made, late_s):
    return from_cameras.from_detections(
        list(made.given), shifted(made, late_s), list(made.names), made.seconds, scene.FPS
    )


def test_clocks_are_found_from_each_other(walk):
    late = (0.0, 0.41, -0.27)
    told = found(walk, late)
    reference = told["cam01"][0]
    assert reference.source == "reference" and reference.given == (0.0, 0.0)
    for name, true in zip(("cam02", "cam03"), late[1:], strict=True):
        clock, lags, costs, why = told[name]
        assert why == "" and clock.method == "cameras" and set(clock.gains) == {"cam01", "cam02", "cam03"}
        error = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - true
        assert abs(error) < 4 * clock.given[0] < 0.008
        assert abs(lags[np.nanargmin(costs)] - true) < 0.08


def test_clocks_further_off_are_found_where_they_are_looked_for(walk):
    late = (0.0, 2.7, -2.4)
    wide = [replace(one, most_s=3.2) for one in shifted(walk, late)]
    told = from_cameras.from_detections(list(walk.given), wide, list(walk.names), walk.seconds, scene.FPS)
    for name, true in zip(("cam02", "cam03"), late[1:], strict=True):
        clock, *_, why = told[name]
        assert why == "" and clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s == pytest.approx(true, abs=0.008)


def test_a_clock_beyond_the_window_is_looked_for_further_and_no_others_are_moved(walk):
    told = found(walk, (0.0, 2.3, 0.1))
    assert [told[name][3] for name in ("cam02", "cam03")] == ["", ""]
    assert told["cam02"][0].offset_s == pytest.approx(2.3, abs=0.008)
    assert told["cam03"][0].offset_s == pytest.approx(0.1, abs=0.008)
    assert told["cam02"][1][-1] == pytest.approx(4.0, abs=1 / scene.FPS)


def test_one_camera_a_whole_frame_wrong_shows(walk):
    told = found(walk, (0.0, 1 / scene.FPS, 0.0))
    assert told["cam02"][0].offset_s == pytest.approx(1 / scene.FPS, abs=0.004)
    assert told["cam03"][0].offset_s == pytest.approx(0.0, abs=0.004)


def test_someone_who_stands_tells_nothing(walk):
    noise = np.random.default_rng(0).standard_normal(walk.uv.shape)
    seen = [TimedDetections(walk.seconds, uv[:1] + e, 0.1) for uv, e in zip(walk.uv, noise, strict=True)]
    told = from_cameras.from_detections(list(walk.given), seen, list(walk.names), walk.seconds, scene.FPS)
    for name in ("cam02", "cam03"):
        clock, *_, why = told[name]
        assert why and clock.source == "assumed_zero" and np.isnan(clock.given[0])


def test_a_camera_that_sees_nobody_is_left_out(walk):
    seen = shifted(walk, (0.0, 0.0, 0.1))
    seen[1] = TimedDetections(seen[1].elapsed, np.full_like(seen[1].uv, np.nan), 0.1)
    told = from_cameras.from_detections(list(walk.given), seen, list(walk.names), walk.seconds, scene.FPS)
    assert "no joint is seen by it" in told["cam02"][3]
    assert told["cam03"][3] == "" and told["cam03"][0].offset_s == pytest.approx(0.1, abs=0.01)


def test_velocities_do_not_believe_another_limb():
    t = np.arange(90) / 30
    points = np.stack([1.2 * t, 0 * t, 0 * t + 1], axis=-1)[:, None]
    points[40:44] += [0.0, 2.0, 0.0]
    kept, velocity = from_cameras.smooth(points, t)
    assert np.isnan(kept[40:44]).all() and np.isfinite(kept[50:80]).all()
    assert velocity[20:36, 0] == pytest.approx(np.broadcast_to([1.2, 0, 0], (16, 3)), abs=0.02)


@pytest.mark.parametrize("hz", some([15, 60, 120], 60))
def test_clocks_are_found_at_any_rate(hz):
    from scipy.signal import lfilter

    cameras, late, keep = ring(3), (0.0, 0.41, -0.27), np.exp(-1 / (0.15 * hz))
    settings = levels.from_dict({"walks": ["across"], "environments": ["outdoor"], "subjects": 1, "sequences": 1})
    motion, random = motion_of(settings, levels.sequences(settings)[0]), np.random.default_rng(1)
    grid, seen = np.arange(8 * hz) / hz, []
    for camera, own in zip(cameras, late, strict=True):
        uv = project(camera, motion.at(grid)[0])[0]
        white = 2.0 * np.sqrt(1 - keep**2) * random.standard_normal(uv.shape)
        seen.append(TimedDetections(grid - own, uv + lfilter([1.0], [1.0, -keep], white, axis=0), 2.5 / hz))
    told = from_cameras.from_detections(cameras, seen, list(MLKIT_33), grid, float(hz))
    for camera, true in zip(cameras[1:], late[1:], strict=True):
        clock, *_, why = told[camera.name]
        error = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - true
        # as certain at any rate: errors that last say nothing new in the next picture
        assert why == "" and abs(error) < 4 * clock.given[0] and 0.0005 < clock.given[0] < 0.005
