"""What is in the bytes of a sensor_msgs Image, CompressedImage or CameraInfo, as ROS 1 or ROS 2 (CDR) writes them.

INPUTS   a message's bytes, or its first ones where that is enough, its type and its wire ("ros1" or "cdr").
OUTPUTS  header stamp (int64 ns since the Unix epoch, 0 where the driver set none), picture size (px), BGR picture,
         CameraInfo.
The layout is that of common_interfaces, which has not changed since ROS 1; only the fields that are used are read, so
that no message type has to be compiled when a step starts. ValueError, IndexError or struct.error mean damage.
"""

import struct
from dataclasses import dataclass

import numpy as np

COMPRESSED, RAW, CAMERA_INFO = (f"sensor_msgs/msg/{kind}" for kind in ("CompressedImage", "Image", "CameraInfo"))
# bytes per pixel; all are of 8-bit samples, which is_bigendian does not concern
ENCODINGS = {"rgb8": 3, "bgr8": 3, "mono8": 1, "yuv422_yuy2": 2, "yuyv": 2}
SIZES = {"I": 4, "d": 8}
NOT_A_FRAME_SIZE = {0xC4, 0xC8, 0xCC}
# 8192 x 8192: no video camera gives more, and a damaged size is not decoded into gigabytes
MOST_PIXELS = 1 << 26


@dataclass(frozen=True)
class Wire:
    """How numbers lie in a message: byte order, and whether they are aligned, which CDR counts from its 4th byte."""

    order: str
    aligned: bool

    def numbers(self, raw, at, letter, count=1):
        """(`count` numbers of struct's kind `letter`, the position after them)."""
        size = SIZES[letter]
        at = 4 + -(-(at - 4) // size) * size if self.aligned else at
        if count * size > len(raw) - at:
            raise ValueError("the message is cut off")
        return struct.unpack_from(f"{self.order}{count}{letter}", raw, at), at + count * size

    def number(self, raw, at, letter="I"):
        (value,), at = self.numbers(raw, at, letter)
        return value, at

    def text(self, raw, at):
        size, at = self.number(raw, at)
        if size > len(raw) - at:
            raise ValueError("the message is cut off")
        return raw[at : at + size].rstrip(b"\0").decode(), at + size


@dataclass(frozen=True)
class Layout:
    """Where the pixels are in an Image: `step` bytes per row, `size` bytes from byte `at`."""

    height: int
    width: int
    encoding: str
    step: int
    size: int
    at: int


def wire_of(wire, raw):
    """The `Wire` of a message. Raises ValueError for an encoding that is neither ROS 1 nor plain CDR."""
    if wire == "ros1":
        return Wire("<", False)
    if wire != "cdr":
        raise ValueError(f"its encoding is '{wire}', not cdr or ros1")
    if len(raw) < 4 or raw[0] != 0 or raw[1] > 1:
        raise ValueError(f"it does not begin like CDR but with {bytes(raw[:4])!r}")
    return Wire("<" if raw[1] else ">", True)


def header(raw, wire):
    """(header stamp in ns, position after the header). ROS 1's seq and CDR's own header are 4 bytes alike."""
    (seconds, nanoseconds), at = wire.numbers(raw, 4, "I", 2)
    if nanoseconds >= 10**9:
        raise ValueError(f"its header stamp has {nanoseconds} nanoseconds")
    return seconds * 10**9 + nanoseconds, wire.text(raw, at)[1]


def picture_of(kind, raw, wire):
    """(header stamp in ns, height, width) of an image message, from its first bytes. The size is one of a picture."""
    if kind not in (COMPRESSED, RAW):
        raise ValueError(f"its type is {kind}, not {COMPRESSED} or {RAW}")
    wire = wire_of(wire, raw)
    stamp_ns, at = header(raw, wire)
    if kind == RAW:
        layout = _layout(raw, at, wire)
        height, width = layout.height, layout.width
    else:
        height, width = _compressed_size(raw, _data(raw, at, wire)[0])
    if not 0 < height * width <= MOST_PIXELS or max(height, width) >= 1 << 16:
        raise ValueError(f"it claims to be {width}x{height} px")
    return stamp_ns, height, width


def decode(kind, raw, wire, size):
    """BGR uint8 picture (height, width, 3) of an image message of a known `size` (height, width) px."""
    # asked first, so that OpenCV never sees a damaged size
    _, *said = picture_of(kind, raw, wire)
    if tuple(said) != tuple(size):
        raise ValueError(f"it is {said[1]}x{said[0]} px where its index says {size[1]}x{size[0]}")
    wire = wire_of(wire, raw)
    _, at = header(raw, wire)
    if kind == RAW:
        return _raw_pixels(raw, _layout(raw, at, wire))
    picture = _decompressed(_bytes(raw, *_data(raw, at, wire)))
    if picture is None or picture.shape[:2] != tuple(size):
        raise ValueError("its JPEG or PNG data are damaged")
    return picture


def compressed(kind, raw, wire):
    """The JPEG or PNG file in an image message, or None where its pixels are raw."""
    if kind == RAW:
        return None
    wire = wire_of(wire, raw)
    return _bytes(raw, *_data(raw, header(raw, wire)[1], wire)).tobytes()


def _decompressed(data):
    """BGR picture of JPEG or PNG bytes (N,), None where OpenCV finds none."""
    import cv2

    # a turned picture would not fit the intrinsics: EXIF's orientation is for people
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        return cv2.imdecode(data, flags)
    except cv2.error:
        return None


def _raw_pixels(raw, layout):
    """BGR picture of an Image's bytes."""
    depth, (height, width, step) = ENCODINGS[layout.encoding], (layout.height, layout.width, layout.step)
    rows = _bytes(raw, layout.at, layout.size)[: height * step].reshape(height, step)
    picture = rows[:, : width * depth].reshape(height, width, depth)
    if layout.encoding == "bgr8":
        return picture.copy()
    if layout.encoding == "rgb8":
        return np.ascontiguousarray(picture[..., ::-1])
    if layout.encoding == "mono8":
        return np.repeat(picture, 3, axis=2)
    import cv2

    return cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_YUV2BGR_YUY2)


