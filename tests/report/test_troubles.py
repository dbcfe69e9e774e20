"""One cause, one line: what follows from what, and what to type."""

import numpy as np

from dior.geometry.camera import Camera, Intrinsics
from dior.report import lights, troubles
from dior.report.beside_boxes import Offset
from dior.report.troubles import Recording, Setting, Trouble

FAULTS = (
    ("bad", "in_box_lacking", "46 % fewer labels are in the hand boxes"),
    ("bad", "beside_boxes", "labels lie 38 % of their height beside"),
    ("look", "clock_unknown", "the clock is not known"),
    ("bad", "error_to_truth_2d", "labels are 7.7 px from the truth"),
)
LENS = Intrinsics(1280, 720, 760.0, 760.0, 640.0, 360.0)
BY_EYE = Setting(
    "config/sessions/field/cam04.yaml", {"locate": "align", "nudge": {"azimuth_deg": 0.3}},
    Camera("cam04", LENS, np.eye(4), "long_range", "align"),
)  # fmt: skip


def off(u, walk="walk_1", faults=FAULTS):
    return Recording(walk, "cam04", faults, Offset((u, 0.1), (0.3, 0.4), 20))


def test_a_turned_camera_is_one_trouble_with_the_value_to_type():
    [found] = troubles.of_camera([off(7.7), off(7.5, "walk_2")], BY_EYE)
    assert found.level == "bad" and found.sequences == ("walk_1", "walk_2")
    assert found.text == "the labels lie 7.6 ± 0.6 px to the right of the hand boxes"
    assert found.fix.file == "config/sessions/field/cam04.yaml" and found.fix.what == "nudge: {azimuth_deg: -0.273}"
    assert {text for _, text in found.follows} >= {text for _, code, text in FAULTS if code != "beside_boxes"}


def test_walks_that_are_off_to_both_sides_are_not_mended_by_a_nudge():
    [found] = troubles.of_camera([off(7.7), off(-7.5, "walk_2")], BY_EYE)
    assert found.text == FAULTS[1][2] and found.fix.what == ""


def test_a_camera_that_is_fitted_to_boxes_is_not_nudged():
    fitted = Setting(BY_EYE.file, {"locate": "align", "align": {"from": "boxes"}}, BY_EYE.camera)
    [found] = troubles.of_camera([off(7.7)], fitted)
    assert "nudge" not in found.fix.what


def test_faults_without_a_common_cause_stay_apart_the_worst_first():
    faults = (("look", "coverage", "90 % of the joints"), ("bad", "mark_error", "marks fit to 9 px"))
    found = troubles.of_camera([Recording("w", "cam01", faults)], Setting("c.yaml"))
    assert [one.code for one in found] == ["mark_error", "coverage"] and found[0].fix == troubles.Fix("c.yaml")


def test_a_file_in_the_sentence_is_the_one_to_edit():
    faults = (("look", "a", "correct it in config/people/walk_1.yaml."),)
    [found] = troubles.of_camera([Recording("walk_1", "cam01", faults)], Setting("c.yaml"))
    assert found.fix == troubles.Fix("config/people/walk_1.yaml")


def test_what_nothing_checks_asks_for_boxes():
    faults = (("look", lights.UNCHECKED, "nothing checks these labels"),)
    [found] = troubles.of_camera([Recording("walk_1", "cam04", faults)], BY_EYE)
    assert found.fix.file == "config/boxes/walk_1.cam04.csv"


def trouble(code, *sequences, level="look"):
    return Trouble(level, code, f"{code} of {sequences[0]}", sequences)


def test_a_wrong_clock_in_a_walk_of_the_adjustment_is_behind_what_is_wrong_in_all_walks():
    found = troubles.across(
        {"cam02": [trouble("clock_contradicts", "w1")], "cam03": [trouble("reprojection_error", "w2", level="bad")]},
        ["w1"],
    )
    [cause], [after] = found["cam02"], found["cam03"]
    assert cause.level == "bad" and ("w2 cam03", "reprojection_error of w2") in cause.follows
    assert after.code == lights.BESIDE_CULPRIT and "follows from cam02" in after.text and after.fix is None


def test_elsewhere_it_is_behind_what_is_wrong_in_its_own_walk_alone():
    given = {"cam02": [trouble("clock_contradicts", "w1")], "cam03": [trouble("reprojection_error", "w2")]}
    assert troubles.across(given, ["w3"])["cam03"] == (given["cam03"][0],)


