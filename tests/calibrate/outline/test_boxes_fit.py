"""A camera fitted to boxes around a known body: analytic cases, the margin, an occluder, intervals."""

from dataclasses import replace

import numpy as np
import pytest

from dior.calibrate.outline import boxes_fit, seen_edges
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import Camera, Intrinsics, pose, project
from dior.geometry.multiview import look_at, rotation_z

LENS = Intrinsics(1280, 720, 760.0, 760.0, 639.5, 359.5)
FREE = seen_edges.Freedom(shift=(2.0, 0.0, 0.0))
START_M = 2.0


def true_camera():
    centre = np.array([0.0, 60.0, 1.9])
    turned = look_at(centre, (0.3, 0, 1.2)) @ rotation_z(np.radians(0.4))
    return Camera("cam04", LENS, pose(turned, centre), "long_range")


def start():
    camera = true_camera()
    centre = camera.centre + (0, START_M, 0)
    return camera.at(pose(look_at(centre, (-0.6, 0, 0.4)), centre))


def body(count=30):
    """Points (F, J, 3): feet that swing, hips, hands and a head, on a walk along X and a little along Y."""
    t = np.linspace(0, 12, count)
    middle = np.stack([2.5 * np.sin(0.5 * t), 0.8 * np.cos(0.5 * t), 0 * t], axis=-1)
    swing = 0.35 * np.sin(5.1 * t)
    zero = 0 * t
    parts = [
        (swing, zero + 0.1, zero + 0.05), (-swing, zero - 0.1, zero + 0.05), (zero, zero + 0.1, zero + 0.93),
        (zero, zero - 0.1, zero + 0.93), (-0.8 * swing, zero + 0.25, zero + 0.8),
        (0.8 * swing, zero - 0.25, zero + 0.8),
        (zero, zero + 0.2, zero + 1.4), (zero, zero - 0.2, zero + 1.4), (zero + 0.05, zero, zero + 1.7),
    ]  # fmt: skip
    return np.stack([middle + np.stack(part, axis=-1) for part in parts], axis=1)


def boxes(uv, margin=0.0, sd=0.0, seed=0):
    tight = np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1)
    return tight + boxes_fit.OUTWARDS * (margin + sd * np.random.default_rng(seed).standard_normal(tight.shape))


def seen(points, edges, clicks=None, bias_m=0.0):
    count, joints = points.shape[:2]
    clicks = np.full((count, joints, 2), np.nan) if clicks is None else clicks
    return seen_edges.EdgeObservations(points, edges, clicks, np.linspace(0, 20, count), np.zeros(count, int), bias_m)


def label_error(camera, points):
    return np.linalg.norm(project(camera, points)[0] - project(true_camera(), points)[0], axis=-1).mean()


def test_exact_boxes_give_the_camera_back():
    points = body()
    found = boxes_fit.fit(start(), FREE, seen(points, boxes(project(true_camera(), points)[0])), "cam04")
    assert label_error(found.camera, points) < 0.02
    assert abs(found.camera.centre[1] - 60) < 0.1 and found.agree.all() and found.camera.occluded == ""
    np.testing.assert_allclose(found.values[boxes_fit.MARGIN], 0, atol=0.05)


@pytest.mark.parametrize("margin", [1.0, 3.0])
def test_the_margin_is_found_and_does_not_move_the_camera(margin):
    points = body()
    found = boxes_fit.fit(start(), FREE, seen(points, boxes(project(true_camera(), points)[0], margin)), "cam04")
    np.testing.assert_allclose(found.values[boxes_fit.MARGIN], margin, atol=0.1)
    assert label_error(found.camera, points) < 0.05


def test_a_few_boxes_around_somebody_else_do_not_matter():
    points = body()
    edges = boxes(project(true_camera(), points)[0])
    edges[[3, 11, 20]] += 40
    found = boxes_fit.fit(start(), FREE, seen(points, edges), "cam04")
    assert label_error(found.camera, points) < 0.05
    assert not found.agree[[3, 11, 20]].any() and np.delete(found.agree, [3, 11, 20], axis=0).all()


def test_the_edge_of_a_wall_is_not_the_body():
    points = body()
    uv = project(true_camera(), points)[0]
    line = uv[:, 2:4, 1].mean()
    edges = boxes(np.where((uv[..., 1] < line)[..., None], uv, uv[:, 8:9]))
    edges[:, 3] = line
    found = boxes_fit.fit(start(), FREE, seen(points, edges), "cam04")
    assert found.camera.occluded == "below" and label_error(found.camera, points) < 0.1
    misled = boxes_fit.fit(start(), FREE, seen(points, edges), "cam04", occluder="none")
    assert label_error(misled.camera, points) > 1.0


