"""The workflow as text: no lint but the one about conda, and one name per step everywhere."""

import os
import re
import shlex
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from dior.cli.flags import flags_of, parsed
from dior.project.steps import MODULES, place_of
from tests.check import recorded
from tests.end_to_end.workflow import ROOT, snakemake
from tests.project.test_project import root  # noqa: F401

# a rule by its name; one that is made in a loop is indented and says its step
BEGINS = r'^rule (\w+):\n|^    rule:\n(?:        """.*"""\n)?        name:\n            numbered\("(\w+)", number\)\n'


def rules_of(text):
    """The text of each rule by its name."""
    begun = [*re.finditer(BEGINS, text, re.MULTILINE)]
    ends = [one.start() for one in begun[1:]] + [len(text)]
    return {
        one[1] or one[2]: text[one.end() : end]
        if one[1]
        else re.sub(r"^    ", "", text[one.end() : end], flags=re.MULTILINE)
        for one, end in zip(begun, ends, strict=False)
    }


RULES = {}
for path in sorted((ROOT / "workflow/rules").glob("*.smk")):
    RULES |= rules_of(path.read_text())
TARGETS = {"all", "release"}
# what a step writes besides
BESIDE = {"report": {"results/timing.csv"}}


def test_no_lint_but_conda(tmp_path):
    from dior.simulate import config, settings

    config.write(settings.Settings(subjects=1, sequences=1), tmp_path / "config")
    _, text = snakemake(tmp_path, "--lint", check=False)
    found = set(re.findall(r"^    \* (.*)$", text, re.MULTILINE))
    assert found == {"Specify a conda environment or container for each rule.:"}


def test_one_name_per_step():
    """Rule = subcommand = module = log folder; the results folder is the step's own, or in the table."""
    assert set(RULES) - TARGETS == set(MODULES)
    for step in MODULES:
        text = RULES[step]
        assert f'    shell:\n        dior("{step}")\n' in text or '"../scripts/step.py"' in text, step
        assert MODULES[step].endswith(f".{step}") and f'code=code("{MODULES[step]}")' in text, step
        assert (
            set(re.findall(r'"logs/(\w+)/', text)) == {step} and "    log:\n" in text and "    benchmark:\n" in text
        ), step


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """What a dry run of the demo prints."""
    from dior.simulate import config, settings

    folder = tmp_path_factory.mktemp("printed")
    config.write(settings.Settings(subjects=1), folder / "config")
    return snakemake(folder, "-n", "-p", "all", "release", "reid", "results/evaluate/to_mark", "zoomed")[1]


def test_results_lie_in_the_folder_of_the_step_or_of_the_table(printed):
    outputs = r"^(?:local)?rule (\w+):\n(?:    input: .*\n)?    output: (.*)$"
    found = {}
    for step, files in re.findall(outputs, printed, re.MULTILINE):
        found.setdefault(step, set()).update(files.split(", "))
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


def test_the_tables_of_reid_are_asked_for_where_their_page_is(tmp_path, monkeypatch):
    """A step that failed has lost them, and is to fail again."""
    monkeypatch.chdir(tmp_path)
    functions = {
        "expand": lambda pattern, table: [pattern.format(table=name) for name in table],
        "os": os,
        "PROJECT": SimpleNamespace(processed_subjects=("S01", "S02")),
        "CONFIG": {"reid": {"networks": {}}},
    }
    exec((ROOT / "workflow/inputs/reid.smk").read_text(), functions)
    assert functions["existing_recognition"]() == []
    Path("results/reid").mkdir(parents=True)
    Path("results/reid/index.html").touch()
    assert functions["existing_recognition"]()[0] == "results/reid/table.csv"


