"""Place a camera by an AprilTag whose place in the world is known.

INPUTS   `tag` of session.yaml, intrinsics, the `frames` table of one sequence and its bags
OUTPUTS  wTc (4, 4) of the camera, where the corners were seen on each picture (`marks`), and findings

World in metres, Z up, floor at Z = 0. A marker's own axes: origin in its centre, x to the right and y to the top of its
official picture, z out of the printed side. Corners are the outer corners of the black square: top left, top right,
bottom right, bottom left; recorded pixels.
A square seen once has two poses that fit nearly as well. The second is left out where it is behind the camera, below
the floor, fits clearly worse, or, where both fit, is upside down while the other is upright; if none of this decides,
it is an error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Bools, Floats, Ints, Table
from dior.calibrate.marks.pnp import upright
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import Camera, angle_deg, inverse_pose, pose, project, undistort
from dior.progress import reporting
from dior.tables import tables

FAMILIES = {"36h11": "APRILTAG_36h11"}
# bits of tag 0 by rows from the top left, as in AprilTag's own sources (tag36h11.c of AprilTag 2) and pictures
FIRST_36H11 = 0xD5D628584
MOST_FRAMES = 40  # chosen: evenly spread pictures; what remains of the corners' error is constant
MOVED_PX = 3.0  # chosen: 20 times a corner's noise, and 2 cm at 4 m
# corners are right to 0.06 px in drawn pictures; blur and paper that is not flat add to it
CORNER_SIGMA_PX = 0.15
CORNERS = ("top_left", "top_right", "bottom_right", "bottom_left")
# chosen: places along a side, without its ends, where the corners blur, and across it
ALONG, ACROSS = np.linspace(0.1, 0.9, 25), np.linspace(-1, 1, 25)
# chosen: how far across a side is looked, px and of its length (half of a bit of 36h11); less of the step is noise
EDGE_PX, EDGE_SHARE, LEAST_STEP = 3.0, 0.06, 0.15
REFINED_PX = 2.0  # chosen: OpenCV's corners are right to 0.25 px, so that a larger move is another edge
WORSE = (
    2.0  # chosen: the other pose is left out where its rms is this many times the better one's or the corners' noise
)
USUAL_SIGMA_M = 0.05  # chosen: of a position by tape


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose of a marker in the camera, `cTm` (4, 4) m, and the rms distance `rms_px` of its four corners."""

    cTm: Floats
    rms_px: float


def detector(dictionary: str) -> Callable[[NDArray[np.uint8]], dict[int, Floats]]:
    """A function from a picture to {id: corners (4, 2) px}, for a dictionary by OpenCV's name (`5X5_250`)."""
    import cv2

    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}"))
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found = cv2.aruco.ArucoDetector(known, parameters)
    turned = _quarter_turns(known) if dictionary == FAMILIES["36h11"] else 0

    def detect(picture: NDArray[np.uint8]) -> dict[int, Floats]:
        corners, ids, _ = found.detectMarkers(picture)
        if ids is None:
            return {}
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(float)
        return {
            int(i): np.roll(sharpened(grey, np.asarray(c, float).reshape(4, 2)), turned, axis=0)
            for i, c in zip(np.ravel(ids), corners, strict=True)
        }

    return detect


def sharpened(grey: Floats, corners: Floats) -> Floats:
    """Corners (4, 2) px of a marker as the intersections of lines along its sides, in a picture (height, width).

    Each side is met at 25 places, where the middle of the step from black to white is its edge. In drawn pictures
    the corners are right to 0.06 px, where OpenCV's own are to 0.25 px and, by its AprilTag method, half a pixel off.
    Corners that would move by more than 2 px stay as they are: the margin was not white.
    """
    ends = np.roll(corners, -1, axis=0)
    with np.errstate(all="ignore"):
        lines = [_side(grey, start, end) for start, end in zip(corners, ends, strict=True)]
    crossed = []
    for (p, d), (q, e) in zip([lines[-1], *lines[:-1]], lines, strict=True):
        cross = d[0] * e[1] - d[1] * e[0]
        crossed.append(p + d * ((q - p)[0] * e[1] - (q - p)[1] * e[0]) / cross if cross else np.full(2, np.nan))
    moved = np.linalg.norm(np.array(crossed) - corners, axis=1)
    return np.array(crossed) if (moved < REFINED_PX).all() else corners


