"""What a camera's own pictures say of where the subject's head is, and what else moves in them.

INPUTS   masks of what stands out of the scene (`moving`); where the 3D has the head and the body in the pictures
OUTPUTS  by picture how far what is seen of the head and the shoulders is off the 3D; boxes of what moves and is not the
         subject
A cover is as good as the pose and the clock that put it there. Whether these are good the labels cannot tell: a pose
that is half a degree off puts all of them off. But a bust that moves stands out of the scene, with an outline that is
known well enough to find it: head and shoulders are drawn from the 3D and shifted to where they fit the mask best. The
shoulders tell where a head ends below that wears a hat.
What moves and is neither under the cover nor below the subject's chin is somebody else's, or a part of the head that
the cover does not reach; it is covered, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints, Texts
from dior.body.names import bones_of
from dior.geometry import camera as cam
from dior.geometry.camera import Camera
from dior.release import head_blur, head_model, moving
from dior.release.moving import Mask

# All lengths m at the head's distance. Chosen, half the sides of an ellipse as large as a bare head, about the middle
# between the ears; how far flesh and clothes lie outside of the shoulders, the trunk and the upper arms, by joints and
# by markers, which are on the skin.
BARE_HEAD_M, SHOULDER_M, MARKER_M = (0.085, 0.12), 0.06, 0.03
# chosen: of the bust so much above and below the ears is looked at, and to both sides; so far it is looked for
ABOVE_M, BELOW_M, BESIDE_M, FARTHEST_M = 0.32, 0.40, 0.42, 0.25
# chosen: higher than this above the ears anything may be, hair or a hat, which would pull the bust up. A head narrower
# than so many pixels has too few of them without its top, and its hat is less than one.
HAT_ABOVE_M, HAT_PX = 0.05, 6
# chosen: at its place so much of it stands out, where it is seen at all; so much of it is in the picture
FILLED, IN_PICTURE = 0.5, 0.6
# what has to be under the cover. Chosen: of most people it is less (0.08 and 0.12), the rest is for the outline's error
LARGE_HEAD_M = (0.105, 0.145)
# chosen: what lies outside of the line between two joints with clothes on it, and how far below the middle of its
# ellipsoid the head ends and the body begins
FLESH_M, CHIN_M = 0.11, 0.12
# s; chosen: a cover that is right so long before and after is right; the median over it forgets single pictures
WINDOW_S = 0.25
# chosen: of the pictures in a window, and of all with a head
SEEN_SHARE = 0.5
# chosen: where so many pictures show the head beside its cover, the others of the recording are no surer
BESIDE_SHARE = 0.3
# chosen: a bust may be seen so much higher: what is above the cover and moves is covered for that
HIGHER_M = 0.08
# chosen: of the scene nothing is taken from where the subject may be, so much around the bones
SUBJECT_M = 0.25
# Other people. m: what is nearer to a close camera is not looked for as a head; between these heights above the floor
# one may be. Chosen: a child of three is 0.95 m tall.
NEAREST_M, HEAD_HEIGHTS_M = 2.0, (0.85, 2.3)
# chosen: pieces so far apart are one thing; so many pixels are one, be it not at the cover
JOIN_M, LEAST_PX = 0.15, 12
# Where something has stood out for this share of the recording, it is covered in all pictures: the scene may be the
# person, who then stands out where they are not. Chosen.
STAYS_SHARE = 0.1
TRUNK = tuple("left_shoulder right_shoulder left_hip right_hip LSHO RSHO C7 CLAV LASI RASI LPSI RPSI".split())
ARMS = ("left_elbow", "right_elbow", "LELB", "RELB")
# what a picture says of the head: it is seen; nothing stands out there; it is not in the picture
SAYS = ("seen", "unseen", "outside")


@dataclass(frozen=True, eq=False)
class Subject:
    """Where the 3D has the subject in the pictures of a camera, px of pictures that are `factor` times smaller.

    `edges` (F, 4) of the cover, first and after the last, NaN none; `head` (F, 2) the middle of the head's ellipsoid;
    `scale` (F,) px per m there; `limbs` (F, B, 2, 2) ends of the bones, `upper` (B,) which are of the bust; `trunk`
    (F, K, 2) corners of the trunk; `flesh_m` how far flesh lies outside of these.
    """

    edges: Floats
    head: Floats
    scale: Floats
    limbs: Floats
    upper: Bools
    trunk: Floats
    flesh_m: float


def subject_of(
    camera: Camera, edges: Floats, middle: Floats, points: Floats, joints: Sequence[str], factor: int
) -> Subject:
    """`Subject` of a camera from the covers' `edges` (F, 4) px, the middle between the ears (F, 3) m and the `points`
    (F, J, 3) m of the `joints` at the pictures' times."""
    centre = middle + (0.0, 0.0, head_model.RAISED_M)
    head = cam.project(camera, centre)[0]
    distance = np.linalg.norm(centre - camera.centre, axis=1)
    uv, depth = cam.project(camera, points)
    uv = np.where((depth > 0)[..., None], uv, np.nan)
    bones = np.array([pair for pair in bones_of(joints) if not _of_head(joints, pair)], int).reshape(-1, 2)
    corners = [i for i, name in enumerate(joints) if name in TRUNK]
    upper = np.array([{joints[i], joints[j]} <= {*TRUNK, *ARMS} for i, j in bones], bool)
    small = (lambda at: (at + 0.5) / factor - 0.5) if factor > 1 else np.asarray
    scale = camera.intrinsics.fx / distance / factor
    flesh_m = SHOULDER_M if "left_shoulder" in joints else MARKER_M
    return Subject(edges / factor, small(head), scale, small(uv[:, bones]), upper, small(uv[:, corners]), flesh_m)


