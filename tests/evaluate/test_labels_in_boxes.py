"""Label boxes and hand boxes: known overlaps and offsets, and the share of perfect labels against a simulation."""

from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.evaluate import labels_in_boxes
from dior.evaluate.grids import LabelGrid
from dior.geometry.camera import occluded_edge, pose, project
from dior.geometry.multiview import rotation_z
from dior.project import boxes
from tests.cases import some
from tests.report.conftest import rig, walk

FRAMES = 400


def grid_of(uv, in_frame=None):
    count, joints = uv.shape[:2]
    in_frame = np.ones((count, joints), bool) if in_frame is None else in_frame
    uv = np.where(in_frame[..., None], uv, np.nan)
    names = [f"joint_{i}" for i in range(joints)]
    return LabelGrid("cam04", np.arange(count), np.arange(count), names, uv, in_frame, np.zeros((count, joints), bool))


def figure(grid, hand, metric):
    return next(values for name, _, values in labels_in_boxes.figures(grid, hand) if name == metric)


SQUARE = np.array([[[10.0, 20.0], [14.0, 30.0], [12.0, 25.0]]])


def test_label_box_holds_the_in_frame_labels():
    uv = np.repeat(SQUARE, 3, axis=0)
    in_frame = np.ones((3, 3), bool)
    in_frame[1, 1] = False
    in_frame[2] = False
    found = labels_in_boxes.label_boxes(grid_of(uv, in_frame))
    np.testing.assert_array_equal(found[:2], [[10, 20, 14, 30], [10, 20, 12, 25]])
    assert np.isnan(found[2]).all()


def test_offsets_are_label_minus_hand_and_have_a_sign():
    hand = np.array([[9.0, 16.0, 17.0, 28.0]])
    grid = grid_of(SQUARE)
    assert figure(grid, hand, "box_offset_u") == -1.0
    assert figure(grid, hand, "box_offset_v") == 3.0
    assert figure(grid, hand, "box_width_difference") == -4.0
    assert figure(grid, hand, "box_height_difference") == -2.0


@pytest.mark.parametrize(
    "hand, share",
    [
        ((10, 20, 14, 30), 1.0),
        ((12, 20, 16, 30), 1 / 3),
        ((14, 20, 18, 30), 0.0),
        ((0, 0, 5, 5), 0.0),
        ((8, 15, 16, 35), 0.25),
    ],
)
def test_iou_of_boxes_with_known_overlap(hand, share):
    assert figure(grid_of(SQUARE), np.array([hand], float), "box_iou")[0, 0] == pytest.approx(share)


def test_frames_without_a_box_are_not_judged():
    grid = grid_of(np.repeat(SQUARE, 4, axis=0))
    hand = labels_in_boxes.of_frames(grid, np.array([1, 2, 3]), np.array([[9.0, 19.0, 15.0, 31.0]] * 3))
    for name, _, values in labels_in_boxes.figures(grid, hand):
        if name.startswith("held_back"):
            assert np.isnan(values).all()  # 3 boxes are too few to keep any back
            continue
        assert np.isnan(values[0]).all() and np.isfinite(values[1:]).all()


def test_boxes_that_are_kept_back_are_the_same_wherever_others_are_drawn():
    many, few = np.arange(0, 1000, 2), np.arange(0, 1000, 10)
    kept = set(many[boxes.kept_back(many)].tolist())
    assert set(few[boxes.kept_back(few)].tolist()) == kept & set(few.tolist())
    assert 0.15 < len(kept) / len(many) < 0.25
    assert not boxes.kept_back(np.arange(14)).any() and boxes.kept_back(np.arange(15)).any()


