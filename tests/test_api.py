"""What `import dior` shows, and the examples of docs/api.md, which are run."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dior
from dior.simulate import config
from tests.release import small

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "docs/api.md").read_text(encoding="utf-8")
GEOMETRY, RELEASE, PROJECT = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_every_public_name_is_there_typed_and_documented():
    for name in dior.__all__:
        assert getattr(dior, name)
        assert name.startswith("__") or f"`dior.{name}" in TEXT
    assert {*dior._PLACES, "__version__"} == set(dior.__all__) == set(dir(dior))
    typed = (
        Path(dior.__file__).read_text(encoding="utf-8").partition("if TYPE_CHECKING:")[2].partition("__version__")[0]
    )
    for module, own in dior._PLACES.values():
        assert re.search(rf"from {re.escape(module)} import .*\b{own}\b", typed)


def test_a_name_that_is_not_there_is_refused():
    with pytest.raises(AttributeError, match="has no attribute 'triangle'"):
        _ = dior.triangle


def test_the_version_is_that_of_the_package():
    from importlib import metadata

    assert dior.__version__ == metadata.version("dior")


def test_importing_dior_loads_nothing():
    code = "import sys, dior; print([m for m in sys.modules if m.startswith(('dior.', 'numpy', 'pyarrow'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_no_module_of_the_package_goes_through_the_public_names():
    """The hashes of code would not see what lies behind them (dior/tables/code_hash.py)."""
    files = [path for path in (ROOT / "dior").rglob("*.py") if path.parent != ROOT / "dior/cli"]
    assert len(files) > 200
    through = re.compile(r"^\s*(import dior\b(?!\.)|from dior import (?!__version__))", re.MULTILINE)
    assert not [path for path in files if through.search(path.read_text(encoding="utf-8"))]


def test_the_example_of_cameras_does_what_it_says(capsys):
    values = {}
    exec(GEOMETRY, values)
    said = re.search(r"It prints\n\n```text\n(.*?)```", TEXT, re.DOTALL)[1]
    assert capsys.readouterr().out == said
    found, joints = values["found"].points, values["joints"]
    assert np.abs(found - joints).max() < 1e-6
    used = values["found"].used
    assert not used[0, 10:15, 2].any() and used[1:].all() and used.sum() == used.size - 5


def test_the_example_of_a_release_reads_one(tmp_path, monkeypatch, capsys):
    small.build(tmp_path / "results/release/dior-0.1.0")
    monkeypatch.chdir(tmp_path)
    exec(RELEASE, {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(small.WALKS) * len(small.CAMERAS)
    assert f"walk_2.cam01: {small.PICTURES} pictures, 33 joints, fx 640 px, train" in lines


def test_the_example_of_a_project_reads_one(tmp_path, monkeypatch, capsys):
    config.run(settings={"subjects": 1, "sequences": 1, "duration_s": 1.0}, write_config=tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    exec(PROJECT, {})
    cameras = ["cam01", "cam02", "cam03", "cam04"]
    found = [line.split(" ", 2) for line in capsys.readouterr().out.splitlines()]
    assert ["indoor_01", str(cameras)] in [[walk, rest] for walk, _, rest in found]
    assert all(len(person) >= 8 and person != "S01" for _, person, _ in found), "a pseudonym"
