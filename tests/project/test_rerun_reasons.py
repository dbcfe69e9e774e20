"""Why a step runs again is told by the key, the file or the code, and never by what is about a person."""

import json
from collections import Counter

from dior.project.rerun_reasons import plan, together, words

CONFIG = {
    "data_root": "data",
    "adjust": {"min_score": 0.4, "huber_px": 15.0},
    "triangulate": {"method": "robust", "max_error_px": 30.0, "max_speed_m_s": 12.0},
    "refine": {"method": "robust"},
    "physics": {"stature_m": [1.0, 2.2], "lean_deg": 50.0},
    "report": {"overlay_frames": 5},
    "release": {"version": "0.2.0", "title": "Walks"},
}
SHA = "0123456789abcdef" * 4


def told(step, params, before):
    """Of a job that was given `before` and is given `params`."""
    old, new = ({repr(value) for value in one.values()} for one in (before, params))
    return words(step, params, old - new, new - old, CONFIG)


def test_a_key_is_told_with_its_values():
    params = {"max_error_px": 30.0, "max_speed": 12.0, "method": "robust", "code": "a"}
    assert told("triangulate", params, params | {"max_error_px": 45.0}) == ["triangulate.max_error_px 45.0 -> 30.0"]
    assert told("triangulate", params, params | {"max_error_px": 45.0, "code": "b"}) == [
        "triangulate.max_error_px 45.0 -> 30.0", "the code of triangulate",
    ]  # fmt: skip
    assert told("triangulate", params, params | {"max_speed": 9}) == ["triangulate.max_speed_m_s 9 -> 12.0"]
    # the step's own section goes first
    assert told("triangulate", params, params | {"method": "rays"}) == ["triangulate.method rays -> robust"]
    assert told("overlays", {"per_camera": 5}, {"per_camera": 3}) == ["report.overlay_frames 3 -> 5"]


def test_of_two_keys_at_once_it_is_not_guessed_which_was_what():
    params = {"max_error_px": 30.0, "max_speed": 12.0}
    found = told("triangulate", params, {"max_error_px": 45.0, "max_speed": 9.0})
    assert found == ["triangulate.max_error_px (now 30.0)", "triangulate.max_speed_m_s (now 12.0)"]


def test_of_a_section_or_all_settings_the_keys_that_differ_are_told():
    physics = {"physics": json.dumps(CONFIG["physics"])}
    assert told("adjust", physics, {"physics": json.dumps(CONFIG["physics"] | {"lean_deg": 40.0})}) == [
        "physics.lean_deg 40.0 -> 50.0"
    ]
    # a release is not told all keys
    settings = {key: CONFIG[key] for key in ("physics", "refine")} | {"release": {"version": "0.2.0"}}
    before = json.dumps(settings | {"release": {"version": "0.1.0"}})
    found = told("package", {"settings": json.dumps(settings)}, {"settings": before})
    assert found == ["release.version 0.1.0 -> 0.2.0"]


def test_a_file_is_named_and_one_that_is_gone_is_not():
    """It may be the walk of somebody who withdrew."""
    now = {"contents": [f"config/a b.yaml {SHA}", "walk/1.bag 120 0123456789abcdef", "walk/2.bag missing"]}
    before = {"contents": [f"config/a b.yaml {SHA[::-1]}", "walk/1.bag 120 0123456789abcdef", "walk/3.bag missing"]}
    assert told("frames", now, before) == ["config/a b.yaml", "walk/2.bag", "files that are not used any more"]
    assert told("frames", {"contents": []}, before) == ["files that are not used any more"]


def test_code_is_that_of_the_step():
    assert told("refine", {"code": "0a1b", "method": "robust"}, {"code": "ffff", "method": "robust"}) == [
        "the code of refine"
    ]


def test_nothing_about_people_is_told():
    params = {"consents": json.dumps([["lab", "P07"]]), "subject": "P07", "height": SHA[:32], "names": ["P07"]}
    found = told("report", params, {"consents": "[]", "subject": "P08", "height": SHA[1:33], "names": ["P08"]})
    assert found == [
        "a consent in config/subjects.tsv", "config/subjects.tsv", "a height in config/subjects.tsv", "names of report",
    ]  # fmt: skip
    rows = {"rows": json.dumps([{"subject": "P07"}])}
    assert told("gallery", rows, {"rows": "[]"}) == ["config/gallery.tsv"]


def test_all_of_them_together_are_short():
    counted = Counter({f"{n}.yaml": 20 - n for n in range(9)} | {f"the code of step_{n}": 99 for n in range(30)})
    assert together(counted) == ("0.yaml; 1.yaml; 2.yaml; 3.yaml; 4.yaml; 5.yaml; and 3 more; the code of 30 steps")
    assert together(Counter(["the code of a", "the code of b"])) == "the code of a; the code of b"


def test_what_cannot_be_read_is_no_error():
    assert words("x", {}, {"<object at 0x1>"}, set(), CONFIG) == ["what x is given"]
    assert words("x", {"a": {1: 2}}, {"{"}, {"{1: 2}"}, CONFIG) == ["a of x"]


def test_a_plan_has_a_line_for_each_step():
    many = [f"config/boxes/{i}.csv" for i in range(9)]
    assert plan({"align": [many, ["after refine", many[8]]], "reproject": [["after refine", "after align"]] * 4}) == [
        "align       2  config/boxes/8.csv; " + "; ".join(many[:5]) + "; and 3 more; after refine",
        "reproject   4  after align, refine",
        "6 jobs of 2 steps would run. Nothing was run.",
    ]
    assert plan({}) == ["Nothing to do: all that was asked for is there and up to date."]
