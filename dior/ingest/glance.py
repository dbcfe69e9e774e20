"""What is in a recording, at a glance: read are its index and the first and last message of each topic.

INPUTS   what `containers` reads: a bag, a video, a folder of pictures
OUTPUTS  `Stream`s, sorted by topic
A bag of 360 MB takes some 5 ms, a video as long as its first picture. What is compressed as a whole file is unpacked,
and an MCAP file without an index of messages is read whole. What is damaged between the ends is not seen.
"""

from dataclasses import dataclass
from pathlib import Path

from dior.arrays import AnyPath
from dior.ingest import bag_ends, containers, messages, picture_folders, videos
from dior.ingest.bag_ends import Ends
from dior.ingest.bag_reader import Message


@dataclass(frozen=True)
class Stream:
    """A topic by its full name, its message type in ROS 2's spelling, and the number of its messages.

    `first_ns`, `last_ns`: header stamps of the first and the last of them, as they were received (ns since the Unix
    epoch; 0 where the driver set none), the receive stamps of what has no header, None where the file does not tell.
    Of a video they are by its time of creation. `height`, `width` (px) of pictures, or of those that a CameraInfo is
    of; `fps`: messages per second. A video's topics, and how many pictures it has, are as `bags.topics_of` has them.
    """

    topic: str
    kind: str
    count: int
    first_ns: int | None
    last_ns: int | None
    height: int | None
    width: int | None
    fps: float | None


def glance(path: AnyPath) -> tuple[Stream, ...]:
    """The `Stream`s of a recording. Raises DiorError for one that is not there or is broken."""
    found: dict[tuple[str, str], Stream] = {}
    for stream in containers.of_files(path, _streams):
        key = stream.topic, stream.kind
        found[key] = _joined(found[key], stream) if key in found else stream
    return tuple(found[key] for key in sorted(found))


def _streams(path: Path, container: str) -> list[Stream]:
    if container == "video":
        return [_of_video(one) for one in videos.ends(path)]
    if container == "pictures":
        return [_of_folder(path)]
    return [_of_bag(one) for one in bag_ends.ends(path, container)]


def _of_bag(ends: Ends) -> Stream:
    first_ns, size = _told(ends.first)
    last_ns, _ = _told(ends.last)
    return _stream(ends.topic, ends.kind, ends.count, (first_ns, last_ns), size)


def _told(message: Message | None) -> tuple[int | None, tuple[int, int] | None]:
    """Stamp (ns) and size (height, width) px of a message."""
    if message is None:
        return None, None
    stamp_ns, size = messages.stamp_and_size(message.kind, message.raw, message.wire)
    return message.receive_ns if stamp_ns is None else stamp_ns, size


def _stream(
    topic: str, kind: str, count: int, span: tuple[int | None, int | None], size: tuple[int, int] | None
) -> Stream:
    first_ns, last_ns = span
    lasts = first_ns is not None and last_ns is not None and last_ns > first_ns
    fps = 1e9 * (count - 1) / (last_ns - first_ns) if lasts and count > 1 else None  # type: ignore[operator]
    height, width = size or (None, None)
    return Stream(topic, kind, count, first_ns, last_ns, height, width, fps)


def _of_video(ends: videos.VideoEnds) -> Stream:
    last_ns = None if ends.began_ns is None else ends.began_ns + ends.span_ns
    size = ends.height, ends.width
    return Stream(ends.topic, messages.RAW, ends.count, ends.began_ns, last_ns, *size, ends.fps or None)


def _of_folder(path: Path) -> Stream:
    files = picture_folders.files(path)
    first = next(picture_folders.recorded(path, {picture_folders.TOPIC}, {0}))
    _, size = messages.stamp_and_size(first.kind, first.raw, first.wire)
    return _stream(picture_folders.TOPIC, messages.COMPRESSED, len(files), (None, None), size)


def _joined(one: Stream, other: Stream) -> Stream:
    """A topic that goes on in another file of the bag."""
    span = [ns for part in (one, other) for ns in (part.first_ns, part.last_ns) if ns is not None]
    whole = (min(span), max(span)) if span else (None, None)
    size = (one.height, one.width) if one.height else (other.height, other.width)
    known = (size[0], size[1]) if size[0] is not None and size[1] is not None else None
    return _stream(one.topic, one.kind, one.count + other.count, whole, known)
