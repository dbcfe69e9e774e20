"""Heads that a detector found in a camera's pictures: the subject's, and everybody else's.

INPUTS   the detector's own output, which holds everybody (`dior.ingest.readers`)
OUTPUTS  the middle of each face, and boxes of the heads that are not under the subject's cover
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.ingest import detections
from dior.ingest.readers import READERS
from dior.ingest.readers.recognise import recognise
from dior.release import head_model

# chosen: of fewer joints of a face nobody knows where it is
LEAST_JOINTS = 3
# Half the sides of a box around a head, of the height of the body that was found. Chosen: of an adult 0.17 and 0.23 m,
# as a detector is off by some centimetres there, and a body half hidden looks smaller.
AROUND = (0.10, 0.13)
# s; chosen: who was found is there so long before and after
FOUND_S = 0.25


@dataclass(frozen=True, eq=False)
class Faces:
    """A row per person and picture: `row` (N,) of the camera's pictures, `uv` (N, J, 2) px of the `joints` of the head,
    NaN missing; `middle` (N, 2) px; `height` (N,) px of the body."""

    row: Ints
    joints: list[str]
    uv: Floats
    middle: Floats
    height: Floats


NOBODY = Faces(np.zeros(0, int), [], np.zeros((0, 0, 2)), np.zeros((0, 2)), np.zeros(0))


def read(path: Path | None, tool: str, min_score: float, rows: Table, where: str, first_frame: int = 0) -> Faces:
    """The faces in a detector's output of a camera whose pictures are `rows`; nobody where there is none.

    `first_frame`: number that it gives the first picture.
    """
    if path is None or not path.exists() or not len(rows["frame"]):
        return NOBODY
    found = recognise(path) if tool == "auto" else tool
    if found not in READERS:
        return NOBODY
    reader = READERS[found]
    people = detections.of_recording(path, reader, rows["camera"][0], rows, where, first_frame)
    uv = np.where((people.score >= min_score)[..., None], people.uv, np.nan)
    mine = [i for i, joint in enumerate(people.joints) if joint in head_model.HEAD]
    there = np.isfinite(uv[:, mine]).all(axis=-1).sum(axis=1) >= LEAST_JOINTS
    if not there.any():
        return NOBODY
    uv, face = uv[there], uv[there][:, mine]
    height = np.max(np.nanmax(uv, axis=1) - np.nanmin(uv, axis=1), axis=1)
    joints = [people.joints[i] for i in mine]
    return Faces(people.frame[there], joints, face, np.nanmean(face, axis=1), height)


def off(faces: Faces, uv: Floats, joints: list[str]) -> Floats:
    """By how much (F, 2) px the nearest face found in each picture is off the subject's labels `uv` (F, J, 2) of the
    `joints`, NaN where none of these were found."""
    found = np.full((len(uv), 2), np.nan)
    shared = [name for name in faces.joints if name in joints]
    if not shared:
        return found
    apart = faces.uv[:, [faces.joints.index(n) for n in shared]] - uv[faces.row][:, [joints.index(n) for n in shared]]
    known = np.asarray(np.isfinite(apart).all(axis=-1))
    count = np.maximum(known.sum(axis=1), 1)[:, None]
    mean = np.where(
        np.asarray(known.any(axis=1))[:, None], np.where(known[..., None], apart, 0.0).sum(axis=1) / count, np.nan
    )
    # the nearest last, so that it is what stays
    for i in np.argsort(-np.nan_to_num(np.linalg.norm(mean, axis=1), nan=np.inf), kind="stable"):
        if np.isfinite(mean[i]).all():
            found[faces.row[i]] = mean[i]
    return found


def strangers(faces: Faces, edges: Floats, times: Floats, on_its_side: bool = False) -> list[Ints]:
    """By picture boxes (N, 4) of whole pixels around the heads that are not under the subject's cover.

    `edges` (F, 4) px of the cover, `times` (F,) s ascending. A box is there up to FOUND_S before and after, too.
    `on_its_side`: the camera is, and a head wider than high in its pictures.
    """
    box = edges[faces.row]
    middle, half = (box[:, :2] + box[:, 2:]) / 2 - 0.5, (box[:, 2:] - box[:, :2]) / 2
    with np.errstate(invalid="ignore"):
        covered = (((faces.middle - middle) / half) ** 2).sum(axis=1) <= 1
    found: list[list[Ints]] = [[] for _ in times]
    for i in np.flatnonzero(~covered):
        reach = np.array(AROUND[:: -1 if on_its_side else 1]) * faces.height[i]
        around = np.concatenate([np.floor(faces.middle[i] - reach), np.ceil(faces.middle[i] + reach) + 1]).astype(int)
        when = times[faces.row[i]]
        for row in range(*np.searchsorted(times, (when - FOUND_S, when + FOUND_S))):
            found[row].append(around)
    return [np.unique(np.array(each, int), axis=0) if each else np.zeros((0, 4), int) for each in found]
