import numpy as np
import pytest

from dior.report import lights, numbers

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
    light = lights.judge(GOOD, 640.0, [("warning", "the camera moved"), ("info", "48 marks")])
    assert light.level == "look" and light.reasons == ("the camera moved",) and "48 marks" in light.facts


def test_a_long_range_camera_that_nothing_checks_is_never_good():
    light = lights.judge({"coverage": 1.0, "in_picture_share": 1.0}, 760.0, role="long_range")
    assert light.level == "look" and "draw boxes" in light.reasons[0]
    boxed = {"coverage": 1.0, "in_picture_share": 1.0, "in_box_share": 0.99}
    assert lights.judge(boxed, 760.0, role="long_range").level == "good"


def test_findings_are_matched_to_what_they_are_about():
    findings = [
        ("walk/cam01", "info", "a", "one"),
        ("lab/cam01", "warning", "b", "two"),
        ("walk", "error", "c", "three"),
        ("other/cam01", "error", "d", "four"),
    ]
    own = lights.findings_of(findings, "walk", "lab", "S01", "cam01")
    assert own == [("info", "one"), ("warning", "two")]
    assert lights.findings_of(findings, "walk", "lab", "S01") == [("error", "three")]


def test_lost_pictures_are_counted_from_the_gaps():
    stamps = np.delete(np.arange(100) * 33_333_333, [10, 11, 50])
    assert lights.lost_share(stamps) == pytest.approx(0.03)
    assert lights.lost_share(stamps[:2]) == 0.0


def test_figures_are_shown_for_people():
    assert numbers.show(0.967, "share") == "96.7 %"
    assert numbers.show(0.0123, "m") == "12.3 mm"
    assert numbers.show(1.234, "px") == "1.23 px"
    assert numbers.show(np.nan, "px") == "unknown"
