"""Cameras in the XML that Vicon's programs write (`.xcp`).

INPUTS   a file
OUTPUTS  a `GivenCamera` for each camera, called by its DEVICEID, or NAME
Sources: Vicon's page on XCP files (CaraPost reference: the quaternion's last value is the real one), and five public
readers that agree on the rest (Pose2Sim 0.10.49 among them): the rotation is that from the world to the camera, with
OpenCV's axes; POSITION is the camera's place, mm; focal length and centre are px. Z is up in Vicon's worlds.

A lens with VICON_RADIAL or VICON_RADIAL2 is refused: it is a polynomial of the distance from a centre in px, but the
readers contradict each other on whether it leads from recorded to ideal pixels or back, and no text of Vicon's that
was at hand says which. The pose is read all the same; take the lens from a board.
"""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dior.arrays import AnyPath
from dior.calibrate.readers.given import GivenCamera, Lens, Pose, part
from dior.calibrate.readers.given import size as whole
from dior.calibrate.readers.source import Source
from dior.calibrate.readers.xml_text import attributes, listed
from dior.errors import DiorError
from dior.formats import CalibrationFormat
from dior.geometry.camera import pose
from dior.geometry.rotation import from_quaternion

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# chosen: rounding to six digits
UNIT_LENGTH = 1e-4
DESCRIPTIONS = (
    CalibrationFormat(
        key="vicon",
        file="Vicon `.xcp`",
        name="`DEVICEID`, or `NAME`",
        convention="its own: the quaternion's real part last, the camera's place",
        unit="mm",
        world="Z up",
        lens="only without VICON_RADIAL(2), which is refused",
        checked="one KeyFrame, a quaternion of length 1, square pixels",
        sample="written here; pose as Pose2Sim 0.10.49 reads it",
    ),
)


def recognises(source: Source) -> bool:
    """Whether a file is one of Vicon's calibrations."""
    return bool(source.elements("Cameras", "Camera"))


def cameras(source: Source) -> list[GivenCamera]:
    """The cameras of a file."""
    return [
        _camera(element, number, source.path) for number, element in enumerate(source.elements("Cameras", "Camera"), 1)
    ]


def _camera(element: "Element", number: int, path: AnyPath) -> GivenCamera:
    name = element.attrib.get("DEVICEID") or str(number)
    where = f"{path} [{name}]"
    also = tuple({element.attrib.get("NAME", "")} - {"", name})
    return GivenCamera(name, part(partial(_lens, element, where)), part(partial(_pose, element, where)), also)


def _frame(element: "Element", where: str) -> "Element":
    """The one KeyFrame of a camera."""
    frames = element.findall("KeyFrames/KeyFrame")
    if len(frames) != 1:
        reason = "was not calibrated" if not frames else f"has {len(frames)} KeyFrames, so that it moves"
        raise DiorError(f"{where}: the camera {reason}")
    return frames[0]


def _is_zero(word: str) -> bool:
    try:
        return float(word) == 0
    except ValueError:
        return False


def _lens(element: "Element", where: str) -> Lens:
    frame = _frame(element, where)
    for key in ("VICON_RADIAL", "VICON_RADIAL2"):
        words = frame.attrib.get(key, "").split()
        # of the newer one the model's name and the centre come first
        coefficients = words[3:] if key.endswith("2") else words
        if not all(map(_is_zero, coefficients)):
            raise DiorError(
                f"{where}: a lens with Vicon's {key} is not understood, as nothing that was at hand says which way it "
                "leads; take the intrinsics from a chessboard or ChArUco board (the pose is read)"
            )
    ratio, skew = attributes(element, ["PIXEL_ASPECT_RATIO", "SKEW"], where)
    if ratio != 1 or skew:
        raise DiorError(f"{where}: pixels that are not square (PIXEL_ASPECT_RATIO {ratio:g}, SKEW {skew:g})")
    (focal,) = attributes(frame, ["FOCAL_LENGTH"], where)
    cx, cy = listed(frame, "PRINCIPAL_POINT", 2, where)
    K = np.array([[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]])
    return Lens(*whole(listed(element, "SENSOR_SIZE", 2, where), where), K, "plumb_bob", ())


def _pose(element: "Element", where: str) -> Pose:
    frame = _frame(element, where)
    quaternion = listed(frame, "ORIENTATION", 4, where)
    if abs(np.linalg.norm(quaternion) - 1) > UNIT_LENGTH:
        raise DiorError(f"{where}: ORIENTATION is no quaternion of length 1")
    cRw = from_quaternion(quaternion)
    return Pose(pose(cRw, -cRw @ listed(frame, "POSITION", 3, where)), "cTw", "mm")
