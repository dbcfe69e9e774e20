"""Folders and files as people call them: blanks, quotes, an umlaut, letters of another script, signs of the shell."""

import re

import pytest

from dior.simulate import config, settings
from tests.end_to_end.workflow import edit, planned, snakemake

TINY = {"subjects": 1, "sequences": 1, "duration_s": 3.0, "width": 640, "height": 360, "fx": 320.0, "gallery": True}
FOLDER = """Käthe's "2nd" capture, 60 m & 歩行 $HOME;*"""
DATA = """my 'raw' data/Größe "x" #1 $(id) `a`"""


@pytest.mark.slow
def test_a_project_and_its_data_may_be_called_anything_but_braces(tmp_path):
    project = tmp_path / FOLDER
    config.write(settings.from_dict(TINY), project / "config")
    quoted = DATA.replace("'", "''")
    edit(project / "config/config.yaml", "data_root: results/simulate", f"data_root: '{quoted}'")
    snakemake(project, "all", "release")
    assert planned(project) == {}
    assert {path.name for path in (project / DATA).iterdir()} >= {"indoor_01", "outdoor_01", "truth", "gallery"}
    assert list((project / "results/release").glob("*.tar")) and not list(tmp_path.glob("id*"))


@pytest.mark.parametrize(
    ("file", "old", "new", "part"),
    [
        ("config.yaml", "data_root: results/simulate", 'data_root: "{wild}"', "'data_root' is '{wild}' with '{'"),
        ("config.yaml", "data_root: results/simulate", "data_root: -x", "begins with - .* write './-x'"),
        ("config.yaml", "data_root: results/simulate", 'data_root: "a\\nb"', r"'data_root' is 'a b' with '\\n'"),
        ("sequences.tsv", "outdoor_01/pc1.bag", "{x}/pc1.bag", r"line \d: bags is '{x}/pc1.bag' with '{'"),
        ("sequences.tsv", "indoor_01/mocap.c3d", "a}.c3d", r"line \d: mocap is 'a}.c3d' with '}'"),
        ("subjects.tsv", "S01", "-S01", "line 2: 'subject' is '-S01' but should be a name of letters"),
        ("subjects.tsv", "S01", "S" * 101, "at most 100"),
    ],
)
def test_names_that_the_workflow_would_take_for_something_else(tmp_path, file, old, new, part):
    from dior.errors import DiorError
    from dior.project import project

    config.write(settings.from_dict(TINY), tmp_path / "config")
    edit(tmp_path / "config" / file, old, new)
    with pytest.raises(DiorError) as caught:
        project.load(tmp_path)
    assert re.search(part, str(caught.value)), str(caught.value)
    assert f"config/{file}" in str(caught.value)
