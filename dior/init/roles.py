"""Which camera is the long-range one: nobody, or only tiny people, are detected in its pictures.

INPUTS   detections of some walks of a session
OUTPUTS  `Role` by camera, with the reason
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Ints
from dior.ingest.readers import READERS
from dior.init import names
from dior.init.cameras import Filmed
from dior.project.todos import WORD

# chosen: of a person smaller than this, and than such a share of the size in the other cameras, no detector is any use
TINY_PX, TINY_SHARE = 80.0, 0.4
# chosen: in fewer pictures somebody passes by, or a detector errs
FEW = 0.1


@dataclass(frozen=True)
class Seen:
    """What was detected in a camera: pictures with somebody, of `pictures`; how tall (px, median, NaN for nobody);
    number of the first and the last picture that the detector's files have."""

    somebody: int
    pictures: int
    height_px: float
    first: int
    last: int


@dataclass(frozen=True)
class Role:
    """`role` as in a camera's YAML, or TODO, and why."""

    role: str
    reason: str


def seen(path: Path, tool: str, camera: Filmed) -> Seen:
    """What is in the detections of a camera. Raises DiorError, ValueError or OSError where they cannot be read."""
    reader = READERS[tool]
    people = reader.read(path, camera.name)
    pictures = camera.stream.count if reader.silent else max(len(people.ran), 1)
    if not len(people.frame):
        return Seen(0, pictures, np.nan, *_ends(people.ran))
    with np.errstate(invalid="ignore"):
        v = people.uv[..., 1] * ((camera.stream.height or 1) if reader.fractions else 1)
        heights = np.nanmax(v, axis=1) - np.nanmin(v, axis=1)
    return Seen(len(np.unique(people.frame)), pictures, float(np.nanmedian(heights)), *_ends(people.ran))


def _ends(ran: Ints) -> tuple[int, int]:
    return (int(ran[0]), int(ran[-1])) if len(ran) else (0, 0)


def roles_of(
    cameras: Sequence[Filmed], detected: Mapping[str, Sequence[Seen]], outdoors: bool, unread: Mapping[str, str]
) -> dict[str, Role]:
    """The role of each camera. `detected`: by camera what was seen in some walks, nothing of one without detections;
    `unread`: by camera why these cannot be read."""
    heights = {
        name: float(np.nanmax([one.height_px for one in of])) for name, of in detected.items()
        if of and not all(np.isnan(one.height_px) for one in of)
    }  # fmt: skip
    roles = {}
    for camera in cameras:
        others = [height for name, height in heights.items() if name != camera.name]
        roles[camera.name] = _role(
            camera, detected.get(camera.name, ()), float(np.median(others or [np.nan])), outdoors,
            unread.get(camera.name, ""),
        )  # fmt: skip
    if all(role.role == "long_range" for role in roles.values()):
        return {name: Role(WORD, f"close or long_range: {role.reason}, as in all") for name, role in roles.items()}
    return roles


def _role(camera: Filmed, detected: Sequence[Seen], others_px: float, outdoors: bool, unread: str) -> Role:
    if detected:
        somebody, pictures = (sum(getattr(one, key) for one in detected) for key in ("somebody", "pictures"))
        where = f"in {somebody} of {pictures} pictures"
        if somebody < FEW * pictures:
            return Role("long_range", f"somebody was detected {where}")
        height = float(np.nanmedian([one.height_px for one in detected]))
        if height < TINY_PX and height < TINY_SHARE * others_px:
            return Role("long_range", f"people are {height:.0f} px tall in it, and {others_px:.0f} px in the others")
        return Role("close", f"somebody was detected {where}, {height:.0f} px tall")
    if unread:
        return Role(WORD, f"close or long_range: its detections could not be read ({unread})")
    if np.isfinite(others_px):
        return Role("long_range", "there are detections of the other cameras and none of it")
    if re.search(names.FAR, f"{camera.name} {camera.topic}"):
        return Role("long_range", "its name says so; there are no detections to tell")
    if outdoors:
        return Role(WORD, "close or long_range: there are no detections to tell")
    return Role("close", "nothing says that it is far away")
