"""Cameras and their covariance as tables: `cameras`, `released_cameras`, `camera_covariance`."""

import os
from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import AnyPath, Floats, Table
from dior.errors import DiorError, nearest
from dior.geometry.camera import Camera, Intrinsics
from dior.tables import tables


def camera_columns(
    cameras: Sequence[Camera],
    session: str = "",
    sequence: str = "",
    offset_s: ArrayLike | None = None,
    drift_ppm: ArrayLike | None = None,
) -> dict[str, Any]:
    """Columns of the `cameras` table from a list of `Camera`."""
    lenses = [camera.intrinsics for camera in cameras]
    unknown = np.full(16, np.nan)
    columns = {
        "session": [session] * len(cameras),
        "sequence": [sequence] * len(cameras),
        "camera": [camera.name for camera in cameras],
        "role": [camera.role for camera in cameras],
        "locate": [camera.locate for camera in cameras],
        "occluded": [camera.occluded for camera in cameras],
        "distortion_model": [lens.model for lens in lenses],
        "distortion": [lens.distortion for lens in lenses],
        "wTc": [unknown if camera.wTc is None else np.ravel(camera.wTc) for camera in cameras],
    }
    for key in ("width", "height", "fx", "fy", "cx", "cy"):
        columns[key] = [getattr(lens, key) for lens in lenses]
    columns["intrinsics_sigma"] = [lens.sigma for lens in lenses]
    if offset_s is not None:
        columns["offset_s"] = offset_s
    if drift_ppm is not None:
        columns["drift_ppm"] = drift_ppm
    return columns


def write_cameras(
    path: AnyPath,
    cameras: Sequence[Camera],
    session: str = "",
    sequence: str = "",
    offset_s: ArrayLike | None = None,
    drift_ppm: ArrayLike | None = None,
) -> None:
    """Write a `cameras` table."""
    tables.write(path, "cameras", camera_columns(cameras, session, sequence, offset_s, drift_ppm))


def read_cameras(paths: AnyPath | Iterable[AnyPath]) -> dict[str, Camera]:
    """Cameras by name from one `cameras` table or several."""
    cameras: dict[str, Camera] = {}
    for path in [paths] if isinstance(paths, (str, os.PathLike)) else paths:
        t = tables.read(path, "cameras")
        cameras |= {name: _camera(t, i) for i, name in enumerate(t["camera"])}
    return cameras


def read_released_cameras(path: AnyPath) -> dict[tuple[str, str], Camera]:
    """Cameras by (session, camera) from the `released_cameras` table of a release."""
    return of_released(tables.read(path, "released_cameras"))


def of_released(t: Table) -> dict[tuple[str, str], Camera]:
    """The same from the table."""
    return {key: _camera(t, i) for i, key in enumerate(zip(t["session"], t["camera"], strict=True))}


def _camera(t: Table, i: int) -> Camera:
    """The camera in row `i` of a table of cameras."""
    lens = Intrinsics(
        int(t["width"][i]),
        int(t["height"][i]),
        float(t["fx"][i]),
        float(t["fy"][i]),
        float(t["cx"][i]),
        float(t["cy"][i]),
        t["distortion_model"][i],
        tuple(t["distortion"][i].tolist()),
        float(np.nan_to_num(t["intrinsics_sigma"][i])),
    )
    wTc = t["wTc"][i].reshape(4, 4)
    camera = Camera(t["camera"][i], lens, role=t["role"][i], locate=t["locate"][i], occluded=t["occluded"][i])
    return camera.at(wTc) if np.isfinite(wTc).all() else camera


def read_placed(paths: Sequence[AnyPath], names: Iterable[str], where: str) -> list[Camera]:
    """The cameras called `names`, in that order, of `cameras` tables. Raises DiorError for one without a pose."""
    rig = read_cameras(paths)
    for name in names:
        if name not in rig or rig[name].wTc is None:
            raise DiorError(f"{where}, camera {name}: {', '.join(map(str, paths))} gives no pose of it")
    return [rig[name] for name in names]


def write_camera_covariance(
    path: AnyPath, names: Sequence[str], covariance: Floats, session: str = "", own: Collection[str] | None = None
) -> None:
    """Write a `camera_covariance` table of V cameras from (6V, 6V), or (9V, 9V) with their lenses; NaN is unknown.

    `own`: the cameras whose rows are written, all by default; the others' are in another file.
    """
    pairs = [(i, j) for i, name in enumerate(names) if own is None or name in own for j in range(len(names))]
    each = len(covariance) // max(len(names), 1)
    blocks = np.zeros((len(names), 9, len(names), 9))
    blocks[:, :each, :, :each] = np.asarray(covariance, float).reshape(len(names), each, len(names), each)
    columns: dict[str, tables.Column] = {
        "session": [session] * len(pairs),
        "camera": [names[i] for i, _ in pairs],
        "other": [names[j] for _, j in pairs],
        "covariance": [blocks[i, :6, j, :6].ravel() for i, j in pairs],
        "with_lens": [
            np.concatenate([blocks[i, :6, j, 6:].ravel(), blocks[i, 6:, j, :6].ravel(), blocks[i, 6:, j, 6:].ravel()])
            for i, j in pairs
        ],
    }
    tables.write(path, "camera_covariance", columns)


def read_camera_covariance(
    paths: AnyPath | Iterable[AnyPath], names: Sequence[str], with_lenses: bool = False
) -> Floats:
    """Covariance (6V, 6V) of the cameras `names` from one or several `camera_covariance` tables.

    With their lenses it is (9V, 9V), nine rows a camera (`dior.geometry.covariance`).

    A camera that is in none of them, or not known, has NaN in its own block and with every other; cameras of which no
    table has a pair are taken as independent.
    """
    blocks = {}
    for path in [paths] if isinstance(paths, (str, os.PathLike)) else paths:
        t = tables.read(path, "camera_covariance")
        for a, b, values, lens in zip(t["camera"], t["other"], t["covariance"], t["with_lens"], strict=True):
            # a table without lenses has none that are uncertain
            lens = np.nan_to_num(lens)
            blocks[a, b] = np.block(
                [[values.reshape(6, 6), lens[:18].reshape(6, 3)], [lens[18:36].reshape(3, 6), lens[36:].reshape(3, 3)]]
            )
    out = np.zeros((len(names), 9, len(names), 9))
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            unknown = any(not np.isfinite(blocks.get((c, c), np.nan)).all() for c in (a, b))
            pair = blocks[a, b] if (a, b) in blocks else blocks[b, a].T if (b, a) in blocks else np.zeros((9, 9))
            out[i, :, j] = np.nan if unknown else pair
    each = 9 if with_lenses else 6
    return out[:, :each, :, :each].reshape(each * len(names), each * len(names))


def unplaced(path: AnyPath, camera: str) -> Camera:
    """The `Camera` of that name in an intrinsics table. Raises DiorError where it is not there."""
    cameras = read_cameras(path)
    if camera not in cameras:
        raise DiorError(f"{path}: no camera '{camera}'{nearest(camera, cameras)}")
    return cameras[camera]
