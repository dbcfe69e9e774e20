"""What a release says of itself must be what it was made with and what it holds.

INPUTS   `Evidence` (evidence.py): LICENSE, README.md, CITATION.cff, croissant.json, provenance.json and the tables, and
         ro-crate-metadata.json where there is one
OUTPUTS  problems as (path, sentence)
Facts are compared and not wording, which another version of dior may change: licence, title, version, authors, DOI and
year; the figures that the card shows; the tables, columns and types that Croissant describes.
"""

import hashlib
import html
import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from dior.project import licenses, publication
from dior.release import card, citation, crate, croissant, layout
from dior.release.verify.evidence import Evidence
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.walk_checks import Problem
from dior.report.numbers import show
from dior.tables.schemas import SCHEMAS

CITED = (
    "title:",
    "version:",
    "license:",
    "doi:",
    "year:",
    "date-released:",
    "- name:",
    "- family-names:",
    "given-names:",
)
FIGURES_HEADER = "| figure | tool | session | over | value | n |"
# what the rounding to six digits in metrics.csv may do to a figure, as a share of it
ROUNDED = 1e-5
BOM = b"\xef\xbb\xbf"


def check(release: Evidence) -> list[Problem]:
    """Compare the texts of a release with its settings, as provenance.json has them, and with its tables."""
    settings = {key.removeprefix("release."): value for key, value in release.rig.settings.items()}
    problems = [("provenance.json", text) for text in _provenance(release)]
    if not {"title", "version", "license"} <= settings.keys():
        return [*problems, ("provenance.json", "has no title, version or licence among its settings")]
    about = {"authors": [], "doi": "", "year": 0, "date": "", "license_file": ""} | settings
    files = release.files
    problems += [("LICENSE", text) for text in _licence(files["LICENSE"].read(), about)]
    problems += [("CITATION.cff", text) for text in _citation(files["CITATION.cff"].read(), about)]
    problems += [("README.md", text) for text in _card(release, about)]
    content = json.loads(files["croissant.json"].read())
    problems += [("croissant.json", text) for text in _croissant(content, about, release)]
    if crate.FILE in files:
        told = json.loads(files[crate.FILE].read())
        problems += [(crate.FILE, text) for text in _crate(told, about, str(content.get("description")), files)]
    return problems


def _provenance(release: Evidence) -> Iterator[str]:
    """Its own hash, and the sessions and walks that it is about."""
    made_of = release.provenance
    settings = made_of.get("config")
    if made_of.get("config_sha256") != hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest():
        yield "its config_sha256 is not that of its settings"
    sheet = release.tables["sequences"]
    for key, column in (("sessions", "session"), ("sequences", "sequence")):
        told, there = set(made_of.get(key, {})), set(sheet[column])
        yield from (f"tells of {column} '{one}', which is not in sequences.parquet" for one in sorted(told - there))
        yield from (f"tells nothing of {column} '{one}'" for one in sorted(there - told))
    version = release.rig.settings.get("release.version")
    if made_of.get("release") != version:
        yield f"is of release {made_of.get('release')}, its settings are of {version}"


def _licence(content: bytes, about: dict[str, Any]) -> Iterator[str]:
    """The text of a licence that dior knows, or the file whose checksum the settings have."""
    wanted = str(about["license_file"])
    if not wanted:
        if about["license"] in licenses.KNOWN and content != licenses.text(about, "").encode():
            yield f"is not the text of {about['license']}, which provenance.json says"
        return
    # it was written without a byte order mark and with line feeds only
    ways = [mark + text for text in (content, content.replace(b"\n", b"\r\n")) for mark in (b"", BOM)]
    if wanted not in {f"sha256:{hashlib.sha256(way).hexdigest()}" for way in ways}:
        yield f"is not the file with the text of {about['license']} whose checksum provenance.json has"


def _citation(content: bytes, about: dict[str, Any]) -> Iterator[str]:
    """Title, version, authors, licence, DOI and year, each on lines of its own."""
    stated, expected = (_cited(text) for text in (content.decode("utf-8", "replace"), citation.text(about)))
    for line in sorted(set(expected) - set(stated)):
        yield f"does not say {line}, which provenance.json does"
    for line in sorted(set(stated) - set(expected)):
        yield f"says {line}, which provenance.json does not"


def _cited(text: str) -> list[str]:
    return [line for line in map(str.strip, text.splitlines()) if line.startswith(CITED)]


def _shown(value: Any) -> str:
    return "nothing" if value is None else json.dumps(value, ensure_ascii=False)


def _card(release: Evidence, about: dict[str, Any]) -> Iterator[str]:
    """The front matter, which the Hub shows, the title, the version and the citation; counts and figures."""
    text = release.files["README.md"].read().decode("utf-8", "replace")
    known = about["license"] in licenses.KNOWN
    licence = ("license" if known else "license_name", about["license"].lower())
    for key, value in (("pretty_name", about["title"]), licence):
        line = f"{key}: {json.dumps(str(value), ensure_ascii=False)}"
        if line not in text.split("\n---\n")[0].splitlines():
            yield f"its front matter does not say {line}, which provenance.json does"
    named = f"[{about['license']}]({licenses.url(about['license'])})" if known else f"{about['license']}, see LICENSE"
    by = f", by {'; '.join(about['authors'])}" if about["authors"] else ""
    lines = set(map(plain, text.splitlines()))
    for line in (f"# {about['title']}", f"Version {about['version']}{by}. Licence: {named}."):
        if plain(line) not in lines:
            yield f"has no line '{line}', by which title, version, authors and licence are those of provenance.json"
    if plain(citation.bibtex(about)) not in plain(text):
        yield "cites another title, author, version, year or DOI than provenance.json has"
    if _numbers(_summary(release)) not in map(_numbers, text.splitlines()):
        yield f"has no line with the counts of '{_summary(release)}'"
    sessions = {row["sequence"]: row["session"] for row in layout.rows_of(release.tables["sequences"])}
    yield from _figures(text, release.files, sessions)


