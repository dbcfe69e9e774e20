"""Somebody else's calibration, in whatever format: recognised by what is in the file, never by its name.

INPUTS   a file
OUTPUTS  its cameras (`given.GivenCamera`), or the one that a camera's YAML names
`dior formats calibrations` says what each reads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dior.arrays import AnyPath
from dior.calibrate.readers import kalibr, opencap, opencv_storage, qualisys, ros_camera_info, toml_cameras, vicon
from dior.calibrate.readers.given import GivenCamera
from dior.calibrate.readers.source import Source
from dior.errors import DiorError, nearest
from dior.formats import CalibrationFormat


@dataclass(frozen=True)
class Reader:
    """`recognises(source)`: whether a file is its own; `cameras(source)` gives what is in it; `tool`: its name in
    messages; `described`: for people."""

    tool: str
    recognises: Callable[[Source], bool]
    cameras: Callable[[Source], list[GivenCamera]]
    described: tuple[CalibrationFormat, ...]


# asked in this order: a pickle is no text, and TOML is no YAML
READERS = {
    "opencap": Reader("OpenCap", opencap.recognises, opencap.cameras, opencap.DESCRIPTIONS),
    "qualisys": Reader("Qualisys", qualisys.recognises, qualisys.cameras, qualisys.DESCRIPTIONS),
    "vicon": Reader("Vicon", vicon.recognises, vicon.cameras, vicon.DESCRIPTIONS),
    "toml": Reader(
        "Pose2Sim, anipose, FreeMoCap and caliscope TOML",
        toml_cameras.recognises,
        toml_cameras.cameras,
        toml_cameras.DESCRIPTIONS,
    ),
    "kalibr": Reader("Kalibr", kalibr.recognises, kalibr.cameras, kalibr.DESCRIPTIONS),
    "ros_info": Reader("ROS", ros_camera_info.recognises, ros_camera_info.cameras, ros_camera_info.DESCRIPTIONS),
    "opencv": Reader("OpenCV", opencv_storage.recognises, opencv_storage.cameras, opencv_storage.DESCRIPTIONS),
}


def camera(path: AnyPath, name: str) -> GivenCamera:
    """The camera `name` of a file.

    Raises DiorError for a missing or broken file, an unknown name (with the nearest) and a name of several cameras.
    """
    found = cameras(path)
    matching = [one for one in found if name in (one.name, *one.also)]
    if not matching:
        known = [name for one in found for name in (one.name, *one.also)]
        there = ", ".join(_shown(one.name) for one in found) or "none"
        raise DiorError(f"{path}: no camera '{name}'{nearest(name, known)}; it has {there}")
    if len(matching) > 1:
        there = ", ".join(_shown(one.name) for one in matching)
        raise DiorError(f"{path}: '{name}' is the name of {len(matching)} cameras: {there}")
    return matching[0]


def _shown(name: str) -> str:
    """A name, in quotes where blanks at its ends would not be seen."""
    return name if name == name.strip() else f"'{name}'"


def cameras(path: AnyPath) -> list[GivenCamera]:
    """The cameras of a file. Raises DiorError for a missing or broken one, and for one of another kind."""
    if not Path(path).exists():
        raise DiorError(f"{path}: there is no such file; check the camera's YAML and data_root")
    source = Source(path)
    reader = next((reader for reader in READERS.values() if reader.recognises(source)), None)
    if reader is None:
        what = (
            "no calibration" if source.xml is None else f"an XML file with <{source.xml.tag:.40}>, and no calibration"
        )
        known = ", ".join(reader.tool for reader in READERS.values())
        raise DiorError(f"{path}: {what} that is read ({known}); `dior formats calibrations` says what they look like")
    return reader.cameras(source)
