"""What other detectors find where the labels are: the paper's tables of detection and success at long range.

INPUTS   rows of config/detectors.tsv of one sequence (camera, tool, zoom, path of the output: any format that
         `detections` reads); the sequence's `frames` table; `labels_2d` of those cameras. Never used for labels.
OUTPUTS  `metrics` with `tool` (`mlkit`, or `mlkit 4x` on pictures of `zoom`): detected_share, success_share
         `detector_frames`: the same per picture; `findings`: pictures that a detector was not run on

A picture counts as detected where anybody is found, and as a success where at least 20 % of the detected keypoints of
somebody lie in the label box, the tight box of the in-frame labels, edges included (paper, table 3). All in recorded
pixels. A tool whose output says nothing of pictures without anybody is taken to have seen them all.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table
from dior.body.names import COCO_17
from dior.errors import DiorError
from dior.evaluate import rows as figures
from dior.evaluate.grids import LabelGrid, label_grids
from dior.evaluate.labels_in_boxes import label_boxes
from dior.evaluate.zoom import window
from dior.ingest.detections import check_recording, of_recording
from dior.ingest.people import People, gathered
from dior.ingest.readers import READERS
from dior.ingest.readers.common import files_by_frame
from dior.ingest.readers.recognise import recognise, why_empty
from dior.tables import tables

SHEET = "config/detectors.tsv"
# a success is one in this many keypoints in the box (paper, table 3)
ONE_IN = 5


def run(
    *,
    sequence: str,
    subject: str,
    rows: list[Any],
    roles: dict[str, str],
    frames: Path,
    labels: list[Path],
    out: Path,
    out_frames: Path,
    findings: Path,
) -> None:
    """Measure the detectors of one sequence.

    `rows`: dicts camera, tool, zoom, path and, where it is not 0, first_frame; `roles`: camera -> close | long_range;
    `labels`: label files. Raises DiorError for output that is missing, of another recording or other pictures, or of no
    known tool.
    """
    pictures = tables.read(frames, "frames", ["camera", "frame", "stamp_ns", "restored_s", "topic", "width", "height"])
    grids = label_grids(labels)
    measured, parts, found = [], [], []
    for row in rows:
        camera, zoom = row["camera"], int(row["zoom"])
        tool = row["tool"] if zoom == 1 else f"{row['tool']} {zoom}x"
        where = f"{SHEET}: {sequence}, {camera}, {tool}"
        mine = tables.of_camera(pictures, camera)
        people, looked_at = read(Path(row["path"]), mine, zoom, where, int(row.get("first_frame") or 0))
        part = per_frame(people, looked_at, _boxes(grids[camera], mine["frame"]))
        detected, success = _float(part["people"]), _float(part["success"])
        for metric, values in (("detected_share", detected > 0), ("success_share", success > 0)):
            known = np.where(np.isnan(detected if metric == "detected_share" else success), np.nan, values)
            measured += figures.mean_row(metric, known, "share", camera, roles[camera], tool=tool)
        parts.append(part | _keys(sequence, row, mine))
        missing = int((~looked_at).sum())
        if missing:
            text = f"{camera}: {tool} was not run on {missing} of {len(looked_at)} pictures"
            found.append((f"{sequence}/{camera}", "info", "detector_not_run", text))
    tables.write(out, "metrics", figures.metric_columns(measured, subject, sequence))
    tables.write(out_frames, "detector_frames", figures.stacked(parts))
    tables.write_findings(findings, found)


def _float(values: Ints) -> Floats:
    return np.where(values < 0, np.nan, values)


def _keys(sequence: str, row: dict[str, str], mine: Table) -> Table:
    texts = {"sequence": sequence, "camera": row["camera"], "tool": row["tool"]}
    count = len(mine["frame"])
    return {
        **{key: np.full(count, text, dtype=object) for key, text in texts.items()},
        "zoom": np.full(count, int(row["zoom"])),
        "frame": mine["frame"],
        "stamp_ns": mine["stamp_ns"],
    }


def read(path: Path, pictures: Table, zoom: int, where: str, first_frame: int = 0) -> tuple[People, Bools]:
    """`People` of one output in recorded pixels, and the pictures (F,) that the detector looked at.

    `pictures`: rows of `frames` of the camera; `first_frame`: number that the tool gives the first of them. `zoom`
    above 1: the output is of the pieces that the step `zoom` writes.
    """
    if not path.exists():
        raise DiorError(f"{where}: there is no output at {path}; path is relative to data_root")
    if not len(pictures["frame"]):
        raise DiorError(f"{where}: there are no pictures of this camera; correct the row")
    kind = recognise(path)
    u, v, wide, high = window(int(pictures["width"][0]), int(pictures["height"][0]), zoom)
    size = wide, high
    if kind == "empty":
        people, silent = _nobody(path, where)
        check_recording(people, pictures, path, where)
    elif kind is None:
        known = ", ".join(reader.tool for reader in READERS.values())
        raise DiorError(f"{where}: {path} is output of none of {known}; docs/formats.md shows what they look like")
    else:
        reader, camera = READERS[kind], pictures["camera"][0]
        people = of_recording(path, reader, camera, pictures, where, first_frame, size, f"`first_frame` in {SHEET}")
        silent = reader.silent
    if zoom > 1 and len(people.frame):
        middle = np.nanmean(people.uv, axis=1)
        if (np.abs(2 * middle - size) > size).any(axis=1).mean() > 0.5:
            raise DiorError(
                f"{where}: most people in {path} are outside of the {size[0]}x{size[1]} pixels of a picture of zoom "
                f"{zoom}; run the detector on the files of results/zoom as they are, or correct zoom"
            )
    looked_at = np.ones(len(pictures["frame"]), bool)
    if not silent:
        looked_at = np.isin(np.arange(len(looked_at)), people.ran)
    return replace(people, uv=people.uv + (u, v)), looked_at


def _nobody(path: Path, where: str) -> tuple[People, bool]:
    """Output without anybody: an empty list, or a folder of empty files, one per picture."""
    if path.is_dir() and (names := files_by_frame(path, (".txt", ".json"))):
        return gathered(path, COCO_17, [], np.empty((0, len(COCO_17), 3)), list(names)), False
    if path.is_file() and path.stat().st_size:
        return gathered(path, COCO_17, [], np.empty((0, len(COCO_17), 3)), []), True
    raise DiorError(f"{where}: {path} {why_empty(path)} (a list without anybody is written as [])")


def _boxes(grid: LabelGrid, frames: Ints) -> Floats:
    """Label boxes (F, 4) of the pictures `frames` (F,)."""
    edges = np.full((len(frames), 4), np.nan)
    _, here, there = np.intersect1d(frames, grid.frames, return_indices=True)
    edges[here] = label_boxes(grid)[there]
    return edges


def per_frame(people: People, looked_at: Bools, box: Floats) -> dict[str, Ints]:
    """Columns people, keypoints, keypoints_in_box, success (F,) of `detector_frames`; -1 is null.

    `looked_at` (F,), `box` (F, 4) px. Of several people the one with the largest share in the box counts.
    """
    frames = len(looked_at)
    count = np.bincount(people.frame, minlength=frames)
    u_min, v_min, u_max, v_max = box[people.frame].T[:, :, None]
    u, v = people.uv[..., 0], people.uv[..., 1]
    with np.errstate(invalid="ignore"):
        inside = ((u >= u_min) & (u <= u_max) & (v >= v_min) & (v <= v_max)).sum(axis=1)
    total = np.isfinite(u).sum(axis=1)
    order = np.lexsort((total, inside / np.maximum(total, 1), people.frame))
    keypoints, in_box = np.zeros(frames, int), np.zeros(frames, int)
    # the last of a frame's people, in this order, is the one that is written last
    keypoints[people.frame[order]], in_box[people.frame[order]] = total[order], inside[order]
    judged = looked_at & np.isfinite(box).all(axis=1)
    # whole numbers, so that exactly 20 % is 20 %
    success = (count > 0) & (ONE_IN * in_box >= keypoints)
    return {
        "people": np.where(looked_at, count, -1),
        "keypoints": np.where(looked_at, keypoints, -1),
        "keypoints_in_box": np.where(judged, in_box, -1),
        "success": np.where(judged, success, -1),
    }
