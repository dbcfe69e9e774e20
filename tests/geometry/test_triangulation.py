"""Points of many views at once: against a nonlinear least squares, and where they are nowhere."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from dior.geometry import camera as cam
from dior.geometry import triangulation
from tests.rig import camera, ring

POINTS = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 2], (12, 3))


def test_points_and_chi_squared_are_those_of_the_reprojection():
    cameras = ring(3, distortion=())
    uv = np.stack([cam.project(c, POINTS)[0] for c in cameras]) + np.random.default_rng(1).normal(0, 2, (3, 12, 2))
    weights = np.array([1.0, 0.5, 0.25])[:, None] * np.ones(12)
    weights[2, :4] = 0.0
    rig = triangulation.rig_of(cameras)
    found, chi2 = triangulation.meet(triangulation.views_of(rig, uv, weights))
    for i, point in enumerate(found.T + rig.origin):

        def miss(p, i=i):
            off = np.stack([cam.project(c, p)[0] for c in cameras]) - uv[:, i]
            return (weights[:, i, None] * off).ravel()

        best = least_squares(miss, POINTS[i], xtol=1e-12)
        assert np.linalg.norm(point - best.x) < 2e-4 and chi2[i] == pytest.approx(2 * best.cost, rel=0.02)


def test_a_point_behind_a_view_that_has_a_say_is_nowhere():
    """Two cameras look away from the point in which the lines of their pixels cross."""
    away = [
        camera(f"cam{i}", (4.0, side, 1.0), target=(9.0, 2 * side, 1.0), distortion=())
        for i, side in enumerate((-1, 1))
    ]
    toward = camera("cam2", (4.0, 0.0, 1.0), target=(0, 0, 1.0), distortion=())
    rig = triangulation.rig_of([*away, toward, ring(1, distortion=())[0]])
    p = (np.array([0.1, 0.2, 1.1]) - np.array([c.centre for c in rig.cameras]))[:, None] @ np.array(
        [c.wRc for c in rig.cameras]
    )
    x, y = (p[:, :, i] / p[:, :, 2] for i in range(2))
    assert (p[:2, 0, 2] < 0).all() and (p[2:, 0, 2] > 0).all()
    for weights, there in (((1, 1, 0, 0), False), ((1, 0, 1, 1), False), ((0, 0, 1, 1), True), ((0, 0, 0, 1), False)):
        views = triangulation.views_of_ideal(rig, x, y, np.array(weights, float)[:, None])
        found, chi2 = triangulation.meet(views)
        assert np.isfinite(found).all() == np.isfinite(chi2).all() == there
        crossed, _ = triangulation.meet_unscaled(views)
        if sum(weights) > 1:
            assert crossed[:, 0] + rig.origin == pytest.approx([0.1, 0.2, 1.1])
        else:
            assert np.isnan(crossed).all()
