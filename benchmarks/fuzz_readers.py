"""What benchmarks.fuzz damages: small files as people and other programs write them, and the readers of dior for them.

The detections and bags are those that the tests write.
"""

import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from dior.calibrate.intrinsics import from_file
from dior.calibrate.marks import marks
from dior.calibrate.place import reference_pose
from dior.clocks import by_hand
from dior.errors import DiorError
from dior.evaluate import checks
from dior.ingest import bags, detections, gallery, messages, mocap, trigger_log, trigger_packet
from dior.project import boxes, cross_checks, project
from dior.project.camera_file import camera_settings
from dior.project.schema_check import check, read_sheet, read_yaml
from dior.release.verify.folder_or_tarball import of_tarball
from dior.tables import tables
from tests.calibrate.readers import (
    test_kalibr,
    test_opencap,
    test_opencv_storage,
    test_qualisys,
    test_ros_camera_info,
    test_vicon,
)
from tests.ingest import bagfiles, c3d_files, formats
from tests.ingest.mocap_files import texts

# of the detections that are one file per picture
FOLDERS = ("openpose", "yolo", "solutions", "text", "pose2sim", "mmpose", "yolo_json")
ROOT = Path(__file__).resolve().parents[1]
SIZE = (formats.WIDTH, formats.HEIGHT)
T0 = bagfiles.T0
TOPICS = ["/cam01/image_raw", "/cam02/image_raw"]


@dataclass(frozen=True)
class Reader:
    """`samples()`: contents by the path of the file that is damaged, in an empty folder; `read(path, folder)` reads it,
    `folder` being for what is written; `beside(folder)` writes what lies there besides."""

    samples: Callable[[], dict[str, bytes]]
    read: Callable[[Path, Path], object]
    beside: Callable[[Path], object] = lambda folder: None


# what a person writes


@cache
def _demo() -> dict[str, bytes]:
    """The config of the demo, by path."""
    files = sorted((ROOT / "config").rglob("*.*"))
    return {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in files}


def _of_demo(*endings: str) -> dict[str, bytes]:
    found = {name: text for name, text in _demo().items() if name.endswith(endings)}
    assert found, endings
    return found


def _cameras() -> dict[str, bytes]:
    return {name: text for name, text in _of_demo(".yaml").items() if "/cam" in name}


def _offsets() -> dict[str, bytes]:
    return {"walk.yaml": b"cam01: {offset_s: 0.012, drift_ppm: 3, sigma_s: 0.001}\ncam02: {offset_s: -1.5}\n"}


def _write_demo(folder: Path) -> None:
    for name, text in _demo().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text)


def _project(path: Path, folder: Path) -> None:
    root = next(parent for parent in path.parents if (parent / "config").is_dir())
    read = project.load(root)
    for name in read.sequences:
        read.bags(name), read.boxes(name), read.cameras_of(name)


def _yaml(kind: str, path: Path, folder: Path) -> None:
    content = check(read_yaml(path), kind, path)
    if kind == "config":
        cross_checks.check_config(content)


SHEETS = {
    "effort": b"what\tminutes\tcount\nmarks\t45.5\t120\nboxes\t30\t\n",
    "markers": b"name\tmarker\tformat\nL_IAS\tLASI\t\nL_FAL\tLANK\tqtm\n",
    "gallery": b"subject\toutfit\tangle\tpath\tbag\ttopic\nS01\tcoat\tfrontal\tgallery/S01\t\t\n"
    b"S01\t\tdown45\t\tgallery/S01.bag\t/cam/image\n",
    "detectors": b"sequence\tcamera\ttool\tzoom\tpath\nwalk_1\tcam04\tyolo\t4\tyolo/{camera}\n",
}
KEYS = {
    "gallery": ("subject", "outfit", "angle"),
    "detectors": ("sequence", "camera", "tool", "zoom"),
    "markers": ("name", "format"),
}


