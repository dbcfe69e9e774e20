"""The body in a picture: drawn over the backdrop, and the box around what is seen of it.

The body is a set of tapered limbs between landmarks, drawn from far to near. The same limbs tell which joints are
hidden; what the dressed figure wears over them hides none. Pixel (0, 0) is the centre of the top-left pixel.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints
from dior.body.names import MLKIT_33
from dior.geometry.camera import Camera
from dior.simulate.scene import project

_AT = {name: i for i, name in enumerate(MLKIT_33)}
# fractional bits of the coordinates that OpenCV is given
SHIFT = 4
# chosen: outline of a limb: half circles of ARC points at both ends
ARC = 7
# chosen: a body lower than SMALL_PX is drawn so many times larger, then averaged: edges of a pixel have the right share
SUPERSAMPLE = 8
SMALL_PX = 120
# chosen: how wide the markers of a motion capture are: 2 to 4 px from where the cameras stand
MARKER_M, MARKER_COLOUR = 0.02, (250, 250, 250)
# chosen: what a wall leaves of a body is looked at so many times larger: its box is right to 1/32 px
FINE = 16

SKIN, HAIR, SHOE = (140, 170, 215), (40, 55, 75), (45, 45, 50)
CLOTHES = {
    ("shirt", 0): {"top": (190, 110, 60), "legs": (105, 70, 45)},
    ("shirt", 1): {"top": (80, 160, 90), "legs": (70, 75, 85)},
    ("jacket", 0): {"top": (50, 60, 185), "legs": (95, 80, 70)},
    ("jacket", 1): {"top": (60, 165, 215), "legs": (110, 65, 60)},
}
# chosen by eye; a limb: ends, radii as fractions of the body height, colour (`sleeve`: skin of a shirt, cloth of a
# jacket)
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


# What the dressed figure has beside the plain one, whose outline the steps know to a centimetre or two; chosen by eye:
# a stouter build, hair that stands off the head, shoes with thick soles and a long tip, a bag at the left hip.
STOUTER = {"top": 1.12, "legs": 1.12, "sleeve": 1.12, "shoe": 1.0, "skin": 1.0, "hair": 1.0}
_WORN = [("skull", "hair", 0.064, 0.055, "hair"), ("bag", "bag", 0.060, 0.060, "top")]
for _s in ("left", "right"):
    _WORN += [(f"{_s}_heel", f"{_s}_foot_index", 0.026, 0.024, "shoe")]
    _WORN += [(f"{_s}_foot_index", f"{_s}_tip", 0.024, 0.016, "shoe")]
_DRESSED = [(a, b, ra * STOUTER[kind], rb * STOUTER[kind], kind) for a, b, ra, rb, kind in _LIMBS] + _WORN
FIGURES = {
    "plain": (_LIMBS, _TRUNK),
    "dressed": (_DRESSED, {name: radius * STOUTER["top"] for name, radius in _TRUNK.items()}),
}


def figure(landmarks: Floats, height: float) -> dict[str, Floats]:
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
        p[f"{side}_tip"] = toes + 0.022 * height * sole
    p["hair"] = ears + height * (0.030 * up - 0.015 * forward)
    p["bag"] = p["left_hip"] + 0.085 * height * _unit(p["left_hip"] - p["right_hip"])
    return p


def _unit(v: Floats) -> Floats:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Drawing:
    """The body's outlines in one camera: polygons (T, P, 3, N, 2) px in three shades, their order and colours."""

    limbs: Floats
    trunk: Floats
    order: Ints
    colours: Floats
    box: Floats


