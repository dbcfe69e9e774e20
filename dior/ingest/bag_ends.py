"""The first and the last message of each topic in one file of a bag, by the file's index: it is not read through.

INPUTS   a file as of `bag_reader`
OUTPUTS  `Ends` by topic, by receive stamp. What is damaged between the ends is not seen.
An MCAP file that has no index of its messages is read whole. A chunk of bz2 or zstd takes as long as unpacking it.
"""

import struct
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Ints
from dior.ingest.bag_reader import Message, Recording, damage_as_value_error, file_of, opened

UINT32, UINT64 = struct.Struct("<I"), struct.Struct("<Q")
# of a ROS 1 bag's record with what a chunk holds: its kind
CHUNK_INFO = 6
# of an MCAP file's MessageIndex: kind and length, channel and length of the list; then a stamp and an offset each
MESSAGE_INDEX, INDEX_HEAD, INDEX_ENTRY = 0x07, 9 + 2 + 4, 16
# chosen: a day of a ROS 1 bag of ten cameras has less, and a damaged position of it must not read the whole file
LARGEST_INDEX = 1 << 28


@dataclass(frozen=True)
class Ends:
    """Topic by its full name, message type, number of messages, the first and the last one; None where there is
    none."""

    topic: str
    kind: str
    count: int
    first: Message | None
    last: Message | None


def ends(path: Path, container: str) -> list[Ends]:
    """`Ends` of each topic of a file, which is `container` (`bag_reader.Recording`). Raises ValueError."""
    with _at_ends(path) if container == "ros1" else opened(path, container) as recording:
        topics = recording.topics()
        with damage_as_value_error():
            received = _STAMPS[container](recording.reader)
        found: dict[str, tuple[Message, Message]] = {}
        for message in recording.messages({topic for topic, _, _ in topics}, received):
            first, last = found.get(message.topic, (message, message))
            first = message if message.receive_ns < first.receive_ns else first
            last = message if message.receive_ns >= last.receive_ns else last
            found[message.topic] = (first, last)
    counts: dict[tuple[str, str], int] = defaultdict(int)
    for topic, kind, count in topics:
        counts[topic, kind] += count
    return [Ends(topic, kind, count, *found.get(topic, (None, None))) for (topic, kind), count in counts.items()]


@contextmanager
def _at_ends(path: Path) -> Iterator[Recording]:
    """A ROS 1 bag, of whose messages rosbags knows no more than those of each connection's first and last chunk.

    rosbags' own `open` looks up every message.
    """
    from rosbags.rosbag1.reader import Header, Reader, RecordType

    file: Any = file_of(path)
    reader = Reader(file)
    with file.open() as bio:
        reader.bio = bio
        with damage_as_value_error():
            bio.readline()
            header = Header.read(bio, RecordType.BAGHEADER)
            if header.get("encryptor"):
                raise ValueError("it is encrypted")
            if not header.get_uint64("index_pos"):
                raise ValueError("it has no index")
            bio.seek(header.get_uint64("index_pos"))
            # rosbags reads four bytes at a time
            reader.bio = tail = BytesIO(bio.read(LARGEST_INDEX))
            connections = [reader.read_connection() for _ in range(header.get_uint32("conn_count"))]
            chunks = _chunks(tail.getvalue(), tail.tell(), header.get_uint32("chunk_count"))
            reader.bio = bio
            _look_up_ends(reader, connections, *chunks)
        yield Recording(reader, "ros1")


