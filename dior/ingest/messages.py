"""What is in a sensor_msgs Image, CompressedImage or CameraInfo, as ROS 1 or ROS 2 (CDR) writes them.

INPUTS   a message's bytes, its type and its wire ("ros1" or "cdr"); or, of wire `PICTURE`, what has its fields:
         pictures of videos (type Image, with `picture` and `content()` besides) and of folders (CompressedImage).
OUTPUTS  header stamp (int64 ns since the Unix epoch, 0 where the driver set none), picture size (px), BGR picture,
         CameraInfo.
rosbags' type store decodes. ValueError means that it is no picture that is read; `Damaged`, that this one message's
bytes are at fault.
"""

import zlib
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dior.formats import MessageFormat
from dior.ingest import jpeg

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

COMPRESSED, RAW, CAMERA_INFO = (f"sensor_msgs/msg/{kind}" for kind in ("CompressedImage", "Image", "CameraInfo"))
# common_interfaces, which has not changed since ROS 1 but for a header's `seq` and the spelling of D, K, R, P. Written
# out, because the type stores that rosbags brings take 0.16 s of every step that opens a bag, these 0.01 s.
DEFINITIONS = {
    COMPRESSED: "std_msgs/Header header\nstring format\nuint8[] data\n",
    RAW: (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data\n"
    ),
    CAMERA_INFO: (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
    ),
    "sensor_msgs/msg/RegionOfInterest": (
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
    ),
}
# What librealsense puts behind an Image since it writes "1" for the header's frame_id: the unit of a depth picture
# (third-party/realsense-file/rosbag/msgs/sensor_msgs/Image.h). The definition in the bag does not say so.
DEPTH_UNIT_BYTES = 4
VERSION_WITH_DEPTH_UNIT = "1"
# of image_transport's plugins whose pictures are those of a video, which `packets` decodes
PACKET, THEORA = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket", "theora_image_transport/msg/Packet"
# what a camera's topic may be of
PICTURES = (COMPRESSED, RAW, PACKET, THEORA)
# not as it is in the other's messages
OF_PACKET = {
    "ros1": (
        "std_msgs/Header header\nuint8[] data\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\n"
    ),
    "cdr": (
        "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\n"
        "bool is_bigendian\nuint8[] data\n"
    ),
}
OF_THEORA = "std_msgs/Header header\nuint8[] data\nint32 b_o_s\nint32 e_o_s\nint64 granulepos\nint64 packetno\n"
# the wire of what is no message: `raw` has its fields
PICTURE = "picture"
HEADER = {"ros1": "uint32 seq\ntime stamp\nstring frame_id\n", "cdr": "time stamp\nstring frame_id\n"}
# bytes per pixel; all are of 8-bit samples, which is_bigendian does not concern. 8UC1 and YUYV are librealsense's words
# (src/media/ros/ros_file_format.h) for mono8 and yuyv; yuv422 is UYVY, as uyvy (sensor_msgs/image_encodings.hpp).
ENCODINGS = {
    **dict.fromkeys(("rgb8", "bgr8"), 3),
    **dict.fromkeys(("rgba8", "bgra8"), 4),
    **dict.fromkeys(("mono8", "8UC1"), 1),
    **dict.fromkeys(("yuv422_yuy2", "yuyv", "YUYV", "yuv422", "uyvy"), 2),
}
# compressed_depth_image_transport's word in `format`
DEPTH = "compressedDepth"
PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
# 8192 x 8192: no video camera gives more, and a damaged size is not decoded into gigabytes
MOST_PIXELS = 1 << 26
DESCRIPTIONS = (
    MessageFormat(
        key="sensor_msgs/CompressedImage",
        what="pictures in files",
        read="JPEG and PNG; EXIF's orientation is ignored",
        refused="`compressedDepth`, and other formats. One that is empty or cut off is a lost picture",
    ),
    MessageFormat(
        key="sensor_msgs/Image",
        what="pictures in pixels",
        read="`rgb8`, `bgr8`, `rgba8`, `bgra8`, `mono8` (`8UC1`), `yuyv` (`yuv422_yuy2`, `YUYV`), `uyvy` "
        "(`yuv422`), padded rows too",
        refused="other encodings, by their names. One with fewer bytes than its rows need is a lost picture",
    ),
    MessageFormat(
        key="ffmpeg_image_transport_msgs/FFMPEGPacket",
        what="pictures as a video",
        read="H.264, HEVC, AV1, VP8, VP9, MJPEG; of ROS 1 and ROS 2, by PyAV (the extra `video`). Packets before the "
        "first key frame, and from a lost, damaged or overtaken one to the next key frame, give no picture",
        refused="other encoders, by their names; a sensor's colour filter (bayer)",
    ),
    MessageFormat(
        key="theora_image_transport/Packet",
        what="pictures as a video",
        read="Theora; of ROS 1 and ROS 2, by PyAV, as the other one",
        refused="a recording without the three headers, which ROS 2 sends before the first picture alone and ROS 1 to "
        "every recorder",
    ),
    MessageFormat(
        key="sensor_msgs/CameraInfo",
        what="the lens",
        read="ROS 1 (`D`, `K`) and ROS 2 (`d`, `k`), once or with every picture, `plumb_bob` and "
        "`rational_polynomial`. Beside `a/image_raw` and `a/image_raw/compressed` it is "
        "`a/camera_info`, beside `a/image/data` `a/info/camera_info`, and else what `camera_info:` in "
        "the camera's YAML names. Of rectified pictures (`image_rect*`) it is P, without distortion. "
        "Region of interest and binning are applied to K",
        refused="one that does not stay the same in all bags of the sequence; a region of interest and "
        "binning that contradict the sizes",
    ),
)


