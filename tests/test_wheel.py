"""The package as others get it: a wheel, installed where there is no checkout."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from dior.tables import tables

ROOT = Path(__file__).resolve().parents[1]
WALK = "indoor_01"
# one walk of half a second in small pictures
SETTINGS = {"subjects": 1, "sequences": 1, "duration_s": 0.5, "width": 320, "height": 180, "fx": 160.0}

pytestmark = pytest.mark.slow


def run(*words, cwd, expect=0):
    """Run a command without the checkout on Python's path; what it printed."""
    env = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=env, capture_output=True, text=True)
    assert done.returncode == expect, done.stdout + done.stderr
    return done.stdout + done.stderr


def sources():
    """Files of the package, relative to the checkout, as the wheel must have them."""
    files = (path for path in (ROOT / "dior").rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(ROOT).as_posix() for path in files}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy, since a build leaves files beside its source."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, folder)
    for name in filter(os.path.exists, (ROOT / "LICENSE", ROOT / "CITATION.cff")):
        shutil.copy(name, folder)
    shutil.copytree(ROOT / "dior", folder / "dior", ignore=shutil.ignore_patterns("__pycache__"))
    words = [sys.executable, "-m", "pip", "wheel", ".", "--no-deps", "--wheel-dir", "out"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    if done.returncode and "No matching distribution found for setuptools" in done.stdout + done.stderr:
        pytest.skip("pip reaches no index, and building a wheel needs setuptools from there")
    assert done.returncode == 0, done.stdout + done.stderr
    return next((folder / "out").glob("dior-*.whl"))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The scripts of an environment with the wheel. Its dependencies are those of the running one, which lie behind."""
    folder = tmp_path_factory.mktemp("env")
    venv.create(folder, with_pip=True)
    scripts = folder / ("Scripts" if os.name == "nt" else "bin")
    python = scripts / "python"
    run(python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", wheel, cwd=folder)
    own = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip())
    # paths of a .pth come last, and what a .pth in there says (the editable dior) does not count
    (own / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return scripts


def test_the_wheel_has_every_file_of_the_package_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert names == sources()
    suffixes = {Path(name).suffix for name in names}
    assert {".py", ".yaml", ".j2", ".css", ".typed"} <= suffixes


def test_the_package_that_runs_is_the_one_of_the_wheel(installed, tmp_path):
    place = run(installed / "python", "-c", "import dior; print(dior.__file__)", cwd=tmp_path).strip()
    assert Path(place).is_relative_to(installed.parent)


def test_a_new_project_and_a_step_without_a_checkout(installed, tmp_path):
    run(installed / "dior", "init", tmp_path / "mine", cwd=tmp_path)
    assert (tmp_path / "mine/config/sessions/session_01/cam01.yaml").is_file()

    data = tmp_path / "data"
    simulate = ("--settings", json.dumps(SETTINGS), "--sequence", WALK, "--out", data)
    run(installed / "dior", "simulate", *simulate, cwd=tmp_path)
    bags = [data / WALK / f"{computer}.bag" for computer in ("pc1", "pc2")]
    topics = [f"cam0{i}=/cam0{i}/color/image_raw/compressed" for i in range(1, 5)]
    index = ("--data-root", data, "--topics", *topics, "--out", tmp_path / "frames.parquet")
    run(installed / "dior", "frames", "--sequence", WALK, "--bags", *bags, *index, cwd=tmp_path)
    frames = tables.read(tmp_path / "frames.parquet", "frames")
    assert len(frames["frame"]) == 4 * 15 and set(frames["width"].tolist()) == {320}


def test_what_a_step_refuses_is_a_sentence_from_the_schema(installed, tmp_path):
    """The JSON schemas are found: a key with a slip is refused by name."""
    (tmp_path / "cam01.yaml").write_text("role: close\nlocated: tape\n")
    code = "from dior.project.camera_file import camera_settings; camera_settings('cam01.yaml')"
    said = run(installed / "python", "-c", code, cwd=tmp_path, expect=1)
    assert "unknown key 'located' (did you mean 'locate'?)" in said
