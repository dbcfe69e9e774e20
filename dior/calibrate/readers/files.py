"""Somebody else's calibration, in whatever format: recognised by what is in the file, never by its name.

INPUTS   a file
OUTPUTS  its cameras (`given.GivenCamera`), or the one that a camera's YAML names
docs/calibrations.md has the formats.
"""

import re
from pathlib import Path

from dior.arrays import AnyPath
from dior.calibrate.readers import (
    kalibr,
    opencap,
    opencv_storage,
    qualisys,
    ros_camera_info,
    toml_cameras,
    vicon,
    xml_text,
)
from dior.calibrate.readers.given import GivenCamera
from dior.errors import DiorError, nearest
from dior.project.plain_text import bytes_of, text_of
from dior.project.yaml_file import yaml_of

# chosen: a camera has some hundred bytes; Vicon's, which have their thresholds besides, some ten thousand
MOST_BYTES, MOST_BYTES_XML = 1 << 20, 1 << 22
KINDS = "Pose2Sim, anipose, FreeMoCap or caliscope TOML, Kalibr, OpenCV, ROS, Qualisys, Vicon or OpenCap"


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
    content = bytes_of(path, path, MOST_BYTES_XML)
    stem = Path(path).stem
    if opencap.recognises(content):
        return opencap.cameras(content, path, tuple(dict.fromkeys((stem, Path(path).absolute().parent.name))))
    is_xml = content.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
    text = text_of(path, path, MOST_BYTES_XML if is_xml else MOST_BYTES)
    if is_xml:
        return _of_xml(text, path, stem)
    if toml_cameras.recognises(_first_line(text)):
        return toml_cameras.cameras(text, path)
    return _of_yaml(text, path, stem)


def _first_line(text: str) -> str:
    """The first line that is neither empty nor a comment, from its first letter."""
    found = re.search(r"^[ \t]*([^\s#].*)$", text, re.MULTILINE)
    return found[1] if found else ""


def _of_xml(text: str, path: AnyPath, stem: str) -> list[GivenCamera]:
    root = xml_text.root_of(text, path)
    for reader in (qualisys, vicon):
        if reader.recognises(root):
            return reader.cameras(root, path)
    if root.tag == "opencv_storage":
        content = opencv_storage.of_xml(root)
        if opencv_storage.recognises(content):
            return opencv_storage.cameras(content, path, stem)
    raise DiorError(f"{path}: an XML file with <{root.tag:.40}> that has no camera; is it {KINDS}?")


def _of_yaml(text: str, path: AnyPath, stem: str) -> list[GivenCamera]:
    content = yaml_of(opencv_storage.plain_yaml(text), path)
    if isinstance(content, dict):
        if kalibr.recognises(content):
            return kalibr.cameras(content, path)
        # OpenCV marks its matrices, by a tag or in JSON by their kind; ROS does not
        of_opencv = "opencv-matrix" in text
        if ros_camera_info.recognises(content) and not of_opencv:
            return ros_camera_info.cameras(content, path, stem)
        if opencv_storage.recognises(content):
            if of_opencv:
                return opencv_storage.cameras(content, path, stem)
            raise DiorError(
                f"{path}: has the names of OpenCV's calibrations and no matrix as its FileStorage writes it "
                "(`!!opencv-matrix` with rows, cols, dt and data); write it by cv2.FileStorage"
            )
    raise DiorError(f"{path}: no calibration that is read ({KINDS}); docs/calibrations.md says what they look like")
