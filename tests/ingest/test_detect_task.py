"""MediaPipe's task file: a stand-in with the interface of its pose landmarker, and the package itself where it is."""

import sys
import zipfile
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.ingest import detect, detect_task, detections, frames
from dior.tables import tables
from tests.ingest.bagfiles import raw, write

HEIGHT, WIDTH = 120, 160


def person(u, v, visibility=0.9):
    """Landmarks as fractions of the picture, one px apart to the right, the first at (u, v)."""
    return [
        SimpleNamespace(x=(u + i + 0.5) / WIDTH, y=(v + 0.5) / HEIGHT, z=0.0, visibility=visibility, presence=0.5)
        for i in range(33)
    ]


class StandIn:
    """Finds a person at every red dot; its pictures are RGB."""

    def __init__(self, landmarks_of=person):
        self.closed, self.landmarks_of = False, landmarks_of

    def detect(self, image):
        assert image.image_format == "SRGB" and image.data.flags.c_contiguous and not self.closed
        v, u = np.nonzero(image.data[..., 0] > 200)
        people = [self.landmarks_of(*at) for at in zip(u.tolist(), v.tolist(), strict=True)]
        return SimpleNamespace(pose_landmarks=people, pose_world_landmarks=[])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.closed = True


def stand_in(monkeypatch, landmarker=None, error=None):
    """Put a package `mediapipe` in place that opens `landmarker`; the options that it was asked for are returned."""
    asked = []

    def create(options):
        asked.append(options)
        if error:
            raise error
        return landmarker

    vision = SimpleNamespace(
        PoseLandmarkerOptions=lambda **options: options, RunningMode=SimpleNamespace(IMAGE="IMAGE"),
        PoseLandmarker=SimpleNamespace(create_from_options=create),
    )  # fmt: skip
    package, tasks, python = ModuleType("mediapipe"), ModuleType("mediapipe.tasks"), ModuleType("mediapipe.python")
    package.Image, package.ImageFormat = SimpleNamespace, SimpleNamespace(SRGB="SRGB")
    python.BaseOptions, python.vision = lambda **options: options, vision
    package.tasks, tasks.python = tasks, python
    for name, module in (("mediapipe", package), ("mediapipe.tasks", tasks), ("mediapipe.tasks.python", python)):
        monkeypatch.setitem(sys.modules, name, module)
    return asked


def recorded(tmp_path, dots):
    """A bag of black pictures with red dots, and what `detect` is called with."""
    pictures = np.zeros((len(dots), HEIGHT, WIDTH, 3), np.uint8)
    for picture, some in zip(pictures, dots, strict=True):
        for u, v in some:
            picture[v, u, 2] = 255
    topic = "/cam01/image_raw"
    stamps = [1_708_000_000 * 10**9 + i * 33_000_000 for i in range(len(dots))]
    sent = [raw(topic, stamp, picture, "bgr8") for stamp, picture in zip(stamps, pictures, strict=True)]
    bags, indexed = [write(tmp_path / "walk", sent, "ros1 lz4")], tmp_path / "indexed.parquet"
    frames.run(sequence="walk", bags=bags, data_root=tmp_path, topics={"cam01": topic}, out=indexed)
    (tmp_path / "pose.task").write_bytes(b"a bundle")
    return {
        "sequence": "walk", "camera": "cam01", "frames": indexed, "data_root": tmp_path,
        "model": tmp_path / "pose.task", "crop": "person", "out": tmp_path / "cam01.json",
    }  # fmt: skip


def test_landmarks_come_out_in_recorded_pixels(tmp_path, monkeypatch):
    """The same file as a network's, read by the same step: nobody in picture 1, two people in picture 2."""
    landmarker = StandIn()
    asked = stand_in(monkeypatch, landmarker)
    arguments = recorded(tmp_path, [[(30, 50)], [], [(32, 50), (100, 90)], [(34, 50)]])
    detect.run(**arguments)
    assert landmarker.closed and asked[0]["base_options"] == {"model_asset_path": str(tmp_path / "pose.task")}
    assert asked[0]["running_mode"] == "IMAGE" and asked[0]["num_poses"] == 3
    detections.run(
        looked_at=[], sequence="walk", pattern=str(tmp_path / "{camera}.json"), cameras=["cam01"], format="coco",
        frames=arguments["frames"], out=tmp_path / "out.parquet", findings=tmp_path / "f.parquet",
    )  # fmt: skip
    grid, joints = tables.grid(tables.read(tmp_path / "out.parquet", "detections"), "u", "v", "score")
    assert tuple(joints) == MLKIT_33 and np.isnan(grid[1]).all()
    for frame, u in ((0, 30), (2, 32), (3, 34)):
        np.testing.assert_allclose(grid[frame, :, 0], u + np.arange(33), atol=0.01)
        np.testing.assert_allclose(grid[frame, :, 1:], [[50, 0.9]] * 33, atol=0.01)
    assert "several_people" in tables.read(tmp_path / "f.parquet", "findings")["code"].tolist()


def test_clear_words_where_something_is_wrong(tmp_path, monkeypatch):
    arguments = recorded(tmp_path, [[(30, 50)], []])
    stand_in(monkeypatch, StandIn(lambda u, v: person(u, v)[:21]))
    with pytest.raises(DiorError, match=r"pose\.task: gives 21 landmarks where a pose has 33"):
        detect.run(**arguments)
    stand_in(monkeypatch, error=RuntimeError("Unable to open zip archive.\nTrace"))
    with pytest.raises(DiorError, match=r"no pose landmarker that MediaPipe opens \(Unable to open zip archive\.\)"):
        detect.run(**arguments)
    monkeypatch.setitem(sys.modules, "mediapipe", None)
    with pytest.raises(DiorError, match="needs MediaPipe .*; install it .*: pip install --no-deps mediapipe absl-py"):
        detect.run(**arguments)
    assert not (tmp_path / "cam01.json").exists()


def bundle(path, names):
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, b"TFL3" * 40)


NETWORKS = ("pose_detector.tflite", "pose_landmarks_detector.tflite")


@pytest.mark.parametrize("damage", ["no archive", "empty archive", "no networks"])
def test_the_package_itself_refuses_a_broken_file_in_a_sentence(tmp_path, damage):
    pytest.importorskip("mediapipe", reason=detect_task.INSTALL)
    model = tmp_path / "pose.task"
    if damage == "no archive":
        model.write_bytes(b"junk" * 99)
    else:
        bundle(model, NETWORKS if damage == "no networks" else ())
    with pytest.raises(DiorError, match=r"pose\.task: no pose landmarker that MediaPipe opens \(.+\)") as raised:
        detect_task.load(model)
    assert "\n" not in str(raised.value)


def test_the_packages_own_landmarks_are_understood():
    containers = pytest.importorskip("mediapipe.tasks.python.components.containers", reason=detect_task.INSTALL)
    mark = containers.NormalizedLandmark(x=0.25, y=0.5, z=0.0, visibility=0.7, presence=1.0)
    found = detect_task.points([mark] * 33, (HEIGHT, WIDTH, 3), "pose.task")
    np.testing.assert_allclose(found, [[39.5, 59.5, 0.7]] * 33)