def test_only_boxes_that_are_kept_back_are_held_back_figures():
    grid = grid_of(np.repeat(SQUARE, 40, axis=0))
    kept = boxes.kept_back(np.arange(40))
    # in those, labels 10 px high lie 2 px right and 1 px below the middle of a box, one of three inside
    hand = np.where(kept[:, None], [[8.0, 22.0, 12.0, 26.0]], [[9.0, 19.0, 15.0, 31.0]])
    found = {name: values for name, _, values in labels_in_boxes.figures(grid, hand) if "held_back" in name}
    assert set(found) == {f"held_back_{name}" for name in ("share", "expected", "offset_u", "offset_v")}
    for values in found.values():
        assert (np.isfinite(values).all(axis=1) == kept).all()
    assert np.nanmean(found["held_back_share"]) == pytest.approx(1 / 3)
    assert np.nanmean(found["held_back_offset_u"]) == pytest.approx(2 / 10)
    assert np.nanmean(found["held_back_offset_v"]) == pytest.approx(1 / 10)


def test_how_large_boxes_are_drawn_does_not_change_by_how_much_labels_lie_beside_them():
    grid, kept = grid_of(np.repeat(SQUARE, 40, axis=0) + (1.5, 0.0)), np.ones(40, bool)
    for margin in (-1.0, 0.0, 5.0):
        hand = np.repeat([[10.0, 20.0, 14.0, 30.0]], 40, axis=0) + margin * np.array([-1, -1, 1, 1])
        found = {name: values for name, _, values in labels_in_boxes.judged("all", grid, hand, kept)}
        assert np.nanmean(found["all_offset_u"]) == pytest.approx(0.15)


def test_a_box_is_judged_by_the_labels_of_the_fit_without_it():
    grid = grid_of(np.repeat(SQUARE, 10, axis=0))
    hand = np.repeat([[10.0, 20.0, 14.0, 30.0]], 10, axis=0)
    # 10 boxes, none kept back; without the box of frame 3 labels would be 1 px further right, and 2 px further down
    found = {n: v for n, _, v in labels_in_boxes.left_out(grid, hand, np.array([3, 5]), np.array([[1.0, 2.0], [0, 0]]))}
    known = np.isfinite(found["left_out_share"]).all(axis=1)
    assert np.flatnonzero(known).tolist() == [3, 5]
    assert found["left_out_offset_u"][3] == 0.1 and found["left_out_offset_v"][3] == 0.2
    assert found["left_out_share"][3].tolist() == [1, 0, 1] and (found["left_out_share"][5] == 1).all()
    assert labels_in_boxes.left_out(grid, hand, np.zeros(0, int), np.zeros((0, 2))) == []


def test_boxes_that_were_kept_back_judge_as_they_are_beside_those_that_were_left_out():
    grid, frames = grid_of(np.repeat(SQUARE, 40, axis=0)), np.arange(40)
    hand, kept = np.repeat([[10.0, 20.0, 14.0, 30.0]], 40, axis=0), boxes.kept_back(np.arange(40))
    shift = np.tile([1.0, 0.0], (40 - kept.sum(), 1))
    found = {name: values for name, _, values in labels_in_boxes.left_out(grid, hand, frames[~kept], shift)}
    np.testing.assert_allclose(found["left_out_offset_u"][:, 0], np.where(kept, 0.0, 0.1))


def test_one_box_tells_nothing_about_its_spread():
    assert np.isnan(figure(grid_of(SQUARE), np.array([[9.0, 19.0, 15.0, 31.0]]), "in_box_expected")).all()


def walker(frames=FRAMES):
    """True landmarks (F, 33, 2) px of a person 60 m away, about 20 px tall."""
    return project(rig(far=True)[3], walk(frames))[0]


def drawn(rng, uv, margin, sd):
    tight = np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1)
    return tight + margin * np.array([-1, -1, 1, 1]) + rng.normal(0, sd, tight.shape)


def share(uv, hand):
    inside = (uv >= hand[:, None, :2]) & (uv <= hand[:, None, 2:])
    return inside.all(axis=-1).mean()


