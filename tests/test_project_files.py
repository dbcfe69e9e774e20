"""What the files of the project say of each other: versions, the names in the docs."""

import re
from pathlib import Path

import yaml

import dior
from dior.project.steps import PLACES
from tests.test_rooms import ROOMS

ROOT = Path(__file__).resolve().parents[1]


def test_one_version():
    version = dior.__version__
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == version
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()


def test_pre_commit_runs_the_versions_of_the_tests():
    wanted = set((ROOT / "tests/requirements.txt").read_text().split("\n"))
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"][0]["hooks"]
    assert {pin for hook in hooks for pin in hook["additional_dependencies"]} <= wanted


def test_architecture_names_what_there_is():
    text = (ROOT / "docs/architecture.md").read_text()
    paths = set(re.findall(r"`((?:dior|tests|benchmarks)/[\w./]+)`", text))
    assert len(paths) > 20 and not [path for path in paths if not (ROOT / path).exists()]
    rooms = text.split("## From bag")[0]
    stages = ROOMS[ROOMS.index("ingest") + 1 : ROOMS.index("release")]  # `ingest/` ... `release/`
    assert [room for room in ROOMS if f"`{room}" not in rooms and room not in stages] == []


def test_architecture_has_the_table_of_places():
    text = (ROOT / "docs/architecture.md").read_text()
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| `([\w/]+)` \|$", text, re.MULTILINE)
    found = {step: place.strip("/") for steps, place in rows for step in re.findall(r"\w+", steps)}
    assert found == {step: place.strip("<>") for step, place in PLACES.items()}


def test_links_between_the_pages_lead_somewhere():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / "config/README.md"]
    for page in pages:
        for link in re.findall(r"\]\(([^)#:]+)(?:#[\w-]*)?\)", page.read_text()):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_every_fault_of_the_page_of_reliability_is_tried_by_a_test_that_there_is():
    text = (ROOT / "docs/reliability.md").read_text()
    named, section_file = [], re.search(r"^In `([\w/.]+)`", text, re.MULTILINE)[1]
    for path, name in re.findall(r"`([\w/.]*)::(\w+)`", text):
        named.append((path or section_file, name))
    lost = [
        f"{path}::{name}" for path, name in named
        if not re.search(rf"^def {name}\(", (ROOT / "tests" / path).read_text(), re.MULTILINE)
    ]  # fmt: skip
    assert len(named) > 80 and lost == []
