"""The line for each kind of camera: how good, how that is known, what is missing."""

import numpy as np
import pytest

from dior.evaluate.label_errors import PARTS
from dior.report import headline
from dior.report.headline import Told

INDOOR, FAR = ("indoor", "close"), ("outdoor", "long_range")
SEEN = {"reprojection_error": 3.0}


def sigma(px, n=100):
    return {"label_sigma": (np.full(PARTS, px), n), "label_sigma_m": (np.full(PARTS, px / 100), n)}


def test_it_is_pooled_over_the_recordings_of_a_kind():
    [line] = headline.lines(
        {("w", "cam01"): Told(INDOOR, "good", SEEN), ("w", "cam02"): Told(INDOOR, "good", SEEN)},
        {("w", "cam01"): sigma(0.5), ("w", "cam02"): sigma(0.5)},
    )
    assert (line.name, line.within, line.at_person) == ("indoors", "1.22 px", "12.2 mm") and line.missing == ()


def test_what_is_red_is_not_counted_and_told():
    found = {("w", "cam01"): Told(INDOOR, "good", SEEN), ("w", "cam02"): Told(INDOOR, "bad", SEEN)}
    [line] = headline.lines(found, {("w", "cam01"): sigma(0.5), ("w", "cam02"): sigma(50.0)})
    assert line.within == "1.22 px" and line.missing == (
        "1 recording with labels that are drawn aside, or red, is left out of these figures",
    )


def test_what_is_drawn_aside_is_left_out_of_what_is_expected_and_of_what_is_measured():
    off = sigma(0.5) | {"error_to_truth_2d": (np.full(PARTS, 4.0), 100)}
    right = sigma(0.5) | {"error_to_truth_2d": (np.full(PARTS, 0.9), 100)}
    found = {("w", "cam01"): Told(INDOOR, "good", SEEN), ("w", "cam02"): Told(INDOOR, "look", SEEN, aside=True)}
    [line] = headline.lines(found, {("w", "cam01"): right, ("w", "cam02"): off})
    assert line.known[1] == "measured: 95 % within 0.90 px of the simulated truth"
    assert line.missing == ("1 recording with labels that are drawn aside, or red, is left out of these figures",)


def test_labels_without_a_sigma_are_not_said_to_be_good():
    [line] = headline.lines({("w", "cam04"): Told(FAR, "good", {"in_box_share": 1.0})}, {})
    assert line.within == "" and "1 recording of 1 without a sigma" in line.missing[0]


@pytest.mark.parametrize(("kind", "figures"), [(INDOOR, {"mark_error": 1.0}), (FAR, {"reprojection_error": 1.0})])
def test_what_nothing_judges_is_told(kind, figures):
    [line] = headline.lines({("w", "cam01"): Told(kind, "good", figures)}, {("w", "cam01"): sigma(0.5)})
    assert "1 recording is judged by what made the labels alone; hand" in line.missing[0]


def test_what_was_measured_stands_beside_it():
    own = sigma(0.5) | {"check_error": (np.linspace(0, 10, PARTS), 40)}
    [line] = headline.lines({("w", "cam01"): Told(INDOOR, "good", {"check_error": 5.0})}, {("w", "cam01"): own})
    assert line.known[0] == "expected, by the labels' own sigmas" and "of the hand checks" in line.known[1]
