"""Intrinsics of one camera of a session, checked against the pictures it recorded.

INPUTS   CameraInfo of the bags in the `frames` table; or a calibration file (`dior.calibrate.readers.files`); or
         pictures of a chessboard or ChArUco board (board.py)
OUTPUTS  `cameras` table of one row: pixels, distortion as k1 k2 p1 p2 k3 (k4 k5 k6), pose null; findings
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from dior.arrays import AnyPath, Table
from dior.calibrate.lens import of_pictures, realsense
from dior.calibrate.readers import files, given
from dior.errors import DiorError, nearest
from dior.geometry import camera_tables
from dior.geometry.camera import MODELS, Camera, Intrinsics, check_picture_size
from dior.ingest import bags as rosbag
from dior.ingest.videos import is_stored, is_stream
from dior.tables import tables

# chosen: a board and the maker differ by 0.1 to 0.6 % in fx (`lens.board`); files tell no better
MAKERS_SIGMA = 0.003
BAG_MODELS = ("plumb_bob", "rational_polynomial")
COEFFICIENTS = (4, 5, 8)  # of distortion, as OpenCV's models have them
# chosen: 1/64 of a lens whose largest coefficient is 0.19, and less than any lens of which somebody bothers to tell
TINY = 0.003
# how pictures are made smaller or larger; twice as large the centre is outside, which `readers.given` refuses
RESIZED = (1 / 4, 1 / 3, 1 / 2, 2 / 3, 4 / 3, 3 / 2)
# chosen: of half a side, more than a lens is off its sensor
OFF_CENTRE = 0.06


def run(
    *,
    session: str,
    camera: str,
    role: str,
    topic: str = "",
    source: str,
    name: str = "",
    board: dict[str, Any],
    distortion_model: str = "",
    info_topic: str = "",
    sigma: str = "",
    frames: Path,
    sequence: str,
    data_root: Path,
    out: Path,
    findings: Path,
) -> None:
    """Write the intrinsics of `camera`, from `source`: "camera_info", "board" or a file's path below `data_root`.

    `name` is the camera in the file, `board` the section of the camera's YAML ({"chessboard": ...} or
    {"charuco": ...}); `distortion_model` is what the camera's YAML says, "" if nothing; `info_topic`: topic of the
    CameraInfo where it is not the one beside.

    `sigma`: 1 sigma of focal length and centre over the focal length, where the camera's YAML says it.
    """
    where = f"session {session}, {camera}"
    pictures = tables.of_camera(tables.read(frames, "frames", ["camera", "bag", "topic", "height", "width"]), camera)
    if not len(pictures["camera"]):
        raise DiorError(f"{where}: {frames} has no frame of {camera}; is the camera in session.yaml and in the bags?")
    if distortion_model and distortion_model not in MODELS:
        raise DiorError(
            f"{where}: distortion_model '{distortion_model}' is not one of {', '.join(MODELS)}"
            f"{nearest(distortion_model, MODELS)}"
        )
    found: list[tuple[str, str, str]] = []
    if source == "board":
        from dior.calibrate.lens.board import from_board

        [(kind, settings)] = board.items()
        lens, found = from_board(kind, settings, data_root, where)
    elif source == "camera_info":
        bags = [Path(data_root) / bag for bag in tables.ordered_unique(pictures["bag"])]
        yaml = f"sessions/{session}/{camera}.yaml"
        if is_stream(pictures["topic"][0]):
            raise DiorError(
                f"{where}: 'intrinsics' is camera_info, which {pictures['bag'][0]} has not, as it is no bag; give a "
                f"file or a board in {yaml}"
            )
        info = rosbag.read_camera_info(bags, topic, info_topic)
        size = int(pictures["width"][0]), int(pictures["height"][0])
        lens, found = from_camera_info(info, topic, distortion_model, yaml, size), of_pictures.findings(info, topic)
    else:
        lens = from_file(Path(data_root) / source, name, distortion_model)
        found = _tiny_distortion(lens, f"{source} [{name}]") + _of_other_size(lens, f"{source} [{name}]")
    if source != "camera_info" and of_pictures.is_rectified(topic) and any(lens.distortion):
        text = f"the pictures on {topic} are rectified, but the lens has distortion; is it that of the raw pictures?"
        found.append(("warning", "rectified_with_distortion", text))
    if sigma or not lens.sigma:
        lens = replace(lens, sigma=float(sigma) if sigma else MAKERS_SIGMA)
    check_size(lens, pictures, f"{where} ({sequence})", f"sessions/{session}/{camera}.yaml")
    camera_tables.write_cameras(out, [Camera(camera, lens, role=role)], session=session)
    tables.write_findings(findings, [(f"{session}/{camera}", *finding) for finding in found])


def check_size(lens: Intrinsics, pictures: Table, where: str, yaml: str) -> None:
    """Refuse pictures of another size, and say so where they are those of a video that is turned.

    `pictures`: width and height (px), topic and bag of at least one.
    """
    width, height = int(pictures["width"][0]), int(pictures["height"][0])
    if is_stream(pictures["topic"][0]) and (lens.width, lens.height) == (height, width) != (width, height):
        frame, other = ("stored", "shown") if is_stored(pictures["topic"][0]) else ("shown", "stored")
        raise DiorError(
            f"{where}: the pictures of {pictures['bag'][0]} are {width}x{height} as {frame} and the intrinsics are for "
            f"{lens.width}x{lens.height}: if they are those of the {other} frame, as detections and marks then have to "
            f"be, write `video: {{frame: {other}}}` into {yaml}"
        )
    check_picture_size(lens, width, height, where)


def from_camera_info(
    info: rosbag.CameraInfo, topic: str, distortion_model: str, yaml: str, size: tuple[int, int]
) -> Intrinsics:
    """Intrinsics from a `bags.CameraInfo` of pictures of `size` (width, height) px.

    `distortion_model` overrides the bag's word, `yaml` is where it is given. Raises DiorError for an uncalibrated
    camera, another lens model, a RealSense colour topic whose model only a person can know, and what
    `of_pictures.lens_of` refuses.
    """
    rectified = of_pictures.is_rectified(topic)
    if not rectified and not any(info.K):
        raise DiorError(
            f"{info.where}: K is all zero, so the camera is not calibrated; give `intrinsics: {{file, name}}` in {yaml}"
        )
    own, refused = realsense.said_by_librealsense(info.model, info.D)
    if not rectified and refused:
        raise DiorError(f"{info.where}: distortion_model {refused}; give `intrinsics: {{file, name}}` in {yaml}")
    if not rectified and not own and info.model not in BAG_MODELS:
        raise DiorError(
            f"{info.where}: distortion_model '{info.model}' is not one of {', '.join(BAG_MODELS)}; "
            f"give `intrinsics: {{file, name}}` in {yaml}"
        )
    if not rectified and len(info.D) not in COEFFICIENTS:
        raise DiorError(f"{info.where}: D has {len(info.D)} numbers, not 4, 5 or 8")
    (width, height), K, D = of_pictures.lens_of(info, topic, size)
    if realsense.is_colour(topic) and any(D) and not distortion_model and not own:
        raise DiorError(
            f"{info.where}: a bag cannot tell a RealSense's lens model, because realsense-ros writes {info.model} even "
            "where the coefficients are inverse_brown_conrady (3 px off at a normalised radius of 0.4, 12 px at 0.8); "
            f"add `distortion_model:` with one of {', '.join(MODELS)} to {yaml} "
            "(`rs-enumerate-devices -c` shows which the camera has)"
        )
    model = "plumb_bob" if rectified else distortion_model or own or info.model
    return given.checked(width, height, K, model, D, info.where)


def from_file(path: AnyPath, name: str, distortion_model: str = "") -> Intrinsics:
    """Intrinsics of the camera `name` in a calibration file; `distortion_model` is what the camera's YAML says."""
    return given.intrinsics(files.camera(path, name), distortion_model, f"{path} [{name}]")


