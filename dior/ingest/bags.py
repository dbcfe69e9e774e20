"""Bags: what is in them, an index of their pictures, the pictures, and the CameraInfo beside them.

INPUTS   bags as `containers` reads them (ROS 1 .bag, ROS 2 .db3 and .mcap, files or folders), with sensor_msgs
         CompressedImage (JPEG or PNG) or Image (`messages.ENCODINGS`), packets of a video, which come decoded
         (`packets`), and CameraInfo; videos and folders of pictures,
         whose pictures count as messages of topics such as `video0`.
OUTPUTS  arrays in memory; the pixels stay in the bags.
Stamps are int64 ns since the Unix epoch: `stamp_ns` from the message header, `receive_ns` from the bag.
"""

import sys
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Table
from dior.errors import DiorError, nearest
from dior.ingest import containers, messages, picture_folders, videos
from dior.ingest.bag_reader import Lost, Message, full_name
from dior.ingest.containers import BROKEN
from dior.ingest.containers import messages as messages_of
from dior.ingest.containers import topics as topics_of
from dior.progress import reporting

__all__ = [
    "bags_with", "camera_info_topic", "full_name", "holding", "index", "read_camera_info", "read_messages",
    "read_pictures", "read_to_show", "repeated", "topics_of",
]  # fmt: skip

# how the topics of pictures end that realsense-viewer records (librealsense, src/media/ros/ros_file_format.h)
OF_LIBREALSENSE = "/image/data"
# how the topics of image_transport's plugins end
TRANSPORTS = ("/compressed", "/ffmpeg", "/theora")
DAMAGED_GREY = 128  # of a picture on a page that cannot be decoded
BY_INDEX = "the bag is damaged: copy it again, or make the index anew (`rosbag reindex`, `mcap recover`)"
# full name -> (message type, number of messages)
Topics: TypeAlias = dict[str, tuple[str, int]]


@dataclass(frozen=True)
class CameraInfo:
    """What sensor_msgs/CameraInfo says of a lens. `K`, `R` 9 numbers and `P` 12 by rows, px; `D` as published;
    `binning` in x and y; `roi` x, y, width, height px; `where` it was read."""

    width: int
    height: int
    K: tuple[float, ...]
    D: tuple[float, ...]
    model: str
    where: str
    R: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    P: tuple[float, ...] = (0.0,) * 12
    binning: tuple[int, int] = (0, 0)
    roi: tuple[int, int, int, int] = (0, 0, 0, 0)


def bags_with(bags: Iterable[Path], topic: str, where: str) -> list[Path]:
    """Those of `bags` that hold messages of `topic`. Raises DiorError if there are none, naming the topics there."""
    return holding({bag: topics_of(bag) for bag in bags}, topic, where)


def holding(there: dict[Path, Topics], topic: str, where: str) -> list[Path]:
    """The same, from the topics of the bags: `there` is a dict bag -> `topics_of(bag)`."""
    names = sorted({name for topics in there.values() for name in topics})
    listed = ", ".join(str(bag) for bag in there)
    if not names:
        raise DiorError(f"{where}: there is no message at all in {listed}")
    if full_name(topic) not in names:
        raise DiorError(
            f"{where}: topic {topic} is not in {listed}{nearest(topic, names)}; the topics there are {', '.join(names)}"
        )
    found = [bag for bag, topics in there.items() if topics.get(full_name(topic), ("", 0))[1]]
    if not found:
        raise DiorError(f"{where}: topic {topic} is declared in {listed} but has no message; was the camera running?")
    return found


