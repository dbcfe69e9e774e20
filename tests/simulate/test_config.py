"""The committed demo config is what the simulator writes."""

from pathlib import Path

import numpy as np
import pytest

from dior.cli import main
from dior.project import project

ROOT = Path(__file__).resolve().parents[2]


def contents(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_shipped_config_is_written_again_byte_for_byte(tmp_path):
    assert main.main(["simulate", "--write-config", str(tmp_path / "config")]) == 0
    again, shipped = contents(tmp_path / "config"), contents(ROOT / "config")
    del shipped["README.md"]  # for who looks at the repository
    assert again.keys() == shipped.keys()
    assert [name for name in shipped if again[name] != shipped[name]] == []


def test_it_is_a_valid_project():
    demo = project.load(ROOT)
    assert len(demo.sequences) == 8 and demo.close("field") == ["cam01", "cam02", "cam03"]
    assert all(demo.boxes(name) for name in demo.sequences if not demo.indoor(name))


def test_settings_on_the_command_line_reach_the_config(tmp_path):
    words = ["--settings", '{"subjects": 1, "sequences": 1, "duration_s": 2.0, "fps": 25.0}']
    assert main.main(["simulate", "--write-config", str(tmp_path / "config"), *words]) == 0
    small = project.load(tmp_path)
    assert small.sequences == ("outdoor_01", "indoor_01")
    assert small.config["simulate"]["fps"] == 25.0 and small.config["simulate"]["duration_s"] == 2.0


def test_nobody_clicks_beside_the_picture(tmp_path):
    """However badly."""
    words = ["--settings", '{"subjects": 1, "sequences": 1, "duration_s": 2.0, "mark_noise_px": 900.0}']
    assert main.main(["simulate", "--write-config", str(tmp_path / "config"), *words]) == 0
    [path] = (tmp_path / "config").glob("sessions/lab/cam01.marks.csv")
    u, v = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(3, 4)).T
    assert -0.5 <= u.min() < 100 and 1200 < u.max() < 1279.5 and -0.5 <= v.min() < 100 and 600 < v.max() < 719.5


def test_a_config_that_is_there_is_not_overwritten(tmp_path, capsys):
    (tmp_path / "config.yaml").write_text("data_root: mine\n")
    assert main.main(["simulate", "--write-config", str(tmp_path)]) == 1
    assert "exists already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["config.yaml"]


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ('{"seed": -1}', "simulate.seed"),
        ('{"detector": 5}', "simulate.detector"),
        ('{"preset": ["real"]}', "simulate.preset"),
        ('"x"', "simulate"),
        ('{"fsp": 25}', "fps"),
    ],
)
def test_settings_of_another_kind_are_one_sentence_and_leave_nothing(tmp_path, capsys, settings, word):
    assert main.main(["simulate", "--write-config", str(tmp_path / "config"), "--settings", settings]) != 0
    said = capsys.readouterr().err
    assert word in said and said.count("\n") == 1 and not (tmp_path / "config").exists()