def _of_head(joints: Sequence[str], pair: Ints) -> bool:
    return any(joints[i] in head_model.HEAD for i in pair)


@dataclass(frozen=True, eq=False)
class Look:
    """What one picture says of the head (one of SAYS), and how far (2,) m to the right of and below the 3D it is seen,
    NaN unless it is; `others`: boxes (N, 4) px of what moves and is not the subject."""

    says: str
    off_m: Floats
    others: Ints


def look(mask: Mask, subject: Subject, i: int, zone: Mask | None) -> tuple[Look, Mask]:
    """`Look` at the mask of picture `i`, and what in it moves and is not the subject, as a mask.

    `zone`: 1 where somebody's head may be, None for everywhere.
    """
    says, off_m = bust(mask, subject, i)
    rest = mask.copy()
    cover = np.zeros_like(mask)
    box = subject.edges[i]
    if np.isfinite(box).all():
        # only those small pixels that it covers whole
        inside, part = moving.in_ellipse(cover, box + (1.0, 1.0, -1.0, -1.0))
        part[inside] = 1
    rest[(cover | _body(mask.shape, subject, i)) > 0] = 0
    if zone is not None:
        rest &= zone
    scale = subject.scale[i] if np.isfinite(subject.scale[i]) else 0.0
    others = moving.groups(rest, JOIN_M * scale, LEAST_PX, _around(cover, box))
    return Look(says, off_m, others), rest


def _around(cover: Mask, box: Floats) -> Mask:
    """The cover and the pixels beside it."""
    import cv2

    if not np.isfinite(box).all():
        return cover
    return np.asarray(cv2.dilate(cover, np.ones((5, 5), np.uint8)), np.uint8)


def bust(mask: Mask, subject: Subject, i: int) -> tuple[str, Floats]:
    """One of SAYS, and by how much (2,) m the head and shoulders in picture `i` are off the 3D, NaN unless seen."""
    import cv2

    nothing = np.full(2, np.nan)
    (u, v), scale = subject.head[i], subject.scale[i]
    if not (np.isfinite([u, v, scale]).all() and np.isfinite(subject.edges[i]).all()):
        return "outside", nothing
    high, wide = mask.shape
    v = v + head_model.RAISED_M * scale
    low = np.floor([u - BESIDE_M * scale, v - ABOVE_M * scale]).astype(int)
    size = np.ceil([2 * BESIDE_M * scale, (ABOVE_M + BELOW_M) * scale]).astype(int) + 1
    shown = np.minimum(low + size, (wide, high)) - np.maximum(low, 0)
    if (shown < IN_PICTURE * size).any():
        return "outside", nothing
    drawn = _drawn_bust(subject, i, low, size, np.array([u, v]))
    # what is outside of the picture tells nothing: there, the bust is as it is drawn
    reach = int(np.ceil(max(FARTHEST_M * scale, 2.0)))
    part = np.zeros(size[::-1] + 2 * reach, np.uint8)
    part[reach:-reach, reach:-reach] = drawn
    first = np.maximum(low - reach, 0)
    last = np.minimum(low + size + reach, (wide, high))
    at = first - low + reach
    part[at[1] : at[1] + last[1] - first[1], at[0] : at[0] + last[0] - first[0]] = mask[
        first[1] : last[1], first[0] : last[0]
    ]
    counts = np.ones(drawn.shape, np.float32)
    if 2 * BARE_HEAD_M[0] * scale >= HAT_PX:
        counts[: max(int(np.floor(v - HAT_ABOVE_M * scale)) - low[1], 0)] = 0
    found = cv2.matchTemplate(part.astype(np.float32), drawn.astype(np.float32), cv2.TM_SQDIFF, mask=counts)
    wrong = np.asarray(found, np.float64)
    row, column = np.unravel_index(int(wrong.argmin()), wrong.shape)
    here = part[row : row + size[1], column : column + size[0]]
    if here[drawn > 0].mean() < FILLED:
        return "unseen", nothing
    shift = [_between(wrong[row], int(column)) - reach, _between(wrong[:, column], int(row)) - reach]
    return "seen", np.array(shift) / scale


