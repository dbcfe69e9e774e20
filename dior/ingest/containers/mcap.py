"""MCAP files, as ROS 2 records them by default and as ROS 1 bags are converted to.

INPUTS   a `Source` of an .mcap file; chunks none, lz4 or zstd, or messages without chunks.
OUTPUTS  topics and `Message`s in the file's order: a chunk outside the wanted receive stamps is skipped, and of an
         uncompressed one only the bytes that are fetched are read.
Own code, because rosbags' reader allocates what a damaged length field says and gives whole messages only.
Source: mcap.dev/spec. ValueError, KeyError or struct.error mean damage.
"""

import struct
from collections import Counter
from functools import partial

from dior.ingest.containers.source import (
    Message,
    description,
    expanded,
    first,
    full_kind,
    full_name,
    opened,
    part,
    plain,
)

__all__ = ["HINT", "MAGIC", "messages", "opened", "topics"]

MAGIC = b"\x89MCAP0\r\n"
HINT = "`mcap recover`"
FOOTER_SIZE = 9 + 20 + len(MAGIC)
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS = 2, 3, 4, 5, 6, 11
MESSAGE_HEADER = 22


def topics(source):
    """Topics: list of (topic, message type, number of messages)."""
    start, end = _bounds(source)
    schemas, channels, counts = {}, {}, None
    for op, at, size in _records(source, start, end) if start else ():
        if op == STATISTICS:
            counts = _statistics(description(source, at, size))
        _declare(source, op, at, size, schemas, channels)
    if counts is None or not set(counts) <= set(channels):
        counts, channels = Counter(), {}
        for number, _, _ in _walk(source, channels, None):
            counts[number] += 1
    return [(topic, kind, counts.get(i, 0)) for i, (topic, kind, _) in channels.items()]


def messages(source, wanted, received=None):
    """Yield the `Message`s of the topics `wanted` (full names), only of the receive stamps `received` if given."""
    channels = {}
    for number, receive_ns, fetch in _walk(source, channels, received):
        topic, kind, wire = channels[number]
        if topic in wanted and (received is None or receive_ns in received):
            yield Message(topic, kind, wire, receive_ns, partial(plain, fetch) if wire == "cdr" else fetch)


def _walk(source, channels, received):
    """Yield (channel, receive_ns, a function that fetches first bytes) of all messages, in the file's order.

    `channels` is filled on the way: number -> (topic, message type, wire).
    """
    schemas = {}
    start, end = _bounds(source)
    for op, at, size in _records(source, start or end, end):
        _declare(source, op, at, size, schemas, channels)
    for op, at, size in _records(source, len(MAGIC), start or end):
        if op == CHUNK:
            chunk = _chunk(source, at, size, received)
            inside = () if chunk is None else _records(chunk, 0, chunk.size)
        else:
            chunk, inside = source, ((op, at, size),)
        for kind, position, length in inside:
            if kind == MESSAGE:
                header = chunk.read(position, MESSAGE_HEADER)
                number, _, receive_ns, _ = struct.unpack("<HIQQ", header)
                data, length = position + MESSAGE_HEADER, length - MESSAGE_HEADER
                if length < 0 or receive_ns >> 63:
                    raise ValueError(f"the message at byte {position} is damaged")
                yield number, receive_ns, partial(first, chunk.read, data, length)
            else:
                _declare(chunk, kind, position, length, schemas, channels)


def _bounds(source):
    """Where the summary begins (0: there is none) and where the footer does."""
    footer = source.read(max(source.size - FOOTER_SIZE, 0), FOOTER_SIZE)
    if footer[-len(MAGIC) :] != MAGIC or footer[:9] != struct.pack("<BQ", FOOTER, 20):
        raise ValueError("it has no end")
    (start,) = struct.unpack_from("<Q", footer, 9)
    if start and not len(MAGIC) <= start <= source.size - FOOTER_SIZE:
        raise ValueError("its summary is not where the footer says")
    return start, source.size - FOOTER_SIZE


def _records(source, at, end):
    """Yield (kind, position of the content, its size) of the records in a range of bytes."""
    while at < end:
        op, size = struct.unpack("<BQ", source.read(at, 9))
        if not op:
            raise ValueError(f"there are zeros at byte {at}")
        if at + 9 + size > end:
            raise ValueError(f"the record at byte {at} is cut off")
        yield op, at + 9, size
        at += 9 + size


def _chunk(source, at, size, received):
    """The `Source` of a chunk's records, or None where no receive stamp of `received` lies in it."""
    data = source.read(at, min(size, 64))
    earliest, latest, expanded_size, _ = struct.unpack_from("<QQQI", data)
    if received is not None and not any(earliest <= stamp <= latest for stamp in received):
        return None
    compression, offset = _text(data, 28)
    (packed,) = struct.unpack_from("<Q", data, offset)
    if offset + 8 + packed > size:
        raise ValueError(f"the chunk at byte {at} is cut off")
    return expanded(part(source, at + offset + 8, packed), compression, expanded_size if compression else packed)


def _declare(source, op, at, size, schemas, channels):
    """Note a schema or a channel."""
    if op == SCHEMA:
        data = description(source, at, size)
        schemas[struct.unpack_from("<H", data)[0]] = _text(data, 2)[0]
    elif op == CHANNEL:
        data = description(source, at, size)
        number, schema = struct.unpack_from("<HH", data)
        topic, after = _text(data, 4)
        channels[number] = (full_name(topic), full_kind(schemas.get(schema, "unknown")), _text(data, after)[0])


def _statistics(data):
    """Number of messages by channel."""
    (size,) = struct.unpack_from("<I", data, 42)
    if 46 + size > len(data):
        raise ValueError("its statistics are cut off")
    return dict(struct.iter_unpack("<HQ", data[46 : 46 + size]))


def _text(data, at):
    (size,) = struct.unpack_from("<I", data, at)
    if at + 4 + size > len(data):
        raise ValueError("a record is cut off")
    return data[at + 4 : at + 4 + size].decode(), at + 4 + size
