"""Tiny bags written with known stamps and pictures, and the real ones."""

import os
import struct

import cv2
import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from dior.errors import DiorError
from dior.ingest import bags, containers, frames
from dior.tables import tables
from tests.ingest.bagfiles import STORES, T0, encoded, picture

STORE = STORES["ros1"]
TYPES = STORE.types
TOPIC = "/cam01/color/image_raw/compressed"


def header(stamp_ns):
    time = TYPES["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return TYPES["std_msgs/msg/Header"](seq=0, stamp=time, frame_id="lens")


def compressed(stamp_ns, data):
    return TYPES["sensor_msgs/msg/CompressedImage"](header=header(stamp_ns), format="x", data=np.frombuffer(data, "u1"))


def write_bag(path, messages, declared=()):
    """`messages` is (topic, receive_ns, message); `declared` (topic, type) get a connection only."""
    with Writer(path) as writer:
        connections = {}
        for topic, kind in [*declared, *((topic, message.__msgtype__) for topic, _, message in messages)]:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
        for topic, receive_ns, message in messages:
            raw = STORE.serialize_ros1(message, message.__msgtype__)
            writer.write(connections[topic], receive_ns, raw)
    return path


def pictures(stamps, topic=TOPIC, delay=4_000_000, **kwargs):
    return [(topic, s + delay, compressed(s, encoded(picture(5 * i, **kwargs)))) for i, s in enumerate(stamps)]


def index(tmp_path, bag_paths, topics=None, sequence="walk"):
    out = tmp_path / "frames.parquet"
    frames.run(sequence=sequence, bags=bag_paths, data_root=tmp_path, topics=topics or {"cam01": TOPIC}, out=out)
    return tables.read(out, "frames")


def rows(bag, topic=TOPIC):
    """The index of one bag with what `read_pictures` needs besides; its bag lies directly in data_root."""
    index_of = bags.index(bag, [topic])
    return index_of | {"bag": np.full(len(index_of["topic"]), bag.name, object)}


def test_index_takes_stamps_from_the_header_and_sizes_from_the_picture(tmp_path):
    stamps = [T0 + 33_333_333 * i for i in range(3)]
    (tmp_path / "day").mkdir()
    bag = write_bag(tmp_path / "day" / "pc1.bag", pictures(stamps))
    table = index(tmp_path, [bag])
    assert table["stamp_ns"].tolist() == stamps
    assert (table["receive_ns"] - table["stamp_ns"] == 4_000_000).all()
    assert table["frame"].tolist() == [0, 1, 2] and set(table["bag"]) == {"day/pc1.bag"}
    assert set(table["height"]) == {48} and set(table["width"]) == {64}


def test_two_bags_of_one_camera_merge_by_stamp_and_cameras_are_sorted(tmp_path):
    late = write_bag(tmp_path / "late.bag", pictures([T0 + 3 * 10**9, T0 + 4 * 10**9]))
    other = pictures([T0 + 5, T0 + 6], topic="/a/image_raw")
    early = write_bag(tmp_path / "early.bag", pictures([T0, T0 + 10**9]) + other)
    table = index(tmp_path, [late, early], {"cam02": TOPIC, "cam01": "/a/image_raw"})
    assert table["camera"].tolist() == ["cam01"] * 2 + ["cam02"] * 4
    second = tables.of_camera(table, "cam02")
    assert ((second["stamp_ns"] - T0) // 10**9).tolist() == [0, 1, 3, 4]
    assert second["bag"].tolist() == ["early.bag"] * 2 + ["late.bag"] * 2
    assert second["frame"].tolist() == [0, 1, 2, 3]


def test_messages_received_out_of_order_are_numbered_as_recorded(tmp_path):
    stamps = [T0 + i for i in (0, 1, 3, 2, *range(4, 20))]
    messages = [(TOPIC, T0 + 100 + i, compressed(s, encoded(picture(i)))) for i, s in enumerate(stamps)]
    table = index(tmp_path, [write_bag(tmp_path / "a.bag", messages)])
    assert table["stamp_ns"].tolist() == stamps and np.isnan(table["restored_s"]).all()
    assert table["receive_ns"].tolist() == [T0 + 100 + i for i in range(20)]


def test_stamps_that_jump_back_for_a_while_renumber_nothing(tmp_path):
    """20 pictures 0.6 s early, in one bag and where the next bag begins."""
    right = [T0 + 33_333_333 * i for i in range(100)]
    given = [s - 600_000_000 * (40 <= i < 60) for i, s in enumerate(right)]
    messages = [
        (TOPIC, r + 4_000_000, compressed(s, encoded(picture(i))))
        for i, (s, r) in enumerate(zip(given, right, strict=True))
    ]
    for parts in ([messages], [messages[:50], messages[50:]], [messages[:65], messages[48:]]):
        paths = [write_bag(tmp_path / f"{len(parts)}_{i}_{len(one)}.bag", one) for i, one in enumerate(parts)]
        table = index(tmp_path, paths)
        np.testing.assert_allclose((table["stamp_ns"] - right) / 1e9, 0, atol=1e-6)
        assert (np.diff(table["receive_ns"]) > 0).all() and table["frame"].tolist() == list(range(100))
        assert np.flatnonzero(np.isfinite(table["restored_s"])).tolist() == list(range(40, 60))
        assert table["restored_s"][40] == pytest.approx(0.6, abs=1e-6) and 0 < table["restored_sigma_s"][40] < 1e-4
        pixels = dict(bags.read_pictures(tables.rows(table, np.array([40, 41])), tmp_path))
        assert [pixels[i][0, 0, 0] for i in (0, 1)] == [40, 41]


@pytest.mark.parametrize(("by_s", "said"), [(-0.6, "set back by 0.6 s"), (0.6, "set forward by 0.6 s")])
def test_a_clock_that_is_set_between_two_bags_is_refused(tmp_path, by_s, said):
    right = [T0 + 33_333_333 * i for i in range(100)]
    given = [s + round(1e9 * by_s) * (i >= 50) for i, s in enumerate(right)]
    messages = [(TOPIC, r + 4_000_000, compressed(s, encoded(picture(9)))) for s, r in zip(given, right, strict=True)]
    paths = [write_bag(tmp_path / name, part) for name, part in (("a.bag", messages[:50]), ("b.bag", messages[50:]))]
    with pytest.raises(DiorError, match=f"the header clock was {said} between a.bag and b.bag"):
        index(tmp_path, paths)


def test_a_glitch_that_ends_with_the_first_picture_of_a_bag_is_told_by_how_much(tmp_path):
    """One picture is too few to be restored, and the lags of the others are as ever."""
    right = [T0 + 33_333_333 * i for i in range(100)]
    given = [s - 600_000_000 * (40 <= i < 51) for i, s in enumerate(right)]
    messages = [(TOPIC, r + 4_000_000, compressed(s, encoded(picture(9)))) for s, r in zip(given, right, strict=True)]
    paths = [write_bag(tmp_path / name, part) for name, part in (("a.bag", messages[:50]), ("b.bag", messages[50:]))]
    with pytest.raises(DiorError, match="the header clock was set back by 0.6 s between a.bag and b.bag"):
        index(tmp_path, paths)


@pytest.mark.parametrize("cameras", [("cam01", "cam02"), ("cam02", "cam01")])
def test_recorders_that_do_not_overlap_are_said_first_unless_a_person_gave_the_clock(tmp_path, cameras):
    """Also where another thing is wrong: the second camera's pictures change their size."""
    near, far = cameras
    one = write_bag(tmp_path / "pc1.bag", pictures([T0 + 10**8 * i for i in range(5)], topic="/a/image"))
    late = T0 + 3_600_000_000_000
    sizes = [(48, 64), (48, 64), (30, 90)]
    messages = [
        ("/b/image", late + i * 10**8 + 4, compressed(late + i * 10**8, encoded(picture(9, size=size))))
        for i, size in enumerate(sizes)
    ]
    topics = {near: "/a/image", far: "/b/image"}
    paths = [one, write_bag(tmp_path / "pc2.bag", messages)]
    said = (
        rf"walk: the recordings do not overlap: that of {near} \(pc1.bag\) ended 3599.6 s before that of {far} "
        rf"\(pc2.bag\) began \(2024-02-15 12:26:40 and 2024-02-15 13:26:40 UTC .* give offset_s "
        rf"of {far} in config/offsets"
    )
    with pytest.raises(DiorError, match=said):
        index(tmp_path, paths, topics)
    out = {"data_root": tmp_path, "out": tmp_path / "frames.parquet"}
    with pytest.raises(DiorError, match="a camera must keep one resolution"):
        frames.run(sequence="walk", bags=paths, topics=topics, by_hand=[far], **out)


def test_recordings_may_overlap_through_a_third(tmp_path):
    """The first camera ended before the second began."""
    parts = {"/a/image": (0, 5), "/b/image": (6, 12), "/c/image": (3, 9)}
    messages = [m for t, (a, b) in parts.items() for m in pictures([T0 + 10**8 * i for i in range(a, b)], topic=t)]
    bag = write_bag(tmp_path / "pc1.bag", sorted(messages, key=lambda message: message[1]))
    table = index(tmp_path, [bag], {f"cam0{i}": topic for i, topic in enumerate(parts)})
    assert len(table["frame"]) == 17


def test_same_input_same_bytes(tmp_path):
    bag = write_bag(tmp_path / "a.bag", pictures([T0, T0 + 9]))
    index(tmp_path, [bag])
    first = (tmp_path / "frames.parquet").read_bytes()
    index(tmp_path, [bag])
    assert (tmp_path / "frames.parquet").read_bytes() == first


def test_pictures_come_back_even_with_equal_receive_stamps(tmp_path):
    messages = [(TOPIC, T0, compressed(T0 + i, encoded(picture(40 * i)))) for i in range(4)]
    table = index(tmp_path, [write_bag(tmp_path / "a.bag", messages)])
    assert table["nth"].tolist() == [0, 1, 2, 3]
    wanted = tables.rows(table, np.array([False, True, False, True]))
    got = dict(bags.read_pictures(wanted, tmp_path))
    assert sorted(got) == [0, 1]
    for row, grey in ((0, 40), (1, 120)):
        np.testing.assert_array_equal(got[row], picture(grey))


def test_jpeg_size_is_found_behind_other_segments(tmp_path):
    jpeg = encoded(picture(50, size=(30, 90)), ".jpg").tobytes()
    exif = b"\xff\xe1" + struct.pack(">H", 2 + 20) + b"\xff\xc0" * 10
    data = jpeg[:2] + exif + jpeg[2:]
    table = rows(write_bag(tmp_path / "a.bag", [(TOPIC, T0, compressed(T0, data))]))
    assert (table["height"][0], table["width"][0]) == (30, 90)


def test_missing_bag(tmp_path):
    with pytest.raises(DiorError, match=r"gone\.bag: there is no such bag"):
        index(tmp_path, [tmp_path / "gone.bag"])


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
def test_truncated_bag(tmp_path, share):
    bag = write_bag(tmp_path / "cut.bag", pictures([T0 + i for i in range(40)]))
    content = bag.read_bytes()
    bag.write_bytes(content[: int(share * len(content))])
    with pytest.raises(DiorError, match=r"cut\.bag: the bag is truncated or was not closed .*rosbag reindex"):
        index(tmp_path, [bag])


def test_bag_that_was_never_closed(tmp_path):
    bag = write_bag(tmp_path / "open.bag", pictures([T0]))
    content = bag.read_bytes()
    at = content.index(b"index_pos=") + len(b"index_pos=")
    bag.write_bytes(content[:at] + bytes(8) + content[at + 8 :])
    with pytest.raises(DiorError, match=r"open\.bag: the bag is truncated or was not closed"):
        index(tmp_path, [bag])


def test_bag_with_damaged_chunk(tmp_path):
    bag = write_bag(tmp_path / "bad.bag", pictures([T0]))
    content = bag.read_bytes()
    at = content.index(TOPIC.encode())
    bag.write_bytes(content[: at - 40] + b"\xff" * 30 + content[at - 10 :])
    with pytest.raises(DiorError, match=r"bad\.bag: the bag is truncated or was not closed"):
        index(tmp_path, [bag])


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "walk.bag")
    with pytest.raises(DiorError, match=r"walk.bag: is neither a file nor a folder"):
        bags.topics_of(tmp_path / "walk.bag")


def test_not_a_bag_and_empty_file(tmp_path):
    (tmp_path / "a.bag").write_text("SQLite format 4")
    with pytest.raises(DiorError, match=r"a\.bag: this is not a bag .* ROS 1 \.bag files, ROS 2"):
        index(tmp_path, [tmp_path / "a.bag"])
    (tmp_path / "b.bag").write_bytes(b"")
    with pytest.raises(DiorError, match=r"b\.bag: the file is empty"):
        index(tmp_path, [tmp_path / "b.bag"])
    (tmp_path / "c.bag").write_bytes(b"#ROSBAG V2")
    with pytest.raises(DiorError, match=r"c\.bag: the bag ends after 10 bytes; copy it again"):
        index(tmp_path, [tmp_path / "c.bag"])


def test_topic_not_in_the_bag_lists_those_there(tmp_path):
    bag = write_bag(tmp_path / "a.bag", pictures([T0]) + pictures([T0], topic="/cam02/image_raw"))
    with pytest.raises(DiorError) as error:
        index(tmp_path, [bag], {"cam01": "/cam01/colour/image_raw/compressed"})
    text = str(error.value)
    assert "walk, cam01" in text and f"did you mean '{TOPIC}'" in text and f"{TOPIC}, /cam02/image_raw" in text


def test_topic_without_messages(tmp_path):
    declared = [("/cam02/image_raw", "sensor_msgs/msg/Image")]
    bag = write_bag(tmp_path / "a.bag", pictures([T0]), declared)
    with pytest.raises(DiorError, match=r"walk, cam02: topic /cam02/image_raw is declared in .* has no message"):
        index(tmp_path, [bag], {"cam02": "/cam02/image_raw"})


def test_bag_without_any_message(tmp_path):
    with pytest.raises(DiorError, match=r"there is no message at all in .*a\.bag"):
        index(tmp_path, [write_bag(tmp_path / "a.bag", [])])


@pytest.mark.parametrize("data", [b"\xff\xd8\x00\x01\x02\x03", b"\xff\xd8\xff\xe0", b"GIF89a", b""])
def test_bad_picture_header_names_bag_topic_and_message(tmp_path, data):
    messages = [(TOPIC, T0, compressed(T0, data)), (TOPIC, T0 + 10**9, compressed(T0 + 10**9, data))]
    with pytest.raises(DiorError, match=rf"a\.bag: message 0 of {TOPIC} has no readable picture"):
        index(tmp_path, [write_bag(tmp_path / "a.bag", messages)])


def test_topic_that_holds_no_pictures(tmp_path):
    bag = write_bag(tmp_path / "a.bag", [("/clock", T0, header(T0))])
    with pytest.raises(DiorError, match=r"message 0 of /clock has no readable .*its type is std_msgs/msg/Header"):
        index(tmp_path, [bag], {"cam01": "/clock"})


def test_header_stamp_of_zero_is_refused(tmp_path):
    bag = write_bag(tmp_path / "a.bag", pictures([0, T0, T0 + 9]))
    with pytest.raises(DiorError, match="walk, cam01: 1 of 3 header stamps are zero, so the driver did not stamp"):
        index(tmp_path, [bag])


def test_mixed_picture_sizes(tmp_path):
    small = pictures([T0 + 10**9], size=(24, 32))
    with pytest.raises(DiorError, match=r"walk, cam01: frame 1 \(a\.bag\) is 32x24 where frame 0 \(a\.bag\) is 64x48"):
        index(tmp_path, [write_bag(tmp_path / "a.bag", pictures([T0]) + small)])


def test_bag_or_topic_given_twice(tmp_path):
    bag = write_bag(tmp_path / "a.bag", pictures([T0]))
    with pytest.raises(DiorError, match=r"walk: bag .*a\.bag is given twice"):
        index(tmp_path, [bag, bag])
    with pytest.raises(DiorError, match=f"walk: topic {TOPIC} is given twice"):
        index(tmp_path, [bag], {"cam01": TOPIC, "cam02": TOPIC})


def test_picture_that_cannot_be_decoded(tmp_path):
    data = encoded(picture(1)).tobytes()
    table = rows(write_bag(tmp_path / "a.bag", [(TOPIC, T0, compressed(T0, data))]))
    (tmp_path / "a.bag").unlink()
    write_bag(tmp_path / "a.bag", [(TOPIC, T0, compressed(T0, data[:40]))])
    with pytest.raises(
        DiorError, match=rf"a\.bag: the picture of {TOPIC} received at {T0} ns cannot be decoded .*; copy"
    ):
        list(bags.read_pictures(table, tmp_path))


def test_a_page_shows_a_picture_that_cannot_be_decoded_grey(tmp_path, capsys):
    data = encoded(picture(1)).tobytes()
    table = rows(write_bag(tmp_path / "a.bag", [(TOPIC, T0, compressed(T0, data))]))
    (tmp_path / "a.bag").unlink()
    write_bag(tmp_path / "a.bag", [(TOPIC, T0, compressed(T0, data[:40]))])
    [(row, shown)] = bags.read_to_show(table, tmp_path)
    assert row == 0 and shown.shape == picture(1).shape and (shown == bags.DAMAGED_GREY).all()
    assert "it is shown grey" in capsys.readouterr().err


def test_bag_that_changed_after_it_was_indexed(tmp_path):
    table = index(tmp_path, [write_bag(tmp_path / "a.bag", pictures([T0, T0 + 10]))])
    (tmp_path / "a.bag").unlink()
    write_bag(tmp_path / "a.bag", pictures([T0]))
    with pytest.raises(DiorError, match="the bag has changed since it was indexed"):
        list(bags.read_pictures(table, tmp_path))


@pytest.mark.parametrize(
    "topic, expected",
    [
        ("/cam01/color/image_raw/compressed", "/cam01/color/camera_info"),
        ("/cam01/color/image_raw", "/cam01/color/camera_info"),
        ("/raspicam_node/image/compressed", "/raspicam_node/camera_info"),
    ],
)
def test_camera_info_topic(topic, expected):
    assert bags.camera_info_topic(topic) == expected


def test_real_outdoor(shared, tmp_path):
    root = shared / "real_outdoor"
    topics = {f"cam0{i}": f"/cam0{i}/color/image_raw/compressed" for i in range(1, 5)}
    out = tmp_path / "frames.parquet"
    frames.run(sequence="beam", bags=[root / "pc1.bag", root / "pc2.bag"], data_root=root, topics=topics, out=out)
    table = tables.read(out, "frames")
    nominal = np.rint(T0 + np.arange(100) * (10**9 / 60)).astype(np.int64)
    for camera in topics:
        mine = tables.of_camera(table, camera)
        assert np.abs(mine["stamp_ns"] - nominal).max() <= 256
        assert mine["frame"].tolist() == list(range(100))
        assert (set(mine["height"]), set(mine["width"])) == ({1920}, {1088})
    assert tables.ordered_unique(table["bag"]) == ["pc1.bag", "pc2.bag"]

    few = tables.rows(table, np.isin(table["frame"], [3, 98]))
    got = dict(bags.read_pictures(few, root))
    assert sorted(got) == list(range(8))
    raw = {c: [m.raw for m in containers.messages(root / "pc1.bag", [topics[c]])] for c in ("cam01", "cam02")}
    for row, camera, frame in ((0, "cam01", 3), (1, "cam01", 98), (2, "cam02", 3), (3, "cam02", 98)):
        message = STORE.deserialize_ros1(raw[camera][frame], "sensor_msgs/msg/CompressedImage")
        np.testing.assert_array_equal(got[row], cv2.imdecode(message.data, cv2.IMREAD_COLOR))


def test_real_bag_with_markers(shared, tmp_path):
    bag, topic = shared / "bags/aruco_images.bag", "/raspicam_node/image/compressed"
    assert bags.topics_of(bag) == {
        topic: ("sensor_msgs/msg/CompressedImage", 1),
        "/raspicam_node/camera_info": ("sensor_msgs/msg/CameraInfo", 15),
    }
    info = bags.read_camera_info([bag], topic)
    assert info.K[0] == pytest.approx(1014.34, abs=0.005)
    assert (info.width, info.height, info.model, len(info.D)) == (1280, 960, "plumb_bob", 5)
    ((_, picture_),) = bags.read_pictures(rows(bag, topic), bag.parent)
    marks = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250))
    assert sorted(marks.detectMarkers(picture_)[1].ravel()) == [100, 103, 106, 107, 110, 111, 112]
    with pytest.raises(DiorError, match="1 picture is no recording"):
        index(tmp_path, [bag], {"cam01": topic})


def test_truncated_real_bag(shared, tmp_path):
    content = (shared / "bags" / "aruco_images.bag").read_bytes()
    (tmp_path / "cut.bag").write_bytes(content[: len(content) // 2])
    with pytest.raises(DiorError, match="truncated or was not closed"):
        index(tmp_path, [tmp_path / "cut.bag"], {"cam01": "/raspicam_node/image/compressed"})
