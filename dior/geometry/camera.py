"""The camera model: intrinsics, lens distortion, pose, and the project's only projection.

World: metres, right-handed, Z up. Camera axes as in OpenCV: x right, y down, z forward.
Pixel (0, 0) is the centre of the top-left pixel. `wTc` is the pose of the camera in the world.
Missing points are NaN and stay NaN.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats
from dior.errors import DiorError
from dior.project.pixels import in_picture

# chosen: thresholds in pixels are given for this focal length (of a 1080p camera) and scaled to the camera's own
REFERENCE_FX = 1680.0
BLOCK = 8192  # points at once: they stay in the cache of a processor, which makes Newton's steps three times as fast
MODELS = ("plumb_bob", "rational_polynomial", "inverse_brown_conrady")


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole and lens of a camera for one picture size.

    `distortion` holds k1 k2 p1 p2 k3 (k4 k5 k6), zeros where the source gave fewer. `plumb_bob` and
    `rational_polynomial` map ideal to recorded coordinates (OpenCV's calib3d documentation);
    `inverse_brown_conrady` is the same polynomial from recorded to ideal (librealsense, rs2_deproject_pixel_to_point).
    `sigma`: 1 sigma of the focal length and of cx and cy, all relative to the focal length.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: str = "plumb_bob"
    distortion: tuple[float, ...] = (0.0,) * 8
    sigma: float = 0.0

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise DiorError(f"distortion model '{self.model}' is not one of {', '.join(MODELS)}")
        if len(self.distortion) > 8:
            raise DiorError(f"{len(self.distortion)} distortion coefficients: at most 8 are understood")
        padded = tuple(float(k) for k in self.distortion) + (0.0,) * (8 - len(self.distortion))
        object.__setattr__(self, "distortion", padded)

    @property
    def K(self) -> Floats:
        """Camera matrix (3, 3), px."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera of a session. `wTc` (4, 4): pose of the camera in the world, m; None while unknown.

    `occluded`: the part of a person that something hides in all of its pictures, below or above; "" for nothing.
    """

    name: str
    intrinsics: Intrinsics
    # only between the steps intrinsics and place is there none; what reads placed cameras refuses it (`read_placed`)
    wTc: Floats = None  # type: ignore[assignment]
    role: str = "close"
    locate: str = ""
    occluded: str = ""

    @property
    def wRc(self) -> Floats:
        return self.wTc[:3, :3]

    @property
    def centre(self) -> Floats:
        """Position of the camera in the world (3,), m."""
        return self.wTc[:3, 3]

    def at(self, wTc: ArrayLike, locate: str = "") -> "Camera":
        """The same camera at another pose."""
        return replace(self, wTc=np.asarray(wTc, float), locate=locate or self.locate)


def occluded_edge(camera: Camera) -> int | None:
    """Which of u_min, v_min, u_max, v_max lies towards what is `occluded` of a body, below or above in the world."""
    if not camera.occluded:
        return None
    down = -camera.wRc[2, :2] * (1 if camera.occluded == "below" else -1)
    axis = int(abs(down[1]) >= abs(down[0]))
    return axis + 2 * int(down[axis] > 0)


def pose(wRc: ArrayLike, centre: ArrayLike) -> Floats:
    """wTc (4, 4) from rotation (3, 3) and centre (3,)."""
    wTc = np.eye(4)
    wTc[:3, :3], wTc[:3, 3] = wRc, centre
    return wTc


def inverse_pose(T: Floats) -> Floats:
    """Inverse of a rigid transform (4, 4): cTw from wTc and back."""
    R, t = T[:3, :3], T[:3, 3]
    return pose(R.T, -R.T @ t)


def angle_deg(R: Floats, S: Floats) -> float:
    """Angle (degrees) of the turn between two rotations (3, 3)."""
    return float(np.degrees(np.arccos(np.clip((np.trace(R.T @ S) - 1) / 2, -1, 1))))


def _polynomial(distortion: tuple[float, ...], xy: Floats) -> Floats:
    """Brown-Conrady with rational radial part: normalised (..., 2) to normalised (..., 2)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = distortion
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def _polynomial_slopes(distortion: tuple[float, ...], xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Derivative of `_polynomial`: of x by x, of either by the other, which are the same, and of y by y, each (...)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = distortion
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    top, bottom = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = top / bottom
    slope = ((k1 + r2 * (2 * k2 + r2 * 3 * k3)) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / bottom
    return (
        radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x,
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y,
        radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x,
    )


def _polynomial_inverse(distortion: tuple[float, ...], xy: Floats, iterations: int = 20) -> Floats:
    """Solve `_polynomial(z) = xy` for z by Newton's method; NaN where it does not converge to 1e-9.

    A lens polynomial folds over outside the picture: there the determinant of its Jacobian changes sign, and a
    solution beyond the fold is not the lens. It is NaN, too.
    """
    flat = xy.reshape(-1, 2)
    out = np.empty(flat.shape)
    for start in range(0, len(flat), BLOCK):
        out[start : start + BLOCK] = _inverse_of_block(distortion, flat[start : start + BLOCK], iterations)
    return out.reshape(xy.shape)


def _inverse_of_block(distortion: tuple[float, ...], xy: Floats, iterations: int) -> Floats:
    """`_polynomial_inverse` of points (N, 2)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = distortion
    goal_x, goal_y = (np.ascontiguousarray(xy[:, i]) for i in range(2))
    x, y = goal_x.copy(), goal_y.copy()
    last = np.inf
    with np.errstate(all="ignore"):
        for _ in range(iterations + 1):
            r2 = x * x + y * y
            top, bottom = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
            radial = top / bottom
            px, py = 2 * p1 * x + 2 * p2 * y, 2 * p1 * y + 2 * p2 * x
            miss_x = x * radial + p1 * (2 * x * y) + p2 * (r2 + 2 * x * x) - goal_x
            miss_y = y * radial + p1 * (r2 + 2 * y * y) + p2 * (2 * x * y) - goal_y
            if last <= 1e-12:
                break
            slope = ((k1 + r2 * (2 * k2 + r2 * 3 * k3)) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / bottom
            xx, yy = radial + 2 * x * x * slope + py + 4 * p2 * x, radial + 2 * y * y * slope + 4 * p1 * y + py
            cross = 2 * x * y * slope + px
            det = xx * yy - cross * cross
            step_x, step_y = (yy * miss_x - cross * miss_y) / det, (xx * miss_y - cross * miss_x) / det
            x -= np.clip(step_x, -0.5, 0.5)
            y -= np.clip(step_y, -0.5, 0.5)
            last = np.nanmax(np.abs([step_x, step_y]), initial=0.0)
        wrong = ~(np.maximum(np.abs(miss_x), np.abs(miss_y)) < 1e-9)
    z = np.stack([x, y], axis=-1)
    return np.where((wrong | folded(distortion, z))[:, None], np.nan, z)


def folded(distortion: tuple[float, ...], xy: Floats) -> Bools:
    """Whether normalised points (..., 2) lie beyond the first fold of the lens polynomial.

    The fold is where d(r f(r))/dr first reaches zero along the ray; tangential terms are too small to matter.
    """
    limit = _fold(tuple(distortion))
    with np.errstate(invalid="ignore"):
        return np.hypot(xy[..., 0], xy[..., 1]) >= limit


@cache
def _fold(distortion: tuple[float, ...]) -> float:
    """Normalised radius of the first fold, inf where there is none up to 5."""
    radii = np.linspace(0.0, 5.0, 2001)
    along = np.stack([radii, np.zeros_like(radii)], axis=-1)
    radial_only = (*distortion[:2], 0.0, 0.0, *distortion[4:])
    bad = _polynomial_slopes(radial_only, along)[0] <= 0
    return radii[np.argmax(bad)] if bad.any() else np.inf


def distort(intrinsics: Intrinsics, xy: ArrayLike) -> Floats:
    """Ideal normalised coordinates (..., 2) to recorded pixels (..., 2); NaN beyond the lens polynomial's fold."""
    xy = np.asarray(xy, float)
    if not any(intrinsics.distortion):
        return xy * (intrinsics.fx, intrinsics.fy) + (intrinsics.cx, intrinsics.cy)
    if intrinsics.model == "inverse_brown_conrady":
        recorded = _polynomial_inverse(intrinsics.distortion, xy)
    else:
        beyond = folded(intrinsics.distortion, xy)[..., None]
        recorded = np.where(beyond, np.nan, _polynomial(intrinsics.distortion, xy))
    return recorded * (intrinsics.fx, intrinsics.fy) + (intrinsics.cx, intrinsics.cy)


def slopes(intrinsics: Intrinsics, xy: Floats, uv: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Derivatives px of recorded pixels uv (2, ...) by the ideal coordinates xy (..., 2) that they show.

    A pair of u, by x and by y, and one of v.
    """
    xx, across, yy = np.ones(xy.shape[:-1]), np.zeros(xy.shape[:-1]), np.ones(xy.shape[:-1])
    if any(intrinsics.distortion) and intrinsics.model == "inverse_brown_conrady":
        recorded = np.stack([(uv[0] - intrinsics.cx) / intrinsics.fx, (uv[1] - intrinsics.cy) / intrinsics.fy], axis=-1)
        a, b, c = _polynomial_slopes(intrinsics.distortion, recorded)
        det = a * c - b * b
        xx, across, yy = c / det, -b / det, a / det
    elif any(intrinsics.distortion):
        xx, across, yy = _polynomial_slopes(intrinsics.distortion, xy)
    return (intrinsics.fx * xx, intrinsics.fx * across), (intrinsics.fy * across, intrinsics.fy * yy)


def undistort(intrinsics: Intrinsics, uv: ArrayLike) -> Floats:
    """Recorded pixels (..., 2) to ideal normalised coordinates (..., 2)."""
    uv = np.asarray(uv, float)
    # one axis at a time: numpy is slow along an axis of two
    xy = np.empty(uv.shape)
    xy[..., 0] = (uv[..., 0] - intrinsics.cx) / intrinsics.fx
    xy[..., 1] = (uv[..., 1] - intrinsics.cy) / intrinsics.fy
    if not any(intrinsics.distortion):
        return xy
    if intrinsics.model == "inverse_brown_conrady":
        return np.where(folded(intrinsics.distortion, xy)[..., None], np.nan, _polynomial(intrinsics.distortion, xy))
    return _polynomial_inverse(intrinsics.distortion, xy)


def project(camera: Camera, points: ArrayLike) -> tuple[Floats, Floats]:
    """World points (..., 3) m to recorded pixels (..., 2) and depths (...,) m.

    `p = K wRc^T (P - t)` with distortion (paper, equation 1). Pixels are NaN behind the camera and where the lens
    model has no answer; the depth is given in either case. Pixels outside the picture are given as they are.
    """
    in_camera = (np.asarray(points, float) - camera.centre) @ camera.wRc
    depth = in_camera[..., 2]
    with np.errstate(all="ignore"):
        xy = np.where(depth[..., None] > 0, in_camera[..., :2] / depth[..., None], np.nan)
    return distort(camera.intrinsics, xy), depth


def reprojection_errors(cameras: Sequence[Camera], points: Floats, uv: Floats) -> Floats:
    """Distances (V, ...) px between recorded pixels uv (V, ..., 2) and the projections of points (..., 3)."""
    return np.linalg.norm(np.stack([project(c, points)[0] for c in cameras]) - uv, axis=-1)


def in_frame(intrinsics: Intrinsics, uv: Floats) -> Bools:
    """Whether pixels (..., 2) lie in the camera's picture."""
    return in_picture(uv, intrinsics.width, intrinsics.height)


def rays(camera: Camera, uv: ArrayLike) -> Floats:
    """Unit directions (..., 3) in the world of recorded pixels (..., 2); the origin of each is `camera.centre`."""
    xy = undistort(camera.intrinsics, uv)
    direction = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
    return (direction / np.linalg.norm(direction, axis=-1, keepdims=True)) @ camera.wRc.T


def unproject(camera: Camera, uv: Floats, depth: ArrayLike) -> Floats:
    """World points (..., 3) m of recorded pixels uv (..., 2) at depths (...,) m: what `project` was given."""
    in_camera = np.concatenate([undistort(camera.intrinsics, uv), np.ones((*uv.shape[:-1], 1))], axis=-1)
    return (in_camera * np.asarray(depth, float)[..., None]) @ camera.wRc.T + camera.centre


def check_picture_size(intrinsics: Intrinsics, width: int, height: int, where: str) -> None:
    """Refuse pictures of another size than the intrinsics were made for."""
    if (intrinsics.width, intrinsics.height) != (int(width), int(height)):
        raise DiorError(
            f"{where}: the pictures are {width}x{height} but the intrinsics are for "
            f"{intrinsics.width}x{intrinsics.height}; use the intrinsics of the recorded resolution"
        )
