"""Metric facts: residuals and derivatives against finite differences, and one measurement however many frames."""

import numpy as np
import pytest

from dior.calibrate.bundle import adjustment, bundle, facts, reduced
from dior.calibrate.bundle.uncertainty import Tracks
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import project
from dior.geometry.triangulation import triangulated
from tests.calibrate.test_adjust import HUBER, MOST, body, misplaced, seen, tape
from tests.rig import ring


def seen_by(camera, world):
    return project(camera, world)[0]


CAMERAS, POINTS = ring(3), body(6)
NONE = np.zeros((6, 3, 3))
SQUARE = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])
EACH = {
    "placed": facts.placed(1, bundle.Prior(CAMERAS[1].centre + 0.1, 0.05, CAMERAS[1].wRc, 0.5)),
    "cameras": facts.between_cameras(0, 2, 8.0, 0.02),
    "point": facts.to_point(1, [2, 3], 4.0, 0.02),
    "length": facts.length([(np.array([[0], [1]]), np.array([[2], [3]]), 0.7)], 0.5, 0.01),
    "middles": facts.length([(np.array([[0, 1]]), np.array([[2, 3]]), 1.0)], 0.5, 0.01),
    "tag": facts.tag(2, seen_by(CAMERAS[2], SQUARE) + 1.0, SQUARE, 0.3),
    "floor": facts.floor([0, 1, 2, 3], 0.03, 0.02, 0.02),
}


@pytest.mark.parametrize("name", EACH)
def test_derivatives_match_finite_differences(name):
    fact = EACH[name]
    row = fact(CAMERAS, POINTS, NONE)
    for view in range(3):
        for axis in range(6):
            ends = []
            for sign in (1, -1):
                cameras = list(CAMERAS)
                cameras[view] = covariance.moved(CAMERAS[view], sign * 1e-6 * np.eye(6)[axis])
                ends.append(fact(cameras, POINTS, NONE).residual)
            slope = (ends[0] - ends[1]) / 2e-6
            np.testing.assert_allclose(row.by_cameras[:, 6 * view + axis], slope, atol=1e-4, rtol=1e-5)
    if name == "floor":  # its directions turn with the points, which the derivative leaves out
        return
    for index in range(len(POINTS)):
        for axis in range(3):
            step = np.zeros_like(POINTS)
            step[index, axis] = 1e-6
            there, back = (fact(CAMERAS, POINTS + sign * step, NONE).residual for sign in (1, -1))
            expected = row.by_points[:, row.points == index, axis].sum(axis=1)
            np.testing.assert_allclose(expected, (there - back) / 2e-6, atol=1e-4, rtol=1e-5)


def test_a_length_takes_the_noise_across_it_off():
    random = np.random.default_rng(0)
    ends = np.array([(0, 0, 0), (0.4, 0, 0)]) + random.normal(0, 0.03, (4000, 2, 3))
    index = np.arange(8000).reshape(4000, 2)
    fact = facts.length([(index[:, :1], index[:, 1:], 1.0)], 0.4, 0.001)
    points, noise = ends.reshape(-1, 3), np.tile(0.03**2 * np.eye(3), (8000, 1, 1))
    assert fact.measured(CAMERAS, points, 0 * noise) > 0.403
    assert abs(fact.measured(CAMERAS, points, noise) - 0.4) < 0.0015


def walker(moments=60, height=1.75):
    """Joints (N, 3) of two legs and a trunk of which each keeps its length, and their tracks."""
    names = [f"{side}_{part}" for part in ("shoulder", "hip", "knee", "ankle", "heel") for side in ("left", "right")]
    up = np.repeat(np.array([0.818, 0.530, 0.285, 0.039, 0.0]) * height, 2)
    up[-2:] = facts.SOLE_M["left_heel"]
    wide = np.tile([0.1, -0.1], 5)
    body = np.stack([0 * up, wide, up], axis=-1)
    t = np.linspace(-1, 1, moments)
    place = np.stack([t, 0.6 * np.sin(3 * t), 0 * t], axis=-1)
    points = (body[None] + place[:, None]).reshape(-1, 3)
    moment, joint = (grid.ravel() for grid in np.mgrid[:moments, :10])
    return points, Tracks(joint, moment, 0 * moment, tuple(names))


def adjusted(known, marked=None, scale=1.04, sigma_m=0.3):
    """The adjustment of cameras that a tape puts `scale` times too far away, with facts."""
    points, tracks = walker()
    middle = np.array([0, 0, 1.0])
    far = [c.at(np.block([[c.wRc, (middle + scale * (c.centre - middle))[:, None]], [np.eye(4)[3:]]])) for c in ring(3)]
    return adjustment.adjust(
        far, seen(ring(3), points, 0.5), tape(far, sigma_m), HUBER, MOST, "s", tracks, known, marked
    )


