"""The same tiny capture in every format gives the same table, the same pictures and the same lens."""

import json
import os
import sqlite3
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import reader as rosbag1_reader
from rosbags.rosbag2 import storage_mcap

from dior.calibrate import intrinsics
from dior.errors import DiorError
from dior.ingest import bags, containers, frames
from dior.tables import tables
from tests.ingest.bagfiles import FORMATS, T0, info, packed, picture, raw, write, write_plain_mcap

JPEG, RAW = "/cam01/color/image_raw/compressed", "/cam02/image_raw"
STEP = 33_333_333
SIZE = 64, 48  # width, height px of the CameraInfo written there


def capture(count=6):
    """Two cameras, PNG and raw, CameraInfo with every frame and once, two messages received in the same nanosecond."""
    messages = [info("/cam02/camera_info", T0, (0.01,) * 8, "rational_polynomial", (24, 32))]
    for i in range(count):
        late = 4_000_000 if i != 3 else 4_000_000 - STEP
        messages += [packed(JPEG, T0 + i * STEP, picture(2 * i), delay=late), info("/cam01/color/camera_info", T0 + i)]
        messages.append(raw(RAW, T0 + 7 + i * STEP, picture(5 * i, (24, 32))[..., ::-1], "rgb8", padding=5))
    return messages


def index(folder, paths, topics=None):
    out = folder / "frames.parquet"
    frames.run(sequence="walk", bags=paths, data_root=folder, topics=topics or {"cam01": JPEG, "cam02": RAW}, out=out)
    return tables.read(out, "frames")


def rows(bag, topic):
    """The index of one bag with what `read_pictures` needs besides; its bag lies directly in data_root."""
    index_of = bags.index(bag, [topic])
    return index_of | {"bag": np.full(len(index_of["topic"]), bag.name, object)}


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_gives_the_same_table_pictures_and_lens(tmp_path, form):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    reference = index(tmp_path / "a", [write(tmp_path / "a" / "walk", capture(), "ros1")])
    bag = write(tmp_path / "b" / "walk", capture(), form)
    table = index(tmp_path / "b", [bag])
    for key in reference:
        if key != "bag":
            np.testing.assert_array_equal(table[key], reference[key], key)
    assert set(table["bag"]) == {bag.relative_to(tmp_path / "b").as_posix()}
    assert table["nth"].tolist() == [0, 0, 0, 1, 0, 0] + [0] * 6

    pictures = dict(bags.read_pictures(table, tmp_path / "b"))
    assert sorted(pictures) == list(range(12))
    for row, got in pictures.items():
        i = int(table["frame"][row])
        wanted = picture(2 * i) if table["camera"][row] == "cam01" else picture(5 * i, (24, 32))
        np.testing.assert_array_equal(got, wanted)
    few = tables.rows(table, np.array([False, False, False, True] + [False] * 7 + [True]))
    assert [row for row, _ in sorted(bags.read_pictures(few, tmp_path / "b"), key=lambda one: one[0])] == [0, 1]

    lens = bags.read_camera_info([bag], JPEG)
    assert (lens.width, lens.height, lens.model, lens.D) == (64, 48, "plumb_bob", (0.1, -0.2, 0.001, 0.002, 0.05))
    assert lens.K == (600.0, 0, 31.5, 0, 601.0, 24.25, 0, 0, 1)
    other = bags.read_camera_info([bag], RAW)
    assert (other.model, other.D, other.height) == ("rational_polynomial", (0.01,) * 8, 24)


