"""Landmarks as CSV, the layout of ML Kit's fitness pose samples.

INPUTS   rows without a header: picture name, class, 33 x (x, y, z); x and y are pixels of that picture, z is as large
         as x and counts from the hips, and there is no score. A recording has one row per picture, whose name is
         <anything><frame>.<ext>; the class is not used.
OUTPUTS  `People` with the joints MLKIT_33, every score 1.
"""

import re

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import INTERRUPTED, frame_of
from dior.project.plain_text import each_row

# of a file
LONGEST_NAME = 255
# chosen: half an hour of pictures
MOST_BYTES = 1 << 26
COLUMNS = 2 + 3 * len(MLKIT_33)
DESCRIPTIONS = (
    DetectionFormat(
        key="mlkit_csv",
        tool="ML Kit's pose samples, CSV",
        file="a file",
        joints="33",
        frame="last number in the picture's name",
        score="none: 1",
        nobody="not told",
        refused="pictures of more than one recording, such as ML Kit's own collection",
        samples=(
            Sample(
                "ML Kit CSV",
                "812 rows x 33 x (x, y, z), 4 classes",
                "real: ML Kit's fitness samples, `detections/mlkit_fitness_pose_samples.csv`",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """The landmarks of a recording. Raises DiorError for other rows and for pictures of more than one recording."""
    names, _, points = poses(path)
    # the search for the last number takes the square of the length
    if too_long := next((name for name in names if len(name) > LONGEST_NAME), ""):
        raise DiorError(
            f"{path}: the picture '{too_long[:40]}...' has a name of {len(too_long)} letters; {INTERRUPTED}"
        )
    stems = sorted({re.sub(r"\d+(?!.*\d)", "#", name.rpartition(".")[0] or name) for name in names})
    if len(stems) > 1:
        raise DiorError(
            f"{path}: pictures of {len(stems)} recordings ({stems[0]}, {stems[1]}, ...), which are no frames of one "
            "camera; keep the rows of one"
        )
    frame = [frame_of(name, f"{path}: {name}") for name in names]
    points[..., 2] = 1.0
    return gathered(path, MLKIT_33, frame, points, frame)


def poses(path: AnyPath) -> tuple[list[str], list[str], Floats]:
    """(names, classes, points (rows, 33, 3)) as the file has them, of any pictures."""
    names, classes, rows = [], [], []
    for line, row in each_row(path, path, most_bytes=MOST_BYTES):
        if len(row) != COLUMNS:
            raise DiorError(f"{path}: line {line} has {len(row)} columns, not {COLUMNS}; {INTERRUPTED}")
        names.append(row[0])
        classes.append(row[1])
        try:
            rows.append([float(cell) for cell in row[2:]])
        except ValueError as error:
            raise DiorError(f"{path}: line {line} is not name, class, 99 numbers ({error!s:.80})") from None
    if not rows:
        raise DiorError(f"{path} is empty; run the detector")
    return names, classes, np.array(rows).reshape(-1, len(MLKIT_33), 3)
