"""One tiny capture written in every format that a recorder has, with the writers of rosbags."""

import struct
from dataclasses import dataclass, field
from fractions import Fraction

import cv2
import lz4.frame
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.ingest import theora_sample

T0 = 1_708_000_000_000_000_000
IMAGE, PACKED, INFO = (f"sensor_msgs/msg/{kind}" for kind in ("Image", "CompressedImage", "CameraInfo"))
STORES = {"ros1": get_typestore(Stores.ROS1_NOETIC), "cdr": get_typestore(Stores.ROS2_HUMBLE)}
# as ffmpeg_image_transport_msgs of ROS 1 and of ROS 2 have it
PACKET = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"
OF_PACKET = {
    "ros1": "Header header\nuint8[] data\nint32 img_width\nint32 img_height\nstring encoding\nuint64 pts\n"
    "uint8 flags\n",
    "cdr": "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\n"
    "bool is_bigendian\nuint8[] data\n",
}
THEORA = "theora_image_transport/msg/Packet"
OF_THEORA = "std_msgs/Header header\nuint8[] data\nint32 b_o_s\nint32 e_o_s\nint64 granulepos\nint64 packetno\n"
for wire, definition in OF_PACKET.items():
    STORES[wire].register({**get_types_from_msg(definition, PACKET), **get_types_from_msg(OF_THEORA, THEORA)})
ROS1_CODECS = {"": None, "lz4": rosbag1.Writer.CompressionFormat.LZ4, "bz2": rosbag1.Writer.CompressionFormat.BZ2}
# name of a format: (rosbags' storage, compression mode)
ROS2 = {
    "db3": ("SQLITE3", "NONE"),
    "db3 message": ("SQLITE3", "MESSAGE"),
    "db3 file": ("SQLITE3", "FILE"),
    "mcap": ("MCAP", "NONE"),
    "mcap zstd": ("MCAP", "STORAGE"),
    "mcap lz4": ("MCAP", "STORAGE"),
    "mcap message": ("MCAP", "MESSAGE"),
    "mcap file": ("MCAP", "FILE"),
}
# as `ros2 bag record` of Jazzy and later has them: metadata of version 9 with the types' hashes, custom data and the
# distribution's name
NEWER = {"db3 9": "db3", "mcap 9": "mcap", "mcap zstd 9": "mcap zstd"}
SINGLE = {"db3 alone": "db3", "mcap alone": "mcap", "db3 zstd alone": "db3 file", "db3 message alone": "db3 message"}
FORMATS = ("ros1", "ros1 lz4", "ros1 bz2", *ROS2, *SINGLE, *NEWER, "mcap plain", "mcap ros1")


@dataclass(frozen=True)
class Sent:
    """A message as the camera published it: `content` holds the fields but the header, in ROS 2's spelling."""

    topic: str
    receive_ns: int
    stamp_ns: int
    kind: str
    content: dict = field(default_factory=dict)


def picture(grey, size=(48, 64)):
    """A picture (height, width, 3) whose left half is `grey` and whose right half is black, red highest."""
    image = np.zeros((*size, 3), np.uint8)
    image[:, : size[1] // 2] = (grey, grey, min(255, grey + 20))
    return image


def encoded(image, suffix=".png"):
    return cv2.imencode(suffix, image)[1].ravel()


def packed(topic, stamp_ns, image, suffix=".png", delay=4_000_000):
    content = {"format": "x", "data": encoded(image, suffix)}
    return Sent(topic, stamp_ns + delay, stamp_ns, PACKED, content)


def raw(topic, stamp_ns, pixels, encoding, padding=0, bigendian=0, delay=4_000_000):
    """An Image of `pixels` (height, width, bytes per pixel) with `padding` bytes at the end of each row."""
    height, width, _ = pixels.shape
    rows = np.concatenate([pixels.reshape(height, -1), np.full((height, padding), 77, np.uint8)], axis=1)
    content = {"height": height, "width": width, "encoding": encoding, "is_bigendian": bigendian}
    content |= {"step": rows.shape[1], "data": rows.ravel()}
    return Sent(topic, stamp_ns + delay, stamp_ns, IMAGE, content)


def info(topic, stamp_ns, d=(0.1, -0.2, 0.001, 0.002, 0.05), model="plumb_bob", size=(48, 64), delay=4_000_000):
    content = {"height": size[0], "width": size[1], "distortion_model": model, "d": np.array(d, float)}
    content |= {"k": np.array([600.0, 0, 31.5, 0, 601.0, 24.25, 0, 0, 1]), "r": np.eye(3).ravel(), "p": np.zeros(12)}
    return Sent(topic, stamp_ns + delay, stamp_ns, INFO, content | {"binning_x": 0, "binning_y": 0})


def packets(topic, stamps_ns, images, encoder="libx264", gop=5, b_frames=0, delay=4_000_000):
    """The packets that ffmpeg_image_transport makes of `images` (height, width, 3), in the order of the encoder."""
    import av

    context = av.CodecContext.create(encoder, "w")
    context.height, context.width = images[0].shape[:2]
    context.pix_fmt, context.time_base, context.gop_size = "yuv420p", Fraction(1, 100), gop
    context.max_b_frames = b_frames
    # no key frames but those of the group, though the pictures differ
    context.options = {"crf": "4", "sc_threshold": "0", "x265-params": "log-level=none"}
    made = []
    for pts, image in [*enumerate(images), (-1, None)]:
        frame = None if image is None else av.VideoFrame.from_ndarray(image, "bgr24")
        if frame is not None:
            frame.pts = pts
        made += context.encode(frame)
    size = {"width": context.width, "height": context.height}
    return [
        Sent(
            topic,
            stamps_ns[place] + delay,
            stamps_ns[one.pts],
            PACKET,
            size | {"encoding": encoder, "pts": one.pts, "flags": int(one.is_keyframe), "is_bigendian": False}
            | {"data": np.frombuffer(bytes(one), np.uint8)},
        )
        for place, one in enumerate(made)
    ]  # fmt: skip


def theora(topic, stamps_ns, delay=4_000_000):
    """The packets of the sample as theora_image_transport sends them: the headers under the first picture's stamp."""
    found = []
    for number, data in enumerate(theora_sample.packets()):
        stamp_ns = stamps_ns[max(number - 3, 0)]
        content = {"b_o_s": int(number == 0), "e_o_s": 0, "granulepos": 0, "packetno": number}
        content |= {"data": np.frombuffer(data, np.uint8)}
        found.append(Sent(topic, stamp_ns + delay, stamp_ns, THEORA, content))
    return found


def _fields(sent, wire):
    """The fields of a message but its header."""
    if sent.kind != PACKET or wire != "ros1":
        return sent.content
    named = {"width": "img_width", "height": "img_height"}
    return {named.get(key, key): value for key, value in sent.content.items() if key != "is_bigendian"}


def serialized(sent, wire, little_endian=True, frame_id="lens"):
    types = STORES[wire].types
    stamp = types["builtin_interfaces/msg/Time"](sec=sent.stamp_ns // 10**9, nanosec=sent.stamp_ns % 10**9)
    seq = {"seq": 0} if wire == "ros1" else {}
    content = {"header": types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id=frame_id), **_fields(sent, wire)}
    if sent.kind == INFO:
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False} | content.get("roi", {})
        content["roi"] = types["sensor_msgs/msg/RegionOfInterest"](**roi)
    if wire == "ros1":
        message = types[sent.kind](**{k.upper() if k in "dkrp" else k: v for k, v in content.items()})
        return bytes(STORES[wire].serialize_ros1(message, sent.kind))
    message = types[sent.kind](**content)
    return bytes(STORES[wire].serialize_cdr(message, sent.kind, little_endian=little_endian))