@pytest.mark.parametrize("form", ["ros1", "ros1 lz4", "db3", "db3 message", "mcap", "mcap zstd"])
def test_messages_equal_those_of_rosbags_own_reader(tmp_path, form):
    bag = write(tmp_path / "walk", capture(30), form, chunk=3000)
    found = bags.topics_of(bag)
    ours = {topic: [] for topic in found}
    for message in containers.messages(bag, set(found)):
        ours[message.topic].append((message.kind, message.receive_ns, bytes(message.raw)))
    with AnyReader([bag]) as reader:
        theirs = {topic: [] for topic in found}
        for connection, stamp, data in reader.messages():
            theirs[connection.topic].append((connection.msgtype, stamp, bytes(data)))
        assert found == {topic: (entry.msgtype, entry.msgcount) for topic, entry in reader.topics.items()}
    assert {t: sorted(m) for t, m in ours.items()} == {t: sorted(m) for t, m in theirs.items()}


def test_big_endian_cdr(tmp_path):
    bag = write(tmp_path / "walk", capture(), "mcap", little_endian=False)
    table = index(tmp_path, [bag])
    assert table["stamp_ns"][:6].tolist() == [T0 + i * STEP for i in range(6)]
    assert len(dict(bags.read_pictures(table, tmp_path))) == 12
    assert bags.read_camera_info([bag], RAW).D == (0.01,) * 8


@pytest.mark.parametrize("form", ["ros1", "mcap"])
@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8", "mono8", "8UC1", "png", "jpeg"])
def test_every_encoding_gives_the_picture_in_bgr(tmp_path, form, encoding):
    image = picture(100)
    alpha = np.full_like(image[..., :1], 77)
    stored = {
        "rgb8": image[..., ::-1],
        "bgr8": image,
        "rgba8": np.concatenate([image[..., ::-1], alpha], axis=2),
        "bgra8": np.concatenate([image, alpha], axis=2),
        "mono8": image[..., :1],
        "8UC1": image[..., :1],
    }.get(encoding)
    sent = raw(RAW, T0, stored, encoding, padding=5) if stored is not None else None
    bag = write(tmp_path / "walk", [sent or packed(RAW, T0, image, {"png": ".png", "jpeg": ".jpg"}[encoding])], form)
    ((_, got),) = bags.read_pictures(rows(bag, RAW), tmp_path)
    wanted = np.repeat(image[..., :1], 3, axis=2) if encoding in ("mono8", "8UC1") else image
    assert np.abs(got.astype(int) - wanted).max() <= (8 if encoding == "jpeg" else 0)


@pytest.mark.parametrize("form", ["ros1", "db3"])
@pytest.mark.parametrize("encoding", ["yuv422_yuy2", "yuyv", "YUYV", "uyvy", "yuv422"])
def test_yuyv_and_uyvy_are_decoded_as_opencv_does(tmp_path, form, encoding):
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (10, 14, 2), dtype=np.uint8)
    luma_at = int(encoding in ("uyvy", "yuv422"))
    sent = raw("/cam02/image_raw", T0, pixels, encoding, padding=3, bigendian=1)
    bag = write(tmp_path / "a", [sent], form)
    table = rows(bag, RAW)
    ((_, got),) = bags.read_pictures(table, tmp_path)
    np.testing.assert_array_equal(
        got, cv2.cvtColor(pixels, cv2.COLOR_YUV2BGR_UYVY if luma_at else cv2.COLOR_YUV2BGR_YUYV)
    )
    grey = pixels.copy()
    grey[..., 1 - luma_at] = 128
    bag = write(tmp_path / "b", [raw("/cam02/image_raw", T0, grey, encoding)], form)
    ((_, got),) = bags.read_pictures(rows(bag, RAW), tmp_path)
    luma = np.clip((grey[..., luma_at].astype(float) - 16) * 255 / 219, 0, 255)
    assert np.abs(got.astype(float) - luma[..., None]).max() <= 1.5


def test_odd_yuyv_and_unknown_encodings_are_refused(tmp_path):
    odd = raw(RAW, T0, np.zeros((4, 5, 2), np.uint8), "yuyv")
    with pytest.raises(DiorError, match="yuyv cannot be 5 px wide"):
        index(tmp_path, [write(tmp_path / "a", [odd], "db3")], {"cam02": RAW})
    deep = raw(RAW, T0, np.zeros((4, 4, 2), np.uint8), "16UC1")
    with pytest.raises(
        DiorError, match="encoding '16UC1' is not one of rgb8, bgr8, rgba8, bgra8, mono8, 8UC1, yuv422_yuy2, yuyv"
    ):
        index(tmp_path, [write(tmp_path / "b", [deep], "db3")], {"cam02": RAW})


