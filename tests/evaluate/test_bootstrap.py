"""Intervals over subjects: against a plain loop, known coverage, none with one subject, and the same bytes twice."""

import numpy as np
import pytest

from dior.evaluate import bootstrap, metrics
from dior.tables import tables


def looped(groups, figure):
    """The interval by the plainest of loops over the same draws; `groups`: arrays by subject, in bootstrap's order."""
    found = []
    for times in bootstrap.draws(len(groups)):
        found.append(figure(np.concatenate([np.tile(g, t) for g, t in zip(groups, times, strict=True)])))
    return np.percentile(found, [2.5, 97.5])


@pytest.fixture
def groups():
    rng = np.random.default_rng(0)
    return [rng.normal(m, 1, n) for m, n in ((3.0, 5), (5.0, 8), (1.0, 13), (4.0, 21))]


def test_draws_are_of_as_many_subjects_with_replacement():
    times = bootstrap.draws(5)
    assert times.shape == (2000, 5) and (times.sum(axis=1) == 5).all() and times.max() > 2
    np.testing.assert_allclose(times.mean(axis=0), 1, atol=0.1)


def test_interval_of_a_mean_is_that_of_a_loop(groups):
    found = bootstrap.of_mean(np.array([g.sum() for g in groups]), np.array([len(g) for g in groups]))
    np.testing.assert_allclose(found, looped(groups, np.mean))
    assert found[0] < np.concatenate(groups).mean() < found[1]


@pytest.mark.parametrize("q", [0.5, 0.95])
def test_interval_of_a_quantile_is_that_of_a_loop(groups, q):
    values = np.concatenate(groups)
    subject = np.repeat(["D", "A", "C", "B"], [len(g) for g in groups])
    shuffled = np.random.default_rng(1).permutation(len(values))
    found = bootstrap.of_quantile(values[shuffled], subject[shuffled], q)
    np.testing.assert_allclose(found, looped(groups, lambda v: np.quantile(v, q)))


def test_one_subject_has_no_interval():
    assert np.isnan(bootstrap.of_mean(np.array([3.0]), np.array([2]))).all()
    assert np.isnan(bootstrap.of_quantile(np.arange(5.0), np.full(5, "S1"), 0.5)).all()


def test_equal_subjects_have_an_interval_of_no_width():
    assert bootstrap.of_mean(np.full(6, 8.0), np.full(6, 4)) == (2.0, 2.0)


def test_names_of_the_subjects_change_nothing(groups):
    """A release has pseudonyms."""
    values, n = np.concatenate(groups), [len(g) for g in groups]
    one, other = (bootstrap.of_quantile(values, np.repeat(list(names), n), 0.5) for names in ("ABCD", "CADB"))
    assert one == other


def test_interval_holds_the_true_mean_about_as_often_as_it_says():
    """Of many subjects; the percentile interval is known to be a little narrow."""
    rng, held = np.random.default_rng(5), 0
    for _ in range(300):
        sums = rng.normal(2.0, 1.0, 30) * 10
        low, high = bootstrap.of_mean(sums, np.full(30, 10))
        held += low <= 2.0 <= high
    assert 0.89 < held / 300 < 0.98


def row(value, n, subject, **key):
    return {
        **dict.fromkeys(metrics.COLUMNS, ""), "metric": "reprojection_error", "unit": "px", "low": np.nan,
        "high": np.nan, "value": value, "n": n, "subject": subject, "sequence": f"walk_{subject}", "camera": "cam01",
        "role": "close", **key,
    }  # fmt: skip


def test_rows_over_subjects_have_an_interval_and_no_others():
    rows = [row(1.0, 10, "S1"), row(2.0, 30, "S2"), row(4.0, 20, "S3"), row(4.0, 20, "S3", camera="cam02")]
    rows += [row(1.0, 10, "", sequence="", metric="adjust_error_before")]
    found = metrics.merged(rows)
    for one in found:
        over = not one["subject"] and one["metric"] == "reprojection_error" and one["camera"] != "cam02"
        assert np.isfinite([one["low"], one["high"]]).all() == over, one
    pooled = [r for r in found if r["camera"] == "cam01" and not r["subject"] and r["metric"] == "reprojection_error"]
    (of_camera,) = pooled
    assert (of_camera["value"], of_camera["n"]) == (pytest.approx(150 / 60), 60)
    interval = bootstrap.of_mean(np.array([10.0, 60, 80]), np.array([10, 30, 20]))
    assert (of_camera["low"], of_camera["high"]) == pytest.approx(interval)


def test_hand_checks_give_median_and_p95_over_all_their_values(tmp_path):
    errors = np.arange(1.0, 21.0)
    table = {
        "subject": np.repeat(np.array(["S1", "S2"], object), 10),
        "sequence": np.repeat(np.array(["a", "b"], object), 10),
        "camera": np.tile(np.array(["cam01", "cam02"], object), 10),
        "role": np.full(20, "close", object),
        "joint": np.full(20, "LASI", object),
        "frame": np.arange(20),
        "error": errors,
    }
    for name in "ab":
        tables.write(tmp_path / f"{name}.parquet", "check_errors", tables.rows(table, table["sequence"] == name))
    empty = tmp_path / "none.parquet"
    tables.write(empty, "check_errors", {"camera": []})
    paths = [tmp_path / "a.parquet", tmp_path / "b.parquet", empty]
    metrics.run(inputs=[], checks=paths, out=tmp_path / "1.csv")
    metrics.run(inputs=[], checks=paths[::-1], out=tmp_path / "2.csv")
    assert (tmp_path / "1.csv").read_bytes() == (tmp_path / "2.csv").read_bytes()
    rows = metrics.read(tmp_path / "1.csv")
    found = {(r["metric"], r["subject"], r["sequence"], r["camera"], r["role"]): r for r in rows}
    assert len(found) == len(rows)
    everything = found["check_error_p95", "", "", "", ""]
    assert (everything["value"], everything["n"]) == (pytest.approx(np.quantile(errors, 0.95)), 20)
    assert everything["low"] < everything["value"] <= everything["high"]
    assert found["check_error_median", "S2", "b", "cam01", "close"]["value"] == np.median(errors[10::2])
    assert found["check_error_median", "", "", "cam02", "close"]["value"] == np.median(errors[1::2])
    assert found["check_error_median", "S1", "", "", ""]["value"] == 5.5
    assert np.isnan(found["check_error_median", "S1", "", "", ""]["low"])
