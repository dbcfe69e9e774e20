"""Bundle adjustment on a simulated ring of cameras: what it recovers, what it reports and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import rolls
from dior.calibrate import adjust as step
from dior.calibrate.bundle import adjustment, bundle
from dior.calibrate.bundle.outcome import Adjusted, check_end, in_front, shift_and_turn, whole_body_off
from dior.calibrate.bundle.uncertainty import Tracks
from dior.calibrate.lens import realsense
from dior.errors import DiorError
from dior.geometry.camera import pose, project, reprojection_errors
from dior.geometry.multiview import look_at, similarity
from tests.cases import some
from tests.rig import camera as looking_in
from tests.rig import ring

HUBER, MOST = 15.0, 12.0


def tape(cameras, sigma_m=0.05):
    return [bundle.Prior(camera.centre, sigma_m, camera.wRc, np.radians(30)) for camera in cameras]


def body(count=400, seed=0):
    """Points (N, 3) of a person of 1.75 m who walks about."""
    rng = np.random.default_rng(seed)
    walked = rng.uniform(-1.2, 1.2, (count, 1)) * (1, 0.3, 0)
    return walked + rng.uniform((-0.3, -0.2, 0.05), (0.3, 0.2, 1.75), (count, 3))


def seen(cameras, points, sigma_px=0.0, seed=0):
    uv = np.stack([project(camera, points)[0] for camera in cameras])
    return uv + np.random.default_rng(seed).normal(0, sigma_px, uv.shape) if sigma_px else uv


def misplaced(cameras, sigma_m=0.05, aim_m=0.3, seed=0):
    """The cameras from a tape that is `sigma_m` off, looking at a target that is `aim_m` off."""
    rng = np.random.default_rng(seed)
    placed = []
    for camera in cameras:
        centre = camera.centre + rng.normal(0, sigma_m, 3)
        placed.append(camera.at(pose(look_at(centre, np.array([0, 0, 1]) + rng.normal(0, aim_m, 3)), centre), "tape"))
    return placed


def test_without_noise_the_cameras_are_recovered_up_to_the_gauge():
    cameras, points = ring(3), body()
    placed = misplaced(cameras)
    done = adjustment.adjust(placed, seen(cameras, points), tape(placed, 10.0), HUBER, MOST, "s")
    assert np.nanmean(done.after_px) < 1e-3 < np.nanmean(done.before_px)
    s, R, t = similarity(done.points, points)
    assert np.linalg.norm(s * done.points @ R.T + t - points, axis=1).max() < 1e-3
    for found, true in zip(done.cameras, cameras, strict=True):
        np.testing.assert_allclose(s * R @ found.centre + t, true.centre, atol=1e-3)
        np.testing.assert_allclose(R @ found.wRc, true.wRc, atol=1e-4)


def test_exact_placement_without_noise_stays_where_it_is():
    cameras, points = ring(3), body()
    done = adjustment.adjust(cameras, seen(cameras, points), tape(cameras), HUBER, MOST, "s")
    for found, true in zip(done.cameras, cameras, strict=True):
        np.testing.assert_allclose(found.wTc, true.wTc, atol=1e-9)


@pytest.mark.parametrize("seed", some(range(5), 0))
@pytest.mark.parametrize("count", [3, 4])
def test_the_demo_s_tape_and_aim_reach_the_noise(seed, count):
    cameras, points = ring(count), body()
    placed = misplaced(cameras, seed=seed)
    done = adjustment.adjust(placed, seen(cameras, points, 2.0, seed), tape(placed), HUBER, MOST, "s")
    # 2 px of noise per axis is 2.5 px of distance, less what the points take up
    assert np.nanmean(done.after_px) < 2.3 and np.nanmean(done.before_px) > 5
    _, R, t = similarity(done.points, points, scale=False)
    assert np.linalg.norm(done.points @ R.T + t - points, axis=1).mean() < 0.05


def with_wrong_person(uv, share, by_px=(90.0, 30.0)):
    """Detections (V, N, 2) of which the second camera has the first `share` (at a moment each) of somebody else."""
    uv = uv.copy()
    count = int(share * uv.shape[1])
    uv[1, :count] += by_px
    return uv


@pytest.mark.slow
def test_another_person_in_one_camera_does_not_move_the_cameras():
    cameras, points = ring(3), body()
    placed, uv = misplaced(cameras), seen(cameras, points, 2.0)
    clean = adjustment.adjust(placed, uv, tape(placed), HUBER, MOST, "s")
    done = adjustment.adjust(placed, with_wrong_person(uv, 0.12), tape(placed), HUBER, MOST, "s")
    assert clean.disagreeing < 0.005 and 0.03 < done.disagreeing < 0.13
    assert np.nanmean(done.after_px) < 2.4
    for found, true in zip(done.cameras, clean.cameras, strict=True):
        distance, angle = shift_and_turn(true, found)
        assert distance < 0.02 and angle < 0.4


def test_cameras_that_mostly_see_another_person_are_refused():
    cameras, points = ring(3), body()
    uv = seen(cameras, points, 2.0)
    uv[0] += np.random.default_rng(1).uniform(-200, 200, (len(points), 1)) * (1, 0.5)
    refused(cameras, uv, "session field: (.* detections disagree|the adjustment ends at a mean)")


def test_two_cameras_keep_to_their_tape_and_horizon():
    cameras, points = ring(2, radius=4), body()
    cameras[1] = ring(5, radius=4)[1]
    placed = misplaced(cameras, 0.02, 0.05)
    done = adjustment.adjust(placed, seen(cameras, points, 1.0), tape(placed, 0.02), HUBER, MOST, "s")
    for found, true in zip(done.cameras, cameras, strict=True):
        assert np.linalg.norm(found.centre - true.centre) < 0.1


@pytest.mark.slow
def test_a_tighter_tape_moves_less():
    cameras, points = ring(3), body()
    placed = misplaced(cameras)
    shifts = []
    for sigma in (0.001, 0.05):
        done = adjustment.adjust(placed, seen(cameras, points, 2.0), tape(placed, sigma), HUBER, MOST, "s")
        shifts.append(max(shift_and_turn(a, b)[0] for a, b in zip(placed, done.cameras, strict=True)))
    assert shifts[0] < 0.02 < shifts[1]


@pytest.mark.slow
def test_gross_outliers_hardly_matter():
    cameras, points = ring(4), body(600)
    uv = seen(cameras, points, 2.0)
    rng = np.random.default_rng(1)
    wrong = rng.random(uv.shape[:2]) < 0.05
    off = uv + wrong[..., None] * rng.choice([-1, 1], uv.shape) * rng.uniform(30, 80, uv.shape)
    placed = misplaced(cameras)
    clean, dirty = (adjustment.adjust(placed, x, tape(placed), HUBER, 20.0, "s") for x in (uv, off))
    for a, b in zip(clean.cameras, dirty.cameras, strict=True):
        distance, angle = shift_and_turn(a, b)
        assert distance < 0.02 and angle < 0.4


def test_residuals_are_in_recorded_pixels():
    cameras, points = ring(3), body()
    done = adjustment.adjust(cameras, seen(cameras, points, 2.0), tape(cameras), HUBER, MOST, "s")
    expected = np.linalg.norm(seen(done.cameras, done.points) - seen(cameras, points, 2.0), axis=-1)
    np.testing.assert_allclose(done.after_px, expected, atol=1e-9)


def test_joints_that_not_all_see_take_part_and_the_unseen_stay_nan():
    cameras, points = ring(4), body()
    uv = seen(cameras, points)
    uv[0, :100] = np.nan
    uv[1:, 399] = np.nan
    done = adjustment.adjust(misplaced(cameras), uv, tape(misplaced(cameras)), HUBER, MOST, "s")
    assert done.left_out == 1 and np.isnan(done.points[399]).all() and np.isnan(done.after_px[0, :100]).all()
    assert np.isfinite(done.after_px[1, :100]).all()


def test_points_behind_a_camera_at_the_start_are_counted_or_brought_back():
    cameras, points = ring(4), body()
    points[0] = (60.0, 60.0, 1.0)
    uv = seen(cameras, points)
    uv[:, 0] = 640, 360
    assert not in_front(cameras, np.full_like(uv, 640), 10 * cameras[0].centre[None] + 0 * points).any()
    done = adjustment.adjust(misplaced(cameras), uv, tape(misplaced(cameras)), HUBER, MOST, "s")
    assert done.left_out <= 1 and np.nanmedian(done.after_px) < 0.1


@pytest.mark.slow
def test_it_is_byte_stable():
    cameras, points = ring(4), body()
    placed, uv = misplaced(cameras), seen(cameras, points, 2.0)
    runs = [adjustment.adjust(placed, uv, tape(placed), HUBER, MOST, "s") for _ in range(3)]
    assert len({np.stack([c.wTc for c in run.cameras]).tobytes() + run.points.tobytes() for run in runs}) == 1


@pytest.mark.slow
def test_the_limit_scales_with_the_focal_length():
    cameras, points = ring(3), body()
    uv = seen(cameras, points, 6.0)
    mean = np.nanmean(adjustment.adjust(cameras, uv, tape(cameras), HUBER, 100.0, "s").after_px)
    limit = mean * 1680 / 640
    adjustment.adjust(cameras, uv, tape(cameras), HUBER, limit * 1.001, "s")
    with pytest.raises(DiorError, match=r"session x: .* ends at a mean of \d.* \(cam01 .*adjust.max_mean_px"):
        adjustment.adjust(cameras, uv, tape(cameras), HUBER, limit * 0.999, "session x")


def test_the_worst_camera_is_named_where_the_adjustment_ends_too_high():
    """The second camera's pixels are noisy; the third's are, too, by half, but count less for its focal length."""
    cameras, points = ring(3), body()
    cameras[2] = looking_in("cam03", cameras[2].centre, fx=1280.0)
    noise = np.array([1.0, 6.0, 7.0])[:, None, None] * np.random.default_rng(0).normal(size=(3, len(points), 2))
    with pytest.raises(
        DiorError, match=r"ends at a mean of .* \(cam01 \d.*, cam02 \d.*\), above .* first cam02, which"
    ):
        adjustment.adjust(cameras, seen(cameras, points) + noise, tape(cameras), HUBER, 2.0, "s")


def test_guessed_limbs_lift_the_mean_and_refuse_nothing_where_the_body_is_in_its_place():
    cameras, rng = ring(3), np.random.default_rng(3)
    points = body(500)
    tracks = Tracks(np.tile(np.arange(20), 25), np.repeat(np.arange(25), 20), np.zeros(500, int), tuple("j" * 20))

    def ended(uv):
        errors = reprojection_errors(cameras, points, uv)
        return Adjusted(cameras, points, errors, errors, 0.0, 1, tracks=tracks)

    true = seen(cameras, points, 2.0)
    guessed = true + np.where(np.arange(500) % 20 < 6, 30.0, 0.0)[:, None] * rng.normal(size=true.shape)
    done = ended(guessed)
    assert np.nanmean(done.after_px) > MOST
    assert whole_body_off(done, guessed) < 2.0
    check_end(done, guessed, MOST, "s")
    # as large a mean, of a world that is not the cameras'
    bent = true + np.where(np.arange(500) // 20 % 2, 10.0, -10.0)[:, None]
    assert whole_body_off(ended(bent), bent) == pytest.approx(10 * np.sqrt(2), rel=0.05)
    with pytest.raises(DiorError, match="ends at a mean of"):
        check_end(ended(bent), bent, MOST, "s")
    # of joints that are not known nothing tells the two apart
    with pytest.raises(DiorError, match="ends at a mean of"):
        check_end(replace(done, tracks=None), guessed, MOST, "s")


def refused(cameras, uv, message):
    with pytest.raises(DiorError, match=message):
        adjustment.adjust(cameras, uv, tape(cameras), HUBER, MOST, "session field")


def test_priors_come_from_the_tape_or_the_placement():
    camera = ring(1)[0]
    measured = {"tape": {"position_m": [1, 2, 3], "sigma_m": 0.02}}
    for locate, settings, position, sigma_m, turn in (
        ("tape", measured, [1, 2, 3], 0.02, 30),
        ("reference", measured, [1, 2, 3], 0.02, 2),
        ("reference", {}, camera.centre, 0.05, 2),
    ):
        prior = step.prior_of(camera.at(camera.wTc, locate), settings)
        np.testing.assert_array_equal(prior.position, position)
        assert (prior.sigma_m, prior.sigma_rad) == (sigma_m, np.radians(turn))
        np.testing.assert_array_equal(prior.wRc, camera.wRc)


def test_two_cameras_at_the_same_place_are_named():
    cameras, points = ring(3), body()
    cameras[2] = cameras[2].at(pose(cameras[2].wRc, cameras[0].centre + (0.009, 0, 0)))
    refused(cameras, seen(cameras, points), "session field: cam01 and cam03 are at the same place")


def test_a_camera_below_the_floor_is_refused():
    cameras = ring(3, height=1.5)
    cameras[1] = cameras[1].at(pose(cameras[1].wRc, cameras[1].centre - (0, 0, 2)))
    refused(cameras, seen(cameras, body()), "session field, cam02: the camera is 0.50 m below the floor")


def test_one_camera_and_no_joints_are_refused():
    refused(ring(3)[:1], seen(ring(3)[:1], body()), "1 close camera; .* at least 2")
    refused(ring(3), np.empty((3, 0, 2)), "no joint is seen by enough cameras")


def looks_away():
    cameras, points = ring(3), body()
    away = cameras[1].centre * (2, 2, 1)
    return [*cameras[:1], cameras[1].at(pose(look_at(cameras[1].centre, away), cameras[1].centre)), cameras[2]], points


def test_a_camera_that_looks_away_is_brought_back_by_the_keypoints():
    placed, points = looks_away()
    done = adjustment.adjust(placed, seen(ring(3), points, 1.0), tape(placed), HUBER, MOST, "s")
    assert [one.name for one in done.starts if not one.cameras][0] == "as placed"
    for found, true in zip(done.cameras, ring(3), strict=True):
        distance, angle = shift_and_turn(true, found)
        assert distance < 0.1 and angle < 2


def test_a_camera_that_looks_away_is_named_where_the_keypoints_are_too_few():
    placed, points = looks_away()
    uv = seen(ring(3), points[:20])
    refused(placed, uv, "0 of 20 joints in front of them, without cam02 it would be 20")


def test_cameras_that_share_no_joints_are_named():
    cameras, points = ring(4), body()
    uv = seen(cameras, points)
    uv[:2, :200], uv[2:, 200:] = np.nan, np.nan
    refused(cameras, uv, "cam03, cam04 shares no joints with cam01")


def test_poor_tape_held_too_tight_is_refused():
    """Cameras that may turn but not move cannot explain the pixels."""
    cameras, points = ring(4), body()
    placed = misplaced(cameras, 0.8, seed=2)
    with pytest.raises(DiorError, match="above the limit of 4.6 px"):
        adjustment.adjust(placed, seen(cameras, points, 2.0), tape(placed, 0.0005), HUBER, MOST, "s")


def test_at_the_papers_size():
    cameras, points = ring(3), body(400 * 33)
    placed = misplaced(cameras)
    done = adjustment.adjust(placed, seen(cameras, points, 2.0), tape(placed), HUBER, MOST, "s")
    assert np.nanmean(done.after_px) < 1.8


@pytest.mark.parametrize("named", ["plumb_bob", "inverse_brown_conrady"])
def test_the_joints_tell_a_realsense_its_lens_model(named):
    """The pixels are those of a plumb_bob lens; what a person names is the same or the other."""
    cameras = ring(4, radius=3.0)
    uv = seen(cameras, body(600), 0.3)
    if named != "plumb_bob":
        cameras = [*map(realsense.as_other, cameras[:3]), cameras[3]]
    done = adjustment.adjust(cameras, uv, tape(cameras), HUBER, MOST, "s")
    yamls = {camera.name: f"{camera.name}.yaml" for camera in cameras}
    topics = dict.fromkeys(yamls, "/cam/color/image_raw") | {"cam04": "/cam/image"}
    found = step._lens_models("field", yamls, topics, done, uv, tape(cameras), HUBER)
    wanted = ("info", "lens_models") if named == "plumb_bob" else ("warning", "lens_model_doubtful")
    assert [(scope, *rest) for scope, *rest, _ in found] == [(f"field/cam0{i}", *wanted) for i in (1, 2, 3)]
    assert f"with the lens as {named}" in found[0][3]


@pytest.mark.slow
@pytest.mark.parametrize("roll_deg", rolls.QUARTERS)
@pytest.mark.parametrize(("level", "seed"), [("ideal", 1), ("real", 2)])
def test_a_camera_that_hangs_turned_is_named_and_placed_as_well(level, seed, roll_deg):
    """One of three; `python -m benchmarks.rolls` has 20 seeds a level."""
    named, metres, degrees, held = rolls.taped(seed, level, roll_deg)
    _, upright_m, upright_deg, _ = rolls.taped(seed, level, 0)
    assert named and held and metres < 1.5 * upright_m + 0.02 and degrees < 1.5 * upright_deg + 0.2
