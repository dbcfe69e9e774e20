"""Pictures: a static background per camera, and the body drawn over it.

The body is a set of tapered limbs between landmarks, drawn from far to near. The same limbs tell which joints are
hidden. Pixel (0, 0) is the centre of the top-left pixel.
"""

from dataclasses import dataclass

import numpy as np

from dior.simulate.scene import project
from dior.simulate.settings import generator
from dior.skeletons import MLKIT_33

_AT = {name: i for i, name in enumerate(MLKIT_33)}
SHIFT = 4
# outline of a limb: half circles of ARC points at both ends
ARC = 7
SUPERSAMPLE = 8
SMALL_PX = 120

SKIN, HAIR, SHOE = (140, 170, 215), (40, 55, 75), (45, 45, 50)
CLOTHES = {
    ("shirt", 0): {"top": (190, 110, 60), "legs": (105, 70, 45)},
    ("shirt", 1): {"top": (80, 160, 90), "legs": (70, 75, 85)},
    ("jacket", 0): {"top": (50, 60, 185), "legs": (95, 80, 70)},
    ("jacket", 1): {"top": (60, 165, 215), "legs": (110, 65, 60)},
}
# limb: ends, radii as fractions of the body height, colour (`sleeve` is skin in a shirt, cloth in a jacket)
_LIMBS = [
    ("neck", "throat", 0.042, 0.034, "skin"),
    ("skull", "skull", 0.061, 0.061, "hair"),
    ("face", "face", 0.046, 0.046, "skin"),
]
for _s in ("left", "right"):
    _LIMBS += [
        (f"{_s}_shoulder", f"{_s}_elbow", 0.036, 0.030, "top"),
        (f"{_s}_elbow", f"{_s}_wrist", 0.030, 0.022, "sleeve"),
        (f"{_s}_wrist", f"{_s}_fingers", 0.022, 0.022, "skin"),
        (f"{_s}_hip", f"{_s}_knee", 0.058, 0.042, "legs"),
        (f"{_s}_knee", f"{_s}_ankle", 0.040, 0.028, "legs"),
        (f"{_s}_ankle", f"{_s}_heel", 0.027, 0.019, "shoe"),
        (f"{_s}_ankle", f"{_s}_foot_index", 0.027, 0.017, "shoe"),
        (f"{_s}_heel", f"{_s}_foot_index", 0.017, 0.015, "shoe"),
        (f"{_s}_foot_index", f"{_s}_toes", 0.015, 0.012, "shoe"),
    ]
# the trunk: circles whose hull is drawn; for hiding, limbs between them
_TRUNK = {
    "left_shoulder": 0.045,
    "right_shoulder": 0.045,
    "chest": 0.076,
    "waist": 0.074,
    "left_hip": 0.070,
    "right_hip": 0.070,
}
_TRUNK_LIMBS = [("chest", "waist", 0.074, 0.072), ("left_shoulder", "left_hip", 0.045, 0.068)]
_TRUNK_LIMBS += [("right_shoulder", "right_hip", 0.045, 0.068), ("left_hip", "right_hip", 0.070, 0.070)]


def figure(landmarks, height):
    """Points of the drawn body (T, 3) by name: the landmarks and a few more, from landmarks (T, 33, 3)."""
    p = {name: landmarks[:, i] for name, i in _AT.items()}
    ears = (p["left_ear"] + p["right_ear"]) / 2
    forward = _unit(p["nose"] - ears)
    left = _unit(p["left_ear"] - p["right_ear"])
    up = _unit(np.cross(forward, left))
    p["skull"] = ears + height * (0.002 * forward + 0.004 * up)
    p["face"] = ears + height * (0.020 * forward - 0.020 * up)
    p["throat"] = ears - 0.045 * height * up
    neck = (p["left_shoulder"] + p["right_shoulder"]) / 2
    hips = (p["left_hip"] + p["right_hip"]) / 2
    p["neck"] = neck
    p["chest"] = neck + 0.28 * (hips - neck)
    p["waist"] = neck + 0.72 * (hips - neck)
    for side in ("left", "right"):
        p[f"{side}_fingers"] = (p[f"{side}_index"] + p[f"{side}_pinky"]) / 2
        sole = _unit(p[f"{side}_foot_index"] - p[f"{side}_heel"])
        toes = p[f"{side}_foot_index"] + 0.022 * height * sole
        toes[:, 2] = np.maximum(toes[:, 2], 0.012 * height)
        p[f"{side}_toes"] = toes
    return p


def _unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Drawing:
    """The body's outlines in one camera: polygons (T, P, 3, N, 2) px in three shades, their order and colours."""

    limbs: np.ndarray
    trunk: np.ndarray
    order: np.ndarray
    colours: np.ndarray
    box: np.ndarray


