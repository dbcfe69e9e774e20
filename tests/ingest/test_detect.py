"""A network made here, whose maps are the picture's brightness: bright dots are found where they are."""

import json
import sys

import numpy as np
import pytest

from dior.body.names import COCO_17
from dior.errors import DiorError
from dior.ingest import detect, detections
from dior.tables import tables

onnx = pytest.importorskip("onnx", reason="pip install onnx")
pytest.importorskip("onnxruntime", reason="pip install -e '.[detect]'")

WIDTH, HEIGHT = 96, 128
K = len(COCO_17)


def network(path, head, batch="n", stride=1, keypoints=K):
    """Weights pick one colour for each keypoint: keypoint k looks for brightness in channel k % 3, scaled to 0-1."""
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    weights = np.zeros((keypoints, 3, 1, 1), np.float32)
    for k in range(keypoints):
        weights[k, k % 3] = detect.DEVIATION[k % 3] / 255
    bias = np.array([detect.MEAN[k % 3] / 255 for k in range(keypoints)], np.float32)
    made = [numpy_helper.from_array(weights, "weights"), numpy_helper.from_array(bias, "bias")]
    nodes = [helper.make_node("Conv", ["image", "weights", "bias"], ["bright"])]
    if stride > 1:
        sides = {"kernel_shape": [stride, stride], "strides": [stride, stride]}
        nodes.append(helper.make_node("MaxPool", ["bright"], ["maps"], **sides))
    last = "maps" if stride > 1 else "bright"
    if head == "simcc":
        made += [numpy_helper.from_array(np.array([-2]), "rows"), numpy_helper.from_array(np.array([-1]), "columns")]
        scales = numpy_helper.from_array(np.array([1, 1, 2], np.float32), "scales")
        made.append(scales)
        for axis, name in (("rows", "x"), ("columns", "y")):
            nodes.append(helper.make_node("ReduceMax", [last, axis], [f"{name}1"], keepdims=0))
            twice = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
            nodes.append(helper.make_node("Resize", [f"{name}1", "", "scales"], [f"simcc_{name}"], **twice))
        outputs = ["simcc_x", "simcc_y"]
    else:
        outputs = [last]
    float32 = onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        nodes, "brightness", [helper.make_tensor_value_info("image", float32, [batch, 3, HEIGHT, WIDTH])],
        [helper.make_tensor_value_info(name, float32, None) for name in outputs], made,
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.save(model, path)
    return path


def picture(dots, width=WIDTH, height=HEIGHT):
    """A dark BGR picture with a dot (u, v) per colour of red, green, blue."""
    made = np.zeros((height, width, 3), np.uint8)
    for channel, (u, v) in enumerate(dots):
        made[v, u, 2 - channel] = 255
    return made


DOTS = ((20, 30), (60, 100), (45, 64))


@pytest.mark.parametrize("head", ["simcc", "heat_maps"])
@pytest.mark.parametrize("batch", ["n", 1, 4])
def test_dots_are_found_at_their_places(tmp_path, head, batch):
    net = detect.load(network(tmp_path / "net.onnx", head, batch))
    assert (net.width, net.height, net.batch) == (WIDTH, HEIGHT, detect.BATCH if batch == "n" else batch)
    pictures = [picture(DOTS)] if batch == 1 else [picture(DOTS), picture(DOTS[::-1])]
    points = detect.look(net, pictures, [detect.whole(one) for one in pictures])
    assert points.shape == (len(pictures), K, 3)
    for one, dots in zip(points, (DOTS, DOTS[::-1]), strict=False):
        np.testing.assert_allclose(one[:3, :2], dots, atol=1e-4)
        np.testing.assert_allclose(one[:, 2], 1.0, atol=1e-4)