def _tiny_distortion(lens: Intrinsics, where: str) -> list[tuple[str, str, str]]:
    """A hint where the coefficients may be 1/64 of the lens's."""
    largest = max(map(abs, lens.distortion))
    if not 0 < largest < TINY:
        return []
    text = (
        f"{where}: all distortion coefficients are below {TINY:g} (the largest is {largest:.2g}). Pose2Sim's converter "
        "from Qualisys divides them by 64; if that wrote the file, multiply them by 64, or calibrate with a chessboard"
    )
    return [("info", "tiny_distortion", text)]


def _of_other_size(lens: Intrinsics, where: str) -> list[tuple[str, str, str]]:
    """A hint where the principal point lies as that of smaller or larger pictures does."""
    across, down = 2 * lens.cx / lens.width, 2 * lens.cy / lens.height
    scale = next((one for one in RESIZED if max(abs(across - one), abs(down - one)) < OFF_CENTRE), 0.0)
    if not scale:
        return []
    text = (
        f"{where}: the principal point {lens.cx:.0f}, {lens.cy:.0f} is far from the middle of pictures of {lens.width} "
        f"x {lens.height} px, and near that of {scale * lens.width:.0f} x {scale * lens.height:.0f}; is K that of such "
        f"pictures? Then multiply its first two rows by {1 / scale:.4g}"
    )
    return [("warning", "lens_of_other_size", text)]
