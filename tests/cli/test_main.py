import importlib.metadata
import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import dior
from dior.cli import flags, main
from dior.project.steps import MODULES
from dior.reid import networks, train
from tests.end_to_end.workflow import ROOT


def said(capsys, *words):
    """Exit code and what was written to standard error."""
    code = main.main([str(word) for word in words])
    return code, capsys.readouterr().err


def test_a_dior_error_is_one_line_and_exit_code_1(tmp_path, capsys):
    code, text = said(
        capsys,
        *["align", "--session", "field", "--camera", "cam04", "--camera-file", tmp_path / "cam04.yaml"],
        *["--intrinsics", tmp_path / "i.parquet", "--out", tmp_path / "o.parquet", "--data-root", "data"],
        *["--out-covariance", tmp_path / "c.parquet", "--out-without", tmp_path / "w.parquet"],
        *["--findings", tmp_path / "f.parquet"],
    )
    assert code == 1 and text.startswith("dior align: ") and "cam04.yaml" in text and text.count("\n") == 1
    assert not (tmp_path / "o.parquet").exists()


WRONG = {
    "align --session field": "dior align: --camera and --camera-file and --intrinsics and ",
    "align --sesion field": "(did you mean '--session'?)",
    "align field": "'field' belongs to no flag",
    "refine --max-gap-s soon": "--sequence and --subject",
    "alin --session field": 'Did you mean "align"?',
    "ini ../mine": 'Did you mean "init"?',
    "init": "--folder",
    "init --foldr mine": "Did you mean --folder?",
    "diff one": "--second",
    "train-reid --labels a --out b --network gaitmixr": 'Did you mean "gaitmixer"?',
    "trigger --log a --port UDP": "--port",
    "simulate --write-config a --settings {": "--settings",
    "simulate --write-config a --settings [1]": "--settings",
    "package --config [1] --project . --out x": "--config takes JSON {...}",
    "frames --sequence a --data-root b --out=": "--out takes PATH, not ''",
}


@pytest.mark.parametrize("words", WRONG)
def test_a_wrong_command_line_is_one_sentence_and_exit_code_2(words, capsys):
    code, text = said(capsys, *words.split())
    assert code == 2 and text.startswith(f"dior {words.split()[0]}: ") and WRONG[words] in text
    assert text.count("\n") == 1