def test_who_is_followed_in_a_walk_is_behind_what_its_cameras_lack():
    given = {
        "": [trouble("somebody_else", "w1"), trouble("missing_3d", "w1")],
        "cam01": [trouble("coverage", "w1", level="bad")],
        "cam02": [trouble("coverage", "w2")],
    }
    # a walk of the adjustment, which this says nothing of
    found = troubles.across(given, ["w1"])
    assert found[""][0].level == "bad" and ("w1 cam01", "coverage of w1") in found[""][0].follows
    assert found["cam01"][0].code == lights.BESIDE_CULPRIT and "the whole walk" in found["cam01"][0].text
    assert found["cam02"] == (given["cam02"][0],)
    faults = (("look", "missing_3d", "41 % of the joints"), ("look", "somebody_else", "see config/people/w1.yaml"))
    [one] = troubles.of_camera([Recording("w1", "", faults)], Setting(""))
    assert one.code == "somebody_else" and one.fix.file == "config/people/w1.yaml"


def test_what_a_sentence_gives_to_type_is_typed_and_told_once():
    text = "who is the subject? Point at them, or in config/people/w1.yaml, such as `seeds: [{u: <u>}]` with the pixel"
    [one] = troubles.of_camera([Recording("w1", "", (("look", "who_is_subject", text),))], Setting(""))
    assert one.text == "who is the subject? Point at them"
    assert one.fix == troubles.Fix("config/people/w1.yaml", "seeds: [{u: <u>}]", "with the pixel", literal=True)


def test_what_follows_below_what_follows_is_named_with_its_camera():
    below = Trouble("bad", "reprojection_error", "5 px", ("w2",), follows=(("w2", "6.9 px from the truth"),))
    found = troubles.across({"cam02": [trouble("clock_contradicts", "w1")], "cam03": [below]}, ["w1"])
    assert found["cam02"][0].follows == (("w2 cam03", "5 px"), ("w2 cam03", "6.9 px from the truth"))


def test_two_causes_are_both_told():
    given = {"cam02": [trouble("culprit_camera", "w1")], "cam03": [trouble("clock_contradicts", "w1")]}
    found = troubles.across(given, ["w1"])
    assert [len(found[camera]) for camera in given] == [1, 1] and found["cam03"][0].code == "clock_contradicts"


def test_where_names_few_walks_and_counts_many():
    names = [f"w{i}" for i in range(12)]
    assert troubles.where(trouble("a", *names), names) == "in all 12 recordings"
    assert troubles.where(trouble("a", "w1"), ["w1"]) == ""
    assert troubles.where(trouble("a", *names[:4]), []) == "in w0, w1, w2, ..."
    assert troubles.where(trouble("a", "w1", "w2"), names) == "in w1 and w2"
    assert troubles.where(trouble("a", *names[:4]), names) == "in 4 of 12 recordings: w0, w1, w2, ..."


def test_a_wrong_clock_by_hand_is_behind_the_turn_that_it_makes_in_the_same_camera_and_in_another():
    found = troubles.across(
        {"cam02": [trouble("clock_contradicts", "w1")], "cam03": [trouble("camera_bumped", "w1", "w2", level="bad")]},
        ["w3"],
    )
    assert found["cam02"][0].level == "bad" and found["cam03"][0].code == lights.BESIDE_CULPRIT
    faults = (("look", "clock_contradicts", "1.0 pictures off"), ("bad", "camera_bumped", "turned by 1.3 degrees"))
    [one] = troubles.of_camera([Recording("w1", "cam02", faults)], Setting("c.yaml"))
    assert (one.code, one.level) == ("clock_contradicts", "bad")
    assert one.fix.file == "config/offsets/w1.yaml" and one.fix.what == "remove the line of cam02"


def test_a_wrong_clock_in_a_walk_of_the_adjustment_is_behind_the_turn_of_its_own_camera_in_others():
    found = troubles.across({"cam02": [trouble("clock_contradicts", "w1"), trouble("camera_bumped", "w2")]}, ["w1"])
    [one] = found["cam02"]
    assert one.code == "clock_contradicts" and ("w2", "camera_bumped of w2") in one.follows


