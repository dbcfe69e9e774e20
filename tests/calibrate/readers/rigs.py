"""Three cameras around a walker, and what a reader must say of them."""

import numpy as np

from dior.calibrate.readers import files, given
from dior.geometry.camera import inverse_pose, pose
from tests.rig import ring

K = np.array([[900.25, 0.0, 640.5], [0.0, 901.75, 355.125], [0.0, 0.0, 1.0]])
D = (-0.05, 0.12, 0.0005, -0.0007, 0.01)
SIZE = (1280, 720)
TURN = pose(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), [0.3, -2.0, 1.25])


def poses():
    """wTc (3, 4, 4) m."""
    return np.stack([camera.wTc for camera in ring(3)])


def relative():
    """The same in the world of the first one."""
    wTc = poses()
    return inverse_pose(wTc[0]) @ wTc


def same_lens(path, name, distortion=D, size=SIZE, matrix=K):
    """The lens that a file gives for a camera is this one, to 1e-9."""
    lens = given.intrinsics(files.camera(path, name), "", f"{path} [{name}]")
    assert (lens.width, lens.height) == size
    np.testing.assert_allclose(lens.K, matrix, atol=1e-9)
    np.testing.assert_allclose(lens.distortion, np.pad(distortion, (0, 8 - len(distortion))), atol=1e-12)
    return lens


def same_pose(found, wTc):
    """Poses (4, 4) that differ by less than 1e-6 m and 1e-6 rad."""
    assert np.linalg.norm(found[:3, 3] - wTc[:3, 3]) < 1e-6
    assert np.linalg.norm(found[:3, :3].T @ wTc[:3, :3] - np.eye(3)) / np.sqrt(2) < 1e-6
