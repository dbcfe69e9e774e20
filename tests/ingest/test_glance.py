"""What a recording holds, at a glance: the same as reading it through tells, in every format."""

from dataclasses import replace
from datetime import UTC, datetime
from itertools import chain

import cv2
import numpy as np
import pytest
from rosbags import rosbag1

from dior.errors import DiorError
from dior.ingest import bag_reader, bags, messages
from dior.ingest.containers import messages as messages_of
from dior.ingest.glance import Stream, glance
from tests.ingest.bagfiles import FORMATS, T0, info, packed, picture, raw, write

CAM01, CAM02 = "/cam01/color/image_raw/compressed", "/cam02/image_raw"
STEP = 33_333_333
NO_PICTURE = f"its type is std_msgs/msg/String, not {messages.COMPRESSED} or {messages.RAW}"


def capture(first=0, count=40):
    """Two cameras, one of which starts late and ends early, and the CameraInfo of one."""
    for i in range(first, first + count):
        yield packed(CAM01, T0 + i * STEP, picture(2 * i))
        yield info("/cam01/color/camera_info", T0 + i * STEP, size=(48, 64))
        if 5 <= i < 30:
            # the last two are received at once
            late = 4_000_000 if i != 28 else 4_000_000 + STEP
            yield raw(CAM02, T0 + 7 + i * STEP, picture(5 * i, (24, 32)), "bgr8", delay=late)


def read_through(bag):
    """The streams of a bag by all its messages."""
    found = {}
    for message in messages_of(bag, set(bags.topics_of(bag))):
        found.setdefault(message.topic, []).append(message)
    streams = []
    for topic, sent in sorted(found.items()):
        told = [messages.told(one.kind, one.raw, one.wire) for one in sent]
        stamps = [stamp for stamp, *_ in told]
        fps = 1e9 * (len(sent) - 1) / (stamps[-1] - stamps[0])
        _, size, why_not = told[0]
        streams.append(Stream(topic, sent[0].kind, len(sent), stamps[0], stamps[-1], *size, fps, why_not))
    return tuple(streams)


@pytest.mark.parametrize("form", FORMATS)
def test_what_a_glance_tells_is_what_reading_tells(tmp_path, form):
    bag = write(tmp_path / "walk", capture(), form, chunk=20_000)
    found = glance(bag)
    assert found == read_through(bag)
    assert found[1] == Stream(
        CAM01, messages.COMPRESSED, 40, T0, T0 + 39 * STEP, 48, 64, pytest.approx(1e9 / STEP, rel=1e-9)
    )
    assert found[2].first_ns == T0 + 7 + 5 * STEP and found[2].count == 25


@pytest.mark.parametrize("form", ["ros1", "db3", "mcap"])
def test_a_bag_is_not_read_through(tmp_path, form, monkeypatch):
    bag = write(tmp_path / "walk", capture(), form, chunk=20_000)
    read = []
    kept = bag_reader.SELECTED[form]

    def counted(*given):
        for one in kept(*given):
            read.append(one)
            yield one

    monkeypatch.setitem(bag_reader.SELECTED, form, counted)
    glance(bag)
    # the two ends of three topics, and what was received at the same time; MCAP is read by chunks, and here is one
    assert len(read) <= (105 if form == "mcap" else 7)


def test_a_topic_goes_on_in_the_next_file_of_a_folder(tmp_path):
    whole = write(tmp_path / "whole", capture(), "db3")
    split = tmp_path / "split"
    split.mkdir()
    names = []
    for number, first in enumerate((0, 20)):
        part = write(tmp_path / f"part{number}", capture(first, 20), "db3 alone")
        names.append(f"split_{number}.db3")
        part.rename(split / names[-1])
    listed = "".join(f"    - {name}\n" for name in names)
    (split / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}")
    assert glance(split) == glance(whole)


def test_what_has_no_picture_does_not_stop_the_others(tmp_path):
    depth = replace(raw("/depth/image_raw", T0 + 5, picture(9), "bgr8"), kind=messages.RAW)
    depth.content["encoding"] = "16UC1"
    packed_depth = packed("/depth/image_raw/compressedDepth", T0 + 6, picture(9))
    packed_depth.content["format"] = "16UC1; compressedDepth png"
    bag = write(tmp_path / "walk", [packed(CAM01, T0, picture(3)), depth, packed_depth], "ros1")
    camera, seen, seen_packed = glance(bag)
    assert (camera.height, camera.width, camera.fps) == (48, 64, None)
    assert (seen.first_ns, seen.height, seen.width) == (T0 + 5, 48, 64)
    assert (seen_packed.first_ns, seen_packed.height) == (T0 + 6, None)
    assert not camera.why_not and "16UC1" in seen.why_not and "depth picture" in seen_packed.why_not


