"""Clock offsets between cameras and the mocap (or the reference camera), and the project's one clock formula.

INPUTS   config/offsets/<sequence>.yaml, only where a person overrides: `cam01: {offset_s: 0.012, drift_ppm: 0}`.
OUTPUTS  an offset (s) and a drift (ppm) per camera with its source.

`t = (stamp_ns - t0_ns)/1e9 * (1 + 1e-6 drift_ppm) + offset_s` (design, section 8): seconds after the first stored
mocap frame indoors, time of the reference camera outdoors.
"""

import math
from pathlib import Path

from dior import checked
from dior.errors import DiorError, nearest
from dior.sampling import seconds  # noqa: F401

KEYS = ("offset_s", "drift_ppm")


def read(path, cameras):
    """Offsets of `cameras`: dict camera -> (offset_s, drift_ppm, source of table `offsets`).

    An absent file (or None) and a camera that is not in it are (0, 0, "assumed_zero"). Raises DiorError for text that
    is no YAML, a camera that the session does not have, an unknown key and a value that is no finite number.
    """
    offsets = {camera: (0.0, 0.0, "assumed_zero") for camera in cameras}
    if path is None or not Path(path).is_file():
        return offsets
    for camera, entry in _load(path).items():
        if camera not in offsets:
            known = ", ".join(cameras)
            raise DiorError(f"{path}: '{camera}' is not one of the cameras {known}{nearest(camera, cameras)}")
        if not isinstance(entry, dict):
            raise DiorError(f"{path}: {camera} must hold offset_s and drift_ppm, for example {{offset_s: 0.012}}")
        for key, value in entry.items():
            if key not in KEYS:
                raise DiorError(f"{path}: {camera} has an unknown key '{key}'{nearest(key, KEYS)}")
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise DiorError(f"{path}: {camera}.{key} is '{value}', not a number")
        offsets[camera] = (float(entry.get("offset_s", 0.0)), float(entry.get("drift_ppm", 0.0)), "manual")
    return offsets


def _load(path):
    content = checked.read_yaml(path)
    if not isinstance(content, dict):
        raise DiorError(f"{path}: must map cameras to their offsets, for example cam01: {{offset_s: 0.012}}")
    return content
