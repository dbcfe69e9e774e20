"""A bag as realsense-viewer records it, written here from librealsense's source, and image_transport's plugins."""

import struct

import numpy as np
import pytest
from rosbags import rosbag1

from dior.calibrate import intrinsics
from dior.errors import DiorError
from dior.ingest import audit, bags, frames, messages
from dior.project import cross_checks
from dior.tables import tables
from tests.ingest.bagfiles import INFO, STORES, T0, info, packed, picture, raw, serialized, write
from tests.ingest.test_bags_formats import index

TOPIC = "/device_0/sensor_1/Color_0/image/data"
BESIDE = "/device_0/sensor_1/Color_0/info/camera_info"
STEP = 33_333_333
SIZE = 64, 48
D = (0.1, -0.2, 0.001, 0.002, 0.05)


def viewers(path, model="Brown Conrady", d=D, encoding="rgb8", version="1", count=4):
    """Received since the start of the recording, with what stands behind a picture since frame_id is "1"; the lens has
    no stamp and no R and P, and beside the pictures are messages of other types."""
    store = STORES["ros1"]
    unit = struct.pack("<f", 0.001) if version == "1" else b""
    with rosbag1.Writer(path) as writer:
        lens = writer.add_connection(BESIDE, INFO, typestore=store)
        shown = writer.add_connection(TOPIC, "sensor_msgs/msg/Image", typestore=store)
        more = writer.add_connection(TOPIC.replace("data", "metadata"), "diagnostic_msgs/msg/KeyValue", typestore=store)
        sent = info(BESIDE, 0, d, model)
        sent.content["r"] = np.zeros(9)
        writer.write(lens, 1, serialized(sent, "ros1", frame_id=""))
        for i in range(count):
            image = picture(60 + 9 * i)[..., ::-1] if encoding == "rgb8" else picture(60 + 9 * i)[..., :1]
            one = serialized(raw(TOPIC, T0 + i * STEP, image, encoding), "ros1", frame_id=version)
            writer.write(shown, 2_000_000 + i * STEP, one + unit)
            pair = store.types["diagnostic_msgs/msg/KeyValue"](key="system_time", value="1.5")
            writer.write(more, 2_000_000 + i * STEP, store.serialize_ros1(pair, "diagnostic_msgs/msg/KeyValue"))
    return path


@pytest.mark.parametrize("version", ["1", ""])
@pytest.mark.parametrize("encoding", ["rgb8", "8UC1"])
def test_pictures_stamps_and_audit(tmp_path, version, encoding):
    table = index(tmp_path, [viewers(tmp_path / "a.bag", version=version, encoding=encoding)], {"cam01": TOPIC})
    assert table["stamp_ns"].tolist() == [T0 + i * STEP for i in range(4)]
    for row, got in bags.read_pictures(table, tmp_path):
        wanted = picture(60 + 9 * row) if encoding == "rgb8" else np.repeat(picture(60 + 9 * row)[..., :1], 3, axis=2)
        np.testing.assert_array_equal(got, wanted)
    audit.run(
        sequence="walk", frames=tmp_path / "frames.parquet", data_root=tmp_path,
        out=tmp_path / "o.parquet", out_dropped=tmp_path / "d.parquet", findings=tmp_path / "f.parquet",
    )  # fmt: skip
    # receive stamps count from the start
    found = tables.read(tmp_path / "f.parquet", "findings")
    assert dict(zip(found["code"], found["severity"], strict=True)) == {"clocks_differ": "info"}


def test_four_bytes_behind_another_message_are_damage():
    for frame_id, more in (("lens", 4), ("1", 3), ("1", 5)):
        one = serialized(raw(TOPIC, T0, picture(3), "bgr8"), "ros1", frame_id=frame_id) + bytes(more)
        with pytest.raises(ValueError, match="size mismatch"):
            messages.picture_of(messages.RAW, one, "ros1")


@pytest.mark.parametrize(
    "model, d, expected",
    [
        ("Brown Conrady", D, "plumb_bob"), ("Inverse Brown Conrady", D, "inverse_brown_conrady"),
        ("None", (0.0,) * 5, "plumb_bob"), ("Modified Brown Conrady", (0.1, 0.2, 0, 0, 0.3), "plumb_bob"),
        ("INVERSE_BROWN_CONRADY", D, "inverse_brown_conrady"),
    ],
)  # fmt: skip
def test_words_of_librealsense_are_believed(tmp_path, model, d, expected):
    lens = bags.read_camera_info([viewers(tmp_path / "a.bag", model, d)], TOPIC)
    found = intrinsics.from_camera_info(lens, TOPIC, "", "cam01.yaml", SIZE)
    assert found.model == expected and found.distortion[:5] == d and found.fx == 600