def test_an_edge_that_hangs_on_a_limb_which_the_wall_cuts_is_not_used():
    """A forearm (joints 0 and 1) that reaches out and down behind the wall, so that the edge is where that cuts it."""
    points = np.zeros((6, 3, 3))
    points[:, 0], points[:, 1], points[:, 2] = (0.2, 0.0, 1.2), (0.8, 0.0, 0.8), (0.0, 0.0, 1.7)
    uv = project(true_camera(), points)[0]
    assert (uv[:, 1, 0] < uv[:, 0, 0]).all() and (uv[:, 0, 0] < uv[:, 2, 0]).all()
    cut = uv[:, :2].mean(axis=1)
    edges = np.stack([cut[:, 0], uv[:, 2, 1], uv[:, 2, 0], cut[:, 1]], axis=1)
    for bones, used in ((np.zeros((0, 2), int), 1), (np.array([[0, 1]]), 0)):
        given = replace(seen(points, edges), bones=bones)
        reading = boxes_fit.Reading(true_camera(), FREE, given, "below")
        assert (reading.rows().kind == 0).any() == used


@pytest.mark.parametrize("wall", [False, True])
def test_a_wall_that_few_careless_boxes_do_not_show_is_doubted_and_in_sigma(wall):
    """Where a person is 11 px tall and edges have an sd of 1 px, half a person looks much like a whole one."""
    half = replace(LENS, fx=380.0, fy=380.0)
    truth = replace(true_camera(), intrinsics=half)
    points = body(10)
    uv = project(truth, points)[0]
    shown = np.where((uv[..., 1] < uv[:, 2:3, 1])[..., None], uv, uv[:, 8:9]) if wall else uv
    for seed in range(5):
        edges = boxes(shown, 3.0, 0.0)
        if wall:
            edges[:, 3] = uv[:, 2:4, 1].mean() + 3.0
        edges += np.random.default_rng(seed).standard_normal(edges.shape)
        found = boxes_fit.fit(replace(start(), intrinsics=half), FREE, seen(points, edges), "cam04")
        off = np.abs(project(found.camera, points)[0] - uv)[..., 1].mean()
        _, J = covariance.projection(found.camera, points)
        sigma = np.sqrt((J @ found.pose_covariance @ np.swapaxes(J, -1, -2))[..., 1, 1]).mean()
        doubted = found.ahead < boxes_fit.DOUBTFUL
        assert not doubted or wall
        assert off < 3 * sigma and (doubted or found.camera.occluded or off < 1.0)


def test_clicked_head_and_feet_do_as_well():
    points = body(8)
    uv = project(true_camera(), points)[0]
    clicks = np.full(uv.shape, np.nan)
    clicks[:, [0, 1, 8]] = uv[:, [0, 1, 8]]
    found = boxes_fit.fit(start(), FREE, seen(points, np.full((8, 4), np.nan), clicks), "cam04")
    assert label_error(found.camera, points) < 0.02


def test_a_focal_length_that_may_change_is_found():
    points = body()
    camera = boxes_fit.with_parameters(true_camera(), np.eye(3), np.array([0, 0, 0, 0, 0, 0, np.log(1.02), 0, 0]))
    edges = boxes(project(camera, points)[0])
    known = true_camera()
    found = boxes_fit.fit(known, seen_edges.Freedom(shift=(0, 0, 0), focal=0.1), seen(points, edges), "cam04")
    assert found.camera.intrinsics.fx == pytest.approx(1.02 * 760, rel=2e-3)
    np.testing.assert_allclose(found.camera.centre, known.centre, atol=1e-9)


@pytest.mark.slow
def test_intervals_hold_over_many_drawings():
    """Labels' errors in units of their stated sigma, 40 sets of boxes with independent edges."""
    points = body(40)
    uv = project(true_camera(), points)[0]
    chi2 = []
    for seed in range(40):
        found = boxes_fit.fit(start(), FREE, seen(points, boxes(uv, 1.0, 1.0, seed)), "cam04", occluder="none")
        _, J = covariance.projection(found.camera, points[::8])
        spread = J @ found.pose_covariance @ np.swapaxes(J, -1, -2)
        error = project(found.camera, points[::8])[0] - uv[::8]
        chi2.append(np.einsum("...i,...ij,...j", error, np.linalg.inv(spread), error).mean() / 2)
    assert 0.8 < np.sqrt(np.mean(chi2)) < 1.25