def index(bag: Path, topics: Sequence[str], lost: list[Lost] | None = None) -> Table:
    """Index of the pictures of `topics` in one bag, in the order of its files, as a dict of arrays.

    `lost` is told what gives no picture: packets of a video, and messages whose picture is damaged.

    Keys: topic (as given), stamp_ns, receive_ns, nth (which message of that topic and receive stamp), height, width
    (px). No picture is decoded but those of packets. Raises DiorError for a broken bag and a topic that holds no
    picture that is read.
    """
    lost = [] if lost is None else lost
    if containers.is_video(bag):
        return _of_video([(topic, containers.video_index(bag, topic)) for topic in topics])
    columns: dict[str, list[Any]] = {key: [] for key in ("topic", "stamp_ns", "receive_ns", "nth", "height", "width")}
    given = {full_name(topic): topic for topic in topics}
    count: Counter[str] = Counter()
    readable: set[str] = set()
    refused: dict[str, str] = {}
    for message, nth in _reported(bag, given, lost):
        topic = given[message.topic]
        try:
            stamp_ns, height, width = messages.picture_of(message.kind, message.raw, message.wire)
        except BROKEN as error:
            own = _file_of(message)
            where = own or f"{bag}: message {count[topic]} of {topic}"
            mend = "; remove it or copy it again" if own else ""
            refusal = f"{where} has no readable picture ({error}){mend}"
            taken_ns, *_ = messages.told(message.kind, message.raw, message.wire)
            # what is no damage is so of all pictures of a topic, unless it has given some
            is_one = isinstance(error, messages.Damaged) or topic in readable
            if own or taken_ns is None or not is_one:
                raise DiorError(refusal) from None
            refused.setdefault(topic, refusal)
            lost.append((message.topic, taken_ns, str(error)))
            count[topic] += 1
            continue
        count[topic] += 1
        readable.add(topic)
        row = (topic, stamp_ns, message.receive_ns, nth, height, width)
        for key, value in zip(columns, row, strict=True):
            columns[key].append(value)
    for topic, refusal in refused.items():
        if topic not in readable:
            others = f", nor has any other of the {count[topic]}" if count[topic] > 1 else ""
            raise DiorError(f"{refusal}{others}; exclude the sequence or drop the camera")
    kinds: dict[str, type] = {"topic": object, "nth": np.int32, "height": np.int32, "width": np.int32}
    return {key: np.array(values, kinds.get(key, np.int64)) for key, values in columns.items()}


def _of_video(streams: list[tuple[str, videos.VideoIndex]]) -> Table:
    """`index` of some streams (topic as given, `VideoIndex`) of a video."""
    count = [len(one.pts_ns) for _, one in streams]
    pts_ns, height, width = (
        np.concatenate([getattr(one, key) for _, one in streams]) for key in ("pts_ns", "height", "width")
    )
    return {
        "topic": np.repeat(np.array([topic for topic, _ in streams], object), count),
        "stamp_ns": pts_ns,
        "receive_ns": pts_ns,
        "nth": np.zeros(sum(count), np.int32),
        "height": height.astype(np.int32),
        "width": width.astype(np.int32),
    }


def _numbered(
    bag: Path,
    wanted: Collection[str],
    received: Collection[int] | None = None,
    lost: list[Lost] | None = None,
) -> Iterator[tuple[Message, int]]:
    """Yield (message, nth): which one it is, from 0, of those of its topic and receive stamp."""
    before: Counter[tuple[str, int]] = Counter()
    for message in messages_of(bag, wanted, received, lost):
        key = (message.topic, message.receive_ns)
        yield message, before[key]
        before[key] += 1


def _reported(bag: Path, given: Collection[str], lost: list[Lost] | None = None) -> Iterator[tuple[Message, int]]:
    """`_numbered` of all messages of some topics, its progress reported."""

    def total() -> int:
        there = topics_of(bag)
        return sum(there.get(topic, ("", 0))[1] for topic in given)

    return reporting(_numbered(bag, given, None, lost), total, "messages", str(bag))


def read_pictures(rows: Table, data_root: AnyPath) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield (row number, BGR uint8 picture (height, width, 3)) for rows of the `frames` table (a dict of arrays).

    In the order of `read_messages`. Raises DiorError where a picture is no longer there or cannot be decoded.
    """
    for row, message, path in read_messages(rows, data_root):
        size = (rows["height"][row], rows["width"][row])
        yield row, _picture(message, size, f"{path}: the picture of {rows['topic'][row]}")


def read_to_show(rows: Table, data_root: AnyPath) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """As `read_pictures`, for pages: a picture that cannot be decoded is grey, and is told on standard error.

    Labels do not need it, and one damaged picture of a walk must not cost the report of all.
    """
    for row, message, path in read_messages(rows, data_root):
        size = (rows["height"][row], rows["width"][row])
        try:
            yield row, _picture(message, size, f"{path}: the picture of {rows['topic'][row]}")
        except DiorError as error:
            print(f"{error}; it is shown grey", file=sys.stderr)
            yield row, np.full((*map(int, size), 3), DAMAGED_GREY, np.uint8)


def read_messages(rows: Table, data_root: AnyPath) -> Iterator[tuple[int, Message, Path]]:
    """Yield (row number, its picture's message, the bag's path) for rows of the `frames` table (a dict of arrays).

    Grouped by bag and in the order in which its messages come, so that a chunk is unpacked once and one without a
    wanted picture never. Raises DiorError where a picture is no longer there.
    """
    for bag in sorted(set(rows["bag"].tolist())):
        mine = np.flatnonzero(rows["bag"] == bag)
        keys = ((full_name(rows["topic"][i]), int(rows["receive_ns"][i]), int(rows["nth"][i])) for i in mine)
        wanted = dict(zip(keys, mine.tolist(), strict=True))
        path = Path(data_root) / bag
        topics = {topic for topic, _, _ in wanted}
        for message, nth in _numbered(path, topics, {key[1] for key in wanted}):
            row = wanted.pop((message.topic, message.receive_ns, nth), None)
            if row is not None:
                yield row, message, path
        if wanted:
            _, receive_ns, _ = min(wanted)
            topic = rows["topic"][wanted[min(wanted)]]
            raise DiorError(
                f"{path}: the picture of {topic} received at {receive_ns} ns is not there any more; "
                "the bag has changed since it was indexed, so index it again"
            )


def _picture(message: Message, size: tuple[int, int], where: str) -> NDArray[np.uint8]:
    try:
        return messages.decode(message.kind, message.raw, message.wire, size)
    except BROKEN as error:
        where = _file_of(message) or f"{where} received at {message.receive_ns} ns"
        again = "copy it again, or give the sequence an exclude_reason where it was damaged as it was recorded"
        raise DiorError(f"{where} cannot be decoded ({error}); {again}") from None


def _file_of(message: Message) -> str:
    """The picture's file where it has one of its own, else empty."""
    return f"{message.raw.path}: the picture" if isinstance(message.raw, picture_folders.PictureFile) else ""


