"""The camera in the YAML file that ROS keeps a CameraInfo in.

INPUTS   a file
OUTPUTS  its one `GivenCamera`
Source: image_common, camera_calibration_parsers/src/parse_yml.cpp. `camera_matrix`, `distortion_coefficients` with
rows, cols and data, `distortion_model` (plumb_bob where there is none), no pose. The lens is that of the raw pictures:
K and D, not P.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from dior.calibrate.readers.given import GivenCamera, Lens, matrix, numbers, part, size
from dior.calibrate.readers.source import Source
from dior.errors import DiorError
from dior.formats import CalibrationFormat

KEYS = ("camera_matrix", "distortion_coefficients", "image_width")
COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,)}
DESCRIPTIONS = (
    CalibrationFormat(
        key="ros_info",
        file="ROS `camera_info` YAML",
        name="`camera_name`, or the file's name",
        convention="no pose",
        unit="",
        world="",
        lens="plumb_bob, rational_polynomial; K and D, for raw pictures",
        checked="number of coefficients, a K of zeros",
        sample="written here by `camera_calibration_parsers`",
    ),
)


def recognises(source: Source) -> bool:
    """Whether a YAML file is a CameraInfo, whose keys OpenCV's files may have as well."""
    K = source.mapping.get("camera_matrix")
    return set(KEYS) <= set(source.mapping) and not isinstance(K, list) and not source.has_opencv_matrix


def cameras(source: Source) -> list[GivenCamera]:
    """The one camera of a CameraInfo file, called as `camera_name` says or as the file without its ending."""
    content, path, stem = source.mapping, source.path, source.stem
    name = str(content.get("camera_name") or stem)
    where = f"{path} [{name}]"
    none = DiorError(f"{where}: a CameraInfo of ROS has no pose; place the camera by another file or by its tape")
    if "R" in content and "T" in content:
        none = DiorError(
            f"{where}: `R` and `T` are only read of OpenCV's files, and its matrices have no `!!opencv-matrix`; write "
            "the file by cv2.FileStorage"
        )
    return [GivenCamera(name, part(partial(_lens, content, where)), none, (stem,) if stem != name else ())]


def _lens(content: Mapping[str, Any], where: str) -> Lens:
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