@pytest.mark.parametrize("folder", ["/proc/mine", "file", "file/below"])
def test_a_folder_that_cannot_be_made_is_one_sentence(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    for words in (["init", folder], ["simulate", "--write-config", folder], ["simulate_mocap", *OF_A_WALK, folder]):
        code, text = said(capsys, *words)
        named = f"dior {words[0]}: {folder.removesuffix('/below')}"
        assert code == 1 and text.startswith(named) and text.count("\n") == 1, text


OF_A_WALK = ["--settings", '{"duration_s": 1}', "--sequence", "indoor_01", "--out"]


def test_a_fault_of_the_system_without_a_file_keeps_its_trace(monkeypatch):
    from dior.project import init

    def broken(folder: Path) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(init, "run", broken)
    with pytest.raises(BrokenPipeError):
        main.main(["init", "mine"])


def test_a_step_that_fails_leaves_none_of_its_files(tmp_path, monkeypatch, capsys):
    """The last of three outputs cannot be written; what another run wrote of them goes, too, as with Snakemake."""
    from dior.ingest import audit

    def run(*, frames: Path, out: Path, out_dropped: Path, findings: Path, **_):
        for path in (out, out_dropped):
            path.write_text("new")
        findings.parent.mkdir()

    monkeypatch.setattr(audit, "run", run)
    out, dropped, frames = (tmp_path / name for name in ("out", "dropped", "frames"))
    frames.write_text("")
    out.write_text("old and longer")
    words = ["audit", "--sequence", "walk", "--frames", frames, "--data-root", tmp_path, "--out", out]
    code, text = said(capsys, *words, "--out-dropped", dropped, "--findings", "/proc/x/findings")
    assert code == 1 and "/proc/x" in text and text.count("\n") == 1
    assert frames.exists() and not out.exists() and not dropped.exists()
    out.write_text("old")
    monkeypatch.setattr(audit, "run", lambda **_: Path("/proc/x/y").mkdir())
    assert said(capsys, *words, "--out-dropped", dropped, "--findings", "f")[0] == 1
    assert out.read_text() == "old", "it was not written"


def test_names_are_spelled_either_way(tmp_path, monkeypatch):
    for command in ("simulate_mocap", "simulate-mocap"):
        assert main.main([command, *OF_A_WALK, str(tmp_path / command)]) == 0
        assert (tmp_path / command / "indoor_01/mocap.c3d").is_file()
    assert flags.parsed("refine", OF_REFINE) == flags.parsed(
        "refine", [word.replace("p-s", "p_s") for word in OF_REFINE]
    )
    asked = {}

    def run(*, test_sessions: list[str], labels: Path) -> None:
        asked.update(test_sessions=test_sessions, labels=labels)

    monkeypatch.setattr(train, "run", run)
    for command in ("train-reid", "train_reid"):
        for flag in ("--test-sessions", "--test_sessions"):
            asked.clear()
            assert main.main([command, flag, "field", "lab", "--labels", "a"]) == 0
            assert asked == {"test_sessions": ["field", "lab"], "labels": Path("a")}


OF_REFINE = "--sequence a --subject b --skeleton c --max-gap-s 1 --out d --findings e".split()


def test_what_is_nested_in_json_is_read(tmp_path):
    settings = '{"detector": {"level": "real"}}'
    assert main.main(["simulate", "--write-config", str(tmp_path), "--settings", settings]) == 0
    assert "detector: {level: real}" in (tmp_path / "config.yaml").read_text()


def test_the_networks_to_train_are_those_there_are():
    from typing import get_args, get_type_hints

    assert get_args(get_type_hints(train.run)["network"]) == networks.NAMES


def test_dior_alone_says_what_to_type_next(capsys):
    assert main.main([]) == 0
    text = capsys.readouterr().out
    assert re.findall(r"^  dior (\w+) my_capture", text, re.MULTILINE) == ["init", "check", "run", "run"]


def test_the_version():
    assert dior.__version__ == importlib.metadata.version("dior")
    done = subprocess.run([sys.executable, "-m", "dior", "--version"], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, dior.__version__)


def test_the_help_names_every_command_those_of_a_person_first(capsys):
    assert main.main(["--help"]) == 0
    text = capsys.readouterr().out
    typed, steps = text.split("Steps of the workflow")
    names = {step.replace("_", "-") for step in MODULES} - {"simulate"}
    assert all(f"│ {name} " in steps for name in names)
    commands = (
        *("init", "check", "pseudonyms", "run", "verify", "diff", "assess", "angles", "formats"),
        *("publish", "export-cameras", "forget", "trigger", "simulate", "train-reid"),
    )
    assert all(f"│ {name} " in typed for name in commands)
    assert "Exit codes: 0" in " ".join(text.split()) and "--install-completion" in typed


def test_the_help_of_a_command_tells_its_flags(capsys):
    from dior.cli import commands

    for name, module in commands.COMMANDS.items():
        assert main.main([name, "--help"]) == 0
        shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
        run = import_module(module).run
        for parameter in inspect.signature(run).parameters:
            text = flags.text_of(parameter, run.__doc__)
            assert len(text) > 5 and text[:20] in shown, (name, parameter)


def modules_of(*words):
    """What a command line imports."""
    code = f"import sys; from dior.cli.main import main; main({list(words)!r}); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


HEAVY = {"numpy", "pandas", "cv2", "gtsam", "matplotlib", "pyarrow", "scipy", "torch"}


def test_a_reader_that_has_enough_ends_it_without_a_word():
    call = [sys.executable, "-m", "dior", "align", "--help"]
    with subprocess.Popen(call, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b"" and process.wait() == 141


@pytest.mark.parametrize("words", [["--help"], ["frames", "--help"], [], ["align", "--sesion", "x"]])
def test_the_command_starts_without_heavy_packages(words):
    """Start-up is paid by every job."""
    found = modules_of(*words)
    steps = {f"dior.{module}" for module in MODULES.values()}
    assert not found & HEAVY and not found & steps
    assert ("cyclopts" in found) == (words == ["--help"])


@pytest.mark.slow
def test_a_step_imports_itself_and_not_what_a_person_needs(tmp_path):
    found = modules_of("simulate_mocap", *OF_A_WALK, str(tmp_path))
    assert "dior.simulate.simulate_mocap" in found and not found & {"cyclopts", "rich", "dior.cli.commands"}
    # the simulator's own modules may use each other
    others = {f"dior.{module}" for module in MODULES.values() if not module.startswith("simulate.")}
    assert not found & others
