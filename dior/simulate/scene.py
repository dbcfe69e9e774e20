"""What stands around the walkway: cameras, their true poses, and what the tape and the bag say about them.

World: metres, Z up, origin in the middle of the walkway. The projection here is the simulator's own, apart from
`dior.geometry.camera.project`, so that a mistake in one shows against the other.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at_angles, rotation_x, rotation_z
from dior.simulate.settings import CAMERAS, SESSIONS, Settings, generator, place_of

LONG_RANGE = "cam04"
# chosen: azimuth (degrees) and distance (m) from the middle of the walkway; the long-range camera is on the Y axis
PLACES: dict[str, dict[str, tuple[float, float | None]]] = {
    "lab": {"cam01": (38, 4.5), "cam02": (142, 4.6), "cam03": (-141, 4.5), "cam04": (-37, 4.7)},
    "field": {"cam01": (32, 4.7), "cam02": (150, 4.6), "cam03": (-92, 4.8), "cam04": (90, None)},
}
# a wall between the walkway and the long-range camera: from 60 m away it hides a body up to the hips
WALL_Y, WALL_HALF_M, WALL_TOP_M = 6.0, 5.0, 0.98


@dataclass(frozen=True)
class Placed:
    """A camera as it stands, and what a person measured of it. `tape` and `target` (3,), m."""

    camera: Camera
    tape: tuple[float, ...]
    target: tuple[float, ...]
    sigma: float


def cameras_of(settings: Settings, session: str) -> dict[str, Placed]:
    """The cameras of a session by name, as `Placed`."""
    return {name: _placed(settings, session, name) for name in CAMERAS}


def _placed(settings: Settings, session: str, name: str) -> Placed:
    draw = generator(settings, "camera", session, name)
    far = place_of(session) == SESSIONS["outdoor"] and name == LONG_RANGE
    scale = settings.width / 1280
    fx = (settings.long_range_fx if far else settings.fx) * (1 + 0.004 * draw.standard_normal())
    fy = fx * (1 + 0.0008 * draw.standard_normal())
    cx = (settings.width - 1) / 2 + 4.0 * scale * draw.standard_normal()
    cy = (settings.height - 1) / 2 + 3.0 * scale * draw.standard_normal()
    lens = np.array([-0.055, 0.064, -0.0006, 0.0006, -0.020]) + draw.standard_normal(5) * (
        0.001,
        0.001,
        0.0002,
        0.0002,
        0.0005,
    )
    fx, fy, cx, cy = (round(float(x), 4) for x in (fx, fy, cx, cy))
    distortion = tuple(round(float(k), 6) for k in lens)
    intrinsics = Intrinsics(settings.width, settings.height, fx, fy, cx, cy, "plumb_bob", distortion)

    azimuth, distance = PLACES[place_of(session)][name]
    distance = settings.long_range_m if far else distance
    angle = np.deg2rad(azimuth + (0.0 if far else 2.0 * draw.standard_normal()))
    height = 1.5 + 0.05 * draw.standard_normal() + (0.4 if far else 0.0)
    centre = np.array([distance * np.cos(angle), distance * np.sin(angle), height]).round(4)
    target = (0.0, 0.0, 1.0)
    aim = np.deg2rad(0.4 if far else settings.aim_sd_deg)
    a, e = look_at_angles(centre, target) + np.clip(draw.standard_normal(2), -1.5, 1.5) * aim * (1.0, 0.6)
    roll = np.deg2rad(0.1 if far else 0.7) * draw.standard_normal()
    roll += np.deg2rad(settings.roll_deg) * (name in settings.rolled)
    wTc = pose(rotation_z(a) @ rotation_x(e) @ rotation_z(roll), centre)

    sigma = np.full(3, settings.tape_sigma_m)
    if far:
        sigma[1] = settings.long_range_tape_sigma_m
    tape = tuple(float(x) for x in (centre + sigma * draw.standard_normal(3)).round(3))
    role = "long_range" if far else "close"
    return Placed(Camera(name, intrinsics, wTc, role, "simulated"), tape, target, float(sigma.max()))


def in_picture(lens: Intrinsics, uv: Floats) -> Bools:
    """Whether pixels (..., 2) lie in the picture: (...,) bool."""
    with np.errstate(invalid="ignore"):
        u, v = uv[..., 0], uv[..., 1]
        return (u >= -0.5) & (u < lens.width - 0.5) & (v >= -0.5) & (v < lens.height - 0.5)


def behind_wall(settings: Settings, camera: Camera, points: Floats) -> Bools:
    """Whether world points (..., 3) are hidden behind the wall of the field from a camera: (...,) bool."""
    if not settings.occluder:
        return np.zeros(points.shape[:-1], bool)
    eye = camera.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (WALL_Y - eye[1]) / (points[..., 1] - eye[1])
        at = eye + share[..., None] * (points - eye)
    return (share > 0) & (share < 1) & (np.abs(at[..., 0]) < WALL_HALF_M) & (at[..., 2] < WALL_TOP_M)


def reported(settings: Settings, session: str, camera: Camera) -> Intrinsics:
    """The intrinsics in CameraInfo: those of a `Camera`, wrong by `intrinsics_error` of the focal length.

    The focal length is too long or too short, the principal point is off by as much in some direction.
    """
    lens = replace(camera.intrinsics, sigma=settings.intrinsics_error)
    if not settings.intrinsics_error:
        return lens
    draw = generator(settings, "camera_info", session, camera.name)
    factor = 1 + settings.intrinsics_error * (1 if draw.random() < 0.5 else -1)
    off, angle = settings.intrinsics_error * lens.fx, draw.uniform(0, 2 * np.pi)
    numbers = (lens.fx * factor, lens.fy * factor, lens.cx + off * np.cos(angle), lens.cy + off * np.sin(angle))
    fx, fy, cx, cy = (round(float(x), 4) for x in numbers)
    return replace(lens, fx=fx, fy=fy, cx=cx, cy=cy)


def project(camera: Camera, points: ArrayLike) -> tuple[Floats, Floats]:
    """World points (..., 3) to pixels (..., 2) and depths (...,): pinhole and Brown-Conrady, five coefficients."""
    points = np.asarray(points, float)
    R, c, lens = camera.wRc, camera.centre, camera.intrinsics
    X, Y, Z = ((points - c) @ R[:, i] for i in range(3))
    ahead = Z > 0.05
    x, y = X / np.where(ahead, Z, np.nan), Y / np.where(ahead, Z, np.nan)
    k1, k2, p1, p2, k3 = lens.distortion[:5]
    r2 = x**2 + y**2
    scale = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = lens.fx * (x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)) + lens.cx
    v = lens.fy * (y * scale + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y) + lens.cy
    # the polynomial turns back beyond a radius that no picture reaches
    return np.where((r2 < 4.0)[..., None], np.stack([u, v], axis=-1), np.nan), Z
