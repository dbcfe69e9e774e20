"""Which tool wrote a file or folder of detections, by the beginning of its content."""

import os
import re
from pathlib import Path

from dior.arrays import AnyPath
from dior.ingest.readers import caliscope, mlkit_csv, yolo
from dior.ingest.readers.common import names_in
from dior.ingest.readers.mediapipe import TEXT
from dior.project.plain_text import unmarked

# chosen: holds the first picture of every tool's files
HEAD_BYTES = 1 << 16
SUFFIXES = (".json", ".jsonl", ".txt", ".csv", *TEXT)
_KEY = re.compile(rb'"([^"\\\n]{1,200})"\s*:')
_MESSAGE = re.compile(rb"(?:\s+|#[^\n]*\n)*(?:pose_)?landmarks?\s*:?\s*\{")
_PICTURE = re.compile(rb"\.\w{3,4}$")


def recognise(path: AnyPath) -> str | None:
    """The key in `READERS` of the tool that wrote a file or folder, "empty", or None: none of them.

    Only the first HEAD_BYTES are looked at, and only the first file of a folder in which there is anybody.
    Raises DiorError for UTF-16.
    """
    path = Path(path)
    if not path.is_dir():
        return _of_head(_head(path), alone=True)
    heads = (_head(path / name) for name in names_in(path, SUFFIXES))
    return next((kind for head in heads if (kind := _of_head(head, alone=False)) != "empty"), "empty")


def why_empty(path: AnyPath) -> str:
    """What is to be said of an empty file or folder."""
    others = [name for name in sorted(os.listdir(path)) if not name.startswith(".")] if os.path.isdir(path) else []
    if not others or names_in(path, SUFFIXES):
        return "is empty; run the detector"
    return f"holds {others[0]} and no file that ends in {', '.join(SUFFIXES)}; name the folder of the detector's files"


def _head(path: AnyPath) -> bytes:
    with open(path, "rb") as stream:
        return unmarked(stream.read(HEAD_BYTES), path).strip()


def _of_head(head: bytes, alone: bool) -> str | None:
    # a picture of MediaPipe's without anybody
    if not head or head == b"null":
        return "empty"
    if head[:1] in b"{[":
        return _of_json(head)
    if _MESSAGE.match(head):
        return "mediapipe"
    line = head.split(b"\n", 1)[0]
    # its reader says that semicolons are wrong
    if re.match(rb"scorer[,;\t]", line):
        return "deeplabcut"
    if {caliscope.MARK.encode(), b"keypoint_id"} <= set(line.strip().split(b",")):
        return "caliscope"
    if line.count(b",") + 1 == mlkit_csv.COLUMNS:
        return "mlkit_csv"
    numbers = re.fullmatch(rb"[-+.\deEnaif\s]*", line)
    count = len(line.split())
    # a picture's file where a stream is expected is YOLO's, too; the reader says what is wrong
    return "yolo" if numbers and (yolo.keypoint_width(count - alone) or yolo.keypoint_width(count)) else None


def _of_json(head: bytes) -> str | None:
    keys = _KEY.findall(head)
    names = set(keys)
    if {b"keypoints", b"keypoint_scores"} <= names or names & {b"instances", b"meta_info", b"instance_info"}:
        return "mmpose"
    if head[:1] == b"[":
        if not keys:
            return "empty" if re.fullmatch(rb"\[[\s\[\]]*", head) else None
        if {b"image_id", b"keypoints"} <= names:
            by_name = re.search(rb'"image_id"\s*:\s*"', head) and b"file_name" not in names
            return "alphapose" if by_name else "coco"
        if {b"keypoints", b"class", b"confidence"} <= names:
            return "yolo_json"
        return "mediapipe" if _is_mediapipe(names) else None
    if _PICTURE.search(keys[0] if keys else b"") and names & {b"bodies", b"people"}:
        return "alphapose"
    if b"people" in names:
        return "openpose"
    if _is_mediapipe(names):
        return "mediapipe"
    return "mlkit" if b"landmarks" in names else None


def _is_mediapipe(names: set[bytes]) -> bool:
    if names & {b"pose_landmarks", b"poseLandmarks", b"landmark", b"worldLandmarks"}:
        return True
    if b"landmarks" not in names:
        # a list of landmarks for each picture and nothing else
        return names == {b"x", b"y", b"z"}
    # ML Kit's have a number each
    return not names & {b"inFrameLikelihood", b"type"} and bool(names & {b"x", b"visibility"})