class Damaged(ValueError):
    """A picture whose own bytes are empty, cut off or contradict each other, in a message that is whole."""


@dataclass(frozen=True)
class Stamp:
    """The stamp of a driver that sets none."""

    sec: int = 0
    nanosec: int = 0


@dataclass(frozen=True)
class Header:
    """The header of what is no message."""

    stamp: Stamp = Stamp()


@cache
def _store(wire: str) -> "Typestore":
    """The types of DEFINITIONS. Raises ValueError for an encoding that is neither ROS 1 nor CDR."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if wire not in HEADER:
        raise ValueError(f"its encoding is '{wire}', not cdr or ros1")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(HEADER[wire], "std_msgs/msg/Header"))
    for kind, definition in {**DEFINITIONS, PACKET: OF_PACKET[wire], THEORA: OF_THEORA}.items():
        store.register(get_types_from_msg(definition, kind))
    return store


def decoded(kind: str, raw: Any, wire: str) -> Any:
    """A message of one of DEFINITIONS, a PACKET or of THEORA, its fields as ROS 2 spells them. Raises ValueError."""
    if wire == PICTURE:
        return raw
    from rosbags.serde import SerdeError

    store = _store(wire)
    try:
        # a view, because rosbags cuts the head of CDR off by copying the rest
        return (store.deserialize_ros1 if wire == "ros1" else store.deserialize_cdr)(memoryview(raw), kind)
    except (SerdeError, IndexError) as error:
        reason = str(error).split("\n")[0]
    if kind == RAW and wire == "ros1":
        with suppress(SerdeError, IndexError):
            message: Any = store.deserialize_ros1(memoryview(raw)[:-DEPTH_UNIT_BYTES], kind)
            if message.header.frame_id == VERSION_WITH_DEPTH_UNIT:
                return message
    raise ValueError(reason)


def picture_of(kind: str, raw: Any, wire: str) -> tuple[int, int, int]:
    """(header stamp in ns, height, width) of an image message, whose bytes are all there. The size is one of a picture.
    Raises ValueError."""
    message = _image(kind, raw, wire)
    taken_ns, size = stamp_ns(message), _size(message, kind, wire)
    if kind == COMPRESSED:
        _check_whole(memoryview(message.data))
    return taken_ns, *size


def told(kind: str, raw: Any, wire: str) -> tuple[int | None, tuple[int, int] | None, str]:
    """(header stamp in ns, (height, width) px, why it is no picture that is read) of any message; None for a stamp or a
    size that it does not have, or that cannot be told: of a packet of Theora only the video's head says it."""
    try:
        if kind in (PACKET, THEORA):
            message = decoded(kind, raw, wire)
            return stamp_ns(message), (message.height, message.width) if kind == PACKET else None, ""
        taken_ns, *size = picture_of(kind, raw, wire)
        return taken_ns, (size[0], size[1]), ""
    except ValueError as error:
        why = str(error)
    if kind not in (COMPRESSED, RAW, CAMERA_INFO):
        return None, None, why
    try:
        # a depth picture, which `picture_of` refuses, or a lens
        message = decoded(kind, raw, wire)
        return stamp_ns(message), None if kind == COMPRESSED else (message.height, message.width), why
    except ValueError:
        return None, None, why


