"""Small videos, written with PyAV: what a lab's cameras leave, and what is done to files on the way."""

from fractions import Fraction

import numpy as np
import pytest

from dior.ingest import bags
from dior.tables import tables

av = pytest.importorskip("av", reason="pip install -e '.[video]'")

SIZE = (48, 64)
GREYS = 23
TICK = Fraction(1, 90000)
# chosen: nearly no loss, so that a picture's grey is told from its neighbours'
OPTIONS = {"libx264": {"crf": "4"}, "libx265": {"crf": "4", "x265-params": "log-level=none"}}


def grey_of(number):
    """The grey of the left half of the picture `number`, by which it is known again: 8 from that of its neighbours."""
    return 40 + 8 * (number % GREYS)


def numbered(number, size=SIZE):
    """A picture (height, width, 3) BGR of grey `grey_of` with a blue mark in its upper left corner."""
    picture = np.zeros((*size, 3), np.uint8)
    picture[:, : size[1] // 2] = grey_of(number)
    picture[:12, :16] = (255, 0, 0)
    return picture


def write(
    path, pictures, *, times=None, rate=30, codec="libx264", b_frames=2, key_every=10, rotation=0, metadata=None,
    tracks=1, sound=None, options=None, coder=None,
):  # fmt: skip
    """Write the `pictures`, shown at `times` (s), else at `rate`; `tracks`: the same picture in so many streams;
    `sound`: (samples (N,), rate Hz) of an audio track; `options` of the container, `coder` of the codec."""
    pictures = list(pictures)
    times = [Fraction(i, rate) for i in range(len(pictures))] if times is None else times
    tick = Fraction(1, rate) if path.suffix == ".avi" else TICK
    height, width = pictures[0].shape[:2]
    with av.open(str(path), "w", options=options or {}) as container:
        container.metadata.update(metadata or {})
        streams = []
        for _ in range(tracks):
            stream = container.add_stream(codec, rate=rate)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuvj420p" if codec == "mjpeg" else "yuv420p"
            if codec != "mjpeg":
                stream.options = {"bf": str(b_frames), "g": str(key_every), **OPTIONS[codec], **(coder or {})}
            stream.time_base = stream.codec_context.time_base = tick
            if rotation:
                stream.set_display_rotation(rotation)
            streams.append(stream)
        heard = _add_sound(container, sound) if sound is not None else None
        for picture, time in zip(pictures, times, strict=True):
            for stream in streams:
                frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
                frame.pts, frame.time_base = round(Fraction(time) / tick), tick
                container.mux(stream.encode(frame))
        if heard is not None:
            _mux_sound(container, heard, *sound)
        for stream in streams:
            container.mux(stream.encode())


def _add_sound(container, sound):
    stream = container.add_stream("aac", rate=sound[1], layout="mono")
    stream.bit_rate = 128_000
    return stream


def _mux_sound(container, stream, samples, rate):
    for start in range(0, len(samples), 1024):
        block = np.zeros(1024, np.float32)
        block[: len(samples[start : start + 1024])] = samples[start : start + 1024]
        frame = av.AudioFrame.from_ndarray(block[None], format="fltp", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = rate, start, Fraction(1, rate)
        container.mux(stream.encode(frame))
    container.mux(stream.encode())


def from_bags(bag_files, folder, suffix=".mp4", late_s=None, sound_of=None, turned=(), matroska=(), **how):
    """Write the pictures of ROS 1 bags, a video `folder`/<camera><suffix> per topic, each with `<camera>.csv` of the
    header stamps; of topics /<camera>/... . `late_s`: by camera, how much of its beginning is left out; `sound_of`: the
    sound of a camera by its name, its first stamp (ns) and how long it recorded (s); `turned`, `matroska`: cameras
    whose pictures lie and are to be turned, and whose file is Matroska under the same name; `how`: as of `write`.
    Returns by camera the first stamp (ns) and how many pictures are left out."""
    folder.mkdir(parents=True, exist_ok=True)
    first = {}
    for bag in bag_files:
        topics = [name for name, (kind, _) in bags.topics_of(bag).items() if not kind.endswith("CameraInfo")]
        table = bags.index(bag, topics)
        table["bag"] = np.full(len(table["topic"]), bag.name, object)
        for topic in topics:
            camera = topic.strip("/").split("/")[0]
            rows = tables.rows(table, table["topic"] == topic)
            rows = tables.rows(rows, np.argsort(rows["stamp_ns"], kind="stable"))
            kept = rows["stamp_ns"] - rows["stamp_ns"][0] >= 1e9 * (late_s or {}).get(camera, 0.0)
            rows = tables.rows(rows, kept & np.r_[True, np.diff(rows["stamp_ns"]) > 0])
            shown = dict(bags.read_pictures(rows, bag.parent))
            began = int(rows["stamp_ns"][0])
            first[camera] = began, int((~kept).sum())
            times = [Fraction(int(stamp) - began, 10**9) for stamp in rows["stamp_ns"]]
            sound = sound_of(camera, began, float(times[-1])) if sound_of else None
            pictures = [shown[i] for i in range(len(times))]
            if camera in turned:
                pictures = [np.ascontiguousarray(np.rot90(picture, -1)) for picture in pictures]
            path = folder / f"{camera}{'.mkv' if camera in matroska else suffix}"
            write(path, pictures, times=times, sound=sound, rotation=90 if camera in turned else 0, **how)
            path.rename(folder / f"{camera}{suffix}")
            lines = "".join(f"{i},{stamp}\n" for i, stamp in enumerate(rows["stamp_ns"].tolist()))
            (folder / f"{camera}.csv").write_text("frame,stamp_ns\n" + lines)
    return first


def lens_toml(bag_files):
    """The lenses of the CameraInfo of topics /<camera>/... in bags, as a TOML file with a table for each camera."""
    text = ""
    for bag in bag_files:
        for topic, (kind, _) in bags.topics_of(bag).items():
            if kind.endswith("CameraInfo"):
                continue
            info, name = bags.read_camera_info([bag], topic), topic.strip("/").split("/")[0]
            matrix = [list(info.K[i : i + 3]) for i in (0, 3, 6)]
            text += f'[{name}]\nname = "{name}"\nsize = [{info.width}.0, {info.height}.0]\n'
            text += f"matrix = {matrix}\ndistortions = {list(info.D)}\n\n"
    return text
