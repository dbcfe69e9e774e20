"""Cameras in Kalibr's camchain (YAML).

INPUTS   a file
OUTPUTS  a `GivenCamera` for each camera
Source: Kalibr's wiki, "yaml formats" and "supported models". `intrinsics` of a pinhole are fu fv pu pv; radtan has
OpenCV's k1 k2 p1 p2; `T_cn_cnm1` takes points of the camera before into this one, in metres as its board is given.
`T_cam_imu` is left alone. The world is camera 0, or what camera 0 has a `T_cn_cnm1` from (mrcal writes one).
"""

import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from dior.arrays import Floats
from dior.calibrate.readers.given import GivenCamera, Lens, Pose, numbers, part, rotation, size
from dior.calibrate.readers.source import Source
from dior.errors import DiorError
from dior.formats import CalibrationFormat
from dior.geometry.camera import pose

OF_A_CAMERA = ("camera_model", "intrinsics")
# of its pinhole, by how OpenCV and ROS call the same
DISTORTIONS = {"radtan": "plumb_bob", "none": "plumb_bob", "equi": "equidistant (fisheye)", "fov": "fov"}
DESCRIPTIONS = (
    CalibrationFormat(
        key="kalibr",
        file="Kalibr camchain YAML",
        name="`cam0`, `cam1`, ...",
        convention="cTw",
        unit="m",
        world="camera 0: `from_walk` or `from_marks`",
        lens="pinhole with radtan or none",
        checked="each link is a rotation with the last row 0, 0, 0, 1, none is missing and no camera is left "
        "out; `T_cam_imu` is left alone",
        sample="written here by Kalibr's wiki",
    ),
)


def recognises(source: Source) -> bool:
    """Whether a YAML file is a camchain."""
    return bool(_cameras_in(source))


def _cameras_in(source: Source) -> list[tuple[Any, dict[Any, Any]]]:
    return [(key, one) for key, one in source.mapping.items() if isinstance(one, dict) and set(OF_A_CAMERA) & set(one)]


def cameras(source: Source) -> list[GivenCamera]:
    """The cameras of a camchain, each with its pose from the first one."""
    named, path = _cameras_in(source), source.path
    wrong = next((key for key, _ in named if not re.fullmatch(r"cam\d{1,4}", str(key))), None)
    if wrong is not None:
        raise DiorError(f"{path} [{wrong}]: a camchain's cameras are called cam0, cam1, ...; is it Kalibr's?")
    named.sort(key=lambda pair: int(pair[0][3:]))
    before: Floats | DiorError = np.eye(4)
    found = []
    origin = f"its world is that of camera {named[0][0]} (Kalibr's chain begins there)"
    last = ""
    for key, one in named:
        where = f"{path} [{key}]"
        before = part(partial(_chained, one, before, last, key, where))
        last = key
        placed = before if isinstance(before, DiorError) else Pose(before, "cTw", "m", origin=origin)
        found.append(GivenCamera(key, part(partial(_lens, one, where)), placed))
    return found


def _chained(one: Mapping[str, Any], before: Floats | DiorError, last: str, key: str, where: str) -> Floats:
    """cTw (4, 4) m of the camera `key`, whose forerunner in the file is `last` ("" for none) with the pose `before`."""
    if isinstance(before, DiorError):
        raise before
    if not last and "T_cn_cnm1" not in one:
        return before
    if last and int(key[3:]) != int(last[3:]) + 1:
        raise DiorError(
            f"{where}: the camera before it is {last}, and its `T_cn_cnm1` leads from cam{int(key[3:]) - 1}; put that "
            "back into the camchain, or calibrate without it"
        )
    T = numbers(one, "T_cn_cnm1", [(4, 4)], where)
    if not np.array_equal(T[3], [0, 0, 0, 1]):
        looks = "; it looks transposed: write it by rows" if T[3, :3].any() and not T[:3, 3].any() else ""
        raise DiorError(f"{where}: `T_cn_cnm1` must have the last row 0, 0, 0, 1, and has {T[3].tolist()}{looks}")
    return pose(rotation(T[:3, :3], where), T[:3, 3]) @ before


def _lens(one: Mapping[str, Any], where: str) -> Lens:
    width, height = size(numbers(one, "resolution", [(2,)], where), where)
    kind, bent = str(one.get("camera_model")), str(one.get("distortion_model", "none"))
    if kind != "pinhole":
        return Lens(width, height, np.eye(3), f"{kind} with {bent}", ())
    fx, fy, cx, cy = numbers(one, "intrinsics", [(4,)], where)
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    model = DISTORTIONS.get(bent, bent)
    if model != "plumb_bob":
        return Lens(width, height, K, model, ())
    coefficients = () if bent == "none" else tuple(numbers(one, "distortion_coeffs", [(4,)], where).tolist())
    return Lens(width, height, K, model, coefficients)