def decode(kind: str, raw: Any, wire: str, size: tuple[int, int]) -> NDArray[np.uint8]:
    """BGR picture (height, width, 3) of an image message of a known `size` (height, width) px. Raises ValueError."""
    message = _image(kind, raw, wire)
    # asked first, so that OpenCV never sees a damaged size
    _check_size(message, kind, wire, size)
    if kind == RAW:
        return message.picture if wire == PICTURE else _raw_pixels(message)
    picture = _decompressed(message.data)
    if picture is None or picture.shape[:2] != tuple(size):
        raise ValueError("its JPEG or PNG data are damaged")
    return picture


def _check_size(message: Any, kind: str, wire: str, size: tuple[int, int]) -> None:
    stamp_ns(message)
    said = _size(message, kind, wire)
    if said != tuple(size):
        raise ValueError(f"it is {said[1]}x{said[0]} px where its index says {size[1]}x{size[0]}")


def size_of_file(data: bytes) -> tuple[int, int]:
    """(height, width) px of a JPEG or PNG file that OpenCV decodes to that size. Raises ValueError."""
    # asked first, as in `decode`
    size = checked_size(*_compressed_size(memoryview(data)))
    picture = _decompressed(np.frombuffer(data, np.uint8))
    if picture is None or picture.shape[:2] != size:
        raise ValueError("its JPEG or PNG data are damaged")
    return size


def compressed(kind: str, raw: Any, wire: str) -> bytes | None:
    """The JPEG or PNG file in an image message, or None where its pixels are raw. Raises ValueError."""
    return None if kind == RAW else _image(kind, raw, wire).data.tobytes()


