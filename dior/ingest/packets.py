"""Pictures that image_transport's plugins ffmpeg and theora put into a bag: each message is a packet of a video.

INPUTS   messages `ffmpeg_image_transport_msgs/FFMPEGPacket` and `theora_image_transport/Packet` of ROS 1 or ROS 2, in
         the order of the bag
OUTPUTS  `bag_reader.Message`s with decoded pictures (`messages.PICTURE`), the packet's header stamp and receive stamp
Sources: ffmpeg_image_transport 1.x and 2.x and ffmpeg_encoder_decoder (ros-misc-utilities), FFMPEGPacket.msg of both. A
packet holds one picture; `encoding` begins with the encoder's name, such as libx264 or hevc_nvenc; `pts` counts the
pictures; bit 1 of `flags` is a key frame, which has the stream's parameters in it. There are no B-frames.
theora_image_transport (image_transport_plugins, theora_publisher.cpp) and the Theora specification, 6.1 and 7.1: three
packets with headers come first, under the first picture's stamp, and once more for each subscriber of ROS 1; of the
first byte bit 7 is a header, bit 6 no key frame; an empty packet is the picture before again; `packetno` counts. Its
pictures use all of 0 to 255.

What cannot be decoded gives no picture: packets before the first key frame of a recording, and those from a lost,
damaged or overtaken one, or an empty one of ffmpeg's, to the next key frame, for the decoder would make up what they
are made of. A count that steps by more than 1 may be one of which packets were dropped (`topic_tools drop`), so key
frames alone are read then. A packet that comes twice counts once.
"""

import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.ingest import messages
from dior.ingest.bag_reader import Lost, Message
from dior.ingest.videos import DecodedPicture

KINDS = (messages.PACKET, messages.THEORA)
# FFmpeg's decoders by what the names of encoders have in them
CODECS = {"264": "h264", "265": "hevc", "hevc": "hevc", "av1": "av1", "vp9": "vp9", "vpx": "vp8", "mjpeg": "mjpeg"}
# FFmpeg's own decoder of AV1 needs a graphics card; this one may give a picture only after some more packets
SOFTWARE, AT_ONCE = {"av1": "libdav1d"}, {"av1": {"max_frame_delay": "1"}}
KEY = 1
# of the first byte of Theora's packets; its headers; FFmpeg's word for pictures that use all of 0 to 255
IS_HEADER, NO_KEY, HEADERS, FULL_RANGE = 0x80, 0x40, 3, 2
# of H.264 and HEVC: a count that goes back by more is that of an encoder that began anew
MOST_REORDERED = 16
# chosen: B-frames make every third step go back or more, a network that lets a packet overtake another one of many
MOST_BACK = 1 / 8
# why packets give no picture
EARLY, HEADLESS = "before a key frame", "without theora's three headers before them"
MISSING = "behind packets that are missing by their count (`pts`), up to the next key frame"
BACK = "behind one that another overtook, up to the next key frame"
DAMAGED = "in or behind a damaged packet, up to the next key frame"
REPUBLISH = (
    "play the bag beside `ros2 run image_transport republish`, from its transport to compressed, and record the topic "
    "that this publishes"
)


@dataclass(frozen=True, eq=False)
class _Packet:
    """`number`: counted from picture to picture; `is_key`: nothing before it is needed; `data`: empty for the picture
    before once more; `header` of the message."""

    number: int
    is_key: bool
    data: bytes
    header: Any


