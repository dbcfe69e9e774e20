"""Video files: their streams, an index of the pictures in the order in which they are shown, and the pictures.

INPUTS   mp4, mov, avi, mkv and webm, read by PyAV (the extra `video`), which brings FFmpeg
OUTPUTS  `bag_reader.Message`s, one per picture: `topic` the stream and its frame, `receive_ns` the picture's
         presentation time in the file (PTS, ns); `raw` has the fields of a sensor_msgs/Image (`messages.PICTURE`)

A stream is called `video0`, `video1`, ... in the file's order, cover pictures left out. Where the file says that its
pictures are to be turned (a telephone held upright), `video0` is the picture as players and OpenCV show it, and
`video0/stored` as the decoder gives it. Edit lists are applied, B-frames are in their places.

Of a file that is damaged or cut off the pictures that can be read are read; the others are in `VideoIndex.lost`.
ValueError means damage. A picture is found by a seek to the key frame before it and decoding on, and is the right one
by its PTS; a second handle looks where the key frame is, so that no picture is decoded twice.
"""

import os
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats, Ints
from dior.errors import DiorError, many
from dior.formats import VideoFormat
from dior.ingest import messages
from dior.ingest.bag_reader import Message, full_name

STORED = "stored"
# chosen: to look for a key frame takes as long as to decode some pictures; what is as near is decoded up to
NEAR_NS = 500_000_000
# chosen: by so much a seek aims earlier where it ended behind what it was for, then by twice as much
FIRST_BACK_S = 0.5
# chosen: fewer pictures than these are not missed at the end of a file that tells its length alone
FEWEST_BEYOND = 2
# chosen: of rows and columns; the mean of a picture is known all the same, at a tenth of a millisecond
LIGHT_STEP = 8
# chosen: fields in a row and in a column, of which what passes near the lens covers some at a time
FIELDS = 8
# where the file's boxes (ISO/IEC 14496-12, QuickTime) begin, and those that such a file may begin with
BOX_AT, BOXES = 4, (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
MATROSKA_MAGIC, RIFF_MAGIC, AVI_MAGIC = b"\x1a\x45\xdf\xa3", b"RIFF", b"AVI "
BEYOND = (1 << 62, None)
DESCRIPTIONS = (
    VideoFormat(
        key="mp4",
        format="mp4, mov",
        read="every codec of FFmpeg; times as the edit list has them, in steps of 11 µs or so",
        tried="written here: H.264 with and without B-frames, at a constant and a variable rate, HEVC; in "
        "fragments; cut by an edit list; turned by 90, 180 and 270 degrees; cut off; a picture's "
        "bytes destroyed",
    ),
    VideoFormat(
        key="mkv",
        format="mkv, webm",
        read="every codec of FFmpeg; times are in steps of 1 ms: those of a regular rate are put back onto it, of "
        "others the step is in the labels' sigma",
        tried="written here: H.264, two streams, cut off",
    ),
    VideoFormat(
        key="avi",
        format="avi",
        read="every codec of FFmpeg; its times are those of decoding, which B-frames follow in another order: they are "
        "sorted, and such a file is read from its beginning",
        tried="written here: MJPEG, H.264 with B-frames",
    ),
)


@dataclass(frozen=True, eq=False)
class VideoIndex:
    """Pictures of a stream in the order in which they are shown.

    `pts_ns` (F,): presentation time in the file; `number` (F,): which picture of the file it is, the lost ones counted;
    `height`, `width` (F,) px; `lost`: (PTS in ns, reason) of pictures that the file had or says it has. `tick_s`: step
    of the file's time; `created_ns`: when the first picture was taken by the file's creation time, since the Unix
    epoch, None if it says nothing; `light` (F, FIELDS * FIELDS): mean brightness of the fields of each picture, 0 to
    255, None where nobody looked.
    """

    pts_ns: Ints
    number: Ints
    height: Ints
    width: Ints
    lost: tuple[tuple[int, str], ...]
    tick_s: float
    created_ns: int | None
    light: Floats | None = None


@dataclass(frozen=True)
class VideoEnds:
    """A stream by its name (`topics`): about how many pictures, when it began (ns since the Unix epoch, None where the
    file does not say), about how long it is, the size of its first picture (px), pictures per second, 0 where
    unknown."""

    topic: str
    count: int
    began_ns: int | None
    span_ns: int
    height: int
    width: int
    fps: float


@dataclass(frozen=True, eq=False)
class DecodedPicture:
    """A decoded picture, to be turned counterclockwise by `quarters`, with the fields of a sensor_msgs/Image."""

    frame: Any
    quarters: int
    header: messages.Header = messages.Header()
    encoding: str = "bgr8"
    is_bigendian: int = 0

    @property
    def height(self) -> int:
        return int(self.frame.width if self.quarters % 2 else self.frame.height)

    @property
    def width(self) -> int:
        return int(self.frame.height if self.quarters % 2 else self.frame.width)

    @property
    def step(self) -> int:
        return 3 * self.width

    @property
    def data(self) -> NDArray[np.uint8]:
        return self.picture.ravel()

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """BGR (height, width, 3)."""
        found: NDArray[np.uint8] = _to_bgr(self.frame)
        return np.ascontiguousarray(np.rot90(found, self.quarters)) if self.quarters else found

    def content(self) -> tuple[Any, ...]:
        """What tells whether two pictures are the same, before any colours are converted."""
        return (self.frame.format.name, *(bytes(plane) for plane in self.frame.planes))


def is_video(head: bytes) -> bool:
    """Whether a file that begins with `head`, 12 bytes or more, is one of the containers that are read."""
    in_riff = head.startswith(RIFF_MAGIC) and head[8:12] == AVI_MAGIC
    return in_riff or head.startswith(MATROSKA_MAGIC) or head[BOX_AT : BOX_AT + 4] in BOXES


def topics(path: Path) -> list[tuple[str, str, int]]:
    """(full name, message type, about how many pictures, at least 1) of each stream. Raises ValueError."""
    with _opened(path) as container:
        found = []
        for number, stream in enumerate(_streams(container)):
            for name in (f"/video{number}", f"/video{number}/{STORED}"):
                found.append((name, messages.RAW, max(stream.frames or _about(container, stream), 1)))
        return found


def ends(path: Path) -> list[VideoEnds]:
    """`VideoEnds` of each stream, by the file's own words and its first picture. Raises ValueError."""
    found = []
    with _opened(path) as container:
        for number in range(len(_streams(container))):
            stream = _stream(container, number)
            container.seek(0)
            _, frame = next(_decoded(container, stream, _Sent()), (0, None))
            if frame is None:
                raise ValueError("no picture in it can be decoded")
            count = max(stream.frames or _about(container, stream), 1)
            fps = float(stream.average_rate or stream.guessed_rate or 0)
            span_ns = round(1e9 * (count - 1) / fps) if fps else 0
            began_ns = _began({**stream.metadata, **container.metadata}, np.array([0, span_ns]))
            size = frame.height, frame.width
            shown = size[::-1] if _quarters(frame) % 2 else size
            name = f"/video{number}"
            found += [
                VideoEnds(topic, count, began_ns, span_ns, *messages.checked_size(*of), fps)
                for topic, of in ((name, shown), (f"{name}/{STORED}", size))
            ]
    return found


def recorded(path: Path, wanted: Collection[str], received: Collection[int] | None) -> Iterator[Message]:
    """The pictures of the streams `wanted` (full names), only those shown at the times `received` (ns) if given.

    Raises ValueError.
    """
    for topic in sorted(wanted):
        number, stored = _stream_of(topic)
        frames = _all(path, number) if received is None else _some(path, number, sorted(received))
        for pts_ns, frame in frames:
            quarters = 0 if stored else _quarters(frame)
            yield Message(topic, messages.RAW, messages.PICTURE, pts_ns, DecodedPicture(frame, quarters))


def index(path: Path, topic: str) -> VideoIndex:
    """`VideoIndex` of a stream. Every picture is decoded, as only that tells which can be. Raises ValueError."""
    number, stored = _stream_of(full_name(topic))
    shown: list[tuple[int, int, int]] = []
    light: list[Floats] = []
    with _opened(path) as container:
        stream = _stream(container, number)
        sent = _Sent()
        for pts_ns, frame in _decoded(container, stream, sent):
            turned = not stored and _quarters(frame) % 2
            size = (frame.width, frame.height) if turned else (frame.height, frame.width)
            shown.append((pts_ns, *messages.checked_size(*size)))
            light.append(_light(frame))
        told, tick_ns = {**stream.metadata, **container.metadata}, 1e9 * float(stream.time_base)
        is_avi = container.format.name == "avi"
        # FFmpeg's index of an mp4 has what the edit list leaves, and `frames` all that is stored
        said = len(stream.index_entries) if "mp4" in container.format.name.split(",") else stream.frames
    if not shown:
        raise ValueError("no picture in it can be decoded")
    pts_ns, height, width = np.array(shown, np.int64).T
    if (np.diff(pts_ns) <= 0).any():
        raise ValueError("the times of its pictures go back or repeat; `ffmpeg -i <video> -fps_mode passthrough <new>`")
    last, period = int(pts_ns[-1]), (pts_ns[-1] - pts_ns[0]) / max(len(pts_ns) - 1, 1)
    if is_avi:
        # its frames count where no picture was stored, too
        beyond = round((said * tick_ns - last) / period) - 1 if period else 0
    elif said:
        beyond = said - sent.count
    else:
        end_ns = _duration_ns(told)
        beyond = round((end_ns - last) / period) - 1 if end_ns and period else 0
        # the last picture may be shown for longer than others
        beyond = beyond if beyond >= FEWEST_BEYOND else 0
    lost = _lost(pts_ns, sent, max(beyond, 0), float(period))
    every = np.sort(np.concatenate([pts_ns, np.array([at for at, _ in lost], np.int64)]))
    # where a tick is a picture's period the time is no rounded one
    tick_s = tick_ns / 1e9 if tick_ns < period / 2 else 0.0
    return VideoIndex(
        pts_ns,
        np.searchsorted(every, pts_ns),
        height,
        width,
        tuple(lost),
        tick_s,
        _began(told, pts_ns),
        np.array(light),
    )


def _light(frame: Any) -> Floats:
    """Mean brightness of the fields of a frame (FIELDS * FIELDS,), 0 to 255: of the samples of its first plane, the
    luma in videos, some of them."""
    # what has all its colours in one plane has no plane of luma
    frame = frame if frame.format.is_planar and not frame.format.is_big_endian else frame.reformat(format="gray")
    plane, bits = frame.planes[0], frame.format.components[0].bits
    samples = np.frombuffer(plane, np.uint8 if bits <= 8 else np.dtype("<u2"))
    lines = samples.reshape(plane.height, -1)[::LIGHT_STEP, : frame.width : LIGHT_STEP].astype(float)
    for axis in (0, 1):
        begins = np.arange(FIELDS) * lines.shape[axis] // FIELDS
        ends = np.r_[begins[1:], lines.shape[axis]]
        shape = (-1, 1) if axis == 0 else (1, -1)
        lines = np.add.reduceat(lines, begins, axis=axis) / np.maximum(ends - begins, 1).reshape(shape)
    return lines.ravel() * 255 / (2**bits - 1)


def sound(path: Path, rate_hz: int, most_s: float) -> tuple[NDArray[np.float64], float]:
    """Samples (N,) of the beginning of the first audio track of a file, of all its channels together, and when in the
    file (s) the first is; none where there is no sound. Raises ValueError."""
    import av

    parts: list[NDArray[np.float64]] = []
    start_s: float | None = None
    with _opened(path) as container:
        if not container.streams.audio:
            return np.zeros(0), 0.0
        resampler = av.AudioResampler(format="flt", layout="mono", rate=rate_hz)
        left = round(most_s * rate_hz)
        for frame in _sounding(container, container.streams.audio[0]):
            start_s = frame.time if start_s is None else start_s
            parts += [np.asarray(one.to_ndarray(), np.float64).ravel() for one in resampler.resample(frame)]
            left -= round(frame.samples * rate_hz / frame.sample_rate)
            if left <= 0:
                break
    return np.concatenate([np.zeros(0), *parts]), start_s or 0.0


def _sounding(container: Any, stream: Any) -> Iterator[Any]:
    """The frames of an audio track that can be decoded, up to where the file ends or is broken."""
    import av

    try:
        for packet in container.demux(stream):
            try:
                yield from packet.decode()
            except av.FFmpegError:
                continue
    except av.FFmpegError:
        return


def _lost(pts_ns: Ints, sent: "_Sent", beyond: int, period_ns: float) -> list[tuple[int, str]]:
    """(PTS in ns, reason) of what was in the file and gave no picture, and of `beyond` pictures after its end."""
    last = int(pts_ns[-1])
    cut = sent.broken or beyond > 0
    found = [(at, "cut_off" if cut and at > last else "not_decoded") for at in sorted(sent.pts_ns - {*pts_ns.tolist()})]
    # by the mean rate: where they were is not in the file
    end = max([last, *(at for at, _ in found)])
    return found + [(end + round(period_ns * i), "cut_off") for i in range(1, beyond + 1)]


def _duration_ns(told: dict[str, str]) -> int:
    """How long a Matroska stream is by its tag, such as 00:00:10.000000000; 0 where it says nothing."""
    found = re.fullmatch(r"(\d+):(\d\d):(\d\d(?:\.\d+)?)", told.get("DURATION", ""))
    return round(1e9 * (3600 * int(found[1]) + 60 * int(found[2]) + float(found[3]))) if found else 0


def _began(told: dict[str, str], pts_ns: Ints) -> int | None:
    """When (ns since the Unix epoch) the first picture was taken, by the metadata of a file."""
    try:
        created = datetime.fromisoformat(told["creation_time"])
        at = round(created.replace(tzinfo=created.tzinfo or UTC).timestamp()) * 10**9
    except (KeyError, ValueError, OverflowError):
        return None
    # AOSP's MPEG4Writer::writeMvhdBox writes the time at which the file is closed
    at -= int(pts_ns[-1] - pts_ns[0]) if "com.android.version" in told else 0
    # 1904 is what a camera without a clock writes
    return at if at > 0 else None


@dataclass
class _Sent:
    """What the file gave to the decoder: how many packets, their presentation times, and whether it ended in the middle
    of one."""

    count: int = 0
    broken: bool = False

    def __post_init__(self) -> None:
        self.pts_ns: set[int] = set()


def _all(path: Path, number: int) -> Iterator[tuple[int, Any]]:
    with _opened(path) as container:
        yield from _decoded(container, _stream(container, number), _Sent())


def _some(path: Path, number: int, wanted: list[int]) -> Iterator[tuple[int, Any]]:
    """(PTS in ns, frame) of the pictures at the times `wanted`, ascending; those that are not there are left out."""
    with _opened(path) as container, _opened(path) as scout:
        stream, looking = _stream(container, number), _stream(scout, number)
        if _is_numbered(container, stream):
            chosen = set(wanted)
            yield from ((at, frame) for at, frame in _decoded(container, stream, _Sent()) if at in chosen)
            return
        frames, frame = _decoded(container, stream, _Sent()), None
        at = _ns(stream.start_time or 0, stream.time_base) - 1
        for target in wanted:
            if target - at > NEAR_NS:
                key = _key_before(scout, looking, target)
                if key is not None and key > at:
                    frames = _from_key(container, stream, key)
            while at < target:
                at, frame = next(frames, BEYOND)
            if at == target:
                yield target, frame
            else:
                yield from _from_the_beginning(path, number, target)


def _from_the_beginning(path: Path, number: int, target_ns: int) -> Iterator[tuple[int, Any]]:
    """The picture at a time, if there is one: after a seek some files miss pictures that are there in order."""
    for at, frame in _all(path, number):
        if at >= target_ns:
            yield from [(at, frame)] if at == target_ns else []
            return


def _key_before(container: Any, stream: Any, target_ns: int) -> int | None:
    """PTS (ns) of the last key frame shown by `target_ns` that a seek finds; None: the beginning."""
    first_ns = _ns(stream.start_time or 0, stream.time_base)
    back = 0.0
    while True:
        aim_ns = target_ns - round(1e9 * back)
        if aim_ns <= first_ns:
            return None
        container.seek(_pts(aim_ns, stream.time_base), stream=stream)
        packet = next((one for one in container.demux(stream) if one.size and one.pts is not None), None)
        if packet is not None and _ns(packet.pts, stream.time_base) <= target_ns and packet.is_keyframe:
            return _ns(packet.pts, stream.time_base)
        back = 2 * back or FIRST_BACK_S


def _from_key(container: Any, stream: Any, key_ns: int) -> Iterator[tuple[int, Any]]:
    """The pictures from where a key frame is. Those shown before it lack what they are made of; nobody wants them."""
    container.seek(_pts(key_ns, stream.time_base), stream=stream)
    return _decoded(container, stream, _Sent())


def _decoded(container: Any, stream: Any, sent: _Sent) -> Iterator[tuple[int, Any]]:
    """(PTS in ns, frame) of all pictures from where the container is; `sent` is told what the file gave."""
    order = iter(_sorted_pts(container, stream)) if _is_numbered(container, stream) else None
    for frame in _frames(container, stream, sent):
        pts = frame.pts if order is None else next(order, None)
        if pts is None:
            raise ValueError("its pictures have no times; `ffmpeg -i <video> -c copy <new>.mkv` may give them some")
        yield _ns(pts, stream.time_base), frame


def _frames(container: Any, stream: Any, sent: _Sent) -> Iterator[Any]:
    import av

    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets, None)
        except av.FFmpegError:
            packet, sent.broken = None, True
        if packet is None:
            break
        if packet.size:
            sent.count += 1
            if packet.pts is not None and not packet.is_discard:
                sent.pts_ns.add(_ns(packet.pts, stream.time_base))
        if packet.is_corrupt:
            # the file ends within it
            sent.broken = True
            continue
        try:
            found = packet.decode()
        except av.FFmpegError:
            continue
        yield from (frame for frame in found if not frame.is_corrupt)
    if sent.broken:
        try:
            rest = stream.decode(None)
        except (av.FFmpegError, EOFError):
            return
        yield from (frame for frame in rest if not frame.is_corrupt)