@pytest.mark.parametrize("form", ["ros1", "db3", "mcap"])
def test_leading_slash_may_be_left_out_on_either_side(tmp_path, form):
    bare = [packed("cam01/image_raw", T0 + i, picture(9)) for i in (0, 1)] + [info("cam01/camera_info", T0)]
    bag = write(tmp_path / "walk", bare, form)
    for topic in ("cam01/image_raw", "/cam01/image_raw"):
        table = index(tmp_path, [bag], {"cam01": topic})
        assert table["topic"].tolist() == [topic] * 2
        for _, got in bags.read_pictures(table, tmp_path):
            np.testing.assert_array_equal(got, picture(9))
        assert bags.read_camera_info([bag], topic).K[0] == 600
    with pytest.raises(DiorError, match="topic /cam01/image_raw is given twice"):
        index(tmp_path, [bag], {"cam01": "cam01/image_raw", "cam02": "/cam01/image_raw"})


def test_overlapping_bags_give_each_picture_once_and_count_the_rest(tmp_path):
    sent = [packed(JPEG, T0 + i * STEP, picture(i)) for i in range(10)]
    late = [packed(JPEG, T0 + i * STEP, picture(i), delay=9_000_000) for i in range(4, 10)]
    first, second = write(tmp_path / "one", sent[:6], "ros1"), write(tmp_path / "two", late, "mcap")
    table = index(tmp_path, [first, second], {"cam01": JPEG})
    assert table["stamp_ns"].tolist() == [T0 + i * STEP for i in range(10)]
    assert table["bag"].tolist() == ["one.bag"] * 6 + ["two"] * 4
    assert json.loads(tables.metadata(tmp_path / "frames.parquet")["recorded_twice"]) == {"cam01": 2}
    other = index(tmp_path, [second, first], {"cam01": JPEG})
    assert other["bag"].tolist() == ["one.bag"] * 4 + ["two"] * 6
    got = dict(bags.read_pictures(other, tmp_path))
    for i in range(10):
        np.testing.assert_array_equal(got[i], picture(i))


def test_a_camera_that_repeats_a_picture_in_one_bag_is_left_as_recorded(tmp_path):
    sent = [packed(JPEG, T0 + i, picture(1), delay=d) for i, d in ((0, 4_000_000), (0, 5_000_000), (9, 6_000_000))]
    table = index(tmp_path, [write(tmp_path / "one", sent, "db3")], {"cam01": JPEG})
    assert table["stamp_ns"].tolist() == [T0, T0, T0 + 9]
    assert json.loads(tables.metadata(tmp_path / "frames.parquet")["recorded_twice"]) == {"cam01": 0}


def test_a_folder_split_into_files(tmp_path):
    """rosbag2 splits by size or time and lists the parts in metadata.yaml."""
    folder = write(tmp_path / "walk", capture(3), "mcap")
    later = [packed(JPEG, T0 + i * STEP, picture(2 * (i - 1))) for i in range(3, 5)]
    write_plain_mcap(folder / "walk_1.mcap", later, "cdr")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("  - walk.mcap\n", "  - walk.mcap\n  - walk/walk_1.mcap\n"))
    table = index(tmp_path, [folder], {"cam01": JPEG})
    assert table["frame"].tolist() == list(range(5)) and set(table["bag"]) == {"walk"}
    assert len(dict(bags.read_pictures(table, tmp_path))) == 5
    # the last picture of the first file again: messages can be compared across the files of a bag
    assert bags.repeated(folder, [JPEG]) == {(JPEG, T0 + 3 * STEP + 4_000_000, 0)}


