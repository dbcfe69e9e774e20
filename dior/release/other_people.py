"""Where somebody else than the subject is to be covered in the pictures of a camera.

INPUTS   boxes of what moves and is not the subject, by picture (`head_evidence.look`); the camera
OUTPUTS  boxes of pixels to be covered: with the head that a body must have, between the pictures in which it is seen,
         and where something stays; where in a close camera's picture a head may be
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats, Ints
from dior.geometry.camera import Camera
from dior.ingest import moving
from dior.ingest.moving import Mask

# m: what is nearer to a close camera is not looked for as a head; between these heights above the floor
# one may be. Chosen: a child of three is 0.95 m tall.
NEAREST_M, HEAD_HEIGHTS_M = 2.0, (0.85, 2.3)
# chosen: pieces so far apart are one thing; so many pixels are one, be it not at the cover
JOIN_M, LEAST_PX = 0.15, 12
# chosen: what is so tall may be a body without its head, which ends so much higher (with the neck, and what else of it
# does not stand out)
BODY_PART_M, HEAD_ON_TOP_M = 0.7, 0.55
# A body that is gone is looked for so long, s, where it can have walked to: as fast as this, m/s, and as far as its
# outline changes, m. Chosen: a walker passes another, or a post, in less
GONE_S, WALKS_M_S, STEP_M = 1.5, 2.5, 0.4
HELD_S = 0.25  # s; chosen: so long before and after it is seen somebody is covered where that was
# Where something has stood out for this share of the recording, it is covered in all pictures: the scene may be the
# person, who then stands out where they are not. Chosen.
STAYS_SHARE = 0.1


def head_zone(camera: Camera, shape: tuple[int, int], factor: int) -> Mask:
    """1 where a close camera may see a head: at a head's height above the floor, not nearer than NEAREST_M."""
    lens = camera.intrinsics
    v, u = np.mgrid[: shape[0], : shape[1]] * factor + (factor - 1) / 2
    # without the lens' distortion, which moves a row by less than the heights leave open
    rays = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones_like(u)], axis=-1) @ camera.wRc.T
    slope = rays[..., 2] / np.maximum(np.hypot(rays[..., 0], rays[..., 1]), 1e-6)
    low, high = HEAD_HEIGHTS_M
    nearest, height = camera.centre[2] + NEAREST_M * slope, camera.centre[2]
    above = np.where(slope > 0, nearest < high, nearest > low)
    if height > high:
        above = slope < 0
    return above.astype(np.uint8)


def with_head(boxes: Ints, scale: float) -> Ints:
    """Boxes (N, 4) px, those of something as tall as a part of a body higher by what may not stand out of the scene.

    A head has the colours of what is behind it more often than a whole body has; `scale` px per m.
    """
    tall = boxes[:, 3] - boxes[:, 1] >= BODY_PART_M * scale
    low = np.where(tall, boxes[:, 1] - int(np.ceil(HEAD_ON_TOP_M * scale)), boxes[:, 1])
    return np.stack([boxes[:, 0], np.maximum(low, 0), boxes[:, 2], boxes[:, 3]], axis=1)


def followed(others: Sequence[Ints], times: Floats, scale: float) -> list[Ints]:
    """By picture the boxes (N, 4) px, and where a body was on its way that stops to stand out and is seen again later.

    Who walks past something of the same colour, or past the subject, is gone for a while. A body is what is as tall as
    a part of one; it is gone if no body is where it can have walked to in the next picture, and the first that is
    there within GONE_S is it. `times` (F,) s ascending; `scale` px per m.
    """
    bodies = [boxes[boxes[:, 3] - boxes[:, 1] >= BODY_PART_M * scale] for boxes in others]
    found = [[boxes] for boxes in others]

    def reached(box: Ints, i: int, j: int) -> Ints:
        """Bodies in picture j that one in picture i may be, the nearest first."""
        off = np.abs((bodies[j][:, :2] + bodies[j][:, 2:] - box[:2] - box[2:]) / 2).max(axis=1, initial=0.0)
        near = off <= (STEP_M + WALKS_M_S * (times[j] - times[i])) * scale
        return bodies[j][near][np.argsort(off[near], kind="stable")]

    for i, here in enumerate(bodies[:-1]):
        last = int(np.searchsorted(times, times[i] + GONE_S, side="right"))
        for box in here:
            if len(reached(box, i, i + 1)):
                continue
            j = next((j for j in range(i + 2, last) if len(reached(box, i, j))), None)
            if j is None:
                continue
            ahead = reached(box, i, j)[0]
            for k in range(i + 1, j):
                at = box + (ahead - box) * (times[k] - times[i]) / (times[j] - times[i])
                found[k].append(np.concatenate([np.floor(at[:2]), np.ceil(at[2:])]).astype(int)[None])
    return [np.concatenate(boxes) for boxes in found]


def held(others: Sequence[Ints], times: Floats, shape: tuple[int, int]) -> list[Ints]:
    """By picture the boxes (N, 4) px of it and of those up to HELD_S before and after, what overlaps as one.

    Who walks by does not stand out in every picture, least of all before something of the same colour. `times` (F,) s
    ascending.
    """
    first = np.searchsorted(times, times - HELD_S)
    last = np.searchsorted(times, times + HELD_S, side="right")
    found = []
    for a, b in zip(first, last, strict=True):
        near = [boxes for boxes in others[a:b] if len(boxes)]
        mask = np.zeros(shape, np.uint8)
        for u_min, v_min, u_max, v_max in np.concatenate([*near, np.zeros((0, 4), int)]).clip(0).tolist():
            mask[v_min:v_max, u_min:u_max] = 1
        found.append(moving.groups(mask, 1, 1) if near else np.zeros((0, 4), int))
    return found


def stays(count: NDArray[np.integer[Any]], pictures: int, join_px: float) -> Ints:
    """Boxes (N, 4) px of where something that is not the subject stood out in many of the pictures.

    `count` (H, W): in how many.
    """
    return moving.groups((count > STAYS_SHARE * pictures).astype(np.uint8), join_px, LEAST_PX)
