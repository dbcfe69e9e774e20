"""One reader per detection tool; each returns `dior.ingest.people.People`. The table of them all."""

from collections.abc import Callable
from dataclasses import dataclass

from dior.arrays import AnyPath
from dior.formats import DetectionFormat
from dior.ingest.people import People
from dior.ingest.readers import (
    alphapose,
    caliscope,
    coco,
    deeplabcut,
    mediapipe,
    mlkit,
    mlkit_csv,
    mmpose,
    openpose,
    yolo,
    yolo_json,
)


@dataclass(frozen=True)
class Reader:
    """`read(path, camera)` gives People; `tool` is its name in messages; `shape` what `detections` must name: file,
    folder or either; `described`: for people. `fractions`: it gives u, v as fractions of the picture. `silent`: its
    files say nothing of a picture in which nobody was found. `all_cameras`: one file holds those of several cameras."""

    tool: str
    read: Callable[..., People]
    shape: str
    described: tuple[DetectionFormat, ...]
    fractions: bool = False
    silent: bool = False
    all_cameras: bool = False


def _alone(read: Callable[[AnyPath], People]) -> Callable[..., People]:
    """The same of a file that holds one camera, whichever it is."""
    return lambda path, camera="": read(path)


READERS = {
    "mlkit": Reader("ML Kit", _alone(mlkit.read), "file", mlkit.DESCRIPTIONS),
    "openpose": Reader("OpenPose", _alone(openpose.read), "folder", openpose.DESCRIPTIONS),
    "mediapipe": Reader("MediaPipe", _alone(mediapipe.read), "either", mediapipe.DESCRIPTIONS, fractions=True),
    "alphapose": Reader("AlphaPose", _alone(alphapose.read), "file", alphapose.DESCRIPTIONS, silent=True),
    "yolo": Reader("YOLO pose", _alone(yolo.read), "either", yolo.DESCRIPTIONS, fractions=True, silent=True),
    "coco": Reader("COCO results", _alone(coco.read), "file", coco.DESCRIPTIONS, silent=True),
    "mmpose": Reader("MMPose", _alone(mmpose.read), "either", mmpose.DESCRIPTIONS),
    "yolo_json": Reader("YOLO pose JSON", _alone(yolo_json.read), "either", yolo_json.DESCRIPTIONS),
    "deeplabcut": Reader("DeepLabCut", _alone(deeplabcut.read), "file", deeplabcut.DESCRIPTIONS),
    "caliscope": Reader("caliscope", caliscope.read, "file", caliscope.DESCRIPTIONS, silent=True, all_cameras=True),
    "mlkit_csv": Reader("ML Kit CSV", _alone(mlkit_csv.read), "file", mlkit_csv.DESCRIPTIONS),
}
