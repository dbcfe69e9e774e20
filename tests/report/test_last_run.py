"""What became better or worse since the figures changed."""

from dior.report import last_run

FIRST = {"lab/cam01": {"level": "bad", "sigma_px": 1.0}, "lab/cam02": {"level": "good", "sigma_px": 1.0}}


def test_the_first_run_compares_with_nothing(tmp_path):
    assert last_run.compared(tmp_path, FIRST) == {"lab/cam01": "", "lab/cam02": ""}


def test_a_change_is_told_and_told_again_by_the_same_results(tmp_path):
    last_run.compared(tmp_path, FIRST)
    now = {"lab/cam01": {"level": "good", "sigma_px": 1.0}, "lab/cam02": {"level": "good", "sigma_px": 1.5},
           "lab/cam03": {"level": "good"}}  # fmt: skip
    told = last_run.compared(tmp_path, now)
    assert told == {"lab/cam01": "better", "lab/cam02": "worse: \u03c3 of a label 1.00 to 1.50 px", "lab/cam03": "new"}
    kept = (tmp_path / last_run.NAME).read_bytes()
    assert last_run.compared(tmp_path, now) == told and (tmp_path / last_run.NAME).read_bytes() == kept


def test_a_mend_is_told_with_the_figure_that_proves_it_and_a_hundredth_of_a_pixel_is_no_change(tmp_path):
    last_run.compared(tmp_path, {"a": {"level": "bad", "beside_px": 4.0}, "b": {"level": "good", "beside_px": 0.02}})
    told = last_run.compared(
        tmp_path, {"a": {"level": "good", "beside_px": 0.1}, "b": {"level": "good", "beside_px": 0.01}}
    )
    assert told == {"a": "better, off hand boxes 4.00 to 0.10 px", "b": ""}


def test_a_file_that_is_not_whole_is_none(tmp_path):
    (tmp_path / last_run.NAME).write_text('{"now": ')
    assert last_run.compared(tmp_path, FIRST) == {"lab/cam01": "", "lab/cam02": ""}
