"""Bags that a lab really has: cut off, empty, flipped bits, of the wrong type. Each ends soon and in one sentence."""

import io
import sqlite3
import struct
import time
import tracemalloc
from contextlib import suppress

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.ingest import bag_reader, bags, frames
from dior.ingest.glance import glance
from dior.tables import tables
from tests.cases import some
from tests.ingest.bagfiles import T0, info, packed, picture, raw, write

TOPICS = {"cam01": "/cam01/image_raw", "cam02": "/cam02/image_raw"}
FORMATS = (
    "ros1", "ros1 lz4", "ros1 bz2", "db3 alone", "db3 message alone", "db3 zstd alone", "mcap alone", "mcap zstd",
    "mcap lz4", "mcap plain", "mcap ros1",
)  # fmt: skip
SECONDS, BYTES = 3.0, 32 << 20


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a small bag in each format."""
    folder = tmp_path_factory.mktemp("whole")
    sent = []
    for i in range(3):
        stamp = T0 + i * 33_333_333
        sent += [packed("/cam01/image_raw", stamp, picture(9 * i, (12, 16)), ".jpg"), info("/cam01/camera_info", stamp)]
        sent.append(raw("/cam02/image_raw", stamp, picture(9 * i, (6, 8)), "bgr8"))
    found = {}
    for form in FORMATS:
        bag = write(folder / form.replace(" ", "_"), sent, form, chunk=1500)
        found[form] = (bag if bag.is_file() else next(bag.glob("*.mcap"))).read_bytes()
    # a function, because hypothesis prints its arguments
    return found.__getitem__


def outcome(folder, content):
    """Write `content` as a bag and read all of it; the error's text or "" for success. Bounded in time and memory."""
    bag = folder / "walk"
    bag.write_bytes(content)
    begun = time.monotonic()
    tracemalloc.start()
    try:
        read_all(folder, bag)
        text = ""
    except DiorError as error:
        text = str(error)
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert time.monotonic() - begun < SECONDS and peak < BYTES
    assert "\n" not in text and "Error(" not in text and len(text) < 1000
    return text


def read_all(folder, bag):
    # bounded as well, and what it raises of a broken bag is said by the others, too
    with suppress(DiorError):
        glance(bag)
    frames.run(sequence="walk", bags=[bag], data_root=folder, topics=TOPICS, out=folder / "frames.parquet")
    table = tables.read(folder / "frames.parquet", "frames")
    got = dict(bags.read_pictures(table, folder))
    assert len(got) == len(table["frame"])
    bags.read_camera_info([bag], "/cam01/image_raw")


def test_undamaged_bags_are_read(tmp_path, whole):
    for form in FORMATS:
        assert outcome(tmp_path, whole(form)) == "", form