def repeated(bag: Path, topics: Sequence[str]) -> set[tuple[str, int, int]]:
    """Pictures of `topics` in one bag whose bytes are those of the one before: a set of (topic, receive_ns, nth).

    The topic is the one given.
    """
    given = {full_name(topic): topic for topic in topics}
    found: set[tuple[str, int, int]] = set()
    before: dict[str, tuple[Any, ...]] = {}
    for message, nth in _reported(bag, given):
        try:
            content = messages.content(message.kind, message.raw, message.wire)
        except BROKEN as error:
            where = f"{bag}: the picture of {given[message.topic]} received at {message.receive_ns} ns"
            raise DiorError(f"{where} is not readable ({error})") from None
        if content == before.get(message.topic):
            found.add((given[message.topic], message.receive_ns, nth))
        before[message.topic] = content
    return found


def camera_info_topic(topic: str) -> str:
    """The CameraInfo topic beside an image topic: `a/image_raw`, and with a transport `a/image_raw/compressed`, has
    `a/camera_info`, and librealsense's `a/image/data` has `a/info/camera_info`."""
    if topic.endswith(OF_LIBREALSENSE):
        return topic.removesuffix(OF_LIBREALSENSE) + "/info/camera_info"
    transport = next((one for one in TRANSPORTS if topic.endswith(one)), "")
    return topic.removesuffix(transport).rpartition("/")[0] + "/camera_info"


def read_camera_info(bags: Sequence[Path], topic: str, info_topic: str = "") -> CameraInfo:
    """The CameraInfo that belongs to the image `topic`, the same in every message of all `bags`.

    `info_topic` is its topic, where that is not the one beside. Raises DiorError where there is none or where one of
    them differs from the first.
    """
    info_topic = info_topic or camera_info_topic(topic)
    first = None
    for bag in bags_with(bags, info_topic, "CameraInfo"):
        for number, message in enumerate(messages_of(bag, {full_name(info_topic)})):
            where = f"{bag}: message {number} of {info_topic}"
            if message.kind != messages.CAMERA_INFO:
                raise DiorError(f"{where} is a {message.kind}, not {messages.CAMERA_INFO}")
            try:
                said = messages.camera_info(message.raw, message.wire)
            except BROKEN as error:
                raise DiorError(f"{where} is no readable CameraInfo ({error})") from None
            info = CameraInfo(where=where, **said)
            first = first or info
            _check_same(first, info)
    if first is None:
        listed = ", ".join(map(str, bags))
        raise DiorError(f"{listed}: {info_topic} has messages by the index, and none is there; {BY_INDEX}")
    return first


def _check_same(first: CameraInfo, info: CameraInfo) -> None:
    for key in ("width", "height", "model", "K", "D", "R", "P", "binning", "roi"):
        a, b = getattr(first, key), getattr(info, key)
        if a != b:
            raise DiorError(
                f"{info.where} says {key} {b} where the recording began with {a}; a camera must keep its stream "
                "profile during a recording, so give `intrinsics: {file, name}` in its YAML or drop this bag"
            )
