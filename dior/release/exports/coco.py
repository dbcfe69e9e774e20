"""COCO keypoints: one JSON per part of the split by subject.

OUTPUTS  coco/person_keypoints_<part>.json: images, annotations and the category, as cocodataset.org/#format-data says
A picture without a joint in it has no annotation. Beyond the format: `sigma`, `derived` of an annotation, `subject`,
`sequence`, `camera`, `frame`, `stamp_ns`, `no_image` of an image.
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats
from dior.body.names import COCO_17
from dior.geometry.camera import Intrinsics
from dior.release.exports.poses import OCCLUDED, OK, AddRecording, Pose
from dior.release.exports.recordings import Recording, Release

ABOUT = """\
`coco/person_keypoints_<part>.json`: keypoints of every picture of a part of the split by subject.

- `keypoints` are 17 times x, y, v: v = 2 in the picture, 1 in the picture but hidden by the body, 0 outside of it or
  not known (then x = y = 0). Pixel (0, 0) is the *centre* of the top-left pixel, as in COCO's own keypoints, which are
  indices of pixels; detectron2 adds 0.5 to such keypoints by itself.
- `bbox` is x, y, width, height around the pixels of all joints in the picture, also those that COCO has not: no box of
  the silhouette. Its origin is the top-left *corner* of the picture, as in COCO. `area` is that of the box (COCO's is
  that of a mask, about half of it).
- `derived`: indices of keypoints that were made from motion capture markers by rule. `sigma`: 17 times sigma of x and
  y, null where it is not known.
- The pictures are in the Parquet files of the release: the row of `frame` in
  `frames/<subject>/<sequence>.<camera>.parquet`; `file_name` is a place to unpack it to. An image with `no_image` has
  labels but no picture in the release.

`COCO("coco/person_keypoints_train.json")` (pycocotools)
"""
# COCO's own, from 1
SKELETON = (
    (16, 14), (14, 12), (17, 15), (15, 13), (12, 13), (6, 12), (7, 13), (6, 7), (6, 8), (7, 9), (8, 10), (9, 11),
    (2, 3), (1, 2), (1, 3), (2, 4), (3, 5), (4, 6), (5, 7),
)  # fmt: skip
CATEGORY = {
    "id": 1, "name": "person", "supercategory": "person", "keypoints": list(COCO_17),
    "skeleton": [list(bone) for bone in SKELETON],
}  # fmt: skip
# of a pixel; chosen: a hundredth of what labels are good to at best
DECIMALS = 3


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddRecording]:
    """Yield `add(recording, pose)`; the files are whole when the context ends."""
    folder.mkdir()
    parts: dict[str, AddRecording] = {}
    with ExitStack() as stack:

        def add(recording: Recording, pose: Pose, pictures: dict[int, str]) -> None:
            if recording.part not in parts:
                parts[recording.part] = stack.enter_context(_file(folder, recording.part, release))
            parts[recording.part](recording, pose, pictures)

        yield add


@contextmanager
def _file(folder: Path, part: str, release: Release) -> Iterator[AddRecording]:
    """Yield `add` of one JSON: its images are written at once, the annotations beside it and appended in the end."""
    path = folder / f"person_keypoints_{part}.json"
    aside = folder / f".{part}.annotations"
    info = {"description": f"{release.folder.name}, {part}"}
    count = {"images": 0, "annotations": 0}
    with open(path, "w", encoding="utf-8") as file, open(aside, "w+", encoding="utf-8") as rest:
        head = {"info": info, "licenses": [], "categories": [CATEGORY]}
        file.write(_json(head)[:-1] + ',"images":[')

        def add(recording: Recording, pose: Pose, pictures: dict[int, str]) -> None:
            images, annotations = rows(recording, pose, pictures, count["images"] + 1, count["annotations"] + 1)
            for stream, name, made in ((file, "images", images), (rest, "annotations", annotations)):
                if made:
                    stream.write(",\n" if count[name] else "\n")
                    stream.write(",\n".join(map(_json, made)))
                    count[name] += len(made)

        yield add
        file.write('\n],"annotations":[')
        rest.seek(0)
        shutil.copyfileobj(rest, file)
        file.write("\n]}\n")
    aside.unlink()


def rows(
    recording: Recording, pose: Pose, no_image: dict[int, str], first_image: int = 1, first_annotation: int = 1
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Images and annotations (dicts) of a recording; ids are counted from those given. `no_image`: frame -> why."""
    walk, lens = recording.walk, recording.camera.intrinsics
    common = {
        "width": lens.width, "height": lens.height, "subject": walk.subject, "sequence": walk.sequence,
        "camera": recording.camera.name,
    }  # fmt: skip
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    keypoints, sigma = _keypoints(pose), with_null(pose.sigma.reshape(len(pose.frame), -1))
    seen = pose.inside.sum(axis=1).tolist()
    boxes = _boxes(pose.box, lens)
    derived = np.flatnonzero(pose.derived).tolist()
    for i, frame in enumerate(pose.frame.tolist()):
        image = {"id": first_image + i, "file_name": f"{walk.subject}/{recording.name}/{frame:06d}.jpg", **common}
        image |= {"frame": frame, "stamp_ns": int(pose.stamp_ns[i])}
        if frame in no_image:
            image["no_image"] = no_image[frame]
        images.append(image)
        if not seen[i]:
            continue
        annotations.append(
            {
                "id": first_annotation + len(annotations), "image_id": image["id"], "category_id": 1, "iscrowd": 0,
                "num_keypoints": seen[i], "keypoints": keypoints[i], "bbox": boxes[i],
                "area": round(boxes[i][2] * boxes[i][3], DECIMALS), "derived": derived, "sigma": sigma[i],
            }
        )  # fmt: skip
    return images, annotations


def _keypoints(pose: Pose) -> list[list[float]]:
    """Lists of 51 numbers per picture."""
    inside = pose.inside
    visibility = np.select([pose.status == OK, pose.status == OCCLUDED], [2, 1], 0)
    uv = np.where(inside[..., None], np.round(pose.uv, DECIMALS), 0.0)
    return [
        [number for (u, v), seen in zip(points, flags, strict=True) for number in (u, v, seen)]
        for points, flags in zip(uv.tolist(), visibility.tolist(), strict=True)
    ]


def _boxes(box: Floats, lens: Intrinsics) -> list[list[float]]:
    """x, y, width, height (F, 4) from the corner of the picture, around whole pixels, of boxes of their centres."""
    low = np.maximum(box[:, :2], 0.0)
    high = np.minimum(box[:, 2:] + 1.0, (lens.width, lens.height))
    return np.round(np.concatenate([low, high - low], axis=1), DECIMALS).tolist()


def with_null(values: Floats) -> list[Any]:
    """Numbers as nested lists, rounded; null where one is not known."""
    known = np.isfinite(values)
    numbers = np.round(np.where(known, values, 0.0), DECIMALS).astype(object)
    numbers[~known] = None
    return numbers.tolist()


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))
