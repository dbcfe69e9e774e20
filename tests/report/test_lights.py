import numpy as np
import pytest

from dior.geometry.camera import REFERENCE_FX
from dior.report import cards, lights, numbers

GOOD = {"coverage": 0.99, "in_picture_share": 0.9, "reprojection_error": 3.0}


def test_a_camera_within_all_limits_is_good():
    light = lights.judge(GOOD, 640.0)
    assert light.level == "good" and light.reasons == ()
    assert "labels are 3.0 px from the detections" in " ".join(light.facts).replace("3.00", "3.0")


@pytest.mark.parametrize(
    ("figures", "level", "words"),
    [
        ({"coverage": 0.90}, "look", "90.0 % of the joints have a label"),
        ({"coverage": 0.50}, "bad", "50.0 %"),
        ({"reprojection_error": 8.0}, "look", "8.00 px from the detections (limit 5.71 px)"),
        ({"reprojection_error": 20.0}, "bad", "20.0 px from the detections"),
        ({"in_box_share": 0.5}, "bad", "50.0 % of the labels are in the hand boxes"),
        ({"in_picture_share": 0.0}, "bad", "0.0 % of the labels are in the picture"),
        ({"swapped_share": 0.4}, "look", "left and right were exchanged in 40.0 %"),
    ],
)
def test_each_limit_has_its_words(figures, level, words):
    light = lights.judge(GOOD | figures, 640.0)
    assert light.level == level and any(words in reason for reason in light.reasons)


def test_no_labels_are_bad_and_findings_count():
    assert lights.judge({}, None).level == "bad"
    light = lights.judge(GOOD, 640.0, [("warning", "a", "the camera moved"), ("info", "b", "48 marks")])
    assert light.level == "look" and light.reasons == ("the camera moved",) and "48 marks" in light.facts
    assert light.faults == (("look", "a", "the camera moved"),)


def test_a_long_range_camera_that_nothing_checks_is_never_good():
    light = lights.judge({"coverage": 1.0, "in_picture_share": 1.0}, 760.0, role="long_range")
    assert light.level == "look" and "draw boxes" in light.reasons[0]
    boxed = {"coverage": 1.0, "in_picture_share": 1.0, "in_box_share": 0.99}
    assert lights.judge(boxed, 760.0, role="long_range").level == "good"


@pytest.mark.parametrize(
    ("share", "expected", "level"),
    [(0.60, 0.62, "good"), (0.92, 0.985, "look"), (0.99, 0.95, "good"), (0.60, 0.95, "bad")],
)
def test_boxes_are_judged_by_what_perfect_labels_would_score_in_them(share, expected, level):
    """Tight boxes hold few labels and are no fault of theirs; large ones are no merit."""
    figures = {"coverage": 1.0, "in_box_share": share, "in_box_expected": expected}
    assert lights.judge(figures, 760.0, role="long_range").level == level


def test_boxes_that_were_kept_back_judge_and_not_those_that_placed_the_camera():
    figures = {"coverage": 1.0, "in_box_share": 0.97, "in_box_expected": 0.97}
    kept = {"held_back_share": 0.85, "held_back_expected": 0.97}
    assert lights.judge(figures, 760.0, role="long_range").level == "good"
    light = lights.judge(figures | kept, 760.0, role="long_range")
    assert light.level == "look" and "12.0 % fewer labels are in the hand boxes" in light.reasons[0]


def test_the_most_independent_boxes_judge():
    figures = {"coverage": 1.0, "in_box_share": 0.97, "in_box_expected": 0.97}
    levels = []
    for name, beside in (("held_back", 0.1), ("left_out", 0.02)):
        figures |= {f"{name}_share": 0.97, f"{name}_expected": 0.97}
        figures |= {f"{name}_offset_u": beside, f"{name}_offset_v": 0.0}
        levels.append(lights.judge(figures, 760.0, role="long_range").level)
    assert levels == ["look", "good"]


