"""One reader per detection tool; each returns `dior.ingest.people.People`. The table of them all."""

from collections.abc import Callable
from dataclasses import dataclass

from dior.arrays import AnyPath
from dior.ingest.people import People
from dior.ingest.readers import alphapose, coco, mediapipe, mlkit, mlkit_csv, openpose, yolo


@dataclass(frozen=True)
class Reader:
    """`read(path)` gives People; `tool` is its name in messages; `shape` what `detections` must name: file, folder or
    either. `fractions`: it gives u, v as fractions of the picture. `silent`: its files say nothing of a picture in
    which nobody was found."""

    tool: str
    read: Callable[[AnyPath], People]
    shape: str
    fractions: bool = False
    silent: bool = False


READERS = {
    "mlkit": Reader("ML Kit", mlkit.read, "file"),
    "openpose": Reader("OpenPose", openpose.read, "folder"),
    "mediapipe": Reader("MediaPipe", mediapipe.read, "either", fractions=True),
    "alphapose": Reader("AlphaPose", alphapose.read, "file", silent=True),
    "yolo": Reader("YOLO pose", yolo.read, "either", fractions=True, silent=True),
    "coco": Reader("COCO results", coco.read, "file", silent=True),
    "mlkit_csv": Reader("ML Kit CSV", mlkit_csv.read, "file"),
}
