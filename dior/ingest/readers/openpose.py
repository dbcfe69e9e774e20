"""Detections of OpenPose as it writes them: a folder with one JSON file per picture.

INPUTS   <anything><frame>[<no digits>].json with `people[].pose_keypoints_2d` = x, y, confidence per joint, pixels;
         (0, 0, 0) is a missing joint; `people: []` and `people: [{}]` are nobody.
OUTPUTS  `People` with the joints of BODY_25, BODY_25B or COCO_18, told apart by the number and place of the points.
"""

import json
import os
import re

import numpy as np

from dior.errors import DiorError
from dior.ingest.people import People
from dior.skeletons import BODY_25, BODY_25B, COCO_18, bones_of

CANDIDATES = {len(COCO_18): {"COCO_18": COCO_18}, len(BODY_25): {"BODY_25": BODY_25, "BODY_25B": BODY_25B}}
# of the right naming the bones are 2 to 4 times shorter than of the wrong one
CLEARLY_SHORTER = 0.8


def read(folder):
    """All people of the folder. Raises DiorError for a file that is not OpenPose's and for a frame given twice."""
    names = sorted(name for name in os.listdir(folder) if name.endswith(".json"))
    numbers = [_frame(folder, name) for name in names]
    where = {}
    for number, name in zip(numbers, names, strict=True):
        if number in where:
            raise DiorError(f"{folder}: {where[number]} and {name} are both frame {number}")
        where[number] = name
    ran = np.array(sorted(where), dtype=np.int64)
    frame, person, values = [], [], []
    for number in ran.tolist():
        for index, keypoints in enumerate(_people(folder, where[number])):
            if any(keypoints):
                if values and len(keypoints) != len(values[0]):
                    raise DiorError(
                        f"{folder}/{where[number]}: {len(keypoints) // 3} keypoints where the files before have "
                        f"{len(values[0]) // 3}; one folder must hold one model's output"
                    )
                frame.append(number)
                person.append(index)
                values.append(keypoints)
    stamp_ns = np.full(len(ran), -1, np.int64)
    if not values:
        empty = np.empty((0, len(BODY_25)))
        none = np.empty(0, np.int64)
        return People(BODY_25, none, none, np.empty((0, len(BODY_25), 2)), empty, ran, stamp_ns)
    points = np.array(values, float).reshape(len(values), -1, 3)
    missing = (points == 0).all(axis=-1)
    uv = np.where(missing[..., None], np.nan, points[..., :2])
    joints = _joints(uv, folder)
    return People(joints, np.array(frame), np.array(person), uv, points[..., 2], ran, stamp_ns)


def _frame(folder, name):
    numbers = re.findall(r"\d+", name.removesuffix(".json"))
    if not numbers:
        raise DiorError(f"{folder}/{name}: the file name holds no frame number")
    return int(numbers[-1])


def _people(folder, name):
    """Keypoint lists of all people of one file; an empty list for one without."""
    try:
        with open(os.path.join(folder, name), "rb") as stream:
            people = json.load(stream)["people"]
        keypoints = [one.get("pose_keypoints_2d") or [] for one in people]
    except (ValueError, KeyError, TypeError, AttributeError):
        raise DiorError(f"{folder}/{name}: not a JSON file of OpenPose; was it interrupted?") from None
    for one in keypoints:
        if len(one) % 3 or (one and len(one) // 3 not in CANDIDATES):
            known = " or ".join(f"{count} ({', '.join(names)})" for count, names in CANDIDATES.items())
            raise DiorError(f"{folder}/{name}: {len(one)} numbers per person, which is not 3 x {known} keypoints")
    return keypoints


def _joints(uv, folder):
    """Joint names of keypoints (people, J, 2): those under which the bones are clearly the shortest."""
    candidates = CANDIDATES[uv.shape[1]]
    if len(candidates) == 1:
        return next(iter(candidates.values()))
    lengths = {name: _bone_length(uv, joints) for name, joints in candidates.items()}
    (best, shortest), (other, longer) = sorted(lengths.items(), key=lambda item: item[1])
    if not shortest < CLEARLY_SHORTER * longer:
        raise DiorError(
            f"{folder}: {uv.shape[1]} keypoints that could be {best} or {other}: the points found are too few to tell"
        )
    return candidates[best]


def _bone_length(uv, joints):
    """Median over people of the mean bone length, px."""
    bones = bones_of(joints)
    lengths = np.linalg.norm(uv[:, bones[:, 0]] - uv[:, bones[:, 1]], axis=-1)
    known = np.isfinite(lengths)
    enough = known.any(axis=1)
    if not enough.any():
        return np.inf
    return np.median(np.nansum(lengths[enough], axis=1) / known[enough].sum(axis=1))
