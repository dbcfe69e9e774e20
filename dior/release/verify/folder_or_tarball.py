"""The files of a release, in a folder or in tarballs that nobody unpacks.

INPUTS   a folder, or a tarball as tarballs.py writes it. OUTPUTS: its files by their path in the release, each of which
         can be opened for reading at any place, and what is wrong with the folder or the tarball as sentences
"""

import io
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from dior.errors import DiorError
from dior.release import checksums, tarballs

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

# bytes read at once; chosen: a table's footer, which is read first, fits
BUFFER = 1 << 18


@dataclass(frozen=True)
class File:
    """`size` bytes from byte `start` of the file at `path`."""

    path: Path
    start: int
    size: int

    def open(self) -> io.BufferedReader:
        return io.BufferedReader(_Section(self), BUFFER)

    def read(self) -> bytes:
        with self.open() as stream:
            return stream.read()


class _Section(io.RawIOBase):
    """A part of a file, read as if it were a file of its own."""

    def __init__(self, file: File) -> None:
        self._file, self._at = file, 0
        self._whole = open(file.path, "rb", buffering=0)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = max(0, offset + (0, self._at, self._file.size)[whence])
        return self._at

    def readinto(self, block: "WriteableBuffer") -> int:
        self._whole.seek(self._file.start + self._at)
        count = self._whole.readinto(memoryview(block)[: max(0, self._file.size - self._at)])
        self._at += count
        return count

    def close(self) -> None:
        self._whole.close()
        super().close()


def of_folder(folder: Path) -> tuple[dict[str, File], list[str]]:
    """(`File`s by path, problems) of a folder."""
    found, problems = {}, []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            problems.append(f"{name}: is a symbolic link, which a release has none of")
        elif path.is_file():
            found[name] = File(path, 0, path.stat().st_size)
        elif not path.is_dir():
            problems.append(f"{name}: is neither a file nor a folder")
    return found, problems


@dataclass(frozen=True)
class Tarball:
    """What a tarball holds: `release`, the folder that all its files are in; `part`, whose it is (checksums.py)."""

    release: str
    part: str
    files: dict[str, File]
    problems: list[str]


def of_tarball(path: Path) -> Tarball:
    """The `Tarball` at `path`, read to its end. Raises DiorError for what is no tarball of a release at all."""
    entries, problems = _entries(path)
    release, _, first = entries[0].name.partition("/") if entries else ("", "", "")
    part = _part(first)
    if not part or not checksums.is_safe(release):
        raise DiorError(
            f"{path}: is no tarball of a release: that begins with <release>/{checksums.SUMS} or "
            f"<release>/{checksums.list_of('<subject>')}" + (f" ({problems[0]})" if problems else "")
        )
    files: dict[str, File] = {}
    end, size = 0, path.stat().st_size
    with open(path, "rb") as stream:
        for entry in entries:
            name = entry.name.removeprefix(f"{release}/")
            wrong = _wrong(entry, name, release, files) or _altered(stream, entry)
            if entry.offset_data + entry.size > size:
                problems.append(f"{entry.name}: is cut off; get the tarball again")
            elif wrong:
                problems.append(f"{entry.name}: {wrong}")
            else:
                files[name] = File(path, entry.offset_data, entry.size)
            end = entry.offset_data + tarballs.padded(entry.size, tarfile.BLOCKSIZE)
        if not problems:
            problems += _bad_end(stream, end, size)
    return Tarball(release, part, files, problems)


def _part(first: str) -> str:
    """Whose a tarball is, by its first file; "" for that of no release."""
    parts = first.split("/")
    whose = checksums.METADATA if len(parts) == 1 else parts[1]
    return whose if first == checksums.list_of(whose) else ""


def _entries(path: Path) -> tuple[list[tarfile.TarInfo], list[str]]:
    entries, problems = [], []
    try:
        with tarfile.open(path, "r:") as tar:
            for entry in tar:
                entries.append(entry)
    except (tarfile.TarError, OSError, ValueError) as error:
        problems.append(f"cut off or damaged after {len(entries)} files ({error}); get it again")
    return entries, problems


def _wrong(entry: tarfile.TarInfo, name: str, release: str, files: dict[str, File]) -> str:
    if not entry.name.startswith(f"{release}/") or not checksums.is_safe(name):
        return f"would be unpacked outside of {release}/"
    if not entry.isreg():
        return "is a link or another thing that is no plain file"
    if name in files:
        return "is in the tarball twice"
    return ""


def _altered(stream: BinaryIO, entry: tarfile.TarInfo) -> str:
    """What is around a file's bytes is known to the last bit."""
    stream.seek(entry.offset)
    head = stream.read(entry.offset_data - entry.offset)
    stream.seek(entry.offset_data + entry.size)
    if head == tarballs.header(entry.name, entry.size) and not any(stream.read(-entry.size % tarfile.BLOCKSIZE)):
        return ""
    return "its entry is not as dior writes it: damaged, or packed by something else; get it again"


def _bad_end(stream: BinaryIO, end: int, size: int) -> list[str]:
    stream.seek(end)
    if size < tarballs.size_of(end):
        return [f"cut off: it has {size} bytes, not {tarballs.size_of(end)}; get it again"]
    while block := stream.read(checksums.BLOCK):
        if any(block):
            return [f"damaged, or something was added, after byte {end}; get it again"]
    return [] if size == tarballs.size_of(end) else [f"has {size - tarballs.size_of(end)} bytes too many"]
