"""Detections of caliscope: the `xy_<tracker>.csv` of a recording, one file for all its cameras.

INPUTS   rows sync_index, cam_id, frame_index, frame_time, object_id, keypoint_id, img_loc_x, img_loc_y, ..., pixels, in
         any order of the columns (caliscope 0.11.8, core/process_synchronized_recording.py and core/point_data.py).
         `frame_index` counts the pictures of the camera, `sync_index` does not and is not used; a file without
         `frame_index`, which older versions wrote, is refused. There are no scores: what it is sure of to 0.3 is there
         (trackers/onnx_tracker.py). An `object_id` is a person. A picture without a person has no row.
OUTPUTS  `People` of one camera: of several `cam_id` the one that is the number at the end of the camera's name. Of
         keypoints up to 16 COCO_17, up to 25 HALPE_26, up to 132 WHOLEBODY_133, the models that come with it.
"""

import re

import numpy as np

from dior.arrays import AnyPath
from dior.body.names import COCO_17, HALPE_26, WHOLEBODY_133
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import INTERRUPTED
from dior.project.plain_text import each_row

NEEDED = ("cam_id", "frame_index", "object_id", "keypoint_id", "img_loc_x", "img_loc_y")
# what a header has in any version
MARK = "img_loc_x"
MODELS = (COCO_17, HALPE_26, WHOLEBODY_133)
# chosen: ten minutes of four cameras
MOST_BYTES = 1 << 28
DESCRIPTIONS = (
    DetectionFormat(
        key="caliscope",
        tool="caliscope, `xy_<tracker>.csv`",
        file="the file, for all cameras",
        joints="17, 26 (Halpe), 133 (WholeBody), by the last keypoint",
        frame="`frame_index`",
        score="none: 1",
        nobody="not told apart from not run",
        refused="a file without `frame_index`, which older versions wrote; no `cam_id` that is the number at the end "
        "of the camera's name; two cameras with the rows of one",
        samples=(
            Sample(
                "caliscope CSV",
                "two cameras, nobody; real_outdoor written again: the same table; a real file of an older version"
                " is refused",
                "written by caliscope 0.11.8 from points made up, and here",
            ),
        ),
    ),
)


def read(path: AnyPath, camera: str = "") -> People:
    """All people of one camera. Raises DiorError for rows that are not caliscope's and where no `cam_id` is it."""
    rows = each_row(path, path, most_bytes=MOST_BYTES)
    _, header = next(rows, (0, []))
    if missing := [name for name in NEEDED if name not in header]:
        old = "; it is of an older caliscope, so process the recording with one of today" if MARK in header else ""
        raise DiorError(f"{path}: there is no column {missing[0]}{old}")
    place = [header.index(name) for name in NEEDED]
    found = []
    for line, cells in rows:
        if len(cells) != len(header):
            raise DiorError(f"{path}: line {line} has {len(cells)} columns, not {len(header)}; {INTERRUPTED}")
        try:
            found.append([float(cells[at]) for at in place])
        except ValueError as error:
            raise DiorError(f"{path}: line {line} holds something that is no number ({error!s:.60})") from None
    if not found:
        raise DiorError(f"{path} is empty; run the detector")
    values = np.array(found)
    keys = values[:, :4]
    if not (np.isfinite(keys).all() and (keys == np.rint(keys)).all() and (np.abs(keys) < 1e9).all()):
        raise DiorError(f"{path}: a number of a camera, picture, person or keypoint is no whole number; {INTERRUPTED}")
    mine = values[keys[:, 0] == _camera_id(np.unique(keys[:, 0]).astype(int).tolist(), camera, path)]
    kind = mine[:, 3].astype(int)
    joints = next((names for names in MODELS if kind.max() < len(names)), None)
    if joints is None or kind.min() < 0:
        raise DiorError(f"{path}: it has keypoints {kind.min()} to {kind.max()}, which are of no model that is known")
    persons, row = np.unique(mine[:, 1:3], axis=0, return_inverse=True)
    row = row.reshape(-1)
    if len(np.unique(np.column_stack([row, kind]), axis=0)) < len(mine):
        raise DiorError(f"{path}: a keypoint of a picture is there twice; {INTERRUPTED}")
    points = np.full((len(persons), len(joints), 3), np.nan)
    points[row, kind, :2], points[row, kind, 2] = mine[:, 4:6], 1.0
    return gathered(path, joints, persons[:, 0], points)


def _camera_id(there: list[int], camera: str, path: AnyPath) -> int:
    """The `cam_id` of a camera; of a file of one camera that one."""
    if len(there) == 1:
        return there[0]
    number = re.search(r"\d{1,9}$", camera)
    if not number or int(number[0]) not in there:
        raise DiorError(
            f"{path}: its cameras are {', '.join(map(str, there[:20]))}, and the number at the end of '{camera}' is "
            "none of them; rename the camera, or give a file per camera"
        )
    return int(number[0])