def _side(grey: Floats, start: Floats, end: Floats) -> tuple[Floats, Floats]:
    """A point and a direction of the line along the side of a marker between two corners (2,) px."""
    from scipy.ndimage import map_coordinates

    length = np.linalg.norm(end - start)
    along = (end - start) / length
    out = np.array([along[1], -along[0]])
    across = ACROSS * np.minimum(EDGE_PX, EDGE_SHARE * length)
    at = start + (ALONG * length)[:, None, None] * along + across[:, None] * out
    profile = map_coordinates(grey, [at[..., 1], at[..., 0]], order=1, mode="nearest")
    step = np.diff(profile, axis=1) * np.sign(np.median(profile[:, -1] - profile[:, 0]))
    step = np.where(step > LEAST_STEP * step.max(), step, 0.0)
    edge = step @ ((across[1:] + across[:-1]) / 2) / step.sum(axis=1)
    good, line = np.isfinite(edge), np.full(2, np.nan)
    for _ in range(2):
        if good.sum() < 5:
            return start, np.full(2, np.nan)
        line = np.polyfit((ALONG * length)[good], edge[good], 1)
        off = np.abs(edge - np.polyval(line, ALONG * length))
        good = off <= max(0.3, 4 * np.median(off[good]))
    return start + line[1] * out, along + line[0] * out


def _quarter_turns(dictionary: Any) -> int:
    """By how many quarter turns OpenCV's 36h11 stands on its head: releases differ (opencv-python issue 1195)."""
    import cv2

    drawn = cv2.aruco.generateImageMarker(dictionary, 0, 8)[1:7, 1:7] > 0
    official = np.array([bit == "1" for bit in f"{FIRST_36H11:036b}"]).reshape(6, 6)
    return next(turns for turns in range(4) if (np.rot90(official, turns) == drawn).all())


def marker_points(size_m: float) -> Floats:
    """Corners (4, 3) m of a marker in its own axes."""
    half = size_m / 2
    return np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0.0]])