@pytest.mark.parametrize(
    "model, d, text",
    [
        ("Ftheta", D, "'Ftheta' is librealsense's word for a fisheye lens"),
        ("Kannala Brandt4", (0.0,) * 5, "'Kannala Brandt4' is librealsense's word for a fisheye lens"),
        ("Modified Brown Conrady", D, "bends by p1 and p2 what is bent by k1 to k3 already"),
        ("None", D, "a lens without distortion, and D is not zero"),
        ("Brown", D, "'Brown' is not one of plumb_bob, rational_polynomial"),
    ],
)
def test_words_that_are_refused(tmp_path, model, d, text):
    lens = bags.read_camera_info([viewers(tmp_path / "a.bag", model, d)], TOPIC)
    with pytest.raises(DiorError, match=rf"a\.bag: message 0 of {BESIDE}: distortion_model .*{text}.*in cam01\.yaml"):
        intrinsics.from_camera_info(lens, TOPIC, "", "cam01.yaml", SIZE)


def test_a_lens_anywhere_is_named_in_the_cameras_yaml(tmp_path):
    bag = write(tmp_path / "walk", [packed("/cam01/image_raw", T0 + i, picture(1)) for i in (0, 1)] +
        [info("/lens", T0, (0.0,) * 5)], "mcap")  # fmt: skip
    index(tmp_path, [bag], {"cam01": "/cam01/image_raw"})
    given = {
        "session": "lab", "camera": "cam01", "role": "close", "topic": "/cam01/image_raw", "source": "camera_info",
        "board": {}, "frames": tmp_path / "frames.parquet", "sequence": "walk", "data_root": tmp_path,
        "out": tmp_path / "out.parquet", "findings": tmp_path / "f.parquet",
    }  # fmt: skip
    with pytest.raises(
        DiorError, match="CameraInfo: topic /cam01/camera_info is not in .*the topics there are .*/lens"
    ):
        intrinsics.run(**given)
    intrinsics.run(**given, info_topic="lens")
    assert tables.read(tmp_path / "out.parquet", "cameras")["fx"].tolist() == [600.0]


def test_a_named_lens_without_effect_is_refused():
    camera = {"role": "close", "topic": "/a", "intrinsics": {"file": "a.toml", "name": "a"}, "camera_info": "/b"}
    with pytest.raises(DiorError, match="cam01.yaml: 'camera_info' has no effect"):
        cross_checks.check_camera(camera | {"locate": "marks", "nudge": {}}, "cam01.yaml")


def test_depth_pictures_are_refused_by_name(tmp_path):
    depth = packed("/depth/compressedDepth", T0, picture(1))
    depth.content.update(
        format="16UC1; compressedDepth png", data=np.concatenate([np.zeros(12, np.uint8), depth.content["data"]])
    )
    bag = write(tmp_path / "walk", [depth], "mcap")
    with pytest.raises(DiorError, match=r"it is a depth picture \(compressedDepth\).* name the topic in colour"):
        index(tmp_path, [bag], {"cam01": "/depth/compressedDepth"})


def test_cameras_of_the_same_topic_in_bags_of_their_own(tmp_path):
    bags_of = [viewers(tmp_path / f"{name}.bag", count=count) for name, count in (("a_123", 4), ("a_456", 3))]
    topics, out = {"cam01": TOPIC, "cam02": TOPIC}, tmp_path / "frames.parquet"

    def read(**in_bags):
        frames.run(sequence="walk", bags=bags_of, data_root=tmp_path, topics=topics, out=out, in_bags=in_bags)
        return tables.read(out, "frames")

    table = read(cam01="456", cam02="123")
    assert table["camera"].tolist() == ["cam01"] * 3 + ["cam02"] * 4
    assert table["bag"].tolist() == ["a_456.bag"] * 3 + ["a_123.bag"] * 4
    assert len(dict(bags.read_pictures(table, tmp_path))) == 7
    with pytest.raises(DiorError, match="topic .*Color_0/image/data is given twice"):
        read()
    with pytest.raises(DiorError, match=r"a_456\.bag: cam01 and cam02 are both its topic .*; give `bag`"):
        read(cam01="456", cam02="a_")
    with pytest.raises(DiorError, match=r"cam02: no bag has '789' in its name, .* they are a_123\.bag, a_456\.bag"):
        read(cam01="456", cam02="789")
