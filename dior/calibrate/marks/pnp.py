"""What a pose from hand marks is worth: its other solution, its covariance, the mark that is wrong, the one to add.

INPUTS   a refined pose with its Jacobian (2N, 6 or more) and residuals (N, 2) px of N marks
OUTPUTS  numbers and sentences for `locate`
World in metres, Z up, floor at Z = 0; recorded pixels. A pose's error is that of `dior.geometry.covariance`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dior.arrays import Floats, Ints, Texts
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import covariance

# chosen: how well people click before anything is seen, worth as many coordinates
CLICK_SD_PX, CLICK_WORTH = 1.5, 4.0
# chosen: marks are nearly planar where their thickness is below this share of their smaller extent in the plane
FLAT = 0.25
OTHER_DEG = 3.0  # chosen: poses nearer than that are one
CLEARLY_WORSE = 20.0  # chosen, chi2: at even odds the other solution is 20 000 times less likely (e^10)
CLEARLY_UP = (
    0.5  # chosen: of the vertical, in the picture's v axis: rolled by less than 60 degrees, or by more than 120
)
SUSPECT = 0.01  # chosen: chance that the worst of all good marks looks as bad


# refines a camera's pose to points and pixels: wTc (4, 4) and its Jacobian
Refine: TypeAlias = Callable[[cam.Camera, Floats, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True, eq=False)
class Mark:
    """A marker that could be marked: `sequence`, `frame`, `joint`, its place `xyz` (3,) m."""

    sequence: str
    frame: int
    joint: str
    xyz: Floats


def variance(residual: Floats, free: int) -> float:
    """Variance px^2 of a coordinate from residuals (..., ) with so many degrees of freedom, and the usual click's."""
    return (CLICK_WORTH * CLICK_SD_PX**2 + (residual**2).sum()) / (CLICK_WORTH + max(free, 0))


def pose_covariance(
    J: Floats, residual: Floats, joint: Ints | Texts | None = None, frame: Ints | Texts | None = None
) -> Floats:
    """(P, P) from the Jacobian (2N, P) by the pose and what was found with it, and the residuals (N, 2) px.

    Marks of one `joint` (N,) share the error of the marker's place on the body, marks of one `frame` (N,) that of the
    clock: what their residuals have in common widens the result.
    """
    free = residual.size - J.shape[1]
    grown = 1.0
    total = (residual**2).sum()
    for group in (joint, frame):
        if group is None or free <= 0 or total < 1e-12:
            continue
        alike = np.equal.outer(np.asarray(group), np.asarray(group))
        np.fill_diagonal(alike, False)
        grown += max(0.0, float((alike[..., None] * residual[:, None] * residual[None]).sum() / total))
    return np.asarray(variance(residual, free) * grown * np.linalg.inv(J.T @ J), float)


