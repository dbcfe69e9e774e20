"""The files that a recorder leaves, whatever their format: what is in them, and their messages.

INPUTS   a bag: a ROS 1 .bag, a ROS 2 .db3 or .mcap file, or the folder with metadata.yaml that `ros2 bag` writes; each
         may be compressed as a whole file (.zstd). A file is known by its first bytes, not by its name.
OUTPUTS  topics by their full name, `source.Message`s in the order of the file.
A file that is compressed as a whole is unpacked once per run of a step, into the temporary folder: it can be read, but
each step pays for it, so `rosbags-convert --src <bag> --dst <new bag>` is worth it. Refusing it would make the lab wait
for a conversion before the first look at its data.
"""

import os
import shutil
import sqlite3
import struct
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from dior.errors import DiorError
from dior.ingest.containers import db3, mcap, ros1
from dior.ingest.containers.source import HEAD, ZSTD_MAGIC, full_name

FORMATS = (ros1, mcap, db3)
BROKEN = (ValueError, LookupError, OSError, EOFError, OverflowError, MemoryError, struct.error, sqlite3.Error)
METADATA = "metadata.yaml"

__all__ = ["BROKEN", "HEAD", "full_name", "messages", "topics"]


def topics(bag):
    """Topics of a bag: dict full name -> (message type, number of messages). Raises DiorError for a broken bag."""
    found = {}
    for path in _files(bag):
        with ExitStack() as files:
            for topic, kind, count in _guarded(files, bag, path, "topics"):
                found[topic] = (kind, found.get(topic, ("", 0))[1] + count)
    return found


def messages(bag, wanted, received=None):
    """Yield the `Message`s of the topics `wanted` (full names), only of the receive stamps `received` if given.

    Raises DiorError for a broken bag; a message's `fetch` raises one of BROKEN. It works until all messages were given.
    """
    with ExitStack() as files:
        for path in _files(bag):
            yield from _guarded(files, bag, path, "messages", wanted, received)


def _damaged(bag, hint, error):
    """The DiorError for a bag whose bytes make no sense."""
    reason = str(error).split("\n")[0] or type(error).__name__
    return DiorError(f"{bag}: the bag is truncated or was not closed ({reason}); try {hint} or copy it again")


def _guarded(files, bag, path, function, *arguments):
    """What `function` of the file's format yields, the file left open in the stack `files`; damage is a DiorError."""
    container = _format(bag, path)
    try:
        yield from getattr(container, function)(files.enter_context(container.opened(path)), *arguments)
    except BROKEN as error:
        raise _damaged(bag, container.HINT, error) from None


def _format(bag, path):
    head = _head(bag, path)
    for container in FORMATS:
        if head.startswith(container.MAGIC):
            return container
    shown = bag if Path(bag).is_file() else path
    if not head:
        raise DiorError(f"{shown}: the bag is empty; copy it again from the recording computer")
    if head.startswith(b"#ROSBAG V1"):
        raise DiorError(f"{shown}: this is a bag of the old format 1; convert it with `rosbag fix`")
    raise DiorError(
        f"{shown}: this is not a bag (it begins with {head[:12]!r}); "
        "bags are ROS 1 .bag files, ROS 2 .db3 or .mcap files, or their folders"
    )


def _head(bag, path):
    try:
        with open(path, "rb") as stream:
            return stream.read(16)
    except OSError as error:
        raise DiorError(f"{bag}: {Path(path).name} cannot be read ({error.strerror})") from None


def _files(bag):
    """The files of a bag, in the order of recording, unpacked where they are compressed as a whole."""
    bag = Path(bag)
    if not bag.exists():
        raise DiorError(f"{bag}: there is no such bag; check `bags` in sequences.tsv and `data_root`")
    files = _listed(bag) if bag.is_dir() else [bag]
    return [_unpacked(bag, path) if _head(bag, path).startswith(ZSTD_MAGIC) else path for path in files]


def _listed(folder):
    """The files that a ROS 2 folder's metadata.yaml names."""
    from dior.project.read import read_yaml

    path = folder / METADATA
    if not path.is_file():
        raise DiorError(
            f"{folder}: there is no {METADATA} in this folder, so the recording was not closed; "
            f"try `ros2 bag reindex {folder.name}`, or give the .db3 or .mcap file itself"
        )
    try:
        content = read_yaml(path, path)
    except BROKEN as error:
        raise DiorError(f"{path}: not readable ({error}); copy the whole folder again") from None
    information = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    names = information.get("relative_file_paths") if isinstance(information, dict) else None
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise DiorError(f"{path}: it names no file of the recording; try `ros2 bag reindex {folder.name}`")
    files = [folder / Path(name).name for name in names]
    for file in files:
        if not file.is_file():
            raise DiorError(f"{path}: it names {file.name}, which is not there; copy the whole folder again")
    return files


def _unpacked(bag, path):
    status = path.stat()
    folder = _unpacked_folder(str(bag), str(path), status.st_mtime_ns, status.st_size)
    return Path(folder.name) / "bag"


@cache
def _unpacked_folder(bag, path, _mtime_ns, _size):
    """A temporary folder, removed when the process ends, with the file `bag` in it."""
    from backports import zstd

    folder = TemporaryDirectory(prefix="dior_")
    try:
        with zstd.open(path, "rb") as packed, open(os.path.join(folder.name, "bag"), "wb") as plain:
            shutil.copyfileobj(packed, plain, 1 << 20)
    except (*BROKEN, zstd.ZstdError) as error:
        folder.cleanup()
        hint = f"`rosbags-convert --src {bag} --dst <new bag>`"
        raise DiorError(
            f"{bag}: {Path(path).name} is compressed as a whole and cannot be unpacked into {folder.name} ({error}); "
            f"set TMPDIR to a larger disk, unpack it with {hint}, or copy it again"
        ) from None
    return folder
