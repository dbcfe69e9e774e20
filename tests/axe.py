"""axe-core, the rules by which a page can be read by everybody, run on a page in Chromium."""

import shutil
import subprocess
import tarfile
from functools import cache
from tempfile import TemporaryDirectory

import pytest

PACKAGE = "axe-core@4.14.1"


@cache
def source():
    """The text of axe-core, from the npm registry; the test is skipped where it is not to be had."""
    if shutil.which("npm") is None:
        pytest.skip("no npm here to fetch axe-core with")
    with TemporaryDirectory() as folder:
        done = subprocess.run(["npm", "pack", PACKAGE], cwd=folder, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"axe-core cannot be fetched: {done.stderr.strip().splitlines()[-1:]}")
        with tarfile.open(f"{folder}/{done.stdout.split()[-1]}") as packed:
            return packed.extractfile("package/axe.min.js").read().decode()


def violations(page):
    """[(rule, what it asks, elements)] that a page, one of Playwright's, breaks."""
    page.evaluate(source())
    # a page from disk may not read its own style sheets once more
    found = page.evaluate("axe.run(document, {resultTypes: ['violations'], preload: false})")
    return [(one["id"], one["help"], [node["html"][:200] for node in one["nodes"]]) for one in found["violations"]]
