"""Cameras in the XML that Qualisys Track Manager exports (`.qca.txt`).

INPUTS   a file
OUTPUTS  a `GivenCamera` for each camera, called by its serial number
Sources, which agree: Pose2Sim 0.10.49 (`calibration.read_qca`), public code that draws QTM's markers into the videos of
Miqus cameras with this file, and public code that calibrates the lenses of the LBMC data anew. They say:
- `transform` has the place x, y, z (mm) in the world, and with r11 r12 r13 as a row the rotation from the world to the
  camera, whose axes are x right, y up and z backward; OpenCV's are turned by 180 degrees about x.
- `intrinsic` is in 1/64 px of the sensor; radial and tangential distortion are OpenCV's k1 k2 (k3), p1 p2 as they are.
  Pose2Sim divides these by 64, too, and its own data fit them undivided (README, real_outdoor).
- `fov_video` is the part of the sensor that the pictures show, its right and bottom edge included.
That the unit is 1/64 px is checked by the size of the sensor. Theia3D writes a file alike in pixels, with another
`transform`: it is refused. The world is that of the L-frame, whose Z is up unless somebody set another axis in QTM.
"""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dior.calibrate.readers.given import GivenCamera, Lens, Pose, part, rotation
from dior.calibrate.readers.given import size as whole
from dior.calibrate.readers.source import Source
from dior.calibrate.readers.xml_text import attributes
from dior.errors import DiorError
from dior.formats import CalibrationFormat
from dior.geometry.camera import pose

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

SUBPIXELS = 64.0
# chosen: whether the last pixel is counted, of a thousand
SENSOR_SHARE = 0.01
NO = ("0", "false", "no")
FLIP = np.diag([1.0, -1.0, -1.0])
DESCRIPTIONS = (
    CalibrationFormat(
        key="qualisys",
        file="Qualisys `.qca.txt`",
        name="the serial number",
        convention="its own; turned to OpenCV's axes",
        unit="mm; 1/64 px",
        world="the L-frame, Z up unless QTM was told otherwise",
        lens="plumb_bob, the coefficients as they are",
        checked="the sensor has 64 units a pixel (Theia3D's file has not), `active`, `calibrated`",
        sample="Pose2Sim's file for `real_outdoor`; poses as Pose2Sim reads them",
    ),
)


def recognises(source: Source) -> bool:
    """Whether a file is one of QTM's calibrations."""
    return bool(source.elements("calibration", "cameras/camera"))


def cameras(source: Source) -> list[GivenCamera]:
    """The cameras of a file."""
    found = []
    for number, element in enumerate(source.elements("calibration", "cameras/camera"), 1):
        name = element.attrib.get("serial") or str(number)
        found.append(_camera(name, element, f"{source.path} [{name}]"))
    return found


def _camera(name: str, element: "Element", where: str) -> GivenCamera:
    return GivenCamera(name, part(partial(_lens, element, where)), part(partial(_pose, element, where)))


def _check_unit(element: "Element", where: str) -> None:
    """Raise DiorError unless the whole sensor has 64 units for each pixel of the largest pictures."""
    largest = element.find("fov_video_max")
    edges = attributes(element.find("fov_video") if largest is None else largest, ["right", "bottom"], where)
    inner = element.find("intrinsic")
    most, least = (attributes(inner, [f"sensor{end}U", f"sensor{end}V"], where) for end in ("Max", "Min"))
    if (np.abs((most - least) / np.maximum(edges, 1.0) / SUBPIXELS - 1) > SENSOR_SHARE).any():
        raise DiorError(
            f"{where}: the sensor is {most[0]:g} x {most[1]:g} for pictures up to {edges[0]:g}, {edges[1]:g}, so that "
            "its unit is not the 1/64 px of QTM (Theia3D writes pixels, and another transform); export it from QTM"
        )


def _lens(element: "Element", where: str) -> Lens:
    _check_unit(element, where)
    left, top, right, bottom = attributes(element.find("fov_video"), ["left", "top", "right", "bottom"], where)
    inner = element.find("intrinsic")
    lengths = attributes(inner, ["focalLengthU", "focalLengthV", "centerPointU", "centerPointV", "skew"], where)
    fx, fy, cx, cy, skew = lengths / SUBPIXELS
    bent = ["radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2"]
    distortion = attributes(inner, [*bent, "radialDistortion3"], where)
    K = np.array([[fx, skew, cx - left], [0.0, fy, cy - top], [0.0, 0.0, 1.0]])
    sides = whole(np.array([right - left + 1, bottom - top + 1]), where)
    return Lens(*sides, K, "plumb_bob", tuple(distortion.tolist()))


def _pose(element: "Element", where: str) -> Pose:
    if any(element.attrib.get(key, "").strip().lower() in NO for key in ("calibrated", "active")):
        raise DiorError(f"{where}: QTM did not calibrate this camera")
    _check_unit(element, where)
    transform = element.find("transform")
    turn = attributes(transform, [f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)], where).reshape(3, 3)
    cRw = FLIP @ rotation(turn, where)
    centre = attributes(transform, ["x", "y", "z"], where)
    return Pose(pose(cRw, -cRw @ centre), "cTw", "mm")
