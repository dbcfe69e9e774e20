"""What a pose from marks is worth: the mirror pose, the suspect mark, the covariance, the mark to add."""

import numpy as np
import pytest

from dior.calibrate.locate import locate, refine
from dior.calibrate.marks import pnp
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import angle_deg, pose, project
from dior.geometry.multiview import rotation_z
from tests.rig import camera

VIEW = camera("cam01", (3.0, -2.0, 1.6))


def points(count=14, seed=0, thick=0.4):
    return np.random.default_rng(seed).uniform((-0.6, -thick, 0.1), (0.6, thick, 1.8), (count, 3))


def noisy(xyz, sd, seed=0, view=VIEW):
    return project(view, xyz)[0] + sd * np.random.default_rng(seed).standard_normal((len(xyz), 2))


def test_marks_in_space_have_no_other_pose():
    xyz = points()
    assert pnp.other_solution(VIEW, xyz, noisy(xyz, 0.0), refine) is None


def far_and_flat(size=0.5, centre=(12.0, 1.0, 1.4)):
    """A small upright square, seen from far away: its mirror pose fits nearly as well."""
    view = camera("cam01", centre, target=(0, 0, 1.0))
    u, v = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4))
    along = np.array([-0.5, 0.85, 0.0])
    return view, np.array([0, 0, 1.0]) + size / 2 * (u.ravel()[:, None] * along + v.ravel()[:, None] * (0, 0, 1.0))


def test_the_mirror_pose_of_a_plane_is_found_and_nearly_fits():
    view, xyz = far_and_flat()
    uv = noisy(xyz, 0.0, view=view)
    other = pnp.other_solution(view, xyz, uv, refine)
    assert angle_deg(other[:3, :3], view.wRc) > 20
    assert np.linalg.norm(project(view.at(other), xyz)[0] - uv, axis=1).max() < 1.0


def test_two_poses_that_fit_are_refused():
    view, xyz = far_and_flat()
    with pytest.raises(DiorError, match="two poses fit.*outside of the plane"):
        locate(view, xyz, noisy(xyz, 1.0, view=view), 8.0, "marks")


def test_a_plane_that_is_near_tells_and_it_is_said_why():
    view, xyz = far_and_flat(size=1.0, centre=(6.0, 1.0, 1.4))
    found = locate(view, xyz, noisy(xyz, 0.3, view=view), 8.0, "marks")
    assert np.linalg.norm(found.wTc[:3, 3] - view.centre) < 0.1
    assert "nearly in a plane" in found.other and "fits clearly worse" in found.other


def test_a_pose_below_the_floor_is_not_taken():
    xyz = points(16, thick=0.6)
    xyz[:, 2] = 0.0
    below = VIEW.wTc.copy()
    below[2, 3] *= -1
    below[:3, :3] = np.diag([1, 1, -1.0]) @ VIEW.wRc @ np.diag([1, -1, 1.0])
    chosen, said = pnp.decide(VIEW, below, xyz, noisy(xyz, 0.5), "marks")
    assert (chosen == VIEW.wTc).all() and "below the floor" in said
    chosen, said = pnp.decide(VIEW.at(below), VIEW.wTc, xyz, noisy(xyz, 0.5), "marks")
    assert (chosen == VIEW.wTc).all() and "below the floor" in said


def rolled(roll_deg):
    return VIEW.at(VIEW.wTc @ pose(rotation_z(np.radians(roll_deg)), np.zeros(3)))


@pytest.mark.parametrize("roll_deg", range(0, 360, 30))
def test_no_roll_is_impossible(roll_deg):
    assert pnp.impossible(rolled(roll_deg), points()) == ""
    assert pnp.impossible(rolled(roll_deg), points() + (20, -14, 0)) == "with marks behind it"
    assert pnp.upright(rolled(roll_deg).wTc) == (1 if roll_deg in (0, 30, 330) else -1 if 150 <= roll_deg <= 210 else 0)


def test_upside_down_breaks_a_tie_and_nothing_else():
    xyz = points(16, thick=0.6)
    down = rolled(180)
    uv = project(down, xyz)[0]
    # the marks say upside down: an upright pose that fits worse does not win
    chosen, said = pnp.decide(down, VIEW.wTc, xyz, uv, "marks")
    assert (chosen == down.wTc).all() and "fits clearly worse" in said
    # a mirrored twin that fits as well, since the projection is replaced by one that tells nothing
    far = xyz.mean(axis=0) + 1e-9 * (xyz - xyz.mean(axis=0))
    level = project(VIEW, far)[0]
    for first, second in ((VIEW, down), (down, VIEW)):
        both = np.where(np.isfinite(level), (project(first, far)[0] + project(second, far)[0]) / 2, np.nan)
        chosen, said = pnp.decide(first, second.wTc, far, both, "marks")
        assert (chosen == VIEW.wTc).all() and "is upside down" in said


def fitted(xyz, uv):
    wTc, J = refine(VIEW, xyz, uv)
    return J, uv - project(VIEW.at(wTc), xyz)[0]


