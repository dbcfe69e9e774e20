import numpy as np
import pytest

from benchmarks import scene
from dior.calibrate.clock import from_cameras
from dior.calibrate.clock.from_cameras import TimedDetections


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
