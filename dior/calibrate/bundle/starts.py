"""Where the adjustment starts from: the placed cameras, one from the pixels alone, and a few turned ones.

INPUTS   placed cameras, recorded pixels (V, N, 2)
OUTPUTS  starts in the order in which they are tried, and the choice among what came of them

A bundle adjustment ends in the minimum next to its start, and an aim that is 20 degrees off has another one there. The
epipolar start does not know the aim: relative poses by the essential matrix of the keypoints, further cameras by PnP
on what two see, and the whole placed by the similarity that brings the centres to where they were measured. Two starts
that end in the same world vouch for each other. Everything is seeded.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np

from dior.arrays import Bools, Floats
from dior.errors import DiorError
from dior.geometry.camera import REFERENCE_FX, Camera, angle_deg, pose, reprojection_errors, undistort
from dior.geometry.multiview import rotation_x, rotation_z, similarity
from dior.geometry.triangulation import triangulate, triangulated

# chosen, at fx 1680: once and three times what a pose network misses by; the start with the lower cost counts
EPIPOLAR_PX = (4.0, 12.0)
FEWEST_SHARED = 30  # chosen: joints that agree on a relative pose; 5 determine it, the others vouch for it
SAMPLE, MOST_DRAWS = 1000, 300  # chosen: joints and RANSAC's draws; 300 find 5 good ones of 70 % with 1 - 1e-24
# chosen: how far an aim by eye is off, about the camera's x axis and about the vertical, and how many of such starts
TURNED_DEG, MOST_TURNED = (12.0, 25.0), 4
CAPPED_PX = 60.0  # chosen, at fx 1680: a joint that is farther off is as wrong as one behind the camera
# chosen: a tripod is level to a few degrees, and so upright is who walks: more is a camera that is mounted otherwise.
# It is believed where so much of the body's directions agrees (the length of their mean), in so many pictures
ROLLED_DEG, AGREED, FEWEST_UPRIGHT = 20.0, 0.8, 20
SAME_M, SAME_DEG = 0.10, 1.5  # chosen: ends nearer than this differ by where their samples stopped
EQUAL = 1.05  # chosen: a cost within 5 % of the best is as good, by the noise of a sample


# adjusts cameras to a sample of the points, or raises DiorError
Attempt: TypeAlias = Callable[[Sequence[Camera]], list[Camera]]


@dataclass(frozen=True)
class Tried:
    """A start by name, the cameras that came of it and their cost (px at fx 1680); none and the error if it failed."""

    name: str
    cameras: list[Camera]
    cost_px: float = np.inf
    error: str = ""


def best(cameras: Sequence[Camera], uv: Floats, attempt: Attempt, where: str) -> tuple[Tried, list[Tried]]:
    """The `Tried` that the adjustment goes on with, and all of them.

    `attempt` (a function) adjusts cameras to a sample, or raises DiorError. Where the placed cameras and the epipolar
    start end in the same world, or one of them far better than the other, no more are tried. Raises DiorError where
    none succeeds (the complaint about the placed ones), and where two end equally well in different worlds.
    """
    tried = [_try("as placed", cameras, uv, attempt)]
    other = epipolar(cameras, uv)
    if other is not None:
        tried.append(_try("epipolar", other, uv, attempt))
    good = [one for one in tried if one.cameras]
    if not (len(good) == 2 and same_world(good[0].cameras, good[1].cameras)):
        tried += [_try(name, start, uv, attempt) for name, start in turned(cameras)]
        good = [one for one in tried if one.cameras]
    if not good:
        raise DiorError(tried[0].error)
    chosen = min(good, key=lambda one: one.cost_px)
    for one in good:
        if one.cost_px < EQUAL * chosen.cost_px and not same_world(one.cameras, chosen.cameras):
            costs = ", ".join(f"{t.name} {t.cost_px:.2f} px" for t in good)
            raise DiorError(
                f"{where}: starts that end equally well give different worlds ({costs}); measure the cameras better "
                "(tape.position_m, tape.target_m) or choose instants in which the person is seen all over the walkway"
            )
    return chosen, tried


def _try(name: str, start: Sequence[Camera], uv: Floats, attempt: Attempt) -> Tried:
    try:
        cameras = attempt(start)
    except DiorError as error:
        return Tried(name, [], error=str(error))
    return Tried(name, cameras, cost(cameras, uv))


def cost(cameras: Sequence[Camera], uv: Floats) -> float:
    """Mean reprojection error (px at fx 1680) of all detections of joints that two cameras see, each at most 60 px."""
    scale = np.array([[REFERENCE_FX / c.intrinsics.fx] for c in cameras])
    errors = reprojection_errors(cameras, triangulated(cameras, uv), uv) * scale
    seen = np.isfinite(uv).all(axis=-1) & (np.isfinite(uv).all(axis=-1).sum(axis=0) >= 2)
    return float(np.mean(np.fmin(np.where(np.isfinite(errors), errors, CAPPED_PX), CAPPED_PX)[seen]))


def same_world(one: Sequence[Camera], other: Sequence[Camera]) -> bool:
    """Whether two sets of cameras are the same to 10 cm and 1.5 degrees."""
    for a, b in zip(one, other, strict=True):
        if np.linalg.norm(a.centre - b.centre) > SAME_M or angle_deg(a.wRc, b.wRc) > SAME_DEG:
            return False
    return True


def roll(camera: Camera, uv: Floats, joints: Sequence[str]) -> float:
    """By how much (rad) a level camera is turned about its axis, by the people in its pictures: uv (F, J, 2) px.

    Who walks has the shoulders above the ankles, or the hips where these are not seen. 0 up to 20 degrees, where too
    few are seen, or not all of one mind.
    """
    places = [[i for i, name in enumerate(joints) if name.endswith(part)] for part in ("shoulder", "hip", "ankle")]
    if not all(places):
        return 0.0
    rays = undistort(camera.intrinsics, uv)
    top, middle, below = (rays[:, own].mean(axis=1) for own in places)
    up = top - np.where(np.isfinite(below), below, middle)
    up = up[np.isfinite(up).all(axis=1)]
    up = (up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)).mean(axis=0) if len(up) else np.zeros(2)
    angle = float(np.arctan2(-up[0], -up[1]))
    few = np.isfinite(top).all(axis=1).sum() < FEWEST_UPRIGHT
    return 0.0 if few or np.linalg.norm(up) < AGREED or abs(angle) < np.radians(ROLLED_DEG) else angle


def turned(cameras: Sequence[Camera]) -> Iterator[tuple[str, list[Camera]]]:
    """Starts whose aims are turned about the vertical and the camera's own x axis: (name, cameras)."""
    for seed in range(MOST_TURNED):
        random = np.random.default_rng(seed)
        out = []
        for camera in cameras:
            about_z, about_x = np.radians(random.uniform(-1, 1, 2) * TURNED_DEG[::-1])
            out.append(camera.at(pose(rotation_z(about_z) @ camera.wRc @ rotation_x(about_x), camera.centre)))
        yield f"turned {seed + 1}", out


