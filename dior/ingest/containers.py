"""The files that a recorder leaves, whatever their format: what is in them, and their messages.

INPUTS   a bag: a ROS 1 .bag, a ROS 2 .db3 or .mcap file, or the folder with metadata.yaml that `ros2 bag` writes; each
         may be compressed as a whole file (.zstd). Or a video (`videos`), or a folder of pictures (`picture_folders`).
         A file is known by its first bytes, not by its name.
OUTPUTS  topics by their full name, `bag_reader.Message`s, file by file in the order of `bag_reader`.
A file that is compressed as a whole is unpacked once per run of a step, into the temporary folder: it can be read, but
each step pays for it, so `rosbags-convert --src <bag> --dst <new bag>` is worth it. Refusing it would make the lab wait
for a conversion before the first look at its data.
"""

import os
import shutil
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from dior.arrays import AnyPath
from dior.errors import DiorError, many
from dior.formats import BagFormat
from dior.ingest import packets, picture_folders, video_audio, videos
from dior.ingest.bag_reader import ZSTD_MAGIC, Lost, Message, opened
from dior.project.plain_text import GZIP, UNPACK

BROKEN = (ValueError, LookupError, OSError, EOFError, OverflowError, MemoryError)
# first bytes -> the format and what may save a damaged file of it
FORMATS = {
    b"#ROSBAG V2.0\n": ("ros1", "`rosbag reindex`"),
    b"\x89MCAP0\r\n": ("mcap", "`mcap recover`"),
    b"SQLite format 3\0": ("db3", "`ros2 bag reindex`, or `sqlite3 <file> .recover`"),
}
# what is no bag, and who reads it
READERS = {"video": videos, "pictures": picture_folders}
HINTS = {
    "video": "`ffmpeg -i <video> -c copy <new>`, or untrunc where its index is missing,",
    "pictures": "to remove that file",
}
# of an MCAP file, where its header names the profile: magic, kind, size, length of the text
PROFILE_AT = 8 + 1 + 8 + 4
HEAD_BYTES = PROFILE_AT + 4
METADATA = "metadata.yaml"
# how the files end that it names
OF_ROS_2 = (".db3", ".mcap", ".zstd")
COPY = "copy it again from the recording computer"
DESCRIPTIONS = (
    BagFormat(
        key="ros1",
        format="ROS 1 `.bag`, version 2.0",
        storage="chunks",
        compression="none, lz4, bz2",
        note="version 1 is refused: `rosbag fix`",
    ),
    BagFormat(
        key="db3",
        format="ROS 2 `.db3`, or the folder with `metadata.yaml`",
        storage="SQLite",
        compression="none, messages (zstd), whole file (zstd)",
        note="an unfinished recording (`-wal` beside it) is refused: `ros2 bag reindex`",
    ),
    BagFormat(
        key="mcap",
        format="ROS 2 `.mcap`, or the folder with `metadata.yaml`",
        storage="chunks, or messages without chunks and summary",
        compression="none, lz4, zstd, messages (zstd), whole file (zstd)",
        note="of the profile `ros2`, as `ros2 bag` writes it; MCAP that was converted from ROS 1 is "
        "refused: give the `.bag`",
    ),
)
Found = TypeVar("Found")
_unpacked_folders = ExitStack()


def topics(bag: AnyPath) -> dict[str, tuple[str, int]]:
    """Topics of a bag: dict full name -> (message type, number of messages). Raises DiorError for a broken bag."""
    found: dict[str, tuple[str, int]] = {}
    for topic, kind, count in of_files(bag, _topics):
        found[topic] = (kind, found.get(topic, ("", 0))[1] + count)
    return found


def _topics(path: Path, container: str) -> list[tuple[str, str, int]]:
    if container in READERS:
        found: list[tuple[str, str, int]] = READERS[container].topics(path)
        return found
    with opened(path, container) as recording:
        return recording.topics()