def _is_numbered(container: Any, stream: Any) -> bool:
    """Whether the times of packets are not those of their pictures: AVI has one time, in the order of decoding."""
    return container.format.name == "avi" and bool(stream.codec_context.has_b_frames)


def _sorted_pts(container: Any, stream: Any) -> list[int]:
    """Times of all packets, ascending: the n-th is that of the n-th picture shown."""
    found = sorted(packet.pts for packet in container.demux(stream) if packet.size and packet.pts is not None)
    container.seek(0)
    return found


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """PyAV's container. Raises ValueError, and DiorError where PyAV is missing."""
    try:
        import av
    except ImportError:
        raise DiorError(f"{path}: a video needs PyAV; install it: pip install -e '.[video]'") from None
    av.logging.set_level(None)
    try:
        with av.open(str(path), metadata_errors="ignore") as container:
            yield container
    except av.FFmpegError as error:
        raise ValueError(error.strerror or type(error).__name__) from None


def _streams(container: Any) -> list[Any]:
    from av.stream import Disposition

    return [one for one in container.streams.video if not one.disposition & Disposition.attached_pic]


def _stream(container: Any, number: int) -> Any:
    there = _streams(container)
    if number >= len(there):
        count = many(len(there), "video stream")
        raise DiorError(
            f"{container.name}: it has {count}, and no video{number}; `video.stream` in the camera's YAML counts from 0"
        )
    stream = there[number]
    if stream.codec_context is None or not stream.time_base:
        raise ValueError("its codec is not known, or its times have no unit")
    stream.thread_type = "AUTO"
    # Snakemake says by this variable how many cores a job has; 0 is all
    stream.codec_context.thread_count = int(os.environ.get("OMP_NUM_THREADS") or 0)
    return stream