def _between(values: Floats, i: int) -> float:
    """Where the parabola through the smallest of values (N,) at `i` and its neighbours is lowest."""
    if not 0 < i < len(values) - 1:
        return float(i)
    a, b, c = (float(values[i + k]) for k in (-1, 0, 1))
    return i + (0.5 * (a - c) / (a - 2 * b + c) if a - 2 * b + c > 0 else 0.0)


def _drawn_bust(subject: Subject, i: int, low: Ints, size: Ints, ears: Floats) -> Mask:
    """Head, shoulders, chest and upper arms (height, width) as the 3D has them, in the part of the picture at `low`."""
    import cv2

    scale = subject.scale[i]
    # drawn finer, as a head 60 m away is three pixels wide
    fine = int(np.clip(np.ceil(32 / scale), 1, 4))
    found = np.zeros(size[::-1] * fine, np.uint8)

    def there(at: Floats) -> Ints:
        return np.clip(np.round((at - low + 0.5) * fine - 0.5), -30000, 30000).astype(int)

    axes = np.maximum(np.round(np.array(BARE_HEAD_M) * scale * fine), 1).astype(int)
    cv2.ellipse(found, there(ears).tolist(), axes.tolist(), 0, 0, 360, 1, -1)
    thick = max(int(round(2 * subject.flesh_m * scale * fine)), 1)
    limbs = subject.limbs[i][subject.upper]
    for a, b in there(limbs[np.isfinite(limbs).all(axis=(1, 2))]).tolist():
        cv2.line(found, a, b, 1, thick)
    trunk = subject.trunk[i]
    trunk = trunk[np.isfinite(trunk).all(axis=1)]
    if len(trunk) > 2:
        cv2.fillConvexPoly(found, cv2.convexHull(there(trunk).astype(np.int32)), 1)
    if fine == 1:
        return found
    shares = found.reshape(size[1], fine, size[0], fine).mean(axis=(1, 3))
    return (shares > 0.25).astype(np.uint8)


def _body(shape: tuple[int, ...], subject: Subject, i: int) -> Mask:
    """1 where the subject may be below the chin."""
    import cv2

    found = np.zeros(shape, np.uint8)
    scale = subject.scale[i]
    if not np.isfinite(scale):
        return found
    thick = max(int(np.ceil(2 * FLESH_M * scale)), 1)
    reach = 10 * max(shape)
    limbs = subject.limbs[i]
    limbs = limbs[np.isfinite(limbs).all(axis=(1, 2)) & (np.abs(limbs) < reach).all(axis=(1, 2))]
    for a, b in np.round(limbs).astype(int).tolist():
        cv2.line(found, a, b, 1, thick)
    trunk = subject.trunk[i]
    trunk = trunk[np.isfinite(trunk).all(axis=1) & (np.abs(trunk) < reach).all(axis=1)]
    if len(trunk) > 2:
        cv2.fillConvexPoly(found, cv2.convexHull(np.round(trunk).astype(np.int32)), 1)
    chin = subject.head[i, 1] + CHIN_M * scale
    if np.isfinite(chin):
        found[: int(np.clip(np.ceil(chin), 0, shape[0]))] = 0
    return found


