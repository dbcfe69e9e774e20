"""The sentence that a run ends with."""

from dior.report.lights import Light
from dior.report.verdict import sentence


def card(sequence, level, *lights, notes=()):
    cells = [{"camera": f"cam{i:02d}", "light": light} for i, light in enumerate(lights, start=1)]
    return {"sequence": sequence, "level": level, "notes": list(notes), "cells": cells}


def file_of(sequence, camera):
    return f"config/sessions/{sequence[:3]}/{camera}.yaml"


GOOD, NONE = Light("good"), Light("none")


def test_all_good():
    assert sentence([card("lab_1", "good", GOOD, GOOD), card("lab_2", "good", GOOD)], file_of) == (
        "3 of 3 recordings are good."
    )
    assert sentence([card("lab_1", "good", GOOD, NONE)], file_of) == "1 of 1 recordings are good."


def test_the_worst_is_told_with_the_file_to_edit():
    cards = [
        card("lab_1", "look", GOOD, Light("look", ("few joints",))),
        card("lab_2", "bad", Light("look", ("lost",)), Light("bad", ("labels are 12 px beside.", "more"))),
        card("lab_3", "good", GOOD),
    ]
    assert sentence(cards, file_of) == (
        "2 of 5 recordings are good. Fix it: lab_2 cam02: labels are 12 px beside; its file is "
        "config/sessions/lab/cam02.yaml. 2 more are in the report."
    )


def test_a_file_that_the_reason_names_is_not_named_twice():
    why = "12 px beside; in config/sessions/lab/cam01.yaml: nudge azimuth_deg: +0.58"
    assert sentence([card("lab_1", "bad", Light("bad", (why,)))], file_of).endswith(f"lab_1 cam01: {why}.")


def test_what_is_about_a_whole_walk_is_told_too():
    cards = [card("lab_1", "bad", GOOD, GOOD, notes=["the 3D has\nthe wrong size", "other"])]
    assert sentence(cards, file_of) == "2 of 2 recordings are good. Fix it: lab_1: the 3D has the wrong size."


def test_it_is_not_endless():
    assert len(sentence([card("lab_1", "bad", Light("bad", ("x" * 5000,)))], file_of)) < 700