def _bytes(raw, at, size):
    """`size` bytes of a message from byte `at` as an array: what its size field says must be there."""
    if not 0 < size <= len(raw) - at:
        raise ValueError(f"its size field says {size} bytes where {max(len(raw) - at, 0)} are")
    return np.frombuffer(raw, np.uint8, size, at)


def camera_info(raw, wire):
    """(width, height, model, D, K) of a CameraInfo: ROS 1's D and K are ROS 2's d and k at the same place."""
    wire = wire_of(wire, raw)
    _, at = header(raw, wire)
    (height, width), at = wire.numbers(raw, at, "I", 2)
    model, at = wire.text(raw, at)
    count, at = wire.number(raw, at)
    D, at = wire.numbers(raw, at, "d", count) if count else ((), at)
    K, _ = wire.numbers(raw, at, "d", 9)
    return width, height, model, D, K


def after_header(raw, wire):
    """A message's bytes without its header, to see whether two say the same."""
    return raw[header(raw, wire_of(wire, raw))[1] :]


def _data(raw, at, wire):
    """(position, size) of a CompressedImage's data."""
    size, at = wire.number(raw, wire.text(raw, at)[1])
    return at, size


def _layout(raw, at, wire):
    (height, width), at = wire.numbers(raw, at, "I", 2)
    encoding, at = wire.text(raw, at)
    if encoding not in ENCODINGS:
        raise ValueError(f"encoding '{encoding}' is not one of {', '.join(ENCODINGS)}")
    (step, size), at = wire.numbers(raw, at + 1, "I", 2)
    if step < width * ENCODINGS[encoding] or size < height * step:
        raise ValueError(f"{size} bytes in rows of {step} are too few for {width}x{height} px of {encoding}")
    if ENCODINGS[encoding] == 2 and width % 2:
        raise ValueError(f"{encoding} cannot be {width} px wide: its pixels come in pairs")
    return Layout(height, width, encoding, step, size, at)


def _compressed_size(raw, at):
    if raw[at : at + 8] == b"\x89PNG\r\n\x1a\n":
        width, height = struct.unpack_from(">II", raw, at + 16)
        return height, width
    if raw[at : at + 2] != b"\xff\xd8":
        raise ValueError("neither JPEG nor PNG")
    at += 2
    while raw[at] == 0xFF:
        marker = raw[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in NOT_A_FRAME_SIZE:
            return struct.unpack_from(">HH", raw, at + 5)
        at += 1 if marker == 0xFF else 2 + struct.unpack_from(">H", raw, at + 2)[0]
    raise ValueError("the JPEG header is damaged")
