"""Place a camera before any person is looked at: by tape and look-at, an AprilTag, or somebody else's calibration.

INPUTS   camera YAML (`locate: tape` with `tape`, `locate: reference` with `reference`, or `locate: apriltag` with the
         `tag` of session.yaml and the pictures of one sequence), intrinsics
OUTPUTS  cameras (one row with wTc), `marks` (where the corners of the tag were seen, else empty), findings

World in metres, Z up, floor at Z = 0. A reference file is a TOML with a section per camera that holds `rotation`
(Rodrigues vector in radians or 3x3) and `translation` (m), as Pose2Sim and caliscope write them.
"""

from pathlib import Path

import numpy as np

from dior import checked, tables
from dior.calibrate import toml_cameras
from dior.camera import inverse_pose, pose
from dior.errors import DiorError, nearest
from dior.geometry import look_at

CONVENTIONS = ("cTw", "wTc")


def camera_settings(path, needs=""):
    """The content of a camera's YAML, checked against its schema; `needs` names the only `locate` that will do.

    Raises DiorError for what the schema refuses and for a section that the way of locating needs and is not there.
    """
    settings = checked.check(checked.read_yaml(path), "camera", path)
    how = settings["locate"]
    if needs and how not in needs.split("|"):
        raise DiorError(f"{path}: `locate` is {how}, this step is for {needs.replace('|', ' or ')}")
    section = {"tape": "tape", "align": "tape", "reference": "reference"}.get(how)
    if section and section not in settings:
        raise DiorError(f"{path}: `locate: {how}` needs the section `{section}`")
    return settings


def unplaced(path, camera):
    """The `Camera` of that name in an intrinsics table. Raises DiorError where it is not there."""
    cameras = tables.read_cameras(path)
    if camera not in cameras:
        raise DiorError(f"{path}: no camera '{camera}'{nearest(camera, cameras)}")
    return cameras[camera]


def check_above_floor(where, centre, hint):
    """Refuse a camera whose centre (3,) m is below the floor."""
    if not centre[2] > 0:
        raise DiorError(f"{where}: the camera is {-centre[2]:.2f} m below the floor; {hint}")


def look_at_pose(where, tape):
    """wTc (4, 4) of an upright camera at the tape's position that looks at its target (default: the origin)."""
    centre, target = (np.array(tape.get(key, (0, 0, 0)), float) for key in ("position_m", "target_m"))
    if np.linalg.norm(centre - target) < 1e-3:
        raise DiorError(f"{where}: tape.position_m and tape.target_m are the same point")
    check_above_floor(where, centre, "tape.position_m is x, y, z with Z up from the floor")
    return pose(look_at(centre, target), centre)


def reference_pose(path, name, convention="cTw"):
    """wTc (4, 4) of the camera `name` in a TOML calibration.

    `name` is the section's key, its last part or its entry `name`. Raises DiorError for an unknown name (with the
    nearest), a missing or broken rotation or translation.
    """
    if convention not in CONVENTIONS:
        raise DiorError(f"{path}: convention '{convention}' is not one of {', '.join(CONVENTIONS)}")
    section = toml_cameras.section(path, name, ("rotation", "translation"))
    where = f"{path} [{name}]"
    translation = _numbers(where, section, "translation")
    if translation.shape != (3,):
        raise DiorError(f"{where}: translation must have 3 numbers, it has the shape {translation.shape}")
    T = pose(_rotation(where, _numbers(where, section, "rotation")), translation)
    return inverse_pose(T) if convention == "cTw" else T


def _numbers(where, section, key):
    if key not in section:
        raise DiorError(f"{where}: `{key}` is missing")
    try:
        values = np.array(section[key], float)
    except (ValueError, TypeError):
        raise DiorError(f"{where}: `{key}` must be numbers") from None
    if not np.isfinite(values).all():
        raise DiorError(f"{where}: `{key}` has a value that is not finite")
    return values


def _rotation(where, values):
    from scipy.spatial.transform import Rotation

    if values.shape == (3,):
        return Rotation.from_rotvec(values).as_matrix()
    if values.shape != (3, 3):
        raise DiorError(f"{where}: rotation must be a Rodrigues vector or 3x3, it has the shape {values.shape}")
    if np.abs(values @ values.T - np.eye(3)).max() > 1e-3 or np.linalg.det(values) < 0:
        raise DiorError(f"{where}: rotation is no rotation matrix (its rows must be orthonormal and right-handed)")
    return Rotation.from_matrix(values).as_matrix()


def run(*, session, camera, camera_file, tag, intrinsics, frames, data_root, out, out_marks, findings):
    """Write the placed camera, its marks and findings.

    `reference.file` and the bags of `frames` are relative to `data_root`. `tag` and `frames`, the table of the sequence
    that shows it, are needed for `locate: apriltag` only.
    """
    settings = camera_settings(camera_file, needs="tape|apriltag|reference")
    found, marks = [], {}
    if settings["locate"] == "apriltag":
        from dior.calibrate.apriltag import place

        where = f"session {session}, {camera}"
        wTc, found, marks = place(unplaced(intrinsics, camera), tag, frames, data_root, settings.get("tape"), where)
    elif settings["locate"] == "tape":
        wTc = look_at_pose(camera_file, settings["tape"])
    else:
        reference = settings["reference"]
        wTc = reference_pose(Path(data_root) / reference["file"], reference["name"], reference.get("convention", "cTw"))
        check_above_floor(camera_file, wTc[:3, 3], "does reference.convention match the file?")
    tables.write_cameras(out, [unplaced(intrinsics, camera).at(wTc, settings["locate"])], session)
    count = len(marks.get("joint", ()))
    tables.write(out_marks, "marks", {"session": [session] * count, "camera": [camera] * count, **marks})
    tables.write_findings(findings, [(f"{session}/{camera}", *finding) for finding in found])
