"""`dior run`: the right project, Snakefile, profile and cores, and everything else is Snakemake's."""

import os
import re
import subprocess
import sys

import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.project import run
from tests.end_to_end.workflow import ROOT


@pytest.fixture
def projects(tmp_path, monkeypatch):
    """Two folders with a config in an empty one, which is where we are; the folder above is this test's, too."""
    here = tmp_path / "projects"
    for name in ("walks", "field trip"):
        (here / name / "config").mkdir(parents=True)
        (here / name / "config/config.yaml").write_text("data_root: data\n")
    monkeypatch.chdir(here)
    return here


@pytest.fixture
def typed(monkeypatch):
    """A function that types `dior run`; it gives the words that Snakemake would begin with."""

    def began(program, words):
        assert program == words[0] == sys.executable
        raise SystemExit(" ".join(words[1:]))

    monkeypatch.setattr(os, "execv", began)
    monkeypatch.setattr(run, "cores", lambda: 7)

    def type_(*words):
        with pytest.raises(SystemExit) as end:
            main.main(["run", *words])
        return end.value.code.removeprefix("-P -m snakemake ")

    return type_


OURS = f"--snakefile {ROOT}/Snakefile --workflow-profile {ROOT}/profiles/default"


def test_the_project_is_named_or_where_one_is(projects, typed, monkeypatch):
    assert typed("walks") == f"{OURS} --cores 7 --directory {projects}/walks"
    assert typed("field trip", "release", "-n") == f"{OURS} --cores 7 --directory {projects}/field trip release -n"
    monkeypatch.chdir(projects / "walks")
    assert typed() == typed(".") == f"{OURS} --cores 7 --directory {projects}/walks"
    assert typed("release") == f"{OURS} --cores 7 --directory {projects}/walks release"
    (projects / "walks/release").mkdir()
    assert typed("release") == f"{OURS} --cores 7 --directory {projects}/walks release"
    assert typed("-n", "--until", "refine").endswith("/walks -n --until refine")


@pytest.mark.parametrize(
    ("words", "filled"),
    [
        ("-j4 -n", OURS), ("-j 4", OURS), ("--cores=4", OURS), ("--jobs 4", OURS), ("-c all", OURS), ("-e slurm", OURS),
        ("--jobscript x", f"{OURS} --cores 7"), ("--config a=b", f"{OURS} --cores 7"),
        ("-k -C a=b", f"{OURS} --cores 7"),
        ("--workflow-profile plain", f"--snakefile {ROOT}/Snakefile --cores 7"), ("--profile mine", OURS),
        ("-s x", "--cores 7"),
    ],
)  # fmt: skip
def test_what_is_given_is_not_filled_in(words, filled, projects, typed):
    assert typed("walks", *words.split()) == f"{filled} --directory {projects}/walks {words}"


def test_where_there_is_no_project_it_is_said(projects, capsys):
    for words, said in (
        ((), "there is no config/config.yaml here"),
        (
            ("../nothing",),
            "../nothing: there is no config/config.yaml in it, and the project's folder is the first word; ",
        ),
        (
            ("./walk",),
            "./walk: there is no config/config.yaml in it, and the project's folder is the first word (did you",
        ),
        (
            ("nowhere", "-n"),
            "nowhere: there is no config/config.yaml in it, and the project's folder is the first word; ",
        ),
        (
            ("Walk", "-n"),
            "Walk: there is no config/config.yaml in it, and the project's folder is the first word (did y",
        ),
        (("-n", "walks"), "walks: the project's folder is the first word (`dior run walks -n`)"),
        (("-n",), "there is no config/config.yaml here"),
        (("walks/config",), f"walks/config: lies in the project {projects}/walks; name that"),
    ):
        assert main.main(["run", *words]) == 1
        assert capsys.readouterr().err.startswith(f"dior run: {said}"), words


def test_without_the_clone_it_is_said_where_the_workflow_is(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "CLONE", tmp_path)
    with pytest.raises(DiorError, match=r"it is in the clone; .*--snakefile <clone>/Snakefile"):
        run.filled_in(["-n"])
    assert run.filled_in(["--snakefile", "x", "-j1"]) == []


def dior(*words, cwd):
    done = subprocess.run(
        [sys.executable, "-m", "dior", *map(str, words)],
        cwd=cwd, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def test_snakemakes_exit_code_is_that_of_dior(projects):
    """With a Snakefile of two lines, which starts in a second; the profile is then the one beside it, here none."""
    (projects / "Snakefile").write_text("rule good:\n    shell: 'pwd'\nrule bad:\n    shell: 'exit 3'\n")
    # what lies where one is must not be taken for a module of Snakemake
    (projects / "yaml.py").write_text("raise RuntimeError\n")
    code, text = dior("run", "walks", "-s", "Snakefile", "good", cwd=projects)
    assert code == 0 and f"{projects}/walks\n" in text
    assert dior("run", "walks", "-s", "Snakefile", "bad", cwd=projects)[0] == 1


@pytest.mark.slow
def test_it_plans_the_demo_from_anywhere(tmp_path):
    assert main.main(["simulate", "--write-config", str(tmp_path / "mine/config"), "--settings", "{}"]) == 0
    code, text = dior("run", "mine", "-n", cwd=tmp_path)
    assert code == 0 and re.search(r"^triangulate +4  not made yet$", text, re.MULTILINE)
    assert "steps would run. Nothing was run." in text
    # what Snakemake says of a dry run
    assert not re.search("Job stats|Reasons|dry-run|Workflow start|provenance information", text)