def test_deletion_residuals_are_those_of_a_fit_without_the_mark():
    xyz = points()
    uv = noisy(xyz, 1.0)
    uv[4] += (7.0, -4.0)
    worst, distance, shift = pnp.suspect(*fitted(xyz, uv))
    keep = np.arange(len(xyz)) != 4
    without = refine(VIEW, xyz[keep], uv[keep])[0]
    everything = refine(VIEW, xyz, uv)[0]
    assert worst == 4
    assert distance == pytest.approx(np.linalg.norm(project(VIEW.at(without), xyz[4])[0] - uv[4]), rel=0.02)
    assert shift == pytest.approx(np.linalg.norm(without[:3, 3] - everything[:3, 3]), rel=0.05)


@pytest.mark.slow
def test_good_marks_are_rarely_suspected():
    xyz = points()
    blamed = [pnp.suspect(*fitted(xyz, noisy(xyz, 1.5, seed))) for seed in range(60)]
    assert sum(b is not None for b in blamed) <= 2


@pytest.mark.slow
def test_the_covariance_holds_over_many_clicks():
    xyz = points(10)
    z2 = []
    for seed in range(60):
        uv = noisy(xyz, 1.0, seed)
        wTc, J = refine(VIEW, xyz, uv)
        spread = pnp.pose_covariance(J, uv - project(VIEW.at(wTc), xyz)[0])
        _, by = covariance.projection(VIEW.at(wTc), xyz)
        error = project(VIEW.at(wTc), xyz)[0] - project(VIEW, xyz)[0]
        z2.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(by @ spread @ np.swapaxes(by, -1, -2)), error) / 2)
    assert 0.75 < np.sqrt(np.mean(z2)) < 1.15


def test_a_marker_that_is_off_on_every_frame_widens_it():
    xyz = np.tile(points(10), (3, 1)) + np.repeat(np.arange(3), 10)[:, None] * (0.2, 0.0, 0.0)
    joint = np.tile(np.arange(10), 3)
    shared = np.random.default_rng(2).standard_normal((10, 2))[joint]
    J, miss = fitted(xyz, project(VIEW, xyz)[0] + 2 * shared)
    wide, plain = pnp.pose_covariance(J, miss, joint), pnp.pose_covariance(J, miss)
    np.testing.assert_allclose(wide, plain * (wide[0, 0] / plain[0, 0]))
    assert 2.0 < wide[0, 0] / plain[0, 0] < 3.2, "three frames with the same errors are worth one"


def test_the_best_next_mark_is_that_of_trying_all():
    xyz = points(8)
    J, miss = fitted(xyz, noisy(xyz, 1.0))
    spread = pnp.pose_covariance(J, miss)
    candidates = [pnp.Mark("walk", 0, f"M{i}", p) for i, p in enumerate(points(6, seed=3))]
    places = points(30, seed=4)
    mark, before, after = pnp.best_next(VIEW, spread, 1.0, candidates, places)

    def sigma(C):
        _, at = covariance.projection(VIEW, places)
        return np.sqrt(np.trace(at @ C @ np.swapaxes(at, -1, -2), axis1=1, axis2=2).mean() / 2)

    tried = []
    for candidate in candidates:
        _, more = covariance.projection(VIEW, candidate.xyz)
        tried.append(sigma(np.linalg.inv(np.linalg.inv(spread) + more.T @ more)))
    assert mark is candidates[int(np.argmin(tried))]
    assert (before, after) == (pytest.approx(sigma(spread)), pytest.approx(min(tried)))


def test_the_variance_of_a_click_is_between_the_usual_one_and_that_of_the_residuals():
    usual, worth = pnp.CLICK_SD_PX**2, pnp.CLICK_WORTH
    assert pnp.variance(np.zeros(6), 0) == pnp.variance(np.zeros(6), -2) == usual
    assert pnp.variance(np.full(106, 3.0), 100) == pytest.approx((worth * usual + 106 * 9) / (worth + 100))


def test_of_good_marks_hardly_one_set_in_a_hundred_has_a_suspect():
    random, found = np.random.default_rng(0), 0
    for _ in range(200):
        J, noise = random.normal(size=(40, 6)), random.normal(0, 1.5, 40)
        left = noise - J @ np.linalg.lstsq(J, noise, rcond=None)[0]
        found += pnp.suspect(J, left.reshape(20, 2)) is not None
    assert found <= 6


def test_the_next_mark_adds_its_information_to_the_pose():
    spread, sd_px = np.diag([1e-4, 2e-4, 1e-4, 4e-3, 1e-3, 2e-3]), 3.0
    mark = pnp.Mark("walk", 0, "LASI", np.array([0.1, 0.2, 1.0]))
    places = np.array([[0.5, 0.0, 0.2], [-0.5, 0.3, 1.5]])
    chosen, before, after = pnp.best_next(VIEW, spread, sd_px, [mark], places)
    (_, J), (_, at) = (covariance.projection(VIEW, x) for x in (mark.xyz[None], places))
    updated = np.linalg.inv(np.linalg.inv(spread) + J[0].T @ J[0] / sd_px**2)
    for sigma, C in ((before, spread), (after, updated)):
        assert sigma == pytest.approx(np.sqrt(np.mean([np.diag(x @ C @ x.T) for x in at])))
    assert chosen is mark
