"""The pages of a finished report with something to mend, in Chromium: everybody can read them, at every size, in light
and dark, and a walk's own page says what to type."""

import pytest

from dior.simulate import config, settings
from tests import axe
from tests.end_to_end.test_tiny import TINY
from tests.end_to_end.workflow import snakemake
from tests.studio import browser

pytestmark = pytest.mark.slow
PAGES = ("index", "cost", *(f"sequences/{walk}{part}" for walk in ("indoor_01", "outdoor_01") for part in ("", ".3d")))


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A clock that is given a picture off is the one thing to type."""
    folder = tmp_path_factory.mktemp("pages")
    config.write(settings.from_dict(TINY | {"gallery": False}), folder / "config")
    (folder / "config/offsets").mkdir()
    (folder / "config/offsets/indoor_01.yaml").write_text("cam02: {offset_s: 0.2}\n")
    snakemake(folder)
    return folder / "results/report"


@pytest.fixture(scope="module")
def chromium():
    with browser.opened() as found:
        yield found


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("size", [(1440, 900), (1024, 768), (390, 844)])
@pytest.mark.parametrize("page", PAGES)
def test_a_page_can_be_read(report, chromium, page, size, dark):
    with browser.page(chromium, (report / f"{page}.html").as_uri(), None, *size, dark=dark) as one:
        for folded in one.query_selector_all("details:not([open]) > summary"):
            if folded.is_visible():
                folded.click()
        assert not axe.violations(one)
        assert one.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_a_walk_says_on_its_own_page_what_to_type(report, chromium):
    with browser.page(chromium, (report / "sequences/indoor_01.html").as_uri(), None) as one:
        said = one.inner_text("#notes .fix")
    assert said.startswith("cam02: in config/offsets/indoor_01.yaml: remove the line of cam02")
