"""What several exports write alike: lists as CSV, names made of free text, members of tar files."""

import csv
import io
import json
import re
import tarfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dior.tables.files import write_text


def plain(text: str) -> str:
    """The letters and digits of a free text, for names of files.

    >>> plain("red coat, hood/cap")
    'redcoathoodcap'
    """
    return re.sub(r"[^A-Za-z0-9]", "", text)


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write rows below a header."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows([columns, *rows])
    write_text(path, stream.getvalue())


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write JSON that a person reads."""
    write_text(path, json.dumps(content, indent=1) + "\n")


def add_to_tar(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    """Append a file of `content` (bytes) with nothing of its owner, time or rights."""
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = len(content), 0o644
    tar.addfile(entry, io.BytesIO(content))
