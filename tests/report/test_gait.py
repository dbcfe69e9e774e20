"""The gait on the page of a walk."""

import numpy as np
import pytest

from dior.report import gait, walk_figures
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.simulate.patterns import RUN
from tests.gait.test_gait import FPS, noisy, walker, written  # noqa: F401


@pytest.fixture
def shown(tmp_path):
    """`gait.Gait` of joints, and the table `gait_parameters` that it is of."""

    def of(points, covariance=None):
        made = written(tmp_path, points, covariance=covariance)[0]
        return gait.read(tmp_path / "out.parquet", tmp_path / "events.parquet"), made

    return of


def test_the_table_has_values_with_intervals_that_are_never_nothing(shown, walker):  # noqa: F811
    walked, made = shown(*noisy(walker))
    rows = {row["name"]: row for row in walked.rows}
    assert rows["walking speed"]["both"].startswith("1.1") and "treadmill" not in rows
    of = {(p, s): v for p, s, v in zip(made["parameter"], made["side"], made["value"], strict=True)}
    assert rows["stance"]["left"].startswith(f"{100 * of['stance_share', 'left']:.1f} ± ")
    assert rows["cadence"]["left"] == "" and rows["cadence"]["n"] == str(made["n"][made["parameter"] == "cadence"][0])
    for row in walked.rows:
        within = [row[side].partition(" ± ")[2] for side in ("left", "right", "both") if row[side]]
        assert within and all(float(one) > 0 for one in within)


def test_stances_are_between_strike_and_toe_off(shown, walker):  # noqa: F811
    walked, _ = shown(*noisy(walker))
    true = walker.contacts
    for side, foot in enumerate(("left", "right")):
        lane = walked.lanes[foot]
        own = true.foot == side
        strikes, offs = true.seconds[own & true.strike], true.seconds[own & ~true.strike]
        assert len(lane.used) > 2
        for column, truth in zip(lane.used.T, (strikes, offs), strict=True):
            assert np.abs(column[:, None] - truth).min(axis=1).max() < 0.03


def test_a_long_walk_is_drawn_from_its_first_step_on(shown):
    long = Walker(Body(1.75), speed=1.1, half_length=60.0, start=2.0, until=41.0)
    walked, _ = shown(long.at(np.arange(0, 40, 1 / FPS))[0])
    first, last = gait.span(walked.lanes)
    assert last - first == pytest.approx(gait.LONGEST_S) and 0 < first < 2


def test_running_and_what_has_no_steps_are_said(shown, tmp_path):
    runner = Walker(Body(1.75), RUN, speed=2.3, half_length=40.0, start=2.0, until=8.0)
    walked, _ = shown(runner.at(np.arange(0, 7, 1 / FPS))[0])
    assert any("running" in note for note in walked.notes)
    assert not any(row["name"] == "double support" for row in walked.rows)
    assert shown(np.full((60, 33, 3), np.nan))[0] is None
    assert walk_figures.Drawn(tmp_path, "plots", "walk_1").gait(None) is None


def test_the_figure_is_the_same_bytes_and_can_be_read_at_night(shown, walker, tmp_path):  # noqa: F811
    walked, _ = shown(*noisy(walker))
    texts = set()
    for _ in range(2):
        found = walk_figures.Drawn(tmp_path, "plots", "walk_1").gait(walked)
        texts.add((tmp_path / "gait.svg").read_text())
    assert len(texts) == 1 and "prefers-color-scheme" in texts.pop() and found["src"] == "plots/gait.svg"