def plain(text: str) -> str:
    """Without what keeps a title from being taken for HTML or Markdown."""
    return html.unescape(text).replace("\\", "")


def _numbers(text: str) -> list[str]:
    return re.findall(r"\d+", text)


def _summary(release: Evidence) -> str:
    """What the release is in one paragraph, of counts of its tables."""
    sheet = release.tables["sequences"]
    walks = {row["sequence"]: row for row in layout.rows_of(sheet)}
    total: Counter[tuple[str, str]] = Counter()
    for walk in release.walks:
        for camera, counts in walk.counts.items():
            one = release.rig.camera(walk.sequence, camera)
            for what in ("keypoints_2d", "frames"):
                total[what, one.role if one else ""] += counts[what]
    for (what, role), n in list(total.items()):
        if role:
            total[what, ""] += n
    counted = [
        {"what": what, "environment": "", "role": role, "camera": "", "reason": "", "value": n}
        for (what, role), n in total.items()
    ]
    return card.summary(walks, counted)


def _figures(text: str, files: dict[str, File], sessions: Mapping[str, str]) -> Iterator[str]:
    """The rows of the card's table of figures must be rows of metrics.csv."""
    from dior.release.verify import figures

    try:
        found = list(figures.read(files["metrics.csv"].read()))
    except ValueError:
        return
    expected = card.pooled_figures(found, sessions)
    part = text.split(FIGURES_HEADER)[1].split("\n\n")[0].splitlines()[2:] if FIGURES_HEADER in text else []
    stated: dict[card.Place, tuple[str, ...]] = {}
    for line in part:
        metric, tool, session, where, *shown = (cell.strip() for cell in [*line.strip("|").split("|"), *" " * 4][:6])
        stated[metric, tool, session, where] = tuple(shown)
    wrong = [key for key in sorted(stated.keys() | expected.keys()) if not _agree(stated.get(key), expected.get(key))]
    if wrong:
        first = wrong[0]
        said = " ".join(stated[first]) if first in stated else "nothing"
        value, unit, n = expected.get(first, (math.nan, "", 0))
        right = f"{show(value, unit)} {n}" if first in expected else "nothing"
        yield (
            f"{len(wrong)} of its figures are not those of metrics.csv, first {' '.join(filter(None, first))}: {said}, "
            f"not {right}"
        )


def _agree(stated: tuple[str, ...] | None, expected: tuple[float, str, int] | None) -> bool:
    """Whether value, unit and count are the same, the value as it is shown of one that was rounded to six digits."""
    if stated is None or expected is None:
        return False
    value, unit, n = expected
    return stated in {(show(value * (1 + off), unit), str(n)) for off in (-ROUNDED, 0.0, ROUNDED)}


def _croissant(content: dict[str, Any], about: dict[str, Any], release: Evidence) -> Iterator[str]:
    """What a search engine shows, and the tables with their columns."""
    expected: dict[str, Any] = {
        "name": about["title"],
        "version": about["version"],
        "license": licenses.url(about["license"]) or about["license"],
        "citeAs": citation.bibtex(about),
        "creator": [{"@type": "sc:Person", "name": name} for name in about["authors"]] or None,
        "datePublished": publication.published(about) or None,
        "url": f"https://doi.org/{about['doi']}" if about["doi"] else None,
    }
    for key, value in expected.items():
        if content.get(key) != value:
            yield f"says {key} {_shown(content.get(key))}; provenance.json has {_shown(value)}"
    if _numbers(str(content.get("description"))) != _numbers(_summary(release)):
        yield f"its description has other counts than '{_summary(release)}'"
    there = [part for part in layout.PARTS if any(_is_of(part, name) for name in release.files)]
    stated = {one.get("name"): one for one in content.get("recordSet", ())}
    for part in there:
        fields = stated.get(part.name, {}).get("field", ())
        told = [(field.get("name"), field.get("dataType")) for field in fields]
        if told != [(column.name, croissant.data_type(column.type)) for column in SCHEMAS[part.table]]:
            yield f"does not describe the table {part.name} with its columns and their types"
    for name in sorted(set(map(str, stated)) - {part.name for part in there}):
        yield f"describes a table {name} that the release does not have"


def _crate(told: dict[str, Any], about: dict[str, Any], description: str, files: Mapping[str, File]) -> Iterator[str]:
    """The release as a whole, its people and licence, and that it names no file that is not there."""
    entities = {one.get("@id"): one for one in told.get("@graph", ())}
    root = entities.get("./", {})
    for key, value in crate.root_of(about, description).items():
        if root.get(key) != value:
            yield f"says {key} {_shown(root.get(key))}; provenance.json and croissant.json have {_shown(value)}"
    licence = licenses.url(about["license"]) or "LICENSE"
    if root.get("license") != {"@id": licence}:
        yield f"says license {_shown(root.get('license'))}; provenance.json has {about['license']}"
    people = [entities.get(one.get("@id"), {}).get("name") for one in root.get("author", ())]
    if people != list(about["authors"]):
        yield f"says author {_shown(people)}; provenance.json has {_shown(about['authors'])}"
    names = {*files, *(f"{name.split('/')[0]}/" for name in files if "/" in name)}
    for one in sorted(str(part.get("@id")) for part in root.get("hasPart", ())):
        if one not in names:
            yield f"names {one}, which the release does not have"


def _is_of(part: layout.Part, name: str) -> bool:
    return name == part.path or (part.path != part.pattern and name.split("/")[0] == part.name)
