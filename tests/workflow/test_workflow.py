"""The workflow as text: no lint but the one about conda, and one name per step everywhere."""

import re

import pytest

from dior.cli.steps import STEPS
from dior.project.steps import MODULES, place_of
from tests.end_to_end.workflow import ROOT, snakemake

RULES = {
    name: text
    for path in sorted((ROOT / "workflow/rules").glob("*.smk"))
    for name, text in re.findall(r"^rule (\w+):\n(.*?)(?=^rule |\Z)", path.read_text(), re.MULTILINE | re.DOTALL)
}
TARGETS = {"all", "release"}
# what a step writes besides
BESIDE = {"report": {"results/timing.csv"}}


def test_no_lint_but_conda(tmp_path):
    from dior.simulate import config, settings

    config.write(settings.Settings(), tmp_path / "config")
    _, text = snakemake(tmp_path, "--lint", check=False)
    found = set(re.findall(r"^    \* (.*)$", text, re.MULTILINE))
    assert found == {"Specify a conda environment or container for each rule.:"}


def test_one_name_per_step():
    """Rule = subcommand = module = log folder; the results folder is the step's own, or in the table."""
    assert set(RULES) - TARGETS == set(MODULES)
    for step in MODULES:
        text = RULES[step]
        assert f'"dior {step}"' in text or '"../scripts/step.py"' in text, step
        assert MODULES[step].endswith(f".{step}") and f'code=code("{MODULES[step]}")' in text, step
        assert (
            set(re.findall(r'"logs/(\w+)/', text)) == {step} and "    log:\n" in text and "    benchmark:\n" in text
        ), step


def outputs_of(folder, *targets):
    """The outputs of each rule in a dry run."""
    _, text = snakemake(folder, "-n", *targets)
    found = {}
    for step, files in re.findall(r"^(?:local)?rule (\w+):\n(?:    input: .*\n)?    output: (.*)$", text, re.MULTILINE):
        found.setdefault(step, set()).update(files.split(", "))
    return found


def test_results_lie_in_the_folder_of_the_step_or_of_the_table(tmp_path):
    from dior.simulate import config, settings

    config.write(settings.Settings(), tmp_path / "config")
    found = outputs_of(tmp_path, "all", "release", "reid", "results/evaluate/to_mark")
    assert len(found) > 30
    for step, files in found.items():
        if step in MODULES:
            place = place_of(step).replace("<data_root>", "results/simulate")
            outside = {path for path in files if not path.startswith(f"{place}/")} - BESIDE.get(step, set())
            assert not outside, step


def test_a_release_is_made_anew_where_anything_of_one_is(tmp_path):
    """An empty folder is none; pictures that a build which was cut short left behind may be of who withdrew."""
    release = tmp_path / "dior-[0.1]"
    functions = {"RELEASE": str(release)}
    exec((ROOT / "workflow/inputs/release.smk").read_text(), functions)
    functions["release_outputs"] = lambda: ["all of it"]
    assert functions["existing_release"]() == []
    (release / "frames/somebody").mkdir(parents=True)
    assert functions["existing_release"]() == []
    (release / "frames/somebody/walk_1.cam01.parquet").touch()
    assert functions["existing_release"]() == ["all of it"]
    assert re.search(r"^rule all:.*?existing_release\(\)", (ROOT / "Snakefile").read_text(), re.MULTILINE | re.DOTALL)


def test_what_a_script_is_given_is_what_its_step_takes():
    """Of what the rule names, the script takes what is a flag; so none may be spelled otherwise."""
    scripts = [name for name, text in RULES.items() if "    script:\n" in text]
    assert scripts == ["metrics", "statistics", "recognise", "package", "report"]
    for name in scripts:
        named = set(re.findall(r"^        (\w+)=", RULES[name], re.MULTILINE))
        assert {flag.replace("-", "_") for flag in STEPS[name][2]} <= named, name


def longest_commands(folder, subjects):
    """The length of the longest command of each rule in a project of that many subjects with two walks each."""
    from dior.simulate import config, settings

    config.write(settings.from_dict({"subjects": subjects, "sequences": 2}), folder / "config")
    _, text = snakemake(folder, "-n", "-p", "release", "report", "reid")
    found = {}
    for command in re.findall(r"(dior \w+ --.*?) 2>&1 \| tee", text):
        step = command.split()[1]
        found[step] = max(found.get(step, 0), len(command))
    return found


@pytest.mark.slow
def test_no_command_grows_too_long_with_the_walks(tmp_path):
    """Linux takes 131072 bytes in one argument, and `bash -c` is given a job's command as one."""
    few, many = longest_commands(tmp_path / "few", 2), longest_commands(tmp_path / "many", 6)
    assert len(few) > 20
    for step, length in few.items():
        per_walk = (many[step] - length) / 8
        assert length + 1000 * per_walk < 131072, f"{step}: {per_walk} bytes per walk"


def test_every_step_has_a_rule():
    assert set(STEPS) <= set(RULES)


def test_only_evaluate_reads_the_truth():
    """The truth of a simulated capture must not help to make the labels."""
    readers = {name for name, text in RULES.items() if "truth" in text.split("output:")[0]}
    assert readers == {"evaluate"}
    inputs = "".join(path.read_text() for path in sorted((ROOT / "workflow/inputs").glob("*.smk")))
    users = {name for name, text in RULES.items() for part in re.findall(r"=(truth\w*)", text)}
    assert users == {"evaluate"} and inputs.count("PROJECT.truth(") == 2
