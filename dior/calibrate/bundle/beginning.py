"""What an adjustment cannot begin with: too few cameras or joints, two cameras in one place, one that nothing ties.

INPUTS   placed cameras, recorded pixels (V, N, 2)
OUTPUTS  a DiorError that names the culprit
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from dior.arrays import Floats
from dior.errors import DiorError
from dior.geometry.camera import Camera
from dior.geometry.tape import check_above_floor

SAME_PLACE_M = 0.01  # chosen: nearer than two cameras can stand
FEWEST_SEEN = 6  # a relative pose has 5 unknowns (Nister 2004) and one joint checks it; chosen as the least


def check_start(cameras: Sequence[Camera], uv: Floats, where: str) -> None:
    """Refuse fewer than two cameras, two in one place, one below the floor, and no joints."""
    if len(cameras) < 2:
        raise DiorError(f"{where}: {len(cameras)} close camera; the adjustment needs at least 2")
    for a, b in combinations(cameras, 2):
        if np.linalg.norm(a.centre - b.centre) < SAME_PLACE_M:
            raise DiorError(
                f"{where}: {a.name} and {b.name} are at the same place ({', '.join(f'{x:g}' for x in a.centre)}); "
                "correct the tape.position_m of one of them"
            )
    for camera in cameras:
        check_above_floor(f"{where}, {camera.name}", camera.centre, "is Z up?")
    if not uv.shape[1]:
        raise DiorError(
            f"{where}: no joint is seen by enough cameras in the window; lower adjust.min_score or adjust.min_views, "
            "or choose other instants"
        )


def check_shared(cameras: Sequence[Camera], uv: Floats, where: str) -> None:
    """Refuse cameras that the points do not tie to the others."""
    seen = np.isfinite(uv).all(axis=-1)
    for camera, count in zip(cameras, seen.sum(axis=1), strict=True):
        if count < FEWEST_SEEN:
            raise DiorError(
                f"{where}: {camera.name} shares {count} joints with the others, at least {FEWEST_SEEN} are needed; "
                "check its detections and the instants of the window"
            )
    together, tied = seen.astype(int) @ seen.T.astype(int) >= FEWEST_SEEN, np.arange(len(cameras)) == 0
    for _ in cameras:
        tied = tied | together[tied].any(axis=0)
    if not tied.all():
        apart = ", ".join(camera.name for camera, is_tied in zip(cameras, tied, strict=True) if not is_tied)
        raise DiorError(f"{where}: {apart} shares no joints with {cameras[0].name}; choose instants that all see")