def _sheet(kind: str) -> Reader:
    keys: str | tuple[str, ...] = KEYS.get(kind, {"effort": "what"}.get(kind, kind.removesuffix("s")))
    key = KEYS.get(kind) or keys
    samples = partial(dict, {f"{kind}.tsv": SHEETS[kind]}) if kind in SHEETS else partial(_of_demo, f"/{kind}.tsv")
    return Reader(samples, lambda path, folder: read_sheet(path, kind, key))


MARKS = {
    "cam01.marks.csv": b"sequence,frame,joint,u,v\nwalk_1,3,LASI,10.25,20.5\nwalk_1,9,RKNE,11,21\nwalk_2,0,LASI,1,2\n",
    "cam02.marks.csv": "\ufeffsequence,frame,joint,u,v,x,y,z\r\nwalk_1,3,Pfosten ü,10,20,1.5,-2,0\r\n"
    "walk_1,9,LASI,11,21,,,\r\n".encode(),
}
CHECKS = {"walk_1.cam01.csv": b"sequence,frame,joint,u,v\nwalk_1,3,LASI,10.25,20.5\nwalk_1,4,RKNE,,\n"}
BOXES = {"walk_1.cam04.csv": b"frame,u_min,v_min,u_max,v_max\n3,10.5,20,30,80\n5,11,21,31,81.25\n7,,,,\n"}
CALIBRATION = {
    "calibration.toml": b'[cam_01]\nname = "cam_01"\nsize = [1280.0, 720.0]\n'
    b"matrix = [[900.0, 0.0, 640.0], [0.0, 901.0, 360.0], [0.0, 0.0, 1.0]]\ndistortions = [0.1, -0.2, 0.0, 0.001]\n"
    b"rotation = [0.1, 1.2, -0.3]\ntranslation = [1.0, -2.0, 3.5]\nfisheye = false\n\n[cameras.cam_02]\n"
    b"size = [1280, 720]\nmatrix = [[900, 0, 640], [0, 901, 360], [0, 0, 1]]\ndistortions = [0, 0, 0, 0, 0]\n"
    b"rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\ntranslation = [0, 0, 1]\n\n[metadata]\nadjusted = false\n"
}


def _calibration(names: tuple[str, ...], path: Path, folder: Path) -> None:
    """Lens and pose of each camera, each of which may be refused."""
    refused = []
    for name in names:
        for read in (from_file, partial(reference_pose, world="from_walk")):
            try:
                read(path, name)
            except DiorError as error:
                refused.append(error)
    if refused:
        raise refused[0]


@cache
def _tools() -> dict[str, bytes]:
    """Calibrations as other tools write them, by path."""
    with TemporaryDirectory() as folder:
        root = Path(folder)
        written = [test_kalibr.chain(root), test_opencap.written(root, test_opencap.content())]
        pose = {"R": np.eye(3), "T": np.ones(3), "units": "m"}
        written += [test_opencv_storage.of_sample(root / f"a.{end}", **pose) for end in test_opencv_storage.ENDINGS]
        found = {path.relative_to(root).as_posix(): path.read_bytes() for path in written}
    texts = {"ros.yaml": test_ros_camera_info.TEXT, "lab.xcp": test_vicon.TEXT, "lab.qca.txt": test_qualisys.TEXT}
    return found | {name: text.encode() for name, text in texts.items()}


def _tool(files: tuple[str, ...], *cameras: str) -> Reader:
    return Reader(lambda: {name: _tools()[name] for name in files}, partial(_calibration, cameras))


# what detectors write


