"""ro-crate-metadata.json: the release as an RO-Crate 1.1, which archives and catalogues of research data read.

INPUTS   the release folder with its other files, the `release:` section of the config
OUTPUT   a dict for JSON-LD: what the release is, who made it by what, its licence, and its tables and texts
A crate has to say when it was published, so that there is one only where the config gives a day or a year.
Source: https://www.researchobject.org/ro-crate/specification/1.1/
"""

from pathlib import Path
from typing import Any

from dior import __version__
from dior.project import licenses, publication
from dior.release import croissant, layout
from dior.tables.result_checksums import file_sha256

FILE = "ro-crate-metadata.json"
TYPES = {
    ".parquet": croissant.PARQUET,
    ".json": "application/json",
    ".md": "text/markdown",
    ".csv": "text/csv",
    ".cff": "application/yaml",
    ".jpg": "image/jpeg",
    "": "text/plain",
}


def content(folder: Path, release: dict[str, Any], description: str) -> dict[str, Any]:
    """The JSON-LD of the release in `folder`, whose other files are there. `description`: one paragraph."""
    parts = layout.parts_of(folder)
    tables = [_table(part, folder) for part in parts]
    known = {entity["@id"] for entity in tables}
    texts = [_file(path) for path in sorted(folder.iterdir()) if path.is_file() and path.name not in known]
    people = [
        {"@id": f"#author-{i}", "@type": "Person", "name": name} for i, name in enumerate(release["authors"], start=1)
    ]
    licence = licenses.url(release["license"])
    root = root_of(release, description) | {
        "hasPart": [_to(entity) for entity in (*tables, *texts)],
        "license": {"@id": licence or "LICENSE"},
        "mentions": {"@id": "#made"},
    }
    if people:
        root["author"] = [_to(person) for person in people]
    about = [
        {
            "@id": FILE,
            "@type": "CreativeWork",
            "about": {"@id": "./"},
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        },
        root,
        {"@id": "#dior", "@type": "SoftwareApplication", "name": "dior", "version": __version__},
        {
            "@id": "#made",
            "@type": "CreateAction",
            "name": "Labels made from recordings; provenance.json has the settings and the checksums of the recordings",
            "instrument": {"@id": "#dior"},
            "result": {"@id": "./"},
        },
    ]
    if licence:
        about.append({"@id": licence, "@type": "CreativeWork", "name": licenses.KNOWN[release["license"]][0]})
    return {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": [*about, *people, *tables, *texts]}


def root_of(release: dict[str, Any], description: str) -> dict[str, Any]:
    """What the crate says of the release as a whole, but for its parts, people and licence."""
    found = {
        "@id": "./",
        "@type": "Dataset",
        "name": release["title"],
        "description": description,
        "version": release["version"],
        "datePublished": publication.published(release),
        "identifier": f"https://doi.org/{release['doi']}" if release["doi"] else "",
    }
    return {key: value for key, value in found.items() if value}


def _to(entity: dict[str, Any]) -> dict[str, str]:
    return {"@id": entity["@id"]}


def _table(part: layout.Part, folder: Path) -> dict[str, Any]:
    """A table's file, or the folder of its files, whose checksums are in SHA256SUMS."""
    described = {"name": part.name, "description": f"One row per {part.row}."}
    if part.path == part.pattern:
        return _file(folder / part.path) | described
    return {"@id": f"{part.name}/", "@type": "Dataset", **described}


def _file(path: Path) -> dict[str, Any]:
    return {
        "@id": path.name,
        "@type": "File",
        "name": path.name,
        "encodingFormat": TYPES.get(path.suffix, "application/octet-stream"),
        "contentSize": str(path.stat().st_size),
        "sha256": file_sha256(path),
    }
