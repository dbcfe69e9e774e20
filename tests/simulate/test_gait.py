import numpy as np
import pytest

from dior.body.names import MLKIT_33, PLUG_IN_GAIT_39
from dior.simulate import motion, settings
from dior.simulate.body import body_of
from dior.simulate.gait import Walker, stride_length
from dior.simulate.patterns import walking_cadence

RATE = 200


@pytest.fixture(scope="module")
def walk():
    body = body_of(settings.Settings(), "S01")
    times = np.arange(0, 12, 1 / RATE)
    return body, times, *Walker(body, speed=1.1).at(times)


def joint(points, name):
    return points[:, MLKIT_33.index(name)]


def test_a_speed_gives_a_plausible_stride():
    """Grieve and Gear: at 1.3 m/s and 1.75 m about 54 strides a minute, 1.4 m long."""
    assert 60 * walking_cadence(1.3, 1.75) == pytest.approx(64.8 * (1.3 / 1.75) ** 0.57)
    assert 1.2 < stride_length(1.3, 1.75) < 1.6
    assert stride_length(1.3, 1.75) * walking_cadence(1.3, 1.75) == pytest.approx(1.3)


@pytest.mark.parametrize("a, b", [("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")])
@pytest.mark.parametrize("side", ["left", "right"])
def test_bones_keep_their_length(walk, side, a, b):
    _, _, landmarks, _ = walk
    length = np.linalg.norm(joint(landmarks, f"{side}_{a}") - joint(landmarks, f"{side}_{b}"), axis=-1)
    assert np.ptp(length) < 1e-6 and 0.2 < length.mean() < 0.5


def test_feet_are_on_the_floor_and_do_not_slide(walk):
    _, _, landmarks, _ = walk
    grounded = []
    for side in ("left", "right"):
        heel, tip = joint(landmarks, f"{side}_heel"), joint(landmarks, f"{side}_foot_index")
        lowest = np.minimum(heel[:, 2], tip[:, 2])
        assert lowest.min() > -0.01
        speed = np.linalg.norm(np.gradient(tip, 1 / RATE, axis=0), axis=-1)
        still = speed < 0.2
        assert 0.5 < still.mean() < 0.75
        assert np.median(tip[still, 2]) < 0.03
        assert np.percentile(speed, 95) > 3.0
        grounded.append(still & (lowest < 0.03))
    assert (grounded[0] | grounded[1]).mean() > 0.97


def test_knees_bend_backwards_only(walk):
    _, _, landmarks, _ = walk
    for side in ("left", "right"):
        hip, knee, ankle, tip = (joint(landmarks, f"{side}_{j}") for j in ("hip", "knee", "ankle", "foot_index"))
        forward = tip - ankle
        forward = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
        straight = hip + (ankle - hip) * 0.5
        bent = np.linalg.norm(ankle - hip, axis=-1) < 0.97 * (
            np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
        )
        assert (((knee - straight) * forward).sum(axis=-1)[bent] > 0).mean() > 0.98


def test_the_motion_is_smooth_and_turns_at_the_ends(walk):
    _, _, landmarks, markers = walk
    for points in (landmarks, markers):
        acceleration = np.gradient(np.gradient(points, 1 / RATE, axis=0), 1 / RATE, axis=0)
        assert np.linalg.norm(acceleration, axis=-1).max() < 250
    pelvis = (joint(landmarks, "left_hip") + joint(landmarks, "right_hip")) / 2
    assert np.ptp(pelvis[:, 0]) > 2.0 and np.abs(pelvis[:, :2]).max() < 2.5
    across = joint(landmarks, "left_hip") - joint(landmarks, "right_hip")
    yaw = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))
    assert np.ptp(yaw) > np.pi


def test_markers_are_near_their_joints_but_not_in_them(walk):
    _, _, landmarks, markers = walk
    for marker, name in (
        ("LKNE", "left_knee"),
        ("RANK", "right_ankle"),
        ("LELB", "left_elbow"),
        ("RSHO", "right_shoulder"),
    ):
        apart = np.linalg.norm(markers[:, PLUG_IN_GAIT_39.index(marker)] - joint(landmarks, name), axis=-1)
        assert 0.02 < apart.min() and apart.max() < 0.12


def test_a_real_c3d_walks(shared):
    real = motion.from_c3d(shared / "mocap/walk_100hz.c3d")
    landmarks, markers = real.at(np.arange(0, 3, 0.01))
    assert len(real.names) == 35 and markers.shape == (300, 35, 3)
    pelvis = (joint(landmarks, "left_hip") + joint(landmarks, "right_hip")) / 2
    assert 3.2 < np.linalg.norm(pelvis[-1, :2] - pelvis[0, :2]) < 3.8
    thigh = np.linalg.norm(joint(landmarks, "left_hip") - joint(landmarks, "left_knee"), axis=-1)
    assert 0.3 < thigh.mean() < 0.45 and thigh.std() < 0.02
    assert not real.seen(np.arange(0, 3, 0.01)).all()


def test_joint_angles_are_those_between_the_joints():
    """Signs: flexion and dorsiflexion forward and up, adduction and rotation inwards, of the pelvis up, right, left."""
    body, t = body_of(settings.Settings(), "S01"), np.arange(0, 3, 0.02)
    walker = Walker(body, half_length=20.0, until=4.0)
    points, found = walker.at(t)[0], walker.angles(t)
    hip, knee, ankle = (joint(points, f"left_{part}") for part in ("hip", "knee", "ankle"))
    thigh, shank = knee - hip, ankle - knee
    cosine = (thigh * shank).sum(axis=1) / np.linalg.norm(thigh, axis=1) / np.linalg.norm(shank, axis=1)
    np.testing.assert_allclose(found["knee_angle_l"], np.rad2deg(np.arccos(cosine)), atol=1e-6)
    # he walks along x, and in a walk that is straight the hip's flexion is almost the thigh's slope
    np.testing.assert_allclose(found["hip_flexion_l"], np.rad2deg(np.arctan2(thigh[:, 0], -thigh[:, 2])), atol=3.0)
    across = joint(points, "left_hip") - joint(points, "right_hip")
    np.testing.assert_allclose(found["pelvis_rotation"], np.rad2deg(np.arctan2(-across[:, 0], across[:, 1])), atol=0.1)
    np.testing.assert_allclose(
        found["pelvis_list"], np.rad2deg(np.arcsin(across[:, 2] / (2 * body.half_hips))), atol=0.1
    )
    # a thigh whose knee is nearer to the middle than its hip is adducted, where the pelvis is level
    level = np.abs(found["pelvis_list"]) < 0.3
    for end, side, sign in (("l", "left", 1), ("r", "right", -1)):
        inwards = sign * (joint(points, f"{side}_hip") - joint(points, f"{side}_knee"))[level, 1]
        assert np.corrcoef(inwards, found[f"hip_adduction_{end}"][level])[0, 1] > 0.8
    assert np.abs(found["pelvis_tilt"]).max() < 1e-6 and found["lumbar_extension"].mean() == pytest.approx(-3, abs=0.3)