def scale_of(done):
    return np.linalg.norm(done.cameras[0].centre - done.cameras[1].centre) / np.linalg.norm(
        ring(3)[0].centre - ring(3)[1].centre
    )


def test_without_a_fact_the_tape_decides_the_scale():
    assert abs(scale_of(adjusted([])) - 1.04) < 0.004


def test_facts_bring_the_scale_and_say_so():
    shin = facts.KeypointDistance(("left_knee", "left_ankle"), 0.246 * 1.75, 0.001)
    bar = np.array([(0.5, 0, 0.5), (0.5, 0, 1.5)])
    marked = facts.Marked(np.stack([seen_by(c, bar) for c in ring(3)]), ("a", "b"), ("walk", "walk"), 0.5)
    for known, marks in (
        ([shin], None),
        ([facts.ScaleBar((("a", "b"),), 1.0, 0.002)], marked),
        ([facts.Distance(("cam01", "cam02"), np.linalg.norm(ring(3)[0].centre - ring(3)[1].centre), 0.005)], None),
        ([facts.Stature(1.75, 0.0)], None),
        ([facts.Tag(SQUARE, {c.name: seen_by(c, SQUARE) for c in ring(3)}, 0.3)], None),
    ):
        done = adjusted(known, marks)
        # stature is known to 2.6 % here, against a tape that is known to 3.5 % and 4 % wrong
        tolerance = 0.02 if isinstance(known[0], facts.Stature) else 0.004
        assert abs(scale_of(done) - 1) < tolerance, known
    done = adjusted([shin])
    (fact, length), *_ = done.facts
    assert fact.name == "distance left_knee to left_ankle" and abs(length - 0.246 * 1.75) < 0.002


def test_more_frames_give_a_length_no_more_weight():
    """A length that contradicts the tape by the same number of sigmas ends in the middle, with 30 frames or 300."""
    ends = []
    for moments in (30, 300):
        points, tracks = walker(moments)
        fact = facts.KeypointDistance(("left_shoulder", "left_ankle"), 1.05 * 0.779 * 1.75, 0.02)
        done = adjustment.adjust(ring(3), seen(ring(3), points), tape(ring(3), 0.1), HUBER, MOST, "s", tracks, [fact])
        ends.append(scale_of(done))
    assert 1.01 < ends[0] < 1.04 and abs(ends[0] - ends[1]) < 0.003


def test_the_floor_brings_the_feet_down():
    points, tracks = walker()
    lifted = [covariance.moved(c, [0, 0, 0, 0, 0, 0.15]) for c in ring(3)]
    uv = seen(ring(3), points)
    for known, low in (([], 0.1), ([facts.Floor(0.005, 0.01)], -0.02)):
        done = adjustment.adjust(lifted, uv, tape(lifted, 0.1), HUBER, MOST, "s", tracks, known)
        feet = done.points[tracks.joint >= 8, 2].mean() - facts.SOLE_M["left_heel"]
        assert low - 0.01 < feet < low + 0.07


@pytest.mark.parametrize(
    ("fact", "message"),
    [
        (
            facts.KeypointDistance(("left_hipp", "left_knee"), 0.4, 0.01),
            "keypoint_distance: .* no joint 'left_hipp' .*'left_hip'",
        ),
        (
            facts.KeypointDistance(("left_hip", "left_knee"), 0.4, 0.01, (3,)),
            ".* at 0 instants of .* at least 10",
        ),
        (
            facts.Distance(("cam01", "post"), 4.0, 0.01),
            "distances: 'post' is no close camera and marked in fewer than two",
        ),
        (facts.Distance(("cam9", "cam01"), 4.0, 0.01), "distances: 'cam9' is no close camera of cam01, .*did you mean"),
        (facts.ScaleBar((("a", "b"),), 1.0, 0.01), "scale_bar: 'a' is marked in fewer than two"),
    ],
)
def test_a_fact_about_nothing_is_refused(fact, message):
    with pytest.raises(DiorError, match=f"s, session.yaml, {message}"):
        adjusted([fact])


def test_the_reduced_system_ends_where_gtsam_does():
    cameras, points = ring(3), body(200)
    uv, placed = seen(cameras, points, 2.0), misplaced(cameras)
    sigma = np.full(3, 4.0)
    there = adjustment.sampled(placed, uv, tape(placed), sigma, "s")
    found, _ = adjustment.metric(there, uv, triangulated(there, uv), tape(placed), sigma, None, (), None, "s")
    graph, _ = bundle.build(there, uv, found.points, tape(placed), sigma)
    _, values = bundle.build(found.cameras, uv, found.points, tape(placed), sigma)
    cost = found.linear.cost + sum(0.5 * row.residual @ row.residual for row in found.facts)
    assert graph.error(values) == pytest.approx(cost, rel=1e-9)
    assert cost - 0.005 < bundle.optimise(graph, values, "s").after < cost


