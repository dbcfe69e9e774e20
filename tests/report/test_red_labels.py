"""Which labels a red light says are wrong."""

from pathlib import Path

import pytest

from dior.body import wrong_world
from dior.geometry import culprit
from dior.report import lights, red_labels
from dior.report.red_labels import Judged, Red, of_walk

FX = 1680.0
CLOSE = ("cam01", "cam02", "cam03")
ALL = (*CLOSE, "far")
GOOD = {"coverage": 1.0, "in_picture_share": 1.0, "reprojection_error": 10.0}


def cameras(**figures):
    """A walk of three close cameras and a far one, those that are named with other figures."""
    return {name: Judged(FX, GOOD | figures.get(name, {})) for name in ALL}


def found(*findings, makers=CLOSE, robust=True, **figures):
    """Whose labels are wrong: "" is the whole walk."""
    return [red.camera for red in of_walk("walk", "field", cameras(**figures), makers, findings, robust)]


def error(scope, code, severity="error"):
    return (scope, severity, code, "config/detections of Anna")


def test_nothing_is_wrong_with_labels_that_are_good():
    assert found() == []
    assert found(error("walk/cam01", "culprit_camera", "warning"), error("walk", "clock_jump", "info")) == []


@pytest.mark.parametrize("limit", [one for one in lights.LIMITS if abs(one.bad) < 1e9], ids=lambda one: one.metric)
def test_each_figure_is_about_its_own_camera_or_about_no_label(limit):
    """0.001 beyond the red, and 0.001 before it."""
    key, value = limit.metric, limit.bad + limit.sign * 0.001
    figures = {"beside_boxes": {"held_back_offset_u": 0.0, "held_back_offset_v": value}}.get(key, {key: value})
    if key == "in_box_lacking":
        figures = {"in_box_share": 1 - value, "in_box_expected": 1.0}
    labels_are_there = ("coverage", "lost_pictures", "error_to_truth_2d")
    assert found(far=figures) == ([] if key in labels_are_there else ["far"])
    better = {
        name: one - limit.sign * 0.002 if name != "in_box_share" else one + 0.002 for name, one in figures.items()
    }
    assert (
        found(
            far={name: one for name, one in better.items() if name != "in_box_expected"}
            | ({"in_box_expected": 1.0} if key == "in_box_lacking" else {})
        )
        == []
    )


def test_a_figure_of_half_of_the_cameras_that_made_the_3d_is_about_all():
    off = {"reprojection_error": 31.0}
    assert found(cam01=off) == ["cam01"]
    assert found(cam01=off, cam02=off) == ["", "cam01", "cam02"]
    assert found(cam01=off, far={"check_error": 7.0}) == ["cam01", "far"], "the far one did not draw it"
    assert found(cam01=off, makers=("cam01", "cam02")) == ["", "cam01"], "one of two"
    assert found(cam01=off, cam02=off, makers=()) == ["cam01", "cam02"], "the motion capture's"
    aside = {"in_picture_share": 0.01}
    assert found(cam01=aside, cam02=aside) == ["cam01", "cam02"], "who walks past two cameras"


def test_a_limit_is_scaled_by_the_focal_length():
    near = {"cam01": Judged(FX / 2, GOOD | {"reprojection_error": 16.0})}
    assert [red.camera for red in of_walk("walk", "field", near, ())] == ["cam01"]


def test_a_finding_is_about_the_cameras_that_it_names_or_about_all():
    assert found(error("walk/cam02", "culprit_camera")) == ["cam02"]
    assert found(error("walk/cam02", "culprit_camera"), robust=False) == [""], "it draws every point"
    assert found(error("walk/far", "clock_jump"), robust=False) == ["far"], "it draws none"
    assert found(error("field/cam02", "camera_bumped")) == ["cam02"]
    for code in ("culprit_exchanged", "culprit_unclear"):
        assert found(error("walk/cam01/cam02", code)) == [""]
    for code in ("culprit_c3d", "world_scale", "something_new"):
        assert found(error("walk", code)) == [""]
    assert found(error("walk/far", "something_new")) == ["far"]


def test_a_finding_about_somebody_else_is_not_about_this_walk():
    others = ("other/cam01", "culprit_camera"), ("other", "world_scale"), ("lab/cam01", "camera_bumped"), ("", "x")
    assert found(*(error(*one) for one in others)) == []


def test_whose_fault_it_is_that_detections_are_beside_the_motion_capture():
    def beside(**apart):
        rows = [(f"walk/{name}", "error" if off else "info", "mocap_apart" if off else "mocap_agrees", "0.4 m off")
                for name, off in apart.items()]  # fmt: skip
        return found(*rows, makers=())

    assert beside(cam01=True, cam02=True, cam03=True) == [""], "the C3D's"
    assert beside(cam01=True, cam02=False, cam03=False) == ["cam01"]
    assert beside(cam01=True) == [""], "nobody knows"


def test_what_a_release_tells_names_no_file_and_nobody():
    (red,) = of_walk("walk", "field", cameras(), CLOSE, [error("walk/cam02", "culprit_camera")] * 2)
    assert red == Red("cam02", "cam02 does not belong to the other cameras")
    (red,) = of_walk("walk", "field", cameras(far={"in_box_share": 0.06}), CLOSE)
    assert red == Red("far", "6.0 % of the labels are in the hand boxes (limit 95.0 %)")
    (red,) = of_walk("walk", "field", cameras(), CLOSE, [error("walk", "something_new")])
    assert red.reason == "an error that dior found (something_new)"


def test_every_error_of_today_has_words_of_its_own():
    source = Path(wrong_world.__file__).read_text() + Path(wrong_world.__file__).with_name("plausible.py").read_text()
    codes = {code for code in red_labels.WORDS if code.startswith("world_")}
    assert {
        f"world_{name}" for name in ("scale", "bones", "left_handed", "axes", "floor", "vertical", "speed")
    } == codes
    assert all(code in source or f'"{code.removeprefix("world_")}"' in source for code in codes)
    assert set(culprit.CODES) < set(red_labels.WORDS)


def test_the_page_has_every_limit_and_every_code():
    page = (Path(__file__).parents[2] / "docs/figures.md").read_text()
    missing = [one.metric for one in lights.LIMITS if f"`{one.metric}`" not in page]
    assert not missing + [code for code in red_labels.WORDS if f"`{code}`" not in page and "world_" not in code]
