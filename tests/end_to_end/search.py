"""Everything that files tell: their bytes, and what these mean where they are packed or coded.

Parquet cells, schema and metadata; members of tar and zip files, with names and owners; what is gzipped; JSON and HTML
with their escapes undone; the bytes of pictures inside any of them; and names of files in base64, which Snakemake's
records have.
"""

import base64
import gzip
import html
import io
import json
import re
import tarfile
import zipfile
from pathlib import Path

import pyarrow.parquet as pq


def told(path, root=None):
    """Yield (where, bytes in lower case) of a file, or of all in a folder; paths count, relative to `root`."""
    path = Path(path)
    if path.is_dir():
        for inner in sorted(path.rglob("*")):
            if inner.is_file():
                yield from told(inner, root or path)
        return
    where = str(path.relative_to(root)) if root else path.name
    yield where, where.lower().encode()
    yield where, _named_in_base64(path.name)
    yield from _content(where, path.read_bytes())


def _named_in_base64(name):
    code = "".join(re.findall(r"[A-Za-z0-9_-]", name))
    # as many characters as are whole bytes
    code = code[: -1 if len(code) % 4 == 1 else None]
    return base64.urlsafe_b64decode(code + "=" * (-len(code) % 4)).lower()


def _content(where, content):
    yield where, content.lower()
    if ".sha256/" in where:
        # the line about the file of this name
        return
    suffix = where.rpartition(".")[2]
    if suffix == "parquet":
        yield where, _table(content)
    elif suffix == "tar":
        with tarfile.open(fileobj=io.BytesIO(content)) as tar:
            for member in tar:
                inner = f"{where}: {member.name}"
                yield inner, repr((member.name, member.uname, member.gname, member.pax_headers)).lower().encode()
                if member.isfile():
                    yield from _content(inner, tar.extractfile(member).read())
    elif suffix in ("zip", "npz"):
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            for name in packed.namelist():
                yield from _content(f"{where}: {name}", packed.read(name))
    elif suffix == "gz":
        yield from _content(where.removesuffix(".gz"), gzip.decompress(content))
    elif suffix in ("json", "jsonl"):
        lines = content.decode().splitlines() if suffix == "jsonl" else [content.decode()]
        values = [json.loads(line) for line in lines]
        yield where, json.dumps(values, ensure_ascii=False).lower().encode()
    elif suffix in ("html", "svg", "xml"):
        yield where, html.unescape(content.decode()).lower().encode()


def _table(content):
    """All cells, names and metadata of a Parquet file; binary cells as they are."""
    table = pq.read_table(io.BytesIO(content))
    parts = [repr((table.schema.metadata, [(f.name, f.metadata) for f in table.schema])).encode()]
    for column in table.columns:
        for value in set(column.to_pylist()) if _hashable(column) else column.to_pylist():
            parts.append(_bytes(value))
    return b"\n".join(parts).lower()


def _hashable(column):
    return not column.type.num_fields


def _bytes(value):
    if isinstance(value, bytes):
        return value
    if isinstance(value, dict):
        return b"\n".join(_bytes(one) for one in value.values())
    return str(value).encode()


def holding(path, words):
    """(word, where) of all places in a file or folder that tell one of the words."""
    coded = [word.lower().encode() for word in words]
    return sorted({(word.decode(), where) for where, content in told(path) for word in coded if word in content})
