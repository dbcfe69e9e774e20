"""The studio as a person has it: the command, serving a project, and Debian's Chromium driven by Playwright."""

import os
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager

import pytest

from dior.simulate import config
from tests.report.chromium import program


def practice(folder):
    """`dior simulate --practice`."""
    config.run(practice=folder)
    return folder


def solved(project, *parts):
    """Put what is done by hand in solution/ into a copy of the practice project: the parts `marks` and `boxes`."""
    if "marks" in parts:
        for path in (project / "solution/sessions/lab").glob("*.marks.csv"):
            shutil.copy(path, project / "config/sessions/lab")
    if "boxes" in parts:
        shutil.copytree(project / "solution/boxes", project / "config/boxes", dirs_exist_ok=True)


def run(project, *recordings):
    """`dior run`, as far as the labels of some recordings need it, "outdoor_01.cam04"; without any, to the report."""
    targets = [f"results/reproject/{one}.parquet" for one in recordings]
    subprocess.run([sys.executable, "-m", "dior", "run", str(project), *targets], check=True, stdout=subprocess.DEVNULL)


@contextmanager
def served(project):
    """The address that `dior studio` prints for a project, while it runs."""
    command = [sys.executable, "-m", "dior", "studio", str(project)]
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    # no port is given, so that tests beside each other find their own
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as studio:
        try:
            yield re.search(r"http\S+", studio.stdout.readline())[0]
        finally:
            studio.terminate()


@contextmanager
def opened():
    """Playwright's Chromium."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: tests/requirements.txt")
    if program() is None:
        pytest.skip("no Chromium here: apt-get install chromium")
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=program(), args=["--no-sandbox", "--disable-gpu"])
        yield found
        found.close()


@contextmanager
def page(chromium, address, path="/", width=1440, height=900, dark=False):
    """A page of the studio, or with no `path` any address; an error in its console fails the test."""
    context = chromium.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light", accept_downloads=True
    )
    one, said = context.new_page(), []
    one.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
    one.on("pageerror", lambda error: said.append(str(error)))
    one.goto(address)
    if path is not None:
        one.goto(address.partition("/?")[0] + path)
    one.said = said
    yield one
    context.close()
    assert not said, said


def until_shown(one, frame):
    """Wait until the picture of a frame is on the page, whole."""
    one.wait_for_selector(f"#picture[data-frame='{frame}'][data-small='false']")