def write(path, messages, form, little_endian=True, chunk=1 << 20):
    """Write the messages below `path` (no suffix) in one of FORMATS; returns the path of the bag: a file or folder."""
    if form.startswith("ros1"):
        return _write_ros1(path.with_suffix(".bag"), messages, ROS1_CODECS[form[5:]], chunk)
    if form in ("mcap plain", "mcap ros1"):
        return write_plain_mcap(path.with_suffix(".mcap"), messages, "ros1" if form == "mcap ros1" else "cdr")
    storage, mode = ROS2[(SINGLE | NEWER).get(form, form)]
    writer = rosbag2.Writer(path, version=9 if form in NEWER else 8, storage_plugin=rosbag2.StoragePlugin[storage])
    writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    if form in NEWER:
        writer.set_custom_data("operator", "S01: walk\n- 1")
    with writer:
        if form == "mcap lz4":
            writer.storage.compression, writer.storage.compressor = "lz4", lz4.frame.compress
        connections = {}
        for sent in messages:
            if sent.topic not in connections:
                connections[sent.topic] = writer.add_connection(sent.topic, sent.kind, typestore=STORES["cdr"])
            writer.write(connections[sent.topic], sent.receive_ns, serialized(sent, "cdr", little_endian))
    if form not in SINGLE:
        return path
    (file,) = (file for file in path.iterdir() if file.name != "metadata.yaml")
    return file


def _write_ros1(path, messages, codec, chunk):
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = chunk
    if codec:
        writer.set_compression(codec)
    with writer:
        connections = {}
        for sent in messages:
            if sent.topic not in connections:
                connections[sent.topic] = writer.add_connection(sent.topic, sent.kind, typestore=STORES["ros1"])
            writer.write(connections[sent.topic], sent.receive_ns, serialized(sent, "ros1"))
    return path


def write_plain_mcap(path, messages, wire):
    """An MCAP file without chunks, summary or statistics, as a recorder writes that is short of time."""
    magic = b"\x89MCAP0\r\n"
    parts, channels = [magic, _record(1, _text("ros2") + _text("test"))], {}
    for sent in messages:
        if sent.topic not in channels:
            number = channels[sent.topic] = len(channels) + 1
            kind = sent.kind.replace("/msg/", "/") if wire == "ros1" else sent.kind
            parts.append(_record(3, struct.pack("<H", number) + _text(kind) + _text("ros2msg") + _text("")))
            parts.append(_record(4, struct.pack("<HH", number, number) + _text(sent.topic) + _text(wire) + _text("")))
        header = struct.pack("<HIQQ", channels[sent.topic], 0, sent.receive_ns, sent.receive_ns)
        parts.append(_record(5, header + serialized(sent, wire)))
    path.write_bytes(b"".join([*parts, _record(15, bytes(4)), _record(2, bytes(20)), magic]))
    return path


def _record(op, content):
    return struct.pack("<BQ", op, len(content)) + content


def _text(text):
    return struct.pack("<I", len(text)) + text.encode()