def small_jpeg(kind: str, raw: Any, wire: str, size: tuple[int, int], factor: int) -> NDArray[np.uint8] | None:
    """As `decode`, `factor` (2, 4 or 8) times smaller, its size rounded up, of an image message that holds a JPEG; None
    for any other. Takes two thirds of the time. Raises ValueError."""
    message = _image(kind, raw, wire)
    if kind == RAW or bytes(message.data[:2]) != jpeg.SOI:
        return None
    import cv2

    _check_size(message, kind, wire, size)
    picture = _decompressed(message.data, getattr(cv2, f"IMREAD_REDUCED_COLOR_{factor}"))
    if picture is None or picture.shape[:2] != tuple(-(-side // factor) for side in size):
        raise ValueError("its JPEG or PNG data are damaged")
    return picture


def camera_info(raw: bytes, wire: str) -> dict[str, Any]:
    """What `bags.CameraInfo` holds of a CameraInfo, by its names. Raises ValueError."""
    message = decoded(CAMERA_INFO, raw, wire)
    roi = message.roi
    return {
        "width": message.width,
        "height": message.height,
        "model": message.distortion_model,
        **{key.upper(): tuple(getattr(message, key).tolist()) for key in "dkrp"},
        "binning": (message.binning_x, message.binning_y),
        "roi": (roi.x_offset, roi.y_offset, roi.width, roi.height),
    }


def content(kind: str, raw: Any, wire: str) -> tuple[Any, ...]:
    """What an image message says but its header, to see whether two say the same. Raises ValueError."""
    message = _image(kind, raw, wire)
    if wire == PICTURE and kind == RAW:
        return tuple(message.content())
    keys = ("format",) if kind == COMPRESSED else ("height", "width", "encoding", "is_bigendian", "step")
    return *(getattr(message, key) for key in keys), message.data.tobytes()


def _image(kind: str, raw: Any, wire: str) -> Any:
    if kind not in (COMPRESSED, RAW):
        raise ValueError(f"its type is {kind}, not {COMPRESSED} or {RAW}")
    message = decoded(kind, raw, wire)
    if kind == COMPRESSED and DEPTH in message.format:
        raise ValueError(f"it is a depth picture ({DEPTH}), in which nobody can be marked; name the topic in colour")
    return message


def stamp_ns(message: Any) -> int:
    """The header stamp of a message, ns since the Unix epoch. Raises ValueError for one that cannot be."""
    stamp = message.header.stamp
    if stamp.sec < 0 or stamp.nanosec >= 10**9:
        raise ValueError(f"its header stamp has {stamp.sec} seconds and {stamp.nanosec} nanoseconds")
    return stamp.sec * 10**9 + stamp.nanosec


def _size(message: Any, kind: str, wire: str) -> tuple[int, int]:
    if kind == RAW:
        if wire != PICTURE:
            _check_layout(message)
        height, width = message.height, message.width
    else:
        height, width = _compressed_size(memoryview(message.data), message.format)
    return checked_size(height, width)


def checked_size(height: int, width: int) -> tuple[int, int]:
    """A size that a picture may have, as it is. Raises Damaged for another."""
    if not 0 < height * width <= MOST_PIXELS or max(height, width) >= 1 << 16:
        raise Damaged(f"it claims to be {width}x{height} px")
    return height, width


def _compressed_size(data: memoryview, said: str = "") -> tuple[int, int]:
    """(height, width) px of a JPEG or PNG file; `said`: its message's word for the format. Raises ValueError."""
    if len(data) < len(jpeg.SOI):
        raise Damaged("it is empty")
    if data[:8] == PNG_MAGIC[: len(data)]:
        if len(data) < 24:
            raise Damaged("its PNG data are cut off")
        return int.from_bytes(data[20:24], "big"), int.from_bytes(data[16:20], "big")
    if data[:2] != jpeg.SOI:
        raise ValueError("neither JPEG nor PNG" + (f", its format is '{said:.40}'" if said else ""))
    try:
        return jpeg.frame_size(data)
    except ValueError as error:
        raise Damaged(str(error)) from None


def _check_whole(data: memoryview) -> None:
    """Raise Damaged for a JPEG or PNG file that is cut off, and for a PNG file with a wrong byte: OpenCV gives no
    picture of these."""
    if data[:2] == jpeg.SOI:
        try:
            return jpeg.check_whole(data)
        except ValueError as error:
            raise Damaged(str(error)) from None
    at, kind = len(PNG_MAGIC), b""
    while kind != b"IEND":
        # length, kind, content and checksum of a chunk (the PNG specification, 5.3)
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        if end + 4 > len(data):
            raise Damaged("its PNG data are cut off")
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            raise Damaged("its PNG data are damaged")
        at, kind = end + 4, bytes(data[at + 4 : at + 8])


def _check_layout(message: Any) -> None:
    """Whether the pixels of an Image are where its numbers say."""
    width, step, encoding = message.width, message.step, message.encoding
    if encoding not in ENCODINGS:
        raise ValueError(f"encoding '{encoding}' is not one of {', '.join(ENCODINGS)}")
    if step < width * ENCODINGS[encoding] or len(message.data) < message.height * step:
        raise Damaged(
            f"{len(message.data)} bytes in rows of {step} are too few for {width}x{message.height} px of {encoding}"
        )
    if ENCODINGS[encoding] == 2 and width % 2:
        raise ValueError(f"{encoding} cannot be {width} px wide: its pixels come in pairs")


def _decompressed(data: NDArray[np.uint8], how: int = 1) -> NDArray[Any] | None:
    """BGR picture of JPEG or PNG bytes (N,), None where OpenCV finds none. `how`: IMREAD_COLOR or a reduced one."""
    import cv2

    try:
        # a turned picture would not fit the intrinsics: EXIF's orientation is for people
        return cv2.imdecode(data, how | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        return None


def _raw_pixels(message: Any) -> NDArray[Any]:
    """BGR picture of an Image whose layout is right."""
    depth, (height, width, step) = ENCODINGS[message.encoding], (message.height, message.width, message.step)
    rows = message.data[: height * step].reshape(height, step)
    picture = rows[:, : width * depth].reshape(height, width, depth)
    if message.encoding == "bgr8":
        return picture.copy()
    if message.encoding == "rgb8":
        return np.ascontiguousarray(picture[..., ::-1])
    if depth == 1:
        return np.repeat(picture, 3, axis=2)
    if message.encoding in ("rgba8", "bgra8"):
        return np.ascontiguousarray(picture[..., 2::-1] if message.encoding == "rgba8" else picture[..., :3])
    import cv2

    uyvy = message.encoding in ("yuv422", "uyvy")
    return cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_YUV2BGR_UYVY if uyvy else cv2.COLOR_YUV2BGR_YUY2)
