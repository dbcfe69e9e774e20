"""What detectors themselves see at long range, as sequences to compare: beside the labels, in which they have no part.

INPUTS   rows of config/detectors.tsv of one sequence (any format that `detections` reads), its `frames` table
OUTPUTS  `inputs.CameraWalk`s of the subject by camera and tool, px in the recorded picture; why there are fewer
Who of several people is the subject is told by how they move (dior/ingest/people.py), never by the labels. Every
keypoint counts, whatever its score, as in the detectors' figures.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats, Ints
from dior.body.names import COCO_17
from dior.evaluate import detectors
from dior.ingest import people as subject
from dior.ingest.people import People
from dior.reid.inputs import CameraWalk, regular
from dior.tables import tables


def camera_walks(
    rows: list[dict[str, Any]], frames: AnyPath, where: str
) -> tuple[list[tuple[str, str, CameraWalk]], list[tuple[str, str, str]]]:
    """(tool, camera, `CameraWalk`) of each of `rows` (dicts camera, tool, zoom, path), and (tool, camera, why) of those
    that lack joints of COCO-17. A tool on magnified pictures is called `mlkit 4x`. `where`: the sequence, for errors.

    Raises DiorError as `detectors.read` does.
    """
    pictures = tables.read(frames, "frames", ["camera", "frame", "stamp_ns", "restored_s", "width", "height"])
    found, left_out = [], []
    for row in rows:
        camera, zoom = row["camera"], int(row["zoom"])
        tool = row["tool"] if zoom == 1 else f"{row['tool']} {zoom}x"
        mine = tables.of_camera(pictures, camera)
        people, _ = detectors.read(
            Path(row["path"]),
            mine,
            zoom,
            f"{detectors.SHEET}: {where}, {camera}, {tool}",
            int(row.get("first_frame") or 0),
        )
        lacks = [name for name in COCO_17 if name not in people.joints]
        if lacks:
            left_out.append((tool, camera, f"the detector has no {lacks[0].replace('_', ' ')}"))
            continue
        uv, fps = regular(mine["stamp_ns"], of_subject(people, mine["stamp_ns"]))
        found.append((tool, camera, CameraWalk(uv, fps, int(mine["width"][0]))))
    return found, left_out


def of_subject(people: People, stamps_ns: Ints) -> Floats:
    """COCO-17 joints (F, 17, 2) px of the subject among `People`, at the pictures' stamps (F,); NaN where not found."""
    row = subject.follow(people, stamps_ns).row
    index = [people.joints.index(name) for name in COCO_17]
    # one row more than there are people, for nobody: index -1 finds it
    return np.concatenate([people.uv[:, index], np.full((1, len(index), 2), np.nan)])[row]