# what Snakemake alone needs: inputs that the step is told of otherwise or finds through its tables, outputs that it
# writes into its folder, and parameters that re-run it
ALONE = {
    "input": {
        **dict.fromkeys(
            ("audit", "detect", "clocks", "align", "follow", "zoom", "overlays", "clip", "viewer"), {"bags"}
        ),
        **dict.fromkeys(("simulate", "simulate_mocap"), {"motion"}),
        "pixels": {"bags"},
        "heads": {"bags", "covariance", "label_clocks", "label_clock_gains"},
        "place": {"bags"},
        "detections": {"files", "bags"},
        "gallery": {"recordings"},
        "recognise": {"weights"},
        "package": {"by_hand", "license"},
    },
    "output": {
        "simulate": {"bags", "detections", "truth"},
        "simulate_gallery": {"frontal", "down"},
        "reid": {"page", "plots"},
        "report": {"page", "compared", "cost", "verdict", "plots", "viewer"},
    },
    "params": {
        "mocap": {"prefix"},
        "heads": {"label_code"},
        "reference": {"height"},
        "world": {"height"},
        "adjust": {"heights"},
        **dict.fromkeys(("triangulate", "people"), {"height"}),
        "detectors": {"tools"},
        "statistics": {"sheet"},
        "recognise": {"sheet", "detectors", "tools"},
        "report": {"sheet", "consents"},
        "package": {"sheets", "settings"},
    },
}


def names_of(step, section):
    """What a rule calls its inputs, outputs or params."""
    block = re.search(rf"^    {section}:\n((?:        .*\n)+)", RULES[step], re.MULTILINE)
    return set(re.findall(r"^        (\w+)=", block[1], re.MULTILINE)) if block else set()


@pytest.mark.parametrize("step", MODULES)
def test_a_rule_calls_things_by_the_flags_of_its_step(step):
    """So nothing is written twice: the shell line and the script take what has a flag's name (common.smk, step.py)."""
    flags = flags_of(step)
    named = {section: names_of(step, section) for section in ("input", "output", "params")}
    outputs = re.search(r"^    output:\n((?:        .*\n)+)", RULES[step], re.MULTILINE)[1]
    given = set().union(re.findall(r"\{(\w+)\}", outputs), *named.values())
    assert flags.keys() - given == {name for name, flag in flags.items() if flag.default and name not in given}
    for section, names in named.items():
        alone = ALONE[section].get(step, set()) | ({"code", "contents"} & names if section == "params" else set())
        assert names - flags.keys() == alone, section


def test_the_rules_over_all_sequences_or_a_session_are_scripts():
    """Their lists of files outgrow a command line."""
    scripts = [name for name, text in RULES.items() if "    script:\n" in text]
    assert scripts == ["moved", "metrics", "statistics", "recognise", "package", "report"]


def test_what_is_printed_can_be_pasted(printed):
    commands = re.findall(r"(dior \w+ --.*?) 2>&1 \| tee logs/", printed)
    assert len(commands) > 120
    lines = {words[1]: words[2:] for words in map(shlex.split, commands)}
    scripts = {name for name, text in RULES.items() if "    script:\n" in text}
    # the demo has neither detections of its own network, nor a gallery, nor other detectors, nor a reference, nor a key
    # to sign with, and labels the subject alone
    not_there = {"detect", "gallery", "simulate_gallery", "detectors", "sign", "reference", "people"}
    assert MODULES.keys() - lines.keys() == scripts | not_there
    for step, words in lines.items():
        given = parsed(step, words)
        assert given.keys() == flags_of(step).keys(), step
    assert parsed("locate", lines["locate"])["ransac_px"] == 8.0
    assert parsed("frames", lines["frames"])["topics"]["cam01"] == "/cam01/color/image_raw/compressed"
    assert parsed("adjust", lines["adjust"])["physics"].keys() >= {"speed_m_s"}


def test_what_is_printed_names_nobody_and_tells_no_height(printed):
    """Nor is it in the parameters of scripts, which Snakemake keeps and prints as the reason to run again."""
    people = [line.split("\t") for line in (ROOT / "config/subjects.tsv").read_text().splitlines()[1:]]
    words = {word for name, _, height, *_ in people for word in (name, height)}
    assert len(words) > 2 and not re.findall(rf"(?<![\w.])(?:{'|'.join(map(re.escape, words))})(?![\w.])", printed)
    assert re.search(r"--known \S*heights.* --people config/subjects.tsv", printed)
    rules = "".join(RULES.values())
    assert not re.findall(r"as_json\([^)]*PROJECT\.(?:rows|subjects)\b", rules)


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


