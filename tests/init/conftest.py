"""A small capture, as a lab keeps it."""

import pytest

from tests.init import small


@pytest.fixture
def lab(tmp_path):
    """Two outdoor walks and an indoor one on the next day, in folders of their own, and things that belong to none."""
    recordings = tmp_path / "recordings"
    small.outdoor(recordings, "out_1")
    small.outdoor(recordings, "out_2", 100)
    small.outdoor(recordings, "in_1", 86400, far=None)
    small.c3d(recordings / "in_1/trial.c3d", "Anna:")
    (recordings / "notes.txt").write_text("it rained")
    small.bag(recordings / "calibration/board", ["cam01"])
    return tmp_path
