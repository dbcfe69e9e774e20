"""Whether the pose of an indoor camera is off, by its detections against those of the other cameras of the walk.

INPUTS   `detection_offsets` of the cameras of one sequence (step clocks). OUTPUT  findings `camera_turned`
"""

from collections.abc import Iterable, Mapping
from typing import TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.tables import tables

# chosen: how much further (m) to one side of the joints than the others' the detections of a camera lie, for a note
# and for a warning, each by so many standard errors over the joints. Simulated right cameras are left less than the
# first, 0.22 degrees 4.5 m away. But a real detector errs by the side from which it sees somebody: of a real walk it
# lies two thirds of the second to one side in a camera whose pose is right (`python -m benchmarks.turned`)
NOTED_M, TURNED_M, TURNED_SIGMAS = 0.0175, 0.06, 3.0
# of a camera: how far (2,) m right of and below each joint its detections lie, and px per m there
Aside: TypeAlias = tuple[Mapping[str, Floats], float]
Finding: TypeAlias = tuple[str, str, str, str]


def read(paths: Iterable[AnyPath]) -> dict[str, Aside]:
    """What tables `detection_offsets` say, by camera."""
    found: dict[str, Aside] = {}
    for table in (tables.read(path, "detection_offsets") for path in paths):
        for camera in tables.ordered_unique(table["camera"]):
            own = tables.of_camera(table, camera)
            by = np.stack([own["right_m"], own["down_m"]], axis=-1)
            found[camera] = dict(zip(own["joint"].tolist(), by, strict=True)), float(own["px_per_m"][0])
    return found


def turned(sequence: str, aside: Mapping[str, Aside]) -> list[Finding]:
    """Whether the detections of one camera lie further to one side of the joints than those of the others do.

    A detector's joints lie beside those of the motion capture in all cameras alike: a camera is compared with the
    middle of the others', joint by joint, and needs two others. Named is the worst, which makes the others look off.
    """
    found: list[tuple[float, float, str, str]] = []
    for name, (own, px_per_m) in aside.items():
        others = [one for other, (one, _) in aside.items() if other != name]
        joints = [joint for joint in own if all(joint in one for one in others)]
        if len(others) < 2 or len(joints) < 2:
            continue
        apart = np.array([own[joint] - np.median([one[joint] for one in others], axis=0) for joint in joints])
        mean, sigma = apart.mean(axis=0), apart.std(axis=0, ddof=1) / np.sqrt(len(joints))
        told = np.abs(mean) > np.maximum(NOTED_M, TURNED_SIGMAS * sigma)
        # labels lie on the other side of detections than these of them
        sides = ("right of" if mean[0] < 0 else "left of", "below" if mean[1] < 0 else "above")
        words = " and ".join(
            f"{abs(m) * px_per_m:.1f} px {side}" for m, side, yes in zip(mean, sides, told, strict=True) if yes
        )
        found.append((float(np.linalg.norm(mean[told])), float(np.abs(mean[told]).max(initial=0.0)), name, words))
    far, most, name, words = max(found, default=(0.0, 0.0, "", ""))
    if not far:
        return []
    lie = f"its labels lie {words} what is detected, {far:.3f} m at the person, compared with the other cameras"
    if most > TURNED_M:
        return [(f"{sequence}/{name}", "warning", "camera_turned", f"the pose of {name} is off: {lie}")]
    text = f"the pose of {name} may be off, or the detector errs from this side: {lie}; hand checks would tell"
    return [(f"{sequence}/{name}", "info", "camera_turned", text)]
