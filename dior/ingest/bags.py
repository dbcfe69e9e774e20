"""ROS 1 bags: what is in them, an index of their pictures, the pictures, and the CameraInfo beside them.

INPUTS   .bag files with sensor_msgs/CompressedImage (JPEG or PNG) or sensor_msgs/Image (rgb8, bgr8, mono8) and
         sensor_msgs/CameraInfo.
OUTPUTS  arrays in memory; the pixels stay in the bags.
Stamps are int64 ns since the Unix epoch: `stamp_ns` from the message header, `receive_ns` from the bag's index.
"""

import struct
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.errors import DiorError, nearest

MAGIC = b"#ROSBAG V"
COMPRESSED, RAW, CAMERA_INFO = (f"sensor_msgs/msg/{kind}" for kind in ("CompressedImage", "Image", "CameraInfo"))
RAW_CHANNELS = {"rgb8": 3, "bgr8": 3, "mono8": 1}
NOT_A_FRAME_SIZE = {0xC4, 0xC8, 0xCC}


@dataclass(frozen=True)
class CameraInfo:
    """What sensor_msgs/CameraInfo says of a lens. `K` 9 numbers by rows, px; `D` as published; `where` it was read."""

    width: int
    height: int
    K: tuple
    D: tuple
    model: str
    where: str


def topics_of(bag):
    """Topics of a bag: dict topic -> (message type, number of messages)."""
    with _reader(bag) as reader:
        topics = {}
        for connection in reader.connections:
            _, before = topics.get(connection.topic, ("", 0))
            topics[connection.topic] = (connection.msgtype, before + connection.msgcount)
        return topics


def bags_with(bags, topic, where):
    """Those of `bags` that hold messages of `topic`. Raises DiorError if there are none, naming the topics there."""
    there = {bag: topics_of(bag) for bag in bags}
    names = sorted({name for topics in there.values() for name in topics})
    listed = ", ".join(str(bag) for bag in bags)
    if not names:
        raise DiorError(f"{where}: there is no message at all in {listed}")
    if topic not in names:
        raise DiorError(
            f"{where}: topic {topic} is not in {listed}{nearest(topic, names)}; the topics there are {', '.join(names)}"
        )
    found = [bag for bag, topics in there.items() if topics.get(topic, ("", 0))[1]]
    if not found:
        raise DiorError(f"{where}: topic {topic} is declared in {listed} but has no message; was the camera running?")
    return found


def index(bag, topics):
    """Index of the pictures of `topics` in one bag, in the bag's order, as a dict of arrays.

    Keys: topic, stamp_ns, receive_ns, nth (which message of that topic and receive stamp), height, width (px).
    Only headers are looked at. Raises DiorError for a broken bag, a topic that holds no pictures, a bad picture header.
    """
    columns = {key: [] for key in ("topic", "stamp_ns", "receive_ns", "nth", "height", "width")}
    count = Counter()
    for topic, kind, receive_ns, nth, raw in _messages(bag, topics):
        try:
            stamp_ns, (height, width) = _stamp_ns(raw), _picture_size(kind, raw)
        except (struct.error, IndexError, ValueError) as error:
            raise DiorError(f"{bag}: message {count[topic]} of {topic} has no readable picture ({error})") from None
        count[topic] += 1
        for key, value in zip(columns, (topic, stamp_ns, receive_ns, nth, height, width), strict=True):
            columns[key].append(value)
    kinds = {"topic": object, "nth": np.int32, "height": np.int32, "width": np.int32}
    return {key: np.array(values, kinds.get(key, np.int64)) for key, values in columns.items()}


def read_pictures(rows, data_root):
    """Yield (row number, BGR uint8 picture (height, width, 3)) for rows of the `frames` table (a dict of arrays).

    Grouped by bag and in the bag's order, so that each chunk is read about once. Raises DiorError where a picture is
    no longer there or cannot be decoded.
    """
    for bag in sorted(set(rows["bag"].tolist())):
        mine = np.flatnonzero(rows["bag"] == bag)
        keys = ((rows["topic"][i], int(rows["receive_ns"][i]), int(rows["nth"][i])) for i in mine)
        wanted = dict(zip(keys, mine.tolist(), strict=True))
        path = Path(data_root) / bag
        topics = {topic for topic, _, _ in wanted}
        for topic, kind, receive_ns, nth, raw in _messages(path, topics, {key[1] for key in wanted}):
            row = wanted.pop((topic, receive_ns, nth), None)
            if row is None:
                continue
            picture = _decode(kind, raw)
            size = (rows["height"][row], rows["width"][row])
            if picture is None or picture.shape[:2] != size:
                raise DiorError(f"{path}: the picture of {topic} received at {receive_ns} ns cannot be decoded")
            yield row, picture
        if wanted:
            topic, receive_ns, _ = next(iter(wanted))
            raise DiorError(
                f"{path}: the picture of {topic} received at {receive_ns} ns is not there any more; "
                "the bag has changed since it was indexed, so index it again"
            )


def camera_info_topic(topic):
    """The CameraInfo topic beside an image topic: `a/image_raw/compressed` and `a/image_raw` have `a/camera_info`."""
    return topic.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"


def read_camera_info(bags, topic):
    """The CameraInfo that belongs to the image `topic`, the same in every message of all `bags`.

    Raises DiorError where there is none or where one of them differs from the first.
    """
    info_topic = camera_info_topic(topic)
    first, body = None, None
    for bag in bags_with(bags, info_topic, "CameraInfo"):
        for number, (_, kind, _, _, raw) in enumerate(_messages(bag, [info_topic])):
            after_header = raw[16 + struct.unpack_from("<I", raw, 12)[0] :]
            if after_header == body:
                continue
            info = _camera_info(kind, raw, f"{bag}: message {number} of {info_topic}")
            if first is None:
                first, body = info, after_header
            _check_same(first, info)
    return first


