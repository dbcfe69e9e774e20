from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry.multiview import rotation_z
from tests.rig import D455, camera

RATIONAL = (0.2, -0.4, 0.001, -0.0005, 0.1, 0.3, -0.3, 0.05)


def test_optical_axis_meets_the_principal_point():
    c = camera("a", (3.0, -2.0, 1.4), target=(0.5, 0.2, 1.0))
    uv, depth = cam.project(c, np.array([0.5, 0.2, 1.0]))
    assert uv == pytest.approx([c.intrinsics.cx, c.intrinsics.cy], abs=1e-9)
    assert depth == pytest.approx(np.linalg.norm([2.5, 2.2, 0.4]))


@pytest.mark.parametrize("distortion", [D455, RATIONAL, (0.0,) * 5])
def test_projection_equals_opencv(distortion):
    import cv2

    c = camera("a", (4.0, 1.0, 1.5), distortion=distortion)
    points = np.random.default_rng(1).uniform([-1, -1, 0], [1, 1, 2], (50, 3))
    cTw = cam.inverse_pose(c.wTc)
    theirs, _ = cv2.projectPoints(
        points, cv2.Rodrigues(cTw[:3, :3])[0], cTw[:3, 3], c.intrinsics.K, np.array(c.intrinsics.distortion)
    )
    assert cam.project(c, points)[0] == pytest.approx(theirs[:, 0], abs=1e-9)


@pytest.mark.parametrize("model", cam.MODELS)
@given(u=st.floats(0, 1279), v=st.floats(0, 719))
def test_undistort_undoes_distort_over_the_whole_picture(model, u, v):
    lens = camera("a", (4, 0, 1), model=model).intrinsics
    there = cam.undistort(lens, np.array([u, v]))
    assert cam.distort(lens, there) == pytest.approx([u, v], abs=1e-5)


@pytest.mark.parametrize(
    ("roll_deg", "below", "above"),
    [(0, "v_max", "v_min"), (180, "v_min", "v_max"), (90, "u_max", "u_min"), (-90, "u_min", "u_max")],
)
def test_the_edge_of_a_box_towards_what_is_hidden_turns_with_the_camera(roll_deg, below, above):
    """A camera that is turned clockwise, as seen from behind it, has the floor at the right of its picture."""
    upright = camera("far", (60.0, 5.0, 2.0), target=(0.0, 0.0, 1.0))
    rolled = upright.at(cam.pose(upright.wRc @ rotation_z(np.radians(roll_deg)), upright.centre))
    assert cam.occluded_edge(rolled) is None
    for part, edge in (("below", below), ("above", above)):
        found = cam.occluded_edge(replace(rolled, occluded=part))
        assert ("u_min", "v_min", "u_max", "v_max")[found] == edge


def test_how_the_lens_bends_follows_finite_differences():
    """Every coefficient of the rational model and the tangential ones, in every direction from the centre."""
    distortion = (-0.2, 0.11, 0.013, -0.017, -0.05, 0.07, 0.04, -0.03)
    xy = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    step = 1e-6
    numeric = np.stack(
        [
            (cam._polynomial(distortion, xy + d) - cam._polynomial(distortion, xy - d)) / (2 * step)
            for d in step * np.eye(2)
        ],
        axis=-1,
    )
    by_x, across, by_y = cam._polynomial_slopes(distortion, xy)
    slopes = np.stack([by_x, across, across, by_y], axis=-1).reshape(-1, 2, 2)
    np.testing.assert_allclose(slopes, numeric, atol=1e-8)


def test_inverse_brown_conrady_is_the_polynomial_read_backwards():
    forward, inverse = (camera("a", (4, 0, 1), model=m).intrinsics for m in ("plumb_bob", "inverse_brown_conrady"))
    ideal = np.array([0.5, 0.3])
    as_pixels = ideal * (forward.fx, forward.fy) + (forward.cx, forward.cy)
    recorded = cam.distort(forward, ideal)
    there = cam.undistort(inverse, as_pixels)
    assert there * (forward.fx, forward.fy) + (forward.cx, forward.cy) == pytest.approx(recorded)


def test_a_point_beyond_the_fold_of_the_lens_is_nowhere():
    """k1 = -0.3 folds at r = 1.05: without a check a point at 80 degrees comes back into the picture."""
    lens = cam.Intrinsics(1280, 720, 640, 640, 640, 360, "plumb_bob", (-0.3,))
    assert np.isfinite(cam.distort(lens, np.array([1.0, 0.0]))).all()
    assert np.isnan(cam.distort(lens, np.array([1.1, 0.0]))).all()


def test_behind_the_camera_has_depth_but_no_pixel():
    c = camera("a", (4.0, 0.0, 1.0))
    uv, depth = cam.project(c, np.array([[8.0, 0.0, 1.0], [np.nan, 0, 0], [4.01, 0.0, 1.0]]))
    assert depth[[0, 2]] == pytest.approx([-4.0, -0.01]) and np.isnan(depth[1])
    assert np.isnan(uv).all()


def test_rays_pass_through_their_points():
    c = camera("a", (4.0, 1.0, 1.5))
    points = np.random.default_rng(2).uniform([-1, -1, 0], [1, 1, 2], (7, 3))
    uv, _ = cam.project(c, points)
    off = np.cross(cam.rays(c, uv), points - c.centre)
    assert np.abs(off).max() < 1e-9


def test_pose_and_its_inverse():
    c = camera("a", (4.0, 1.0, 1.5))
    assert cam.inverse_pose(c.wTc) @ c.wTc == pytest.approx(np.eye(4))


def test_the_picture_ends_half_a_pixel_outside_the_last_centre():
    lens = camera("a", (4, 0, 1)).intrinsics
    uv = np.array([[-0.5, 0], [-0.51, 0], [1279.49, 719.49], [1279.5, 0], [np.nan, 5]])
    assert cam.in_frame(lens, uv).tolist() == [True, False, True, False, False]


def test_unknown_model_and_wrong_picture_size_are_refused():
    with pytest.raises(DiorError, match="fisheye"):
        cam.Intrinsics(640, 480, 1, 1, 1, 1, "fisheye")
    with pytest.raises(DiorError, match="walk_1, camera cam01: the pictures are 640x480 but the intrinsics"):
        cam.check_picture_size(camera("a", (4, 0, 1)).intrinsics, 640, 480, "walk_1, camera cam01")


def test_a_pixel_with_its_depth_is_the_point_that_was_projected():
    c = camera("a", (3.0, -2.0, 1.4))
    points = np.random.default_rng(3).uniform(-1, 1, (20, 3))
    np.testing.assert_allclose(cam.unproject(c, *cam.project(c, points)), points, atol=1e-9)
