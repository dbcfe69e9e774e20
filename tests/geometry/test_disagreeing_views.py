import numpy as np
import pytest

from dior.geometry import camera as cam
from dior.geometry import disagreeing_views, triangulation
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import camera, ring


def test_one_gross_outlier_is_left_out():
    cameras = ring(4)
    points = walker(10)
    uv = observed(cameras, points, 0.0)
    uv[2, 3, 7] += [80, -40]
    found, error, used, good = disagreeing_views.by_dropping(cameras, uv, np.ones(uv.shape[:3]), 15.0, 45.0)
    assert good.all()
    assert found == pytest.approx(points, abs=1e-6)
    assert used[:, 3, 7].tolist() == [True, True, False, True]
    assert used.sum() == used.size - 1
    assert error.max() < 1e-4


def test_what_no_two_views_agree_on_is_not_good():
    cameras = ring(3)
    uv = observed(cameras, walker(4), 0.0)
    uv[:, 1, 5] += [[0, 200], [0, -200], [0, 0]]
    _, _, used, good = disagreeing_views.by_dropping(cameras, uv, np.ones(uv.shape[:3]), 5.0, 5.0)
    assert not good[1, 5] and good.sum() == good.size - 1
    assert used[:, 1, 5].sum() == 2


def test_an_outlier_that_puts_the_point_behind_a_camera_is_left_out():
    """The rays of all three views then meet nowhere; the two good ones still do."""
    cameras = [
        camera(f"cam0{i}", centre) for i, centre in enumerate(((4.0, 0, 1.5), (3.8, 1.2, 1.5), (3.8, -1.2, 1.5)))
    ]
    points = walker(6)
    lost = 0
    for seed in range(12):
        uv = observed(cameras, points, 0.0)
        uv[1] += np.random.default_rng(seed).uniform(-400, 400, uv[1].shape)
        found, _, used, good = disagreeing_views.by_dropping(cameras, uv, np.ones(uv.shape[:3]), 15.0, 45.0)
        nowhere = np.isnan(error_of_all(cameras, uv))
        lost += nowhere.sum()
        wrong = np.linalg.norm(found - points, axis=-1) > 0.01
        assert (good & ~wrong).mean() > 0.9
        assert good[nowhere].all()
    assert lost > 20


def error_of_all(cameras, uv):
    """Mean error (T, J) of the point of all views; NaN where it lies behind one of them."""
    xy = np.stack([cam.undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    points = triangulation.triangulate([cam.inverse_pose(c.wTc) for c in cameras], xy, np.ones(xy.shape[:-1]))
    return cam.reprojection_errors(cameras, points, uv).mean(axis=0)


def test_between_dropping_and_rejecting_a_joint_of_two_views_is_kept():
    cameras = [camera("cam01", (4.0, 0, 1.5)), camera("cam02", (0, 4.0, 1.5))]
    uv = observed(cameras, walker(10), 0.0)
    uv[0, 2] += [0, 12]
    found, error, _, good = disagreeing_views.by_dropping(cameras, uv, np.ones(uv.shape[:3]), 5.0, 45.0)
    assert good.all() and (error[2] * 1680 / 640 > 5).all()
    assert not disagreeing_views.by_dropping(cameras, uv, np.ones(uv.shape[:3]), 5.0, 5.0)[3][2].any()


def test_views_disagree_beyond_four_times_the_usual_error():
    cameras, points = ring(4), walker(60)
    clean = observed(cameras, points, 1.0)
    usual = disagreeing_views.usual_error(cameras, clean, np.ones(clean.shape[:3]))
    for times, agree in ((2.5, True), (6.0, False)):
        uv = clean.copy()
        # the point of four views takes a part of the shift, the mean error at fx 1680 is what remains
        step = np.array([0.0, 100.0])
        uv[1, 30, 5] = cam.project(cameras[1], points[30, 5])[0] + step
        _, error, _, _ = disagreeing_views.by_dropping(cameras, uv, np.ones(uv.shape[:3]), np.inf, np.inf)
        uv[1, 30, 5] += (times * usual / (error[30, 5] * 1680 / 640) - 1) * step
        found = disagreeing_views.agreeing(cameras, uv, least_px=0.0)
        assert found[1, 30, 5] == agree and found[:, :30].mean() > 0.99
        assert disagreeing_views.agreeing(cameras, uv, least_px=8 * usual)[1, 30, 5]
        assert found[[0, 2, 3], 30, 5].all()


def test_usual_error_is_in_pixels_at_fx_1680():
    cameras = ring(3, fx=1680.0 / 2)
    uv = observed(cameras, walker(200), 1.0)
    assert 1.0 < disagreeing_views.usual_error(cameras, uv, np.ones(uv.shape[:3])) < 3.0
    assert disagreeing_views.usual_error(cameras, uv * np.nan, np.ones(uv.shape[:3])) == np.inf


def test_no_fewer_views_are_kept_than_agree():
    """A camera that does not see the joint makes no pair of the others a set of three."""
    cameras, points = ring(5), walker(10)
    uv, weights = observed(cameras, points, 2.0), np.ones((5, 10, 33))
    uv[1] += [90, -70]
    uv[4], weights[4] = np.nan, 0.0
    _, _, used, good = disagreeing_views.by_dropping(cameras, uv, weights, 15.0, 45.0)
    assert good.all() and (used.sum(axis=0) == 3).all() and not used[1].any()
