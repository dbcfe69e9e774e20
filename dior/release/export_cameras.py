"""`dior export-cameras`: the placed cameras of a session as other tools read them.

INPUTS   a project whose session has been placed (results/)
OUTPUTS  a new folder with pose2sim.toml, kalibr.yaml and opencv/<camera>.yml
World of the first and the last: the session's, metres, Z up, world to camera. A camchain has no world: camera 0 is its
origin. `dior.calibrate.readers` reads them back. A lens that a format has no words for is refused by name: Pose2Sim's
has k1 k2 p1 p2 k3, Kalibr's radtan k1 k2 p1 p2, OpenCV's k6 besides; none has inverse_brown_conrady.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dior.arrays import Floats
from dior.errors import DiorError, nearest
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, inverse_pose
from dior.geometry.rotation import rotvec
from dior.project import project as projects
from dior.project.run import CONFIG
from dior.tables.files import folder_written_whole, write_text

# how many of the coefficients k1 k2 p1 p2 k3 k4 k5 k6 a format has
COEFFICIENTS = {"pose2sim": 5, "kalibr": 4, "opencv": 8}


def run(project: Path, *, session: str, out: Path, formats: list[str] | None = None) -> None:
    """Write the cameras of a session in the formats of other tools, and print what was written.

    `project`: folder that holds config/; `session`: whose cameras; `out`: folder to write, which must not be there yet;
    `formats`: of pose2sim, kalibr and opencv; all that have words for every lens if none is named.
    Raises DiorError for a session that is not there or not placed, and for a lens that a named format cannot say.
    """
    for name in formats or ():
        if name not in COEFFICIENTS:
            raise DiorError(f"there is no format '{name}'{nearest(name, COEFFICIENTS)}; there are {_listed()}")
    if os.path.lexists(out):
        raise DiorError(f"{out}: is there already; name a folder that is not")
    cameras, topics = placed(project, session)
    refused = {name: problem for name in COEFFICIENTS if (problem := unspoken(name, cameras))}
    for name in formats or ():
        if name in refused:
            raise DiorError(refused[name])
    chosen = [name for name in COEFFICIENTS if name in (formats or COEFFICIENTS) and name not in refused]
    if not chosen:
        raise DiorError("; ".join(refused.values()))
    with folder_written_whole(out) as folder:
        for name in chosen:
            for path, text in texts(name, cameras, topics).items():
                (folder / path).parent.mkdir(exist_ok=True)
                write_text(folder / path, text)
    for name in chosen:
        print(f"{out}: {', '.join(texts(name, cameras, topics))}")
    for name in () if formats else refused:
        print(f"not written: {refused[name]}")


def _listed() -> str:
    return ", ".join(COEFFICIENTS)


def placed(root: Path, session: str) -> tuple[list[Camera], dict[str, str]]:
    """The cameras of a session of the project in `root` with their final poses, and their topics by name."""
    if not (root / CONFIG).is_file():
        raise DiorError(f"{root}: there is no {CONFIG} in it; name the project's folder")
    found = projects.load(root)
    if session not in found.sessions:
        known = f"{nearest(session, found.sessions)}; there are {', '.join(found.sessions)}"
        raise DiorError(f"{root}: no session '{session}'{known}")
    settings = found.cameras(session)
    paths = {name: root / found.final_cameras(session, name) for name in settings}
    for name, path in paths.items():
        if not path.is_file():
            raise DiorError(f"{path}: is not there, so {name} has no pose yet; run the workflow first")
    tables = list(dict.fromkeys(paths.values()))
    cameras = camera_tables.read_placed(tables, settings, f"{root}, session {session}")
    return cameras, {name: camera["topic"] for name, camera in settings.items()}


def unspoken(name: str, cameras: Sequence[Camera]) -> str:
    """Why a format cannot say what these cameras are, "" where it can."""
    for camera in cameras:
        lens, has = camera.intrinsics, COEFFICIENTS[name]
        if lens.model == "inverse_brown_conrady" and any(lens.distortion):
            return f"{name}: has no words for the lens of {camera.name}, which is inverse_brown_conrady"
        if any(lens.distortion[has:]):
            coefficients = "k4, k5 and k6" if has == 5 else "more than k1 k2 p1 p2"
            return f"{name}: has no words for the lens of {camera.name}, which has {coefficients}"
        if name == "pose2sim" and camera.name == "metadata":
            return f"{name}: a camera cannot be called metadata there"
    return ""


def texts(name: str, cameras: Sequence[Camera], topics: Mapping[str, str]) -> dict[str, str]:
    """The files of a format by path."""
    if name == "pose2sim":
        return {"pose2sim.toml": pose2sim(cameras)}
    if name == "kalibr":
        return {"kalibr.yaml": kalibr(cameras, topics)}
    return {f"opencv/{camera.name}.yml": opencv(camera) for camera in cameras}


def pose2sim(cameras: Sequence[Camera]) -> str:
    """A TOML of Pose2Sim's: a section per camera, Rodrigues vector and translation from the world to it."""
    parts = []
    for camera in cameras:
        lens, cTw = camera.intrinsics, inverse_pose(camera.wTc)
        parts += [
            f"[{camera.name}]",
            f'name = "{camera.name}"',
            f"size = {_row([float(lens.width), float(lens.height)])}",
            f"matrix = [{', '.join(_row(row) for row in lens.K)}]",
            f"distortions = {_row(lens.distortion[: 5 if lens.distortion[4] else 4])}",
            f"rotation = {_row(rotvec(cTw[:3, :3]))}",
            f"translation = {_row(cTw[:3, 3])}",
            "fisheye = false\n",
        ]
    return "\n".join([*parts, "[metadata]", "adjusted = false", "error = 0.0\n"])


