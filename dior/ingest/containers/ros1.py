"""ROS 1 bags, format 2.0: the index records and, through them, the messages.

INPUTS   a `Source` of a .bag file; chunks none, lz4 or bz2.
OUTPUTS  topics and `Message`s in the file's order: a chunk is read once, one without a wanted message never, and of an
         uncompressed one only the bytes that are fetched.
Own code, because rosbags' reader allocates what a damaged length field says and gives whole messages only.
Source: wiki.ros.org/Bags/Format/2.0. ValueError, KeyError or struct.error mean damage.
"""

import struct
from functools import partial

import numpy as np

from dior.ingest.containers.source import Message, description, expanded, first, full_kind, full_name, opened, part

__all__ = ["HINT", "MAGIC", "messages", "opened", "topics"]

MAGIC = b"#ROSBAG V2.0\n"
HINT = "`rosbag reindex`"
GUESS = 128
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7


def topics(source):
    """Topics: list of (topic, message type, number of messages)."""
    connections, chunks = _contents(source)
    total = dict.fromkeys(connections, 0)
    for _, counts in chunks:
        for connection, count in counts:
            total[connection] += count
    return [(*connections[i], count) for i, count in total.items()]


def messages(source, wanted, received=None):
    """Yield the `Message`s of the topics `wanted` (full names), only of the receive stamps `received` if given."""
    connections, chunks = _contents(source)
    mine = {i for i, (topic, _) in connections.items() if topic in wanted}
    for at, counts in sorted(chunks):
        if not mine.intersection(i for i, _ in counts):
            continue
        chunk, entries = _chunk(source, at, len(counts), mine)
        for offset, receive_ns, connection in entries:
            if received is None or receive_ns in received:
                start, size = _message(chunk, offset, receive_ns, connection)
                yield Message(*connections[connection], "ros1", receive_ns, partial(first, chunk.read, start, size))


def _contents(source):
    """Connections by number, (topic, type), and chunks as (position, [(connection, count)])."""
    fields, _, _ = _record(source, len(MAGIC), BAG)
    at = _number(fields, b"index_pos")
    if not at:
        raise ValueError("it has no index")
    connections, chunks = {}, []
    for _ in range(_number(fields, b"conn_count")):
        header, data_at, size = _record(source, at, CONNECTION)
        kind = full_kind(_fields(description(source, data_at, size))[b"type"].decode())
        connections[_number(header, b"conn")] = (full_name(header[b"topic"].decode()), kind)
        at = data_at + size
    for _ in range(_number(fields, b"chunk_count")):
        header, data_at, size = _record(source, at, CHUNK_INFO)
        pairs = np.frombuffer(description(source, data_at, size), "<u4").reshape(-1, 2).tolist()
        for connection, _ in pairs:
            if connection not in connections:
                raise ValueError(f"its index names connection {connection}, which is not there")
        chunks.append((_number(header, b"chunk_pos"), pairs))
        at = data_at + size
    return connections, chunks


def _chunk(source, at, count, mine):
    """A chunk's `Source` and its index: (offset, receive_ns, connection) of the connections `mine`, by offset."""
    fields, data_at, size = _record(source, at, CHUNK)
    data, at = part(source, data_at, size), data_at + size
    parts = []
    for _ in range(count):
        header, data_at, size = _record(source, at, INDEX)
        at, connection = data_at + size, _number(header, b"conn")
        if size != 12 * _number(header, b"count"):
            raise ValueError("an index record has the wrong size")
        if connection in mine:
            seconds, nanoseconds, offset = (
                np.frombuffer(description(source, data_at, size), "<u4").reshape(-1, 3).T.tolist()
            )
            stamps = [s * 10**9 + n for s, n in zip(seconds, nanoseconds, strict=True)]
            parts += zip(offset, stamps, [connection] * len(offset), strict=True)
    return expanded(data, fields[b"compression"].decode(), _number(fields, b"size")), sorted(parts)


def _message(chunk, at, receive_ns, connection):
    """(position, size) of a message's bytes in its chunk; the index must agree with the message's own header."""
    fields, data_at, size = _record(chunk, at, None)
    while fields[b"op"] == bytes([CONNECTION]):
        fields, data_at, size = _record(chunk, data_at + size, None)
    seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
    here = (fields[b"op"][0], _number(fields, b"conn"), seconds * 10**9 + nanoseconds)
    if here != (MESSAGE, connection, receive_ns):
        raise ValueError(f"its index and its messages disagree at byte {at} of a chunk")
    if data_at + size > chunk.size:
        raise ValueError(f"the message at byte {at} of a chunk is cut off")
    return data_at, size


def _record(source, at, op):
    """(header fields, position of the data, size of the data) of the record at byte `at`, of kind `op` if given."""
    guess = source.read(at, min(GUESS, max(source.size - at, 8)))
    (length,) = struct.unpack_from("<I", guess)
    header = guess[4 : 8 + length] if 8 + length <= len(guess) else description(source, at + 4, length + 4)
    fields, (size,) = _fields(header[:length]), struct.unpack_from("<I", header, length)
    if op is not None and fields[b"op"] != bytes([op]):
        raise ValueError(f"there is no record of kind {op} at byte {at}")
    return fields, at + 8 + length, size


def _fields(header):
    fields, at = {}, 0
    while at < len(header):
        (size,) = struct.unpack_from("<I", header, at)
        name, equals, value = header[at + 4 : at + 4 + size].partition(b"=")
        if not equals or at + 4 + size > len(header):
            raise ValueError("a record's header is damaged")
        fields[name] = value
        at += 4 + size
    return fields


def _number(fields, name):
    return int.from_bytes(fields[name], "little")
