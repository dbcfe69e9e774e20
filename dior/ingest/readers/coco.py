"""Detections in the results format of COCO's keypoint task: one JSON list for a camera.

INPUTS   [{"image_id": frame, "keypoints": [x, y, score, ...], "score"}], pixels, of 17 (COCO), 26 (Halpe), 133 (COCO
         WholeBody) or 136 (Halpe full body) keypoints; (0, 0) is a missing joint. COCO lets the third number be 1 (or
         0, or 2 as in its own labels) throughout; then the person's score takes its place. A picture without a person
         is not in the list.
         Also `predictions.json`, which `save_json` of a validation by Ultralytics writes: results with a "file_name",
         their image_id a text where it is no number (ultralytics 8.4.190, models/yolo/detect/val.py, pred_to_json);
         their pixels are those of `yolo_json`.
OUTPUTS  `People`.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import BY_COUNT
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers import yolo_json
from dior.ingest.readers.common import frame_of, load_json, number, one_model, triples

DESCRIPTIONS = (
    DetectionFormat(
        key="coco",
        tool="results of COCO's keypoint task",
        file="a file",
        joints="17, 18, 26, 33, 133, 136 by number",
        frame="`image_id`; in Ultralytics' `predictions.json` its last number",
        score="third number; the person's `score` where it is 1 (or 0 or 2) throughout",
        nobody="not told apart from not run",
        refused="another number of keypoints; several models in a file",
        samples=(
            Sample(
                "COCO keypoint results",
                "two people, `v` of 1 throughout",
                "written here",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the file. Raises DiorError for a file that is no such list."""
    content = load_json(path, "COCO results")
    people = from_list(content, path, _frame)
    if "file_name" in content[0]:
        people.uv[...] -= yolo_json.EDGE
    return people


def _frame(image_id: Any, where: str) -> Any:
    # a stem, and what looks like an extension belongs to it
    return frame_of(f"{image_id}.", f"{where}, {image_id:.40}") if isinstance(image_id, str) else image_id


def from_list(content: Any, path: AnyPath, frame_of: Callable[[Any, str], int]) -> People:
    """`People` of a list of results; `frame_of(image_id, where)` is the frame. Raises DiorError for any other."""
    if not isinstance(content, list):
        raise DiorError(f"{path}: not a list of results but a single {type(content).__name__}")
    frame: list[int] = []
    people: list[Floats] = []
    score: list[float] = []
    names: dict[Any, Any] = {}
    for count, one in enumerate(content):
        where = f"{path}: result {count}"
        try:
            name = one["image_id"]
            frame.append(frame_of(name, where))
            if names.setdefault(frame[-1], name) != name:
                raise DiorError(f"{path}: {names[frame[-1]]} and {name} are both frame {frame[-1]}")
            people.append(triples(one["keypoints"], where))
            score.append(number(one.get("score")))
        except (KeyError, TypeError, AttributeError, OverflowError) as error:
            raise DiorError(f"{where} has no such image_id, keypoints and score ({error!r:.80})") from None
    if not people:
        raise DiorError(f"{path} is empty; run the detector")
    points = one_model(people, path)
    given = points[..., 2][np.isfinite(points[..., 2])]
    if len(given) and given[0] in (0, 1, 2) and (given == given[0]).all() and np.isfinite(score).all():
        points[..., 2] = np.array(score)[:, None]
    return gathered(path, BY_COUNT[points.shape[1]], frame, points)
