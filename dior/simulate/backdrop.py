"""What a picture shows without the people: a room, or a field under the sky; with a wall and the sun where asked for.

Pixel (0, 0) is the centre of the top-left pixel.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats
from dior.geometry.camera import Camera, Intrinsics
from dior.simulate.scene import WALL_HALF_M, WALL_TOP_M, WALL_Y
from dior.simulate.settings import Settings, generator

# half as much memory as float64, and a backdrop is no measurement
Rays: TypeAlias = NDArray[np.float32]
# chosen: azimuth and elevation; from the long-range camera a little above the walkway and beside it
SUN_DEG = (-78.0, 8.0)
# chosen: a disc as large as an overexposed sun is in a picture
SUN_RADIUS_DEG, SUN_GLARE_DEG = 1.6, 2.5
WALL_BGR = (105.0, 120.0, 150.0)


def background(settings: Settings, camera: Camera, environment: str) -> NDArray[np.uint8]:
    """The picture (height, width, 3) uint8 without the person: a room, or a field under the sky."""
    import cv2

    lens = camera.intrinsics
    ray = _rays(lens, camera)
    eye = camera.centre.astype(np.float32)
    colour = _room(ray, eye, lens.fx) if environment == "indoor" else _field(ray, eye, lens.fx)
    if environment == "outdoor" and settings.sun:
        colour = _shining(colour, ray)
    if environment == "outdoor" and settings.occluder:
        colour = np.where(_wall(ray, eye)[..., None], WALL_BGR, colour)
    noise = generator(settings, "texture", environment, camera.name).standard_normal((lens.height // 24, 54, 1))
    colour = colour + 2.0 * cv2.resize(noise.astype(np.float32), (lens.width, lens.height))[..., None]
    return np.clip(colour, 0, 255).astype(np.uint8)


def in_front(settings: Settings, camera: Camera, environment: str) -> Bools | None:
    """Pixels (height, width, 1) bool in which the wall hides everybody, or None where there is none."""
    if environment == "indoor" or not settings.occluder or camera.centre[1] < WALL_Y:
        return None
    return _wall(_rays(camera.intrinsics, camera), camera.centre.astype(np.float32))[..., None]


def _rays(lens: Intrinsics, camera: Camera) -> Rays:
    """Directions (height, width, 3) in the world of a camera's pixels."""
    import cv2

    step = 8
    u, v = np.meshgrid(np.arange(0, lens.width + step, step), np.arange(0, lens.height + step, step))
    seen = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy], axis=-1).astype(float)
    k1, k2, p1, p2, k3 = lens.distortion[:5]
    xy = seen.copy()
    for _ in range(12):
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        bent = np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=-1)
        xy = (seen - bent) / (1 + r2 * (k1 + r2 * (k2 + r2 * k3)))[..., None]
    ray = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1) @ camera.wRc.T
    high, wide = ray.shape[:2]
    fine = cv2.resize(ray.astype(np.float32), (wide * step, high * step), interpolation=cv2.INTER_LINEAR)
    # resize puts sample (i, j) at pixel centre step (i + 1/2) - 1/2
    half = step // 2
    return fine[half : half + lens.height, half : half + lens.width].astype(np.float32, copy=False)


