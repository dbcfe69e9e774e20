"""What the end-to-end tests share."""

import shutil

import pytest


@pytest.fixture
def copy(project, tmp_path):
    """A copy of the module's finished `project`, to be edited."""
    folder = tmp_path / "copy"
    shutil.copytree(project, folder, symlinks=True)
    return folder
