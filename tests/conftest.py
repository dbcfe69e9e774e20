"""Fixtures that several test folders use."""

import os
from pathlib import Path

import pytest

# before NumPy is imported: there is a process of tests on every core already
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def shared():
    """Folder with the real data, beside the repository; tests that need it are skipped where it is absent."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real data is not there: {folder}")
    # a link is followed, since tests build paths relative to it
    return folder.resolve()