def epipolar(cameras: Sequence[Camera], uv: Floats) -> list[Camera] | None:
    """The cameras (V) placed by the pixels uv (V, N, 2), their scale and place by the centres they have.

    None where two cameras do not share enough, or the others cannot be tied to them. How near to its epipolar line a
    joint has to be is tried strictly and less so, as detectors differ; the one with the least cost counts.
    """
    tried = [_epipolar(cameras, uv, limit / REFERENCE_FX) for limit in EPIPOLAR_PX]
    each = [start for start in tried if start is not None]
    return min(each, key=lambda start: cost(start, uv)) if each else None


def _epipolar(cameras: Sequence[Camera], uv: Floats, threshold: float) -> list[Camera] | None:
    rays = np.stack([undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    seen = np.asarray(np.isfinite(rays).all(axis=-1))
    index = np.flatnonzero(seen.sum(axis=0) >= 2)
    if len(index) > SAMPLE:
        index = np.sort(np.random.default_rng(0).permutation(index)[:SAMPLE])
    rays, seen = rays[:, index], seen[:, index]
    tried = [_pair(rays, seen, a, b, threshold) for a, b in combinations(range(len(cameras)), 2)]
    pairs = [pair for pair in tried if pair is not None]
    for _, a, b, bTa in sorted(pairs, key=lambda pair: -pair[0]):
        cTw = _chained(rays, seen, a, b, bTa, threshold)
        if cTw is not None:
            return _to_tape(cameras, cTw)
    return None


def _pair(rays: Floats, seen: Bools, a: int, b: int, threshold: float) -> tuple[int, int, int, Floats] | None:
    """How many joints agree on the relative pose of two cameras, the cameras, and that pose bTa; None for too few."""
    import cv2

    both = seen[a] & seen[b]
    if both.sum() < FEWEST_SHARED:
        return None
    one, other = (np.ascontiguousarray(rays[view][both]) for view in (a, b))
    cv2.setRNGSeed(0)
    E, agree = cv2.findEssentialMat(
        one, other, np.eye(3), method=cv2.RANSAC, prob=0.999, threshold=threshold, maxIters=MOST_DRAWS
    )
    if E is None or E.shape != (3, 3):
        return None
    count, R, t, _ = cv2.recoverPose(E, one, other, np.eye(3), mask=agree)
    return (int(count), a, b, pose(R, t.ravel())) if count >= FEWEST_SHARED else None


def _chained(rays: Floats, seen: Bools, a: int, b: int, bTa: Floats, threshold: float) -> Floats | None:
    """cTw (V, 4, 4) of all cameras in the axes of camera a and units of the baseline, the others by PnP; or None."""
    import cv2

    cTw = {a: np.eye(4), b: bTa}
    while len(cTw) < len(rays):
        views = list(cTw)
        points = triangulate(np.stack([cTw[v] for v in views]), rays[views], seen[views].astype(float))
        known = np.isfinite(points).all(axis=1)
        left = [v for v in range(len(rays)) if v not in cTw]
        view = max(left, key=lambda v: (known & seen[v]).sum())
        both = known & seen[view]
        if both.sum() < FEWEST_SHARED:
            return None
        cv2.setRNGSeed(0)
        done, turn, move, agree = cv2.solvePnPRansac(
            points[both], np.ascontiguousarray(rays[view][both]), np.eye(3), None, iterationsCount=500,
            reprojectionError=2 * threshold, flags=cv2.SOLVEPNP_SQPNP,
        )  # fmt: skip
        if not done or agree is None or len(agree) < FEWEST_SHARED:
            return None
        cTw[view] = pose(cv2.Rodrigues(turn)[0], move.ravel())
    return np.stack([cTw[v] for v in range(len(rays))])


def _to_tape(cameras: Sequence[Camera], cTw: Floats) -> list[Camera] | None:
    """The cameras at `cTw` (V, 4, 4), brought to their measured centres by a similarity.

    Two centres leave a turn about their line open, and any few of them little of the tilt: a point below each camera,
    by its own downward axis, has a say as well.
    """
    wTc = np.linalg.inv(cTw)
    centre = np.array([c.centre for c in cameras])
    found = np.asarray(wTc[:, :3, 3], float)
    size, measured = (np.sqrt(np.mean((x - x.mean(axis=0)) ** 2)) for x in (found, centre))
    if not size > 0:
        return None
    if len(cameras) == 2:
        found = np.concatenate([found, found + size * wTc[:, :3, 1]])
        centre = np.concatenate([centre, centre + measured * np.array([c.wRc[:, 1] for c in cameras])])
    s, R, t = similarity(found, centre)
    if not s > 0:
        return None
    return [c.at(pose(R @ T[:3, :3], s * R @ T[:3, 3] + t)) for c, T in zip(cameras, wTc, strict=True)]
