"""The script of the rules over all sequences, run as Snakemake does: with a job of a name of its own."""

import subprocess
import sys

import pytest

from tests.end_to_end.workflow import ROOT

# what a script finds in its name `snakemake`
JOB = """
from types import SimpleNamespace
snakemake = SimpleNamespace(rule="metrics", log=["job.log"], input={inputs}, output={{"out": "metrics.csv"}},
    params={{"code": "not a flag"}}, wildcards={{}})
"""


def ran(folder, inputs):
    text = JOB.format(inputs=inputs) + (ROOT / "workflow/scripts/step.py").read_text()
    done = subprocess.run(
        [sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, env={"PYTHONPATH": str(ROOT)}
    )
    return done.returncode, done.stdout + done.stderr


def test_more_files_than_a_command_line_takes(tmp_path):
    from dior.tables import tables

    name = f"{'long' * 60}.parquet"
    tables.write(tmp_path / name, "metrics", {key: [] for key in tables.columns_of("metrics")})
    code, text = ran(tmp_path, f"{{'inputs': [{name!r}] * 600, 'checks': []}}")
    assert (code, text) == (0, "")
    assert (tmp_path / "metrics.csv").read_text().count("\n") == 1


@pytest.mark.parametrize(
    ("inputs", "word"),
    [("{'inputs': ['lost.parquet'], 'checks': []}", "dior metrics: lost.parquet"), ("None", "Traceback")],
)
def test_what_goes_wrong_is_on_the_screen_and_in_the_log(tmp_path, inputs, word):
    code, text = ran(tmp_path, inputs)
    assert code == 1 and word in text and (tmp_path / "job.log").read_text() == text
