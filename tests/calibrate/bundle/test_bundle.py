"""The adjustment's bookkeeping, on the BAL problem of GTSAM's examples and on analytic graphs."""

import gtsam
import numpy as np
import pytest

from dior.calibrate.bundle import bundle
from dior.errors import DiorError
from dior.geometry.camera import project
from tests.rig import ring


def bal(path):
    """The Bundle Adjustment in the Large problem as a GTSAM graph with its own camera model, and its start."""
    data = gtsam.SfmData.FromBalFile(str(path))
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Unit.Create(2)
    for j in range(data.numberTracks()):
        track = data.track(j)
        for m in range(track.numberMeasurements()):
            view, uv = track.measurement(m)
            graph.push_back(gtsam.GeneralSFMFactorCal3Bundler(uv, noise, view, bundle.POINT + j))
        values.insert(bundle.POINT + j, track.point3())
    for view in range(data.numberCameras()):
        values.insert(view, data.camera(view))
    return graph, values


def test_bal_starts_exactly_and_ends_low(shared):
    graph, values = bal(shared / "bal/dubrovnik-3-7-pre.txt")
    assert graph.size() == 19
    assert graph.error(values) == pytest.approx(2764.219984, abs=5e-7)
    found = bundle.optimise(graph, values, "bal", tolerance=1e-9)
    assert found.before == pytest.approx(2764.219984, abs=5e-7)
    assert found.after < 0.021 and found.iterations > 0


def test_the_cost_is_half_the_sum_of_squared_whitened_residuals():
    cameras = ring(3)
    points = np.array([[0.1, 0.2, 1.0], [-0.3, 0.1, 0.4]])
    uv = np.stack([project(camera, points)[0] for camera in cameras])
    graph, values = bundle.build(cameras, uv, points, priors(cameras), [2.0] * 3)
    assert graph.error(values) == pytest.approx(0, abs=1e-12)
    shifted = [camera.at(camera.wTc + np.eye(4, k=3) * 0.01) for camera in cameras]
    graph, values = bundle.build(shifted, uv, points, priors(cameras), [2.0] * 3)
    ideal = [
        bundle.ideal_pixels(c.intrinsics, project(s, points)[0]) - bundle.ideal_pixels(c.intrinsics, uv[i])
        for i, (c, s) in enumerate(zip(cameras, shifted, strict=True))
    ]
    norms = np.linalg.norm(np.array(ideal) / 2.0, axis=-1)
    k = bundle.HUBER
    huber = np.where(norms <= k, norms**2 / 2, k * (norms - k / 2)).sum()
    tape = 3 * 0.5 * (0.01 / 0.05) ** 2
    assert graph.error(values) == pytest.approx(huber + tape, rel=1e-9)


def priors(cameras, sigma_m=0.05):
    return [bundle.Prior(camera.centre, sigma_m, camera.wRc, np.radians(30)) for camera in cameras]


def position_only(measured, start):
    """A camera that is only held by two positions; the least cost is at their mean."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.5)
    for position in measured:
        graph.push_back(gtsam.PoseTranslationPrior3D(0, np.array(position, float), noise))
    graph.push_back(gtsam.PoseRotationPrior3D(0, gtsam.Rot3(), noise))
    values.insert(0, gtsam.Pose3(gtsam.Rot3(), np.array(start, float)))
    return graph, values


def test_two_measured_positions_meet_in_the_middle():
    graph, values = position_only([(0, 0, 0), (2, 0, 0)], (5, 5, 5))
    found = bundle.optimise(graph, values, "x")
    np.testing.assert_allclose(bundle.poses(found.values, 1)[0][:3, 3], [1, 0, 0], atol=1e-6)
    assert found.after == pytest.approx(2 * 0.5 * (1 / 0.5) ** 2)


def test_a_start_that_is_the_minimum_is_no_failure():
    graph, values = position_only([(0, 0, 0), (2, 0, 0)], (1, 0, 0))
    assert bundle.is_minimum(graph, values)
    found = bundle.optimise(graph, values, "x")
    assert found.after == pytest.approx(found.before)


def test_no_accepted_iteration_away_from_the_minimum_is_refused():
    """A residual whose Jacobian has the wrong sign: every step makes it worse and none is accepted."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    values.insert(0, np.array([2.0]))

    def uphill(factor, at, jacobians):
        if jacobians is not None:
            jacobians[0] = -np.eye(1, order="F")
        return at.atVector(0)

    graph.push_back(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(1), [0], uphill))
    assert not bundle.is_minimum(graph, values)
    with pytest.raises(DiorError, match="session field: the adjustment made no progress, no iteration was accepted"):
        bundle.optimise(graph, values, "session field")


def test_a_start_that_is_not_finite_is_a_sentence():
    graph, values = position_only([(0, 0, 0), (np.nan, 0, 0)], (1, 0, 0))
    with pytest.raises(DiorError, match="session field: the cost of the start is not finite"):
        bundle.optimise(graph, values, "session field")
