"""croissant.json: the release in the words of MLCommons Croissant 1.1, which dataset search engines and loaders read.

INPUTS   the release folder with its tables, the `release:` section of the config
OUTPUT   a dict for JSON-LD: a file or a set of files for each table, and a record set with a field for each column
Source: https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html
"""

from pathlib import Path
from typing import Any

import pyarrow as pa

from dior.project import licenses, publication
from dior.release import citation, layout, responsible
from dior.release.layout import Part
from dior.tables import tables
from dior.tables.result_checksums import file_sha256
from dior.tables.schemas import PICTURE, SCHEMAS, VOCABULARY

PARQUET = "application/x-parquet"
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "arrayShape": "cr:arrayShape",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "containedIn": "cr:containedIn",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": {"@container": "@language"},
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isArray": "cr:isArray",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "name": {"@container": "@language"},
    "parentField": "cr:parentField",
    "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}


def content(folder: Path, release: dict[str, Any], description: str, simulated: bool) -> dict[str, Any]:
    """The JSON-LD of the release in `folder`. `release`: the section of the config; `description`: one paragraph;
    `simulated`: whether the people do not exist."""
    parts = layout.parts_of(folder)
    place = licenses.url(release["license"])
    found = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": release["title"],
        "description": description,
        "version": release["version"],
        "license": place or release["license"],
        "citeAs": citation.bibtex(release),
        "distribution": [_files(part, folder) for part in parts],
        "recordSet": [_records(part) for part in parts],
    } | responsible.properties(release, {part.name for part in parts}, simulated)
    if release["authors"]:
        found["creator"] = [{"@type": "sc:Person", "name": name} for name in release["authors"]]
    if published := publication.published(release):
        found["datePublished"] = published
    if release["doi"]:
        found["url"] = f"https://doi.org/{release['doi']}"
    return found


def _files(part: Part, folder: Path) -> dict[str, Any]:
    """A table's file with its checksum, or its files, whose checksums are in SHA256SUMS."""
    if part.path == part.pattern:
        return {
            "@type": "cr:FileObject",
            "@id": part.path,
            "name": part.path,
            "contentUrl": part.path,
            "encodingFormat": PARQUET,
            "sha256": file_sha256(folder / part.path),
        }
    return {
        "@type": "cr:FileSet",
        "@id": f"{part.name}-files",
        "name": f"{part.name}-files",
        "description": f"{part.path}; checksums in SHA256SUMS",
        "encodingFormat": PARQUET,
        "includes": part.pattern,
    }


def _records(part: Part) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": part.name,
        "name": part.name,
        "description": f"One row per {part.row}.",
        "field": [_field(part, column) for column in SCHEMAS[part.table]],
    }


def _field(part: Part, column: pa.Field) -> dict[str, Any]:
    single = part.path == part.pattern
    files = {"fileObject": {"@id": part.path}} if single else {"fileSet": {"@id": f"{part.name}-files"}}
    picture = {"transform": {"jsonPath": "bytes"}} if column.type == PICTURE else {}
    field = {
        "@type": "cr:Field",
        "@id": f"{part.name}/{column.name}",
        "name": column.name,
        "description": _described(part.table, column),
        "dataType": data_type(column.type),
        "source": {**files, "extract": {"column": column.name}, **picture},
    }
    if pa.types.is_fixed_size_list(column.type):
        field |= {"isArray": True, "arrayShape": str(column.type.list_size)}
    return field


def _described(table: str, column: pa.Field) -> str:
    description, unit = (column.metadata[key].decode() for key in (b"description", b"unit"))
    words = ", ".join(filter(None, VOCABULARY.get((table, column.name), ())))
    parts = (description, f"unit: {unit}" if unit else "", f"one of {words}" if words else "")
    return "; ".join(filter(None, parts)) or column.name


def data_type(kind: pa.DataType) -> str:
    """The type of a column in Croissant's words."""
    if kind == PICTURE:
        return "sc:ImageObject"
    if pa.types.is_fixed_size_list(kind):
        return data_type(kind.value_type)
    word = tables.word_of(kind)
    return "sc:Text" if word == "string" else f"cr:{word.capitalize()}"
