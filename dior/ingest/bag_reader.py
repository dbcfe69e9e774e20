"""One file of a bag, read by rosbags: its topics and its messages.

INPUTS   a ROS 1 .bag, a ROS 2 .db3 or .mcap file under any name
OUTPUTS  `Recording`s. ROS 1 and .db3 messages come by receive stamp, .mcap messages in the file's order or, those of
         some stamps, by receive stamp; of one topic and stamp always in the file's order.
Damage is a ValueError: rosbags raises whatever its parsing comes across. Checked here is what rosbags does not check
and a damaged or unfinished file shows (tests/ingest/test_bags_damage.py): how much is read at once, holes of zeros, a
database that is not all there, types within it.
"""

import io
import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import quote

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
# chosen: more than any picture has; what is compressed must not expand without end
MESSAGE_LIMIT = 1 << 28

# of a message without a picture: its topic's full name, header stamp (ns), and why there is none
Lost: TypeAlias = tuple[str, int, str]


@dataclass(frozen=True)
class Message:
    """One message of a bag. `topic` is its full name, `kind` as in `sensor_msgs/msg/Image`; `wire` is ros1 or cdr and
    `raw` its bytes, or as of `messages.PICTURE`."""

    topic: str
    kind: str
    wire: str
    receive_ns: int
    raw: Any


@dataclass(frozen=True, eq=False)
class Recording:
    """An open file: rosbags' reader of it, and whether that is one of "ros1", "mcap" and "db3"."""

    reader: Any
    container: str

    def topics(self) -> list[tuple[str, str, int]]:
        """(full name, message type, number of messages) of each topic. Raises ValueError."""
        return [(topic, kind, connection.msgcount) for connection, topic, kind in self._connections()]

    def messages(self, wanted: Collection[str], received: Collection[int] | None) -> Iterator[Message]:
        """The messages of the topics `wanted` (full names), only of the receive stamps `received` if given.

        Raises ValueError.
        """
        mine = {connection.id: (topic, kind) for connection, topic, kind in self._connections() if topic in wanted}
        if not mine:
            return
        connections = [connection for connection in self.reader.connections if connection.id in mine]
        with damage_as_value_error():
            for connection, receive_ns, raw in SELECTED[self.container](self.reader, connections, received):
                if received is None or receive_ns in received:
                    if not isinstance(receive_ns, int) or not isinstance(raw, bytes):
                        raise ValueError(f"a message of {connection.topic} is damaged")
                    wire = "ros1" if self.container == "ros1" else connection.ext.serialization_format
                    raw = unzstd(raw) if wire == "cdr" and raw.startswith(ZSTD_MAGIC) else raw
                    yield Message(*mine[connection.id], wire, receive_ns, raw)

    def _connections(self) -> list[tuple[Any, str, str]]:
        """(rosbags' connection, full name of the topic, message type) of each topic. Raises ValueError."""
        for connection in self.reader.connections:
            if not isinstance(connection.topic, str) or not isinstance(connection.msgtype, str):
                raise ValueError(f"topic {connection.id} is damaged")
        return [(one, full_name(one.topic), full_kind(one.msgtype)) for one in self.reader.connections]


def full_name(topic: str) -> str:
    """A topic's name with one leading slash: ROS resolves `cam01/image_raw` and `/cam01/image_raw` to the same."""
    return "/" + "/".join(word for word in topic.split("/") if word)


def full_kind(kind: str) -> str:
    """A message type in ROS 2's spelling: sensor_msgs/Image is sensor_msgs/msg/Image."""
    package, slash, name = kind.partition("/")
    return f"{package}/msg/{name.rpartition('/')[2]}" if slash else kind


@contextmanager
def opened(path: Path, container: str) -> Iterator[Recording]:
    """The `Recording` in a file. Raises ValueError."""
    from rosbags import rosbag1, rosbag2

    if container == "db3":
        _check_database(path)
    file: Any = file_of(path)
    with damage_as_value_error():
        if container == "ros1":
            reader: Any = rosbag1.Reader(file)
        elif container == "mcap":
            reader = rosbag2.Reader.STORAGE_PLUGINS[".mcap"](file)
        else:
            # rosbags puts the path into a URI as it is
            reader = rosbag2.Reader.STORAGE_PLUGINS[".db3"](Path(quote(str(path.absolute()))))
        reader.open()
    try:
        yield Recording(reader, container)
    finally:
        reader.close()