def _written(writer: Callable[..., Path]) -> dict[str, bytes]:
    joints = formats.WRITERS[writer][1]
    with TemporaryDirectory() as folder:
        path = writer(Path(folder), formats.scene(len(joints)))
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        texts = {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}
    # as of a recording of 30 Hz
    stamp = rb'"stamp_ns": %d(\d)' % (T0 // 10)
    return {name: re.sub(stamp, lambda one: b'"stamp_ns": %d' % _stamp(int(one[1])), t) for name, t in texts.items()}


def _stamp(frame: int) -> int:
    return T0 + frame * 33_333_333


def _detections(key: str) -> Reader:
    """All files of all ways to write a format; one is damaged, the others of its folder lie beside it."""
    writers = [writer for writer, (name, *_) in formats.WRITERS.items() if name == key]

    @cache
    def samples() -> dict[str, bytes]:
        return {name: text for writer in writers for name, text in _written(writer).items()}

    def beside(folder: Path) -> None:
        for name, text in samples().items():
            if "/" in name:
                (folder / name).parent.mkdir(exist_ok=True)
                (folder / name).write_bytes(text)
        stamps = np.array([_stamp(frame) for frame in range(4)])
        columns = {
            "camera": ["cam01"] * 4, "frame": np.arange(4), "stamp_ns": stamps, "receive_ns": stamps, "bag": ["b"] * 4,
            "topic": ["t"] * 4, "nth": [0] * 4, "height": [SIZE[1]] * 4, "width": [SIZE[0]] * 4,
        }  # fmt: skip
        tables.write(folder / "frames.parquet", "frames", columns)

    def read(path: Path, folder: Path) -> None:
        named = path.parent if path.parent.name in FOLDERS else path
        detections.run(
            looked_at=[],
            sequence="walk", pattern=str(named), cameras=["cam01"], format="auto", frames=folder / "frames.parquet",
            out=folder / "out.parquet", findings=folder / "findings.parquet",
        )  # fmt: skip

    return Reader(samples, read, beside)


# what recorders write


def _sent() -> Iterator[bagfiles.Sent]:
    for i in range(3):
        stamp = T0 + i * 33_333_333
        yield bagfiles.packed("/cam01/image_raw", stamp, bagfiles.picture(9 * i, (12, 16)), ".jpg")
        yield bagfiles.info("/cam01/camera_info", stamp)
        yield bagfiles.raw("/cam02/image_raw", stamp, bagfiles.picture(9 * i, (6, 8)), "bgr8")


# of pictures that are a video, a packet a message
OF_VIDEO = ("/cam01/image_raw/ffmpeg", "/cam02/image_raw/theora")


def _sent_as_video() -> list[bagfiles.Sent]:
    stamps = [T0 + 33_333_333 * i for i in range(13)]
    images = [bagfiles.picture(9 * i) for i in range(13)]
    return [*bagfiles.packets(OF_VIDEO[0], stamps, images), *bagfiles.theora(OF_VIDEO[1], stamps)]


def _bag(*forms: str, of_video: bool = False) -> Reader:
    @cache
    def samples() -> dict[str, bytes]:
        found, sent = {}, _sent_as_video() if of_video else list(_sent())
        with TemporaryDirectory() as folder:
            for form in forms:
                name = form.replace(" ", "_")
                bag = bagfiles.write(Path(folder) / name, sent, form, chunk=1500)
                found[name] = (bag if bag.is_file() else next(bag.glob("*.*[!l]"))).read_bytes()
        return found

    return Reader(samples, _read_video if of_video else _read_bag)


def _read_video(path: Path, folder: Path) -> None:
    table = bags.index(path, OF_VIDEO)
    table["bag"] = np.full(len(table["topic"]), path.name, object)
    for _ in bags.read_pictures(table, path.parent):
        pass


def _read_bag(path: Path, folder: Path) -> None:
    table = bags.index(path, TOPICS)
    table["bag"] = np.full(len(table["topic"]), path.name, object)
    for _ in bags.read_pictures(table, path.parent):
        pass
    bags.repeated(path, TOPICS)
    bags.read_camera_info([path], TOPICS[0])


@cache
def _ros2_folder() -> dict[str, bytes]:
    with TemporaryDirectory() as folder:
        bag = bagfiles.write(Path(folder) / "walk", list(_sent()), "mcap")
        return {f"walk/{path.name}": path.read_bytes() for path in sorted(bag.iterdir())}


def _write_ros2_folder(folder: Path) -> None:
    (folder / "walk").mkdir()
    for name, content in _ros2_folder().items():
        (folder / name).write_bytes(content)


@cache
def _messages() -> dict[str, bytes]:
    return {
        f"{sent.kind.rpartition('/')[2]}.{wire}": bagfiles.serialized(sent, wire)
        for sent in list(_sent())[:3]
        for wire in ("ros1", "cdr")
    }


def _message(path: Path, folder: Path) -> None:
    name, _, wire = path.name.partition(".")
    kind, raw = f"sensor_msgs/msg/{name}", path.read_bytes()
    try:
        if kind == messages.CAMERA_INFO:
            messages.camera_info(raw, wire)
        else:
            _, height, width = messages.picture_of(kind, raw, wire)
            messages.content(kind, raw, wire)
            messages.decode(kind, raw, wire, (height, width))
    except ValueError as error:
        raise DiorError(f"{path}: {error}") from None


@cache
def _pictures() -> dict[str, bytes]:
    grey = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 255, (40, 60, 3), np.uint8), (9, 9), 3)
    return {f"1{end}": cv2.imencode(end, grey)[1].tobytes() for end in (".jpg", ".png")}


