"""Detections of a YOLO pose model as JSON: `to_json()` of Ultralytics' results.

INPUTS   per picture a list of {"name", "class", "confidence", "box", "keypoints": {"x": [...], "y": [...],
         "visible": [...]}}, pixels, 17 keypoints; without "visible" the score is 1 (ultralytics 8.4.190,
         engine/results.py, Results.summary). As a folder of <anything><frame>.json; as a JSON list of such lists or as
         JSON lines, whose first is frame 0. Only class 0, the person, is read. (0, 0) is a missing joint; an empty list
         is a picture without a person. Text rows of the same: `yolo`; `save_json` of a validation: `coco`.
OUTPUTS  `People` with the joints COCO_17, in pixels. The file's are the text rows' fractions times the size, so that
         they count from the picture's edges as well.
"""

import os
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import COCO_17
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import content_of, files_by_frame, from_json, load_json, points_of

TOOL = "a YOLO pose model"
# from the edge of the first pixel to its centre
EDGE = 0.5
DESCRIPTIONS = (
    DetectionFormat(
        key="yolo_json",
        tool="Ultralytics pose, `to_json()`",
        file="the folder of `<stem>_<frame>.json`, or a file of all pictures: a JSON list of them or JSON lines, in "
        "order from 0",
        joints="17",
        frame="file's name, or place in the file",
        score="`visible`, else 1",
        nobody="`[]`; a missing file: not run",
        refused="a file of one picture; another number of keypoints; other classes than 0 are not read",
        samples=(
            Sample(
                "YOLO JSON: per picture, list, lines; `predictions.json`",
                "two people, nobody, other classes; the same as the text rows; real_outdoor written again: the "
                "same table",
                "written here, from the source of ultralytics 8.4.190",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the folder or file. Raises DiorError for JSON that is not of a YOLO pose model."""
    if os.path.isdir(path):
        files = [(frame, f"{path}/{name}") for frame, name in files_by_frame(path, ".json").items()]
        pictures = [(frame, load_json(file, TOOL), file) for frame, file in files]
    else:
        pictures = _of_stream(path)
    frame: list[int] = []
    people: list[Floats] = []
    for number, content, where in pictures:
        found = _people(content, where)
        frame += [number] * len(found)
        people += found
    points = np.array(people).reshape(-1, len(COCO_17), 3)
    points[..., :2] -= EDGE
    return gathered(path, COCO_17, frame, points, [number for number, _, _ in pictures])


def _of_stream(path: AnyPath) -> list[tuple[int, Any, str]]:
    """(frame, content, where) of every picture of a file of all of them."""
    text = content_of(path).strip()
    lines = text.splitlines()
    if len(lines) > 1 and lines[0].strip().startswith(b"[") and lines[0].strip().endswith(b"]"):
        numbered = [(f"{path}: line {count}", line) for count, line in enumerate(lines, 1) if line.strip()]
        return [(frame, from_json(line, where, TOOL), where) for frame, (where, line) in enumerate(numbered)]
    content = from_json(text, path, TOOL)
    if not isinstance(content, list) or any(isinstance(one, dict) for one in content):
        raise DiorError(f"{path}: holds one picture, and no list of them; name the folder of them in `detections`")
    if not content:
        raise DiorError(f"{path} is empty; run the detector")
    return [(frame, one, f"{path}: picture {frame}") for frame, one in enumerate(content)]


def _people(content: Any, where: str) -> list[Floats]:
    """Points (17, 3) of every person of a picture, px from the edge."""
    people = []
    try:
        for one in content:
            if one["class"] == 0:
                keypoints = one["keypoints"]
                pairs = zip(keypoints["x"], keypoints["y"], strict=True)
                people.append(points_of(pairs, keypoints.get("visible"), where))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise DiorError(f"{where}: no class and keypoints as Ultralytics writes them ({error!r:.80})") from None
    if wrong := [len(one) for one in people if len(one) != len(COCO_17)]:
        raise DiorError(f"{where}: {wrong[0]} keypoints of a person, not {len(COCO_17)}; is it another model's?")
    return people
