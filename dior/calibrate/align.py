"""Place the long-range camera: tape and look-at, corrected by eye with three nudges.

INPUTS   camera YAML (`locate: align`, `tape`, `nudge`), intrinsics
OUTPUTS  cameras (one row with wTc)

`wRc = Rz(azimuth + da) Rx(elevation + de)` with the look-at angles of the un-nudged centre, then the centre moves
`distance_m` away from the target, horizontally; the aim is not recomputed (design, section 2; the paper's long-range
refinement). World in metres, Z up. In the picture, by about f times the angle: a positive azimuth turns the camera to
the left and moves the labels right, a positive elevation turns it up and moves them down, a positive distance shrinks
them.
"""

import numpy as np

from dior import tables
from dior.calibrate.place import camera_settings, check_above_floor, look_at_pose, unplaced
from dior.camera import pose
from dior.errors import DiorError
from dior.geometry import look_at_angles, rotation_x, rotation_z


def aligned_pose(where, tape, nudge):
    """wTc (4, 4) from the sections `tape` and `nudge` of a camera's YAML (degrees and metres).

    Raises DiorError for a camera straight above its target, which has no horizontal direction to move in.
    """
    look_at_pose(where, tape)
    centre, target = (np.array(tape.get(key, (0, 0, 0)), float) for key in ("position_m", "target_m"))
    azimuth, elevation = look_at_angles(centre, target)
    azimuth += np.radians(nudge.get("azimuth_deg", 0.0))
    elevation += np.radians(nudge.get("elevation_deg", 0.0))
    away = (centre - target) * (1, 1, 0)
    distance = nudge.get("distance_m", 0.0)
    if distance and np.linalg.norm(away) < 1e-3:
        raise DiorError(f"{where}: nudge.distance_m has no direction for a camera straight above its target")
    if distance <= -np.linalg.norm(away) and distance:
        raise DiorError(f"{where}: nudge.distance_m {distance:g} moves the camera past its target")
    moved = centre + (distance * away / np.linalg.norm(away) if distance else 0.0)
    check_above_floor(where, moved, "tape.position_m is x, y, z with Z up from the floor")
    return pose(rotation_z(azimuth) @ rotation_x(elevation), moved)


def run(*, session, camera, camera_file, intrinsics, out):
    """Write the aligned camera."""
    settings = camera_settings(camera_file, needs="align")
    wTc = aligned_pose(camera_file, settings["tape"], settings.get("nudge", {}))
    tables.write_cameras(out, [unplaced(intrinsics, camera).at(wTc, settings["locate"])], session)
