"""A calibration in the world of its first camera is brought to that of marked points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dior.calibrate.marks import world_of_points
from dior.calibrate.marks.marks import Marks
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose, pose, project
from tests.rig import ring

POINTS = {"post": (0.0, 0.0, 0.0), "corner": (2.0, 0.0, 0.0), "bag": (0.3, 1.5, 0.0), "lamp": (-0.5, 0.5, 1.4)}


def marks_of(points, uv):
    """A click for each point (P, 3) at pixels (P, 2), and the first one a second time on another picture."""
    names = [*points, next(iter(points))]
    xyz, uv = np.array([points[name] for name in names]), np.vstack([uv, uv[:1]])
    frame = np.arange(len(names))
    return Marks(np.array(["walk"] * len(names), object), frame, np.array(names, object), frame, uv, xyz)


def scene(names=tuple(POINTS), move=None, noise=0.0, seed=0):
    """Cameras of which the world is moved by T (4, 4), and the marks of points that they see."""
    rng, true = np.random.default_rng(seed), ring(3)
    points = {name: POINTS[name] for name in names}
    marks = {}
    for camera in true:
        uv = project(camera, np.array(list(points.values())))[0]
        marks[camera.name] = marks_of(points, uv + noise * rng.standard_normal(uv.shape))
    move = inverse_pose(true[0].wTc) if move is None else move
    return true, [camera.at(move @ camera.wTc) for camera in true], marks


@pytest.mark.parametrize("names", [("post", "corner", "bag"), tuple(POINTS)])
def test_cameras_come_back_to_where_they_stand(names):
    true, cameras, marks = scene(names)
    found = world_of_points.rebased(cameras, marks, "session field")
    for camera, moved in zip(true, cameras, strict=True):
        np.testing.assert_allclose(found.bTw @ moved.wTc, camera.wTc, atol=1e-7)
    assert found.names == names and found.off_m.max() < 1e-7 and found.tilt_rad < 1e-6


def test_a_point_that_is_clicked_on_several_pictures_is_their_mean():
    _, cameras, marks = scene()
    first = marks["cam01"]
    first.uv[0] += (4.0, -2.0)
    first.uv[-1] -= (4.0, -2.0)
    assert world_of_points.rebased(cameras, marks, "").off_m.max() < 1e-7


def test_the_tilt_is_not_further_off_than_it_is_said_to_be():
    """Of 100 draws of clicks that are 3 px off; the sigma is that about the axis that the points tell least."""
    errors, sigmas = [], []
    for seed in range(100):
        true, cameras, marks = scene(noise=3.0, seed=seed)
        found = world_of_points.rebased(cameras, marks, "")
        turn = (found.bTw @ cameras[1].wTc)[:3, :3] @ true[1].wRc.T
        errors.append(Rotation.from_matrix(turn).as_rotvec()[:2])
        sigmas.append(found.tilt_rad)
    assert 0.2 < np.mean(np.square(errors)) / np.mean(np.square(sigmas)) < 1.0


@pytest.mark.parametrize(
    ("names", "change", "sentence"),
    [
        (("post", "corner"), None, "needs 3 points .* two reference cameras or more; there are post, corner"),
        (("post", "corner", "bag"), lambda m: m.update(cam01=m["cam02"].only(slice(0))), None),
        ((), lambda m: m.clear(), "from_marks` needs 3 points with x, y, z, each marked in the <camera>.marks.csv"),
        (("post", "corner", "bag"), lambda m: m["cam02"].xyz.__setitem__(1, (2.1, 0, 0)), "corner has two places"),
        (("post", "corner", "bag"), lambda m: [own.xyz.__imul__(0.001) for own in m.values()], "are on a line"),
        (
            ("post", "corner", "bag"),
            lambda m: [own.xyz.__imul__(0.5) for own in m.values()],
            "too large by 2.00, by post",
        ),
    ],
)
def test_what_is_refused(names, change, sentence):
    _, cameras, marks = scene(names or tuple(POINTS))
    if change:
        change(marks)
    if sentence is None:
        # two cameras of three will do
        world_of_points.rebased(cameras, marks, "")
        return
    with pytest.raises(DiorError, match=sentence):
        world_of_points.rebased(cameras, marks, "session field")


def test_another_unit_is_named():
    true, _, marks = scene()
    large = [camera.at(pose(camera.wRc, 1000 * camera.centre)) for camera in true]
    with pytest.raises(DiorError, match="field: the calibration's world is in millimetres, not metres, by post"):
        world_of_points.rebased(large, marks, "session field")


def test_three_points_on_a_line_tell_no_turn_about_it():
    true, cameras, marks = scene(("post", "corner", "bag"))
    for camera in true:
        own = marks[camera.name]
        own.xyz[2] = (1.0, 0.1, 0.0)
        own.uv[2] = project(camera, own.xyz[2])[0]
    with pytest.raises(DiorError, match="the marked points post, corner, bag are on a line; mark one beside it"):
        world_of_points.rebased(cameras, marks, "")


def test_a_point_that_one_camera_alone_has_says_nothing():
    _, cameras, marks = scene()
    for camera in cameras[1:]:
        own = marks[camera.name]
        marks[camera.name] = own.only(own.joint != "lamp")
    assert world_of_points.rebased(cameras, marks, "").names == ("post", "corner", "bag")