def outlines(
    camera: Camera, points: dict[str, Floats], height: float, outfit: str, subject: str, worn: str = "plain"
) -> Drawing:
    """`Drawing` of the body (points as from `figure`) in a camera; `worn`: one of `FIGURES`."""
    shapes, rounds = FIGURES[worn]
    pixel, depth = {}, {}
    for name, xyz in points.items():
        pixel[name], depth[name] = project(camera, xyz)
    fx = camera.intrinsics.fx
    cloth = CLOTHES[outfit, int(subject[1:]) % 2]
    colour = {**cloth, "skin": SKIN, "hair": HAIR, "shoe": SHOE}
    colour["sleeve"] = cloth["top"] if outfit == "jacket" else SKIN

    a = np.stack([pixel[limb[0]] for limb in shapes], axis=1)
    b = np.stack([pixel[limb[1]] for limb in shapes], axis=1)
    za = np.stack([depth[limb[0]] for limb in shapes], axis=1)
    zb = np.stack([depth[limb[1]] for limb in shapes], axis=1)
    ra = fx * height * np.array([limb[2] for limb in shapes]) / za
    rb = fx * height * np.array([limb[3] for limb in shapes]) / zb
    limbs = _shaded(a, b, ra, rb)

    names = list(rounds)
    centre = np.stack([pixel[name] for name in names], axis=1)
    radius = fx * height * np.array(list(rounds.values())) / np.stack([depth[name] for name in names], axis=1)
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
    kinds = [limb[4] for limb in shapes] + ["top"]
    shades = np.array([0.68, 0.88, 1.05])
    colours = np.clip(np.array([colour[k] for k in kinds])[:, None, :] * shades[:, None], 0, 255)
    whole = np.concatenate([limbs.reshape(len(a), -1, 2), trunk.reshape(len(a), -1, 2)], axis=1)
    box = np.concatenate([np.nanmin(whole, axis=1), np.nanmax(whole, axis=1)], axis=1)
    return Drawing(limbs, trunk, order, colours, box)


# three nested shapes: radius, and shift towards the light, as fractions of the radius
_SHADES = ((1.0, 0.0), (0.72, 0.16), (0.34, 0.34))
_LIGHT = (-0.6, -0.8)


def _shaded(a: Floats, b: Floats, ra: Floats, rb: Floats) -> Floats:
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


def paint(picture: NDArray[np.uint8], drawing: Drawing, i: int) -> None:
    """Draw the body of frame `i` into `picture` (height, width, 3) uint8, in place."""
    import cv2

    high, wide = picture.shape[:2]
    box = drawing.box[i]
    if not _in_picture(box, (wide, high)):
        return
    small = box[3] - box[1] < SMALL_PX
    times = SUPERSAMPLE if small else 1
    u0, v0, u1, v1 = _around(box, (wide, high))
    part = picture[v0:v1, u0:u1]
    canvas = np.repeat(np.repeat(part, times, axis=0), times, axis=1) if small else part
    _fill(canvas, drawing, i, (u0, v0), times, drawing.colours.tolist(), cv2.LINE_8 if small else cv2.LINE_AA)
    if small:
        part[:] = cv2.resize(canvas, (u1 - u0, v1 - v0), interpolation=cv2.INTER_AREA)


def paint_markers(picture: NDArray[np.uint8], uv: Floats, width: Floats) -> None:
    """Draw round spots at pixels uv (M, 2), `width` (M,) px wide, into `picture` (height, width, 3) uint8, in place.

    A pixel is covered by how far it is from the edge, so that the spot's centre of mass is where the marker is.
    """
    high, wide = picture.shape[:2]
    for centre, across in zip(uv, width, strict=True):
        u0, v0, u1, v1 = _around(np.concatenate([centre - across, centre + across]), (wide, high))
        u, v = np.meshgrid(np.arange(u0, u1), np.arange(v0, v1))
        covered = np.clip(across / 2 - np.hypot(u - centre[0], v - centre[1]) + 0.5, 0, 1)[..., None]
        part = picture[v0:v1, u0:u1]
        part[:] = np.round(part + covered * (np.array(MARKER_COLOUR) - part))


def _in_picture(box: Floats, size: tuple[int, int]) -> bool:
    inside = box[0] <= size[0] and box[1] <= size[1] and box[2] >= 0 and box[3] >= 0
    return bool(np.isfinite(box).all() and inside)