def kalibr(cameras: Sequence[Camera], topics: Mapping[str, str]) -> str:
    """A camchain: each camera's pose from the one before it."""
    lines = ["# written by dior; the first camera is the origin"]
    for number, camera in enumerate(cameras):
        lens = camera.intrinsics
        lines += [
            f"# {camera.name}",
            f"cam{number}:",
            "  camera_model: pinhole",
            f"  intrinsics: {_row([lens.fx, lens.fy, lens.cx, lens.cy])}",
            "  distortion_model: radtan",
            f"  distortion_coeffs: {_row(lens.distortion[:4])}",
            f"  resolution: [{lens.width}, {lens.height}]",
            f"  rostopic: {_quoted(topics.get(camera.name, ''))}",
        ]
        if number:
            step = inverse_pose(camera.wTc) @ cameras[number - 1].wTc
            lines += ["  T_cn_cnm1:", *(f"  - {_row(row)}" for row in step)]
    return "\n".join(lines) + "\n"


def opencv(camera: Camera) -> str:
    """A FileStorage as OpenCV's calibration sample writes it, with the pose beside it; OpenCV 3 to 5 read it."""
    lens, cTw = camera.intrinsics, inverse_pose(camera.wTc)
    coefficients = np.array([lens.distortion[: 8 if any(lens.distortion[5:]) else 5]])
    parts = ["%YAML:1.0", "---", f"image_width: {lens.width}", f"image_height: {lens.height}"]
    matrices = {"camera_matrix": lens.K, "distortion_coefficients": coefficients, "R": cTw[:3, :3], "T": cTw[:3, 3:]}
    parts += [_matrix(key, values) for key, values in matrices.items()]
    return "\n".join([*parts, "units: m\n"])


def _matrix(key: str, values: Floats) -> str:
    rows, columns = values.shape
    data = ", ".join(map(_number, values.ravel()))
    return f"{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]"


def _row(values: Sequence[float] | Floats) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """As short as it reads back the same; with a point, without which YAML takes 1e-05 for a text."""
    mantissa, exponent = (*repr(float(value)).split("e"), "")[:2]
    whole = mantissa if "." in mantissa else f"{mantissa}.0"
    return f"{whole}e{exponent}" if exponent else whole


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
