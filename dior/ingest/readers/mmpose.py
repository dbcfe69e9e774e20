"""Detections of MMPose (1.x): what its inferencer and its demo scripts save.

INPUTS   instances {"keypoints": [[x, y], ...], "keypoint_scores": [...], "bbox", ...}, pixels, of 17 (COCO), 26
         (Halpe), 133 (COCO WholeBody) or 136 (Halpe full body) keypoints:
         folder   <anything><frame>.json with the list of a picture's instances
         video    [{"frame_id", "instances": [...]}]: the inferencer, from 0 (mmpose 1.3.2,
                  apis/inferencers/base_mmpose_inferencer.py, split_instances in structures/utils.py)
         demo     {"meta_info", "instance_info": [{"frame_id", "instances": [...]}]}: the scripts of demo/, from 1
                  (topdown_demo_with_mmdet.py), with the keypoints' names in `meta_info`; of a picture without frame_id
         An empty list is a picture without a person.
OUTPUTS  `People`, frames as the file counts them.
"""

import os
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import BY_COUNT, COCO_17
from dior.body.spellings import joint_of
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import files_by_frame, load_json, one_model, points_of

TOOL = "MMPose"
DESCRIPTIONS = (
    DetectionFormat(
        key="mmpose",
        tool="MMPose 1.x, inferencer and demo scripts",
        file="the file `<video>.json`, or the folder of `<stem><frame>.json` of pictures",
        joints="17 (COCO), 26 (Halpe), 133 (WholeBody), 136 (Halpe full body); the demo's names are compared",
        frame="`frame_id`, or file's name",
        score="`keypoint_scores`, at most 1",
        nobody="`instances: []`, `[]`; a missing entry: not run",
        refused="a model of other joints, by the demo's names; another number of keypoints; a picture's instances "
        "named as a video's",
        samples=(
            Sample(
                "MMPose JSON: pictures, video, demo",
                "two people, nobody, other models' names; real_outdoor written again: the same table",
                "written here, from the source of mmpose 1.3.2; instances of its own `split_instances` were read "
                "as well",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the folder or file. Raises DiorError for what is not MMPose's and for names of other joints."""
    if os.path.isdir(path):
        files = [(frame, f"{path}/{name}") for frame, name in files_by_frame(path, ".json").items()]
        pictures = [(frame, _unwrapped(load_json(file, TOOL), file), file) for frame, file in files]
    else:
        pictures = list(_of_video(_unwrapped(load_json(path, TOOL), path), path))
    frame: list[Any] = []
    people: list[Floats] = []
    for number, instances, where in pictures:
        found = _people(instances, where)
        frame += [number] * len(found)
        people += found
    if not pictures:
        raise DiorError(f"{path} is empty; run the detector")
    looked_at = [number for number, _, _ in pictures]
    if not people:
        return gathered(path, COCO_17, [], np.empty((0, len(COCO_17), 3)), looked_at)
    points = one_model(people, path)
    return gathered(path, BY_COUNT[points.shape[1]], frame, points, looked_at)


def _unwrapped(content: Any, where: AnyPath) -> Any:
    """What is in `instance_info` of a demo's file, its names being checked; the content of any other."""
    if not isinstance(content, dict):
        return content
    try:
        names = content["meta_info"].get("keypoint_id2name") or {}
        instances = content["instance_info"]
        given = [str(names[key]) for key in sorted(names, key=int)]
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise DiorError(f"{where}: no meta_info and instance_info as MMPose writes them ({error!r:.80})") from None
    _check_names(given, where)
    return instances


def _check_names(given: list[str], where: AnyPath) -> None:
    """Refuse names of other joints than those of as many keypoints; of face and hands only their number counts."""
    if given and len(given) not in BY_COUNT:
        raise DiorError(f"{where}: a model of {len(given)} keypoints, which is none of {_known()}")
    for number, (name, joint) in enumerate(zip(given, BY_COUNT.get(len(given), ()), strict=False)):
        if joint_of(joint) and joint_of(name) != joint:
            raise DiorError(
                f"{where}: keypoint {number} is '{name:.40}', and of {len(given)} keypoints it should be {joint}; is "
                "it a model of something else than people?"
            )


def _known() -> str:
    return ", ".join(map(str, sorted(BY_COUNT)))


def _of_video(content: Any, path: AnyPath) -> list[tuple[Any, Any, str]]:
    """(frame, instances, where) of every picture of a video."""
    if not isinstance(content, list):
        raise DiorError(f"{path}: no list of pictures as MMPose writes it; {type(content).__name__}")
    found = []
    for count, one in enumerate(content):
        where = f"{path}: entry {count}"
        if not isinstance(one, dict) or not {"frame_id", "instances"} <= one.keys():
            raise DiorError(
                f"{where} has no frame_id and instances; of single pictures name the folder in `detections`"
            )
        found.append((one["frame_id"], one["instances"], where))
    return found


def _people(instances: Any, where: str) -> list[Floats]:
    """Points (J, 3) of every person of a picture."""
    try:
        people = [points_of(one["keypoints"], one["keypoint_scores"], where) for one in instances]
    except (KeyError, TypeError, AttributeError) as error:
        raise DiorError(f"{where}: no instances with keypoints and keypoint_scores ({error!r:.80})") from None
    if wrong := [len(one) for one in people if len(one) not in BY_COUNT]:
        raise DiorError(f"{where}: {wrong[0]} keypoints per person, which is none of {_known()}")
    return people
