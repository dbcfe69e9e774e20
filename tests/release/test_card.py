"""The card, the licence and the citation say what the config says and what is in the release."""

import json
import re
from pathlib import Path

import pytest
import yaml

from dior.errors import DiorError
from dior.project import licenses, publication
from dior.release import card, citation, transform
from dior.tables import tables
from tests.release.made import PSEUDONYM, RELEASE, build, sheets

ROOT = Path(__file__).parents[2]
FACTS = {
    "version": "1.2.3",
    "title": "Walks",
    "license": "CC0-1.0",
    "license_file": "",
    "authors": [],
    "doi": "",
    "year": 0,
    "date": "",
}


def test_the_card(built):
    out = built["out"]
    text = (out / "README.md").read_text()
    _, front, body = text.split("---\n", 2)
    heading = yaml.safe_load(front)
    assert heading["pretty_name"] == RELEASE["title"] and heading["license"] == "cc-by-nc-4.0"
    assert heading["size_categories"] == ["n<1K"]
    for part in heading["configs"]:
        assert list(out.glob(part["data_files"])), part
    assert [part["config_name"] for part in heading["configs"] if part.get("default")] == ["labels_2d"]
    assert (
        "3 walks of 2 subjects (1 indoor, 2 outdoor): 27 labels inside the picture on 27 frames. Some cameras" in body
    )
    assert "| indoor | cam01 | close | 1 | 3 | 3 | 0.500 |" in body
    assert "| outdoor | cam02 | long-range | 2 | 6 | 6 | 0.500 |" in body
    assert "| Multi-view | yes | 3 cameras |" in body and "| 2D pose | yes | 27 keypoints |" in body
    assert "| MoCap pose | yes | 9 of 27 pictures |" in body and "| Gallery from all around | no | 0 pictures |" in body
    assert "| coverage |  |  | all | 77.5 % | 40 |" in body
    assert re.search(r"\| indoors \| not known \|  \|  \| .*without a sigma", body)
    assert "Indoor, 2: " in body
    # what only the project has is not pointed at
    assert "docs/" not in body and "results/" not in body and "config/" not in body
    assert "by Person, A.; The Lab." in body and "hold for the cameras as given" in body
    for name in (
        "labels_2d", "skeletons_3d", "released_frames", "released_detections", "released_boxes", "released_marks",
        "released_cameras", "camera_covariance", "sequences", "subjects", "splits",
    ):  # fmt: skip
        for column in tables.columns_of(name):
            assert f"| {column} |" in body
    assert "| u | float32 | px |" in body and "| wTc | 16 x float64 | m |" in body
    assert "| status | string |  | ok, out_of_frame, behind_camera, missing_3d, occluded, suspect |" in body
    assert "no_consent, head_unknown, head_uncertain, head_red, head_unseen, head_beside, not_readable" in body
    assert "heads are covered. Who released it" not in body
    assert "simulated" not in body.split("## What is in it")[0]
    assert "assumed to be zero" not in body and "not part of the release" not in body


def test_who_has_looked_at_the_heads_is_told(made):
    path = made["project"] / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + "heads_checked: {cam02: all of walk_2 looked at}\n")
    out = build(made)
    body = " ".join((out / "README.md").read_text().split())
    assert "Of camera cam02 of session field, dior does not say" in body and "says: all of walk_2 looked at" in body
    rig = tables.read(out / "cameras.parquet", "released_cameras")
    told = dict(zip(zip(rig["session"], rig["camera"], strict=True), rig["heads_checked"], strict=True))
    assert told.pop(("field", "cam02")) == "all of walk_2 looked at" and set(told.values()) == {""}


def test_what_covering_leaves_of_a_picture_is_told(made, monkeypatch):
    body = " ".join((build(made) / "README.md").read_text().split())
    assert "nothing is lost outside of the covers" in body and "is encoded again as a whole, one" not in body
    monkeypatch.setattr(transform, "library", lambda: None)
    body = " ".join((build(made) / "README.md").read_text().split())
    assert "A picture with a cover is encoded again as a whole" in body and "nothing is lost" not in body


def test_a_simulated_capture_says_so(made, tmp_path):
    sheets(tmp_path, dict.fromkeys(PSEUDONYM, "yes"), truth="truth/walk")
    assert "**These recordings are simulated.**" in (build(made) / "README.md").read_text()


def test_a_licence_of_ones_own_is_copied_and_called_other(made, tmp_path):
    (tmp_path / "agreement.txt").write_bytes(b"Ask us first.\r\n")
    config = made["config"] | {"release": RELEASE | {"license": "Lab-Agreement", "license_file": "agreement.txt"}}
    out = build(made, config=config)
    assert (out / "LICENSE").read_bytes() == b"Ask us first.\n"
    front = yaml.safe_load((out / "README.md").read_text().split("---\n")[1])
    assert (front["license"], front["license_name"], front["license_link"]) == ("other", "lab-agreement", "LICENSE")
    assert "license" not in yaml.safe_load((out / "CITATION.cff").read_text())


@pytest.mark.parametrize("name", sorted(licenses.KNOWN))
def test_known_licences_say_where_their_text_is(name, tmp_path):
    text = licenses.text(FACTS | {"license": name}, tmp_path)
    assert f"SPDX-License-Identifier: {name}\n" in text and "https://creativecommons.org/" in text
    licenses.check(FACTS | {"license": name}, tmp_path)


