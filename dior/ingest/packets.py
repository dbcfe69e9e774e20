"""Pictures that image_transport's plugin ffmpeg put into a bag: each message is a packet of a video.

INPUTS   messages `ffmpeg_image_transport_msgs/FFMPEGPacket` of ROS 1 or ROS 2, in the order of the bag
OUTPUTS  `bag_reader.Message`s with decoded pictures (`messages.PICTURE`), the packet's header stamp and receive stamp
Sources: ffmpeg_image_transport 1.x and 2.x and ffmpeg_encoder_decoder (ros-misc-utilities), FFMPEGPacket.msg of both. A
packet holds one picture; `encoding` begins with the encoder's name, such as libx264 or hevc_nvenc; `pts` counts the
pictures; bit 1 of `flags` is a key frame, which has the stream's parameters in it. There are no B-frames.

What cannot be decoded gives no picture: packets before the first key frame of a recording, and those from a lost or
damaged one to the next key frame, for the decoder would make up what they are made of.
"""

import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.ingest import messages
from dior.ingest.bag_reader import Message
from dior.ingest.videos import DecodedPicture

# FFmpeg's decoders by what the names of encoders have in them
CODECS = {"264": "h264", "265": "hevc", "hevc": "hevc", "av1": "av1", "vp9": "vp9", "vpx": "vp8", "mjpeg": "mjpeg"}
KEY = 1
REPUBLISH = (
    "play the bag beside `ros2 run image_transport republish`, from the transport ffmpeg to compressed, and record the "
    "topic that this publishes"
)


@dataclass
class Unpacker:
    """Decodes the packets of a bag's topics; only the pictures `received` then (ns) are given, all where it is None."""

    bag: AnyPath
    received: Collection[int] | None

    def __post_init__(self) -> None:
        self._streams: dict[str, _Stream] = {}

    def given(self, message: Message) -> Iterator[Message]:
        """The pictures that are there when the bag's next packet is. Raises ValueError, and DiorError for a codec."""
        packet = messages.decoded(message.kind, message.raw, message.wire)
        if message.topic not in self._streams:
            where = f"{self.bag}: {message.topic}"
            self._streams[message.topic] = _Stream(where, _decoder(packet.encoding, where))
        wanted = self.received is None or message.receive_ns in self.received
        yield from self._streams[message.topic].given(message, packet, wanted)

    def rest(self) -> Iterator[Message]:
        """What is left when the bag ends. Raises DiorError for a topic of which nothing could be decoded."""
        for stream in self._streams.values():
            yield from stream.ended()
            if self.received is None and not stream.shown:
                raise DiorError(
                    f"{stream.where}: no picture can be decoded from its {stream.count} packets; a recording must hold "
                    "a key frame"
                )


@dataclass
class _Stream:
    """The decoder of a topic; `where` it is, for messages. `sent`: message and header by the number of a packet whose
    picture has not come; `waiting`: packets since the key frame that nobody wanted so far; `whole`: none is missing
    since then."""

    where: str
    decoder: Any
    count: int = 0
    shown: int = 0
    whole: bool = False
    last_pts: int = -1
    sent: dict[int, tuple[Message, Any]] = field(default_factory=dict)
    waiting: list[tuple[int, Any]] = field(default_factory=list)

    def given(self, message: Message, packet: Any, wanted: bool) -> Iterator[Message]:
        if packet.flags & KEY:
            yield from self.ended()
            self.whole = True
        elif packet.pts < self.last_pts:
            raise DiorError(
                f"{self.where}: its packets are in another order than its pictures (B-frames), which the transport "
                f"ffmpeg does not make; {REPUBLISH}"
            )
        elif packet.pts != self.last_pts + 1:
            self.whole = False
        self.last_pts = packet.pts
        self.count += 1
        if not self.whole:
            return
        self.waiting.append((self.count, packet))
        if wanted:
            self.sent[self.count] = message, packet.header
            for number, one in self.waiting:
                yield from self._decoded(number, one)
            self.waiting = []

    def _decoded(self, number: int, packet: Any) -> Iterator[Message]:
        import av

        if not self.whole:
            return
        one = av.Packet(packet.data.tobytes())
        # the file's own count begins anew where its encoder did
        one.pts = one.dts = number
        try:
            frames = self.decoder.decode(one)
        except av.FFmpegError:
            self.whole = False
            return
        yield from self._shown(frames)

    def ended(self) -> Iterator[Message]:
        """The pictures that the decoder still holds before the next key frame."""
        import av

        self.waiting = []
        try:
            yield from self._shown(self.decoder.decode(None))
        except (av.FFmpegError, EOFError):
            pass
        self.decoder.flush_buffers()
        self.sent = {}

    def _shown(self, frames: list[Any]) -> Iterator[Message]:
        for frame in frames:
            if frame.is_corrupt:
                self.whole = False
            if frame.pts in self.sent and self.whole:
                message, header = self.sent.pop(frame.pts)
                self.shown += 1
                picture = DecodedPicture(frame, 0, header=header)
                yield Message(message.topic, messages.RAW, messages.PICTURE, message.receive_ns, picture)


def _decoder(encoding: str, where: str) -> Any:
    """The decoder for what an encoder made. Raises DiorError for one that is not known."""
    try:
        import av
    except ImportError:
        raise DiorError(f"{where}: pictures of the transport ffmpeg need PyAV; pip install -e '.[video]'") from None
    encoder, *formats = encoding.split(";")
    name = next((codec for part, codec in CODECS.items() if part in encoder), "")
    if not name or any(one.startswith("bayer") for one in formats[1:2]):
        raise DiorError(
            f"{where}: its encoding is '{encoding:.80}', and pictures by {', '.join(sorted(set(CODECS.values())))} are "
            f"read, none of a sensor's colour filter; {REPUBLISH}"
        )
    decoder = av.CodecContext.create(name, "r")
    av.logging.set_level(None)
    # a picture's slices: whole pictures at once would come later by as many as there are threads
    decoder.thread_type = "SLICE"
    # as for videos
    decoder.thread_count = int(os.environ.get("OMP_NUM_THREADS") or 0)
    return decoder
