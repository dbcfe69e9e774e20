"""Pictures whose bytes are damaged inside a whole bag: lost, or refused with bag, topic and stamp, never half
decoded."""

import re
import struct
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.ingest import audit, bags, frames, messages
from dior.ingest.containers import BROKEN
from dior.tables import tables
from tests.cases import some
from tests.ingest.bagfiles import T0, encoded, info, packed, picture, raw, serialized, write

TOPIC = "/cam01/image_raw"
RAW = {"rgb8": 3, "bgr8": 3, "mono8": 1, "yuyv": 2, "yuv422_yuy2": 2}
ENCODINGS = (*RAW, "jpeg", "png")
HEIGHT, WIDTH = 12, 16
VALUES = (0, 1, 7, 8, 1 << 13, 1 << 16, 1 << 20, (1 << 31) - 1, 1 << 31, (1 << 32) - 1)
SECONDS, BYTES = 3.0, 32 << 20


def sent_as(encoding, stamp_ns=T0, grey=90):
    image = picture(grey, (HEIGHT, WIDTH))
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


CUT = {"empty": slice(0, 0), "a few bytes": slice(0, 10), "in its head": slice(0, 80), "in its pixels": slice(0, -9)}


def several(encoding, stamps):
    return [sent_as(encoding, stamp, 20 + 9 * i) for i, stamp in enumerate(stamps)]


def of_damage(folder, made):
    """The stamps of the pictures that are read, (stamp, reason) of the lost ones, and what the audit says."""
    topics = {"cam01": made[0].topic}
    frames.run(sequence="walk", bags=[write(folder / "walk", made, "mcap")], data_root=folder, topics=topics,
               out=folder / "frames.parquet")  # fmt: skip
    audit.run(sequence="walk", frames=folder / "frames.parquet", data_root=folder, out=folder / "a.parquet",
              out_dropped=folder / "d.parquet", findings=folder / "f.parquet")  # fmt: skip
    table, lost = tables.read(folder / "frames.parquet", "frames"), tables.read(folder / "d.parquet", "dropped_frames")
    assert len(list(bags.read_pictures(table, folder))) == len(table["frame"])
    found = tables.read(folder / "f.parquet", "findings")
    said = list(zip(found["severity"], found["code"], found["text"], strict=True))
    return table["stamp_ns"].tolist(), list(zip(lost["frame"], lost["stamp_ns"], lost["reason"], strict=True)), said


@pytest.mark.parametrize("cut", CUT)
@pytest.mark.parametrize("encoding", ["jpeg", "png", "bgr8"])
@pytest.mark.parametrize("number", [0, 7])
def test_one_damaged_picture_is_a_lost_one(tmp_path, encoding, cut, number):
    stamps = [T0 + 33_000_000 * i for i in range(23)]
    made = several(encoding, stamps)
    made[number].content["data"] = made[number].content["data"][CUT[cut]]
    there, lost, said = of_damage(tmp_path, made)
    assert there == [stamp for i, stamp in enumerate(stamps) if i != number]
    assert lost == [(max(number - 1, 0), stamps[number], "not_decoded")]
    ((severity, code, text),) = said
    assert (severity, code) == ("warning", "pictures_lost") and text.startswith("walk: 1 picture lost (4.3%) in 1 gap")
    assert f"1 of them cannot be decoded, the first after frame {max(number - 1, 0)}: " in text


def test_a_png_with_a_wrong_byte_is_a_lost_picture(tmp_path):
    stamps = [T0 + 33_000_000 * i for i in range(9)]
    made = several("png", stamps)
    made[4].content["data"] = made[4].content["data"].copy()
    made[4].content["data"][60] ^= 0x5A
    there, lost, _ = of_damage(tmp_path, made)
    assert there == stamps[:4] + stamps[5:] and lost == [(3, stamps[4], "not_decoded")]


@pytest.mark.parametrize("encoding, why", [("jpeg", "it is empty"), ("bgr8", "0 bytes in rows of 48 are too few .*")])
def test_where_all_are_damaged_it_is_one_error(tmp_path, encoding, why):
    made = several(encoding, [T0 + 33_000_000 * i for i in range(9)])
    for one in made:
        one.content["data"] = one.content["data"][:0]
    with pytest.raises(DiorError) as caught:
        of_damage(tmp_path, made)
    said = rf"{tmp_path}/walk: message 0 of {TOPIC} has no readable picture \({why}\), nor has any other of the 9; "
    assert re.fullmatch(f"{said}exclude the sequence or drop the camera", str(caught.value))


def test_a_jpeg_with_a_thumbnail_or_bytes_behind_it_is_whole(tmp_path):
    whole = encoded(picture(90, (HEIGHT, WIDTH)), ".jpg").tobytes()
    thumb = b"\xff\xe1" + (2 + len(whole)).to_bytes(2, "big") + whole
    stamps = [T0 + 33_000_000 * i for i in range(9)]
    made = several("jpeg", stamps)
    made[3].content["data"] = np.frombuffer(whole + bytes(50), np.uint8)
    made[5].content["data"] = np.frombuffer(whole[:2] + thumb + whole[2:], np.uint8)
    made[6].content["data"] = np.frombuffer((whole[:2] + thumb + whole[2:])[:-30], np.uint8)
    there, *_ = of_damage(tmp_path, made)
    assert there == stamps[:6] + stamps[7:]


def test_another_format_is_named(tmp_path):
    made = several("jpeg", [T0 + 33_000_000 * i for i in range(9)])
    for one in made:
        one.content.update(format="h264", data=np.arange(90, dtype=np.uint8))
    with pytest.raises(DiorError, match=r"no readable picture \(neither JPEG nor PNG, its format is 'h264'\)"):
        of_damage(tmp_path, made)
