"""The documentation site is built without a warning: every page in it, every link, every module of the reference."""

import importlib.util
import subprocess
import sys
import venv

import pytest

from tests.end_to_end.workflow import ROOT


def python_with_mkdocs(folder):
    """The Python to build with: this one, or one in an environment made for it."""
    if importlib.util.find_spec("mkdocs"):
        return sys.executable
    venv.create(folder, with_pip=True)
    wanted = ["-q", "-r", str(ROOT / "docs/requirements.txt")]
    done = subprocess.run([folder / "bin/python", "-m", "pip", "install", *wanted], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"docs/requirements.txt cannot be installed here: {done.stderr.strip().splitlines()[-1]}")
    return folder / "bin/python"


@pytest.mark.slow
def test_the_site_is_built(tmp_path):
    python = python_with_mkdocs(tmp_path / "env")
    command = [python, "-m", "mkdocs", "build", "--strict", "-d", tmp_path / "site"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    for page in ("index", "architecture/index", "reference/geometry/camera/index"):
        text = (tmp_path / "site" / f"{page}.html").read_text(encoding="utf-8")
        assert "fonts.googleapis" not in text
    assert "undistort" in text
