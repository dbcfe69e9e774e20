"""Detections of AlphaPose: `alphapose-results.json`, one file for a camera.

INPUTS   [{"image_id": "<anything><frame>.<ext>", "keypoints": [x, y, score, ...], "score", "idx"}], pixels, of 17
         (COCO), 26 (Halpe) or 136 (Halpe full body) keypoints; also the two other layouts that it writes, by picture:
         `cmu` {name: {"bodies": [{"joints"}]}} and `open` {name: {"people": [{"pose_keypoints_2d"}]}}. The person's
         score goes up to about 4 and is not used; a keypoint's above 1 counts as 1. `idx`, a number, a list or a list
         of lists, is its tracker's and is not used: the same number may stand for several people of a picture.
         A picture without a person is not in the list.
OUTPUTS  `People`.
"""

from typing import Any

from dior.arrays import AnyPath, Floats
from dior.body.names import BY_COUNT
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers import coco
from dior.ingest.readers.common import frame_of, load_json, one_model, triples

BY_PICTURE = {"bodies": "joints", "people": "pose_keypoints_2d"}
DESCRIPTIONS = (
    DetectionFormat(
        key="alphapose",
        tool="AlphaPose, default, `cmu` and `open` layouts",
        file="the file `alphapose-results.json`",
        joints="17 (COCO), 26 (Halpe), 136 (Halpe full body), 133 (WholeBody), 18 (`cmu`, `open`)",
        frame="last number in `image_id`",
        score="of the keypoint, at most 1",
        nobody="not told apart from not run",
        refused="another number of keypoints; several models in a file; two names of one frame",
        samples=(
            Sample(
                "AlphaPose: 17, 26, 136 keypoints; `cmu`, `open`",
                "two people, scores above 1, `idx` as number, list, list of lists or null",
                "written here",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the file. Raises DiorError for a file that is not AlphaPose's."""
    content = load_json(path, "AlphaPose")
    return _by_picture(content, path) if isinstance(content, dict) else coco.from_list(content, path, _named)


def _named(image_id: Any, where: str) -> int:
    if not isinstance(image_id, str):
        raise TypeError(f"image_id {image_id!r:.40} is no file name")
    return frame_of(image_id, f"{where}, {image_id}")


def _by_picture(content: dict[str, Any], path: AnyPath) -> People:
    frames: dict[int, str] = {}
    frame: list[int] = []
    people: list[Floats] = []
    for name, picture in content.items():
        where = f"{path}: {name}"
        number = frame_of(name, where)
        if number in frames:
            raise DiorError(f"{path}: {frames[number]} and {name} are both frame {number}")
        frames[number] = name
        try:
            key = next(key for key in BY_PICTURE if key in picture)
            found = [triples(one[BY_PICTURE[key]], where) for one in picture[key]]
        except (KeyError, TypeError, StopIteration) as error:
            raise DiorError(f"{where} has no people as AlphaPose writes them ({error!r:.80})") from None
        frame += [number] * len(found)
        people += found
    if not people:
        raise DiorError(f"{path} is empty; run the detector")
    points = one_model(people, path)
    return gathered(path, BY_COUNT[points.shape[1]], frame, points, list(frames))
