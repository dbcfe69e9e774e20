"""The README's way for a first-timer, typed as it stands there, up to a mark that is placed and saved."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.studio import browser
from tests.studio.marking import PLACE, asked, clear, frame_of, picture_of, ready, truth_of, until

pytestmark = pytest.mark.slow
README = (Path(__file__).parents[2] / "README.md").read_text()


def lines_of(readme):
    """The commands below "The first time", as arguments."""
    block = re.search(r"^The first time.*?```bash\n(.*?)```", readme, re.DOTALL | re.MULTILINE)[1]
    return [shlex.split(line, comments=True) for line in block.splitlines()]


def noted(notebook):
    """What somebody reads out of the notebook, by the page's key and the file's name."""
    person = re.search(r"(\d\.\d+) m tall, measured to (\d\.\d+) m", notebook)
    tape = re.findall(r"^(cam\d+) +(.*?) +\(", notebook, re.MULTILINE)
    model = re.search(r"lens model (\w+)", notebook)[1]
    values = {"height_m": person[1], "height_sigma_m": person[2], "consent_release": "yes", "consent_pictures": "yes"}
    return values | {"subject": "S01"}, dict(tape), model


def test_the_first_time_as_the_readme_says(tmp_path, chromium):
    clone = tmp_path / "dior"
    clone.mkdir()
    *typed, studio = lines_of(README)
    assert [line[1] for line in (*typed, studio)] == ["simulate", "init", "pseudonyms", "studio"]
    # where the package is, as the clone's .venv has it
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])}
    for program, *arguments in typed:
        assert program == ".venv/bin/dior"
        subprocess.run([sys.executable, "-m", "dior", *arguments], cwd=clone, env=environment, check=True)
    project, practice = clone / studio[-1], tmp_path / "practice"
    values, tape, model = noted((practice / "notebook.txt").read_text())
    with browser.served(project.resolve()) as address, browser.page(chromium, address) as one:
        one.wait_for_selector(".todos form")
        forms = one.locator(".todos form").all()
        for form in forms:
            key, path = form.get_attribute("data-key"), Path(form.get_attribute("data-path"))
            form.locator("input").fill(values.get(key) or tape.get(path.stem) or model)
            form.locator("input").press("Enter")
            # after the last one the page is loaded again
            if form is not forms[-1]:
                one.wait_for_selector(f"[data-path='{path}'][data-key='{key}'][data-done=right]")
        one.locator("tr", has_text="cam01").get_by_role("link", name="Mark markers").click()
        ready(one)
        one.keyboard.press("f")
        until(one, "document.querySelector('#number').value !== '0'")
        browser.until_shown(one, frame_of(one))
        assert "4 marks more" in one.locator("#answer").inner_text()
        truth, frame = truth_of(tmp_path / "practice", "cam01"), frame_of(one)
        while not clear(truth, frame, asked(one), picture_of(one, frame)):
            one.keyboard.press("x")
        name = asked(one)
        one.mouse.click(*one.evaluate(PLACE, truth[frame, name].tolist()))
        until(one, "document.querySelector('#picture').dataset.saved === '1'")
    written = project / "config/sessions/indoor/cam01.marks.csv"
    [(_, at_frame, joint, u, v)] = [row.split(",")[:5] for row in written.read_text().splitlines()[1:]]
    assert (int(at_frame), joint) == (frame, name)
    assert np.linalg.norm(np.subtract((float(u), float(v)), truth[frame, name])) < 1
