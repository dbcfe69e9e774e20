"""Detections of MediaPipe's pose landmarker, JSON or protobuf text.

INPUTS   per picture the result as its Python packages give it:
         tasks      {"pose_landmarks": [[{"x", "y", "z", "visibility", "presence"}, ...], ...]}, a list per person
         solutions  {"pose_landmarks": {"landmark": [{...}, ...]}}, or only what is within
         web        {"landmarks": [[{...}, ...], ...]}
         text       landmarks { landmark { x: ... y: ... visibility: ... presence: ... } ... }
         as a folder of <anything><frame>.json, .pbtxt or .txtpb; as JSON lines or a JSON list whose entries have a
         "frame", or each a "timestamp_ms" or "stamp_ns" since the Unix epoch, which tells the picture; or as a single
         .pbtxt, which is frame 0. Nobody is null or an empty list.
         Fractions of the picture's width and height; the score is `visibility`, else `presence`, else 1.
OUTPUTS  `People` with the joints MLKIT_33, in fractions of the picture.
"""

import os
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath
from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers import prototext
from dior.ingest.readers.common import content_of, files_by_frame, from_json, number

TEXT = (".pbtxt", ".txtpb", ".textproto")
KEYS = ("pose_landmarks", "poseLandmarks", "landmarks", "landmark")
SCORES = ("visibility", "presence")
DESCRIPTIONS = (
    DetectionFormat(
        key="mediapipe",
        tool="MediaPipe pose landmarker",
        file="a folder of `.json` or `.pbtxt`, a `.jsonl`, a JSON list, or one `.pbtxt` file",
        joints="33",
        frame='file\'s name, or `"frame"` in the entry, or else `timestamp_ms`; a single `.pbtxt` is frame 0',
        score="`visibility`, else `presence`",
        nobody="`null`, `[]`; a missing entry: not run",
        refused="pixels in place of fractions; another number of landmarks; a frame twice",
        samples=(
            Sample(
                "MediaPipe protobuf text",
                "33 landmarks of one picture with visibility and presence",
                "real: MediaPipe's test data, `detections/mediapipe_pose_landmarks.pbtxt`",
            ),
            Sample(
                "MediaPipe JSON: tasks, solutions, web",
                "one and two people, missing coordinates, nobody",
                "written here",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the folder or file. Raises DiorError for what is not MediaPipe's and for a frame given twice."""
    stamps: list[int | None] = []
    by_stamp = False
    if os.path.isdir(path):
        names = files_by_frame(path, (".json", *TEXT))
        pictures = [(frame, _whole_file(Path(path) / name), f"{path}/{name}") for frame, name in names.items()]
    elif str(path).lower().endswith(TEXT):
        pictures = [(0, _whole_file(path), str(path))]
    else:
        entries = _entries(path)
        stamps = [stamp_ns_of(one) for one, _ in entries]
        by_stamp = None not in stamps and not any("frame" in one for one, _ in entries)
        pictures = [(i if by_stamp else _frame(one, where), one, where) for i, (one, where) in enumerate(entries)]
    frames: list[Any] = []
    points: list[list[list[float]]] = []
    for frame, content, where in pictures:
        people = _people(content, where)
        frames += [frame] * len(people)
        points += people
    whole = np.array(points).reshape(-1, len(MLKIT_33), 3)
    looked_at = [frame for frame, _, _ in pictures]
    return gathered(path, MLKIT_33, frames, whole, looked_at, stamps if by_stamp else None, by_stamp)


def _whole_file(path: AnyPath) -> Any:
    text = content_of(path)
    if not text.strip():
        raise DiorError(f"{path} is empty; run the detector")
    if str(path).lower().endswith(TEXT):
        try:
            return _from_text(prototext.parse(text.decode(), path), path)
        except UnicodeDecodeError:
            raise DiorError(f"{path}: is no text; is the file damaged?") from None
    return from_json(text, path, "MediaPipe")


def _entries(path: AnyPath) -> list[tuple[Any, str]]:
    """(content, where) of every picture of a JSON list or of JSON lines."""
    text = content_of(path)
    if text.lstrip()[:1] == b"[":
        return [(one, f"{path}: entry {i}") for i, one in enumerate(from_json(text, path, "MediaPipe"))]
    lines = [(line, f"{path}: line {i}") for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise DiorError(f"{path} is empty; run the detector")
    return [(from_json(line, where, "MediaPipe"), where) for line, where in lines]


def _frame(content: Any, where: str) -> Any:
    if not isinstance(content, dict) or "frame" not in content:
        raise DiorError(f'{where} has no "frame"; write it with each picture, or a file per picture')
    return content["frame"]


def stamp_ns_of(content: Any) -> int | None:
    """When a picture was taken, by its entry; None where that does not say it."""
    for key, ns in (("stamp_ns", 1), ("timestamp_ms", 1_000_000)):
        stamp = content.get(key) if isinstance(content, dict) else None
        if isinstance(stamp, int) and not isinstance(stamp, bool) and 0 <= stamp * ns < 1 << 63:
            return stamp * ns
    return None


def _people(content: Any, where: str) -> list[list[list[float]]]:
    """Points (33, 3) of every person of a picture."""
    try:
        found = _lists(content)
        return [_points(one, where) for one in found]
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise DiorError(f"{where}: no pose landmarks as MediaPipe gives them ({error!r:.80})") from None


def _lists(content: Any) -> list[Any]:
    """The landmark lists, one per person, of all the ways to nest them."""
    while isinstance(content, dict):
        content = content[next((key for key in KEYS if key in content), KEYS[0])]
    if not content:
        return []
    if isinstance(content[0], dict) and "x" in content[0]:
        return [content]
    return [one for person in content for one in (_lists(person) if isinstance(person, dict) else [person]) if one]


def _points(landmarks: Any, where: str) -> list[list[float]]:
    if len(landmarks) != len(MLKIT_33):
        raise DiorError(f"{where}: {len(landmarks)} landmarks, but a pose has {len(MLKIT_33)}; is it another solution?")
    points = []
    for one in landmarks:
        score = next((one[key] for key in SCORES if one.get(key) is not None), 1.0)
        points.append([number(one["x"]), number(one["y"]), number(score)])
    return points


def _from_text(message: list[tuple[str, Any]], where: AnyPath) -> dict[str, Any]:
    """What the JSON of the same message would be."""
    if any(name == "landmark" for name, _ in message):
        message = [("landmarks", message)]
    people = [value for name, value in message if name in KEYS]
    if not people:
        raise DiorError(f"{where}: holds no message `landmarks`; is it MediaPipe's?")
    try:
        return {
            "landmarks": [
                [{key: float(value) for key, value in one if key in ("x", "y", *SCORES)} for name, one in person
                 if name == "landmark"]
                for person in people
            ]
        }  # fmt: skip
    except (TypeError, ValueError) as error:
        raise DiorError(f"{where}: a landmark holds something that is no number ({error})") from None