def _check_same(first, info):
    for key, text in (("width", "width"), ("height", "height"), ("model", "model"), ("K", "K"), ("D", "D")):
        a, b = getattr(first, key), getattr(info, key)
        if a != b:
            raise DiorError(
                f"{info.where} says {text} {b} where the recording began with {a}; a camera must keep its stream "
                "profile during a recording, so give `intrinsics: {file, name}` in its YAML or drop this bag"
            )


def _camera_info(kind, raw, where):
    if kind != CAMERA_INFO:
        raise DiorError(f"{where} is a {kind}, not {CAMERA_INFO}")
    from rosbags.typesys import Stores, get_typestore

    message = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(raw, kind)
    return CameraInfo(
        int(message.width),
        int(message.height),
        tuple(message.K.tolist()),
        tuple(message.D.tolist()),
        message.distortion_model,
        where,
    )


def _reader(bag):
    """The opened rosbags reader of a bag, a context manager. Raises DiorError for what is no complete ROS 1 bag."""
    from rosbags.rosbag1 import Reader

    bag = Path(bag)
    if not bag.is_file():
        raise DiorError(f"{bag}: there is no such bag; check `bags` in sequences.tsv and `data_root`")
    with open(bag, "rb") as stream:
        magic = stream.read(len(MAGIC))
    if not magic:
        raise DiorError(f"{bag}: the bag is empty; copy it again from the recording computer")
    if magic != MAGIC:
        raise DiorError(f"{bag}: this is not a ROS 1 bag (it does not begin with {MAGIC.decode()!r})")
    reader = Reader(bag)
    try:
        reader.open()
    except _broken() as error:
        raise _truncated(bag, error) from None
    return closing(reader)


def _messages(bag, topics, received=None):
    """Yield (topic, message type, receive_ns, nth, raw bytes) of `topics`, only of the receive stamps `received`."""
    with _reader(bag) as reader:
        connections = [c for c in reader.connections if c.topic in topics]
        if not connections:
            return
        if received is not None:
            # rosbags filters by one time range; its index thinned out makes it skip everything that is not asked for
            reader.indexes = {k: [e for e in entries if e.time in received] for k, entries in reader.indexes.items()}
        messages, last, nth = reader.messages(connections), {}, {}
        while True:
            try:
                connection, receive_ns, raw = next(messages)
            except StopIteration:
                return
            except _broken() as error:
                raise _truncated(bag, error) from None
            topic = connection.topic
            nth[topic] = nth[topic] + 1 if last.get(topic) == receive_ns else 0
            last[topic] = receive_ns
            yield topic, connection.msgtype, receive_ns, nth[topic], raw


def _broken():
    """What rosbags and its decompressors raise on damaged bytes."""
    from rosbags.rosbag1 import ReaderError

    return ReaderError, AssertionError, LookupError, OSError, RuntimeError, ValueError, EOFError, struct.error


def _truncated(bag, error):
    reason = str(error).split("\n")[0] or type(error).__name__
    return DiorError(f"{bag}: the bag is truncated or was not closed ({reason}); try `rosbag reindex`")


def _stamp_ns(raw):
    """Header stamp of a message that begins with std_msgs/Header."""
    seconds, nanoseconds = struct.unpack_from("<II", raw, 4)
    if not seconds:
        raise ValueError("its header stamp is zero: the driver did not stamp it")
    return seconds * 10**9 + nanoseconds


def _text(raw, at):
    size = struct.unpack_from("<I", raw, at)[0]
    end = at + 4 + size
    if end > len(raw):
        raise ValueError("the message is cut off")
    return raw[at + 4 : end], end


def _picture_size(kind, raw):
    """(height, width) in px of an image message, from its first bytes."""
    _, at = _text(raw, 12)
    if kind == RAW:
        height, width = struct.unpack_from("<II", raw, at)
        encoding = _text(raw, at + 8)[0].decode()
        if encoding not in RAW_CHANNELS:
            raise ValueError(f"encoding '{encoding}' is not one of {', '.join(RAW_CHANNELS)}")
        return height, width
    if kind != COMPRESSED:
        raise ValueError(f"its type is {kind}, not {COMPRESSED} or {RAW}")
    _, at = _text(raw, at)
    return _compressed_size(raw, at + 4)


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


def _decode(kind, raw):
    """BGR picture, or None."""
    import cv2

    _, at = _text(raw, 12)
    if kind == COMPRESSED:
        _, at = _text(raw, at)
        # a turned picture would not fit the intrinsics: EXIF's orientation is for people
        flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        return cv2.imdecode(np.frombuffer(raw, np.uint8, offset=at + 4), flags)
    height, width = struct.unpack_from("<II", raw, at)
    encoding, at = _text(raw, at + 8)
    step = struct.unpack_from("<I", raw, at + 1)[0]
    channels = RAW_CHANNELS[encoding.decode()]
    pixels = np.frombuffer(raw, np.uint8, offset=at + 9)
    if len(pixels) < height * step or step < width * channels:
        return None
    picture = pixels[: height * step].reshape(height, step)[:, : width * channels].reshape(height, width, channels)
    if channels == 1:
        return np.repeat(picture, 3, axis=2)
    return np.ascontiguousarray(picture[..., ::-1]) if encoding == b"rgb8" else picture.copy()
