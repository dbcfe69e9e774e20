"""A made-up release: whole, to be looked at only, and a copy that a test changes."""

import shutil

import pytest

from tests.release import made_up


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made_up.release(tmp_path_factory.mktemp("whole") / "dior-0.1.0")


@pytest.fixture
def made(whole, tmp_path):
    shutil.copytree(whole, tmp_path / whole.name)
    return tmp_path / whole.name
