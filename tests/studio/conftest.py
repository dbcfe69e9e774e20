"""Projects that the studio is tried on: a tiny one of few pictures, and the practice capture, served to a browser."""

import shutil
from contextlib import chdir

import pytest
from starlette.testclient import TestClient

from dior.studio import app
from dior.studio.workspace import Workspace
from tests.check import recorded
from tests.project.test_project import root  # noqa: F401
from tests.studio import browser

TOKEN = "a-token"
HOST = "http://127.0.0.1:8125"


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    recorded.record(folder)
    return folder


@pytest.fixture
def project(root, recordings):  # noqa: F811
    """A whole project with its recordings, of 40 pictures a camera; the working directory."""
    recorded.of_project(root, recordings)
    with chdir(root):
        yield root


@pytest.fixture
def client(project):
    """Asks the pages of `project` as a browser does that has been given the address."""
    with Workspace() as workspace:
        client = TestClient(app.made(workspace, TOKEN), base_url=HOST, headers={"origin": HOST})
        client.get("/", params={"token": TOKEN})
        yield client


@pytest.fixture(scope="session")
def practice(tmp_path_factory):
    """A capture to practise on, without marks and boxes; not to be changed (`browser.served` takes a copy)."""
    return browser.practice(tmp_path_factory.mktemp("practice") / "practice")


@pytest.fixture(scope="module")
def ran(practice, tmp_path_factory):
    """A copy of the practice capture, solved, after a run of all that its labels need."""
    project = tmp_path_factory.mktemp("ran") / "practice"
    shutil.copytree(practice, project)
    browser.solved(project, "marks", "boxes")
    browser.run(project, *(f"{walk}_01.cam0{number}" for walk in ("indoor", "outdoor") for number in range(1, 5)))
    return project


@pytest.fixture(scope="module")
def chromium():
    """Playwright's browser; the test is skipped where there is none."""
    with browser.opened() as found:
        yield found