def test_only_evaluate_reads_the_truth():
    """The truth of a simulated capture must not help to make the labels."""
    readers = {name for name, text in RULES.items() if "truth" in text.split("output:")[0]}
    assert readers == {"evaluate"}
    inputs = "".join(path.read_text() for path in sorted((ROOT / "workflow/inputs").glob("*.smk")))
    users = {name for name, text in RULES.items() for part in re.findall(r"\b(truth_\w+)", text)}
    assert users == {"evaluate"} and inputs.count("PROJECT.truth(") == 2


BAD_CONFIGS = {
    "Latin-1": (b"data_root: caf\xe9\n", "config/config.yaml line 1: the byte 0xe9 is not UTF-8"),
    "an open bracket": (b"a: 1\ndata_root: [\n", "config/config.yaml line 3: not valid YAML"),
    "a key that is given twice": (b"data_root: a\ndata_root: b\n", "key 'data_root' is given twice, on lines 1 and 2"),
    "deep": (b"a: " + b"[" * 50_000, "config/config.yaml line 1: nested 40 times"),
    "a list": (b"- a\n", "config/config.yaml: is a list, not keys with values"),
    "a folder": (None, "config/config.yaml: is a folder where a file should be"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BAD_CONFIGS)
def test_what_is_wrong_with_the_config_is_said_in_the_words_of_dior(tmp_path, name):
    """Snakemake's own reader of `configfile:` would end in a traceback or in words that name no file."""
    content, sentence = BAD_CONFIGS[name]
    path = tmp_path / "config/config.yaml"
    path.parent.mkdir()
    path.mkdir() if content is None else path.write_bytes(content)
    code, text = snakemake(tmp_path, "-n", check=False)
    assert code == 1 and sentence in text and "Traceback" not in text and "yaml.scanner" not in text


@pytest.mark.slow
def test_where_there_is_no_config_it_is_said_how_to_get_one(tmp_path):
    code, text = snakemake(tmp_path, "-n", check=False)
    assert code == 1 and "config/config.yaml: there is no such file; name the folder that holds config/" in text


@pytest.fixture
def recorded_project(root):  # noqa: F811
    """A project whose recordings are there."""
    recorded.record(root / "data")
    return root


def test_a_dry_run_names_what_is_missing_and_plans_the_rest(recorded_project):
    (recorded_project / "data/in_1/a.bag").unlink()
    (recorded_project / "data/out_1/mlkit/cam02.jsonl").unlink()
    _, text = snakemake(recorded_project, "-n", "results/frames/out_2.parquet")
    assert "rule frames:" in text and text.strip().splitlines()[-3:] == [
        "config/sequences.tsv line 3: 'out_1': data/out_1/mlkit/cam02.jsonl is not there (detections of cam02) (did "
        "you mean 'cam01.jsonl'?)",
        "config/sequences.tsv line 4: 'in_1': data/in_1/a.bag is not there (bag)",
        "2 missing; `dior check` looks into the recordings, too",
    ]


def test_the_labels_of_a_walk_are_one_job_also_where_sessions_have_other_cameras(recorded_project):
    labels = ["in_1.cam01", "out_1.cam01", "out_1.cam03"]
    _, text = snakemake(recorded_project, "-n", "--", *(f"results/reproject/{one}.parquet" for one in labels))
    stats = text.split("Job stats:")[1].split("total")[0]
    found = dict(re.findall(r"^(reproject\w*) +(\d+)$", stats, re.MULTILINE))
    assert found == {"reproject": "1", "reproject_2": "1"}


@pytest.mark.slow
def test_a_dry_run_fails_where_no_walk_could_run_and_strictly_where_any_could_not(recorded_project):
    target = "results/frames/out_2.parquet"
    code, text = snakemake(recorded_project, "-n", target, "--config", "strict=true")
    assert "missing" not in text
    (recorded_project / "data/in_1/a.bag").unlink()
    for words in (["-n"], []):
        code, text = snakemake(recorded_project, *words, target, "--config", "strict=true", check=False)
        assert code == 1 and "data/in_1/a.bag is not there (bag)" in text and "rule frames:" not in text
    # a run does what it can
    _, text = snakemake(recorded_project, target)
    assert "missing;" not in text and (recorded_project / target).exists()
    shutil.rmtree(recorded_project / "data")
    code, text = snakemake(recorded_project, "-n", target, check=False)
    assert code == 1 and "config/config.yaml line 1: data_root is 'data', where there is no folder" in text
