"""What the report tells of the cameras' clocks."""

import numpy as np
import pytest

from dior.report import clocks
from tests.report.conftest import CLOCKS, LAGS_S, LEAST_PX, RISE

UNKNOWN = ("outdoor_01/cam04", "warning", "clock_unknown", "its clock cannot be told: nobody walks")
WRONG = ("outdoor_01/cam03", "warning", "clock_contradicts", "1.5 pictures apart")
FINE = ("outdoor_01/cam02", "info", "clock_found", "offset +0.0090 s")


def told(capture, findings=(UNKNOWN, WRONG, WRONG, FINE)):
    return {
        sequence: clocks.read(sequence, cameras, capture.clocks, capture.clock_costs, findings)
        for sequence, cameras in CLOCKS.items()
    }


def row(capture, sequence, camera, **options):
    return next(one for one in told(capture, **options)[sequence].rows if one["camera"] == camera)


def test_an_estimate_is_told_with_its_intervals_and_residuals(capture):
    """2 ms and 40 ppm of standard error, and the nearest lag tried to 499 ms is 500 ms."""
    one = row(capture, "indoor_01", "cam01")
    assert (one["offset"], one["interval"], one["drift"]) == ("+499.0", "495.1 to 502.9", "+12 ±78")
    before, after = one["residual"].split(" \u2192 ")
    assert float(before) == pytest.approx(LEAST_PX + RISE * 0.499, abs=0.05)
    assert float(after) == pytest.approx(LEAST_PX + RISE * 0.001, abs=0.006)
    assert (one["source"], one["light"]) == ("detections", "")


def test_what_marks_told_has_their_residuals(capture):
    one = row(capture, "indoor_01", "cam04")
    assert one["source"] == "marks"
    assert float(one["residual"].split()[-1]) == pytest.approx(LEAST_PX + RISE * 0.015, abs=0.006)


def test_the_search_of_the_clock_goes_before_that_of_the_marks(capture):
    """The same camera in two tables of costs."""
    table, again = capture.clock_costs[0], [*capture.clock_costs[1:], capture.clock_costs[0]]
    whole = clocks.read("indoor_01", ["cam01"], capture.clocks, [table, *again], ())
    assert len(whole.costs["cam01"][0]) == len(LAGS_S)


def test_a_clock_by_hand_or_unknown_is_marked_with_the_reason(capture):
    one = told(capture)["outdoor_01"]
    rows = {row["camera"]: row for row in one.rows}
    assert (rows["cam03"]["source"], rows["cam03"]["interval"]) == ("by hand", "taken as exact")
    assert (rows["cam04"]["source"], rows["cam04"]["interval"]) == ("not known", "unknown")
    assert rows["cam03"]["light"] == rows["cam04"]["light"] == "look" and rows["cam02"]["light"] == ""
    assert one.notes == (
        ("cam03", "given in config/offsets/outdoor_01.yaml; 1.5 pictures apart"),
        ("cam04", UNKNOWN[3]),
    )
    assert row(capture, "outdoor_01", "cam03", findings=())["light"] == "none"


def test_a_value_by_hand_that_is_wrong_fits_worse(capture):
    before, after = row(capture, "outdoor_01", "cam03")["residual"].split(" \u2192 ")
    assert float(before) == LEAST_PX and float(after) > 2


def test_the_reference_and_an_unknown_clock_have_no_residual_with_it(capture):
    assert row(capture, "outdoor_01", "cam01")["residual"] == clocks.NOTHING
    assert row(capture, "outdoor_01", "cam04")["residual"] == f"{LEAST_PX:.2f}"


def test_no_cost_is_told_of_an_offset_that_was_not_tried():
    lags = np.array([-40.0, 0.0, 40.0])
    assert clocks.at(lags, np.array([3.0, 1.0, 2.0]), 55.0) == 2.0
    assert np.isnan(clocks.at(lags, np.array([3.0, 1.0, 2.0]), 100.0))
    assert np.isnan(clocks.at(lags[:0], lags[:0], 0.0))


def test_how_far_apart_counts_only_what_is_certain(capture):
    """-28 ms and +6 ms, each ± 3.92 ms, and 12 ppm over 1.5 s; a clock that is not known does not count."""
    each = {sequence: one.clocks for sequence, one in told(capture).items()}
    assert clocks.least_apart(each["outdoor_02"]) == pytest.approx(34 - 2 * 1.96 * 2)
    assert clocks.least_apart(each["outdoor_01"]) == 50.0
    assert clocks.middle(each["indoor_01"]) == pytest.approx((485 + 499) / 2 + 0.018)


def test_of_a_sequence_without_clocks_nothing_is_told(capture):
    found = {name: clocks.read(name, cameras, capture.clocks[:1], [], ()) for name, cameras in CLOCKS.items()}
    assert [name for name, one in found.items() if one] == ["indoor_01"]
    assert clocks.in_words({}) == "0 clocks are estimated."


@pytest.mark.slow
def test_many_recordings_and_none_that_is_known_can_be_drawn(capture, tmp_path):
    unknown = {"cam01": (0.0, np.nan, np.nan, "assumed_zero")}
    many = {f"walk_{i}": unknown for i in range(clocks.MOST_NAMES + 1)}
    known = {sequence: one.clocks for sequence, one in told(capture).items()}
    clocks.overview(tmp_path / "all.svg", {"indoor": many, "outdoor": many | known})
    nan = clocks.SequenceClocks(unknown, {"cam01": (LAGS_S, np.full(len(LAGS_S), np.nan))}, (), ())
    clocks.costs(tmp_path / "one.svg", nan)
    for name in ("all.svg", "one.svg"):
        assert (tmp_path / name).stat().st_size > 2000