def of_files(bag: AnyPath, read: Callable[[Path, str], list[Found]]) -> list[Found]:
    """What `read` finds in all files of a bag, each given as its path and its format: ros1, mcap, db3, video or
    pictures. Raises DiorError for a broken bag."""
    found: list[Found] = []
    for path in _files(bag):
        container, hint = _format(bag, path)
        try:
            found += read(path, container)
        except BROKEN as error:
            raise _damaged(bag, container, hint, error) from None
    return found


def messages(
    bag: AnyPath,
    wanted: Collection[str],
    received: Collection[int] | None = None,
    lost: list[Lost] | None = None,
) -> Iterator[Message]:
    """Yield the `Message`s of the topics `wanted` (full names), only of the receive stamps `received` if given.

    Packets of a video are decoded, from the key frame before; the packets themselves are not given. `lost` is told
    which of them give no picture. Raises DiorError for a broken bag.
    """
    unpacker = packets.Unpacker(bag, received, [] if lost is None else lost)
    for path in _files(bag):
        container, hint = _format(bag, path)
        try:
            if container in READERS:
                yield from READERS[container].recorded(path, wanted, received)
                continue
            with opened(path, container) as recording:
                packed = {topic for topic, kind, _ in recording.topics() if kind in packets.KINDS} & {*wanted}
                _check_one_kind(recording.topics(), packed, path)
                # before the others, which leave the reader with the chunks of `received` alone
                for message in recording.messages(packed, None) if packed else ():
                    yield from unpacker.given(message)
                yield from recording.messages({*wanted} - packed, received)
        except BROKEN as error:
            raise _damaged(bag, container, hint, error) from None
    yield from unpacker.rest()


def _check_one_kind(topics: list[tuple[str, str, int]], packed: Collection[str], path: Path) -> None:
    """Refuse a topic of a video's packets that holds messages of other types, too."""
    for topic in sorted(packed):
        kinds = sorted({kind for name, kind, _ in topics if name == topic})
        if len(kinds) > 1:
            raise DiorError(
                f"{path}: {topic} holds messages of several types ({', '.join(kinds)}), which cannot be told apart; "
                "record each under a topic of its own"
            )


def is_packed(path: AnyPath) -> bool:
    """Whether a file is compressed as a whole. Raises DiorError for one that cannot be read."""
    return _head(path, Path(path)).startswith(ZSTD_MAGIC)


def is_video(path: AnyPath) -> bool:
    """Whether a path is that of a video's file. Raises DiorError for a file that cannot be read."""
    return Path(path).is_file() and videos.is_video(_head(path, Path(path)))


def video_index(path: AnyPath, topic: str) -> videos.VideoIndex:
    """`videos.index`. Raises DiorError for a broken video."""
    try:
        return videos.index(Path(path), topic)
    except BROKEN as error:
        raise _damaged(path, "video", HINTS["video"], error) from None


def heard(path: AnyPath) -> video_audio.Heard | None:
    """What is heard in a video, None of what is none or has no sound. Raises DiorError for a broken one."""
    if not is_video(path):
        return None
    try:
        return video_audio.heard(Path(path))
    except BROKEN as error:
        raise _damaged(path, "video", HINTS["video"], error) from None


def _damaged(bag: AnyPath, container: str, hint: str, error: BaseException) -> DiorError:
    """The DiorError for a bag whose bytes make no sense."""
    reason = str(error).split("\n")[0] or type(error).__name__
    what = "one of the pictures" if container == "pictures" else f"the {container if container == 'video' else 'bag'}"
    return DiorError(f"{bag}: {what} is truncated or was not closed ({reason}); try {hint} or copy it again")


