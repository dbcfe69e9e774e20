import subprocess
import sys

import pytest

from dior.cli import main, steps


def test_a_dior_error_is_one_line_and_exit_code_1(tmp_path, capsys):
    code = main.main(
        ["align", "--session", "field", "--camera", "cam04", "--camera-file", str(tmp_path / "cam04.yaml")]
        + ["--intrinsics", str(tmp_path / "i.parquet"), "--out", str(tmp_path / "o.parquet"), "--data-root", "data"]
        + ["--out-covariance", str(tmp_path / "c.parquet"), "--findings", str(tmp_path / "f.parquet")]
    )
    said = capsys.readouterr().err
    assert code == 1 and said.startswith("dior align: ") and "cam04.yaml" in said and said.count("\n") == 1
    assert not (tmp_path / "o.parquet").exists()


def test_a_missing_flag_is_named(capsys):
    with pytest.raises(SystemExit):
        main.main(["align", "--session", "field"])
    assert "--camera" in capsys.readouterr().err


def test_pairs_of_words():
    assert steps.pairs(["cam01=/a=b", "cam02=/c"]) == {"cam01": "/a=b", "cam02": "/c"}


@pytest.mark.parametrize("step", steps.STEPS)
def test_flags_are_the_arguments_of_the_step(step):
    import inspect
    from importlib import import_module

    run = import_module(f"dior.{steps.STEPS[step][0]}").run
    assert {flag.replace("-", "_") for flag in steps.STEPS[step][2]} == set(inspect.signature(run).parameters)


def test_the_command_starts_without_heavy_packages():
    """Start-up is paid by every job."""
    code = "import sys, dior.cli.main; dior.cli.main._parser(); print([m for m in sys.modules if m in %r])"
    heavy = ["numpy", "pandas", "cv2", "gtsam", "matplotlib", "pyarrow"]
    done = subprocess.run([sys.executable, "-c", code % heavy], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
