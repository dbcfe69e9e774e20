"""What is in a recording, at a glance: read are its index and the first and last message of each topic.

INPUTS   what `containers` reads: a bag, a video, a folder of pictures
OUTPUTS  `Stream`s, sorted by topic
A bag takes as long as its index (`python -m benchmarks.check`), a video as its first picture. What is compressed as a
whole file is unpacked, and an MCAP file without an index of messages is read whole. What is damaged between the ends
is not seen.
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
    of; `fps`: messages per second; `why_not`: why the first message is no picture that is read, empty where it is one.
    A video's topics, and how many pictures it has, are as `bags.topics_of` has them.
    """

    topic: str
    kind: str
    count: int
    first_ns: int | None
    last_ns: int | None
    height: int | None
    width: int | None
    fps: float | None
    why_not: str = ""


def glance(path: AnyPath) -> tuple[Stream, ...]:
    """The `Stream`s of a recording. Raises DiorError for one that is not there or is broken."""
    found: dict[tuple[str, str], Stream] = {}
    for stream in containers.of_files(path, _streams):
        key = stream.topic, stream.kind
        found[key] = _joined(found[key], stream) if key in found else stream
    return tuple(found[key] for key in sorted(found))


def is_packed(path: AnyPath) -> bool:
    """Whether a bag, or a file of its folder, is compressed as a whole, so that a glance would unpack it."""
    path = Path(path)
    files = [path] if path.is_file() else [one for one in path.iterdir() if one.suffix == ".zstd"]
    return any(containers.is_packed(file) for file in files)


def _streams(path: Path, container: str) -> list[Stream]:
    if container == "video":
        return [_of_video(one) for one in videos.ends(path)]
    if container == "pictures":
        return [_of_folder(path)]
    return [_of_bag(one) for one in bag_ends.ends(path, container)]


def _of_bag(ends: Ends) -> Stream:
    first_ns, size, why_not = _told(ends.first)
    last_ns, last_size, why_last = _told(ends.last)
    if why_not:
        # one picture may be damaged
        size, why_not = last_size, why_last
    return _stream(ends.topic, ends.kind, ends.count, (first_ns, last_ns), size, why_not)


def _told(message: Message | None) -> tuple[int | None, tuple[int, int] | None, str]:
    """Stamp (ns), size (height, width) px of a message, and why it is no picture."""
    if message is None:
        return None, None, "there is no message of it"
    stamp_ns, size, why_not = messages.told(message.kind, message.raw, message.wire)
    return message.receive_ns if stamp_ns is None else stamp_ns, size, why_not


def _stream(
    topic: str,
    kind: str,
    count: int,
    span: tuple[int | None, int | None],
    size: tuple[int, int] | None,
    why_not: str = "",
) -> Stream:
    first_ns, last_ns = span
    lasts_ns = (last_ns or 0) - (first_ns or 0)
    fps = 1e9 * (count - 1) / lasts_ns if count > 1 and lasts_ns > 0 else None
    height, width = size or (None, None)
    return Stream(topic, kind, count, first_ns, last_ns, height, width, fps, why_not)


def _of_video(ends: videos.VideoEnds) -> Stream:
    last_ns = None if ends.began_ns is None else ends.began_ns + ends.span_ns
    size = ends.height, ends.width
    return Stream(ends.topic, messages.RAW, ends.count, ends.began_ns, last_ns, *size, ends.fps or None)


def _of_folder(path: Path) -> Stream:
    files = picture_folders.files(path)
    first = next(picture_folders.recorded(path, {picture_folders.TOPIC}, {0}))
    _, size, why_not = messages.told(first.kind, first.raw, first.wire)
    return _stream(picture_folders.TOPIC, messages.COMPRESSED, len(files), (None, None), size, why_not)


def _joined(one: Stream, other: Stream) -> Stream:
    """A topic that goes on in another file of the bag."""
    span = [ns for part in (one, other) for ns in (part.first_ns, part.last_ns) if ns is not None]
    whole = (min(span), max(span)) if span else (None, None)
    size = (one.height, one.width) if one.height else (other.height, other.width)
    known = (size[0], size[1]) if size[0] is not None and size[1] is not None else None
    # of a file without a message of it, the other tells
    why_not = one.why_not if one.count else other.why_not
    return _stream(one.topic, one.kind, one.count + other.count, whole, known, why_not)


def first_message(path: AnyPath, topic: str) -> Message | None:
    """The first message of a topic (its full name) in a bag. Raises DiorError for a broken one."""

    def read(file: Path, container: str) -> list[Message]:
        ends = [] if container in containers.READERS else bag_ends.ends(file, container)
        return [one.first for one in ends if one.topic == topic and one.first]

    return next(iter(containers.of_files(path, read)), None)