def _format(bag: AnyPath, path: Path) -> tuple[str, str]:
    """(format, what may save a damaged file of it). Raises DiorError for a file of no format that is read."""
    if path.is_dir():
        return "pictures", HINTS["pictures"]
    head = _head(bag, path)
    shown = bag if Path(bag).is_file() else path
    for magic, (container, hint) in FORMATS.items():
        if head.startswith(magic):
            if container == "mcap" and len(head) > PROFILE_AT and head[PROFILE_AT:] != b"ros2":
                raise DiorError(
                    f"{shown}: this MCAP file is not of the profile ros2, which is the one that is read; if it was "
                    "converted from a ROS 1 bag, give that bag"
                )
            return container, hint
    if videos.is_video(head):
        return "video", HINTS["video"]
    if head.startswith(GZIP):
        raise DiorError(f"{shown}: {UNPACK}")
    if not head:
        raise DiorError(f"{shown}: the file is empty; {COPY}")
    if any(magic.startswith(head) for magic in FORMATS):
        raise DiorError(f"{shown}: the bag ends after {many(len(head), 'byte')}; {COPY}")
    if head.startswith(b"#ROSBAG V1"):
        raise DiorError(f"{shown}: this is a bag of the old format 1; convert it with `rosbag fix`")
    short, fix = "", ""
    if len(head) < HEAD_BYTES:
        short, fix = f", and ends after {many(len(head), 'byte')}", f"{COPY}; "
    raise DiorError(
        f"{shown}: this is not a bag (it begins with {head[:12]!r}{short}); {fix}"
        "bags are ROS 1 .bag files, ROS 2 .db3 or .mcap files, or their folders, videos mp4, mov, avi or mkv"
    )


def _head(bag: AnyPath, path: Path) -> bytes:
    try:
        with open(path, "rb") as stream:
            return stream.read(HEAD_BYTES)
    except OSError as error:
        raise DiorError(f"{bag}: {Path(path).name} cannot be read ({error.strerror})") from None


def _files(bag: AnyPath) -> list[Path]:
    """The files of a bag, in the order of recording, unpacked where they are compressed as a whole."""
    bag = Path(bag)
    if not bag.exists():
        raise DiorError(f"{bag}: there is no such bag; check `bags` in sequences.tsv and `data_root`")
    if not (bag.is_file() or bag.is_dir()):
        raise DiorError(f"{bag}: is neither a file nor a folder; check `bags` in sequences.tsv")
    if bag.is_dir() and not (bag / METADATA).exists() and picture_folders.files(bag):
        return [bag]
    files = _listed(bag) if bag.is_dir() else [bag]
    return [_unpacked(bag, path) if _head(bag, path).startswith(ZSTD_MAGIC) else path for path in files]


def _listed(folder: Path) -> list[Path]:
    """The files that a ROS 2 folder's metadata.yaml names."""
    from dior.project.schema_check import read_yaml

    path = folder / METADATA
    if not path.is_file() and not any(one.suffix in OF_ROS_2 for one in folder.iterdir()):
        raise DiorError(
            f"{folder}: this folder holds neither pictures ({', '.join(picture_folders.SUFFIXES)}) nor a ROS 2 bag "
            f"({METADATA} and its files); name another, or {COPY}"
        )
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


def _unpacked(bag: Path, path: Path) -> Path:
    status = path.stat()
    folder = _unpacked_folder(str(bag), str(path), status.st_mtime_ns, status.st_size)
    return Path(folder.name) / "bag"


def remove_unpacked() -> None:
    """Remove what is unpacked; called when the process ends (`dior.cli.main`), which is at once."""
    _unpacked_folders.close()
    _unpacked_folder.cache_clear()


@cache
def _unpacked_folder(bag: str, path: str, _mtime_ns: int, _size: int) -> TemporaryDirectory[str]:
    """A temporary folder, until `remove_unpacked`, with the file `bag` in it."""
    from backports import zstd

    folder = TemporaryDirectory(prefix="dior_", ignore_cleanup_errors=True)
    _unpacked_folders.callback(folder.cleanup)
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
