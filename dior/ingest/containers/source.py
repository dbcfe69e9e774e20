"""Bytes that can be read anywhere: of a file, of a part of it, of a compressed chunk as far as somebody asks.

INPUTS   a path, or the bytes of an lz4 frame, a bz2 stream, a zstd frame.
OUTPUTS  a `Source`. No size that a file claims is allocated before there are bytes to fill it: damaged bytes raise
         ValueError, and a read beyond the end does, too.
"""

import os
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass

HEAD = 4096
FIRST_PIECE = 1 << 22
PIECE = 1 << 20
DESCRIPTION_LIMIT, MESSAGE_LIMIT, CHUNK_LIMIT = 1 << 24, 1 << 28, 1 << 30
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
ZSTD_BLOCK = (1 << 17) + 64

# after a free of this size glibc keeps the buffers of chunks for the next ones: else their page faults cost as much as
# unpacking lz4
bytearray(1 << 24)


@dataclass(frozen=True)
class Source:
    """`read(at, count)` gives exactly `count` bytes from byte `at`, or raises ValueError; `size` is where it ends."""

    read: Callable
    size: int


@dataclass(frozen=True)
class Message:
    """One message of a bag, its bytes not read yet. `wire` is "ros1" or "cdr".

    `topic` is its full name, `kind` as in `sensor_msgs/msg/Image`. `fetch(count)` gives its first bytes, fewer only
    where it ends; `fetch(None)` all. Both raise ValueError.
    """

    topic: str
    kind: str
    wire: str
    receive_ns: int
    fetch: Callable


def full_name(topic):
    """A topic's name with one leading slash: ROS resolves `cam01/image_raw` and `/cam01/image_raw` to the same."""
    return "/" + "/".join(word for word in topic.split("/") if word)


def full_kind(kind):
    """A message type in ROS 2's spelling: sensor_msgs/Image is sensor_msgs/msg/Image."""
    package, slash, name = kind.partition("/")
    return f"{package}/msg/{name.rpartition('/')[2]}" if slash else kind


@contextmanager
def opened(path):
    """A `Source` of a file. It reads by position instead of mapping: a file cut meanwhile is an error, not SIGBUS."""
    with open(path, "rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size

        def read(at, count):
            _check_inside(at, count, size)
            data = os.pread(file.fileno(), count, at)
            while 0 < len(data) < count:
                more = os.pread(file.fileno(), count - len(data), at + len(data))
                data = data + more if more else b""
            if len(data) != count:
                raise ValueError(f"it was cut while it was read, at byte {at}")
            return data

        yield Source(read, size)


def part(source, at, size):
    """A `Source` of `size` bytes of another one, from byte `at`."""
    _check_inside(at, size, source.size)

    def read(start, count):
        _check_inside(start, count, size)
        return source.read(at + start, count)

    return Source(read, size)


def description(source, at, size):
    """The bytes of a record that says what is in a bag: damage claims to be larger than one ever is."""
    if size > DESCRIPTION_LIMIT:
        raise ValueError(f"the record at byte {at} claims {size} bytes")
    return source.read(at, size)


def first(read, at, size, count):
    """The first `count` bytes, or all with None, of a message of `size` bytes that `read(at, count)` gives."""
    if count is None and size > MESSAGE_LIMIT:
        raise ValueError(f"a message of {size} bytes is no picture")
    return read(at, size if count is None else min(count, size))


def expanded(source, compression, size):
    """A `Source` of the `size` bytes that the whole of `source` expands to, unpacked only as far as it is read.

    `compression` is "none" or "", "lz4", "bz2" or "zstd".
    """
    if compression in ("none", ""):
        return source
    if max(source.size, size) > CHUNK_LIMIT:
        raise ValueError(f"a chunk claims {max(source.size, size)} bytes")
    inflate, done, begun = _decompressor(compression), b"", False

    def read(at, count):
        nonlocal done, begun
        _check_inside(at, count, size)
        while len(done) < at + count:
            # an ordinary chunk at once, a large one by doubling: neither trusts `size` with memory
            most = min(size, FIRST_PIECE + 2 * len(done)) - len(done)
            piece, begun = inflate(b"" if begun else source.read(0, source.size), most), True
            if not piece:
                raise ValueError(f"a chunk holds {len(done)} bytes where its header says {size}")
            done = done + piece if done else piece
        return done[at : at + count]

    return Source(read, size)


def plain(fetch, count):
    """What `fetch(count)` gives, unpacked where a ROS 2 message is compressed by itself; CDR never begins like zstd."""
    head = fetch(None if count is None else max(count, len(ZSTD_MAGIC)))
    if not head.startswith(ZSTD_MAGIC):
        return head if count is None else head[:count]
    return unzstd(head if count is None else fetch(ZSTD_BLOCK + count), count)


def unzstd(data, count):
    """The first `count` bytes, or all with None, of what the zstd frame `data` holds."""
    inflate, pieces, total, step = _decompressor("zstd"), [], 0, PIECE
    while count is None or total < count:
        piece = inflate(b"" if pieces else data, step if count is None else min(step, count - total))
        if not piece:
            break
        pieces.append(piece)
        total, step = total + len(piece), max(PIECE, total)
        if total > MESSAGE_LIMIT:
            raise ValueError(f"a message expands to more than {MESSAGE_LIMIT >> 20} MB")
    return b"".join(pieces)


def _decompressor(compression):
    """A function (data, most bytes) -> bytes, to be called again with b"" for more; b"" at the end. ValueError."""
    try:
        make, broken = _codecs()[compression]
    except KeyError:
        raise ValueError(f"its compression '{compression}' is not one of none, lz4, bz2, zstd") from None
    codec = make()

    def inflate(data, most):
        if codec.eof:
            return b""
        try:
            return codec.decompress(data, most)
        except broken as error:
            raise ValueError(f"its {compression} data are damaged: {error}") from None

    return inflate


def _codecs():
    import bz2

    import lz4.frame
    from backports import zstd

    return {
        "bz2": (bz2.BZ2Decompressor, (OSError, EOFError)),
        "lz4": (lz4.frame.LZ4FrameDecompressor, (RuntimeError, EOFError)),
        "zstd": (zstd.ZstdDecompressor, (zstd.ZstdError, EOFError)),
    }


def _check_inside(at, count, size):
    if at < 0 or count < 0 or at + count > size:
        raise ValueError(f"it ends at byte {size} where {count} bytes from {at} should be")
