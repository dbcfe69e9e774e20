"""Detections of a YOLO pose model as text rows.

INPUTS   a folder of <anything>_<frame>.txt, a row per person, or one file whose rows begin with the frame:
         class, box (centre, size), then 17 x (x, y, conf): 56 columns, or 17 x (x, y): 39; up to two more at the end
         (the box's confidence, the track) are not used. Fractions of the picture; `0 0 conf` is a missing joint; a
         joint without conf has score 1. Only class 0, the person, is read. A picture without a person has no file, an
         empty one, or no row.
OUTPUTS  `People` with the joints COCO_17, in fractions of the picture's width and height.
"""

import os
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import COCO_17
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import INTERRUPTED, content_of, files_by_frame

# class and box before the keypoints; the box's confidence and the track may come after
BOX = 5
MOST_AT_THE_END = 2
ONE_PICTURE = "is it the file of one picture? Then name the folder of them in `detections`"
WIDTHS = (BOX + 3 * len(COCO_17), BOX + 2 * len(COCO_17))
DESCRIPTIONS = (
    DetectionFormat(
        key="yolo",
        tool="Ultralytics pose, text",
        file="the folder of `<stem>_<frame>.txt`, or a file whose rows begin with the frame",
        joints="17",
        frame="file's name, or first column",
        score="conf; 1 in rows of 39 columns, which have none",
        nobody="an empty file; else not told apart from not run",
        refused="rows of a stream in a folder, and a picture's in a file; other numbers of columns; other classes "
        "than 0 are not read",
        samples=(
            Sample(
                "YOLO pose: 56 and 39 columns, each per picture and as a stream",
                "two people, `0 0 conf`, other classes, the box's confidence and track at the end",
                "written here",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the folder or file. Raises DiorError for rows that are not of a YOLO pose model."""
    if not os.path.isdir(path):
        rows = _rows(path, leading=1)
        if not rows:
            raise DiorError(f"{path} is empty; run the detector")
        rows = [row for row in rows if row[1] == 0]
        return gathered(path, COCO_17, [row[0] for row in rows], _points([row[1:] for row in rows], path))
    names = files_by_frame(path, ".txt")
    frame: list[int] = []
    rows = []
    for number, name in names.items():
        found = [row for row in _rows(Path(path) / name, leading=0) if row[0] == 0]
        frame += [number] * len(found)
        rows += found
    return gathered(path, COCO_17, frame, _points(rows, path), list(names))


def _rows(path: AnyPath, leading: int) -> list[list[float]]:
    """Numbers of every row that is not empty, all of the same kind."""
    rows = []
    for count, line in enumerate(content_of(path).splitlines(), 1):
        words = line.split()
        if not words:
            continue
        where = f"{path}: line {count}"
        if keypoint_width(len(words) - leading) is None:
            if leading and keypoint_width(len(words)):
                raise DiorError(f"{where} has {len(words)} columns and no frame at its beginning; {ONE_PICTURE}")
            known = " or ".join(str(width + leading) for width in WIDTHS)
            raise DiorError(f"{where} has {len(words)} columns, not {known}; {INTERRUPTED}")
        try:
            row = [float(word) for word in words]
        except ValueError:
            raise DiorError(f"{where} holds something that is no number; {INTERRUPTED}") from None
        kind, centre = row[leading : leading + 2]
        # a box whose centre is 0 is a class, and a class with decimals a box's centre: a column too many or too few
        if not kind.is_integer() or not centre:
            shift = ONE_PICTURE if leading else "rows that begin with the frame belong in one file, not in a folder"
            raise DiorError(f"{where} has no class and box at its {'second' if leading else 'first'} column; {shift}")
        rows.append(row)
    return rows


def keypoint_width(width: int) -> int | None:
    """Numbers per keypoint (3 or 2) of rows of `width` columns without a frame, or None."""
    return next((3 - i for i, least in enumerate(WIDTHS) if least <= width <= least + MOST_AT_THE_END), None)


def _points(rows: list[list[float]], path: AnyPath) -> Floats:
    """Rows from the class on as (P, 17, 3)."""
    if not rows:
        return np.empty((0, len(COCO_17), 3))
    if len({len(row) for row in rows}) > 1:
        raise DiorError(f"{path}: rows of {min(map(len, rows))} and of {max(map(len, rows))} columns; {INTERRUPTED}")
    per_point = keypoint_width(len(rows[0]))
    assert per_point is not None, "_rows lets no other width pass"
    values = np.array(rows)[:, BOX : BOX + per_point * len(COCO_17)].reshape(len(rows), len(COCO_17), per_point)
    points = values if per_point == 3 else np.concatenate([values, np.ones_like(values[..., :1])], axis=-1)
    points[(points[..., :2] == 0).all(axis=-1)] = np.nan
    return points
