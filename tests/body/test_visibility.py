"""What the body hides, on the simulator's walker, whose own drawing says what is hidden."""

import numpy as np
import pytest

from dior.body import visibility
from dior.body.names import MLKIT_33
from dior.body.visibility import hidden
from dior.simulate import settings as levels
from dior.simulate import truth
from dior.simulate.motion import motion_of
from tests.rig import camera


@pytest.fixture(scope="module")
def walk():
    settings = levels.from_dict({"duration_s": 4.0})
    return settings, levels.sequence_named(settings, "indoor_01")


@pytest.fixture(scope="module")
def seen(walk):
    settings, sequence = walk
    motion = motion_of(settings, sequence)
    view = truth.view(settings, sequence, motion, "cam01")
    landmarks, markers = motion.at(view.seconds)
    return view, {MLKIT_33: landmarks, motion.names: markers}


def standing():
    """Landmarks of somebody who stands at the origin and looks along x, both feet down."""
    from dior.simulate.body import Body
    from dior.simulate.bystander import standing as at

    return at(Body(1.75), np.zeros(2), 0.0)[None]


def test_a_face_is_hidden_from_behind_and_not_from_the_front():
    at = MLKIT_33.index("nose")
    front, back = (hidden(camera("cam01", (x, 0.0, 1.5)), standing(), MLKIT_33) for x in (5.0, -5.0))
    assert not front[0, at] and back[0, at]


def test_the_far_arm_is_hidden_from_the_side():
    from_left = hidden(camera("cam01", (0.0, 5.0, 1.5)), standing(), MLKIT_33)[0]
    assert from_left[MLKIT_33.index("right_elbow")] and not from_left[MLKIT_33.index("left_elbow")]
    assert from_left[MLKIT_33.index("right_ear")] and not from_left[MLKIT_33.index("left_ear")]


@pytest.mark.parametrize(("joints", "alike"), [("landmarks", 0.90), ("markers", 0.83)])
def test_most_of_what_the_drawn_body_hides_is_found(seen, joints, alike):
    view, points = seen
    names, points = list(points.items())[joints == "markers"]
    true = view.status[:, [view.joints.index(name) for name in names]] == "occluded"
    found = hidden(view.camera, points, names)
    assert (found == true).mean() > alike
    assert true[found].mean() > 0.85  # of those called hidden


def test_without_legs_nothing_is_known_of_the_size():
    assert not hidden(camera("cam01", (5.0, 0.0, 1.5)), standing()[:, :11], MLKIT_33[:11]).any()


def test_a_missing_joint_hides_nothing(seen):
    view, points = seen
    lost = points[MLKIT_33].copy()
    lost[:, 11:] = np.nan
    assert not hidden(view.camera, lost, MLKIT_33).any()


@pytest.mark.parametrize(
    ("beside", "behind", "told"),
    [
        (0.0, 0.03, False),  # in the limb that it belongs to, 1.3 radii below its surface
        (0.0, 0.05, True),  # 1.5 radii
        (0.0, 0.5, True),
        (0.0, -0.2, False),  # in front of it
        (0.099, 0.02, False),  # the line of sight grazes a limb that the joint belongs to
        (0.099, 0.07, True),  # 1.21 radii from the axis: another limb, and 0.84 radii behind where the line enters it
        (0.101, 0.5, False),  # past the limb
    ],
)
def test_a_joint_is_hidden_by_a_limb_of_10_cm_radius(beside, behind, told):
    """An upright limb 5 m from the eye at 0, its axis `beside` the line of sight, the joint `behind` the axis, m."""
    a, b = (np.array([[5.0, beside, z]]) for z in (-1.0, 1.0))
    sight, far = np.array([1.0, 0.0, 0.0]).reshape(3, 1, 1), np.array([[5.0 + behind]])
    assert visibility._behind(sight, far, a, b, 0.1, 0.1)[0, 0] == told