@pytest.mark.parametrize("margin", [-1.0, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("sd", some([0.5, 1.0, 2.0], 1.0))
@pytest.mark.parametrize("error", ["perfect", "shifted", "jittered"])
def test_expected_share_is_what_perfect_labels_score(margin, sd, error):
    """Labels that are off as a whole, by the same in all frames or by another in each, must not change it."""
    rng = np.random.default_rng(7)
    scored, expected, own = [], [], []
    for _ in range(6):
        true = walker()
        hand = drawn(rng, true, margin, sd)
        shift = {"perfect": (0, 0), "shifted": (2.0, -1.5), "jittered": rng.normal(0, 1.5, (FRAMES, 1, 2))}[error]
        scored.append(share(true, hand))
        own.append(share(true + shift, hand))
        expected.append(np.nanmean(figure(grid_of(true + shift), hand, "in_box_expected")))
    assert np.mean(expected) == pytest.approx(np.mean(scored), abs=0.01)
    if error != "perfect" and margin in (0, 1):
        assert np.mean(own) < np.mean(scored) - 0.01, "the labels themselves must score less, or the test shows nothing"


def test_a_few_wild_labels_do_not_make_the_boxes_look_carelessly_drawn():
    rng = np.random.default_rng(3)
    true = walker()
    hand = drawn(rng, true, 3.0, 1.0)
    ours = true.copy()
    ours[::20, 5, 0] += 25
    found = figure(grid_of(ours), hand, "in_box_expected")
    assert np.nanmean(found) == pytest.approx(share(true, hand), abs=0.01)


def test_thirty_boxes_are_enough_for_a_few_percent():
    rng, off = np.random.default_rng(4), []
    for _ in range(100):
        true = walker()[::13][:30]
        hand = drawn(rng, true, 1.0, 1.0)
        off.append(np.nanmean(figure(grid_of(true), hand, "in_box_expected")) - share(true, hand))
    assert abs(np.mean(off)) < 0.01 and np.std(off) < 0.04


@pytest.mark.parametrize("turned", [False, True])
def test_what_a_wall_hides_is_not_judged(turned):
    """Boxes end at a wall that hides the legs; the camera may hang upside down."""
    rng, camera = np.random.default_rng(5), rig(far=True)[3]
    if turned:
        camera = camera.at(pose(camera.wRc @ rotation_z(np.pi), camera.centre))
    true = project(camera, walk(FRAMES))[0]
    edge = occluded_edge(replace(camera, occluded="below"))
    assert edge == (1 if turned else 3)
    shown = drawn(rng, true, 1.0, 1.0)
    wall = np.median(true[:, MLKIT_33.index("left_knee"), 1])
    shown[:, edge] = wall + rng.normal(0, 0.5, FRAMES)

    def found(uv, edge):
        return {name: values for name, _, values in labels_in_boxes.figures(grid_of(uv), shown, edge)}

    judged = found(true, edge)
    ankles = [MLKIT_33.index(f"{side}_ankle") for side in ("left", "right")]
    assert np.isnan(judged["in_box_share"][:, ankles]).all() and np.isfinite(judged["in_box_share"][:, :11]).all()
    assert np.nanmean(judged["in_box_share"]) == pytest.approx(np.nanmean(judged["in_box_expected"]), abs=0.01)
    assert np.nanmean(judged["in_box_share"]) > np.nanmean(found(true, None)["in_box_share"]) + 0.15
    assert np.isnan(judged["box_offset_v"]).all() and abs(np.nanmean(judged["box_offset_u"])) < 0.2
    # labels beside the person are still found out
    aside = found(true + (4.0, 0.0), edge)
    assert np.nanmean(aside["in_box_share"]) < np.nanmean(aside["in_box_expected"]) - 0.2


def test_exact_boxes_hold_perfect_labels():
    true = walker()
    assert (figure(grid_of(true), drawn(np.random.default_rng(1), true, 0.0, 0.0), "in_box_expected") == 1).all()