def test_size_behind_a_long_exif_segment(tmp_path):
    jpeg = cv2.imencode(".jpg", picture(50, (30, 90)))[1].tobytes()
    data = jpeg[:2] + (b"\xff\xe1\xff\xff" + bytes(65533)) * 3 + jpeg[2:]
    sent = packed(JPEG, T0, picture(0))
    sent.content["data"] = np.frombuffer(data, np.uint8)
    for form in ("ros1", "ros1 lz4", "db3", "db3 message", "mcap zstd"):
        table = bags.index(write(tmp_path / form, [sent], form), [JPEG])
        assert (table["height"][0], table["width"][0]) == (30, 90)


@pytest.mark.parametrize(
    "form, size, codecs, name",
    [
        ("ros1 bz2", (48, 64), rosbag1_reader.decompressors, "bz2"),
        ("mcap zstd", (240, 320), storage_mcap.DECOMPRESSORS, "zstd"),
    ],
)
def test_one_picture_is_read_without_the_chunks_of_the_others(tmp_path, monkeypatch, form, size, codecs, name):
    noise = np.random.default_rng(0)
    sent = [packed(JPEG, T0 + i, noise.integers(0, 256, (*size, 3), dtype=np.uint8)) for i in range(20)]
    bag = write(tmp_path / "walk", sent, form, chunk=20_000)
    table = index(tmp_path, [bag], {"cam01": JPEG})
    unpacked, original = [], codecs[name]
    monkeypatch.setitem(codecs, name, lambda *data: unpacked.append(1) or original(*data))
    got = dict(bags.read_pictures(tables.rows(table, table["frame"] == 11), tmp_path))
    assert len(got) == 1 and len(unpacked) == 1
    assert len(dict(bags.read_pictures(table, tmp_path))) == 20 and len(unpacked) > 3


@pytest.mark.parametrize("form", ["ros1", "db3", "mcap"])
@pytest.mark.parametrize("topic", ["/cam01/color/image_raw/compressed", "cam01/color/image_raw", "color/image_raw"])
def test_a_recorded_realsense_needs_a_person_to_name_its_model(tmp_path, form, topic):
    beside = topic.removesuffix("/compressed").removesuffix("image_raw") + "camera_info"
    lens = bags.read_camera_info([write(tmp_path / form, [info(beside, T0)], form)], topic)
    with pytest.raises(
        DiorError, match=r"cannot tell a RealSense's lens model.* add `distortion_model:` .*cam01\.yaml"
    ):
        intrinsics.from_camera_info(lens, topic, "", "cam01.yaml", SIZE)
    for model in ("plumb_bob", "inverse_brown_conrady"):
        assert intrinsics.from_camera_info(lens, topic, model, "cam01.yaml", SIZE).model == model
    plain = bags.read_camera_info([write(tmp_path / "plain", [info(beside, T0, (0.0,) * 5)], form)], topic)
    assert intrinsics.from_camera_info(plain, topic, "", "cam01.yaml", SIZE).model == "plumb_bob"


def test_recorded_lens_of_both_spellings_through_the_step(tmp_path):
    written = []
    for form in ("ros1", "db3"):
        bag = write(tmp_path / form, capture(), form)
        index(tmp_path, [bag])
        lens = bags.read_camera_info([bag], RAW)
        written.append(intrinsics.from_camera_info(lens, RAW, "", "cam02.yaml", SIZE))
    assert written[0] == written[1] and written[0].model == "rational_polynomial"


def test_camera_info_without_a_stamp_counts(tmp_path):
    """Some drivers stamp their pictures only, and a lens needs no stamp."""
    infos = [replace(info("/cam02/camera_info", T0 + i), stamp_ns=0) for i in (0, 1)]
    for form in ("ros1", "mcap"):
        assert bags.read_camera_info([write(tmp_path / form, infos, form)], RAW).K[0] == 600