def _wall(ray: Rays, eye: Rays) -> Bools:
    """Rays (..., 3) that meet the wall of the field."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (WALL_Y - eye[1]) / ray[..., 1]
        x, z = eye[0] + t * ray[..., 0], eye[2] + t * ray[..., 2]
        return (t > 0) & (np.abs(x) < WALL_HALF_M) & (z > 0) & (z < WALL_TOP_M)


def _shining(colour: Floats, ray: Rays) -> Floats:
    """The saturated disc of the sun and its glare."""
    ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    azimuth, elevation = np.deg2rad(SUN_DEG)
    towards = (np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation))
    away = np.rad2deg(np.arccos(np.clip(ray @ np.array(towards), -1, 1)))
    glare = 255.0 * np.exp(-np.maximum(away - SUN_RADIUS_DEG, 0.0) / SUN_GLARE_DEG)
    return colour + glare[..., None]


def _ground(ray: Rays, eye: Rays, fx: float) -> tuple[Floats, Floats, Floats, Bools]:
    """Where rays meet the floor: x, y (m), the distance and whether they do."""
    down = ray[..., 2] < -1e-3
    t = np.where(down, -eye[2] / np.where(down, ray[..., 2], -1.0), 1e4)
    return eye[0] + t * ray[..., 0], eye[1] + t * ray[..., 1], t, down


def _lines(x: Floats, y: Floats, distance: Floats, fx: float, spacing: float, width: float) -> Floats:
    """How much (0 to 1) of a pixel is covered by lines on the floor, blurred with the distance."""
    blur = np.maximum(width, 1.2 * distance / fx)
    off = [np.abs((c + spacing / 2) % spacing - spacing / 2) for c in (x, y)]
    cover = np.maximum(*(np.clip(1.5 - o / blur, 0, 1) for o in off))
    return cover * width / blur


def _room(ray: Rays, eye: Rays, fx: float) -> Floats:
    x, y, t, down = _ground(ray, eye, fx)
    wall = 6.5
    with np.errstate(divide="ignore", invalid="ignore"):
        tx = np.where(np.abs(ray[..., 0]) > 1e-6, (np.sign(ray[..., 0]) * wall - eye[0]) / ray[..., 0], 1e4)
        ty = np.where(np.abs(ray[..., 1]) > 1e-6, (np.sign(ray[..., 1]) * wall - eye[1]) / ray[..., 1], 1e4)
    tw = np.minimum(tx, ty)
    floor = down & (t < tw)
    z = eye[2] + tw * ray[..., 2]
    shade = np.where(tx < ty, 1.0, 0.93) * (0.90 + 0.03 * np.clip(z, 0, 3))
    walls = np.stack([c * shade for c in (205.0, 208.0, 212.0)], axis=-1)
    walls = np.where((z < 0.12)[..., None], np.array([120.0, 125.0, 130.0]), walls)
    tile = 168 + 4 * np.sin(1.3 * x + 0.4) * np.sin(1.1 * y)
    tile = tile - 45 * _lines(x, y, t, fx, 1.0, 0.012)
    mat = (np.abs(x) < 2.6) & (np.abs(y) < 1.1)
    ground = np.stack([tile * 0.96, tile, tile * 1.02], axis=-1) * np.where(mat, 0.86, 1.0)[..., None]
    return np.where(floor[..., None], ground, walls)


def _field(ray: Rays, eye: Rays, fx: float) -> Floats:
    x, y, t, down = _ground(ray, eye, fx)
    flat = np.hypot(ray[..., 0], ray[..., 1])
    rise = ray[..., 2] / np.maximum(flat, 1e-6)
    azimuth = np.arctan2(ray[..., 1], ray[..., 0])
    crowns = 0.045 + 0.012 * np.sin(9 * azimuth) + 0.008 * np.sin(23 * azimuth + 1) + 0.005 * np.sin(57 * azimuth)
    near = np.exp(-t / 40.0)
    tuft = near * (5 * np.sin(2.1 * x + 0.7 * y) * np.sin(1.7 * y - 0.5 * x) + 4 * np.sin(5.3 * x) * np.sin(4.9 * y))
    grass = np.stack([92 + tuft, 158 + tuft, 132 + tuft], axis=-1)
    grass = grass - (26 * _lines(x, y, t, fx, 1.0, 0.015) * (np.abs(x) < 4.2) * (np.abs(y) < 4.2))[..., None]
    light = np.clip(rise / 0.6, 0, 1)[..., None]
    sky = (1 - light) * np.array([235.0, 225.0, 215.0]) + light * np.array([225.0, 185.0, 140.0])
    edge = np.clip((rise - crowns) * 400 + 0.5, 0, 1)[..., None]
    trees = np.array([78.0, 112.0, 92.0])
    above = edge * sky + (1 - edge) * trees
    return np.where((down & (t < 150.0))[..., None], grass, above)
