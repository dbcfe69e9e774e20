"""The adjustment with the points eliminated against GTSAM's of the whole problem: its optimum and its marginals."""

import gtsam
import numpy as np
import pytest
from scipy.linalg import block_diag

from dior.calibrate.bundle import bundle, facts, reduced
from dior.geometry import covariance
from dior.geometry.camera import project
from tests.calibrate.test_adjust import body, seen
from tests.rig import ring

SIGMA_PX, TAPE_M, LENGTH_M = 0.5, 0.05, 0.01
TAG = 1 << 40
# GTSAM's lenses have no k3: without distortion both see the same problem
CAMERAS, POINTS = ring(3, distortion=()), body(40)
SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])
ENDS = np.arange(20).reshape(10, 2)


def distance(a, b):
    return np.linalg.norm(np.asarray(a) - b)


@pytest.fixture(scope="module")
def both():
    """`reduced.Solved`, and GTSAM's poses (3, 4, 4) and covariance (18, 18) of the same measurements.

    The metric facts contradict the tape by one or two sigmas each.
    """
    random = np.random.default_rng(3)
    uv = seen(CAMERAS, POINTS, SIGMA_PX)
    uv[2, ::7] = np.nan
    uv[0, 3] += 40  # beyond where the loss turns linear
    priors = [
        bundle.Prior(c.centre + random.normal(0, TAPE_M, 3), TAPE_M, covariance.moved(c, 0.02 * np.ones(6)).wRc, 0.1)
        for c in CAMERAS
    ]
    between = distance(CAMERAS[0].centre, CAMERAS[1].centre) + LENGTH_M
    away = distance(CAMERAS[2].centre, POINTS[30]) - LENGTH_M
    joints = np.mean([distance(POINTS[a], POINTS[b]) for a, b in ENDS]) + LENGTH_M
    corners = project(CAMERAS[1], SQUARE)[0] + random.normal(0, 0.3, (4, 2))
    stated = [facts.placed(v, prior) for v, prior in enumerate(priors)]
    stated += [
        facts.between_cameras(0, 1, between, LENGTH_M),
        facts.to_point(2, [30], away, LENGTH_M),
        facts.length([(ENDS[:, :1], ENDS[:, 1:], 1.0)], joints, LENGTH_M),
        facts.tag(1, corners, SQUARE, 0.3),
    ]
    start = [covariance.moved(c, random.normal(0, 0.01, 6)) for c in CAMERAS]
    observed = reduced.Observed(uv, np.full(uv.shape[:2], SIGMA_PX), len(POINTS))
    solved = reduced.solve(start, observed, POINTS, stated)

    graph, values = bundle.build(start, uv, POINTS, priors, [SIGMA_PX] * 3)
    one = gtsam.noiseModel.Isotropic.Sigma(1, LENGTH_M)
    graph.push_back(gtsam.RangeFactorPose3(0, 1, between, one))
    graph.push_back(gtsam.RangeFactor3D(2, bundle.POINT + 30, away, one))
    graph.push_back(gtsam.CustomFactor(one, [bundle.POINT + int(j) for j in ENDS.ravel()], mean_length(joints)))
    lens = CAMERAS[1].intrinsics
    K = gtsam.Cal3_S2(lens.fx, lens.fy, 0.0, lens.cx, lens.cy)
    for j, (corner, place) in enumerate(zip(corners, SQUARE, strict=True)):
        graph.push_back(gtsam.PriorFactorPoint3(TAG + j, place, gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)))
        noise = gtsam.noiseModel.Isotropic.Sigma(2, 0.3)
        graph.push_back(gtsam.GenericProjectionFactorCal3_S2(corner, noise, 1, TAG + j, K))
        values.insert(TAG + j, place)
    best = bundle.optimise(graph, values, "whole", tolerance=1e-12).values
    poses = bundle.poses(best, 3)
    C = gtsam.Marginals(graph, best).jointMarginalCovariance([0, 1, 2]).fullMatrix()
    # GTSAM shifts a pose along its own axes
    turned = block_diag(*(part for wTc in poses for part in (np.eye(3), wTc[:3, :3])))
    return solved, poses, turned @ C @ turned.T


def mean_length(measured):
    """The error function of a mean distance of pairs of points, for `gtsam.CustomFactor`."""

    def error(factor, at, jacobians):
        points = np.array([at.atPoint3(key) for key in factor.keys()]).reshape(-1, 2, 3)
        gap = points[:, 1] - points[:, 0]
        length = np.linalg.norm(gap, axis=1)
        if jacobians is not None:
            for i, along in enumerate(gap / length[:, None] / len(gap)):
                jacobians[2 * i], jacobians[2 * i + 1] = -along[None], along[None]
        return np.array([length.mean() - measured])

    return error


def test_the_optimum_is_gtsams(both):
    solved, poses, C = both
    sigma = np.sqrt(np.diag(C)).reshape(3, 6)
    for camera, wTc, own in zip(solved.cameras, poses, sigma, strict=True):
        shift, turn = camera.centre - wTc[:3, 3], turned_by(camera.wRc, wTc[:3, :3])
        # sigmas; what differs is that a metric fact here measures the cameras and does not pull its points
        assert np.abs(shift / own[3:]).max() < 0.03 and np.abs(turn / own[:3]).max() < 0.03


def turned_by(one, other):
    """The turn (3,) rad about the camera's axes between two rotations."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(one.T @ other).as_rotvec()


def test_the_covariance_is_gtsams_marginal(both):
    solved, _, C = both
    ours = np.linalg.inv(solved.normal)
    scale = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    assert np.abs((ours - C) / scale).max() < 0.03
