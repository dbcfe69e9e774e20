"""How well given poses are known: errors of known size come back, by linear algebra and by a walk."""

import numpy as np
import pytest

from benchmarks import scene
from dior.calibrate.bundle import given_poses, in_adjustment
from dior.calibrate.bundle.window import Recorded
from dior.calibrate.clock.from_cameras import TimedDetections
from dior.geometry import covariance

VIEWS = 4


def drawn(turn_rad, shift_m, seed):
    """What an adjustment reports of poses with such errors: moves, normal matrix and covariance."""
    random = np.random.default_rng(seed)
    count = 6 * VIEWS
    held = np.tile([given_poses.HELD_RAD**-2] * 3 + [given_poses.HELD_M**-2] * 3, VIEWS)
    # 7 directions that move the world show in no pixel
    directions = random.normal(size=(count - 7, count)) * np.sqrt(held)
    H = 1e4 * directions.T @ directions
    error = np.tile([turn_rad] * 3 + [shift_m] * 3, VIEWS) * random.normal(size=count)
    gradient = -H @ error + 1e2 * directions.T @ random.normal(size=count - 7)
    normal = H + np.diag(held)
    inverse = np.linalg.inv(normal)
    return -inverse @ gradient, normal, inverse


@pytest.mark.parametrize(("turn_deg", "shift_m"), [(0.1, 0.005), (0.5, 0.01), (0.2, 0.05)])
def test_known_errors_come_back(turn_deg, shift_m):
    found = [given_poses.variances(*drawn(np.radians(turn_deg), shift_m, seed)) for seed in range(12)]
    turns, shifts = np.array([(one.turn_rad, one.shift_m) for one in found]).T
    assert np.exp(np.log(turns / np.radians(turn_deg)).mean()) == pytest.approx(1, abs=0.25)
    assert np.exp(np.log(shifts / shift_m).mean()) == pytest.approx(1, abs=0.25)


def of_walk(made, turn_deg, shift_m, seed, frames=None):
    """`PoseErrors` of a scene's cameras, each off by a turn and a shift of that standard error."""
    random = np.random.default_rng(seed)
    errors = [np.r_[np.radians(turn_deg) * random.normal(size=3), shift_m * random.normal(size=3)] for _ in made.given]
    cameras = [covariance.moved(c, error) for c, error in zip(made.given, errors, strict=True)]
    uv = np.where((made.score >= 0.3)[..., None], made.uv, np.nan)[:, :frames]
    seen = tuple(TimedDetections(made.seconds[:frames], one, 0.06) for one in uv)
    window = {"first": 0, "count": len(seen[0].elapsed) // 2, "step": 2}
    names = [camera.name for camera in cameras]
    given = [[(0.0, 0.0, "manual")] * len(cameras)]
    timed = in_adjustment.of([Recorded(seen, made.names, scene.FPS)], [window], names, given, 2)
    return given_poses.of(cameras, timed, 15.0, np.full(len(cameras), 0.003))


def test_a_walk_tells_good_poses_from_bad_ones():
    made = scene.make("real", 1, 200)
    good, bad = of_walk(made, 0.0, 0.0, 1), of_walk(made, 1.0, 0.05, 1)
    assert np.degrees(good.turn_rad) < 0.15 and good.shift_m < 0.012
    assert 0.4 < np.degrees(bad.turn_rad) < 2 and 0.015 < bad.shift_m < 0.12
    np.testing.assert_allclose(np.diag(bad.covariance()), [bad.turn_rad**2] * 3 + [bad.shift_m**2] * 3)


def test_a_walk_of_few_joints_tells_nothing():
    assert of_walk(scene.make("ideal", 1, 30), 0.0, 0.0, 1, frames=8) is None
