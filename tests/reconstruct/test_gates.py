"""Pixels that agree in a world that is wrong."""

import numpy as np

from dior.body.names import MLKIT_33
from dior.reconstruct.gates import implausible
from tests.reconstruct.test_swaps import walker

FPS = 30.0
SMALL = 1e-4 * np.eye(3)


def judged(points, speed=12.0, body=8.0, bone=0.4):
    covariance = np.broadcast_to(SMALL, (*points.shape, 3))
    return implausible(points, covariance, list(MLKIT_33), FPS, speed, body, bone)


def test_a_walker_is_plausible():
    assert not judged(walker(60)).any()


def test_a_runner_is_plausible():
    points = walker(60) + (np.arange(60) / FPS * 7.0)[:, None, None] * [0, 1, 0]
    assert not judged(points).any()
    assert judged(points, body=3.0).sum() > 33 * 40


def test_another_person_two_views_agree_on_is_rejected_and_the_walker_is_not():
    points = walker(90)
    hit = np.zeros(90, bool)
    hit[20:32] = hit[60:66] = True
    points[hit] += [1.5, 1.5, 0]
    points[45:50] = np.nan
    bad = judged(points)
    assert bad[hit].all() and not bad[~hit].any()


def test_one_joint_that_jumps_is_rejected_alone():
    points = walker(40)
    wrist = MLKIT_33.index("left_wrist")
    points[15:18, wrist] += [0, 2.0, 0]
    bad = judged(points, bone=1e9)
    assert bad[15:18, wrist].all() and bad.sum() == 3


def test_a_bone_of_another_length_costs_its_far_end():
    points = walker(40)
    ankle, heel, toe = (MLKIT_33.index(f"left_{name}") for name in ("ankle", "heel", "foot_index"))
    points[20, [ankle, heel, toe]] += [0, 0, 0.25]
    knee = points[20, MLKIT_33.index("left_knee")]
    ratio = np.linalg.norm(points[20, ankle] - knee) / np.linalg.norm(
        points[19, ankle] - points[19, MLKIT_33.index("left_knee")]
    )
    bad = judged(points, bone=0.5 * abs(ratio - 1))
    assert bad[20, ankle] and not bad[np.arange(40) != 20].any()
    assert not judged(points, bone=10.0).any()