def test_boxes_that_tell_one_axis_alone_say_how_far_off_labels_are_along_it():
    figures = {"coverage": 1.0, "left_out_share": 0.85, "left_out_expected": 0.95, "left_out_offset_u": 0.3}
    found = lights.boxes_compared(figures)
    assert found["in_box_lacking"] == pytest.approx(0.1) and found["beside_boxes"] == pytest.approx(0.3)


def test_of_two_drawers_the_middle_judges():
    figures = {"coverage": 1.0, "in_box_share": 0.5, "in_box_expected": 0.97}
    figures |= {"left_out_share": 0.97, "left_out_expected": 0.97, "left_out_offset_u": 0.02, "left_out_offset_v": 0.0}
    for share, u, lacking, beside in ((0.91, -0.02, 0.03, 0.0), (0.93, 0.16, 0.02, 0.09), (0.99, 0.02, 0.0, 0.02)):
        other = {"other_drawer_share": share, "other_drawer_expected": 0.97}
        other |= {"other_drawer_offset_u": u, "other_drawer_offset_v": 0.0}
        found = lights.boxes_compared(figures | other)
        assert (found["in_box_lacking"], found["beside_boxes"]) == pytest.approx((lacking, beside))


def test_labels_beside_the_middle_of_large_boxes_are_seen():
    figures = {"coverage": 1.0, "held_back_share": 0.995, "held_back_expected": 1.0, "held_back_offset_u": 0.0}
    # 0.02 and 0.09 of 25 px
    levels = [lights.judge(figures | {"held_back_offset_v": v}, 760.0).level for v in (0.02, 0.09, -0.09, 0.3)]
    assert levels == ["good", "look", "look", "bad"]


def test_findings_are_matched_to_what_they_are_about():
    findings = [
        ("walk/cam01", "info", "a", "one"),
        ("lab/cam01", "warning", "b", "two"),
        ("walk", "error", "c", "three"),
        ("other/cam01", "error", "d", "four"),
    ]
    own = lights.findings_of(findings, "walk", ["lab", "S01"], "cam01")
    assert own == [("info", "a", "one"), ("warning", "b", "two")]
    assert lights.findings_of(findings, "walk", ["lab", "S01"]) == [("error", "c", "three")]


CULPRIT = ("walk/cam02", "error", "culprit_camera", "cam02 does not belong to the others")


def test_the_culprit_comes_first_and_is_about_the_sequence_too():
    findings = [("lab/cam02", "error", "a", "one"), ("walk", "error", "b", "two"), CULPRIT]

    def of(camera=""):
        return [text for _, _, text in lights.findings_of(findings, "walk", ["lab", "S01"], camera)]

    assert of("cam02") == [CULPRIT[3], "one"] and of() == [CULPRIT[3], "two"] and of("cam01") == []
    both = [("walk/cam01/cam02", "error", "culprit_exchanged", "exchanged")]
    assert lights.findings_of(both, "walk", ["lab", "S01"], "cam01") == [("error", "culprit_exchanged", "exchanged")]
    assert not lights.findings_of(both, "walk", ["lab", "S01"], "cam03")
    assert not lights.findings_of(both, "other", ["lab", "S01"])
    assert [row["code"] for row in cards.shown([("a", "error", "b", "two"), CULPRIT])] == ["culprit_camera", "b"]


def test_the_light_of_an_innocent_camera_points_at_the_culprit():
    red = lights.judge({"coverage": 1.0, "reprojection_error": 40.0}, REFERENCE_FX)
    beside = lights.beside_culprit(red, [CULPRIT], "walk", "cam01")
    assert "cam02 may have drawn aside" in beside.reasons[0] and beside.reasons[1:] == red.reasons
    assert lights.beside_culprit(red, [CULPRIT], "walk", "cam02") == red
    assert lights.beside_culprit(red, [CULPRIT], "other", "cam01") == red
    good = lights.judge({"coverage": 1.0}, REFERENCE_FX)
    assert lights.beside_culprit(good, [CULPRIT], "walk", "cam01") == good