def test_a_quarter_towards_the_higher_neighbour():
    net = detect.Network(None, WIDTH, HEIGHT, 1, "net")
    maps = np.zeros((1, 17, HEIGHT // 4, WIDTH // 4), np.float32)
    maps[0, :, 5, 7], maps[0, :, 5, 8], maps[0, :, 4, 7], maps[0, 1] = 0.9, 0.5, 0.2, 0.0
    maps[0, 1, 0, 0] = 0.4
    points = detect.from_heat_maps(maps, net)
    np.testing.assert_allclose(points[0, 0], [4 * 7.25, 4 * 4.75, 0.9], rtol=1e-6)
    # at the border the missing neighbour is no lower than the place itself
    np.testing.assert_allclose(points[0, 1], [-1.0, -1.0, 0.4], rtol=1e-6)


def test_simcc_of_any_ratio():
    net = detect.Network(None, WIDTH, HEIGHT, 1, "net")
    x, y = np.zeros((1, 17, 2 * WIDTH), np.float32), np.zeros((1, 17, 4 * HEIGHT), np.float32)
    x[..., 31], y[..., 50] = 0.8, 0.6
    np.testing.assert_allclose(detect.from_simcc(x, y, net)[0, 3], [15.5, 12.5, 0.6], rtol=1e-6)


def test_crop_goes_to_the_network_and_back():
    """The middle of the box is the middle of the input; its longer side, in the network's shape, fills it."""
    scale, du, dv = detect.to_picture((100.0, 50.0, 195.0, 305.0), WIDTH, HEIGHT)
    assert scale == 2.0
    assert scale * (WIDTH - 1) / 2 + du == 147.5 and scale * (HEIGHT - 1) / 2 + dv == 177.5
    assert detect.to_picture((0, 0, WIDTH - 1, HEIGHT - 1), WIDTH, HEIGHT) == (1.0, 0.0, 0.0)


def bag_of(tmp_path, pictures):
    """A ROS 1 bag with raw pictures of cam01, and its index."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    from dior.ingest import frames

    store = get_typestore(Stores.ROS1_NOETIC)
    kind = store.types["sensor_msgs/msg/Image"]
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with Writer(tmp_path / "walk.bag") as writer:
        connection = writer.add_connection("/cam01/image_raw", kind.__msgtype__, typestore=store)
        for i, one in enumerate(pictures):
            height, width = one.shape[:2]
            stamp = 1_708_000_000 * 10**9 + i * 33_000_000
            message = kind(
                header(i, time(stamp // 10**9, stamp % 10**9), "cam01"),
                height,
                width,
                "bgr8",
                0,
                3 * width,
                one.ravel(),
            )
            writer.write(connection, stamp, store.serialize_ros1(message, kind.__msgtype__))
    frames.run(
        sequence="walk", bags=[tmp_path / "walk.bag"], data_root=tmp_path, topics={"cam01": "/cam01/image_raw"},
        out=tmp_path / "indexed.parquet",
    )  # fmt: skip


@pytest.mark.parametrize("crop, within", [("whole", 4.0), ("person", 1.2)])
def test_the_step_writes_what_detections_reads(tmp_path, crop, within):
    """Pictures four times the network's size: looking again at the box brings the dots nearer. One is dark: nobody."""

    def at(i):
        return ((160 + 2 * i, 200), (200 + 2 * i, 300), (180, 260 + i))

    def scene(i):
        made = np.zeros((4 * HEIGHT, 4 * WIDTH, 3), np.uint8)
        for channel, (u, v) in enumerate(at(i)):
            made[v - 6 : v + 7, u - 6 : u + 7, 2 - channel] = 255 - 15 * np.add.outer(*2 * [np.abs(np.arange(-6, 7))])
        return made

    dark = np.zeros((4 * HEIGHT, 4 * WIDTH, 3), np.uint8)
    bag_of(tmp_path, [scene(0), scene(1), dark, scene(3)])
    arguments = {
        "sequence": "walk", "camera": "cam01", "frames": tmp_path / "indexed.parquet", "data_root": tmp_path,
        "model": network(tmp_path / "net.onnx", "heat_maps"), "crop": crop, "out": tmp_path / "cam01.json",
    }  # fmt: skip
    detect.run(**arguments)
    first = (tmp_path / "cam01.json").read_bytes()
    detect.run(**arguments)
    assert (tmp_path / "cam01.json").read_bytes() == first
    assert [one["image_id"] for one in json.loads(first)] == [0, 1, 3]
    detections.run(
        looked_at=[], sequence="walk", pattern=str(tmp_path / "{camera}.json"), cameras=["cam01"], format="coco",
        frames=tmp_path / "indexed.parquet", out=tmp_path / "out.parquet", findings=tmp_path / "f.parquet",
    )  # fmt: skip
    grid, joints = tables.grid(tables.read(tmp_path / "out.parquet", "detections"), "u", "v")
    assert tuple(joints) == COCO_17 and np.isnan(grid[2]).all()
    for i in (0, 1, 3):
        assert np.abs(grid[i, :3] - at(i)).max() <= within


def test_clear_words_where_something_is_missing(tmp_path, monkeypatch):
    for missing in ("none.onnx", "none.task", ""):
        with pytest.raises(DiorError, match=rf"detector\.model '{missing}': there is no such file"):
            detect.run(
                sequence="walk", camera="cam01", frames="", data_root="", crop="whole", model=missing, out="out.json"
            )  # fmt: skip
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"\x08\x09junk")
    with pytest.raises(DiorError, match=r"detector\.model .*broken\.onnx: not a network that ONNX Runtime reads"):
        detect.load(broken)
    net = detect.load(network(tmp_path / "five.onnx", "heat_maps", keypoints=5))
    with pytest.raises(DiorError, match=r"outputs of shape \[\(1, 5, 128, 96\)\] are no heads for 17"):
        detect.look(net, [picture(DOTS)], [(0, 0, 9, 9)])
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(DiorError, match=r"needs onnxruntime; install it: pip install -e '\.\[detect\]'"):
        detect.load(tmp_path / "five.onnx")


def test_nobody_anywhere_is_an_error(tmp_path):
    bag_of(tmp_path, [np.zeros((HEIGHT, WIDTH, 3), np.uint8)] * 2)
    with pytest.raises(DiorError, match="walk, cam01: .*net.onnx found nobody in any of 2 pictures"):
        detect.run(
            sequence="walk", camera="cam01", frames=tmp_path / "indexed.parquet", data_root=tmp_path, crop="whole",
            model=network(tmp_path / "net.onnx", "simcc"), out=tmp_path / "out.json",
        )  # fmt: skip


@pytest.mark.slow
def test_only_the_sequences_that_ask_for_it_in_the_sheet_are_detected(tmp_path):
    from dior.simulate import config, settings
    from tests.end_to_end.workflow import edit, planned, snakemake

    tiny = {"subjects": 1, "sequences": 2, "environments": ["outdoor"], "duration_s": 1.0}
    config.write(settings.from_dict(tiny), tmp_path / "config")
    edit(tmp_path / "config/sequences.tsv", "outdoor_02/mlkit/{camera}.jsonl", "detect")
    code, said = snakemake(tmp_path, "-n", check=False)
    assert code and "sequence 'outdoor_02' has 'detections: detect', which needs the pose network" in said
    edit(tmp_path / "config/config.yaml", 'model: ""', "model: net.onnx")
    code, said = snakemake(tmp_path, "-n", check=False)
    assert code and "`detector.model` in config/config.yaml is 'net.onnx', where there is no file" in said
    (tmp_path / "net.onnx").touch()
    assert planned(tmp_path, "--until", "detections") | {"simulate": 0} == {
        "simulate": 0, "frames": 2, "detect": 3, "detections": 2
    }  # fmt: skip
