"""Place a camera before any person is looked at: by tape and look-at, an AprilTag, or somebody else's calibration.

INPUTS   camera YAML (`locate: tape` with `tape`, `locate: reference` with `reference`, or `locate: apriltag` with the
         `tag` of session.yaml and the pictures of one sequence), intrinsics
OUTPUTS  cameras (one row with wTc), `marks` (where the corners of the tag were seen, else empty), findings

World in metres, Z up, floor at Z = 0. A reference file is a TOML with a section per camera that holds `rotation`
(Rodrigues vector in radians or 3x3) and `translation` (`reference.units`), as Pose2Sim and caliscope write them.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.calibrate.lens import toml_cameras
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import inverse_pose, pose
from dior.geometry.camera_tables import unplaced
from dior.geometry.tape import look_at_pose
from dior.project.camera_file import camera_settings
from dior.tables import tables

CONVENTIONS = ("cTw", "wTc")


def reference_pose(path: AnyPath, name: str, convention: str = "cTw", units: str = "m") -> Floats:
    """wTc (4, 4) of the camera `name` in a TOML calibration; `units` of its translation.

    `name` is the section's key, its last part or its entry `name`. Raises DiorError for an unknown name (with the
    nearest), a missing or broken rotation or translation.
    """
    if convention not in CONVENTIONS:
        raise DiorError(f"{path}: convention '{convention}' is not one of {', '.join(CONVENTIONS)}")
    section = toml_cameras.section(path, name, ("rotation", "translation"))
    where = f"{path} [{name}]"
    translation = toml_cameras.numbers(section, "translation", [(3,)], where)
    rotation = _rotation(where, toml_cameras.numbers(section, "rotation", [(3,), (3, 3)], where))
    T = pose(rotation, toml_cameras.METRES[units] * translation)
    return inverse_pose(T) if convention == "cTw" else T


def _rotation(where: str, values: Floats) -> Floats:
    from scipy.spatial.transform import Rotation

    if values.shape == (3,):
        if (turn := float(np.linalg.norm(values))) > 2 * np.pi * 1.01:
            raise DiorError(
                f"{where}: rotation is a Rodrigues vector of {turn:.0f} rad, more than a whole turn; if it is in "
                "degrees, multiply it by pi / 180"
            )
        return Rotation.from_rotvec(values).as_matrix()
    if np.abs(values @ values.T - np.eye(3)).max() > 1e-3:
        raise DiorError(f"{where}: rotation is no rotation matrix (its rows must be orthonormal and right-handed)")
    if np.linalg.det(values) < 0:
        raise DiorError(
            f"{where}: rotation is no rotation matrix but mirrors, so the calibration is left-handed; export it with a "
            "right-handed world and OpenCV's axes (x right, y down, z forward)"
        )
    return Rotation.from_matrix(values).as_matrix()


def run(
    *,
    session: str,
    camera: str,
    camera_file: Path,
    tag: dict[str, Any],
    intrinsics: Path,
    frames: Path | None,
    data_root: Path,
    out: Path,
    out_marks: Path,
    findings: Path,
) -> None:
    """Write the placed camera, its marks and findings.

    `reference.file` and the bags of `frames` are relative to `data_root`. `tag` and `frames`, the table of the sequence
    that shows it, are needed for `locate: apriltag` only.
    """
    settings = camera_settings(camera_file, needs="tape|apriltag|reference")
    found: list[tuple[str, str, str]] = []
    marks: dict[str, Any] = {}
    if settings["locate"] == "apriltag":
        from dior.calibrate.marks.apriltag import place

        where = f"session {session}, {camera}"
        if frames is None:
            raise DiorError(f"{where}: `locate: apriltag` needs the frames of a sequence that shows the tag")
        wTc, found, marks = place(unplaced(intrinsics, camera), tag, frames, data_root, settings.get("tape"), where)
    elif settings["locate"] == "tape":
        wTc = look_at_pose(camera_file, settings["tape"])
    else:
        reference = settings["reference"]
        path = Path(data_root) / reference["file"]
        # whether it is above a floor is asked where its world is known: in the step reference
        wTc = reference_pose(path, reference["name"], reference["convention"], reference["units"])
    camera_tables.write_cameras(out, [unplaced(intrinsics, camera).at(wTc, settings["locate"])], session)
    count = len(marks.get("joint", ()))
    tables.write(out_marks, "marks", {"session": [session] * count, "camera": [camera] * count, **marks})
    tables.write_findings(findings, [(f"{session}/{camera}", *finding) for finding in found])