def test_camera_info_that_changes_or_is_none(tmp_path):
    infos = [info("/cam02/camera_info", T0), info("/cam02/camera_info", T0 + 1, (0.2, 0, 0, 0, 0))]
    bag = write(tmp_path / "a", infos, "mcap")
    with pytest.raises(DiorError, match=r"a: message 1 of /cam02/camera_info says D \(0\.2"):
        bags.read_camera_info([bag], RAW)
    wrong = write(tmp_path / "b", [packed("/cam02/camera_info", T0, picture(1))], "mcap")
    with pytest.raises(DiorError, match="is a sensor_msgs/msg/CompressedImage, not sensor_msgs/msg/CameraInfo"):
        bags.read_camera_info([wrong], RAW)


def test_folder_without_metadata_or_with_a_lost_file(tmp_path):
    folder = write(tmp_path / "walk", capture(), "db3")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("- walk.db3", "- gone.db3"))
    with pytest.raises(DiorError, match=r"metadata\.yaml: it names gone\.db3, which is not there"):
        index(tmp_path, [folder])
    (folder / "metadata.yaml").write_text("a: 1")
    with pytest.raises(DiorError, match=r"names no file of the recording; try `ros2 bag reindex walk`"):
        index(tmp_path, [folder])
    (folder / "metadata.yaml").unlink()
    with pytest.raises(DiorError, match=r"walk: there is no metadata\.yaml .* give the \.db3 or \.mcap file itself"):
        index(tmp_path, [folder])


def test_database_whose_last_messages_are_in_its_journal(tmp_path):
    bag = write(tmp_path / "walk", capture(), "db3 alone")
    bag.with_name(bag.name + "-wal").write_bytes(b"x")
    with pytest.raises(DiorError, match=r"walk\.db3: .*its last messages are still in walk\.db3-wal"):
        index(tmp_path, [bag])


def test_mcap_of_another_profile(tmp_path):
    """Of the converters of ROS 1 bags to MCAP, which rosbags does not read."""
    bag = write(tmp_path / "walk", capture(), "mcap ros1")
    bag.write_bytes(bag.read_bytes().replace(b"ros2", b"ros1", 1))
    with pytest.raises(DiorError, match=r"walk\.mcap: this MCAP file is not of the profile ros2.*give that bag"):
        index(tmp_path, [bag])


def test_a_database_in_a_folder_of_any_name(tmp_path):
    folder = tmp_path / "50% of day #2?"
    folder.mkdir()
    bag = write(tmp_path / "walk", capture(), "db3 alone").rename(folder / "walk.db3")
    assert len(index(folder, [bag])["frame"]) == 12


def test_topic_in_another_encoding(tmp_path):
    bag = write(tmp_path / "walk", capture(), "db3 alone")
    with sqlite3.connect(bag) as base:
        base.execute("UPDATE topics SET serialization_format = 'cbor'")
    with pytest.raises(DiorError, match="message 0 of .* has no readable picture .its encoding is 'cbor'"):
        index(tmp_path, [bag])


def test_whole_file_is_unpacked_once_per_process(tmp_path, monkeypatch):
    bag = write(tmp_path / "walk", capture(), "db3 file")
    copies, original = [], containers.shutil.copyfileobj
    monkeypatch.setattr(containers.shutil, "copyfileobj", lambda *a: copies.append(1) or original(*a))
    table = index(tmp_path, [bag])
    assert len(dict(bags.read_pictures(table, tmp_path))) == 12 and len(copies) == 1


def test_what_is_unpacked_is_gone_when_a_step_has_ended(tmp_path):
    bag = write(tmp_path / "walk", capture(), "db3 file")
    kept = tmp_path / "kept"
    kept.mkdir()
    words = ["--sequence", "walk", "--bags", bag, "--data-root", tmp_path, "--topics", f"cam01={JPEG}"]
    command = [sys.executable, "-m", "dior", "frames", *words, "--out", tmp_path / "frames.parquet"]
    subprocess.run(command, env=os.environ | {"TMPDIR": str(kept)}, check=True)
    assert (tmp_path / "frames.parquet").is_file() and not [*kept.iterdir()]
