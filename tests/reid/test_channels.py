"""What GaitGraph2 is given, by hand."""

import numpy as np
import pytest

from dior.body.names import COCO_17
from dior.reid import channels

UV = np.random.default_rng(0).uniform(0, 100, (60, 17, 2))
JOINTS, VELOCITIES, BONES = range(3)


def test_joints_velocities_and_bones_are_where_the_authors_have_them():
    found = channels.gaitgraph2(UV, 0.8)
    assert found.shape == (3, 5, 60, 17)
    assert (found[JOINTS, :2, 7, 9] == UV[7, 9]).all()
    assert found[JOINTS, 3:, 7, 9] == pytest.approx(UV[7, 9] - UV[7, 0])
    assert found[VELOCITIES, :2, 7, 9] == pytest.approx(UV[8, 9] - UV[7, 9])
    assert found[VELOCITIES, 4, 7, 9] == pytest.approx(UV[9, 9, 1] - UV[7, 9, 1])
    # a wrist hangs on its elbow
    bone = UV[7, 9] - UV[7, 7]
    assert found[BONES, :2, 7, 9] == pytest.approx(bone)
    assert found[BONES, 4, 7, 9] == pytest.approx(np.arctan2(abs(bone[0]), bone[1]), abs=1e-2)
    assert (found[JOINTS, 2] == 0.8).all() and (found[1:, 3] == 0.8).all() and (found[1:, 2] == 0).all()
    # the last two frames have nothing to move to
    assert (found[VELOCITIES, :2, -2:] == 0).all() and (found[VELOCITIES, 4, -2:] == 0).all()


def test_each_joint_has_its_own_confidence():
    sure = np.random.default_rng(1).uniform(0, 1, (60, 17, 1))
    found = channels.gaitgraph2(UV, sure)
    assert (found[JOINTS, 2] == sure[..., 0]).all() and (found[BONES, 3] == sure[..., 0]).all()


def test_motion_and_bones_do_not_know_where_the_person_is():
    here, there = (channels.gaitgraph2(uv, 0.8) for uv in (UV, UV + (40.0, -7.0)))
    assert there[1:] == pytest.approx(here[1:]) and there[JOINTS, 3:] == pytest.approx(here[JOINTS, 3:])
    assert np.abs(there[JOINTS, 0] - here[JOINTS, 0] - 40).max() < 1e-9


def test_exchanged_joints_have_the_name_of_the_other_side():
    other = {"left": "right", "right": "left"}
    for joint, name in enumerate(COCO_17):
        side, _, rest = name.partition("_")
        expected = f"{other[side]}_{rest}" if side in other else name
        assert COCO_17[channels.EXCHANGED[joint]] == expected
