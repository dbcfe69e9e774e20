"""Clocks that a person gives; the formula is in dior/clocks/axis.py.

INPUTS   config/offsets/<sequence>.yaml, only where a person overrides: `cam01: {offset_s: 0.012, drift_ppm: 0}`
OUTPUTS  an offset (s) and a drift (ppm) per camera with its source
"""

from collections.abc import Sequence
from pathlib import Path

from dior.arrays import AnyPath
from dior.clocks.axis import ClockValues
from dior.clocks.clock import Clock
from dior.errors import DiorError, nearest
from dior.project import schema_check


def by_hand(path: AnyPath | None, cameras: Sequence[str]) -> dict[str, Clock]:
    """`Clock` of the cameras that a person gave one, by name. An absent file (or None) is an empty one.

    Without `sigma_s` a value counts as exact. Raises DiorError for what the schema refuses and a camera that the
    session does not have.
    """
    if path is None or not Path(path).is_file():
        return {}
    given = schema_check.check(schema_check.read_yaml(path), "offsets", path)
    for camera in given:
        if camera not in cameras:
            known = ", ".join(cameras)
            raise DiorError(f"{path}: '{camera}' is not one of the cameras {known}{nearest(camera, cameras)}")
    return {
        camera: Clock(
            float(entry["offset_s"]), float(entry["drift_ppm"]), "manual", given=(float(entry["sigma_s"]), 0.0)
        )
        for camera, entry in given.items()
    }


def read(path: AnyPath | None, cameras: Sequence[str]) -> dict[str, ClockValues]:
    """Offsets of `cameras`: dict camera -> (offset_s, drift_ppm, source of table `offsets`).

    A camera that no person gave a clock is (0, 0, "assumed_zero"). Raises DiorError as `by_hand`.
    """
    given = by_hand(path, cameras)
    clocks = {camera: given.get(camera, Clock(0.0)) for camera in cameras}
    return {camera: (clock.offset_s, clock.drift_ppm, clock.source) for camera, clock in clocks.items()}