@contextmanager
def damage_as_value_error() -> Iterator[None]:
    """Whatever rosbags raises, as a ValueError in one line."""
    try:
        yield
    except ValueError:
        raise
    except (AssertionError, struct.error, TypeError, KeyError, IndexError):
        raise ValueError("its records are cut off or contradict each other") from None
    except Exception as error:
        raise ValueError(str(error).split("\n")[0] or type(error).__name__) from None


def file_of(path: Path) -> "_File":
    """As much of a path as rosbags asks for."""
    return _File(path)


class _File:
    """The path of a file whose reads end where it does: a damaged size is never allocated."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __str__(self) -> str:
        return self._path.name

    def exists(self) -> bool:
        return self._path.exists()

    def open(self, _mode: str = "rb") -> io.BufferedReader:
        return _BoundedReader(io.FileIO(self._path))


class _BoundedReader(io.BufferedReader):
    def __init__(self, file: io.FileIO) -> None:
        super().__init__(file)
        self._end = self.seek(0, io.SEEK_END)
        self.seek(0)

    def read(self, size: int | None = -1) -> bytes:
        left = max(self._end - self.tell(), 0)
        data = super().read(left if size is None or size < 0 else min(size, left))
        # only the kind of an MCAP record is one byte; a hole of zeros would be walked through, nine by nine
        if size == 1 and data == b"\0":
            raise ValueError(f"there are zeros at byte {self.tell() - 1}")
        return data


def _check_database(path: Path) -> None:
    """Raise ValueError where SQLite would read less than was recorded, without a word."""
    journal = Path(f"{path}-wal")
    if journal.is_file() and journal.stat().st_size:
        raise ValueError(f"its last messages are still in {journal.name}")
    with open(path, "rb") as stream:
        page = int.from_bytes(stream.read(18)[16:], "big")
    # SQLite takes a last page that is cut off for one that ends in zeros; a page size of 1 means 65536
    if not page or path.stat().st_size % (65536 if page == 1 else page):
        raise ValueError("its last page is cut off")


def _of_ros1(reader: Any, connections: list[Any], received: Collection[int] | None) -> Iterator[Any]:
    if received is not None:
        # else a chunk without a wanted message would be unpacked, too
        reader.indexes = {i: [one for one in index if one.time in received] for i, index in reader.indexes.items()}
    return reader.messages(connections)


def _of_mcap(reader: Any, connections: list[Any], received: Collection[int] | None) -> Iterator[Any]:
    """By chunk where there is an index of them: without, rosbags' `messages` refuses the file or finds nothing."""
    if received is None or not all(chunk.channel_count for chunk in reader.chunks):
        return reader.messages_scan(connections)
    reader.chunks = [
        chunk
        for chunk in reader.chunks
        if any(chunk.message_start_time <= stamp <= chunk.message_end_time for stamp in received)
    ]
    return reader.messages(connections) if reader.chunks else reader.messages_scan(connections)


def _of_db3(reader: Any, connections: list[Any], received: Collection[int] | None) -> Iterator[Any]:
    if received is None:
        return reader.messages(connections)
    # the database has an index of stamps
    return (one for stamp in sorted(received) for one in reader.messages(connections, stamp, stamp + 1))


SELECTED = {"ros1": _of_ros1, "mcap": _of_mcap, "db3": _of_db3}


def unzstd(raw: bytes) -> bytes:
    """What a ROS 2 message that is compressed by itself holds. Raises ValueError where that is no picture's size."""
    from backports import zstd

    inflate = zstd.ZstdDecompressor()
    try:
        plain = inflate.decompress(raw, MESSAGE_LIMIT)
    except zstd.ZstdError as error:
        raise ValueError(f"its zstd data are damaged: {error}") from None
    if not inflate.eof:
        raise ValueError(f"a message is cut off or expands to more than {MESSAGE_LIMIT >> 20} MB")
    return plain