def _gallery(path: Path, folder: Path) -> None:
    row = {"subject": "S01", "outfit": "", "angle": "frontal", "path": path.parent.name, "bag": "", "topic": ""}
    gallery.run(rows=[row], data_root=path.parent.parent, out=folder / "o.parquet", findings=folder / "f.parquet")


@cache
def _c3d() -> dict[str, bytes]:
    labels = list(c3d_files.PLACES)
    points = 1000 * c3d_files.person(labels, 12)
    return {
        f"{processor}.c3d": c3d_files.c3d_bytes(labels, points, processor=processor) for processor in ("intel", "dec")
    }


@cache
def _mocap_texts() -> dict[str, bytes]:
    labels = list(c3d_files.PLACES)
    points = c3d_files.person(labels, 12)
    with TemporaryDirectory() as folder:
        writers = {"a.tsv": texts.qtm, "a.csv": texts.motive, "a.trc": texts.trc}
        return {name: write(Path(folder) / name, labels, points).read_bytes() for name, write in writers.items()}


# what dior's own listener and packers write, and anyone may send


def _log() -> dict[str, bytes]:
    events = [
        {"event": "listening", "host_ns": T0, "port": 30, "ntp": {"source": "chrony"}},
        {"event": "start", "host_ns": T0, "name": "walk", "delay_ms": 0, "start_ns": T0, "packet_id": "1"},
        {"event": "stop", "host_ns": T0 + 10**10, "name": "walk", "stop_ns": T0 + 10**10, "result": "SUCCESS"},
        {"event": "start", "host_ns": T0 + 2 * 10**10, "name": "walk_02", "start_ns": T0 + 2 * 10**10},
    ]
    return {"trigger.jsonl": "".join(json.dumps(event) + "\n" for event in events).encode()}


def _trigger_log(path: Path, folder: Path) -> None:
    trigger_log.choose(trigger_log.read(path), T0 + 10**9, T0 + 9 * 10**9, path, c3d="walk.c3d")


def _packet() -> dict[str, bytes]:
    return {
        "packet": b'<?xml version="1.0" encoding="UTF-8" standalone="no" ?><CaptureStart><Name VALUE="walk 3"/>'
        b'<Notes VALUE=""/><Description VALUE=""/><DatabasePath VALUE="D:/Data/"/><Delay VALUE="33"/>'
        b'<PacketID VALUE="7"/></CaptureStart>\0'
    }


