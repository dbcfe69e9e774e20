"""The world of marked points: three or more whose places are measured, clicked in two cameras of a calibration.

INPUTS   cameras in some world, their marks with x, y, z (`marks.Marks`)
OUTPUTS  the rigid motion that brings the calibration's points to the measured ones, and how far they miss them

For a calibration whose origin is a camera, or that has another axis up, where no walk tells the floor, or points tell
it better. Cameras and points stand still: a point that is clicked on several pictures of a camera is their mean.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats
from dior.body.wrong_world import scale_words
from dior.calibrate.marks.marks import Marks
from dior.errors import DiorError
from dior.geometry.camera import Camera
from dior.geometry.triangulation import triangulated

FEWEST = 3
# chosen: three points nearer to a line than this tell no turn about it
LEAST_WIDTH_M = 0.2
# chosen: what a person measures is the same point in two files, and a size that is further off is another unit
SAME_M, SIZE = 0.001, 0.1


@dataclass(frozen=True, eq=False)
class Rebased:
    """`bTw` (4, 4); `names` of the P points and by how much they miss, `off_m` (P,); `tilt_rad`: 1 sigma of the world's
    turn by these misses, about the axis of which the points tell least."""

    bTw: Floats
    names: tuple[str, ...]
    off_m: Floats
    tilt_rad: float


def rebased(cameras: Sequence[Camera], marks: Mapping[str, Marks], where: str) -> Rebased:
    """The motion to the world of the points that are marked with x, y, z in two cameras or more.

    Raises DiorError, `where` first, for fewer than three, for points on a line, for one that has two places, and for a
    calibration of another size.
    """
    places = _places(marks, where)
    seen = {name: _middles(own) for name, own in marks.items()}
    rig = [camera for camera in cameras if camera.name in seen]
    names = [name for name in places if sum(name in seen[camera.name] for camera in rig) > 1]
    if len(names) < FEWEST:
        there = f"; there are {', '.join(names)}" if names else ""
        raise DiorError(
            f"{where}: `reference.world: from_marks` needs {FEWEST} points with x, y, z, each marked in the "
            f"<camera>.marks.csv of two reference cameras or more{there}"
        )
    nowhere = np.full(2, np.nan)
    uv = np.array([[seen[camera.name].get(name, nowhere) for name in names] for camera in rig])
    found, measured = triangulated(rig, uv), np.array([places[name] for name in names])
    if not np.isfinite(found).all():
        bad = [name for name, point in zip(names, found, strict=True) if not np.isfinite(point).all()]
        raise DiorError(f"{where}: the rays of {', '.join(bad)} meet nowhere; are they clicked on the same point?")
    own, given = found - found.mean(axis=0), measured - measured.mean(axis=0)
    if np.linalg.svd(given, compute_uv=False)[1] < LEAST_WIDTH_M:
        raise DiorError(f"{where}: the marked points {', '.join(names)} are on a line; mark one beside it")
    ratio = float(np.sqrt((own**2).sum() / (given**2).sum()))
    if abs(ratio - 1) > SIZE:
        raise DiorError(f"{where}: the calibration's world is {scale_words(ratio)}, by {', '.join(names)}")
    R = _turn(own, given)
    bTw = np.eye(4)
    bTw[:3, :3], bTw[:3, 3] = R, measured.mean(axis=0) - R @ found.mean(axis=0)
    off = np.linalg.norm(own @ R.T - given, axis=1)
    return Rebased(bTw, tuple(names), off, _tilt(off, given))


def _places(marks: Mapping[str, Marks], where: str) -> dict[str, Floats]:
    """Where each named point is (3,) m."""
    found: dict[str, Floats] = {}
    for own in marks.values():
        for name, xyz in zip(own.joint, own.xyz, strict=True):
            if not np.isfinite(xyz).all():
                continue
            if np.abs(found.setdefault(name, xyz) - xyz).max() > SAME_M:
                raise DiorError(f"{where}: the point {name} has two places in the marks: {found[name]} and {xyz} m")
    return found


def _middles(own: Marks) -> dict[str, Floats]:
    """The mean pixel (2,) of each point that a camera has with its place."""
    measured = np.isfinite(own.xyz).all(axis=1)
    return {name: own.uv[measured & (own.joint == name)].mean(axis=0) for name in set(own.joint[measured])}


def _turn(own: Floats, given: Floats) -> Floats:
    """The rotation (3, 3) that brings points (P, 3) about their middle nearest to others (Kabsch 1976)."""
    U, _, Vt = np.linalg.svd(given.T @ own)
    return U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt


def _tilt(off: Floats, given: Floats) -> float:
    """1 sigma (rad) of the turn about the line along which the points lie: their misses over how wide they are."""
    # three numbers a point, less the six of the motion
    free = max(3 * len(off) - 6, 1)
    return float(np.sqrt((off**2).sum() / free) / np.linalg.svd(given, compute_uv=False)[1])
