import pytest

from tests.release import made as project


@pytest.fixture
def made(tmp_path):
    """Arguments of a build over four walks of three people, one of whom did not agree."""
    return project.project(tmp_path)


@pytest.fixture(scope="package")
def built(tmp_path_factory):
    """Arguments of such a build, which has run; to be looked at only."""
    arguments = project.project(tmp_path_factory.mktemp("built"))
    project.build(arguments)
    return arguments