def test_the_normal_matrix_is_the_schur_complement():
    cameras, points = ring(3), body(8)
    uv = np.stack([bundle.ideal_pixels(c.intrinsics, x) for c, x in zip(cameras, seen(cameras, points), strict=True)])
    linear = reduced.linearise(cameras, reduced.Observed(uv, np.full((3, 8), 2.0), 8), points)
    H, _ = reduced.equations(linear, [])
    full = np.zeros((18 + 24, 18 + 24))
    for v in range(3):
        for n in range(8):
            D = np.zeros((2, 42))
            D[:, 6 * v : 6 * v + 6], D[:, 18 + 3 * n : 21 + 3 * n] = linear.C[v, :, :, n], linear.J[v, :, :, n]
            full += D.T @ D
    schur = full[:18, :18] - full[:18, 18:] @ np.linalg.solve(full[18:, 18:], full[18:, :18])
    np.testing.assert_allclose(H, schur, atol=1e-6 * np.abs(schur).max())


def test_the_noise_of_detections_is_estimated_and_that_of_marks_is_believed():
    """Pixels are 1 px off where 2 px are assumed: a quarter of the variance, by the degrees that points leave over."""
    cameras, points = ring(3), body(300)
    uv = seen(cameras, points, 1.0)
    ideal = np.stack([bundle.ideal_pixels(c.intrinsics, x) for c, x in zip(cameras, uv, strict=True)])
    stated = [facts.placed(view, prior) for view, prior in enumerate(tape(cameras))]
    observed = reduced.Observed(ideal, np.full((3, 300), 2.0), detected=250)
    variance = reduced.solve(cameras, observed, points, stated).linear.variance
    assert variance[:250] == pytest.approx(0.25, rel=0.1)
    assert (variance[250:] == 1.0).all()


def test_a_fact_is_as_many_of_its_own_sigmas_off_as_was_measured():
    apart = np.linalg.norm(CAMERAS[0].centre - CAMERAS[2].centre)
    assert facts.between_cameras(0, 2, apart - 0.04, 0.02)(CAMERAS, POINTS, NONE).residual == pytest.approx([2.0])
    far = np.linalg.norm(POINTS[[2, 3]] - CAMERAS[1].centre, axis=1).mean()
    assert facts.to_point(1, [2, 3], far + 0.06, 0.02)(CAMERAS, POINTS, NONE).residual == pytest.approx([-3.0])
    sole = np.array([[0.0, 0, 0.07], [1, 0, 0.07], [0, 1, 0.07], [1, 1, 0.07]])
    assert facts.floor([0, 1, 2, 3], 0.03, 0.02, 0.02)(CAMERAS, sole, NONE).residual == pytest.approx([2.0, 0, 0])
    # a height counts by the share of it that is seen, and people differ in that share by 2 % of their height
    shin = [(np.array([[0]]), np.array([[1]]), 1.0)]
    assert facts.stature(shin, 1.75, 0.01).sigma == pytest.approx(np.hypot(facts.STATURE_SHARE * 0.01, 0.02 * 1.75))


def test_of_a_foot_the_lowest_quarter_stands_on_the_floor():
    """A foot on a floor that rises by 3 % is 5 cm high but for every fourth moment."""
    at = np.arange(80)
    height = 0.03 * at / 40 + 0.02 + np.where(at % 4, 0.05 + 0.001 * (at % 7), 0.0)
    found = facts.lowest(np.stack([at / 40, 0.1 * np.sin(at), height], axis=-1), 100 + at)
    assert found.tolist() == (100 + at[::4]).tolist()


def test_a_pixel_far_off_pulls_as_one_that_is_1_345_sigmas_off():
    """Huber's constant of 95 % efficiency, by the distance: 20 px off at a sigma of 2."""
    cameras, points = ring(3), body(8)
    uv = np.stack([bundle.ideal_pixels(c.intrinsics, x) for c, x in zip(cameras, seen(cameras, points), strict=True)])
    uv[0, 2] += (12.0, -16.0)
    uv[1, 3, 0] += 2.6
    linear = reduced.linearise(cameras, reduced.Observed(uv, np.full((3, 8), 2.0), 8), points)
    assert np.linalg.norm(linear.root[0, 2] * linear.r[0, :, 2]) == pytest.approx(1.345 / 2)
    assert linear.root[1, 3] == 0.5 and linear.r[1, 0, 3] == pytest.approx(-1.3)
    assert linear.cost == pytest.approx(1.345 * (10 - 1.345 / 2) + 1.3**2 / 2)