def test_a_licence_without_a_text_is_refused(tmp_path):
    with pytest.raises(DiorError, match=r"'CC-BY-4', .*did you mean 'CC-BY-4.0'.*'release.license_file'"):
        licenses.check(FACTS | {"license": "CC-BY-4"}, tmp_path)
    with pytest.raises(DiorError, match="'release.license_file' is 'terms.txt', where there is no file"):
        licenses.check(FACTS | {"license_file": "terms.txt"}, tmp_path)


def test_the_citation_is_yaml_with_people_and_names():
    given = FACTS | {"authors": ['Müller, Ann "Q"', "The Lab"], "doi": "10.5281/zenodo.1", "year": 2026}
    found = yaml.safe_load(citation.text(given))
    people = [{"family-names": "Müller", "given-names": 'Ann "Q"'}, {"name": "The Lab"}]
    assert found["authors"] == people and found["cff-version"] == "1.2.0" and found["type"] == "dataset"
    assert found["doi"] == "10.5281/zenodo.1" and found["license"] == "CC0-1.0" and found["version"] == "1.2.3"
    assert found["preferred-citation"]["year"] == 2026 and found["preferred-citation"]["authors"] == people
    plain = yaml.safe_load(citation.text(FACTS))
    assert plain["authors"] == [{"name": "anonymous"}] and {"doi", "preferred-citation"} & set(plain) == set()


def test_a_day_of_publication_is_told_and_another_year_is_refused():
    given = FACTS | {"date": "2026-11-30"}
    publication.check(given)
    found = yaml.safe_load(citation.text(given).replace("date-released: ", "date-released: !!str "))
    assert found["date-released"] == "2026-11-30" and found["preferred-citation"]["year"] == 2026
    assert "year = {2026}" in citation.bibtex(given)
    assert publication.published(given) == "2026-11-30" and publication.published(FACTS | {"year": 2025}) == "2025"
    assert publication.published(FACTS) == ""
    with pytest.raises(DiorError, match="'release.date' is 2026-11-30 and 'release.year' 2025; leave the year at 0"):
        publication.check(given | {"year": 2025})
    with pytest.raises(DiorError, match="'2026-02-30', which is no day"):
        publication.check(given | {"date": "2026-02-30"})


HOSTILE = (
    "<script>alert(1)</script> <img src=x onerror=f()> [click](javascript:f) ![i](http://x) `c` $x$ a_b*c* } \\input{x}"
)


def test_a_title_that_is_html_markdown_or_tex_is_text_in_the_card(made):
    """In its heading, among the authors, as a licence, and as a citation."""
    (made["project"] / "terms.txt").write_text("Ask us.")
    hostile = {"title": HOSTILE, "authors": [HOSTILE, "Lab\n# Heading\n```"], "license": HOSTILE}
    config = made["config"] | {"release": RELEASE | hostile | {"license_file": "terms.txt"}}
    out = build(made, config=config)
    _, front, body = (out / "README.md").read_text().split("---\n", 2)
    assert yaml.safe_load(front)["pretty_name"] == HOSTILE
    prose, cited = body.split("```bibtex\n")
    top = prose.split("## How to read it")[0]
    assert "<" not in top and top.count("&lt;script&gt;") == 3 and "\n# Heading" not in top
    assert not re.search(r"(?<!\\)[`*_\[\]$]", top.replace("**", "")), "nothing is a link, a picture, code or emphasis"
    assert cited.count("\n") == 2 and cited.count("{") == cited.count("}"), "the entry is one line, whose braces match"
    assert r"\input" not in cited and r"\textbackslash{}input" in cited
    described = (out / "croissant.json").read_text()
    assert "<" not in described and ">" not in described, "it may stand in a page's <script>"
    content = json.loads(described)
    assert content["name"] == HOSTILE and content["creator"][0]["name"] == HOSTILE and content["license"] == HOSTILE
    assert yaml.safe_load((out / "CITATION.cff").read_text())["title"] == HOSTILE


def test_a_harmless_title_is_shown_as_it_is(made):
    title = "DIOR: indoor-outdoor (2nd), Zürich 2.0"
    out = build(made, config=made["config"] | {"release": RELEASE | {"title": title}})
    assert f"# {title}\n" in (out / "README.md").read_text()
    assert f"title = {{{{{title}}}}}," in (out / "README.md").read_text()


def test_cameras_of_one_name_in_two_sessions_are_two_rows():
    walks = {"in_1": "lab_1", "in_2": "lab_1", "out_1": "field_1"}
    row = {"metric": "check_error", "tool": "", "subject": "p1", "camera": "cam04", "role": "close", "joint": "",
           "unit": "px", "n": 10}  # fmt: skip
    rows = [row | {"sequence": "in_1", "value": 1.0}, row | {"sequence": "in_2", "value": 4.0, "n": 20},
            row | {"sequence": "out_1", "value": 9.0}]  # fmt: skip
    assert card.pooled_figures(rows, walks) == {
        ("check_error", "", "field_1", "cam04"): (9.0, "px", 10),
        ("check_error", "", "lab_1", "cam04"): (3.0, "px", 30),
    }


def test_a_new_projects_title_and_no_authors_are_told():
    assert len(citation.lacks(FACTS | {"title": citation.TITLE})) == 2
    assert citation.lacks(FACTS | {"authors": ["A"]}) == []
    template = (ROOT / "dior/project/templates/config.yaml").read_text()
    assert yaml.safe_load(template)["release"]["title"] == citation.TITLE
