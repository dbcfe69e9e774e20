"""Clock offsets between cameras and the mocap (or the reference camera); the formula is in dior/sampling.py.

INPUTS   config/offsets/<sequence>.yaml, only where a person overrides: `cam01: {offset_s: 0.012, drift_ppm: 0}`
OUTPUTS  an offset (s) and a drift (ppm) per camera with its source
"""

from pathlib import Path

from dior import checked
from dior.errors import DiorError, nearest


def read(path, cameras):
    """Offsets of `cameras`: dict camera -> (offset_s, drift_ppm, source of table `offsets`).

    An absent file (or None) and a camera that is not in it are (0, 0, "assumed_zero"). Raises DiorError for what the
    schema refuses and a camera that the session does not have.
    """
    offsets = {camera: (0.0, 0.0, "assumed_zero") for camera in cameras}
    if path is None or not Path(path).is_file():
        return offsets
    for camera, entry in checked.check(checked.read_yaml(path), "offsets", path).items():
        if camera not in offsets:
            known = ", ".join(cameras)
            raise DiorError(f"{path}: '{camera}' is not one of the cameras {known}{nearest(camera, cameras)}")
        offsets[camera] = (float(entry["offset_s"]), float(entry["drift_ppm"]), "manual")
    return offsets
