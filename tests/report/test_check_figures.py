"""What is drawn of the pooled rows of metrics.csv, and the lines of the table of key figures."""

import numpy as np
import pandas as pd
import pytest

from dior.evaluate.metrics import COLUMNS
from dior.geometry import camera_tables
from dior.report import certainty, check_figures, key_figures
from dior.tables import tables


def row(metric, value, n, **columns):
    pooled = dict.fromkeys(COLUMNS, "") | {"low": np.nan, "high": np.nan, "unit": "px"}
    return pooled | {"metric": metric, "value": value, "n": n} | columns


def table(*rows):
    return pd.DataFrame(rows, columns=COLUMNS)


def test_nothing_is_drawn_of_what_was_not_measured():
    other = row("coverage", 0.9, 10, role="close", camera="cam01")
    for rows in ((), (other,)):
        for draw in (check_figures.indoor, check_figures.long_range, check_figures.detectors):
            assert draw(table(*rows)) == []


def test_a_camera_of_two_roles_is_drawn_with_the_one_of_more_values():
    drawn = check_figures.indoor(
        table(
            row("check_error", 2.0, 30, role="close"),
            row("check_error", 1.0, 10, role="close", camera="cam01"),
            row("check_error", 5.0, 20, role="long_range", camera="cam01"),
            row("check_error", 9.0, 99, role="close", camera="cam01", subject="S01"),
        )
    )
    assert [one.name for one in drawn] == ["check_error_camera"]
    groups, values, _ = drawn[0].args
    assert groups == ["cam01", "all"]
    assert values["mean"]["cam01"] == pytest.approx((5.0, np.nan, np.nan, 20), nan_ok=True)
    assert values["mean"]["all"][0] == 2.0 and values["median"] == {}


def test_an_interval_is_only_that_of_the_same_values():
    rows = table(
        row("reprojection_error", 3.0, 50, low=2.0, high=4.0),
        row("reprojection_error", 3.0, 20, role="close", camera="cam01", low=1.0, high=5.0),
    )
    assert check_figures.interval(rows, "reprojection_error", 20, camera="cam01") == (1.0, 5.0)
    assert np.isnan(check_figures.interval(rows, "reprojection_error", 21, camera="cam01")).all()
    assert check_figures.whole(rows, "reprojection_error", 50) == (3.0, 2.0, 4.0, 50)
    assert check_figures.whole(rows, "reprojection_error", 20) is None


def test_detectors_are_drawn_far_ones_first_with_their_roles_where_there_are_both():
    rows = [row("detected_share", 0.5, 8, tool=tool, role="long_range") for tool in ("b", "a")]
    near = row("detected_share", 0.9, 8, tool="a", role="close")
    rows += [row("detected_share", 0.6, 16, tool="a")]
    assert list(check_figures.detectors(table(*rows))[0].args[0]) == ["a", "b"]
    assert list(check_figures.detectors(table(near, *rows))[0].args[0]) == [
        "a, long range",
        "b, long range",
        "a, close",
    ]


def test_key_figures_are_means_weighted_by_n_and_rows_of_no_sequence_as_they_are():
    assert key_figures.table_of([], {}) == []
    own = {"role": "close", "subject": "S01", "camera": "cam01"}
    lines = key_figures.table_of(
        [
            row("check_error", 1.0, 30, sequence="walk_1", **own),
            row("check_error", 5.0, 10, sequence="walk_2", **own),
            row("check_error", 7.0, 40, joint="nose", sequence="walk_1", **own),
            row("check_error", 99.0, 40),
            row("check_error_median", 4.0, 40),
            row("adjust_error_after", 3.0, 1000),
        ],
        {"walk_1": "indoor", "walk_2": "indoor"},
    )
    assert lines == [
        {"metric": "check_error", "where": "indoor close", "value": "2.00 px", "interval": "", "n": "40"},
        {"metric": "check_error_median", "where": "all", "value": "4.00 px", "interval": "", "n": "40"},
        {"metric": "adjust_error_after", "where": "all", "value": "3.00 px", "interval": "", "n": "1\u202f000"},
    ]


def test_key_figures_have_an_interval_over_the_subjects_where_there_are_several():
    rows = [
        row("check_error", value, 10, sequence="walk_1", role="close", subject=subject, camera="cam01")
        for subject, value in (("S01", 1.0), ("S02", 3.0))
    ]
    assert key_figures.table_of(rows, {"walk_1": "indoor"})[0]["interval"] == "1.00 to 3.00 px"


def test_standard_errors_of_poses_are_shown_in_degrees_and_centimetres(tmp_path):
    sigma = np.array([np.radians(0.1), np.radians(0.2), np.radians(0.3), 0.01, 0.02, 0.03])
    covariance = np.diag(sigma**2)
    covariance[0, 3] = covariance[3, 0] = 1e-6
    camera_tables.write_camera_covariance(tmp_path / "c.parquet", ["cam01"], covariance, "lab")
    assert certainty.spreads([tmp_path / "c.parquet"])["lab"]["cam01"] == pytest.approx([0.1, 0.2, 0.3, 1, 2, 3])


def test_a_bump_is_a_step_of_the_turns_since_the_first_walk(tmp_path):
    """The tables have each of four walks against the other three."""
    stood = np.array([0.0, 0.0, 0.6, 0.6])
    against = (stood - stood.mean()) * 4 / 3
    table = {"session": ["field"] * 4, "sequence": [f"walk_{i}" for i in range(4)], "camera": ["cam01"] * 4}
    table |= {f"turn_{axis}": against * (axis == "y") for axis in "xyz"}
    table |= {f"sigma_{axis}": np.full(4, 0.02) for axis in "xyz"}
    tables.write(tmp_path / "t.parquet", "camera_turns", table)
    names, length, sigma = certainty.turns([tmp_path / "t.parquet"])["field"]["cam01"]
    assert list(names) == table["sequence"]
    assert length == pytest.approx(stood) and sigma[2:] == pytest.approx([0.02, 0.02])


def test_key_figures_take_quantiles_over_everything_and_no_means_of_them():
    own = {"role": "close", "subject": "S01", "camera": "cam01"}
    rows = [row("check_error_p95", 9.0, 30, sequence="walk_1", **own), row("check_error_p95", 4.0, 40)]
    assert [(one["where"], one["value"]) for one in key_figures.table_of(rows, {"walk_1": "indoor"})] == [
        ("all", "4.00 px")
    ]
