"""A page whose server is slow: it says that it is at work, and no key breaks it meanwhile."""

import shutil

import pytest

from dior.studio.pages import PAGES
from tests.studio import browser
from tests.studio.test_every_page import ASKED

pytestmark = pytest.mark.slow
# letters and signs of all pages, of which none types into a field
KEYS = [*"bcefghijklmnopqsuvwxyz0489+-=,.<>[]{}", "Enter", "Backspace", "Delete", "Escape", "Home", "End",
        *(f"Arrow{way}" for way in ("Left", "Right", "Up", "Down")), "Control+z", "Control+y"]  # fmt: skip


@pytest.fixture(scope="module")
def address(practice, tmp_path_factory):
    project = tmp_path_factory.mktemp("slow") / "practice"
    shutil.copytree(practice, project)
    browser.solved(project, "marks", "boxes")
    with browser.served(project) as found:
        yield found, project


@pytest.mark.parametrize("path", PAGES)
def test_a_page_that_waits_says_so_and_takes_keys(address, chromium, path):
    served, project = address
    before = {file: file.read_bytes() for file in sorted((project / "config").rglob("*.*"))}

    held, holds = [], True

    def hold(route):
        held.append(route) if holds else route.continue_()

    with browser.page(chromium, served, "/frames") as one:
        one.wait_for_load_state("networkidle")
        one.route("**/api/*", hold)
        one.route("**/api/*/*", hold)
        one.goto(served.partition("/?")[0] + path + ASKED.get(path, ""), wait_until="commit")
        one.wait_for_selector("body[data-busy] #busy")
        assert one.locator("#busy").is_visible()
        for key in KEYS:
            one.keyboard.press(key)
        holds = False
        for route in held:
            route.continue_()
        # a page asks for more when it has the first answers
        one.locator("#busy").wait_for(state="hidden", timeout=90_000)
    # who presses keys before there is anything to see has said nothing
    after = {file: file.read_bytes() for file in sorted((project / "config").rglob("*.*"))}
    assert before.keys() <= after.keys() and all(after[file] == content for file, content in before.items())