def test_a_bias_of_the_joints_widens_the_intervals():
    points = body()
    edges = boxes(project(true_camera(), points)[0], 0.0, 0.5)
    without, with_bias = (boxes_fit.fit(start(), FREE, seen(points, edges, bias_m=b), "cam04") for b in (0.0, 0.025))
    grown = np.diagonal(with_bias.covariance) - np.diagonal(without.covariance)
    assert (grown[:3] > 0).all()
    # the head alone decides the upper edge: a bias of 2.5 cm there turns the camera by half of it at 60 m
    assert np.sqrt(grown[0]) == pytest.approx(0.5 * 0.025 * np.sqrt(1 + 1 / 4) / 60, rel=0.5)


def test_edges_that_are_further_out_in_every_box_are_in_the_covariance_as_a_tilt_and_a_pan():
    points = body()
    edges = boxes(project(true_camera(), points)[0], 1.0, 0.5)
    without, habit = (
        boxes_fit.fit(start(), replace(FREE, habit_px=h), seen(points, edges), "cam04") for h in (0.0, 0.5)
    )
    np.testing.assert_array_equal(without.values, habit.values)
    grown = np.sqrt(np.diagonal(habit.covariance) - np.diagonal(without.covariance))
    # half the difference of two edges, and half their sum, of 0.5 px each; f is 760 px
    np.testing.assert_allclose(grown[:2], 0.5 / np.sqrt(2) / 760, rtol=0.1)
    np.testing.assert_allclose(grown[boxes_fit.MARGIN], 0.5 / np.sqrt(2), rtol=0.15)


@pytest.mark.parametrize(("sides", "turn"), [((1, 3), 0), ((0, 2), 1)])
def test_the_unequal_part_of_a_habit_turns_the_camera_by_half_of_it(sides, turn):
    points = body()
    edges = boxes(project(true_camera(), points)[0])
    edges[:, sides[0]] -= 1.0
    found, plain = (
        boxes_fit.fit(start(), FREE, seen(points, e), "cam04", occluder="none")
        for e in (edges, boxes(project(true_camera(), points)[0]))
    )
    assert abs(found.values[turn] - plain.values[turn]) * 760 == pytest.approx(0.5, abs=0.05)


def test_a_habit_counts_once_where_a_wall_leaves_one_edge_of_an_axis():
    """The upper edge alone tells the tilt: its habit, and what parts the margins of u and v beside habits."""
    points, random = body(), np.random.default_rng(4)
    split, habit = 0.3, 0.5
    free = replace(FREE, shift=(0, 0, 0), margin_split_px=float(np.hypot(split, habit)), habit_px=habit)
    uv = project(true_camera(), points)[0]
    line = (uv[:, :2, 1].mean() + uv[:, 2:6, 1].max()) / 2
    above, off = np.where((uv[..., 1] < line)[..., None], uv, uv[:, 8:9]), []
    for seed in range(80):
        margins = 2.0 + split / np.sqrt(2) * random.standard_normal(2)
        outwards = margins[boxes_fit.AXIS] + habit * random.standard_normal(4)
        edges = boxes(above, outwards)
        edges[:, 3] = line + outwards[3]
        edges += np.random.default_rng(seed).standard_normal(edges.shape)
        found = boxes_fit.fit(true_camera(), free, seen(points, edges), "cam04", occluder="below")
        off.append(found.values[0] / np.sqrt(found.covariance[0, 0]))
    assert 0.85 < np.sqrt(np.mean(np.square(off))) < 1.15


def test_an_outline_that_lies_further_out_is_in_the_covariance():
    points = body()
    edges = boxes(project(true_camera(), points)[0], 0.0, 0.5)
    without, unknown = (
        boxes_fit.fit(start(), FREE, replace(seen(points, edges), outline_m=m), "cam04") for m in (0.0, 0.02)
    )
    grown = np.sqrt(np.diagonal(unknown.covariance) - np.diagonal(without.covariance))
    # crown and soles by 2 cm each, 60 m away; beside, each side of the body has its own
    assert grown[0] == pytest.approx(0.02 / 60 / np.sqrt(2), rel=0.1)
    assert 0 < grown[1] < 0.02 / 60 / np.sqrt(2)


