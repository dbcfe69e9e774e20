"""Cameras in YAML: Kalibr's camchain and the file that ROS keeps a camera's CameraInfo in.

INPUTS   the content of a file
OUTPUTS  a `GivenCamera` for each camera

Kalibr's camchain (its wiki, "yaml formats" and "supported models"): `intrinsics` of a pinhole are fu fv pu pv; radtan
has OpenCV's k1 k2 p1 p2; `T_cn_cnm1` takes points of the camera before into this one, in metres as its board is given.
`T_cam_imu` is left alone. The world is camera 0, or what camera 0 has a `T_cn_cnm1` from (mrcal writes one).

ROS (image_common, camera_calibration_parsers/src/parse_yml.cpp): `camera_matrix`, `distortion_coefficients` with rows,
cols and data, `distortion_model` (plumb_bob where there is none), no pose. The lens is that of the raw pictures: K and
D, not P.
"""

import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.calibrate.readers.given import GivenCamera, Lens, Pose, numbers, part, rotation, size
from dior.errors import DiorError
from dior.geometry.camera import pose

OF_KALIBR, OF_ROS = ("camera_model", "intrinsics"), ("camera_matrix", "distortion_coefficients", "image_width")
# of Kalibr's pinhole, by how OpenCV and ROS call the same
DISTORTIONS = {"radtan": "plumb_bob", "none": "plumb_bob", "equi": "equidistant (fisheye)", "fov": "fov"}
COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,)}


def is_kalibr(content: Mapping[Any, Any]) -> bool:
    """Whether the content of a YAML file is a camchain."""
    return any(isinstance(one, dict) and set(OF_KALIBR) & set(one) for one in content.values())


def is_ros(content: Mapping[Any, Any]) -> bool:
    """Whether the content of a YAML file is a CameraInfo."""
    return set(OF_ROS) <= set(content)


def of_kalibr(content: Mapping[Any, Any], path: AnyPath) -> list[GivenCamera]:
    """The cameras of a camchain, each with its pose from the first one."""
    named = [(key, one) for key, one in content.items() if isinstance(one, dict) and set(OF_KALIBR) & set(one)]
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
        found.append(GivenCamera(key, part(partial(_lens_of_kalibr, one, where)), placed))
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


def _lens_of_kalibr(one: Mapping[str, Any], where: str) -> Lens:
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


def of_ros(content: Mapping[Any, Any], path: AnyPath, stem: str) -> list[GivenCamera]:
    """The one camera of a CameraInfo file, called as `camera_name` says or as the file without its ending, `stem`."""
    name = str(content.get("camera_name") or stem)
    where = f"{path} [{name}]"
    none = DiorError(f"{where}: a CameraInfo of ROS has no pose; place the camera by another file or by its tape")
    if "R" in content and "T" in content:
        none = DiorError(
            f"{where}: `R` and `T` are only read of OpenCV's files, and its matrices have no `!!opencv-matrix`; write "
            "the file by cv2.FileStorage"
        )
    return [GivenCamera(name, part(partial(_lens_of_ros, content, where)), none, (stem,) if stem != name else ())]


def _lens_of_ros(content: Mapping[str, Any], where: str) -> Lens:
    sides = [numbers(content, key, [()], where) for key in ("image_width", "image_height")]
    width, height = size(np.array(sides), where)
    K = matrix(content, "camera_matrix", where)
    if K.shape != (3, 3):
        raise DiorError(f"{where}: `camera_matrix` must be 3 x 3 numbers")
    if not K.any():
        raise DiorError(f"{where}: K is all zero, so the camera is not calibrated")
    model = str(content.get("distortion_model") or "plumb_bob")
    D = matrix(content, "distortion_coefficients", where).ravel()
    if model in COEFFICIENTS and len(D) not in (0, *COEFFICIENTS[model]):
        raise DiorError(f"{where}: `distortion_coefficients` has {len(D)} numbers, as no {model} lens has")
    return Lens(width, height, K, model, tuple(D.tolist()) if model in COEFFICIENTS else ())


def matrix(content: Mapping[str, Any], key: str, where: str) -> Floats:
    """A matrix written as `rows`, `cols` and `data`, as ROS and OpenCV do. Raises DiorError for anything else."""
    node = content.get(key)
    if not isinstance(node, Mapping):
        raise DiorError(f"{where}: `{key}` is missing, or no matrix with rows, cols and data")
    if "sizes" in node and "rows" not in node:
        # how OpenCV 5 writes a vector
        node = {**node, "rows": numbers(node, "sizes", [(1,)], f"{where}: {key}")[0], "cols": 1}
    rows, columns = (int(numbers(node, side, [()], f"{where}: {key}")) for side in ("rows", "cols"))
    data = node.get("data")
    count = len(data) if isinstance(data, list) else 0
    if min(rows, columns) < 0 or count != rows * columns:
        raise DiorError(f"{where}: `{key}` is {rows} x {columns}, and has {count} numbers")
    return numbers(node, "data", [(count,)], f"{where}: {key}").reshape(rows, columns)