def _chunks(data: bytes, at: int, count: int) -> tuple[Ints, Ints]:
    """What the chunk infos (wiki.ros.org, Bags/Format/2.0) from `at` on say: where each of `count` chunks is (C,), and
    rows (N, 3) of the number of the chunk, a connection, and how many messages of it the chunk has.

    rosbags takes ten times as long, which is most of a glance. Raises ValueError, struct.error and KeyError.
    """
    positions, pairs = [], []
    places: dict[bytes, int] = {}
    for _ in range(count):
        (size,) = UINT32.unpack_from(data, at)
        header = data[at + 4 : at + 4 + size]
        # nearly all records have their fields at the same places
        if not places or any(header[place - len(name) : place] != name for name, place in places.items()):
            places = _places(header)
        if header[places[b"op="]] != CHUNK_INFO:
            raise ValueError("its index has something else where a chunk's should be")
        positions.append(UINT64.unpack_from(header, places[b"chunk_pos="])[0])
        at += 4 + size
        (size,) = UINT32.unpack_from(data, at)
        pairs.append(np.frombuffer(data, "<u4", size // 4, at + 4))
        at += 4 + size
    of_chunk = np.repeat(np.arange(count), [len(one) // 2 for one in pairs])
    whole = np.concatenate([np.zeros(0, np.int64), *pairs]).reshape(-1, 2)
    return np.array(positions, np.int64), np.column_stack([of_chunk, whole]).astype(np.int64)


def _places(header: bytes) -> dict[bytes, int]:
    """Where in the header of a record the values of its fields begin, by the field's name and `=`."""
    found, at = {}, 0
    while at < len(header):
        (size,) = UINT32.unpack_from(header, at)
        name, _, _ = header[at + 4 : at + 4 + size].partition(b"=")
        found[name + b"="] = at + 4 + len(name) + 1
        at += 4 + size
    return found


def _look_up_ends(reader: Any, connections: list[Any], positions: Ints, counts: Ints) -> None:
    """Tell rosbags of the messages of each connection's first and last chunk. `positions`, `counts`: of `_chunks`."""
    indexes: dict[int, list[Any]] = defaultdict(list)
    for connection in connections:
        mine = counts[(counts[:, 1] == connection.id) & (counts[:, 2] > 0)]
        reader.connections.append(connection._replace(msgcount=int(mine[:, 2].sum())))
        for chunk in {*mine[:1, 0].tolist(), *mine[-1:, 0].tolist()}:
            at = int(positions[chunk])
            if at not in reader.chunks:
                reader.bio.seek(at)
                reader.chunks[at] = reader.read_chunk()
                for _ in range(int((counts[:, 0] == chunk).sum())):
                    reader.read_index_data(at, indexes)
    reader.indexes = {connection.id: sorted(indexes[connection.id]) for connection in connections}


def _of_ros1(reader: Any) -> set[int]:
    """Receive stamps of the first and the last message of each connection."""
    return {entry.time for index in reader.indexes.values() if index for entry in (index[0], index[-1])}


def _of_db3(reader: Any) -> set[int]:
    rows = reader.dbconn.execute("SELECT min(timestamp), max(timestamp) FROM messages GROUP BY topic_id").fetchall()
    return {stamp for row in rows for stamp in row}


def _of_mcap(reader: Any) -> set[int] | None:
    """None: there is no index, so all messages are to be read."""
    if not reader.chunks or not all(chunk.channel_count for chunk in reader.chunks):
        return None
    found: set[int] = set()
    for connection in reader.connections:
        holding = [chunk for chunk in reader.chunks if chunk.channel_count.get(connection.id)]
        for chunk in holding[:1] + holding[-1:]:
            reader.bio.seek(chunk.message_index_offsets[connection.id])
            size = INDEX_HEAD + INDEX_ENTRY * chunk.channel_count[connection.id]
            data = reader.bio.read(size)
            if len(data) != size or data[0] != MESSAGE_INDEX:
                raise ValueError("its index of messages is damaged")
            stamps = [int.from_bytes(data[at : at + 8], "little") for at in range(INDEX_HEAD, size, INDEX_ENTRY)]
            found |= {min(stamps), max(stamps)}
    return found


_STAMPS = {"ros1": _of_ros1, "mcap": _of_mcap, "db3": _of_db3}
