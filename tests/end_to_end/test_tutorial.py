"""The tutorial, typed as it is written: every command of it, and between them what its text tells to fill in."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from dior.project import todos
from tests.end_to_end.workflow import ENVIRONMENT, ROOT, edit
from tests.studio import browser

pytestmark = pytest.mark.slow
PAGE = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")


def blocks():
    """The commands of the page, a list for each block of them."""
    return [block.strip().splitlines() for block in re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)]


def typed(line, folder):
    """Type a line in a folder beside the ones that it makes; returns the exit code and what is said."""
    words = line.replace(".venv/bin/dior", f"{sys.executable} -m dior")
    if " studio " in line:
        with browser.served(folder / line.split()[-1]) as address:
            return 0, address
    done = subprocess.run(words, shell=True, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def noted(folder):
    """What the notebook tells: the row of the person, and the places of the cameras by name."""
    text = (folder / "practice/notebook.txt").read_text()
    height, sigma = re.search(r"(\d\.\d+) m tall, measured to (\d\.\d+) m", text).groups()
    return (height, sigma), dict(re.findall(r"(?m)^(cam\d\d)  ([-\d., ]+?)  ", text))


def fill_in(folder):
    config = folder / "my_capture/config"
    (height, sigma), places = noted(folder)
    edit(config / "subjects.tsv", "TODO\tTODO\tTODO\tTODO", f"{height}\t{sigma}\tyes\tyes")
    edit(config / "sequences.tsv", "outdoor_01\t1\tTODO", "outdoor_01\t1\tS01")
    for _ in range(2):
        edit(config / "config.yaml", ": TODO", ": plumb_bob")
    for camera, place in places.items():
        edit(config / f"sessions/outdoor/{camera}.yaml", "position_m: TODO", f"position_m: [{place}]")


def test_what_is_typed_makes_a_release(tmp_path):
    here = tmp_path / "clone"
    here.mkdir()
    far = tmp_path / "my_capture/config/sessions/outdoor/cam04.yaml"
    said, todo = [], blocks()
    for number, lines in enumerate(todo):
        for line in lines:
            if line.endswith("dior pseudonyms ../my_capture"):
                assert f"`TODO`: {len(todos.found(tmp_path / 'my_capture'))} values" in PAGE
                fill_in(tmp_path)
                assert not todos.found(tmp_path / "my_capture")
            if line.endswith("-n"):
                edit(far, "# align:", "align:")
            code, text = typed(line, here)
            said.append((line, text))
            expected = 1 if line.endswith("dior check ../my_capture") else 0
            assert code == expected, (number, line, text[-3000:])
            if line.startswith("cp") and "marks" in line:
                edit(far, "\nalign:", "\n# align:")
    runs = [text for line, text in said if line.endswith("dior run ../my_capture")]
    assert "7 of 8 recordings are good" in runs[0] and "cam04" in runs[0]
    assert "8 of 8 recordings are good" in runs[1]
    [planned] = [text for line, text in said if line.endswith("-n")]
    assert "triangulate" not in planned and "align" in planned
    [checked] = [text for line, text in said if "check" in line]
    assert "cam01.marks.csv" in checked and "outdoor_01.cam04.csv" in checked
    assert Path(tmp_path / "my_capture/results/release/dior-0.1.0/SHA256SUMS").is_file()