def whole_body(shape: tuple[int, ...], subject: Subject, i: int) -> Mask:
    """1 where the subject may be at all in picture `i`, with much around them: not for what is covered."""
    import cv2

    found = np.zeros(shape, np.uint8)
    scale, box = subject.scale[i], subject.edges[i]
    if not np.isfinite(scale):
        return found
    limbs = subject.limbs[i]
    limbs = limbs[np.isfinite(limbs).all(axis=(1, 2)) & (np.abs(limbs) < 10 * max(shape)).all(axis=(1, 2))]
    for a, b in np.round(limbs).astype(int).tolist():
        cv2.line(found, a, b, 1, max(int(np.ceil(2 * SUBJECT_M * scale)), 1))
    if np.isfinite(box).all():
        rows, columns = head_blur.inside(box + SUBJECT_M * scale * np.array([-1, -1, 1, 1]), *shape[:2])
        found[rows, columns] = 1
    return found


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


def stays(count: NDArray[np.integer[Any]], pictures: int, join_px: float) -> Ints:
    """Boxes (N, 4) px of where something that is not the subject stood out in many of the pictures.

    `count` (H, W): in how many.
    """
    return moving.groups((count > STAYS_SHARE * pictures).astype(np.uint8), join_px, LEAST_PX)


def sure(says: Texts, off_m: Floats, cover_m: Floats, times: Floats, told: Bools) -> Texts:
    """What is to be thought of each picture (F,): "ok", "unseen" or "beside".

    `says` (F,) of SAYS and `off_m` (F, 2) as of `Look`; `cover_m` (F, 4) as of `covers_m`; `times` (F,) s ascending;
    `told` (F,): something else tells that the head is under its cover.
    """
    judged = says != "outside"
    known = judged & ((says == "seen") | told)
    covered = np.isfinite(cover_m).all(axis=1)
    out = np.full(len(says), "ok", object)
    if not judged.any():
        # of a head at the border of all pictures nothing is known
        return np.where(covered & ~told, "unseen", "ok").astype(object)
    if known[judged].mean() < SEEN_SHARE:
        return np.full(len(says), "unseen", object)
    # a bust that is a part of the scene, for it hides the same place all the time, is found where it is not; where
    # something else tells of most pictures, the others do not speak for these
    seen = np.flatnonzero((says == "seen") & covered & ~told)
    if (
        len(seen)
        and told[judged].mean() < SEEN_SHARE
        and not holds(np.median(cover_m[seen], axis=0), np.median(off_m[seen], axis=0))
    ):
        return np.full(len(says), "beside", object)
    first, last = (np.searchsorted(times, times + s, side="left" if s < 0 else "right") for s in (-WINDOW_S, WINDOW_S))
    n_known, n_judged = (np.concatenate([[0], np.cumsum(which)]) for which in (known, judged))
    share = (n_known[last] - n_known[first]) / np.maximum(n_judged[last] - n_judged[first], 1)
    out[judged & (share < SEEN_SHARE)] = "unseen"
    for i in seen:
        near = seen[np.searchsorted(seen, first[i]) : np.searchsorted(seen, last[i])]
        if not holds(cover_m[i], np.median(off_m[near], axis=0)):
            out[i] = "beside"
    if (out[judged] == "beside").mean() > BESIDE_SHARE:
        return np.full(len(says), "beside", object)
    return out


def holds(cover_m: Floats, off_m: Floats) -> Bools:
    """Whether (...,) the ellipse in `cover_m` (..., 4) m, left, top, right and bottom from the middle between the ears,
    holds a head that is `off_m` (..., 2) m to the right of and below it. False for NaN.
    """
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    outline = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * LARGE_HEAD_M
    middle, half = (cover_m[..., :2] + cover_m[..., 2:]) / 2, (cover_m[..., 2:] - cover_m[..., :2]) / 2
    with np.errstate(invalid="ignore"):
        off_m = np.stack([off_m[..., 0], off_m[..., 1] + np.clip(-off_m[..., 1], 0, HIGHER_M)], axis=-1)
        from_middle = (off_m - middle)[..., None, :] + outline
        return np.asarray(((from_middle / half[..., None, :]) ** 2).sum(axis=-1).max(axis=-1) <= 1)


def covers_m(subject: Subject) -> Floats:
    """The covers (F, 4) m from the middle between the ears: left, top, right, bottom; NaN none."""
    ears = subject.head + np.array([0.0, head_model.RAISED_M]) * subject.scale[:, None]
    return (subject.edges - 0.5 - np.tile(ears, 2)) / subject.scale[:, None]
