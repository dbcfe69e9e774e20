"""The clocks of placed cameras that see two people throughout, before it is known which of them is the subject.

INPUTS   the pictures of each camera (`TimedDetections`), table `detected_people`
OUTPUT   an `Estimate` by camera as of `from_cameras`, or None
Whom a detector gives first differs from camera to camera, and rays to two people tell no clock. But both walk by the
same clocks: of the ways to take one of the two in each camera that one counts whose rays meet best, and it is believed
where the other person of each camera says the same.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from dior.arrays import Floats, Table
from dior.calibrate.clock import from_cameras
from dior.calibrate.clock.from_cameras import TimedDetections
from dior.clocks.clock import Estimate
from dior.geometry.camera import Camera
from dior.tables import tables

# chosen: of the pictures of a camera in which each of the two is
OFTEN = 0.5
# chosen: more cameras have more ways than are worth their time, and tell the clocks by others
MOST_CAMERAS = 5
# chosen: s, by which the two may differ; half of the shortest step, and several standard errors of a clock
AGREE_S = 0.1


def from_two_people(
    cameras: Sequence[Camera],
    seen: Sequence[TimedDetections],
    names: Sequence[str],
    everybody: Table,
    min_score: float,
    grid: Floats,
    fps: float,
) -> dict[str, Estimate] | None:
    """The estimates, or None where there are no two people in each camera, or where these do not agree.

    `everybody`: table `detected_people`; the others as of `from_cameras.from_detections`.
    """
    if len(cameras) > MOST_CAMERAS:
        return None
    each = [
        _two(tables.of_camera(everybody, camera.name), names, own, min_score)
        for camera, own in zip(cameras, seen, strict=True)
    ]
    if not all(each):
        return None

    def said(way: tuple[int, ...]) -> dict[str, Estimate]:
        taken = [two[who] for two, who in zip(each, way, strict=True)]
        return from_cameras.from_detections(cameras, taken, names, grid, fps)

    # the other half of the ways is what the others say
    ways = {way: said(way) for way in product((0,), *[(0, 1)] * (len(cameras) - 1))}
    way = min(ways, key=lambda way: _cost(ways[way]))
    one, other = ways[way], said(tuple(1 - who for who in way))
    agree = all(
        not one[name][3] and not other[name][3] and abs(one[name][0].offset_s - other[name][0].offset_s) < AGREE_S
        for name in one
    )
    return one if agree else None


def _two(everybody: Table, joints: Sequence[str], own: TimedDetections, min_score: float) -> list[TimedDetections]:
    """What a camera has of each of the two people whom it sees most; nothing where there are no two."""
    column = {name: i for i, name in enumerate(joints)}
    j = np.array([column.get(name, -1) for name in everybody["joint"]], int)
    counts = (j >= 0) & (everybody["score"] > min_score)
    found = []
    for track in np.unique(everybody["track"]):
        rows = counts & (everybody["track"] == track)
        uv = np.full_like(own.uv, np.nan)
        uv[everybody["frame"][rows], j[rows]] = np.stack([everybody["u"][rows], everybody["v"][rows]], axis=-1)
        found.append((int(np.isfinite(uv[..., 0]).any(axis=1).sum()), own.with_pixels(uv)))
    often = sorted((one for one in found if one[0] >= OFTEN * len(own.uv)), key=lambda one: -one[0])
    return [seen for _, seen in often[:2]] if len(often) >= 2 else []


def _cost(said: dict[str, Estimate]) -> float:
    """How far the rays of the cameras pass each other at the best lags, px, all cameras together."""
    own = [costs for _, _, costs, _ in said.values() if len(costs)]
    return float(sum(np.nanmin(costs) if np.isfinite(costs).any() else np.inf for costs in own))
