"""ro-crate-metadata.json: whole by the rules of RO-Crate 1.1, read by its own library, and held by `dior verify`."""

import json

import pytest

from dior.release import crate
from tests.release import made_up
from tests.release.made import RELEASE, build
from tests.release.verify.test_forged import replaced, verified  # noqa: F401

DAY = {"date": "2026-11-30", "doi": "10.5281/zenodo.1"}


def entities(out):
    content = json.loads((out / crate.FILE).read_text())
    assert content["@context"] == "https://w3id.org/ro/crate/1.1/context"
    found = {one["@id"]: one for one in content["@graph"]}
    assert len(found) == len(content["@graph"]), "no two of one @id"
    return found


def named(value):
    """The @id that a value names."""
    if isinstance(value, dict):
        return {value["@id"]}
    return set().union(*map(named, value)) if isinstance(value, list) else set()


def test_a_release_with_a_day_is_a_crate(made):
    out = build(made, config=made["config"] | {"release": RELEASE | DAY})
    found = entities(out)
    assert found[crate.FILE]["about"] == {"@id": "./"}
    assert found[crate.FILE]["conformsTo"] == {"@id": "https://w3id.org/ro/crate/1.1"}
    root = found["./"]
    assert {"name", "description", "datePublished", "license"} <= set(root)
    assert root["datePublished"] == "2026-11-30" and root["identifier"] == "https://doi.org/10.5281/zenodo.1"
    assert [found[one["@id"]]["name"] for one in root["author"]] == RELEASE["authors"]
    assert "4.0" in found[root["license"]["@id"]]["name"]
    # what an entity names is described, and what is described as a part is there
    for one in found.values():
        for key in set(one) - {"conformsTo"}:
            assert named(one[key]) <= set(found), (one["@id"], key)
    parts = {one["@id"] for one in root["hasPart"]}
    assert parts == {f"{path.name}/" if path.is_dir() else path.name for path in out.iterdir()} - {
        *(crate.FILE, "SHA256SUMS", "checksums/")
    }


def test_without_a_day_there_is_none(built):
    assert not (built["out"] / crate.FILE).exists()


def test_its_own_library_reads_it(made):
    rocrate = pytest.importorskip("rocrate.rocrate", reason="rocrate is not installed")
    out = build(made, config=made["config"] | {"release": RELEASE | DAY})
    found = rocrate.ROCrate(str(out))
    assert found.name == RELEASE["title"] and len(found.data_entities) == len(entities(out)["./"]["hasPart"])


@pytest.fixture
def crated(tmp_path, monkeypatch):
    """A release that `dior verify` finds whole, with a crate."""
    about = made_up.ABOUT | DAY
    monkeypatch.setattr(made_up, "ABOUT", about)
    folder = made_up.release(tmp_path / "dior-0.1.0")
    described = json.loads((folder / "croissant.json").read_text())["description"]
    for path in folder.rglob("SHA256SUMS"):
        path.unlink()
    (folder / crate.FILE).write_text(json.dumps(crate.content(folder, about, described)))
    made_up.remade(folder)
    return folder


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("2026-11-30", "2020-01-01", 'says datePublished "2020-01-01"; provenance.json and croissant.json have'),
        ("zero/1.0", "by/4.0", "says license"),
        ('"name": "made up"', '"name": "mine"', 'says name "mine"'),
        ('"LICENSE"', '"LICENCE"', "has another SHA-256 of LICENCE than SHA256SUMS"),
        ('"labels_2d/"', '"labels_3d/"', "names labels_3d/, which the release does not have"),
        ('"sha256": "[0-9a-f]{4}', '"sha256": "0000', "has another SHA-256 of"),
        (r"\A\{", "[", "is not the JSON that dior writes"),
    ],
)
def test_a_crate_that_says_something_else_is_found(crated, verified, old, new, problem):  # noqa: F811
    assert verified(crated) == []
    replaced(crated, crate.FILE, old, new)
    assert any(line.startswith(f"{crate.FILE}: {problem}") for line in verified(crated)), verified(crated)