def _trigger_packet(path: Path, folder: Path) -> None:
    try:
        trigger_packet.parse(path.read_bytes())
    except trigger_packet.Refused as refused:
        raise DiorError(f"{path}: {refused}") from None


@cache
def _tarball() -> dict[str, bytes]:
    from dior.release import tarballs

    parts = []
    for name, content in {"SHA256SUMS": b"0" * 64 + b"  README.md\n", "README.md": b"# a\n" * 9}.items():
        head = tarballs.header(f"dior-0.1.0/{name}", len(content))
        parts += [head, content, bytes(-len(content) % 512)]
    size = sum(map(len, parts))
    return {"dior-0.1.0-metadata.tar": b"".join([*parts, bytes(tarballs.size_of(size) - size)])}


def _of_tarball(path: Path, folder: Path) -> None:
    if problems := of_tarball(path).problems:
        raise DiorError(f"{path}: {problems[0]}")


READERS = {
    "project": Reader(lambda: _of_demo(".yaml", ".tsv", ".marks.csv"), _project, _write_demo),
    "config": Reader(lambda: _of_demo("config/config.yaml"), partial(_yaml, "config")),
    "session": Reader(lambda: _of_demo("session.yaml"), partial(_yaml, "session")),
    "camera": Reader(_cameras, lambda path, folder: cross_checks.check_camera(camera_settings(path), str(path))),
    "offsets": Reader(_offsets, lambda path, folder: by_hand.by_hand(path, ["cam01", "cam02"])),
    **{kind: _sheet(kind) for kind in ("sequences", "subjects", "gallery", "detectors", "effort", "markers")},
    "marks": Reader(lambda: MARKS, lambda path, folder: marks.read(path)),
    "boxes": Reader(lambda: BOXES, lambda path, folder: boxes.read(path, range(10))),
    "checks": Reader(lambda: CHECKS, lambda path, folder: checks.points(path, "walk_1", range(10), ["LASI", "RKNE"])),
    "toml": Reader(lambda: CALIBRATION, partial(_calibration, ("cam_01", "cam_02"))),
    "kalibr": _tool(("chain.yaml",), "cam0", "cam2"),
    "opencv": _tool(("a.yml", "a.xml", "a.json"), "a"),
    "ros_info": Reader(lambda: {"ros.yaml": _tools()["ros.yaml"]}, lambda path, folder: from_file(path, "left")),
    "qualisys": _tool(("lab.qca.txt",), "cam01", "cam03"),
    "vicon": _tool(("lab.xcp",), "Vue_1"),
    "opencap": _tool(("Cam1/cameraIntrinsicsExtrinsics.pickle",), "Cam1"),
    **{key: _detections(key) for key in detections.READERS},
    "ros1": _bag("ros1", "ros1 lz4", "ros1 bz2"),
    "db3": _bag("db3 alone", "db3 message alone", "db3 zstd alone"),
    "mcap": _bag("mcap alone", "mcap zstd", "mcap lz4", "mcap plain", "mcap ros1"),
    "packets": _bag("ros1", "db3 alone", "mcap alone", of_video=True),
    "ros2_folder": Reader(_ros2_folder, lambda path, folder: _read_bag(path.parent, folder), _write_ros2_folder),
    "mocap_texts": Reader(_mocap_texts, lambda path, folder: mocap.read(path)),
    "c3d": Reader(_c3d, lambda path, folder: mocap.read(path)),
    "messages": Reader(_messages, _message),
    "pictures": Reader(_pictures, _gallery),
    "trigger_log": Reader(_log, _trigger_log),
    "trigger_packet": Reader(_packet, _trigger_packet),
    "tarball": Reader(_tarball, _of_tarball),
}


def prepared(reader: Reader, folder: Path, name: str, content: bytes) -> Path:
    """The path of the damaged file in an emptied folder, with what lies beside it."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    reader.beside(folder)
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path
