"""Cameras in the YAML, XML or JSON that OpenCV's FileStorage writes, by the names of OpenCV's own samples.

INPUTS   a file
OUTPUTS  a `GivenCamera` for the one camera of a file, or two for a stereo pair
Sources: FileStorage of OpenCV 4 and 5 (matrices as `rows`, `cols`, `dt`, `data`; lists of rows, as Python's json.dump
writes them, are read as well), and the names in
samples/cpp/calibration.cpp and tutorial_code/calib3d (`camera_matrix`, `distortion_coefficients`, `image_width`,
`image_height`, `fisheye_model`) and stereo_calib.cpp (`M1`, `D1`, `M2`, `D2`; `R` and `T` lead from the first camera to
the second). The samples write `M1` and `R` into two files and no size beside them, so that each gives a part only.

`R` and `T` beside one camera lead from the world to it, as everywhere in OpenCV. Their unit is that of the board's
squares, which the file does not tell; what `dior export-cameras` writes has `units` besides.
"""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dior.arrays import Floats
from dior.calibrate.readers.given import METRES, GivenCamera, Lens, Pose, matrix, numbers, part, rotation, size
from dior.calibrate.readers.source import Source
from dior.errors import DiorError
from dior.formats import CalibrationFormat
from dior.geometry.camera import pose

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

KIND = "type_id"
# of OpenCV's distortion coefficients by their number: those behind k6 are of thin prisms (4) and a tilted sensor (2)
MODELS = {4: "plumb_bob", 5: "plumb_bob", 8: "rational_polynomial", 12: "thin prism", 14: "tilted sensor"}
FISHEYE = "equidistant (fisheye)"
# what a file has that is of a camera
ONE, PAIR = ("camera_matrix", "distortion_coefficients"), ("M1", "D1", "M2", "D2", "R", "T")
DESCRIPTIONS = (
    CalibrationFormat(
        key="opencv",
        file="OpenCV FileStorage, YAML, XML or JSON: `camera_matrix`, `distortion_coefficients`, "
        "`image_width`, `image_height`, and `R`, `T` beside them; "
        "matrices as lists of rows, too",
        name="the file's name without its ending",
        convention="cTw",
        unit="asked for, unless the file has `units`",
        world="not told",
        lens="plumb_bob (4, 5 numbers), rational_polynomial (8)",
        checked="shapes; more than 8 numbers that are not zero",
        sample="written by OpenCV 5; its header as OpenCV 4 writes it",
    ),
    CalibrationFormat(
        key="opencv",
        file="OpenCV's stereo sample: `M1`, `D1`, `M2`, `D2`; `R`, `T`",
        name="`1`, `2`",
        convention="cTw",
        unit="asked for, unless the file has `units`",
        world="camera 1: `from_walk` or `from_marks`",
        lens="plumb_bob (4, 5 numbers), rational_polynomial (8); the size has to be added, the sample writes none",
        checked="shapes; more than 8 numbers that are not zero",
        sample="written by OpenCV 5",
    ),
)


def _content(source: Source) -> dict[Any, Any]:
    """What is in a file of FileStorage; of XML as the YAML one has it."""
    if source.xml is None:
        return source.mapping
    return {element.tag: _plain(element) for element in source.xml} if source.xml.tag == "opencv_storage" else {}


def _plain(element: "Element") -> Any:
    if len(element):
        inside = {one.tag: (one.text or "").strip() for one in element}
        lists = {key: inside.get(key, "").split() for key in ("data", "sizes") if key in inside}
        return inside | lists | {KIND: element.attrib.get(KIND, "")}
    return (element.text or "").strip().strip('"')


def recognises(source: Source) -> bool:
    """Whether a file has a camera by one of the names."""
    content = _content(source)
    return any(key in content for key in (*ONE, *PAIR))


def cameras(source: Source) -> list[GivenCamera]:
    """The cameras of a file: one that is called as the file without its ending, or "1" and "2" of a pair."""
    content, path, stem = _content(source), source.path, source.stem
    lists = any(isinstance(content[key], list) for key in (*ONE, *PAIR) if key in content)
    if source.xml is None and not source.has_opencv_matrix and not lists:
        raise DiorError(
            f"{path}: has the names of OpenCV's calibrations and no matrix as its FileStorage writes it "
            "(`!!opencv-matrix` with rows, cols, dt and data), nor as a list of rows; write it by cv2.FileStorage"
        )
    if "camera_matrix" in content or not any(key in content for key in PAIR):
        where = f"{path} [{stem}]"
        lens = part(partial(_lens, content, *ONE, where))
        return [GivenCamera(stem, lens, part(partial(_placed, content, where)))]
    first, second = (f"{path} [{name}]" for name in "12")
    lenses = part(partial(_lens, content, "M1", "D1", first)), part(partial(_lens, content, "M2", "D2", second))
    poses = part(partial(_of_pair, content, True, first)), part(partial(_of_pair, content, False, second))
    return [GivenCamera("1", lenses[0], poses[0]), GivenCamera("2", lenses[1], poses[1])]


def _lens(content: Mapping[str, Any], K: str, D: str, where: str) -> Lens:
    pinhole = matrix(content, K, where)
    if pinhole.shape != (3, 3):
        raise DiorError(f"{where}: `{K}` must be 3 x 3 numbers")
    if "image_width" not in content:
        raise DiorError(
            f"{where}: the file does not say the size of the pictures; add `image_width` and `image_height` to it, as "
            "OpenCV's calibration sample writes them"
        )
    sides = [numbers(content, key, [()], where) for key in ("image_width", "image_height")]
    width, height = size(np.array(sides), where)
    coefficients = matrix(content, D, where).ravel()
    if _is_fisheye(content):
        return Lens(width, height, pinhole, FISHEYE, ())
    # OpenCV takes none for a lens without distortion
    coefficients = coefficients if len(coefficients) else np.zeros(4)
    if len(coefficients) not in MODELS:
        raise DiorError(f"{where}: `{D}` must be 4, 5, 8, 12 or 14 numbers, and there is {len(coefficients)}")
    used = coefficients if coefficients[8:].any() else coefficients[:8]
    return Lens(width, height, pinhole, MODELS[len(used)], tuple(used.tolist()))


def _is_fisheye(content: Mapping[str, Any]) -> bool:
    return str(content.get("fisheye_model", "0")) not in ("0", "")


def _placed(content: Mapping[str, Any], where: str) -> Pose:
    """The pose of the one camera of a file."""
    if "R" not in content:
        raise DiorError(f"{where}: the file has no pose (`R` and `T`)")
    return Pose(_rigid(content, where), "cTw", _units(content, where))


def _units(content: Mapping[str, Any], where: str) -> str:
    units = str(content.get("units", ""))
    if units not in ("", *METRES):
        raise DiorError(f"{where}: units '{units}' is not one of {', '.join(METRES)}")
    return units


def _of_pair(content: Mapping[str, Any], first: bool, where: str) -> Pose:
    T = np.eye(4) if first else _rigid(content, where)
    return Pose(T, "cTw", _units(content, where), origin="its world is that of the first camera of the pair")


def _rigid(content: Mapping[str, Any], where: str) -> Floats:
    """T (4, 4) from `R` (3 x 3, or a Rodrigues vector) and `T`."""
    turn, shift = matrix(content, "R", where), matrix(content, "T", where).ravel()
    if turn.size not in (3, 9) or len(shift) != 3:
        raise DiorError(f"{where}: `R` must be 3 x 3 or 3 numbers, and `T` 3")
    return pose(rotation(turn if turn.size == 9 else turn.ravel(), where), shift)
