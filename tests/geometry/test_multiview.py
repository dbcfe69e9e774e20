import numpy as np
import pytest

from dior.geometry import camera as cam
from dior.geometry import multiview, triangulation
from tests.rig import camera, ring


@pytest.mark.parametrize("azimuth", np.linspace(0, 2 * np.pi, 9))
@pytest.mark.parametrize("height", [0.3, 1.5, 6.0])
def test_look_at_sees_the_target_in_the_middle_and_up_is_up(azimuth, height):
    centre = np.array([4 * np.cos(azimuth), 4 * np.sin(azimuth), height])
    c = camera("a", centre, target=(0.1, -0.2, 1.0))
    uv, depth = cam.project(c, np.array([[0.1, -0.2, 1.0], [0.1, -0.2, 1.3]]))
    assert uv[0] == pytest.approx([c.intrinsics.cx, c.intrinsics.cy], abs=1e-6)
    assert depth[0] > 0
    assert uv[1, 1] < uv[0, 1] and uv[1, 0] == pytest.approx(uv[0, 0], abs=0.5)


def test_look_at_is_a_rotation_and_its_angles_make_it():
    R = multiview.look_at((3, 4, 2))
    assert R @ R.T == pytest.approx(np.eye(3)) and np.linalg.det(R) == pytest.approx(1)
    azimuth, elevation = multiview.look_at_angles((3, 4, 2))
    assert multiview.rotation_z(azimuth) @ multiview.rotation_x(elevation) == pytest.approx(R)


def paper_intersection(origins, directions):
    """The paper's equations as printed, for one point and three views."""
    (k1, k2, k3), (c1, c2, c3), o = origins, directions, np.zeros(3)
    A = np.block([[c1[:, None], -c2[:, None], o[:, None]], [c1[:, None], o[:, None], -c3[:, None]],
                  [o[:, None], c2[:, None], -c3[:, None]]])  # fmt: skip
    w = np.linalg.lstsq(A, np.concatenate([k2 - k1, k3 - k1, k3 - k2]), rcond=None)[0]
    return (k1 + w[0] * c1 + k2 + w[1] * c2 + k3 + w[2] * c3) / 3


def test_ray_intersection_is_the_papers():
    rng = np.random.default_rng(3)
    cameras = ring(3)
    points = rng.uniform([-1, -1, 0], [1, 1, 2], (20, 3))
    uv = np.stack([cam.project(c, points)[0] for c in cameras]) + rng.normal(0, 3, (3, 20, 2))
    rays = np.stack([cam.rays(c, p) for c, p in zip(cameras, uv, strict=True)])
    origins = np.stack([c.centre for c in cameras])
    ours = multiview.intersect_rays(origins, rays)
    assert ours == pytest.approx(np.stack([paper_intersection(origins, rays[:, i]) for i in range(20)]), abs=1e-9)


def test_ray_intersection_with_missing_views_and_parallel_rays():
    origins = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
    target = np.array([1.0, 1.0, 3.0])
    rays = (target - origins)[:, None, :] * [[[1.0], [1.0], [1.0], [1.0]]]
    rays[2, 1] = np.nan
    rays[1:, 2] = np.nan
    rays[:, 3] = [0, 0, 1.0]
    found = multiview.intersect_rays(origins, rays)
    assert found[:2] == pytest.approx(np.stack([target, target]))
    assert np.isnan(found[2:]).all()


def test_triangulation_is_exact_and_honours_weights_and_missing_views():
    rng = np.random.default_rng(4)
    cameras = ring(4)
    points = rng.uniform([-1, -1, 0], [1, 1, 2], (6, 5, 3))
    uv = np.stack([cam.project(c, points)[0] for c in cameras])
    xy = np.stack([cam.undistort(c.intrinsics, p) for c, p in zip(cameras, uv, strict=True)])
    weights = np.ones(xy.shape[:-1])
    xy[0, 0] += 0.3
    weights[0, 0] = 0.0
    xy[1, 1] = np.nan
    weights[1:, 2] = 0.0
    found = triangulation.triangulate([cam.inverse_pose(c.wTc) for c in cameras], xy, weights)
    keep = [0, 1, 3, 4, 5]
    assert found[keep] == pytest.approx(points[keep], abs=1e-7)
    assert np.isnan(found[2]).all()


def test_similarity_recovers_what_was_applied():
    rng = np.random.default_rng(5)
    source = rng.normal(size=(30, 3))
    R = multiview.look_at((1, 2, 3))
    target = 1.7 * source @ R.T + [1, -2, 3]
    target[4] = np.nan
    s, found, t = multiview.similarity(source, target)
    assert s == pytest.approx(1.7) and found == pytest.approx(R) and t == pytest.approx([1, -2, 3])
    assert multiview.similarity(source, target, scale=False)[0] == 1.0
    with pytest.raises(ValueError, match="3 common points"):
        multiview.similarity(source[:2], target[:2])


def test_an_alignment_turns_and_never_mirrors():
    source = np.random.default_rng(6).normal(size=(30, 3))
    _, R, _ = multiview.similarity(source, source * [-1, 1, 1])
    assert R @ R.T == pytest.approx(np.eye(3)) and np.linalg.det(R) == pytest.approx(1)


def test_which_side_of_a_body_a_camera_sees():
    """Who has his left at +y looks along +x."""
    left, middle = np.array([[0.0, 0.2]]), np.array([[1.0, 2.0]])
    for azimuth, side in ((0, 0), (90, 1), (180, 2), (270, 3), (40, 0), (50, 1)):
        a = np.radians(azimuth)
        centre = np.array([1 + 5 * np.cos(a), 2 + 5 * np.sin(a), 1.5])
        assert multiview.side_seen(centre, left, middle).tolist() == [side]
