"""Cases of a parametrized test."""

import pytest


def slow(*values):
    """A case that only `pytest -m slow` runs."""
    return pytest.param(*values, marks=pytest.mark.slow)


def some(values, *fast):
    """Cases of one argument: those of `fast` always run, the others by `pytest -m slow` alone."""
    return [value if value in fast else slow(value) for value in values]
