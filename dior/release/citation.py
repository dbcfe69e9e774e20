"""CITATION.cff of a release: how to cite it, in the Citation File Format 1.2.0 that GitHub and Zenodo read.

INPUT    the `release:` section of the config. OUTPUT: YAML text
"""

import json
import re
from typing import Any

from dior.project import licenses
from dior.project.publication import year_of
from dior.release import escape

MESSAGE = "If you use this dataset, please cite it as below."
# the format asks for an author; so does nobody where the config names none
NOBODY = "anonymous"
# a new project's, of dior/project/templates/config.yaml
TITLE = "A gait dataset"


def lacks(release: dict[str, Any]) -> list[str]:
    """What of the `release:` section is as the template has it, as sentences: others would cite that."""
    found = []
    if not release["authors"]:
        found.append(f"config/config.yaml: release.authors is empty, so that the citation names the author '{NOBODY}'")
    if release["title"] == TITLE:
        found.append(f"config/config.yaml: release.title is still '{TITLE}', the template's")
    return found


def text(release: dict[str, Any]) -> str:
    """The file's content. An author written "Family, Given" is a person, any other a name as it stands."""
    lines = ["cff-version: 1.2.0", f"message: {_quoted(MESSAGE)}", "type: dataset", *_what(release)]
    if release["license"] in licenses.KNOWN:
        lines.append(f"license: {release['license']}")
    if release["date"]:
        lines.append(f"date-released: {_quoted(release['date'])}")
    if year := year_of(release):
        # only a reference has a year of its own; the file itself asks for a day, which not everybody tells
        lines += ["preferred-citation:", "  type: data", *(f"  {line}" for line in _what(release))]
        lines.append(f"  year: {year}")
    return "\n".join(lines) + "\n"


def _what(release: dict[str, Any]) -> list[str]:
    lines = [f"title: {_quoted(release['title'])}", f"version: {_quoted(release['version'])}", "authors:"]
    for name in release["authors"] or [NOBODY]:
        family, comma, given = name.partition(",")
        if comma and given.strip():
            lines += [f"- family-names: {_quoted(family.strip())}", f"  given-names: {_quoted(given.strip())}"]
        else:
            lines.append(f"- name: {_quoted(name)}")
    return [*lines, f"doi: {_quoted(release['doi'])}"] if release["doi"] else lines


def bibtex(release: dict[str, Any]) -> str:
    """One @misc entry, for Croissant's citeAs and for the card."""
    authors = " and ".join(map(escape.bibtex, release["authors"])) or NOBODY
    fields = {"title": f"{{{escape.bibtex(release['title'])}}}", "author": authors}
    fields |= {"note": f"version {release['version']}"}
    # a DOI stands as it is in BibTeX; its own characters are none of TeX's but _, which every style takes there
    given = {"year": year_of(release), "doi": release["doi"]}
    fields |= {key: re.sub(r"[\\{}\s]", "", str(value)) for key, value in given.items() if value}
    inner = ", ".join(f"{key} = {{{value}}}" for key, value in fields.items())
    return f"@misc{{dior-{release['version']}, {inner}}}"


def _quoted(word: str) -> str:
    return json.dumps(str(word), ensure_ascii=False)