@dataclass
class Unpacker:
    """Decodes the packets of a bag's topics; only the pictures `received` then (ns) are given, all where it is None.
    Then `lost` is told which packets gave none."""

    bag: AnyPath
    received: Collection[int] | None
    lost: list[Lost] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._streams: dict[str, _Stream] = {}

    def given(self, message: Message) -> Iterator[Message]:
        """The pictures that are there when the bag's next packet is. Raises DiorError for a codec, and for a message
        that is no packet."""
        try:
            content = messages.decoded(message.kind, message.raw, message.wire)
        except ValueError as error:
            raise DiorError(
                f"{self.bag}: the message of {message.topic} received at {message.receive_ns} ns is no {message.kind} "
                f"({error}); was something of another type recorded under this topic? Else copy the bag again"
            ) from None
        stream = self._streams.setdefault(message.topic, _Stream(f"{self.bag}: {message.topic}"))
        data = content.data.tobytes()
        if message.kind == messages.PACKET:
            yield from stream.coded(_codec(content.encoding, stream.where))
            packet = _Packet(content.pts, bool(content.flags & KEY), data, content.header)
        elif data and data[0] & IS_HEADER:
            yield from stream.headed(data)
            return
        else:
            packet = _Packet(content.packetno, bool(data and not data[0] & NO_KEY), data, content.header)
        yield from stream.given(message, packet, self.received is None or message.receive_ns in self.received)
        self._told(message.topic, stream)

    def rest(self) -> Iterator[Message]:
        """What is left when the bag ends. Raises DiorError for a topic of which nothing could be decoded."""
        for topic, stream in self._streams.items():
            yield from stream.ended()
            self._told(topic, stream)
            if stream.back > MOST_BACK * stream.count:
                raise DiorError(
                    f"{stream.where}: its packets are in another order than its pictures (B-frames), which the "
                    f"transport ffmpeg does not make; {REPUBLISH}"
                )
            if self.received is None and not stream.shown:
                needs = f"a key frame of {stream.codec}, as its encoding says"
                if not stream.codec:
                    needs = "a key frame" + (", and theora's three headers before it" if not stream.decoder else "")
                raise DiorError(
                    f"{stream.where}: no picture can be decoded from its {stream.count} packets; a recording must hold "
                    f"{needs}"
                )

    def _told(self, topic: str, stream: "_Stream") -> None:
        if self.received is None:
            self.lost += [(topic, messages.stamp_ns(packet), why) for packet, why in stream.lost]
        stream.lost.clear()


