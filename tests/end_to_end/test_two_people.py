"""The whole workflow on a tiny simulated capture of two people: what an edit or a withdrawal of one of them touches."""

import shutil
from collections import Counter

import pytest

from dior.simulate import config as simulated
from dior.simulate import settings
from dior.tables import tables
from tests.end_to_end.test_tiny import TINY
from tests.end_to_end.workflow import edit, planned, snakemake

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A finished run with a release. Tests that edit it work on a copy."""
    folder = tmp_path_factory.mktemp("two")
    simulated.write(settings.from_dict(TINY | {"subjects": 2}), folder / "config")
    snakemake(folder, "all", "release")
    return folder


def gallery_of(folder):
    """Pictures by (subject, outfit, angle) in the release's gallery."""
    released = tables.read(folder / "results/release/dior-0.1.0/gallery.parquet", "released_gallery")
    return Counter(zip(released["subject"], released["outfit"], released["angle"], strict=True))


def withdraw(folder, release="no", pictures="no"):
    """Take back the consents of S02; returns the pseudonym."""
    sheet = folder / "config/subjects.tsv"
    row = next(line for line in sheet.read_text().splitlines() if line.startswith("S02"))
    edit(sheet, row, row.replace("\tyes\tyes", f"\t{release}\t{pictures}"))
    return row.split("\t")[1]


def test_the_gallery_is_counted_and_released_until_its_subject_withdraws(copy):
    found = tables.read(copy / "results/gallery/gallery.findings.parquet", "findings")
    rows = (copy / "config/subjects.tsv").read_text().splitlines()[1:]
    assert found["scope"].tolist() == sorted(row.split("\t")[1] for row in rows) and set(found["severity"]) == {"info"}
    assert all("72 gallery pictures" in text and "frontal 36" in text for text in found["text"]), found["text"]
    assert "72 gallery pictures" in (copy / "results/report/index.html").read_text()
    before = gallery_of(copy)
    assert len(before) == 4 and set(before.values()) == {36}
    names = {subject for subject, _, _ in before}
    sheet = copy / "config/subjects.tsv"
    gone = withdraw(copy)
    assert names == {row.split("\t")[1] for row in sheet.read_text().splitlines()[1:]} and gone in names
    snakemake(copy, "release")
    assert {subject for subject, _, _ in gallery_of(copy)} == names - {gone}
    assert gone.encode() not in (copy / "results/release/dior-0.1.0/gallery.parquet").read_bytes()
    assert set(tables.read(copy / "results/gallery/gallery.parquet", "gallery")["subject"]) == names - {gone}


@pytest.mark.parametrize("target", ["subject", "report", "release"])
def test_targets_have_names(project, tmp_path, target):
    shutil.copytree(project / "config", tmp_path / "config")
    who = (tmp_path / "config/subjects.tsv").read_text().splitlines()[1].split("\t")[1]
    jobs = planned(tmp_path, f"subject_{who}" if target == "subject" else target)
    assert jobs["reproject"] == (2 if target == "subject" else 4)
    assert ("tarballs" in jobs) == (target == "release")


def test_an_edited_sheet_row_touches_its_sequence(copy):
    row = next(r for r in (copy / "config/sequences.tsv").read_text().splitlines() if r.startswith("outdoor_02"))
    edit(copy / "config/sequences.tsv", row, row.replace("\tS02\t", "\tS01\t"))
    # the session is adjusted with this walk, and its person's height judges that; now it tells of the other one's, too
    assert planned(copy) == {
        "adjust": 1, "clocks": 2, "timeline": 2, "bodies": 1, "follow": 2, "triangulate": 2, "refine": 2, "world": 2,
        "gait": 2,
        "align": 1, "moved": 1, "reproject": 2, "evaluate": 2,
        "overlays": 2, "clip": 2, "viewer": 2, "page": 2, "metrics": 1, "statistics": 1, "report": 1,
        "heads": 8, "pixels": 8, "package": 1, "exports": 1, "tarballs": 3,
    }  # fmt: skip


def test_who_withdraws_touches_the_labels_that_depended_on_it(copy):
    """The cameras outdoors were adjusted and aligned with a walk of S02; indoors there is nothing to do."""
    withdraw(copy)
    assert planned(copy) == {
        "adjust": 1, "clocks": 1, "timeline": 1, "follow": 1, "triangulate": 1, "refine": 1, "world": 1,
        "gait": 1, "align": 1,
        "gallery": 1, "reproject": 1, "evaluate": 1, "overlays": 1, "clip": 1, "viewer": 1, "page": 2, "metrics": 1,
        "statistics": 1, "report": 1, "heads": 4, "pixels": 4, "package": 1, "exports": 1, "tarballs": 2,
    }  # fmt: skip


def test_who_takes_back_the_pictures_touches_no_label(copy):
    withdraw(copy, release="yes")
    assert planned(copy) == {"pixels": 8, "package": 1, "exports": 1, "tarballs": 3}