def _around(box: Floats, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """The pixels u0, v0, u1, v1 of a picture (width, height) that hold a box, and a little around it."""
    u0, v0 = np.maximum(np.floor(box[:2]).astype(int) - 2, 0).tolist()
    u1, v1 = np.minimum(np.ceil(box[2:]).astype(int) + 3, size).tolist()
    return u0, v0, u1, v1


def _fill(
    canvas: NDArray[np.uint8], drawing: Drawing, i: int, corner: tuple[int, int], times: int, colours: Any, kind: int
) -> None:
    """Draw the body of frame `i` into a canvas that begins at the pixel `corner` and is `times` as large, in place."""
    import cv2

    begin = np.array(corner) - 0.5
    limbs = np.round(((drawing.limbs[i] - begin) * times - 0.5) * (1 << SHIFT)).astype(np.int32)
    trunk = ((drawing.trunk[i] - begin) * times - 0.5).astype(np.float32)
    last = len(limbs)
    for p in drawing.order[i].tolist():
        for layer in range(3):
            if p == last:
                hull = np.round(cv2.convexHull(trunk[layer]) * (1 << SHIFT)).astype(np.int32)
                cv2.fillConvexPoly(canvas, hull, colours[p][layer], kind, SHIFT)
            else:
                cv2.fillConvexPoly(canvas, limbs[p, layer], colours[p][layer], kind, SHIFT)


def seen_boxes(drawing: Drawing, size: tuple[int, int], wall: Bools | None = None) -> Floats:
    """Tight boxes (T, 4) px of what a picture (width, height) shows of the body: u_min, v_min, u_max, v_max.

    NaN where it shows nothing of it. `wall` (height, width, 1): pixels in which something hides everybody. A pixel
    ends half a pixel from its centre, so that a picture that is all body has the box -0.5, -0.5, width - 0.5, ...
    """
    found = np.full((len(drawing.box), 4), np.nan)
    limit = np.array([*size, *size]) - 0.5
    for i, box in enumerate(drawing.box):
        if not _in_picture(box, size):
            continue
        u0, v0, u1, v1 = _around(box, size)
        if wall is None or not wall[v0:v1, u0:u1].any():
            found[i] = np.clip(box, -0.5, limit)
        else:
            found[i] = _beside_wall(drawing, i, (u0, v0), wall[v0:v1, u0:u1, 0])
    return found


def _beside_wall(drawing: Drawing, i: int, corner: tuple[int, int], wall: Bools) -> Floats:
    """The box (4,) px of what the wall, in the pixels from `corner` on, leaves of the body; NaN for nothing."""
    import cv2

    hidden = np.repeat(np.repeat(wall, FINE, axis=0), FINE, axis=1)
    canvas = np.zeros(hidden.shape, np.uint8)
    _fill(canvas, drawing, i, corner, FINE, np.full((len(drawing.colours), 3), 255).tolist(), cv2.LINE_8)
    whole, left = canvas > 0, (canvas > 0) & ~hidden
    if not left.any():
        return np.full(4, np.nan)
    ends, all_ends = _ends(left), _ends(whole)
    # an edge that the wall leaves alone is known better than to a pixel of the canvas
    return np.where(ends == all_ends, drawing.box[i], np.tile(corner, 2) - 0.5 + ends / FINE)


def _ends(mask: Bools) -> Ints:
    """u_min, v_min, u_max, v_max (4,) of the pixels of a mask, the last ones counted whole."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1])


def hidden(camera: Camera, points: dict[str, Floats], height: float, joints: Floats, slack: Floats) -> Bools:
    """Whether joints (T, J, 3) are behind another part of the body, as seen by a camera: (T, J) bool.

    A joint is hidden where the ray to it meets a limb more than `slack` (J,) m before the joint itself.
    """
    pairs = [limb[:4] for limb in _LIMBS] + _TRUNK_LIMBS
    a = np.stack([points[pair[0]] for pair in pairs], axis=1).astype(np.float32)
    b = np.stack([points[pair[1]] for pair in pairs], axis=1).astype(np.float32)
    ra, rb = (np.array([pair[k] for pair in pairs], np.float32) * np.float32(height) for k in (2, 3))
    eye = camera.centre
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
