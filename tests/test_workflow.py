"""The workflow as text: no lint but the one about conda, and one name per step everywhere."""

import re

from dior.cli import STEPS
from tests.end_to_end.workflow import ROOT, snakemake

RULES = {
    name: text
    for path in sorted((ROOT / "workflow/rules").glob("*.smk"))
    for name, text in re.findall(r"^rule (\w+):\n(.*?)(?=^rule |\Z)", path.read_text(), re.MULTILINE | re.DOTALL)
}
TARGETS = {"all", "release"}


def test_no_lint_but_conda(tmp_path):
    from dior.simulate import config, settings

    config.write(settings.Settings(), tmp_path / "config")
    _, text = snakemake(tmp_path, "--lint", check=False)
    found = set(re.findall(r"^    \* (.*)$", text, re.MULTILINE))
    assert found == {"Specify a conda environment or container for each rule.:"}


def test_rule_is_subcommand_is_log_folder():
    assert len(RULES) > 15
    for name, text in RULES.items():
        if name in TARGETS:
            continue
        step = name.partition("_")[0] if name.startswith("simulate") else name
        assert f'"dior {step}"' in text, name
        assert step in STEPS, name
        assert "    log:\n" in text and "    benchmark:\n" in text and "code=code(" in text, name
        assert f'code=code("{STEPS[step][0]}")' in text, name


def test_every_step_has_a_rule():
    assert set(STEPS) <= set(RULES)


def test_only_evaluate_reads_the_truth():
    """The truth of a simulated capture must not help to make the labels."""
    readers = {name for name, text in RULES.items() if "truth" in text.split("output:")[0]}
    assert readers == {"evaluate"}
    inputs = "".join(path.read_text() for path in sorted((ROOT / "workflow/inputs").glob("*.smk")))
    users = {name for name, text in RULES.items() for part in re.findall(r"=(truth\w*)", text)}
    assert users == {"evaluate"} and inputs.count("PROJECT.truth(") == 2