@pytest.mark.parametrize("number", [0, 4])
def test_a_damaged_picture_at_an_end_hides_no_camera(tmp_path, number):
    made = [packed("/cam01/image/compressed", T0 + 10**8 * i, picture(9 * i)) for i in range(5)]
    made[number].content["data"] = made[number].content["data"][:0]
    (one,) = glance(write(tmp_path / "walk", made, "mcap"))
    assert (one.height, one.width, one.why_not, one.first_ns, one.last_ns) == (48, 64, "", T0, T0 + 4 * 10**8)


def test_stamps_are_those_of_receiving_where_there_is_no_header_and_zero_where_none_was_set(tmp_path):

    unstamped = replace(packed(CAM01, T0, picture(3)), stamp_ns=0)
    bag = write(tmp_path / "walk", [unstamped], "ros1")
    assert glance(bag)[0].first_ns == 0
    with rosbag1.Writer(tmp_path / "words.bag") as writer:
        words = writer.add_connection("/words", "std_msgs/msg/String", msgdef="string data", md5sum="0" * 32)
        writer.write(words, T0 + 1, b"\x02\0\0\0hi")
        writer.write(words, T0 + 1_000_000_001, b"\x02\0\0\0ho")
    assert glance(tmp_path / "words.bag") == (
        Stream("/words", "std_msgs/msg/String", 2, T0 + 1, T0 + 1_000_000_001, None, None, 1.0, NO_PICTURE),
    )


def test_a_topic_that_was_declared_and_never_sent(tmp_path):

    with rosbag1.Writer(tmp_path / "walk.bag") as writer:
        writer.add_connection("/silent", messages.RAW, msgdef="string data", md5sum="0" * 32)
        words = writer.add_connection("/words", "std_msgs/msg/String", msgdef="string data", md5sum="0" * 32)
        writer.write(words, T0, b"\x02\0\0\0hi")
    assert glance(tmp_path / "walk.bag")[0] == Stream(
        "/silent", messages.RAW, 0, None, None, None, None, None, "there is no message of it"
    )


@pytest.mark.parametrize("form", ["ros1", "db3 alone", "mcap alone"])
def test_a_broken_bag_is_one_sentence(tmp_path, form):
    bag = write(tmp_path / "walk", capture(), form, chunk=20_000)
    bag.write_bytes(bag.read_bytes()[:-3000])
    with pytest.raises(DiorError, match=rf"{bag.name}: the bag is truncated or was not closed"):
        glance(bag)
    with pytest.raises(DiorError, match="there is no such bag"):
        glance(tmp_path / "none.bag")


def test_a_folder_of_pictures(tmp_path):
    for i in range(12):
        cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
    assert glance(tmp_path) == (Stream("/pictures", messages.COMPRESSED, 12, None, None, 48, 64, None),)


@pytest.mark.parametrize("name", ["walk.mp4", "walk.mkv", "walk.avi"])
def test_a_video_and_its_turned_picture(tmp_path, name):
    pytest.importorskip("av", reason="pip install -e '.[video]'")
    from tests.ingest import videofiles

    began = datetime(2026, 3, 4, 10, 20, 30, tzinfo=UTC)
    created = {"creation_time": began.isoformat()}
    codec = "mjpeg" if name.endswith("avi") else "libx264"
    turned = 90 if name.endswith("mp4") else 0
    pictures = [videofiles.numbered(i) for i in range(31)]
    videofiles.write(tmp_path / name, pictures, metadata=created, codec=codec, rotation=turned)
    shown, stored = glance(tmp_path / name)
    assert [one.topic for one in (shown, stored)] == ["/video0", "/video0/stored"]
    assert (stored.height, stored.width) == (48, 64)
    assert (shown.height, shown.width) == ((64, 48) if turned else (48, 64))
    assert shown.fps == pytest.approx(30) and abs(shown.count - 31) <= 1
    if not name.endswith("avi"):
        assert shown.first_ns == began.timestamp() * 10**9
        assert shown.last_ns == pytest.approx(shown.first_ns + 1e9, abs=4e7)
    else:
        assert shown.first_ns is None and shown.last_ns is None


def test_topics_are_sorted_and_named_in_full(tmp_path):
    sent = chain([packed("cam02/image_raw", T0, picture(1))], [packed("/cam01//image_raw", T0, np.zeros((4, 6, 3)))])
    bag = write(tmp_path / "walk", sent, "ros1")
    assert [one.topic for one in glance(bag)] == ["/cam01/image_raw", "/cam02/image_raw"]
