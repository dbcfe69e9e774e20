"""The table of cameras: what of many is folded, what is told at once, what is struck out."""

import pytest

from dior.report import overview
from dior.report.overview import NOTHING, CameraRow, Cell, RecordingRow
from dior.report.troubles import Fix, Trouble

SIGMA = Cell("0.50 px", "", 0.5)


def camera(session, name, *levels):
    troubles = tuple(Trouble(level, f"code_{i}", f"trouble {i}", ("walk_1",)) for i, level in enumerate(levels))
    cells = (SIGMA, *(NOTHING,) * (len(overview.COLUMNS) - 1))
    return overview._judged(CameraRow(session, name, "close", "good", "good", cells, (), ()), troubles)


def test_of_many_cameras_the_good_ones_are_folded_and_no_other():
    rows = [camera("lab", "cam01", "bad"), camera("field", "cam01", "look")]
    rows += [camera(session, f"cam{i:02d}") for session in ("lab", "field") for i in range(2, 9)]
    assert overview.folded(rows[: overview.UNFOLDED]) == [("", rows[: overview.UNFOLDED])]
    parts = overview.folded(rows)
    assert parts[0] == ("", rows[:2])
    assert [words for words, _ in parts[1:]] == ["field: 7 cameras are good", "lab: 7 cameras are good"]
    assert sorted(row.name for _, part in parts for row in part) == sorted(row.name for row in rows)


def test_the_first_trouble_is_told_at_once_and_each_that_is_to_fix():
    row = camera("lab", "cam01", "bad", "look", "bad", "look")
    assert [one.text for one in row.told] == ["trouble 0", "trouble 2"]
    assert [one.text for one in row.more] == ["trouble 1", "trouble 3"]


def test_the_sigma_of_a_camera_that_is_red_is_struck_out():
    assert camera("lab", "cam01", "bad").cells[0].struck and not camera("lab", "cam01", "look").cells[0].struck


def test_the_sigma_of_walks_that_something_draws_aside_is_struck_out_and_of_a_camera_all_of_whose_walks_are():
    def row(*aside):
        cells = (SIGMA, *(NOTHING,) * (len(overview.COLUMNS) - 1))
        each = tuple(RecordingRow(walk, "", "look", "", cells, "") for walk in ("walk_1", "walk_2"))
        own = Trouble("look", "camera_turned", "its labels lie 3.4 px left", aside)
        return overview._judged(CameraRow("lab", "cam01", "close", "look", "", cells, (), each), (own,))

    one, both = row("walk_2"), row("walk_1", "walk_2")
    assert [each.cells[0].struck for each in (*one.recordings, one)] == [False, True, False]
    assert [each.cells[0].struck for each in (*both.recordings, both)] == [True, True, True]
    assert overview.aside([one]) == {("walk_2", "cam01")}


@pytest.mark.parametrize(
    ("lags", "text"),
    [
        ([(1.0, -2.0, 4.0, "estimated")], "\u00b1 3 ms"),
        ([(1.0, 1.0, 1.0, "manual")], "by hand"),
        ([(1.0, -4.0, 6.0, "manual")], "\u00b1 5 ms, by hand"),
        ([(1.0, 1.0, 1.0, "manual"), (0.0, -45.0, 45.0, "estimated")], "\u00b1 45 ms, 1 by hand"),
        ([(0.0, 0.0, 0.0, "reference")], "reference"),
    ],
)
def test_a_clock_that_was_typed_is_not_said_to_be_exact(lags, text):
    assert overview._clock(lags).text == text


def test_a_walk_whose_trouble_follows_from_another_walk_says_what_to_type_there():
    each = tuple(RecordingRow(walk, "", "look", "", (), "") for walk in ("walk_1", "walk_2", "walk_3"))
    fix = Fix("config/offsets/walk_1.yaml", "remove the line of cam02")
    own = Trouble("bad", "clock_contradicts", "0.8 pictures off", ("walk_1",), fix, (("walk_2 cam03", "5 px"),))
    typed = overview.typed([CameraRow("field", "cam02", "close", "bad", "", (), (own,), each)])
    assert {walk: [(one["camera"], one["of"], one["what"]) for one in lines] for walk, lines in typed.items()} == {
        "walk_1": [("cam02", "", fix.what)], "walk_2": [("cam02", "walk_1", fix.what)],
    }  # fmt: skip
