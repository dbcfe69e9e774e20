"""Pixels that agree in a world that is wrong."""

import numpy as np
import pytest

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


SURE = 1e-10 * np.eye(3)


@pytest.mark.parametrize("fps", [15, 60, 120])
@pytest.mark.parametrize(("speed", "told"), [(7.5, False), (8.5, True)])
def test_a_body_is_as_fast_as_the_limit_and_no_faster(fps, speed, told):
    points = walker(fps)
    points += (np.arange(fps) / fps * (speed - 2.0 * fps / (fps - 1)))[:, None, None] * [1, 0, 0]
    bad = implausible(points, np.broadcast_to(SURE, (*points.shape, 3)), list(MLKIT_33), fps, 100.0, 8.0, 0.4)
    # of what is too fast an instant is left every half second: after a gap nothing is known
    assert bad.mean() > 0.85 if told else not bad.any()


@pytest.mark.parametrize(("speed", "told"), [(11.5, False), (12.5, True)])
def test_a_joint_is_as_fast_as_its_limit_and_no_faster(speed, told):
    points = walker(40)
    wrist = MLKIT_33.index("left_wrist")
    points[:, wrist] = points[0, wrist] + (np.arange(40) / FPS * speed)[:, None] * [0, 1, 0]
    bad = implausible(points, np.broadcast_to(SURE, (*points.shape, 3)), list(MLKIT_33), FPS, 12.0, 8.0, 1e9)
    assert bad[:, wrist].mean() > 0.9 if told else not bad.any()
    assert bad.sum() == bad[:, wrist].sum()


@pytest.mark.parametrize("fps", [15, 30, 60, 120])
def test_after_a_gap_of_half_a_second_the_body_may_be_anywhere(fps):
    """Six metres within half a second are too far at 8 m/s; one instant later nothing is known."""
    half = int(0.5 * fps)
    for apart, lost in ((half - 2, 3), (half, 1), (half + 1, 0)):
        points = np.repeat(walker(fps)[:1], 4 * fps, axis=0)
        last = 3 * fps
        points[last + 1 : last + apart] = np.nan
        points[last + apart :] += [6.0, 0, 0]
        bad = implausible(points, np.broadcast_to(SURE, (*points.shape, 3)), list(MLKIT_33), fps, 12.0, 8.0, 0.4)
        assert bad.all(axis=1).sum() == lost and bad.sum() == lost * 33


@pytest.mark.parametrize("fps", [15, 60, 120])
def test_a_bones_length_is_judged_once_a_third_of_a_second_of_it_is_known(fps):
    for known, told in ((round(fps / 3) - 1, False), (round(fps / 3), True)):
        points = np.repeat(walker(fps)[:1], fps, axis=0)
        points[known:] = np.nan
        points[0, MLKIT_33.index("left_wrist")] += [0, 0, 0.05]
        bad = implausible(points, np.broadcast_to(SURE, (*points.shape, 3)), list(MLKIT_33), fps, 1e9, 1e9, 0.01)
        assert bad[0].any() == told and not bad[1:].any()


@pytest.mark.parametrize(("jump", "told"), [(0.9, False), (1.05, True)])
def test_a_joint_may_be_off_by_its_standard_errors(jump, told):
    """In a 30th of a second 0.4 m at 12 m/s, and four times the root of 0.1^2 + 0.1^2 m^2: 0.97 m in all."""
    points = np.repeat(walker(1), 40, axis=0)
    wrist = MLKIT_33.index("left_wrist")
    points[25:, wrist] += [0, jump, 0]
    covariance = np.broadcast_to(0.1**2 / 3 * np.eye(3), (*points.shape, 3))
    bad = implausible(points, covariance, list(MLKIT_33), FPS, 12.0, 8.0, 1e9)
    # an instant later the wrist has had twice the time
    assert bad[24:26, wrist].sum() == told and bad.sum() == told


@pytest.mark.parametrize(("off", "told"), [(0.8, False), (0.95, True)])
def test_a_bone_may_be_off_by_its_share_and_its_standard_errors(off, told):
    """A bone of 0.6 m may change by half of it and by four times the root of 0.1^2 + 0.1^2 m^2: 0.87 m."""
    points = np.zeros((40, 2, 3))
    points[:, 1, 0] = 0.6
    points[20, 1, 0] += off
    covariance = np.broadcast_to(0.1**2 / 3 * np.eye(3), (40, 2, 3, 3))
    bad = implausible(points, covariance, ["left_hip", "left_knee"], FPS, 1e9, 1e9, 0.5)
    assert bad[20, 1] == told and bad.sum() == told
