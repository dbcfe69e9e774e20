"""Labels and what they are compared with, as grids on the same frames and joints.

A grid is (frames, joints, values): pixels or metres, NaN where missing. The tables are complete and sorted, so grids
are joined by frame number and joint name once, and no row is looked at on its own.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import AnyPath, Floats, Ints, Table
from dior.tables import tables
from dior.tables.words import WITHOUT_3D


@dataclass(frozen=True, eq=False)
class LabelGrid:
    """Labels of one camera of one sequence.

    `frames` (F,) frame numbers, `stamp_ns` (F,), `uv` (F, J, 2) px, NaN unless the label is in the picture,
    `in_frame` (F, J) whether its status is ok or occluded, `missing` (F, J) whether there was no 3D.
    """

    camera: str
    frames: np.ndarray
    stamp_ns: np.ndarray
    joints: list
    uv: np.ndarray
    in_frame: np.ndarray
    missing: np.ndarray


def label_grids(paths: Iterable[AnyPath]) -> dict[str, LabelGrid]:
    """`LabelGrid`s by camera of `labels_2d` files, each of one camera or of several."""
    grids = {}
    for path in paths:
        table = tables.read(path, "labels_2d", ["camera", "joint", "frame", "stamp_ns", "u", "v", "status"])
        for camera in tables.ordered_unique(table["camera"]):
            grids[camera] = _label_grid(camera, tables.of_camera(table, camera))
    return dict(sorted(grids.items()))


def _label_grid(camera: str, table: Table) -> LabelGrid:
    uv, joints = tables.grid(table, "u", "v")
    shape = uv.shape[:2]
    status = table["status"].reshape(shape)
    in_frame = (status == "ok") | (status == "occluded")
    return LabelGrid(
        camera,
        table["frame"].reshape(shape)[:, 0],
        table["stamp_ns"].reshape(shape)[:, 0],
        joints,
        np.where(in_frame[..., None], uv.astype(float), np.nan),
        in_frame,
        np.isin(status, WITHOUT_3D),
    )


def value_grid(table: Table, key: str, *columns: str) -> tuple[Floats, Ints, list[str]]:
    """Values (K, J, C) of a complete table, its keys (K,) (frames or instants) and its joints."""
    values, joints = tables.grid(table, *columns)
    return values.astype(float), table[key].reshape(values.shape[:2])[:, 0], joints


def onto(
    frames: Ints, joints: Sequence[str], values: Floats, value_frames: Ints, value_joints: Sequence[str]
) -> Floats:
    """`values` (K, M, C) brought onto `frames` (F,) and `joints` (J,): (F, J, C), NaN where there is none."""
    out = np.full((len(frames), len(joints), values.shape[-1]), np.nan)
    position = {joint: i for i, joint in enumerate(value_joints)}
    here = [i for i, joint in enumerate(joints) if joint in position]
    there = [position[joints[i]] for i in here]
    _, row, value_row = np.intersect1d(frames, value_frames, return_indices=True)
    out[row[:, None], here] = values[value_row[:, None], there]
    return out


def distance(a: Floats, b: Floats) -> Floats:
    """Euclidean distance along the last axis; NaN where either is missing."""
    return np.linalg.norm(a - b, axis=-1)