def solutions(camera: Camera, corners: Floats, size_m: float) -> list[Solution]:
    """The two poses of a marker with `corners` (4, 2) recorded px, better one first (IPPE, Collins and Bartoli 2014).

    Those behind the camera, and all where the lens model has no answer, are left out.
    """
    import cv2

    xy, points = undistort(camera.intrinsics, corners), marker_points(size_m)
    if not np.isfinite(xy).all():
        return []
    count, turns, moves, _ = cv2.solvePnPGeneric(points, xy, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    found = []
    for turn, move in zip(turns[:count], moves[:count], strict=True):
        turn, move = cv2.solvePnPRefineLM(points, xy, np.eye(3), None, turn, move)
        cTm = pose(cv2.Rodrigues(turn)[0], np.ravel(move))
        off = project(camera.at(inverse_pose(cTm)), points)[0] - corners
        if np.isfinite(off).all() and cTm[2, 3] > 0:
            found.append(Solution(cTm, float(np.sqrt(np.mean(np.sum(off**2, axis=1))))))
    return sorted(found, key=lambda solution: solution.rms_px)


def tag_pose(tag: dict[str, Any], where: str) -> Floats:
    """wTm (4, 4) of the session's tag. Raises DiorError where `normal` and `up` do not make a right angle."""
    normal, up = (np.array(tag[key], float) for key in ("normal", "up"))
    lengths = np.linalg.norm(normal), np.linalg.norm(up)
    if min(lengths) < 1e-6 or abs(normal @ up) > 0.02 * lengths[0] * lengths[1]:
        raise DiorError(
            f"{where}: tag.normal {tag['normal']} and tag.up {tag['up']} must be at a right angle; the first is where "
            "the printed side faces, the second where its upper edge is"
        )
    z = normal / lengths[0]
    y = up - (up @ z) * z
    y /= np.linalg.norm(y)
    return pose(np.stack([np.cross(y, z), y, z], axis=1), tag["position_m"])


def world_points(tag: dict[str, Any], where: str) -> Floats:
    """Corners (4, 3) m of the session's tag in the world."""
    wTm = tag_pose(tag, where)
    return marker_points(tag["size_m"]) @ wTm[:3, :3].T + wTm[:3, 3]


@dataclass(frozen=True, eq=False)
class Corners:
    """Where one camera sees the corners `world` (4, 3) m of a tag: `uv` (4, 2) recorded px, each to `sigma_px`."""

    uv: Floats
    world: Floats
    sigma_px: float


def corners_of(marks: Table) -> Corners:
    """`Corners` of a camera from its `marks` table as `place` made it: the mean over the still pictures.

    Their sigma is the scatter over the pictures or how far they are from the placed pose, whichever is more; more
    pictures do not make it smaller, as what is left is constant (paper, lens).
    """
    kept = marks["inlier"]
    seen = np.stack([marks["u"], marks["v"]], axis=-1)[kept].reshape(-1, 4, 2)
    world = np.stack([marks[axis] for axis in "xyz"], axis=-1)[kept].reshape(-1, 4, 3)[0]
    rms_px = float(np.sqrt(np.mean(marks["residual_px"][kept] ** 2)))
    return Corners(seen.mean(axis=0), world, max(CORNER_SIGMA_PX, _noise_px(seen), rms_px))


def still(corners: Floats) -> Bools:
    """Mask (F,) of the detections (F, 4, 2) that are where most are: a tag that is hidden in part, or carried, is not.

    Within 3 px of the median in every corner.
    """
    return np.linalg.norm(corners - np.median(corners, axis=0), axis=-1).max(axis=1) <= MOVED_PX


def choose(found: Sequence[Solution], wTm: Floats, corner_sigma_px: float, where: str) -> tuple[Floats, str]:
    """wTc (4, 4) of the right one of `solutions`, and in words what decided.

    Raises DiorError where none is above the floor or the two fit as well.
    """
    if not found:
        raise DiorError(f"{where}: no pose fits the tag; are the intrinsics right?")
    poses = [(wTm @ inverse_pose(solution.cTm), solution.rms_px) for solution in found]
    above = [(wTc, rms) for wTc, rms in poses if wTc[2, 3] > 0]
    if not above:
        raise DiorError(
            f"{where}: the tag puts the camera {-poses[0][0][2, 3]:.2f} m below the floor; check tag.position_m, "
            "tag.normal and tag.up in session.yaml"
        )
    if len(above) == 1:
        return above[0][0], "the only one above the floor"
    (best, best_px), (other, other_px) = above
    if other_px >= WORSE * max(best_px, corner_sigma_px):
        return best, f"the other fits to {other_px:.2f} px"
    # a camera may be mounted upside down: that decides only where nothing else does
    standing = [upright(wTc) for wTc, _ in above]
    if sorted(standing) == [-1, 1]:
        return above[int(np.argmax(standing))][0], "the only one that is not upside down, of two that fit as well"
    raise DiorError(
        f"{where}: two poses fit the tag, to {best_px:.2f} and {other_px:.2f} px, "
        f"{np.linalg.norm(best[:3, 3] - other[:3, 3]):.2f} m and {angle_deg(best[:3, :3], other[:3, :3]):.0f} "
        "degrees apart; put the tag nearer to the camera or turn it away by 30 degrees, or use `locate: tape`"
    )


def uncertainty(camera: Camera, wTm: Floats, size_m: float, sigma_px: float) -> tuple[float, float]:
    """1 sigma of the position (m) and of the rotation (degrees) of a placed camera, from corners with `sigma_px`."""
    from scipy.linalg import block_diag

    points = marker_points(size_m) @ wTm[:3, :3].T + wTm[:3, 3]
    _, by_camera = covariance.projection(camera, points)
    J = by_camera.reshape(-1, 6)
    # from turns about the camera's axes to turns about the world's
    spread = block_diag(camera.wRc, np.eye(3)) @ np.linalg.inv(J.T @ J) @ block_diag(camera.wRc, np.eye(3)).T
    variance = sigma_px**2 * np.diag(spread)
    return float(np.sqrt(variance[3:].max())), float(np.degrees(np.sqrt(variance[:3].max())))


def place(
    camera: Camera, tag: dict[str, Any], frames: AnyPath, data_root: AnyPath, tape: dict[str, Any] | None, where: str
) -> tuple[Floats, list[tuple[str, str, str]], dict[str, Any]]:
    """wTc (4, 4) of `camera` from the tag in its pictures, findings [(severity, code, text)] and columns of `marks`.

    At most 40 pictures of the table `frames`, evenly spread, are looked at; the corners of those in which the tag is
    where it mostly is are averaged. `tape`, the YAML's section or None, is only compared with. Raises DiorError where
    no picture shows the tag or the pose is ambiguous. The marks have a row for each corner on each picture; `inlier`
    are those of the pictures that were averaged.
    """
    seen, shown, looked_at = _detections(camera, tag, frames, data_root, where)
    if not len(seen):
        raise DiorError(
            f"{where}: tag {tag['id']} of {tag['family']} is in none of the {looked_at} pictures of sequence "
            f"{Path(frames).stem} that were looked at; is it the right id, wholly in view, with a white margin? A tag "
            "of 40 cm flat on the floor is not found beyond 4 m at fx 640: put it upright, nearer, or print it larger"
        )
    steady = still(seen)
    kept = seen[steady]
    if len(kept) < len(seen) / 2:
        raise DiorError(
            f"{where}: tag {tag['id']} lies still in {len(kept)} of the {len(seen)} pictures that show it; name a "
            "`tag.sequence` in session.yaml in which neither the tag nor the camera moves"
        )
    corners = kept.mean(axis=0)
    sigma_px = max(CORNER_SIGMA_PX, _noise_px(kept))
    wTm = tag_pose(tag, where)
    found = solutions(camera, corners, tag["size_m"])
    wTc, why = choose(found, wTm, sigma_px, where)
    placed = camera.at(wTc, "apriltag")
    points = world_points(tag, where)
    predicted = project(placed, points)[0]
    rms_px = float(np.sqrt(np.mean(np.sum((predicted - corners) ** 2, axis=1))))
    sigma_m, sigma_deg = uncertainty(placed, wTm, tag["size_m"], max(sigma_px, rms_px))
    marks = {
        "sequence": [Path(frames).stem] * (4 * len(seen)),
        "frame": np.repeat(shown, 4),
        "joint": [f"tag_{tag['id']}_{corner}" for corner in CORNERS] * len(seen),
        **dict(zip("uv", seen.reshape(-1, 2).T, strict=True)),
        **dict(zip("xyz", np.tile(points, (len(seen), 1)).T, strict=True)),
        "residual_px": np.linalg.norm(seen - predicted, axis=-1).ravel(),
        "inlier": np.repeat(steady, 4),
    }
    away = np.linalg.norm(wTc[:3, 3] - wTm[:3, 3])
    text = (
        f"placed by tag {tag['id']} in {len(kept)} of {looked_at} pictures, {away:.2f} m away, rms {rms_px:.2f} px; of "
        f"two poses {why}; position to {100 * sigma_m:.1f} cm and {sigma_deg:.2f} degrees by the tag alone"
    )
    findings = [("info", "pose_from_tag", text)]
    if sigma_m > USUAL_SIGMA_M:
        text = f"the tag gives the position only to {100 * sigma_m:.0f} cm; put it nearer or print it larger"
        findings.append(("warning", "tag_far", text))
    if len(kept) < len(seen):
        text = (
            f"the tag is elsewhere, or hidden in part, in {len(seen) - len(kept)} of {len(seen)} pictures that show it"
        )
        findings.append(("info", "tag_moved", text))
    return wTc, findings + _against_tape(wTc, tape, sigma_m), marks


def _detections(
    camera: Camera, tag: dict[str, Any], frames: AnyPath, data_root: AnyPath, where: str
) -> tuple[Floats, Ints, int]:
    """Corners (F, 4, 2) px of the tag where it is found, on which frames (F,), and how many pictures were looked at."""
    from dior.ingest import bags

    rows = tables.of_camera(tables.read(frames, "frames"), camera.name)
    count = len(rows["frame"])
    if not count:
        raise DiorError(f"{where}: {frames} has no picture of {camera.name}")
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_FRAMES)).round().astype(int))
    rows = {key: values[chosen] for key, values in rows.items()}
    detect, found = detector(FAMILIES[tag["family"]]), {}
    for row, picture in reporting(bags.read_pictures(rows, data_root), len(rows["frame"]), "pictures", where):
        corners = detect(picture).get(tag["id"])
        if corners is not None:
            found[row] = corners
    shown = sorted(found)
    return np.array([found[row] for row in shown]).reshape(-1, 4, 2), rows["frame"][shown], len(chosen)


def _noise_px(corners: Floats) -> float:
    """Spread (px) of a corner's coordinate over the detections (F, 4, 2), robust."""
    return float(1.4826 * np.median(np.abs(corners - np.median(corners, axis=0))))


def _against_tape(wTc: Floats, tape: dict[str, Any] | None, sigma_m: float) -> list[tuple[str, str, str]]:
    """A warning where the tape disagrees: the tag's `up` may be a quarter turn wrong, which nothing else shows."""
    if not tape:
        return []
    away = float(np.linalg.norm(wTc[:3, 3] - tape["position_m"]))
    limit = 4 * float(np.hypot(tape.get("sigma_m", USUAL_SIGMA_M), sigma_m))
    if away <= limit:
        return []
    text = (
        f"the tag puts the camera {away:.2f} m away from tape.position_m, more than {limit:.2f} m; check tag.up, "
        "tag.position_m and tag.size_m in session.yaml"
    )
    return [("warning", "tag_against_tape", text)]
