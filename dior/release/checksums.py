"""The checksums of a release: which files it has, and which of them go into whose tarball.

OUTPUTS  SHA256SUMS: every file of the release, as `sha256sum` writes it; checksums/<subject>/SHA256SUMS: the files of
         one subject, who can so be checked alone, without a list that names the others
A file is about a subject where its path is <table>/<subject>/<file>; what lies at the top is about the whole release.
"""

import hashlib
import re
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.progress import reporting
from dior.tables.files import write_text

SUMS = "SHA256SUMS"
# beside it, where the lab signs its releases (signature.py); in no list, as it is made of one
SIGNATURE = f"{SUMS}.sig"
FOLDER = "checksums"
NOT_AS_LISTED = f"its SHA-256 is not the one that {SUMS} has, so it is damaged or edited"
# the part of a release that is about nobody alone; no pseudonym may be called so
METADATA = "metadata"
LINE = re.compile(r"([0-9a-f]{64})  (.+)")
# bytes read at once; chosen: large enough that hashing and not the calls takes the time
BLOCK = 1 << 20
# files at once; chosen: as many as the rules of the release have threads
THREADS = 2


def of_whom(name: str) -> str:
    """The subject that a file of a release is about, or `METADATA`."""
    parts = name.split("/")
    return parts[1] if len(parts) == 3 else METADATA


def list_of(part: str) -> str:
    """Where the checksums of a part of the release are: those of a subject, or those of everything."""
    return SUMS if part == METADATA else f"{FOLDER}/{part}/{SUMS}"


def write(folder: AnyPath) -> None:
    """Write the checksums of all files in `folder`, a release that is being built."""
    folder = Path(folder)
    found = of_folder(folder)
    for subject in sorted(set(map(of_whom, found)) - {METADATA}):
        own = list_of(subject)
        write_text(folder / own, text({name: d for name, d in found.items() if of_whom(name) == subject}))
        found[own] = hashlib.sha256((folder / own).read_bytes()).hexdigest()
    write_text(folder / SUMS, text(found))


def of_folder(folder: Path) -> dict[str, str]:
    """Hex SHA-256 by path of all files in a folder, which are hashed two at a time."""
    return _of_files(
        folder, sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    )


def check(folder: Path, parts: Collection[str]) -> None:
    """Raise DiorError unless a release's files, at its top and in its folders `parts`, are those it was built with."""
    listed = {name: found for name, found in read(folder).items() if "/" not in name or name.split("/")[0] in parts}
    for name in listed:
        if not (folder / name).is_file():
            raise DiorError(f"{folder / name}: listed in {SUMS} but gone; build the release again")
    for name, found in _of_files(folder, sorted(listed)).items():
        if found != listed[name]:
            raise DiorError(f"{folder / name}: {NOT_AS_LISTED}: delete the release's folder and build it again")


def expect(folder: Path, names: Collection[str], listed: dict[str, str]) -> None:
    """Raise DiorError unless files of a release that are to be read are those that `listed` has the digests of."""
    for name in names:
        try:
            found = digest(open(folder / name, "rb"))
        except OSError as error:
            raise DiorError(f"{folder / name}: cannot be read ({error.strerror}); `dior verify {folder}`") from None
        if found != listed.get(name):
            raise DiorError(f"{folder / name}: {NOT_AS_LISTED}; `dior verify {folder}` says what else is")


def _of_files(folder: Path, names: list[str]) -> dict[str, str]:
    with ThreadPoolExecutor(THREADS) as pool:
        every = pool.map(lambda name: digest(open(folder / name, "rb")), names)
        return dict(zip(names, reporting(every, len(names), "files hashed", folder.name), strict=True))


def digest(stream: BinaryIO) -> str:
    """Hex SHA-256 of what is left in a stream, which is closed."""
    with stream:
        found = hashlib.sha256()
        while block := stream.read(BLOCK):
            found.update(block)
    return found.hexdigest()


def text(found: dict[str, str]) -> str:
    """Lines as `sha256sum` writes them, by path."""
    return "".join(f"{found[name]}  {name}\n" for name in sorted(found))


def read(folder: AnyPath, part: str = METADATA) -> dict[str, str]:
    """Hex SHA-256 by name, as the list of a part of a release says. DiorError for one that is gone or malformed."""
    folder = Path(folder)
    path = folder / list_of(part)
    if not folder.exists():
        raise DiorError(f"{folder}: there is no such folder; build the release first")
    if not folder.is_dir():
        raise DiorError(f"{folder}: is a file, not the folder of a release; tarballs are to be unpacked first")
    if not path.is_file():
        raise DiorError(f"{path}: there is no such file, so this is no whole release; build it again")
    found, problems = parsed(path.read_bytes())
    if problems:
        raise DiorError(f"{path}: {problems[0]}; build the release again")
    return found


def parsed(content: bytes) -> tuple[dict[str, str], list[str]]:
    """(hex SHA-256 by name, what is wrong with the list as sentences) of the bytes of a list of checksums."""
    found: dict[str, str] = {}
    problems = []
    lines = content.decode("utf-8", "replace").split("\n")
    if lines.pop():
        problems.append("the last line does not end, so that the file is cut off")
    for number, line in enumerate(lines, start=1):
        match = LINE.fullmatch(line)
        if not match:
            problems.append(f"line {number} is not '<SHA-256>  <path>'")
        elif not is_safe(match[2]):
            problems.append(f"line {number}: '{match[2]}' is not a path inside the release")
        elif match[2] in found:
            problems.append(f"line {number}: '{match[2]}' is listed twice")
        else:
            found[match[2]] = match[1]
    return found, problems


def is_safe(name: str) -> bool:
    """Whether a path stays in the folder that it is relative to, and is written in the one plain way."""
    path = PurePosixPath(name)
    return name not in ("", ".") and str(path) == name and not path.is_absolute() and ".." not in path.parts