def other_solution(camera: cam.Camera, xyz: Floats, uv: Floats, refine: Refine) -> Floats | None:
    """The second pose (4, 4) that nearly planar marks may have, refined by `refine(camera, xyz, uv)`; None if none.

    Points in a plane look nearly alike from two sides (Schweighofer and Pinz 2006, IPPE: Collins and Bartoli 2014).
    """
    import cv2

    middle = xyz.mean(axis=0)
    _, extent, axes = np.linalg.svd(xyz - middle)
    if len(xyz) < 4 or extent[2] > FLAT * extent[1]:
        return None
    axes = axes * np.array([1.0, 1.0, np.linalg.det(axes)])[:, None]
    flat = (xyz - middle) @ axes.T * (1, 1, 0)
    ideal = cam.undistort(camera.intrinsics, uv)
    count, rotations, translations, _ = cv2.solvePnPGeneric(flat, ideal, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    for rotation, translation in list(zip(rotations, translations, strict=True))[:count]:
        cTp = cam.pose(cv2.Rodrigues(rotation)[0], translation.ravel())
        pTw = cam.pose(axes, -axes @ middle)
        wTc = cam.inverse_pose(cTp @ pTw)
        if not np.isfinite(wTc).all():
            continue
        found = refine(camera.at(wTc), xyz, uv)[0]
        if cam.angle_deg(found[:3, :3], camera.wRc) > OTHER_DEG:
            return found
    return None


def impossible(camera: cam.Camera, xyz: Floats) -> str:
    """Why a camera cannot stand there, or ""."""
    if not camera.centre[2] > 0:
        return "below the floor"
    if (cam.project(camera, xyz)[1] <= 0).any():
        return "with marks behind it"
    return ""


def upright(wTc: Floats) -> int:
    """1 for a camera whose pictures have up above, -1 for one that is upside down, 0 for one on its side or that looks
    up or down. Any of them may be mounted so: it only breaks ties.
    """
    down = -float(wTc[2, 1])
    return 0 if abs(down) < CLEARLY_UP else int(np.sign(down))


def decide(camera: cam.Camera, other: Floats | None, xyz: Floats, uv: Floats, where: str) -> tuple[Floats, str]:
    """The pose (4, 4) to take of `camera.wTc` and `other` (4, 4) or None, and what to say of the second, or "".

    Raises DiorError where both fit and nothing tells which.
    """
    if other is None:
        return camera.wTc, ""
    first, second = camera, camera.at(other)
    misses = [np.nan_to_num(cam.project(c, xyz)[0] - uv, nan=1e3) for c in (first, second)]
    chi2 = [(miss**2).sum() for miss in misses]
    if chi2[1] < chi2[0] and not impossible(second, xyz):
        first, second, misses, chi2 = second, first, misses[::-1], chi2[::-1]
    worse = (chi2[1] - chi2[0]) / variance(misses[0], misses[0].size - 6)
    rms = [np.sqrt((miss**2).mean()) for miss in misses]
    distance, angle = np.linalg.norm(first.centre - second.centre), cam.angle_deg(first.wRc, second.wRc)
    apart = f"{distance:.1f} m and {angle:.0f} degrees away"
    reasons = [impossible(c, xyz) for c in (first, second)]
    if reasons[1]:
        return first.wTc, f"the marks are nearly in a plane; the other pose that fits, {apart}, is {reasons[1]}"
    if worse > CLEARLY_WORSE and not reasons[0]:
        text = f"the marks are nearly in a plane; the other pose, {apart}, fits clearly worse"
        return first.wTc, f"{text} ({rms[1]:.2f} px rms, not {rms[0]:.2f})"
    if reasons[0]:
        return second.wTc, f"the marks are nearly in a plane; a pose that fits as well, {apart}, is {reasons[0]}"
    standing = upright(first.wTc), upright(second.wTc)
    if sorted(standing) == [-1, 1]:
        taken = first if standing[0] == 1 else second
        return taken.wTc, f"the marks are nearly in a plane; a pose that fits as well, {apart}, is upside down"
    raise DiorError(
        f"{where}: the marks are nearly in a plane and two poses fit ({rms[0]:.2f} and {rms[1]:.2f} px rms, {apart}); "
        "mark a point that is well outside of the plane"
    )


def suspect(J: Floats, residual: Floats) -> tuple[int, float, float] | None:
    """The mark that the others contradict most: its index, distance px from where they put it, shift (m) of the camera.

    `J` (2N, P), the pose first. None if no mark stands out. Deletion residuals by the hat matrix, tested against the
    noise of the others with the number of marks taken into account (Cook and Weisberg 1982, 2.2.1).
    """
    from scipy.special import fdtrc

    count = len(residual)
    free = 2 * count - J.shape[1] - 2
    if free < 1:
        return None
    inverse = np.linalg.inv(J.T @ J)
    each = J.reshape(count, 2, -1)
    left = np.linalg.inv(np.eye(2) - each @ inverse @ np.swapaxes(each, -1, -2))
    without = np.einsum("nij,nj->ni", left, residual)
    drop = np.einsum("ni,ni->n", residual, without)
    noise = (CLICK_WORTH * CLICK_SD_PX**2 + (residual**2).sum() - drop) / (CLICK_WORTH + free)
    worst = int(np.argmax(drop / noise))
    chance = fdtrc(2, CLICK_WORTH + free, drop[worst] / 2 / noise[worst])
    if chance * count > SUSPECT:
        return None
    step = inverse @ each[worst].T @ without[worst]
    return worst, float(np.linalg.norm(without[worst])), float(np.linalg.norm(step[3:6]))


def best_next(
    camera: cam.Camera, spread: Floats, sd_px: float, candidates: Sequence[Mark], places: Floats
) -> tuple[Mark, float, float] | None:
    """Of `candidates` (`Mark`s) the one that helps the labels at `places` (P, 3) most: it, sigma before and after.

    sigma: root of the mean variance px^2 of a label's coordinate, by the covariance (6, 6) `spread` of the camera.
    None if there is no candidate.
    """
    if not candidates:
        return None
    _, J = covariance.projection(camera, np.stack([mark.xyz for mark in candidates]))
    _, at = covariance.projection(camera, places)
    at = at[np.isfinite(at).all(axis=(1, 2))].reshape(-1, 6)
    # C' = C - C J' (J C J' + s^2)^-1 J C
    CJ = spread @ np.swapaxes(J, -1, -2)
    gain = CJ @ np.linalg.inv(J @ CJ + sd_px**2 * np.eye(2)) @ np.swapaxes(CJ, -1, -2)
    weight = at.T @ at / len(at)
    lower = np.einsum("nij,ji->n", gain, weight)
    best = int(np.nanargmax(lower))
    before = np.trace(spread @ weight)
    return candidates[best], float(np.sqrt(before)), float(np.sqrt(max(before - lower[best], 0.0)))
