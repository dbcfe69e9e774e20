"""Pictures whose bytes are damaged inside a whole bag: refused with bag, topic and stamp, never half decoded."""

import struct
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.ingest import bags, messages
from dior.ingest.containers import BROKEN
from tests.cases import some
from tests.ingest.bagfiles import T0, info, packed, picture, raw, serialized, write

TOPIC = "/cam01/image_raw"
RAW = {"rgb8": 3, "bgr8": 3, "mono8": 1, "yuyv": 2, "yuv422_yuy2": 2}
ENCODINGS = (*RAW, "jpeg", "png")
HEIGHT, WIDTH = 12, 16
VALUES = (0, 1, 7, 8, 1 << 13, 1 << 16, 1 << 20, (1 << 31) - 1, 1 << 31, (1 << 32) - 1)
SECONDS, BYTES = 3.0, 32 << 20


def sent_as(encoding, stamp_ns=T0):
    image = picture(90, (HEIGHT, WIDTH))
    if encoding in RAW:
        return raw(TOPIC, stamp_ns, image[..., : RAW[encoding]], encoding)
    return packed(TOPIC, stamp_ns, image, {"jpeg": ".jpg", "png": ".png"}[encoding])


def fields(sent, message):
    """Where the numbers of a message are that say how large its picture is: name -> (position, struct format)."""
    if sent.kind == messages.RAW:
        size = message.index(struct.pack("<II", HEIGHT, WIDTH))
        rows = message.index(struct.pack("<II", sent.content["step"], len(sent.content["data"])), size)
        return {"height": (size, "<I"), "width": (size + 4, "<I"), "step": (rows, "<I"), "size": (rows + 4, "<I")}
    data = message.index(sent.content["data"].tobytes())
    found = {"size": (data - 4, "<I")}
    if message[data : data + 2] == b"\xff\xd8":
        at = message.index(b"\xff\xc0", data)
        return found | {"segment": (at + 2, ">H"), "height": (at + 5, ">H"), "width": (at + 7, ">H")}
    return found | {"width": (data + 16, ">I"), "height": (data + 20, ">I")}


def damaged(message, at, form, value):
    """The message with another number at `at`, or None where that is the same or does not fit."""
    if value >= 1 << 8 * struct.calcsize(form) or struct.unpack_from(form, message, at)[0] == value:
        return None
    return message[:at] + struct.pack(form, value) + message[at + struct.calcsize(form) :]


def read(folder, rows):
    """The only picture of `rows`. Bounded in time and memory."""
    begun = time.monotonic()
    tracemalloc.start()
    try:
        ((_, got),) = bags.read_pictures(rows, folder)
        return got
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert time.monotonic() - begun < SECONDS and peak < BYTES


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_damaged_size_is_refused_with_bag_topic_and_stamp(tmp_path, encoding):
    sent = sent_as(encoding)
    bag, message = write(tmp_path / "walk", [sent], "mcap plain"), serialized(sent, "cdr")
    whole = bag.read_bytes()
    rows = bags.index(bag, [TOPIC]) | {"bag": np.array([bag.name], object)}
    undamaged = read(tmp_path, rows)
    assert undamaged.shape == (HEIGHT, WIDTH, 3)
    refused = set()
    for name, (at, form) in fields(sent, message).items():
        (true,) = struct.unpack_from(form, message, at)
        for value in (*VALUES, true - 1, true + 1, 2 * true):
            changed = damaged(message, at, form, value)
            if changed is None:
                continue
            bag.write_bytes(whole.replace(message, changed))
            try:
                got = read(tmp_path, rows)
            except DiorError as error:
                start = f"{bag}: the picture of {TOPIC} received at {T0 + 4_000_000} ns cannot be decoded ("
                assert str(error).startswith(start) and "\n" not in str(error)
                refused.add((name, value))
            else:
                # a JPEG without the last byte of its end mark holds all pixels
                assert name in ("size", "segment", "step"), (name, value)
                np.testing.assert_array_equal(got, undamaged, f"{name} {value}")
    for name in fields(sent, message):
        assert (name, 0) in refused and any(value > 8000 for which, value in refused if which == name)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_damaged_size_is_refused_by_the_index_or_harmless(tmp_path, encoding):
    sent = sent_as(encoding)
    bag, message = write(tmp_path / "walk", [sent], "mcap plain"), serialized(sent, "cdr")
    whole = bag.read_bytes()
    for name, (at, form) in fields(sent, message).items():
        for value in VALUES:
            changed = damaged(message, at, form, value)
            if changed is None:
                continue
            bag.write_bytes(whole.replace(message, changed))
            try:
                rows = bags.index(bag, [TOPIC]) | {"bag": np.array([bag.name], object)}
                got = read(tmp_path, rows)
            except DiorError as error:
                assert str(error).startswith(f"{bag}: ") and TOPIC in str(error), (name, value)
            else:
                assert got.shape == (rows["height"][0], rows["width"][0], 3), (name, value)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_jpeg_is_unpacked_smaller_and_checked_as_a_whole_one(encoding):
    sent = sent_as(encoding)
    message = serialized(sent, "cdr")
    found = messages.small_jpeg(sent.kind, message, "cdr", (HEIGHT, WIDTH), 2)
    if encoding != "jpeg":
        assert found is None
        return
    assert found.shape == (HEIGHT // 2, WIDTH // 2, 3)
    assert np.abs(found[:, [0, -1]].astype(int) - picture(90, (HEIGHT, WIDTH))[::2, [0, -1]]).max() < 30
    with pytest.raises(ValueError, match="where its index says 16x14"):
        messages.small_jpeg(sent.kind, message, "cdr", (HEIGHT + 2, WIDTH), 2)
    with pytest.raises(ValueError):
        messages.small_jpeg(sent.kind, message.replace(b"\xff\xc4", b"\xff\xc5"), "cdr", (HEIGHT, WIDTH), 2)


many = settings(max_examples=100, deadline=None, derandomize=True)


@pytest.mark.parametrize("wire", ["ros1", "cdr"])
@pytest.mark.parametrize("encoding", some(ENCODINGS, *[*ENCODINGS][::4]))
@many
@given(data=st.data())
def test_flipped_bits_and_cut_pictures_raise_nothing_else(wire, encoding, data):
    sent = sent_as(encoding)
    message = changed_somewhere(serialized(sent, wire), data)
    for size in ((HEIGHT, WIDTH), None):
        try:
            size = size or messages.picture_of(sent.kind, message, wire)[1:]
            got = messages.decode(sent.kind, message, wire, size)
        except BROKEN:
            continue
        assert got.shape == (*size, 3) and got.dtype == np.uint8


@pytest.mark.parametrize("wire", ["ros1", "cdr"])
@many
@given(data=st.data())
def test_flipped_bits_and_cut_camera_info_raise_nothing_else(wire, data):
    message = changed_somewhere(serialized(info("/cam01/camera_info", T0), wire), data)
    try:
        said = messages.camera_info(message, wire)
    except BROKEN:
        return
    assert isinstance(said["model"], str) and min(said["width"], said["height"], *said["binning"], *said["roi"]) >= 0
    assert [len(said[key]) for key in "KRP"] == [9, 9, 12] and len(said["D"]) < len(message)


def changed_somewhere(message, data):
    """The message with some bits flipped, and sometimes cut off."""
    changed = bytearray(message)
    for bit in data.draw(st.lists(st.integers(0, 8 * len(changed) - 1), min_size=1, max_size=3)):
        changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed[: data.draw(st.just(len(changed)) | st.integers(0, len(changed)))])
