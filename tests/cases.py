"""Cases of a parametrized test."""

import pytest


def slow(*values):
    """A case that only `pytest -m slow` runs."""
    return pytest.param(*values, marks=pytest.mark.slow)
