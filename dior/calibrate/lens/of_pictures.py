"""What a CameraInfo says of the pictures beside it: K with its distortion, or P where they are rectified; and which
part of the sensor they show.

INPUTS   `bags.CameraInfo`, the topic and the size of its pictures
OUTPUTS  the pinhole (3, 3) px and the distortion of these pictures

sensor_msgs/CameraInfo has K, D, R and P of the full sensor, `width` x `height`, and the pictures' region of interest
and binning beside. A rectified picture (image_proc, `image_rect*`) has no distortion, and P[:, :3] for its K.
"""

import numpy as np

from dior.arrays import Floats
from dior.errors import DiorError
from dior.ingest.bags import CameraInfo

SAME_DEG = 0.01  # chosen: a turn by rounding


def is_rectified(topic: str) -> bool:
    """Whether a topic is named as image_proc and realsense-ros name rectified pictures, also compressed ones."""
    return any(word.startswith("image_rect") for word in topic.split("/"))


def lens_of(info: CameraInfo, topic: str, size: tuple[int, int]) -> tuple[tuple[int, int], Floats, tuple[float, ...]]:
    """Size (width, height) px, pinhole (3, 3) px and distortion for the pictures on `topic`, which have `size`.

    Raises DiorError where P of rectified pictures is zero, and where region of interest and binning contradict the
    sizes.
    """
    K, D = np.reshape(info.K, (3, 3)), info.D
    if is_rectified(topic):
        K, D = np.reshape(info.P, (3, 4))[:, :3], ()
        if not K[0, 0]:
            raise DiorError(
                f"{info.where}: P is all zero, so nothing tells the focal length of the rectified pictures on {topic}; "
                "give `intrinsics: {file, name}` in the camera's YAML, without distortion"
            )
    return *_in_window(info, K, size), D


def findings(info: CameraInfo, topic: str) -> list[tuple[str, str, str]]:
    """What a person should know of rectified pictures."""
    if not is_rectified(topic):
        return []
    R = np.reshape(info.R, (3, 3))
    turn = np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))) if R.any() else 0.0
    text = f"the pictures on {topic} are rectified: P of the CameraInfo holds for them, and no distortion"
    if turn > SAME_DEG:
        text += f"; they are turned by {turn:.2f} degrees from the camera (R), as a pose measured for the camera is not"
    return [("warning" if turn > SAME_DEG else "info", "rectified_pictures", text)]


def _in_window(info: CameraInfo, K: Floats, size: tuple[int, int]) -> tuple[tuple[int, int], Floats]:
    """Size of the pictures for which the CameraInfo is, and `K` of the full sensor as theirs."""
    full = (info.width, info.height)
    left, top, *part = info.roi
    binning = tuple(max(n, 1) for n in info.binning)
    whole = tuple(part) in ((0, 0), full)
    if whole and not left and not top and binning == (1, 1):
        return full, K
    said = full if whole else (part[0], part[1])
    beyond = left + said[0] > full[0] or top + said[1] > full[1]
    said = said[0] // binning[0], said[1] // binning[1]
    if beyond or said != tuple(int(n) for n in size):
        raise DiorError(
            f"{info.where}: by its region of interest ({info.roi[2]}x{info.roi[3]} at {left}, {top}) and binning "
            f"({binning[0]}x{binning[1]}) of {full[0]}x{full[1]} px, the pictures would be {said[0]}x{said[1]}, and "
            f"they are {size[0]}x{size[1]}, so what K is of cannot be told; give `intrinsics: {{file, name}}` in the "
            "camera's YAML"
        )
    out = K.copy()
    for axis, (begin, n) in enumerate(zip((left, top), binning, strict=True)):
        out[axis] /= n
        # of n pixels in one, the middle
        out[axis, 2] = (K[axis, 2] - begin + 0.5) / n - 0.5
    return said, out
