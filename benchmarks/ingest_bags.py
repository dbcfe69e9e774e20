"""How fast bags are indexed, each format beside the limit that the same run measures on the same bytes.

The pictures of real_outdoor, four times over, 200 MB, as every format holds them; the files are cached, and the best
of five runs counts (of bz2: the only one). Without that recording: noise of the same size.
"""

import math
import resource
import shutil
import subprocess
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

from dior.ingest import bags, containers

RUNS = 5
REPEAT = 4
NOISE_MESSAGES, NOISE_BYTES = 400, 134_000
KIND = "sensor_msgs/msg/CompressedImage"
JPEG_HEAD = bytes.fromhex("ffd8ffc0001108078004400301220002110103110100")
# per format: rosbags' storage and compression mode, or ROS 1's codec
ROS1 = {"ROS 1": None, "ROS 1 lz4": "LZ4", "ROS 1 bz2": "BZ2"}
ROS2 = {
    "ROS 2 db3": ("SQLITE3", "NONE"),
    "ROS 2 db3, zstd messages": ("SQLITE3", "MESSAGE"),
    "ROS 2 db3, zstd file": ("SQLITE3", "FILE"),
    "ROS 2 mcap": ("MCAP", "NONE"),
    "ROS 2 mcap, zstd chunks": ("MCAP", "STORAGE"),
}


def seconds(job, runs=RUNS):
    """(processor time, clock) of a job and its children, the shortest of some runs.

    What else runs on the machine counts little in the first, which the ratio is of.
    """
    taken = []
    for _ in range(runs):
        begun = time.perf_counter(), processor()
        job()
        taken.append((processor() - begun[1], time.perf_counter() - begun[0]))
    return tuple(min(times) for times in zip(*taken, strict=True))


def processor():
    """Processor time of this process and of its children that have ended, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def print_bags(data):
    """Print the speed of indexing bags of every format, per byte of file. `data`: the folder of real_outdoor."""
    with tempfile.TemporaryDirectory() as folder:
        _print_bags(data, Path(folder))


def _print_bags(data, folder):
    messages = recorded(data) if data.is_dir() else noise()
    print(f"bags of {len(messages)} pictures from {data.name if data.is_dir() else 'noise'}, files in the cache")
    print(f"{'MB/s':26}{'MB':>5}{'per core':>10}{'clock':>8}{'limit per core':>16}{'ratio':>7}  the limit")
    for name in (*ROS1, *ROS2):
        bag = write_bag(folder / name.replace(" ", "_").replace(",", ""), name, messages)
        files = [bag] if bag.is_file() else sorted(file for file in bag.iterdir() if file.name != "metadata.yaml")
        size = sum(file.stat().st_size for file in files) / 1e6
        topics = list(bags.topics_of(bag))
        runs = 1 if "bz2" in name else RUNS
        taken, clock = seconds(partial(index_afresh, bag, topics), runs)
        text, limit = limit_of(name, bag, files, runs)
        speeds = f"{size / taken:10.0f}{size / clock:8.0f}{size / limit:16.0f}{limit / taken:7.2f}"
        print(f"{name:26}{size:5.0f}{speeds}  {text}", flush=True)
        for file in files:
            file.unlink()


def index_afresh(bag, topics):
    """What the step `frames` does with a bag, as a process of its own would."""
    containers._unpacked_folder.cache_clear()
    found = bags.index(bag, topics)
    assert len(found["topic"]) == sum(count for _, count in bags.topics_of(bag).values())


def limit_of(name, bag, files, runs):
    """(what cannot be beaten, its seconds): the codec alone on the same bytes, or reading them."""
    if name == "ROS 1 bz2":
        if not shutil.which("bzip2"):
            return "bzip2 is not installed", math.nan
        streams = bag.with_suffix(".bz2")
        streams.write_bytes(b"".join(chunks_of(bag)))
        taken, _ = seconds(partial(subprocess.run, ["bzip2", "-dc", streams], stdout=subprocess.DEVNULL), runs)
        streams.unlink()
        return "bzip2 -dc of the chunks", taken
    if name == "ROS 1 lz4":
        import lz4.frame

        chunks = chunks_of(bag)
        return "lz4.frame of the chunks, in memory", seconds(lambda: [len(lz4.frame.decompress(c)) for c in chunks])[0]
    if "zstd" in name:
        return "rosbags' own reader, whole messages", seconds(partial(read_with_rosbags, bag))[0]
    return "reading the file (1 MB pieces)", seconds(lambda: [read_through(file) for file in files])[0]


def chunks_of(bag):
    """The compressed chunks of a ROS 1 bag."""
    from rosbags.rosbag1 import Reader

    with Reader(bag) as reader, open(bag, "rb") as stream:
        return [stream.seek(c.datapos) and stream.read(c.datasize) for c in reader.chunks.values()]


def read_with_rosbags(bag):
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        for _ in reader.messages():
            pass


def read_through(path):
    buffer = bytearray(1 << 20)
    with open(path, "rb", buffering=0) as stream:
        while stream.readinto(buffer):
            pass


def recorded(data):
    """Messages of the real pictures as (topic, stamp ns, JPEG), repeated one recording after the other."""
    from rosbags.highlevel import AnyReader

    with AnyReader([data / "pc1.bag", data / "pc2.bag"]) as reader:
        wanted = [c for c in reader.connections if c.msgtype == KIND]
        messages = [(c.topic, stamp, reader.deserialize(raw, KIND).data) for c, stamp, raw in reader.messages(wanted)]
    span = messages[-1][1] - messages[0][1] + 10**7
    return [(topic, stamp + i * span, jpeg) for i in range(REPEAT) for topic, stamp, jpeg in messages]


def noise():
    """The same with bytes that look like JPEG to a compressor."""
    rng = np.random.default_rng(0)
    body = [rng.integers(0, 256, NOISE_BYTES, dtype=np.uint8) for _ in range(NOISE_MESSAGES)]
    jpegs = [np.concatenate([np.frombuffer(JPEG_HEAD, np.uint8), one]) for one in body]
    topics = [f"/cam{i:02d}/image_raw/compressed" for i in (1, 2, 3, 4)]
    first, step = 1_708_000_000_000_000_000, 4_000_000
    return [(topics[i % 4], first + i * step, jpegs[i % len(jpegs)]) for i in range(REPEAT * len(jpegs))]


def write_bag(path, name, messages):
    """Write (topic, stamp ns, JPEG) messages in one of the formats; returns the bag."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if name in ROS1 else Stores.ROS2_HUMBLE)
    types, wire = store.types, store.serialize_ros1 if name in ROS1 else store.serialize_cdr
    seq = {"seq": 0} if name in ROS1 else {}
    if name in ROS1:
        path = path.with_suffix(".bag")
        writer = rosbag1.Writer(path)
        if ROS1[name]:
            writer.set_compression(rosbag1.Writer.CompressionFormat[ROS1[name]])
    else:
        storage, mode = ROS2[name]
        writer = rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin[storage])
        writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, stamp, jpeg in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, KIND, typestore=store)
            time_ = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
            header = types["std_msgs/msg/Header"](**seq, stamp=time_, frame_id="lens")
            message = types[KIND](header=header, format="jpeg", data=jpeg)
            writer.write(connections[topic], stamp, bytes(wire(message, KIND)))
    return path
