"""Hand-marked points: how well the marks fit their camera, and how far labels are from checks nobody used.

INPUTS   `marks` tables of locate; `checks/<sequence>.<camera>.csv`: `sequence,frame,joint,u,v`, px. A row without u and
         v is one of `to_mark` that is not marked yet, or where the marker is not seen: it does not count.
OUTPUT   distances px.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Floats, Table
from dior.errors import DiorError, Faults, nearest
from dior.evaluate.grids import LabelGrid, distance
from dior.project.boxes import FAR_PX, Size
from dior.project.pixels import in_picture
from dior.project.plain_text import rows_of
from dior.tables import tables

REQUIRED = ("sequence", "frame", "joint", "u", "v")


def mark_errors(paths: Iterable[AnyPath], sequence: str) -> dict[str, Floats]:
    """Residuals px by camera of this sequence's marks, outliers included: leaving them out would flatter."""
    errors: dict[str, Floats] = {}
    for path in paths:
        marks = tables.read(path, "marks", ["camera", "sequence", "residual_px"])
        for camera in tables.ordered_unique(marks["camera"]):
            here = (marks["camera"] == camera) & (marks["sequence"] == sequence)
            errors[camera] = np.concatenate([errors.get(camera, []), marks["residual_px"][here]])
    return dict(sorted(errors.items()))


def check_points(path: AnyPath, sequence: str, grid: LabelGrid, size: Size | None = None) -> Floats:
    """Hand checks (F, J, 2) px on the frames and joints of the labels, NaN where nothing was checked. As `points`."""
    row_of = {frame: i for i, frame in enumerate(grid.frames.tolist())}
    checked = np.full(grid.uv.shape, np.nan)
    for (frame, joint), uv in points(path, sequence, row_of, grid.joints, size).items():
        checked[row_of[frame], grid.joints.index(joint)] = uv
    return checked


def points(
    path: AnyPath, sequence: str, frames: Iterable[int], joints: Sequence[str] | None = None, size: Size | None = None
) -> dict[tuple[int, str], tuple[float, float]]:
    """Hand checks (u, v) px by frame and joint.

    `frames` of the recording; `joints` of the labels and `size` of the pictures, where they are known. Raises DiorError
    for all rows together, naming file and line: malformed, another sequence's, a frame or joint that is not there, a
    point outside of the picture.
    """
    path, frames = Path(path), set(frames)
    lines = rows_of(path, path)
    header = lines[0][1] if lines else []
    for column in REQUIRED:
        if column not in header:
            raise DiorError(f"{path}: the first line has no column '{column}'{nearest(column, header)}")
    found: dict[tuple[int, str], tuple[float, float]] = {}
    faults = Faults()
    for number, words in lines[1:]:
        where = f"{path}, line {number}"
        cells = dict(zip(header, words, strict=False))
        if not cells.get("u", "-") and not cells.get("v", "-"):
            continue
        with faults.kept():
            try:
                frame, uv = int(cells["frame"]), (float(cells["u"]), float(cells["v"]))
            except (ValueError, KeyError):
                raise DiorError(
                    f"{where}: '{','.join(words):.80}' has no whole frame number and no two pixel values"
                ) from None
            joint = cells["joint"]
            if cells["sequence"] != sequence:
                raise DiorError(f"{where}: is of sequence '{cells['sequence']}', not '{sequence}'")
            if frame not in frames:
                raise DiorError(f"{where}: frame {frame} is not in the recording; frames count from 0")
            if joints is not None and joint not in joints:
                raise DiorError(f"{where}: no label is called '{joint}'{nearest(joint, joints)}")
            if not all(abs(pixel) <= FAR_PX for pixel in uv):
                raise DiorError(f"{where}: the point at ({cells['u']}, {cells['v']}) is in no picture")
            if size and not in_picture(np.array(uv), *size):
                raise DiorError(f"{where}: ({uv[0]:g}, {uv[1]:g}) is outside of the {size[0]}x{size[1]} picture")
            if (frame, joint) in found:
                raise DiorError(f"{where}: {joint} of frame {frame} is there already; keep one of the two rows")
            found[frame, joint] = uv
    faults.tell()
    return found


def error_columns(grid: LabelGrid, checked: Floats, role: str) -> Table:
    """Columns of `check_errors` of one camera, a row per hand check of an in-frame label."""
    errors = distance(grid.uv, checked)
    frame, joint = np.nonzero(np.isfinite(errors))
    return {
        "camera": np.full(len(frame), grid.camera, dtype=object),
        "role": np.full(len(frame), role, dtype=object),
        "joint": np.array(grid.joints, dtype=object)[joint],
        "frame": grid.frames[frame],
        "u": checked[frame, joint, 0],
        "v": checked[frame, joint, 1],
        "error": errors[frame, joint],
    }