def mocap(**off_m):
    """Findings of the step `clocks`, by camera how far its detections are from the joints, m."""
    words = {True: ("error", "mocap_apart"), False: ("info", "mocap_agrees")}
    return [(f"walk/{name}", *words[m > 0.2], f"{m:.2f} m beside its detections") for name, m in off_m.items()]


def test_whose_fault_it_is_that_detections_do_not_lie_on_the_motion_capture():
    def told(**off_m):
        return [(scope, code) for scope, severity, code, _ in lights.by_mocap(mocap(**off_m)) if severity == "error"]

    assert told(cam01=0.4, cam02=1.1, cam03=0.5) == [("walk", "culprit_c3d")]
    assert told(cam01=0.05, cam02=0.06, cam03=0.5) == [("walk/cam03", "culprit_camera")]
    assert told(cam01=0.5) == [("walk/cam01", "culprit_unclear")]
    assert told(cam01=0.05, cam02=0.6) == [("walk/cam02", "culprit_unclear")]
    assert told(cam01=0.05, cam02=0.06) == []
    (finding,) = lights.by_mocap(mocap(cam01=0.4, cam02=1.1))
    assert "cam01 0.40 m, cam02 1.10 m" in finding[3] and "another walk's" in finding[3]


def test_lost_pictures_are_counted_from_the_gaps():
    stamps = np.delete(np.arange(100) * 33_333_333, [10, 11, 50])
    assert lights.lost_share(stamps) == pytest.approx(0.03)
    assert lights.lost_share(stamps[:2]) == 0.0


def test_figures_are_shown_for_people():
    assert numbers.show(0.967, "share") == "96.7 %"
    assert numbers.show(0.0123, "m") == "12.3 mm"
    assert numbers.show(1.234, "px") == "1.23 px"
    assert numbers.show(np.nan, "px") == "unknown"


@pytest.mark.parametrize("limit", lights.LIMITS, ids=lambda limit: limit.metric)
def test_a_figure_at_its_limit_is_within_it_and_one_beyond_is_not(limit):
    def level(value):
        return lights.judge({"coverage": 1.0, limit.metric: value}, REFERENCE_FX).level

    beyond = 1 + 1e-9 * limit.sign
    assert level(limit.look) == "good" and level(limit.look * beyond) == "look"
    if np.isfinite(limit.bad):
        assert level(limit.bad) == "look" and level(limit.bad * beyond) == "bad"


def test_the_limits_are_where_their_reasons_put_them():
    """What is measured passes: a detector's noise, a steady hand, boxes drawn 3 px large; tight boxes are no fault of
    the labels but tell nothing, and a picture in 20 that was lost is much."""
    limit = {one.metric: one for one in lights.LIMITS}
    assert limit["reprojection_error"].look == 15 and limit["reprojection_error"].scaled_by_fx
    assert all(2 < limit[name].look < limit[name].bad for name in ("mark_error", "check_error", "error_to_truth_2d"))
    assert limit["in_box_share"].look == 1 - limit["in_box_lacking"].look == 0.95
    assert limit["in_box_share"].bad == 1 - limit["in_box_lacking"].bad > 0.63
    assert limit["lost_pictures"].bad == 0.05 and limit["lost_pictures"].look < 0.05
    assert limit["coverage"].sign == limit["in_picture_share"].sign == limit["in_box_share"].sign == -1


def test_a_far_camera_has_wider_limits_in_pixels_only_where_they_are_a_detectors():
    figures = {"coverage": 1.0, "in_box_share": 1.0}
    assert lights.judge(figures | {"reprojection_error": 29.0}, 2 * REFERENCE_FX).level == "good"
    assert lights.judge(figures | {"check_error": 5.0}, 2 * REFERENCE_FX).level == "look"
