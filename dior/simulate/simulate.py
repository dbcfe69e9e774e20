"""Record one simulated walk as a lab would bring it home: bags and detections; and the truth apart.

INPUTS   the `simulate:` section and the sequence's name
OUTPUTS  below `out` (data_root): <sequence>/pc1.bag and pc2.bag (ROS 1, a recording computer each),
         <sequence>/mlkit/<camera>.jsonl, or mediapipe/ of everybody, truth/<sequence>/*.parquet
Every random number derives from the seed and a name, so that the same settings give the same bytes.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dior.body.names import MLKIT_33
from dior.geometry.camera import Intrinsics
from dior.progress import reporting
from dior.simulate import backdrop, bystander, detector_real, draw, scene, truth
from dior.simulate.bystander import SecondPerson
from dior.simulate.clocks import Clock
from dior.simulate.detector import detect, write_mediapipe, write_mlkit
from dior.simulate.motion import Motion, motion_of
from dior.simulate.settings import COMPUTERS, Sequence, Settings, detections_path, from_dict, sequence_named
from dior.simulate.truth import View
from dior.tables.files import written_whole

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

IMAGE, INFO = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
# chosen: less than any picture period
REPEATED_AFTER_NS = 1_000_000


def run(*, settings: dict[str, Any], sequence: str, out: Path) -> None:
    """Write the bags, detections and truth of one sequence below `out`.

    `settings` is the section as a dict. Raises DiorError for a wrong key or an unknown sequence.
    """
    capture = from_dict(settings)
    record(capture, sequence_named(capture, sequence), out)


def record(settings: Settings, walk: Sequence, out: Path) -> None:
    """The same of a walk."""
    motion = motion_of(settings, walk)
    views, others = observe(settings, walk, motion)
    write_detections(settings, walk, motion.height, views, others, out)
    for computer, group in COMPUTERS.items():
        seen = {name: (views[name], others[name]) for name in group}
        write_bag(out / walk.name / f"{computer}.bag", settings, walk, motion.height, seen)


def observe(settings: Settings, walk: Sequence, motion: Motion) -> tuple[dict[str, View], dict[str, SecondPerson]]:
    """What every camera sees of the subject (`truth.View`) and of the second person (`SecondPerson`), by name."""
    views = {name: truth.view(settings, walk, motion, name) for group in COMPUTERS.values() for name in group}
    others = {name: bystander.seen(settings, walk, seen.camera, seen.clock.seconds) for name, seen in views.items()}
    return views, others


def write_detections(
    settings: Settings,
    walk: Sequence,
    height: float,
    views: dict[str, View],
    others: dict[str, SecondPerson],
    out: Path,
) -> None:
    """Detect the person in every camera, or everybody, and write the detections and the truth below `out`."""
    pattern, folder = str(out / detections_path(settings, walk.name)), out / "truth" / walk.name
    if not settings.detector.everybody:
        found = detected(settings, walk, height, views, others)
        for camera, one in found.items():
            write_mlkit(Path(pattern.format(camera=camera)), views[camera].clock, one)
        truth.write(settings, walk, views, found, folder)
        return
    # nobody is taken for anybody else
    nobody = {camera: replace(one, present=np.zeros_like(one.present)) for camera, one in others.items()}
    found = detected(settings, walk, height, views, nobody)
    people = [found]
    truth.write(settings, walk, views, found, folder)
    if settings.bystander:
        second = replace(walk, name=f"{walk.name} second", subject=bystander.SUBJECT)
        seen = {name: truth.second_view(settings, walk, own, height, others[name]) for name, own in views.items()}
        people.append(detected(settings, second, next(iter(others.values())).height, seen, nobody))
        truth.write_second(settings, replace(second, name=walk.name), seen, folder)
    for camera, own in views.items():
        each = [one[camera] for one in people]
        write_mediapipe(Path(pattern.format(camera=camera)), own.clock, own.camera.intrinsics, each)


def detected(
    settings: Settings, walk: Sequence, height: float, views: dict[str, View], others: dict[str, SecondPerson]
) -> dict[str, truth.Detected]:
    """What the detector makes of one person in every camera; arguments as of `detector_real.detect`."""
    if settings.detector.level == "real":
        return detector_real.detect(settings, walk, height, views, others)
    noise_px = settings.detector.noise_px
    return {
        camera: detect(seen, noise_px, truth.detector_generator(settings, walk, camera))
        for camera, seen in views.items()
    }


def write_bag(
    path: Path, settings: Settings, sequence: Sequence, height: float, views: dict[str, tuple[View, SecondPerson]]
) -> None:
    """Render the pictures of some cameras into a ROS 1 bag, in the order in which a recorder received them.

    `views`: camera -> its `truth.View` and what it sees of the second person. A message that is there twice has one
    header stamp and two receive stamps.
    """
    import cv2
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    cv2.setNumThreads(1)
    store = get_typestore(Stores.ROS1_NOETIC)
    painters = {name: painter(settings, sequence, height, *both) for name, both in views.items()}
    clock = {name: seen.clock for name, (seen, _) in views.items()}
    lens = {name: scene.reported(settings, sequence.session, seen.camera) for name, (seen, _) in views.items()}
    order = sorted(_arrivals(clock))
    with written_whole(path) as part, Writer(part) as bag:
        topics = {
            name: [
                bag.add_connection(f"/{name}/color/{what}", kind, typestore=store)
                for what, kind in (("image_raw/compressed", IMAGE), ("camera_info", INFO))
            ]
            for name in views
        }
        for receive_ns, name, i in reporting(order, len(order), "pictures", f"{sequence.name}, {path.name}"):
            header = _header(store, i, int(clock[name].stamp_ns[i]), name)
            messages = (_image(store, header, painters[name](i)), _info(store, header, lens[name]))
            for topic, message in zip(topics[name], messages, strict=True):
                bag.write(topic, receive_ns, store.serialize_ros1(message, topic.msgtype))


def _arrivals(clocks: dict[str, Clock]) -> Iterator[tuple[int, str, int]]:
    """(receive_ns, camera, number) of every message of the clocks by camera; a repeated one comes a moment later."""
    for name, clock in clocks.items():
        for i, (receive, twice) in enumerate(zip(clock.receive_ns.tolist(), clock.twice.tolist(), strict=True)):
            yield receive, name, i
            if twice:
                yield receive + REPEATED_AFTER_NS, name, i


def painter(
    settings: Settings, sequence: Sequence, height: float, seen: View, other: SecondPerson
) -> Callable[[int], NDArray[np.uint8]]:
    """A function that gives the JPEG bytes (N,) of a frame."""
    import cv2

    empty = backdrop.background(settings, seen.camera, sequence.environment)
    own = draw.figure(seen.landmarks, height)
    figures = [draw.outlines(seen.camera, own, height, sequence.outfit, sequence.subject, settings.figure)]
    if other.present.any():
        others = draw.figure(other.landmarks, other.height)
        second = draw.outlines(seen.camera, others, other.height, "shirt", bystander.SUBJECT)
        figures.append(second)
        nearer = other.depth.mean(axis=1) < np.nanmean(seen.landmark(seen.depth), axis=1)
    wall = backdrop.in_front(settings, seen.camera, sequence.environment)
    drawn = [i for i, name in enumerate(seen.joints) if settings.markers and name not in MLKIT_33]
    across = draw.MARKER_M * seen.camera.intrinsics.fx / seen.depth[:, drawn]
    shown = seen.status[:, drawn] == "ok"

    def jpeg(i: int) -> NDArray[np.uint8]:
        picture = empty.copy()
        if other.present[i]:
            for figure in figures if nearer[i] else figures[::-1]:
                draw.paint(picture, figure, i)
        else:
            draw.paint(picture, figures[0], i)
        draw.paint_markers(picture, seen.uv[i, drawn][shown[i]], across[i, shown[i]])
        if wall is not None:
            picture = np.where(wall, empty, picture)
        return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality])[1].ravel()

    return jpeg


def _header(store: "Typestore", seq: int, stamp_ns: int, camera: str) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return store.types["std_msgs/msg/Header"](seq=seq, stamp=stamp, frame_id=f"{camera}_color_optical_frame")


def _image(store: "Typestore", header: Any, jpeg: NDArray[np.uint8]) -> Any:
    return store.types[IMAGE](header=header, format="rgb8; jpeg compressed bgr8", data=jpeg)


def _info(store: "Typestore", header: Any, lens: Intrinsics) -> Any:
    K = np.array([lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1.0])
    P = np.array([lens.fx, 0, lens.cx, 0, 0, lens.fy, lens.cy, 0, 0, 0, 1.0, 0])
    whole = store.types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return store.types[INFO](
        header=header,
        height=lens.height,
        width=lens.width,
        distortion_model="plumb_bob",
        D=np.array(lens.distortion[:5]),
        K=K,
        R=np.eye(3).ravel(),
        P=P,
        binning_x=0,
        binning_y=0,
        roi=whole,
    )