@dataclass
class _Stream:
    """The decoder of a topic; `where` it is, for messages; its `codec`, "" of Theora, whose `headers` by their
    first byte have come.

    `sent`: message and packet by the number of one whose picture has not come; `waiting`: packets since the key frame
    that nobody wanted so far; `whole`: none is missing since then, else `why`; `last`: number, stamp and data of the
    packet before; `back`: how many went back behind it; `lost`: those that give no picture, and why; `frame`: the last
    one.
    """

    where: str
    decoder: Any = None
    codec: str = ""
    headers: dict[int, bytes] = field(default_factory=dict)
    count: int = 0
    shown: int = 0
    whole: bool = False
    why: str = EARLY
    last: tuple[int, int, bytes] = (-1, 0, b"")
    back: int = 0
    sent: dict[int, tuple[Message, _Packet]] = field(default_factory=dict)
    waiting: list[tuple[int, _Packet]] = field(default_factory=list)
    lost: list[tuple[_Packet, str]] = field(default_factory=list)
    frame: Any = None

    def coded(self, codec: str) -> Iterator[Message]:
        """Packets of FFmpeg's `codec` follow: where it is another one than before, with a decoder of its own."""
        if codec != self.codec:
            yield from self.ended()
            self.decoder, self.codec = _decoder(codec, self.where), codec
            self._broken(EARLY)

    def headed(self, data: bytes) -> Iterator[Message]:
        """One of Theora's headers; with the third there is a decoder for what follows. One that is sent again says
        nothing."""
        kind = data[0]
        if self.headers.get(kind) == data:
            return
        yield from self.ended()
        self.decoder = None
        self._broken(HEADLESS)
        # the first one's are others
        self.headers = {kind: data} if kind == IS_HEADER else self.headers | {kind: data}
        if len(self.headers) == HEADERS:
            self.decoder = _decoder("theora", self.where)
            in_order = [self.headers[key] for key in sorted(self.headers)]
            self.decoder.extradata = b"".join(len(one).to_bytes(2, "big") + one for one in in_order)
            self._broken(EARLY)

    def _broken(self, why: str) -> None:
        """What follows cannot be decoded up to the next key frame."""
        self.whole, self.why = False, why

    def given(self, message: Message, packet: _Packet, wanted: bool) -> Iterator[Message]:
        here, (last, *_) = (packet.number, messages.stamp_ns(packet), packet.data), self.last
        if here == self.last:
            return
        if packet.is_key:
            yield from self.ended()
            self.whole = self.decoder is not None
        elif last - MOST_REORDERED <= packet.number < last:
            self.back += 1
            self._broken(BACK)
        elif packet.number != last + 1 and self.whole:
            self._broken(MISSING)
        self.last = here
        self.count += 1
        if not self.whole:
            self.lost.append((packet, self.why))
            return
        self.waiting.append((self.count, packet))
        if wanted:
            self.sent[self.count] = message, packet
            for number, one in self.waiting:
                yield from self._decoded(number, one)
            self.waiting = []

    def _decoded(self, number: int, packet: _Packet) -> Iterator[Message]:
        import av

        if not self.whole:
            return
        if not packet.data and self.codec:
            self._broken(DAMAGED)
            return
        if not packet.data:
            yield from self._shown(number, self.frame)
            return
        one = av.Packet(packet.data)
        # the stream's own count begins anew where its encoder did
        one.pts = one.dts = number
        try:
            frames = self.decoder.decode(one)
        except av.FFmpegError:
            self._broken(DAMAGED)
            return
        for frame in frames:
            yield from self._shown(frame.pts, frame)

    def ended(self) -> Iterator[Message]:
        """The pictures that the decoder still holds before the next key frame."""
        import av

        self.waiting = []
        if self.decoder is not None:
            try:
                for frame in self.decoder.decode(None):
                    yield from self._shown(frame.pts, frame)
            except (av.FFmpegError, EOFError):
                pass
            self.decoder.flush_buffers()
        self.lost += [(packet, DAMAGED) for _, packet in self.sent.values()]
        self.sent = {}

    def _shown(self, number: int, frame: Any) -> Iterator[Message]:
        if frame is None or frame.is_corrupt:
            self._broken(DAMAGED)
            return
        self.frame = frame
        if number in self.sent and self.whole:
            message, packet = self.sent.pop(number)
            if message.kind == messages.THEORA:
                frame.color_range = FULL_RANGE
            self.shown += 1
            picture = DecodedPicture(frame, 0, header=packet.header)
            yield Message(message.topic, messages.RAW, messages.PICTURE, message.receive_ns, picture)


def _codec(encoding: str, where: str) -> str:
    """FFmpeg's name of what an encoder made. Raises DiorError for one that is not known."""
    encoder, *formats = encoding.split(";")
    name = next((codec for part, codec in CODECS.items() if part in encoder.lower()), "")
    if not name or any(one.startswith("bayer") for one in formats[1:2]):
        raise DiorError(
            f"{where}: its encoding is '{encoding:.80}', and pictures by {', '.join(sorted(set(CODECS.values())))} are "
            f"read, none of a sensor's colour filter; {REPUBLISH}"
        )
    return name


def _decoder(codec: str, where: str) -> Any:
    try:
        import av
    except ImportError:
        raise DiorError(f"{where}: packets of a video need PyAV; install it: pip install -e '.[video]'") from None
    decoder = av.CodecContext.create(SOFTWARE.get(codec, codec), "r")
    decoder.options = AT_ONCE.get(codec, {})
    av.logging.set_level(None)
    # a picture's slices: whole pictures at once would come later by as many as there are threads
    decoder.thread_type = "SLICE"
    # as for videos
    decoder.thread_count = int(os.environ.get("OMP_NUM_THREADS") or 0)
    return decoder
