"""Detections of OpenPose as it writes them: a folder with one JSON file per picture.

INPUTS   <anything><frame>[<no digits>].json with `people[].pose_keypoints_2d` = x, y, confidence per joint, pixels;
         (0, 0, 0) and NaN are a missing joint; `people: []` and `people: [{}]` are nobody. OpenPose of 2017
         wrote `pose_keypoints`. Pose2Sim writes the same of
         RTMPose by rtmlib (0.10.49, poseEstimation.py, save_to_openpose): 17, 26 or 133 keypoints of a person, frames
         from 0, NaN throughout for somebody whom its tracker lost or a picture on which the network failed.
OUTPUTS  `People` with the joints of BODY_25, BODY_25B, COCO_17, COCO_18, HALPE_26 or WHOLEBODY_133, told apart by the
         number and place of the points.
"""

import os
from array import array

import msgspec
import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import BODY_25, BODY_25B, COCO_17, COCO_18, HALPE_26, WHOLEBODY_133, bones_of
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import files_by_frame, from_json, number
from dior.project.plain_text import unmarked

CANDIDATES = {
    len(COCO_17): {"COCO_17": COCO_17},
    len(COCO_18): {"COCO_18": COCO_18},
    len(BODY_25): {"BODY_25": BODY_25, "BODY_25B": BODY_25B},
    len(HALPE_26): {"HALPE_26": HALPE_26},
    len(WHOLEBODY_133): {"WHOLEBODY_133": WHOLEBODY_133},
}
# of the right naming the bones are 2 to 4 times shorter than of the wrong one
CLEARLY_SHORTER = 0.8
# chosen: people that tell models with the same number of points apart
ENOUGH_PEOPLE = 500
# files are a few kB, and a buffer of this size costs no system call of its own
READ_AT_ONCE = 1 << 15
DESCRIPTIONS = (
    DetectionFormat(
        key="openpose",
        tool="OpenPose; RTMPose (rtmlib) by Pose2Sim; OpenPose of 2017 (`pose_keypoints`)",
        file="the folder",
        joints="BODY_25, BODY_25B, told apart by the bones, COCO-18; 17 (COCO), 26 (Halpe), 133 (WholeBody)",
        frame="last number in the file's name",
        score="confidence",
        nobody="`people: []`, `people: [{}]`, NaN throughout; a missing file: not run",
        refused="another number of keypoints (rtmlib's 134); several models in a folder; a frame twice; "
        "`--keypoint_scale 3` (fractions)",
        samples=(
            Sample(
                "OpenPose BODY_25B",
                "4 cameras x 100 files, up to two people; the published choice of the person in 398 of 400 "
                "frames, the two others explained in the test",
                "real: Pose2Sim's demo session, `real_outdoor/openpose`, `openpose_single`",
            ),
            Sample(
                "OpenPose BODY_25, COCO-18",
                "one person from the front, the side and behind; empty files",
                "written here",
            ),
            Sample(
                "OpenPose JSON of 17, 26, 133 keypoints with NaN",
                "two people, nobody, NaN throughout; real_outdoor's detections written again: the same table",
                "written here, as `save_to_openpose` of Pose2Sim 0.10.49; what that function itself wrote was "
                "read as well",
            ),
        ),
    ),
)


class _Person(msgspec.Struct, gc=False):
    pose_keypoints_2d: list[float] = []
    pose_keypoints: list[float] = []


class _Picture(msgspec.Struct, gc=False):
    people: list[_Person]


KEYS = _Person.__struct_fields__
_FILE = msgspec.json.Decoder(_Picture)


def read(folder: AnyPath) -> People:
    """All people of the folder. Raises DiorError for a file that is not OpenPose's and for a frame given twice."""
    names = files_by_frame(folder, ".json")
    frame: list[int] = []
    values: list[array[float] | None] = []
    size = 0
    for of_picture, name in names.items():
        path = f"{folder}/{name}"
        for person in _people(_text(path), path):
            keypoints = person.pose_keypoints_2d or person.pose_keypoints
            if keypoints and len(keypoints) != size:
                _check_count(len(keypoints), size, path)
                size = len(keypoints)
            frame.append(of_picture)
            values.append(array("d", keypoints) if keypoints else None)
    if not size:
        return gathered(folder, BODY_25, [], np.empty((0, len(BODY_25), 3)), list(names))
    # a bytearray can be written to, so that nothing is copied; a person without keypoints has zeros, which are missing
    joined = bytearray().join([bytes(8 * size) if one is None else one for one in values])
    points = np.frombuffer(joined).reshape(len(frame), -1, 3)
    points[(points[..., 0] == 0) & (points[..., 1] == 0)] = np.nan
    return gathered(folder, _joints(points[..., :2], folder), frame, points, list(names))


def _text(path: AnyPath) -> bytes:
    file = os.open(path, os.O_RDONLY)
    try:
        text = part = os.read(file, READ_AT_ONCE)
        while len(part) == READ_AT_ONCE:
            part = os.read(file, READ_AT_ONCE)
            text += part
        return unmarked(text, path)
    except OSError as error:
        raise DiorError(f"{path}: cannot be read ({error.strerror}); a folder of OpenPose holds files only") from None
    finally:
        os.close(file)


def _people(text: bytes, path: AnyPath) -> list[_Person]:
    """The people of a file, with NaN, which is no JSON, where it has that."""
    try:
        return _FILE.decode(text).people
    except (msgspec.MsgspecError, RecursionError):
        if b"NaN" not in text:
            raise DiorError(f"{path}: not a JSON file of OpenPose; was it interrupted?") from None
    try:
        people = from_json(text, path, "OpenPose")["people"]
        return [_Person(*([number(value) for value in one.get(key, [])] for key in KEYS)) for one in people]
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise DiorError(f"{path} has no people as OpenPose writes them ({error!r:.80})") from None


def _check_count(size: int, before: int, path: AnyPath) -> None:
    count = size // 3
    if size % 3 or count not in CANDIDATES:
        known = " or ".join(f"{count} ({', '.join(names)})" for count, names in CANDIDATES.items())
        raise DiorError(f"{path}: {size} numbers per person, which is not 3 x {known} keypoints")
    if before:
        raise DiorError(
            f"{path}: {count} keypoints where the files before have {before // 3}; "
            "one folder must hold one model's output"
        )


def _joints(uv: Floats, folder: AnyPath) -> tuple[str, ...]:
    """Joint names of keypoints (people, J, 2): those under which the bones are clearly the shortest."""
    candidates = CANDIDATES[uv.shape[1]]
    if len(candidates) == 1:
        return next(iter(candidates.values()))
    lengths = {name: _bone_length(uv[:: -(-len(uv) // ENOUGH_PEOPLE)], joints) for name, joints in candidates.items()}
    (best, shortest), (other, longer) = sorted(lengths.items(), key=lambda item: item[1])
    if not shortest < CLEARLY_SHORTER * longer:
        raise DiorError(
            f"{folder}: {uv.shape[1]} keypoints that could be {best} or {other}: the points found are too few to tell"
        )
    return candidates[best]


def _bone_length(uv: Floats, joints: tuple[str, ...]) -> float:
    """Median over people of the mean bone length, px."""
    bones = bones_of(joints)
    lengths = np.linalg.norm(uv[:, bones[:, 0]] - uv[:, bones[:, 1]], axis=-1)
    known = np.isfinite(lengths)
    enough = known.any(axis=1)
    if not enough.any():
        return np.inf
    return np.median(np.nansum(lengths[enough], axis=1) / known[enough].sum(axis=1))
