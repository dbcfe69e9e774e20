"""Intrinsics from CameraInfo messages written here, from a TOML file, and from the real recording."""

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from dior.calibrate import intrinsics
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.tables import tables

STORE = get_typestore(Stores.ROS1_NOETIC)
TYPES = STORE.types
T0 = 1_708_000_000_000_000_000
REALSENSE = "/cam01/color/image_raw/compressed"
OTHER = "/cam01/rgb/image_raw/compressed"
K = (600.0, 0, 320.5, 0, 601.0, 240.25, 0, 0, 1)
IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)
# another focal length and middle than K, and the second camera of a pair: P[3] is its distance times -fx
P = (560.0, 0, 318.0, -56.0, 0, 560.0, 242.0, 0, 0, 0, 1, 0)
TOML = """
[cam_01]
name = "cam_01"
size = [640.0, 480.0]
matrix = [[600.0, 0.0, 320.5], [0.0, 601.0, 240.25], [0.0, 0.0, 1.0]]
distortions = [0.1, -0.2, 0.001, 0.002]
fisheye = false
"""


def camera_info(d=(), k=K, model="plumb_bob", width=640, height=480, second=0, p=(0,) * 12, r=IDENTITY, **window):
    """`window`: binning_x, binning_y; left, top, wide, high of the region of interest."""
    time = TYPES["builtin_interfaces/msg/Time"](sec=T0 // 10**9 + second, nanosec=0)
    window = dict.fromkeys(("binning_x", "binning_y", "left", "top", "wide", "high"), 0) | window
    roi = TYPES["sensor_msgs/msg/RegionOfInterest"](
        x_offset=window["left"], y_offset=window["top"], height=window["high"], width=window["wide"], do_rectify=False
    )
    return TYPES["sensor_msgs/msg/CameraInfo"](
        header=TYPES["std_msgs/msg/Header"](seq=second, stamp=time, frame_id="lens"),
        height=height, width=width, distortion_model=model, D=np.array(d, float), K=np.array(k, float),
        R=np.array(r, float), P=np.array(p, float), binning_x=window["binning_x"], binning_y=window["binning_y"],
        roi=roi,
    )  # fmt: skip


def run(tmp_path, infos=None, topic=REALSENSE, size=(640, 480), **kwargs):
    """Write a bag with the CameraInfo messages and a frames table that points to it, and run the step."""
    (tmp_path / "a.bag").unlink(missing_ok=True)
    if infos:
        info_topic = topic.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"
        with Writer(tmp_path / "a.bag") as writer:
            connection = writer.add_connection(info_topic, infos[0].__msgtype__, typestore=STORE)
            for i, info in enumerate(infos):
                writer.write(connection, T0 + i, STORE.serialize_ros1(info, info.__msgtype__))
    frames = {"camera": ["cam01"], "frame": [0], "stamp_ns": [T0], "receive_ns": [T0], "bag": ["a.bag"]}
    frames |= {"topic": [topic], "nth": [0], "height": [size[1]], "width": [size[0]]}
    tables.write(tmp_path / "frames.parquet", "frames", frames)
    arguments = {
        "session": "lab", "camera": "cam01", "role": "close", "topic": topic, "source": "camera_info", "name": "",
        "board": {}, "distortion_model": "", "frames": tmp_path / "frames.parquet", "sequence": "walk",
        "data_root": tmp_path, "out": tmp_path / "out.parquet", "findings": tmp_path / "findings.parquet",
    }  # fmt: skip
    intrinsics.run(**(arguments | kwargs))
    return camera_tables.read_cameras(tmp_path / "out.parquet")["cam01"]


@pytest.mark.parametrize("count, model", [(4, "plumb_bob"), (5, "plumb_bob"), (8, "rational_polynomial")])
def test_camera_info(tmp_path, count, model):
    d = tuple(0.01 * (i + 1) for i in range(count))
    camera = run(tmp_path, [camera_info(d, model=model), camera_info(d, model=model, second=1)], OTHER)
    lens = camera.intrinsics
    assert (lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy) == (640, 480, 600, 601, 320.5, 240.25)
    assert lens.model == model and lens.distortion == d + (0.0,) * (8 - count)
    assert camera.wTc is None and camera.role == "close"
    assert tables.read(tmp_path / "out.parquet", "cameras")["session"].tolist() == ["lab"]


def test_realsense_colour_topic_needs_a_model_from_a_person(tmp_path):
    info = camera_info((0.1, -0.2, 0, 0, 0.05))
    with pytest.raises(DiorError) as error:
        run(tmp_path, [info])
    text = str(error.value)
    for part in ("cannot tell", "inverse_brown_conrady", "`distortion_model:`", "sessions/lab/cam01.yaml"):
        assert part in text
    camera = run(tmp_path, [info], distortion_model="inverse_brown_conrady")
    assert camera.intrinsics.model == "inverse_brown_conrady"


def test_realsense_without_distortion_needs_no_word(tmp_path):
    assert run(tmp_path, [camera_info((0, 0, 0, 0, 0))]).intrinsics.model == "plumb_bob"


def test_picture_size_unlike_the_intrinsics(tmp_path):
    with pytest.raises(DiorError, match=r"session lab, cam01 .*pictures are 1280x720 but the intrinsics .* 640x480"):
        run(tmp_path, [camera_info((0, 0, 0, 0, 0))], size=(1280, 720))


def test_camera_info_that_changes_names_the_first_that_differs(tmp_path):
    zeros = (0, 0, 0, 0, 0)
    other = (*K[:2], 321.5, *K[3:])
    infos = [camera_info(zeros), camera_info(zeros), camera_info(zeros, other), camera_info(zeros, width=2)]
    with pytest.raises(DiorError, match=r"a\.bag: message 2 of /cam01/color/camera_info says K .*321\.5"):
        run(tmp_path, infos)


@pytest.mark.parametrize(
    "info, text",
    [
        (camera_info((0,) * 5, k=(0,) * 9), "K is all zero"),
        (camera_info((0,) * 4, model="equidistant"), "'equidistant' is not one of plumb_bob, rational_polynomial"),
        (camera_info((0,) * 3), "D has 3 numbers, not 4, 5 or 8"),
        (camera_info((0, 0, 0, 0, 0, 0.1, 0, 0)), "k4, k5 and k6 are given"),
        (camera_info((0,) * 5, k=(600, 2.0, *K[2:])), "skew 2.0"),
        (camera_info((0,) * 5, k=(600, 0, 0, 0, 600, 0, 320, 240, 1)), "it looks transposed"),
    ],
)
def test_refused_camera_info(tmp_path, info, text):
    with pytest.raises(DiorError, match=text):
        run(tmp_path, [info], OTHER)


@pytest.mark.parametrize(
    "name", ["image_rect", "image_rect_color/compressed", "image_rect_raw", "image_rect/compressed"]
)
@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_rectified_pictures_have_P_and_no_distortion(tmp_path, name, model):
    lens = run(tmp_path, [camera_info((0.1, -0.2, 0, 0), model=model, p=P)], f"/cam01/{name}").intrinsics
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == (560, 560, 318, 242)
    assert lens.model == "plumb_bob" and not any(lens.distortion) and (lens.width, lens.height) == (640, 480)
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert list(zip(found["severity"], found["code"], strict=True)) == [("info", "rectified_pictures")]


def test_rectified_pictures_that_are_turned_or_whose_P_is_zero_or_whose_lens_is_another(tmp_path):
    c, s = np.cos(0.01), np.sin(0.01)
    run(tmp_path, [camera_info(p=P, r=(c, 0, s, 0, 1, 0, -s, 0, c), d=(0,) * 5)], "/cam01/image_rect")
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert found["severity"].tolist() == ["warning"] and "turned by 0.57 degrees" in found["text"][0]
    with pytest.raises(
        DiorError, match="P is all zero, so nothing tells the focal length of the rectified pictures on /c"
    ):
        run(tmp_path, [camera_info((0,) * 5)], "/cam01/image_rect")
    (tmp_path / "calib.toml").write_text(TOML)
    run(tmp_path, topic="/cam01/image_rect", source="calib.toml", name="cam_01")
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert (found["severity"][0], found["code"][0]) == ("warning", "rectified_with_distortion")


@pytest.mark.parametrize(
    "window, size, middle",
    [
        ({"binning_x": 1, "binning_y": 1}, (640, 480), (320.5, 240.25)),
        ({"wide": 640, "high": 480}, (640, 480), (320.5, 240.25)),
        ({"binning_x": 2, "binning_y": 2}, (320, 240), (160.0, 119.875)),
        ({"left": 100, "top": 40, "wide": 400, "high": 300}, (400, 300), (220.5, 200.25)),
        ({"left": 400, "top": 40, "wide": 200, "high": 300}, (200, 300), (-79.5, 200.25)),
        ({"left": 100, "top": 40, "wide": 400, "high": 300, "binning_x": 2, "binning_y": 2}, (200, 150), (110, 99.875)),
    ],
)
def test_a_part_of_the_sensor_or_binned_pixels_have_their_own_middle_and_focal_length(tmp_path, window, size, middle):
    """Pixel n of binned ones lies between 2n and 2n + 1."""
    lens = run(tmp_path, [camera_info((0.1,) * 5, **window)], OTHER, size).intrinsics
    n = max(window.get("binning_x", 1), 1)
    assert (lens.cx, lens.cy) == pytest.approx(middle) and (lens.fx, lens.fy) == (600 / n, 601 / n)
    assert (lens.width, lens.height) == size and lens.distortion[:5] == (0.1,) * 5


@pytest.mark.parametrize(
    "window, size",
    [
        ({"binning_x": 2, "binning_y": 2}, (640, 480)),
        ({"binning_x": 2, "binning_y": 1}, (320, 240)),
        ({"wide": 400, "high": 300}, (640, 480)),
        ({"left": 100, "top": 40, "wide": 640, "high": 480}, (640, 480)),
        ({"left": 100}, (640, 480)),
    ],
)
def test_a_region_or_binning_that_contradicts_the_sizes_is_refused(tmp_path, window, size):
    said = r"camera_info: by its region of interest .* of 640x480 px, the pictures would be .*, and they are "
    for topic in (OTHER, "/cam01/rgb/image_rect"):
        with pytest.raises(DiorError, match=said + f"{size[0]}x{size[1]}, so what K is of cannot be told"):
            run(tmp_path, [camera_info((0,) * 5, p=P, **window)], topic, size)


def test_no_camera_info_in_the_bag(tmp_path):
    run(tmp_path, [camera_info((0,) * 5)], OTHER)
    with pytest.raises(DiorError, match=r"topic /cam02/rgb/camera_info is not in .*there are /cam01/rgb/camera_info"):
        intrinsics.run(
            session="lab", camera="cam01", role="close", topic="/cam02/rgb/image_raw", source="camera_info", name="",
            board={}, distortion_model="", frames=tmp_path / "frames.parquet", sequence="walk", data_root=tmp_path,
            out=tmp_path / "out.parquet", findings=tmp_path / "findings.parquet",
        )  # fmt: skip


def test_toml(tmp_path):
    (tmp_path / "calib.toml").write_text(TOML)
    lens = run(tmp_path, source="calib.toml", name="cam_01").intrinsics
    assert (lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy) == (640, 480, 600, 601, 320.5, 240.25)
    assert lens.model == "plumb_bob" and lens.distortion == (0.1, -0.2, 0.001, 0.002, 0, 0, 0, 0)


def test_how_well_a_lens_is_known_is_the_makers_unless_a_person_says_it(tmp_path):
    (tmp_path / "calib.toml").write_text(TOML)
    from_file = {"source": "calib.toml", "name": "cam_01"}
    assert run(tmp_path, [camera_info((0,) * 5)], OTHER).intrinsics.sigma == 0.003
    assert run(tmp_path, **from_file).intrinsics.sigma == 0.003
    assert run(tmp_path, **from_file, sigma="0.001").intrinsics.sigma == 0.001
    assert run(tmp_path, **from_file, sigma="0").intrinsics.sigma == 0


@pytest.mark.parametrize(
    ("distortions", "hint"),
    [([-0.0007, 0.0022, 9.5e-06, 1e-05], True), ([-0.046, 0.14, 6e-4, 7e-4], False), ([0.0] * 4, False)],
)
def test_coefficients_that_may_be_a_64th_are_hinted_at(tmp_path, distortions, hint):
    (tmp_path / "calib.toml").write_text(TOML.replace("[0.1, -0.2, 0.001, 0.002]", str(distortions)))
    run(tmp_path, source="calib.toml", name="cam_01")
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert list(zip(found["severity"], found["code"], strict=True)) == [("info", "tiny_distortion")] * hint
    assert not hint or "calib.toml [cam_01]: all distortion coefficients are below 0.003" in found["text"][0]


@pytest.mark.parametrize(
    ("scale", "size"),
    [(0.5, "320 x 240"), (2 / 3, "427 x 320"), (1.5, "960 x 720"), (0.95, ""), (1.0, ""), (1.12, ""), (0.85, "")],
)
def test_a_matrix_of_pictures_of_another_size_is_hinted_at(tmp_path, scale, size):
    """Where twice the principal point is that of such pictures; a lens that is off its sensor's middle is none."""
    (tmp_path / "calib.toml").write_text(
        TOML.replace("320.5", f"{320.5 * scale}").replace("240.25", f"{240.25 * scale}")
    )
    run(tmp_path, source="calib.toml", name="cam_01")
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert list(zip(found["severity"], found["code"], strict=True)) == [("warning", "lens_of_other_size")] * bool(size)
    assert not size or f"of pictures of 640 x 480 px, and near that of {size}; is K" in found["text"][0]


@pytest.mark.parametrize(
    "old, new, name, text",
    [
        ("", "", "cam_1", "no camera 'cam_1' .did you mean 'cam_01'"),
        ("size", "sizes", "cam_01", "`size` is missing"),
        ("fisheye = false", "fisheye = true", "cam_01", "fisheye"),
        ("[640.0, 480.0]", "[640.0]", "cam_01", "`size` must be 2 numbers"),
        ("[0.1, ", "[", "cam_01", "`distortions` must be 4 or 5 or 8 numbers, and there is 3"),
        ("[cam_01]", "[cam_01", "cam_01", "not readable as TOML"),
    ],
)
def test_refused_toml(tmp_path, old, new, name, text):
    (tmp_path / "calib.toml").write_text(TOML.replace(old, new) if old else TOML)
    with pytest.raises(DiorError, match=text):
        run(tmp_path, source="calib.toml", name=name)


def test_intrinsics_of_the_other_frame_of_a_turned_video_are_refused_by_name(tmp_path):
    (tmp_path / "calib.toml").write_text(TOML)
    of = {"source": "calib.toml", "name": "cam_01"}
    with pytest.raises(
        DiorError, match=r"480x640 as shown .* write `video: \{frame: stored\}` into sessions/lab/cam01"
    ):
        run(tmp_path, topic="video0", size=(480, 640), **of)
    with pytest.raises(DiorError, match=r"480x640 as stored .* `video: \{frame: shown\}`"):
        run(tmp_path, topic="video0/stored", size=(480, 640), **of)
    with pytest.raises(DiorError, match="the pictures are 480x641 but the intrinsics are for 640x480"):
        run(tmp_path, topic="video0", size=(480, 641), **of)
    with pytest.raises(DiorError, match=r"'intrinsics' is camera_info, which a\.bag has not"):
        run(tmp_path, topic="video0")


def test_toml_that_is_not_there(tmp_path):
    with pytest.raises(DiorError, match=r"gone\.toml: there is no such file"):
        run(tmp_path, source="gone.toml", name="cam_01")


def test_camera_without_frames_and_unknown_model(tmp_path):
    (tmp_path / "calib.toml").write_text(TOML)
    with pytest.raises(DiorError, match="has no frame of cam09"):
        run(tmp_path, source="calib.toml", name="cam_01", camera="cam09")
    with pytest.raises(DiorError, match="did you mean 'plumb_bob'"):
        run(tmp_path, source="calib.toml", name="cam_01", distortion_model="plumbob")


def test_real_outdoor_camera_info_and_toml_agree(shared, tmp_path):
    root = shared / "real_outdoor"
    frames = {"camera": ["cam03"], "frame": [0], "stamp_ns": [T0], "receive_ns": [T0], "bag": ["pc2.bag"]}
    frames |= {"topic": ["/cam03/color/image_raw/compressed"], "nth": [0], "height": [1920], "width": [1088]}
    tables.write(tmp_path / "frames.parquet", "frames", frames)
    lenses = []
    for source, name in (("camera_info", ""), ("reference/calibration.toml", "cam_03")):
        intrinsics.run(
            session="beam", camera="cam03", role="close", topic=frames["topic"][0], source=source, name=name,
            board={}, distortion_model="plumb_bob", frames=tmp_path / "frames.parquet", sequence="beam",
            data_root=root, out=tmp_path / "out.parquet", findings=tmp_path / "findings.parquet",
        )  # fmt: skip
        lenses.append(camera_tables.read_cameras(tmp_path / "out.parquet")["cam03"].intrinsics)
    assert lenses[0] == lenses[1]
    assert lenses[0].fx == pytest.approx(1681.598, abs=1e-3)