def outlines(camera, points, height, outfit, subject):
    """`Drawing` of the body (points as from `figure`) in a camera."""
    pixel, depth = {}, {}
    for name, xyz in points.items():
        pixel[name], depth[name] = project(camera, xyz)
    fx = camera.intrinsics.fx
    cloth = CLOTHES[outfit, int(subject[1:]) % 2]
    colour = {**cloth, "skin": SKIN, "hair": HAIR, "shoe": SHOE}
    colour["sleeve"] = cloth["top"] if outfit == "jacket" else SKIN

    a = np.stack([pixel[limb[0]] for limb in _LIMBS], axis=1)
    b = np.stack([pixel[limb[1]] for limb in _LIMBS], axis=1)
    za = np.stack([depth[limb[0]] for limb in _LIMBS], axis=1)
    zb = np.stack([depth[limb[1]] for limb in _LIMBS], axis=1)
    ra = fx * height * np.array([limb[2] for limb in _LIMBS]) / za
    rb = fx * height * np.array([limb[3] for limb in _LIMBS]) / zb
    limbs = _shaded(a, b, ra, rb)

    names = list(_TRUNK)
    centre = np.stack([pixel[name] for name in names], axis=1)
    radius = fx * height * np.array(list(_TRUNK.values())) / np.stack([depth[name] for name in names], axis=1)
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    layers = []
    for shrink, shift in _SHADES:
        r = (radius * shrink)[..., None, None]
        toward = np.array(_LIGHT) * (radius * shift)[..., None]
        layers.append(((centre + toward)[..., None, :] + r * ring).reshape(len(centre), -1, 2))
    trunk = np.stack(layers, axis=1)

    deep = np.concatenate([(za + zb) / 2, ((depth["chest"] + depth["waist"]) / 2)[:, None]], axis=1)
    order = np.argsort(-deep, axis=1, kind="stable")
    kinds = [limb[4] for limb in _LIMBS] + ["top"]
    shades = np.array([0.68, 0.88, 1.05])
    colours = np.clip(np.array([colour[k] for k in kinds])[:, None, :] * shades[:, None], 0, 255)
    whole = np.concatenate([limbs.reshape(len(a), -1, 2), trunk.reshape(len(a), -1, 2)], axis=1)
    box = np.concatenate([np.nanmin(whole, axis=1), np.nanmax(whole, axis=1)], axis=1)
    return Drawing(limbs, trunk, order, colours, box)


# three nested shapes: radius, and shift towards the light, as fractions of the radius
_SHADES = ((1.0, 0.0), (0.72, 0.16), (0.34, 0.34))
_LIGHT = (-0.6, -0.8)


def _shaded(a, b, ra, rb):
    """Outlines (T, P, 3, 2 ARC, 2) of tapered limbs between pixels a and b (T, P, 2) with radii (T, P)."""
    along = b - a
    apart = np.linalg.norm(along, axis=-1)
    inside = apart < np.abs(ra - rb) + 1e-6
    ra, rb = np.where(inside, np.maximum(ra, rb), ra), np.where(inside, np.maximum(ra, rb), rb)
    angle = np.arctan2(along[..., 1], along[..., 0])[..., None]
    arc = np.linspace(-np.pi / 2, np.pi / 2, ARC)
    front = np.stack([np.cos(angle + arc), np.sin(angle + arc)], axis=-1)
    layers = []
    for shrink, shift in _SHADES:
        light = np.array(_LIGHT) * shift
        far = b[..., None, :] + rb[..., None, None] * (shrink * front + light)
        near = a[..., None, :] + ra[..., None, None] * (-shrink * front + light)
        layers.append(np.concatenate([far, near], axis=-2))
    return np.stack(layers, axis=2)


def paint(picture, drawing, i):
    """Draw the body of frame `i` into `picture` (height, width, 3) uint8, in place."""
    import cv2

    high, wide = picture.shape[:2]
    box = drawing.box[i]
    if not np.isfinite(box).all() or box[0] > wide or box[1] > high or box[2] < 0 or box[3] < 0:
        return
    small = box[3] - box[1] < SMALL_PX
    times = SUPERSAMPLE if small else 1
    u0, v0 = np.maximum(np.floor(box[:2]).astype(int) - 2, 0)
    u1, v1 = np.minimum(np.ceil(box[2:]).astype(int) + 3, (wide, high))
    part = picture[v0:v1, u0:u1]
    canvas = np.repeat(np.repeat(part, times, axis=0), times, axis=1) if small else part
    corner = np.array([u0, v0]) - 0.5
    limbs = np.round(((drawing.limbs[i] - corner) * times - 0.5) * (1 << SHIFT)).astype(np.int32)
    trunk = ((drawing.trunk[i] - corner) * times - 0.5).astype(np.float32)
    kind = cv2.LINE_8 if small else cv2.LINE_AA
    colours = drawing.colours.tolist()
    last = len(limbs)
    for p in drawing.order[i].tolist():
        for layer in range(3):
            if p == last:
                hull = np.round(cv2.convexHull(trunk[layer]) * (1 << SHIFT)).astype(np.int32)
                cv2.fillConvexPoly(canvas, hull, colours[p][layer], kind, SHIFT)
            else:
                cv2.fillConvexPoly(canvas, limbs[p, layer], colours[p][layer], kind, SHIFT)
    if small:
        part[:] = cv2.resize(canvas, (u1 - u0, v1 - v0), interpolation=cv2.INTER_AREA)