def test_the_camera_follows_a_world_that_is_shifted():
    """Close cameras that are all off by the same put the points there: dθ of the fit says where this one goes."""
    points = body()
    edges = boxes(project(true_camera(), points)[0])
    derivative = np.zeros((*points.shape, 6))
    derivative[..., 3:] = np.eye(3)
    found = boxes_fit.fit(start(), FREE, seen(points, edges), "cam04", derivative)
    shift = np.array([0.02, 0.0, 0.03])
    again = boxes_fit.fit(start(), FREE, seen(points + shift, edges), "cam04", derivative)
    expected = found.by_cameras @ np.concatenate([np.zeros(3), shift])
    np.testing.assert_allclose((again.values - found.values)[:2], expected[:2], rtol=0.05, atol=2e-6)


def test_too_few_edges_are_refused():
    points = body(1)
    with pytest.raises(DiorError, match="cam04: 4 usable edges"):
        boxes_fit.fit(start(), FREE, seen(points, boxes(project(true_camera(), points)[0])), "cam04")


def test_a_margin_of_each_axis_and_the_flesh_around_the_joints():
    """Boxes that are 1 px too wide on each side, 3 px too high, around limbs 10 cm thick."""
    points = body()
    uv, depth = project(true_camera(), points)
    out = (760.0 * 0.1 / depth)[..., None] * [1, 1]
    tight = np.concatenate([(uv - out).min(axis=1), (uv + out).max(axis=1)], axis=1)
    shown = replace(seen(points, tight + boxes_fit.OUTWARDS * (1.0, 3.0, 1.0, 3.0)), flesh_m=np.full(9, 0.1))
    found = boxes_fit.fit(start(), replace(FREE, margin_split_px=5.0), shown, "cam04")
    np.testing.assert_allclose(found.values[boxes_fit.MARGIN], (1.0, 3.0), atol=0.1)
    assert label_error(found.camera, points) < 0.05


def test_three_pictures_at_once_with_the_same_errors_tell_as_much_as_one():
    points, each = body(20), np.repeat(np.arange(20), 3)
    edges = boxes(project(true_camera(), points)[0], 1.0, 1.0, seed=2)
    alone = boxes_fit.fit(start(), FREE, replace(seen(points, edges), seconds=np.arange(20) * 1.5), "cam04")
    thrice = replace(seen(points[each], edges[each]), seconds=each * 1.5 + 0.01 * np.tile(np.arange(3), 20))
    found = boxes_fit.fit(start(), FREE, thrice, "cam04")
    assert alone.inflation < 1.5 < found.inflation
    ratio = np.diagonal(found.covariance)[:2] / np.diagonal(alone.covariance)[:2]
    assert (0.7 < ratio).all() and (ratio < 1.4).all(), "independent pictures would have a third of the variance"


def test_a_walk_without_a_box_has_no_middle():
    nothing = np.zeros((2, 1, 3)), np.zeros((2, 4)), np.zeros((2, 1, 2))
    seen = seen_edges.EdgeObservations(*nothing, seconds=np.array([1.0, 2.0]), walk=np.array([1, 1]))
    assert (seen.middle_s(0), seen.middle_s(1)) == (0.0, 1.5)


def test_a_reading_that_comes_to_nothing_is_left_out(monkeypatch):
    points, solve = body(), boxes_fit.Reading.solve
    edges = boxes(project(true_camera(), points)[0])
    alone = boxes_fit.fit(start(), FREE, seen(points, edges), "cam04", occluder="none")

    def failing(hides):
        def of(reading, where):
            if reading.hides in hides:
                raise DiorError(f"{where}: nothing")
            return solve(reading, where)

        return of

    monkeypatch.setattr(boxes_fit.Reading, "solve", failing(("below", "above")))
    found = boxes_fit.fit(start(), FREE, seen(points, edges), "cam04")
    np.testing.assert_array_equal(found.values, alone.values)
    monkeypatch.setattr(boxes_fit.Reading, "solve", failing(("", "below", "above")))
    with pytest.raises(DiorError, match="cam04: nothing"):
        boxes_fit.fit(start(), FREE, seen(points, edges), "cam04")


def test_a_fit_that_has_no_edge_left_is_refused_and_no_number():
    points = body()
    edges = boxes(project(true_camera(), points)[0])
    reading = boxes_fit.Reading(start(), FREE, seen(points, edges), "")
    reading.visible = lambda uv: (*np.zeros((2, *uv.shape[:2]), bool), np.zeros(len(uv), bool))
    with pytest.raises(DiorError, match="no edge or click is where the 3D goes"):
        reading.solve("cam04")