def _about(container: Any, stream: Any) -> int:
    """About how many pictures a stream has that does not count them, by the length of the file."""
    seconds, rate = (container.duration or 0) / 1e6, stream.average_rate or stream.guessed_rate or 0
    return round(seconds * float(rate))


def is_stream(topic: str) -> bool:
    """Whether a topic of the table `frames` is one of a video."""
    try:
        return _stream_of(topic)[0] >= 0
    except ValueError:
        return False


def is_stored(topic: str) -> bool:
    """Whether it stands for pictures as the decoder gives them, and not as they are shown."""
    return _stream_of(topic)[1]


def _stream_of(topic: str) -> tuple[int, bool]:
    """The number of the stream that a topic names, and whether its stored frame is meant. Raises ValueError."""
    name, _, frame = topic.strip("/").partition("/")
    digits = name.removeprefix("video")
    if not digits.isdigit() or name == digits or frame not in ("", STORED):
        raise ValueError(f"there is no {topic} in a video; its streams are video0, video1, ...")
    return int(digits), frame == STORED


def _quarters(frame: Any) -> int:
    """By how many quarter turns counterclockwise a frame is to be shown. Raises ValueError for other turns."""
    if frame.rotation % 90:
        raise ValueError(f"its pictures are to be turned by {frame.rotation} degrees, which is no quarter turn")
    return (frame.rotation // 90) % 4


def _to_bgr(frame: Any) -> NDArray[np.uint8]:
    found: NDArray[np.uint8] = frame.to_ndarray(format="bgr24")
    return found


def _ns(pts: int, time_base: Fraction) -> int:
    numerator, denominator = time_base.numerator * 10**9, time_base.denominator
    return (2 * pts * numerator + denominator) // (2 * denominator)


def _pts(ns: int, time_base: Fraction) -> int:
    """The last time of a file's ticks that is not after `ns`, rounded as `_ns` does."""
    return (2 * ns + 1) * time_base.denominator // (2 * time_base.numerator * 10**9)