def test_a_bump_says_all_that_is_to_be_typed():
    text = "cam02 was turned by 0.5 degrees; config/sessions/field/cam02@w3.yaml says where it stands"
    faults = (("bad", "camera_bumped", text),)
    folder = "config/sessions/field"
    tape = Setting(
        f"{folder}/cam02.yaml",
        {"locate": "tape"},
        aligned={f"{folder}/cam04.yaml": ["w1"], f"{folder}/cam05.yaml": ["w1", "w3"]},
    )
    [found] = troubles.of_camera([Recording(walk, "cam02", faults) for walk in ("w1", "w2", "w3")], tape)
    assert "for cam01" not in found.fix.gain
    doubt = ("bad", "camera_bumped", text.replace("cam02 was", "cam02 (or cam01: that explains nearly as much) was"))
    [unsure] = troubles.of_camera([Recording("w3", "cam02", (doubt,))], tape)
    assert unsure.fix.gain.endswith("take these lines back and do the same for cam01")
    typed = [(one.file, one.what) for one in (found.fix, *found.also)]
    assert typed == [
        ("", f"cp {folder}/cam02.yaml {folder}/cam02@w3.yaml"),
        (f"{folder}/session.yaml", "  w3: {}"),
        (f"{folder}/cam04.yaml", "w3"),
    ]


def test_a_pose_that_is_off_in_all_walks_is_marked_again_and_one_from_a_walk_on_has_a_file_of_its_own():
    faults = (("look", "camera_turned", "its labels lie 3.4 px left"), ("look", "error_to_truth_2d", "3.6 px"))
    marked = Setting("config/sessions/lab/cam02.yaml", {"locate": "marks"})
    [found] = troubles.of_camera([Recording("w1", "cam02", faults), Recording("w2", "cam02", faults)], marked)
    assert found.code == "camera_turned" and found.fix.file == "config/sessions/lab/cam02.marks.csv"
    [found] = troubles.of_camera([Recording("w1", "cam02", ()), Recording("w2", "cam02", faults)], marked)
    assert found.fix.what.endswith(" config/sessions/lab/cam02@w2.yaml")
    assert [one.file for one in found.also] == ["config/sessions/lab/cam02@w2.marks.csv"]


def test_marks_that_count_from_1_say_what_to_do_with_their_frames():
    text = "the clock by its marks is 1.0 pictures before: do the frames of its .marks.csv count from 1?"
    faults = (("look", "marks_clock", text), ("look", "camera_turned", "its labels lie 3.4 px left"))
    [found] = troubles.of_camera([Recording("w1", "cam02", faults)], Setting("config/sessions/lab/cam02.yaml"))
    assert found.code == "marks_clock" and found.fix.file == "config/sessions/lab/cam02.marks.csv"
    assert found.fix.what == "subtract 1 from every frame"


def test_pictures_that_a_recorder_lost_are_one_trouble_and_no_file_of_the_project_mends_it():
    faults = (
        ("look", "lost_pictures", "3.3 % of the pictures were lost in the recording"),
        ("look", "pictures_lost", "a.bag: 8 pictures lost (3.3%) in 6 gaps"),
    )
    [found] = troubles.of_camera([Recording("walk_1", "cam01", faults)], Setting("config/sessions/lab/cam01.yaml"))
    assert (found.code, found.fix) == ("pictures_lost", None)
    assert found.follows == (("walk_1", faults[0][2]),)


def test_what_is_said_otherwise_of_another_walk_stands_with_that_walk():
    """The sentence of the first walk is the cause's own."""

    def says(walk, px):
        return Recording(walk, "cam01", (("bad", "high_error", f"{px} px"),))

    [found] = troubles.of_camera([says("walk_1", 3.4), says("walk_2", 3.1)], Setting("c.yaml"))
    assert (found.text, found.of, found.alike, found.follows) == ("3.4 px", "walk_1", (("walk_2", "3.1 px"),), ())
    assert troubles.where(found, ["walk_1", "walk_2"]) == "in walk_1; the same in 2 of 2 recordings"
    worse = [Recording("walk_1", "cam01", (("look", "high_error", "3.1 px"),)), says("walk_2", 3.4)]
    [found] = troubles.of_camera(worse, Setting("c.yaml"))
    assert (found.text, found.of, found.alike) == ("3.4 px", "walk_2", (("walk_1", "3.1 px"),))


def test_two_sentences_of_one_walk_are_no_other_recordings():
    faults = (("look", "clock_contradicts", "0.8 pictures off"), ("look", "clock_contradicts", "1.0 pictures off"))
    [found] = troubles.of_camera([Recording("w1", "cam02", faults), Recording("w2", "cam02", ())], Setting("c.yaml"))
    assert (found.alike, found.follows) == ((), (("w1", "1.0 pictures off"),))
    assert troubles.where(found, ["w1", "w2"]) == "in w1"
