"""Where the head is: from any part of its joints, without strangers, and between what is known."""

import numpy as np
import pytest

from dior.body.names import MLKIT_33, PLUG_IN_GAIT_39, mirrored
from dior.release import head_model

TURNS = np.deg2rad([0, 50, 170, -100])


def people(places, middle=(0.3, -0.2, 1.6)):
    """Points (F, J, 3) of heads that stand at `middle` and look in the directions TURNS; names."""
    c, s, zero = np.cos(TURNS), np.sin(TURNS), np.zeros(len(TURNS))
    axes = np.stack([np.stack([c, s, zero], -1), np.stack([-s, c, zero], -1), np.tile([0, 0, 1.0], (4, 1))], axis=1)
    return np.asarray(middle) + np.array(list(places.values())) @ axes, list(places)


@pytest.mark.parametrize(
    "names",
    [
        ("left_ear", "right_ear"),
        ("nose", "left_eye", "right_eye", "left_ear", "right_ear"),
        # the ears tell the side from an eye to the other
        ("nose", "left_eye", "right_eye", "left_ear"),
        ("LFHD", "RFHD", "LBHD", "RBHD"),
        ("LFHD", "RFHD", "LBHD"),
    ],
)
def test_middle_of_the_head_from_what_there_is(names):
    points, names = people({name: head_model.HEAD[name] for name in names})
    middle, sigma = head_model.centres(points, names)
    assert np.allclose(middle, (0.3, -0.2, 1.6))
    assert (sigma == 0).all()


def test_shoulders_tell_it_less_well_and_only_where_the_head_is_missing():
    places = {name: {**head_model.HEAD, **head_model.TRUNK}[name] for name in ("nose", "left_shoulder")}
    places |= {mirrored("left_shoulder"): head_model.TRUNK["right_shoulder"]}
    points, names = people(places)
    points[1, 0] = np.nan
    points[2] = np.nan
    middle, sigma = head_model.centres(points, names)
    assert np.allclose(middle[[0, 1, 3]], (0.3, -0.2, 1.6))
    assert sigma[[0, 1, 3]].tolist() == [0.0, head_model.TRUNK_SIGMA_M, 0.0]
    assert np.isnan(middle[2]).all() and np.isnan(sigma[2])


def test_legs_tell_nothing():
    names = ["left_knee", "right_knee"]
    middle, _ = head_model.centres(np.ones((3, 2, 3)), names)
    assert np.isnan(middle).all()
    assert not head_model.used(names).any()


@pytest.mark.parametrize("names", [MLKIT_33, PLUG_IN_GAIT_39])
def test_places_are_symmetric_and_of_known_joints(names):
    for places in (head_model.HEAD, head_model.TRUNK):
        for name, (forward, left, up) in places.items():
            assert places[mirrored(name)] == (forward, -left if left else left, up)
    assert head_model.used(names).sum() == (11 if "nose" in names else 4)


def walk(count=90, speed=1.2):
    t = np.arange(count) / 30
    return t, np.stack([speed * t, 0.02 * np.sin(11 * t), 1.6 + 0.02 * np.cos(11 * t)], axis=1)


def test_a_stranger_for_a_moment_is_left_out_and_nothing_else():
    t, at = walk()
    taken = at.copy()
    taken[40:50] += (0.3, 0.3, 0.0)
    # what refine put between the walker and the stranger goes, too
    filled = np.zeros(len(t), bool)
    filled[50:53] = True
    taken[50:53] += np.linspace(0.25, 0.1, 3)[:, None] * (1, 1, 0)
    kept = np.isfinite(head_model.steady(t, taken, filled)[:, 0])
    assert np.flatnonzero(~kept).tolist() == list(range(40, 53))
    assert np.isfinite(head_model.steady(t, at, filled)).all()


@pytest.mark.parametrize("speed", [0.0, 1.2, 4.0])
def test_who_only_walks_stays(speed):
    t, at = walk(speed=speed)
    at[60:70] = np.nan
    found = head_model.steady(t, at + np.random.default_rng(1).normal(0, 0.015, at.shape), np.zeros(len(t), bool))
    assert np.isnan(found[60:70]).all() and np.isfinite(np.delete(found, np.s_[60:70], axis=0)).all()


def test_somebody_who_comes_back_elsewhere_is_the_same():
    t, at = walk()
    t = t + np.where(np.arange(90) < 45, 0.0, 5.0)
    assert np.isfinite(head_model.steady(t, at, np.zeros(90, bool))).all()


def test_between_and_beyond_what_is_known():
    t, at = walk()
    at = np.stack([1.2 * t, 0 * t, 1.6 + 0 * t], axis=1)
    at[30:36] = np.nan
    at[60:80] = np.nan
    when = np.array([0.5, (t[32] + t[33]) / 2, 2.3, t[-1] + 0.1, t[-1] + 0.5, -0.1])
    middle, sigma = head_model.at_times(when, t, at, np.zeros(90))
    known = [0, 1, 3, 5]
    assert np.allclose(middle[known], np.stack([1.2 * when, 0 * when, 1.6 + 0 * when], axis=1)[known])
    assert np.isnan(middle[[2, 4]]).all() and np.isnan(sigma[[2, 4]]).all()
    assert sigma[0] < 0.001
    # half an acceleration times the times to both sides of the gap
    assert sigma[1] == pytest.approx(head_model.ACCELERATION / 2 * (7 / 60) ** 2)
    assert sigma[3] > sigma[1]


def test_the_ellipsoid_holds_the_face_and_the_crown():
    horizontal, vertical = head_model.RADII_M
    for name, (forward, left, up) in head_model.HEAD.items():
        out = (forward**2 + left**2) / horizontal**2 + ((up - head_model.RAISED_M) / vertical) ** 2
        assert out < 1, name
