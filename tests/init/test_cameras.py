"""Which topics are cameras, and what they are called."""

from dior.ingest.glance import Stream
from dior.ingest.messages import CAMERA_INFO
from dior.init import cameras
from dior.init.found import Recording
from dior.init.walks import Walk
from tests.init.test_walks import KIND, T0, S, recorded


def bag(path, *topics, start_s=0, lenses=()):
    first, last = T0 + start_s * S, T0 + (start_s + 10) * S
    streams = tuple(Stream(topic, KIND, 100, first, last, 48, 64, 10.0) for topic in topics)
    there = {**dict.fromkeys(topics, KIND), **dict.fromkeys(lenses, CAMERA_INFO)}
    return Recording(path, "bag", streams, first, last, "stamps", there)


def filmed(*recordings, known=()):
    found, videos, aside = cameras.filmed(Walk(recordings, ("w",) * len(recordings), ()), known)
    assert not aside
    return found, videos


def test_of_a_camera_with_many_topics_the_colour_is_taken():
    kinds = [
        "color/image_raw", "color/image_raw/compressed", "depth/image_rect_raw", "infra1/image_rect_raw",
        "aligned_depth_to_color/image_raw/compressedDepth",
    ]  # fmt: skip
    topics = [f"/{camera}/{kind}" for camera in ("cam01", "cam02") for kind in kinds]
    found, videos = filmed(bag("w.bag", *topics, lenses=["/cam01/color/camera_info", "/cam01/depth/camera_info"]))
    assert videos == "" and [(one.name, one.topic, one.bag) for one in found] == [
        (camera, f"/{camera}/color/image_raw/compressed", "") for camera in ("cam01", "cam02")
    ]
    assert [one.info for one in found] == ["/cam01/color/camera_info", ""]
    assert found[0].reasons == ("in w.bag", "chosen before /cam01/color/image_raw")


def test_two_eyes_are_two_cameras():
    found, _ = filmed(bag("w.bag", "/zed/left/image_rect", "/zed/right/image_rect"))
    assert [one.name for one in found] == ["zed_left", "zed_right"]


def test_one_topic_in_bags_that_ran_at_once_is_several_cameras():
    topic = "/device_0/sensor_1/Color_0/image/data"
    found, _ = filmed(bag("w/0123_hall.bag", topic), bag("w/0456_hall.bag", topic, start_s=1))
    assert [(one.name, one.bag, one.paths) for one in found] == [
        ("cam0123", "0123", ("w/0123_hall.bag",)), ("cam0456", "0456", ("w/0456_hall.bag",)),
    ]  # fmt: skip
    found, _ = filmed(bag("cam1/w.bag", "/camera/color/image_raw"), bag("cam2/w.bag", "/camera/color/image_raw"))
    assert [(one.name, one.bag) for one in found] == [("cam1", "TODO"), ("cam2", "TODO")]


def test_one_topic_in_bags_that_follow_each_other_is_one_camera():
    found, _ = filmed(bag("pc1_0.bag", "/cam01/image_raw"), bag("pc1_1.bag", "/cam01/image_raw", start_s=11))
    assert [(one.name, one.bag, len(one.paths)) for one in found] == [("cam01", "", 2)]


def test_videos_are_called_as_one_path_tells_beside_those_in_bags():
    found, videos = filmed(bag("w/pc1.bag", "/cam01/image_raw"), recorded("w/cam08.mp4"), recorded("w/cam09.mp4"))
    assert videos == "w/{camera}.mp4" and [one.name for one in found] == ["cam01", "cam08", "cam09"]
    assert [one.topic for one in found] == ["/cam01/image_raw", "", ""]
    found, videos, aside = cameras.filmed(Walk((recorded("w/Küche.mp4"), recorded("w/Flur.mp4")), ("w", "w"), ()), ())
    assert not found and not videos and "rename the files" in aside[0][1]


def test_cameras_are_called_as_the_files_that_have_their_numbers():
    assert cameras.renamed(["camera_1", "camera_2"], ["cam01", "cam02"]) == {"camera_1": "cam01", "camera_2": "cam02"}
    assert cameras.renamed(["Cam_01", "Cam_02"], ["cam1"]) == {"Cam_01": "cam1"}
    assert cameras.renamed(["cam01", "cam02"], ["cam02"]) is None
    assert cameras.renamed(["left", "right"], ["a", "b"]) is None
    assert cameras.renamed(["cam01", "kam01"], ["c1"]) is None


def test_of_several_transports_the_one_with_most_messages_is_taken():
    whole, part = (Stream(topic, KIND, count, T0, T0 + S, 48, 64, 10.0) for topic, count in (
        ("/cam01/image_raw", 100), ("/cam01/image_raw/compressed", 60)))  # fmt: skip
    one = Recording("w.bag", "bag", (part, whole), T0, T0 + S, "stamps", {})
    found, _ = filmed(one)
    assert [camera.topic for camera in found] == ["/cam01/image_raw"]