examples = settings(
    max_examples=15, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.mark.parametrize("form", some(FORMATS, *FORMATS[::3]))
@examples
@given(data=st.data())
def test_flipped_bits(tmp_path, whole, form, data):
    content = bytearray(whole(form))
    flips = st.lists(st.integers(0, 8 * len(content) - 1), min_size=1, max_size=3)
    for bit in data.draw(flips):
        content[bit // 8] ^= 1 << bit % 8
    outcome(tmp_path, bytes(content))


@pytest.mark.parametrize("form", some(FORMATS, *FORMATS[::6]))
@examples
@given(data=st.data())
def test_numbers_blown_up(tmp_path, whole, form, data):
    """Four or eight bytes set to what a huge size looks like."""
    content = bytearray(whole(form))
    value = data.draw(st.sampled_from([b"\xff" * 4, b"\xff" * 8, b"\0" * 8, b"\0\0\0\x7f", b"\0\0\0\0\x40\0\0\0"]))
    at = data.draw(st.integers(0, len(content) - len(value)))
    content[at : at + len(value)] = value
    outcome(tmp_path, bytes(content))


@pytest.mark.parametrize("form", FORMATS)
def test_cut_off_anywhere_is_one_error(tmp_path, whole, form):
    content = whole(form)
    for size in sorted({int(s) for s in np.linspace(0, len(content) - 1, 16)}):
        text = outcome(tmp_path, content[:size])
        assert "walk: " in text, (form, size)
        assert "truncated or was not closed" in text or size < 16 or "compressed as a whole" in text, (form, text)


@pytest.mark.parametrize("form", FORMATS)
def test_hole_of_zeros(tmp_path, whole, form):
    """A block that a full disk or a bad card left empty."""
    content = whole(form)
    for at in range(0, len(content), max(len(content) // 8, 1)):
        outcome(tmp_path, content[:at] + bytes(min(512, len(content) - at)) + content[at + 512 :])


def test_long_hole_of_zeros_is_not_walked_through(tmp_path, whole):
    """Zeros look like empty records to an MCAP reader: a gigabyte of them would take minutes."""
    content = whole("mcap plain")
    middle = content.index(b"\x05", len(content) // 2)
    text = outcome(tmp_path, content[:middle] + bytes(1 << 24) + content[middle:])
    assert "truncated or was not closed" in text


def test_bag_that_holds_fewer_messages_than_it_says(tmp_path, whole):
    """One byte of a message's kind is all it takes for an MCAP reader to pass over it."""
    content, picture_ = whole("mcap alone"), b"\xff\xd8\xff\xe0"
    record = content.rindex(b"\x05", 0, content.index(picture_) - 60)
    text = outcome(tmp_path, content[:record] + b"\x55" + content[record + 1 :])
    assert "walk: it says it holds 3 messages of /cam01/image_raw, but there are 2; copy it again" in text


def test_flipped_bits_in_metadata(tmp_path_factory):
    folder = write(tmp_path_factory.mktemp("meta") / "walk", [packed("/cam01/image_raw", T0, picture(1))], "db3")
    whole = (folder / "metadata.yaml").read_bytes()

    @examples
    @given(st.lists(st.integers(0, 8 * len(whole) - 1), min_size=1, max_size=3), st.integers(0, 2 * len(whole)))
    def check(bits, size):
        content = bytearray(whole)
        for bit in bits:
            content[bit // 8] ^= 1 << bit % 8
        (folder / "metadata.yaml").write_bytes(content[:size])
        try:
            assert set(bags.topics_of(folder)) == {"/cam01/image_raw"}
        except DiorError as error:
            assert "metadata.yaml" in str(error)

    check()


def test_empty_and_wrong_files(tmp_path):
    assert outcome(tmp_path, b"").endswith("the file is empty; copy it again from the recording computer")
    jpeg = cv2.imencode(".jpg", picture(3))[1].tobytes()
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    for content in (jpeg, stream.getvalue(), b"#!/bin/sh\n", b"frame,joint\n" * 100, bytes(5000)):
        assert "this is not a bag (it begins with" in outcome(tmp_path, content)
    assert "old format 1; convert it with `rosbag fix`" in outcome(tmp_path, b"#ROSBAG V1.2\n" + bytes(100))


def test_another_sqlite_database(tmp_path):
    path = tmp_path / "other"
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE songs (name TEXT)")
    text = outcome(tmp_path, path.read_bytes())
    assert "walk: the bag is truncated or was not closed (Cannot open database" in text and "missing tables" in text


def test_wrong_types_in_the_database(tmp_path, whole):
    for change in (
        "UPDATE messages SET timestamp = 'soon'",
        "UPDATE messages SET data = 'text'",
        "UPDATE messages SET data = zeroblob(3)",
        "UPDATE topics SET name = x'80ff'",
        "UPDATE messages SET timestamp = -9223372036854775808",
        "UPDATE topics SET type = 'std_msgs/msg/String'",
    ):
        path = tmp_path / "changed"
        path.write_bytes(whole("db3 alone"))
        with sqlite3.connect(path) as base:
            base.execute(change)
        assert outcome(tmp_path, path.read_bytes()), change


def test_chunk_that_claims_four_gigabytes(tmp_path, whole):
    for form in ("ros1 lz4", "ros1 bz2"):
        content = whole(form)
        at = content.index(b"size=") + 5
        # rosbags goes by what the codec gives, which is all there
        assert outcome(tmp_path, content[:at] + b"\xff\xff\xff\xff" + content[at + 4 :]) == ""
    for form, name in (("mcap lz4", b"\3\0\0\0lz4"), ("mcap zstd", b"\4\0\0\0zstd")):
        content = whole(form)
        # after two stamps and before a checksum: the specification's record 0x06
        at = content.index(name) - 12
        text = outcome(tmp_path, content[:at] + b"\xff\xff\xff\xff" + content[at + 4 :])
        assert "truncated or was not closed (Chunk size mismatch: expected" in text


def test_message_that_expands_beyond_any_picture(tmp_path, monkeypatch):
    from backports import zstd

    monkeypatch.setattr(bag_reader, "MESSAGE_LIMIT", 1 << 22)
    bomb = zstd.compress(bytes(1 << 24))
    assert len(bomb) < 4096
    with pytest.raises(ValueError, match="expands to more than 4 MB"):
        bag_reader.unzstd(bomb)
    assert bag_reader.unzstd(zstd.compress(bytes(1 << 21))) == bytes(1 << 21)


def test_picture_header_with_an_impossible_size(tmp_path):
    sent = packed("/cam01/image_raw", T0, picture(1))
    png = sent.content["data"].tobytes()
    sent.content["data"] = np.frombuffer(png[:16] + struct.pack(">II", 40_000, 40_000) + png[24:], np.uint8)
    bag = write(tmp_path / "walk", [sent], "ros1")
    with pytest.raises(DiorError, match="it claims to be 40000x40000 px"):
        bags.index(bag, ["/cam01/image_raw"])


def test_an_index_that_promises_messages_that_are_not_there(tmp_path, monkeypatch):
    """Found by benchmarks.fuzz in an MCAP file whose chunk lost what its summary counts."""
    stamp = T0 + 33_333_333
    bag = write(tmp_path / "walk", [info("/cam01/camera_info", stamp)], "mcap alone")
    monkeypatch.setattr(bags, "messages_of", lambda *_: iter(()))
    with pytest.raises(
        DiorError, match=r"/cam01/camera_info has messages by the index, and none is there; the bag is d"
    ):
        bags.read_camera_info([bag], "/cam01/image_raw")