def hidden(camera, points, height, joints, slack):
    """Whether joints (T, J, 3) are behind another part of the body, as seen by a camera: (T, J) bool.

    A joint is hidden where the ray to it meets a limb more than `slack` (J,) m before the joint itself.
    """
    pairs = [limb[:4] for limb in _LIMBS] + _TRUNK_LIMBS
    a = np.stack([points[pair[0]] for pair in pairs], axis=1).astype(np.float32)
    b = np.stack([points[pair[1]] for pair in pairs], axis=1).astype(np.float32)
    ra, rb = (np.array([pair[k] for pair in pairs], np.float32) * np.float32(height) for k in (2, 3))
    eye = camera.wTc[:3, 3]
    ray = (joints - eye).astype(np.float32)
    far = np.linalg.norm(ray, axis=-1)
    ray = ray / far[..., None]
    out = np.zeros(far.shape, bool)
    a = a - eye.astype(np.float32)
    b = b - eye.astype(np.float32)
    for p in range(len(pairs)):
        axis = b[:, p] - a[:, p]
        # closest points of the ray and the limb's axis
        length2 = np.maximum((axis**2).sum(axis=-1), 1e-8)[:, None]
        along = np.einsum("tjk,tk->tj", ray, axis)
        start = np.einsum("tjk,tk->tj", ray, a[:, p])
        onto = (a[:, p] * axis).sum(axis=-1)[:, None]
        s = np.clip((along * start - onto) / np.maximum(length2 - along**2, 1e-8), 0.0, 1.0)
        nearest = a[:, p][:, None] + s[..., None] * axis[:, None]
        depth = np.einsum("tjk,tjk->tj", ray, nearest)
        gap2 = (nearest**2).sum(axis=-1) - depth**2
        radius2 = (ra[p] + s * (rb[p] - ra[p])) ** 2
        enters = depth - np.sqrt(np.maximum(radius2 - gap2, 0.0))
        out |= (gap2 < radius2) & (enters < far - slack)
    return out


def background(settings, camera, environment):
    """The picture (height, width, 3) uint8 without the person: a room, or a field under the sky."""
    import cv2

    lens = camera.intrinsics
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
    ray = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1) @ camera.wTc[:3, :3].T
    high, wide = ray.shape[:2]
    ray = cv2.resize(ray.astype(np.float32), (wide * step, high * step), interpolation=cv2.INTER_LINEAR)
    # resize puts sample (i, j) at pixel centre step (i + 1/2) - 1/2
    half = step // 2
    ray = ray[half : half + lens.height, half : half + lens.width]
    eye = camera.wTc[:3, 3].astype(np.float32)
    colour = _room(ray, eye, lens.fx) if environment == "indoor" else _field(ray, eye, lens.fx)
    noise = generator(settings, "texture", environment, camera.name).standard_normal((lens.height // 24, 54, 1))
    colour = colour + 2.0 * cv2.resize(noise.astype(np.float32), (lens.width, lens.height))[..., None]
    return np.clip(colour, 0, 255).astype(np.uint8)


def _ground(ray, eye, fx):
    """Where rays meet the floor: x, y (m), the distance and whether they do."""
    down = ray[..., 2] < -1e-3
    t = np.where(down, -eye[2] / np.where(down, ray[..., 2], -1.0), 1e4)
    return eye[0] + t * ray[..., 0], eye[1] + t * ray[..., 1], t, down


def _lines(x, y, distance, fx, spacing, width):
    """How much (0 to 1) of a pixel is covered by lines on the floor, blurred with the distance."""
    blur = np.maximum(width, 1.2 * distance / fx)
    off = [np.abs((c + spacing / 2) % spacing - spacing / 2) for c in (x, y)]
    cover = np.maximum(*(np.clip(1.5 - o / blur, 0, 1) for o in off))
    return cover * width / blur


def _room(ray, eye, fx):
    x, y, t, down = _ground(ray, eye, fx)
    wall = 6.5
    with np.errstate(divide="ignore"):
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


def _field(ray, eye, fx):
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
