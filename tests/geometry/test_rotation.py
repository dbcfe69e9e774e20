"""Rotations by formulas that can be written down, and beside SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dior.geometry.rotation import cross, from_quaternion, from_rotvec, nearest_rotation, rotvec

axes = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
angles = st.floats(0, np.pi) | st.sampled_from([0.0, 1e-300, 1e-13, 1e-8, 1e-4, np.pi - 1e-9, np.pi])


def test_a_quarter_turn_about_z():
    assert np.allclose(from_rotvec([0, 0, np.pi / 2]), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert np.allclose(rotvec(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])), [0, 0, np.pi / 2])
    assert np.allclose(from_quaternion(np.array([0, 0, 3, 3])), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


@pytest.mark.parametrize("diagonal", [(1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
def test_half_a_turn(diagonal):
    R = np.diag(np.array(diagonal, float))
    assert np.allclose(np.abs(rotvec(R)), np.pi * (np.array(diagonal) > 0)) and np.allclose(from_rotvec(rotvec(R)), R)


@given(axes, angles)
def test_there_and_back(axis, angle):
    R = from_rotvec(axis * angle)
    assert np.allclose(R, Rotation.from_rotvec(axis * angle).as_matrix(), atol=1e-15)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14) and np.linalg.det(R) > 0
    back = rotvec(R)
    assert np.linalg.norm(back) <= np.pi + 1e-15 and np.allclose(from_rotvec(back), R, atol=1e-14)
    if angle < 3:
        assert np.allclose(back, axis * angle, atol=1e-14)


@given(axes, angles)
def test_quaternions(axis, angle):
    q = np.r_[axis * np.sin(angle / 2), np.cos(angle / 2)]
    assert np.allclose(from_quaternion(-2 * q), from_rotvec(axis * angle), atol=1e-14)


def test_many_at_once():
    turns = np.random.default_rng(0).normal(size=(4, 5, 3))
    assert np.allclose(from_rotvec(turns)[2, 3], from_rotvec(turns[2, 3])) and from_rotvec(turns).shape == (4, 5, 3, 3)


@given(axes, angles)
def test_the_nearest_rotation_undoes_a_stretch(axis, angle):
    R = from_rotvec(axis * angle)
    stretch = np.eye(3) + 0.01 * np.outer(axis, axis)
    assert np.allclose(nearest_rotation(R @ stretch), R, atol=1e-13)


def test_a_cross_product_as_a_matrix():
    a, b = np.random.default_rng(1).normal(size=(2, 7, 3))
    assert np.allclose((cross(a) @ b[..., None])[..., 0], np.cross(a, b))
