"""What is in a file or a folder, told by its length and its two ends, so that one that was replaced is noticed.

INPUTS   recordings and what people wrote: files, or folders of files
OUTPUTS  a short text of each, for the parameters of the rules
Times are not looked at: `mv`, `cp -p`, `rsync -a` and unzip bring a file with the time that it had elsewhere, and to
touch one changes nothing. What was changed in the middle of a long file, its length kept, shows only when all of it is
read (`dior verify --inputs`). Read each time Snakemake plans, so this loads no numerics.
"""

import hashlib
import os
from collections.abc import Iterator
from functools import cache

# bytes at either end of a file; chosen: headers, indices and the first and last pictures are there, and 224 files take
# 22 ms
END = 1 << 16
# files of a folder that are opened, evenly spread; chosen: all of most ROS 2 bags, some of a detector's 3600
OPENED = 16
MISSING, UNREADABLE = "missing", "unreadable"


@cache
def state(path: str) -> str:
    """`<bytes> <hash>` of a file; of a folder the same of the names, lengths and some of the files in it.

    `missing` or `unreadable` where it cannot be told: the step that reads it says what is wrong.
    """
    try:
        return _of_folder(path) if os.path.isdir(path) else _of_file(path)
    except FileNotFoundError:
        return MISSING
    except OSError:
        return UNREADABLE


def _of_file(path: str) -> str:
    with open(path, "rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        found = hashlib.sha256(stream.read(END))
        stream.seek(max(END, size - END))
        found.update(stream.read(END))
    return f"{size} {found.hexdigest()[:16]}"


def _of_folder(folder: str) -> str:
    files = sorted(_files(folder))
    opened = {round(i * (len(files) - 1) / (OPENED - 1)) for i in range(OPENED)} if files else set()
    lines = [
        (name, _of_file(os.path.join(folder, name)) if number in opened else str(size))
        for number, (name, size) in enumerate(files)
    ]
    return f"{sum(size for _, size in files)} {hashlib.sha256(repr(lines).encode()).hexdigest()[:16]}"


def _files(folder: str, below: str = "") -> Iterator[tuple[str, int]]:
    """Path inside `folder` and length of each file in it."""
    for entry in os.scandir(os.path.join(folder, below)):
        name = f"{below}{entry.name}"
        if entry.is_dir():
            yield from _files(folder, f"{name}/")
        elif entry.is_file():
            yield name, entry.stat().st_size
