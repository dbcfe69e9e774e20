"""What each result was when its job wrote it: a result is read only if it still is that.

OUTPUTS  results/.sha256/<step>/<file>: for each result that another step reads a line as `sha256sum` writes it
A line per file and not one list, since jobs run at once, and on several computers; in a folder of its own and not
beside the file, so that a file or a folder of another project that is put in the place of one's own is noticed.

It holds in the results/ of a project: a folder that has config/config.yaml beside it, or .sha256 in it. A release has
SHA256SUMS instead, and a file anywhere else is taken as it is.
"""

import hashlib
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from dior.errors import DiorError
from dior.paths import AnyPath

FOLDER, RESULTS = ".sha256", "results"
CONFIG = os.path.join("config", "config.yaml")
# a release has its own list of checksums, which others check without a project; no step reads what the jobs cost
NOT_IN_IT = (FOLDER, "release", "timing.csv")
# what one step writes and another reads; not pages and pictures for people, nor simulated recordings
KINDS = (".parquet", ".json", ".csv")
_LINE = re.compile(r"([0-9a-f]{64})  (.+)\n")


@dataclass(frozen=True)
class Result:
    """A file in the results/ of a project that another step reads. `parts`: its path below results/."""

    results: Path
    parts: tuple[str, ...]

    @property
    def name(self) -> str:
        """As the workflow calls it."""
        return "/".join((RESULTS, *self.parts))

    @property
    def entry(self) -> Path:
        """The file that has its checksum."""
        return self.results.joinpath(FOLDER, *self.parts)

    def line(self, digest: str) -> str:
        """The line of that file; `digest`: hex SHA-256."""
        return f"{digest}  {self.name}\n"


def file_sha256(path: AnyPath) -> str:
    """Hex SHA-256 of a file's bytes."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def result_at(path: AnyPath) -> Result | None:
    """The `Result` at a path; None for any other file."""
    whole = Path(os.path.abspath(path))
    if whole.suffix not in KINDS:
        return None
    for folder in whole.parents:
        if folder.name == RESULTS and (os.path.isfile(folder.parent / CONFIG) or os.path.isdir(folder / FOLDER)):
            parts = whole.relative_to(folder).parts
            return None if parts[0] in NOT_IN_IT else Result(folder, parts)
    return None


def check(path: AnyPath, digest: str) -> None:
    """Raise DiorError for a result whose SHA-256 is not the one that its job noted, or of which none is noted."""
    result = result_at(path)
    if result is None:
        return
    again = f"run snakemake again with `--forcerun {result.name}`"
    try:
        noted = _noted(result.entry)
    except FileNotFoundError:
        folder = result.results / FOLDER
        if folder.is_dir():
            raise DiorError(
                f"{path}: no job has noted what it wrote there, so that this cannot be trusted ({result.entry} is "
                f"missing); {again}, or with `--forceall` if an older dior made it"
            ) from None
        raise DiorError(
            f"{path}: cannot be trusted, since {folder} is missing, where jobs note what they wrote; if the results "
            "were copied, copy that folder, too; if an older dior made them, run snakemake again with `--forceall`"
        ) from None
    if noted != result.line(digest):
        found = _LINE.fullmatch(noted)
        expected = f"{found[1][:12]}..." if found and found[2] == result.name else f"readable in {result.entry}"
        raise DiorError(
            f"{path}: is not what its job wrote, but damaged, edited or of another run (its SHA-256 is "
            f"{digest[:12]}..., not {expected}); {again}"
        )


def _noted(entry: Path) -> str:
    """The line in a file of checksums. Raises FileNotFoundError."""
    if not entry.is_file():
        # a disk on the network may not show what another computer has just written until the folder is listed
        with suppress(OSError):
            os.listdir(entry.parent)
    return entry.read_text(encoding="utf-8", errors="replace")


def check_file(path: AnyPath) -> None:
    """The same for a result that is not read by dior's own means."""
    check(path, file_sha256(path))


def read_bytes(path: AnyPath) -> bytes:
    """The bytes of a file. Raises DiorError for a result that is not what its job wrote."""
    content = Path(path).read_bytes()
    check(path, hashlib.sha256(content).hexdigest())
    return content


def read_text(path: AnyPath) -> str:
    """The same as text. Raises DiorError for what is not UTF-8, too."""
    try:
        return read_bytes(path).decode()
    except UnicodeDecodeError as error:
        raise DiorError(f"{path}: is not UTF-8 (byte {error.start}); delete it and run again") from None
