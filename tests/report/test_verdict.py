"""The sentence that a run ends with."""

from dior.report import lights
from dior.report.overview import CameraRow, RecordingRow
from dior.report.troubles import Fix, Trouble
from dior.report.verdict import sentence


def row(camera, *levels, troubles=()):
    recordings = tuple(RecordingRow(f"lab_{i}", "", level, "", (), "") for i, level in enumerate(levels, start=1))
    return CameraRow("lab", camera, "close", lights.worst(levels), "", (), tuple(troubles), recordings)


BESIDE = Trouble("bad", "beside_boxes", "the labels lie 12.0 ± 0.5 px to the left of the hand boxes",
                 ("lab_1", "lab_2"), Fix("config/sessions/lab/cam02.yaml", "nudge: {azimuth_deg: 0.58}"))  # fmt: skip
FEW = Trouble(
    "look", "coverage", "90.0 % of the joints have a label", ("lab_2",), Fix("config/sessions/lab/cam01.yaml")
)


def test_all_good():
    assert sentence([row("cam01", "good", "good"), row("cam02", "good")]) == "3 of 3 recordings are good."
    assert sentence([row("cam01", "good", "none")]) == "1 of 1 recordings are good."


def test_the_worst_is_told_with_what_to_type():
    rows = [row("cam01", "good", "look", troubles=[FEW]), row("cam02", "bad", "bad", troubles=[BESIDE])]
    assert sentence(rows) == (
        "1 of 4 recordings are good. Fix it: lab cam02: the labels lie 12.0 ± 0.5 px to the left of the hand boxes (in "
        "all 2 recordings); in config/sessions/lab/cam02.yaml: nudge: {azimuth_deg: 0.58}. 1 more is in the report."
    )


def test_where_nothing_is_computed_the_file_is_named():
    assert sentence([row("cam01", "good", "look", troubles=[FEW])]).endswith(
        "90.0 % of the joints have a label (in lab_2); its file is config/sessions/lab/cam01.yaml."
    )


def test_a_file_that_the_reason_names_is_not_named_twice():
    why = "12 px beside; correct config/people/lab_1.yaml"
    trouble = Trouble("bad", "a", why, ("lab_1",), Fix("config/people/lab_1.yaml"))
    assert sentence([row("cam01", "bad", troubles=[trouble])]).endswith(f"lab cam01: {why}.")


def test_what_is_about_a_whole_walk_is_told_too():
    walks = row("", troubles=[Trouble("bad", "world_scale", "the 3D has\nthe wrong size", ("lab_1",))])
    assert sentence([walks, row("cam01", "good")]) == (
        "1 of 1 recordings are good. Fix it: lab: the 3D has the wrong size (in lab_1)."
    )


def test_what_follows_from_another_camera_is_not_told_again():
    after = Trouble("bad", lights.BESIDE_CULPRIT, "this follows from cam02", ("lab_1",))
    assert "follows" not in sentence([row("cam01", "bad", troubles=[after]), row("cam02", "bad", troubles=[BESIDE])])


def test_it_is_not_endless():
    assert len(sentence([row("cam01", "bad", troubles=[Trouble("bad", "a", "x" * 5000, ("lab_1",))])])) < 700
