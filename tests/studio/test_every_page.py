"""Every page, light and dark, at two sizes: readable by axe-core's rules, nothing wider than the window, no error."""

import shutil

import pytest

from dior.studio.pages import PAGES
from tests import axe
from tests.studio import browser

pytestmark = pytest.mark.slow
# of the practice project what a page needs to be told
ASKED = {
    "/frames": "?walk=indoor_01&camera=cam01&frame=20",
    "/marks": "?session=lab&camera=cam01",
    "/boxes": "?walk=outdoor_01&camera=cam04",
    "/long-range": "?session=field&camera=cam04",
    "/time": "?walk=indoor_01&camera=cam01",
    "/who": "?walk=outdoor_01",
}


@pytest.fixture(scope="module")
def address(practice, tmp_path_factory):
    project = tmp_path_factory.mktemp("served") / "practice"
    shutil.copytree(practice, project)
    browser.solved(project, "marks", "boxes")
    with browser.served(project) as found:
        yield found


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("size", [(1440, 900), (1024, 768)])
@pytest.mark.parametrize("path", PAGES)
def test_a_page_can_be_read(address, chromium, path, size, dark):
    with browser.page(chromium, address, path + ASKED.get(path, ""), *size, dark=dark) as one:
        one.wait_for_load_state("networkidle")
        assert not axe.violations(one)
        assert one.evaluate("document.documentElement.scrollWidth") <= size[0]
