import numpy as np
import pytest

from dior.body import joint_centres
from dior.body.names import BODY_25, COCO_17, MLKIT_33
from dior.simulate import settings
from dior.simulate.motion import motion_of


@pytest.fixture(scope="module")
def walk():
    made = settings.from_dict({"subjects": 1, "duration_s": 4.0})
    return motion_of(made, settings.sequences(made)[0])


def test_joints_lie_near_the_truth_and_stay_put_in_their_axes(walk):
    landmarks, markers = walk.at(np.linspace(0, 4, 200))
    points, axes = joint_centres.joints(markers, list(walk.names), list(MLKIT_33))
    assert np.isfinite(points).all(axis=(0, 2)).all()
    off = landmarks - points
    assert np.linalg.norm(off, axis=-1).max() < 0.2
    own = np.einsum("tjxa,tjx->tja", axes, off)
    # what is left after the constant: a joint centre is not quite rigid with the markers
    assert np.linalg.norm(own - own.mean(axis=0), axis=-1).mean() < 0.01
    assert np.einsum("tjxa,tjxb->tjab", axes, axes) == pytest.approx(np.broadcast_to(np.eye(3), axes.shape), abs=1e-9)


def test_every_detectors_joints_are_known(walk):
    _, markers = walk.at(np.zeros(1))
    for names in (COCO_17, BODY_25):
        assert np.isfinite(joint_centres.joints(markers, list(walk.names), list(names))[0]).all()


def test_a_missing_marker_leaves_its_joints_out(walk):
    _, markers = walk.at(np.zeros(1))
    keep = [i for i, name in enumerate(walk.names) if name != "LANK"]
    points, _ = joint_centres.joints(markers[:, keep], [walk.names[i] for i in keep], list(MLKIT_33))
    missing = {name for name, there in zip(MLKIT_33, np.isfinite(points[0, :, 0]), strict=True) if not there}
    assert missing == {"left_ankle", "left_knee"}
