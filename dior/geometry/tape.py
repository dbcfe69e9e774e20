"""The pose of a camera by what a tape measured: where it stands and what it looks at. World in metres, Z up."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.errors import DiorError
from dior.geometry.camera import pose
from dior.geometry.multiview import look_at, rotation_z


def check_above_floor(where: AnyPath, centre: Floats, hint: str) -> None:
    """Refuse a camera whose centre (3,) m is below the floor."""
    if not centre[2] > 0:
        raise DiorError(f"{where}: the camera is {abs(centre[2]):.2f} m below the floor; {hint}")


def look_at_pose(where: AnyPath, tape: Mapping[str, Any]) -> Floats:
    """wTc (4, 4) of a camera at the tape's position that looks at its target (default: the origin).

    It is upright, or turned about its axis by `roll_deg`, clockwise as seen from behind it.
    """
    centre, target = (np.array(tape.get(key, (0, 0, 0)), float) for key in ("position_m", "target_m"))
    if np.linalg.norm(centre - target) < 1e-3:
        raise DiorError(f"{where}: tape.position_m and tape.target_m are the same point")
    check_above_floor(where, centre, "tape.position_m is x, y, z with Z up from the floor")
    return pose(look_at(centre, target) @ rotation_z(np.radians(tape.get("roll_deg", 0.0))), centre)
