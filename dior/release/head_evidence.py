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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats, Ints, Texts
from dior.body.names import bones_of
from dior.geometry import camera as cam
from dior.geometry.camera import Camera
from dior.ingest import moving
from dior.ingest.moving import Mask
from dior.release import head_blur, head_model, other_people

# All lengths m at the head's distance. Chosen, half the sides of an ellipse about the middle between the ears that a
# bare head fills, and of one beyond which there is neither hair nor a hat.
BARE_HEAD_M, WORN_HEAD_M = (0.075, 0.11), (0.13, 0.16)
# chosen: so far outside of the shoulders, the trunk and the upper arms there is flesh in any case, and beyond the
# second there are no clothes, by joints and by markers, which are on the skin
FLESH_M, CLOTHES_M = (0.02, 0.0), (0.11, 0.09)
# chosen: of the bust so much above and below the ears is looked at, and to both sides; so far it is looked for
ABOVE_M, BELOW_M, BESIDE_M, FARTHEST_M = 0.32, 0.40, 0.42, 0.25
# chosen: higher than this above the ears anything may be, hair or a hat
HAT_ABOVE_M = 0.05
# chosen: at its place so much of it stands out, where it is seen at all; so much of it is in the picture. Places that
# differ by so little of it are as good
FILLED, IN_PICTURE, AS_GOOD = 0.5, 0.6, 0.01
# what has to be under the cover. Chosen: of most people it is less (0.08 and 0.12), the rest is for the outline's error
LARGE_HEAD_M = (0.105, 0.145)
# chosen: what lies outside of the line between two joints with clothes on it, and how far below the middle of its
# ellipsoid the head ends and the body begins
BODY_M, CHIN_M = 0.11, 0.12
# s; chosen: a cover that is right so long before and after is right; the median over it forgets single pictures. Up and
# down over a longer time: there, only the pose puts a cover beside a head, not the clock, and a bust seen from the side
# is less sure
WINDOW_S, UPRIGHT_S = 0.25, 1.0
# chosen: of the pictures in a window, and of all with a head
SEEN_SHARE = 0.5
# chosen: where so many pictures show the head beside its cover, the others of the recording are no surer
BESIDE_SHARE = 0.3
# m. Chosen: half a head; what is told further off than that is not of this head, or the labels are not. So much may be
# wrong with what is told: a detector is off by this at a joint of the face, a box drawn by hand at a side
TOLD_M, TOLD_SPARE_M = 0.15, 0.06
# chosen: a bust may be seen so much higher: what is above the cover and moves is covered for that
HIGHER_M = 0.08
# chosen: of the scene nothing is taken from where the subject may be, so much around the bones
SUBJECT_M = 0.25
TRUNK = tuple("left_shoulder right_shoulder left_hip right_hip LSHO RSHO C7 CLAV LASI RASI LPSI RPSI".split())
ARMS = ("left_elbow", "right_elbow", "LELB", "RELB")
# what a picture says of the head: it is seen; nothing stands out there; it is not in the picture
SAYS = ("seen", "unseen", "outside")


@dataclass(frozen=True, eq=False)
class Subject:
    """Where the 3D has the subject in the pictures of a camera, px of pictures that are `factor` times smaller.

    `edges` (F, 4) of the cover, first and after the last, NaN none; `head` (F, 2) the middle of the head's ellipsoid;
    `scale` (F,) px per m there; `limbs` (F, B, 2, 2) ends of the bones, `upper` (B,) which are of the bust; `trunk`
    (F, K, 2) corners of the trunk; `of_markers`: all of these are markers on the skin.
    """

    edges: Floats
    head: Floats
    scale: Floats
    limbs: Floats
    upper: Bools
    trunk: Floats
    of_markers: bool


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
    of_markers = "left_shoulder" not in joints
    return Subject(edges / factor, small(head), scale, small(uv[:, bones]), upper, small(uv[:, corners]), of_markers)


def quarter_turns(camera: Camera) -> int:
    """By how many quarters, against the clock, a camera's pictures are turned so that up is above in them, or nearest.

    What a head looks like is known of upright pictures only.
    """
    right, down = camera.wRc[2, :2]
    if abs(down) >= abs(right):
        return 0 if down <= 0 else 2
    return 1 if right > 0 else 3


def turned_points(uv: Floats, quarters: int, shape: tuple[int, ...]) -> Floats:
    """Pixels uv (..., 2) of a picture of `shape` (height, width) in the picture that is `np.rot90` of it."""
    high, wide = shape[:2]
    for _ in range(quarters % 4):
        uv = np.stack([uv[..., 1], wide - 1 - uv[..., 0]], axis=-1)
        high, wide = wide, high
    return uv


def turned_boxes(boxes: Any, quarters: int, shape: tuple[int, ...]) -> Any:
    """The same of boxes (..., 4): first column and row, those after the last."""
    high, wide = shape[:2]
    for _ in range(quarters % 4):
        u0, v0, u1, v1 = (boxes[..., i] for i in range(4))
        boxes = np.stack([v0, wide - u1, v1, wide - u0], axis=-1)
        high, wide = wide, high
    return boxes


def turned(subject: Subject, quarters: int, shape: tuple[int, ...]) -> Subject:
    """The `Subject` in pictures of `shape` (height, width) that are turned by `np.rot90`."""
    if not quarters % 4:
        return subject
    head, limbs, trunk = (
        turned_points(points, quarters, shape) for points in (subject.head, subject.limbs, subject.trunk)
    )
    return replace(subject, edges=turned_boxes(subject.edges, quarters, shape), head=head, limbs=limbs, trunk=trunk)


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
        inside, part = _in_ellipse(cover, box + (1.0, 1.0, -1.0, -1.0))
        part[inside] = 1
    rest[(cover | _body(mask.shape, subject, i)) > 0] = 0
    if zone is not None:
        rest &= zone
    scale = subject.scale[i] if np.isfinite(subject.scale[i]) else 0.0
    others = other_people.with_head(
        moving.groups(rest, other_people.JOIN_M * scale, other_people.LEAST_PX, _around(cover, box)), scale
    )
    return Look(says, off_m, others), rest


def _in_ellipse(mask: Mask, box: Floats) -> tuple[Bools, Mask]:
    """Which pixels of the ellipse in a box (4,) lie in the mask's picture, as a bool array of the box's part of it, and
    that part of the mask."""
    rows, columns = head_blur.inside((*np.floor(box[:2]), *np.ceil(box[2:])), *mask.shape)
    at = np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop)
    return head_blur.ellipse(box, *at), mask[rows, columns]


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
    body, around = _drawn_bust(subject, i, low, size, np.array([u, v]))
    # what is outside of the picture tells nothing
    reach = int(np.ceil(max(FARTHEST_M * scale, 2.0)))
    part = np.full(size[::-1] + 2 * reach, 0.5, np.float32)
    first = np.maximum(low - reach, 0)
    last = np.minimum(low + size + reach, (wide, high))
    at = first - low + reach
    part[at[1] : at[1] + last[1] - first[1], at[0] : at[0] + last[0] - first[0]] = mask[
        first[1] : last[1], first[0] : last[0]
    ]
    around[: max(int(np.floor(v - HAT_ABOVE_M * scale)) - low[1], 0)] = 0
    # pixels of the body that do not stand out, and pixels around it that do
    weights = around.astype(np.float32) - body
    wrong = cv2.matchTemplate(part, weights, cv2.TM_CCORR) + float(body.sum())
    row, column = np.unravel_index(int(wrong.argmin()), wrong.shape)
    here = part[row : row + size[1], column : column + size[0]]
    if here[body > 0].mean() < FILLED:
        return "unseen", nothing
    # clothes and hair leave it some room: the middle of the places that are as good
    good = (wrong <= wrong[row, column] + max(AS_GOOD * float(body.sum()), 0.5)).astype(np.uint8)
    _, pieces, _, middles = cv2.connectedComponentsWithStats(good)
    return "seen", (middles[pieces[row, column]] - reach) / scale


def _drawn_bust(subject: Subject, i: int, low: Ints, size: Ints, ears: Floats) -> tuple[Mask, Mask]:
    """In the part of the picture at `low`, two masks (height, width): what is head, shoulders, chest or upper arms
    whatever somebody wears, as the 3D has them, and what is neither these nor clothes or hair."""
    import cv2

    scale = subject.scale[i]
    # drawn finer, as a head 60 m away is three pixels wide
    fine = int(np.clip(np.ceil(32 / scale), 1, 4))
    found = np.zeros(size[::-1] * fine, np.uint8)

    limbs, trunk = subject.limbs[i][subject.upper], subject.trunk[i]
    limbs, trunk = limbs[np.isfinite(limbs).all(axis=(1, 2))], trunk[np.isfinite(trunk).all(axis=1)]
    points = np.concatenate([ears[None], limbs.reshape(-1, 2), trunk])
    points = np.clip(np.round((points - low + 0.5) * fine - 0.5), -30000, 30000).astype(np.int32)
    middle, lines = points[0].tolist(), points[1 : 1 + 2 * len(limbs)].reshape(-1, 2, 2).tolist()
    corners = cv2.convexHull(points[1 + 2 * len(limbs) :]) if len(trunk) > 2 else None
    for value, head, flesh in ((1, WORN_HEAD_M, CLOTHES_M), (2, BARE_HEAD_M, FLESH_M)):
        axes = np.maximum(np.round(np.array(head) * scale * fine), 1).astype(int)
        cv2.ellipse(found, middle, axes.tolist(), 0, 0, 360, value, -1)
        thick = max(int(round(2 * flesh[subject.of_markers] * scale * fine)), 1)
        for a, b in lines:
            cv2.line(found, a, b, value, thick)
        if corners is not None:
            cv2.fillConvexPoly(found, corners, value)
    if fine > 1:
        body, around = (
            cv2.resize((found == value).astype(np.float32), size.tolist(), interpolation=cv2.INTER_AREA)
            for value in (2, 0)
        )
        return (body > 0.5).astype(np.uint8), (around > 0.999).astype(np.uint8)
    return (found == 2).astype(np.uint8), (found == 0).astype(np.uint8)


def _body(shape: tuple[int, ...], subject: Subject, i: int) -> Mask:
    """1 where the subject may be below the chin."""
    import cv2

    found = np.zeros(shape, np.uint8)
    scale = subject.scale[i]
    if not np.isfinite(scale):
        return found
    thick = max(int(np.ceil(2 * BODY_M * scale)), 1)
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


def sure(says: Texts, off_m: Floats, cover_m: Floats, scale: Floats, times: Floats, told: Bools) -> Texts:
    """What is to be thought of each picture (F,): "ok", "unseen" or "beside".

    `says` (F,) of SAYS and `off_m` (F, 2) as of `Look`; `cover_m` (F, 4) as of `covers_m`; `scale` (F,) px per m;
    `times` (F,) s ascending; `told` (F,): something else tells where the head is, and it is covered there.
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
    first, last = (np.searchsorted(times, times + s, side="left" if s < 0 else "right") for s in (-WINDOW_S, WINDOW_S))
    n_known, n_judged = (np.concatenate([[0], np.cumsum(which)]) for which in (known, judged))
    share = (n_known[last] - n_known[first]) / np.maximum(n_judged[last] - n_judged[first], 1)
    out[judged & (share < SEEN_SHARE)] = "unseen"
    seen = (says == "seen") & covered & ~told
    off_px = np.where(seen[:, None], off_m * scale[:, None], np.nan)
    around = [steady(off_px[:, [axis]], times, s) for axis, s in enumerate((WINDOW_S, UPRIGHT_S))]
    out[seen & ~holds(cover_m, np.concatenate(around, axis=1) / scale[:, None])] = "beside"
    # a bust that is a part of the scene, for it hides the same place all the time, is found where it is not; where
    # something else tells of most pictures, the others do not speak for these
    if seen.any() and told[judged].mean() < SEEN_SHARE:
        common = np.nanmedian(off_px, axis=0) / scale[:, None]
        out[covered & ~told & ~holds(cover_m, common)] = "beside"
    if (out[judged] == "beside").mean() > BESIDE_SHARE:
        return np.full(len(says), "beside", object)
    return out


def steady(values: Floats, times: Floats, window_s: float) -> Floats:
    """The running median (F, N) of `values` (F, N) over what is known up to `window_s` before and after; NaN where
    nothing is."""
    out = np.full(values.shape, np.nan)
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    first = np.searchsorted(times[known], times - window_s)
    last = np.searchsorted(times[known], times + window_s, side="right")
    for i in np.flatnonzero(last > first):
        # as np.median, which takes ten times as long for so few
        near = np.sort(values[known[first[i] : last[i]]], axis=0)
        out[i] = (near[(len(near) - 1) // 2] + near[len(near) // 2]) / 2
    return out


def holds(cover_m: Floats, off_m: Floats, spare_m: float = 0.0, higher_m: float = HIGHER_M) -> Bools:
    """Whether (...,) the ellipse in `cover_m` (..., 4) m, left, top, right and bottom from the middle between the ears,
    holds a head, and `spare_m` around it, that is `off_m` (..., 2) m to the right of and below it, or up to `higher_m`
    higher than it holds. False for NaN.
    """
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    outline = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * (np.array(LARGE_HEAD_M) + spare_m)
    middle, half = (cover_m[..., :2] + cover_m[..., 2:]) / 2, (cover_m[..., 2:] - cover_m[..., :2]) / 2
    with np.errstate(invalid="ignore"):
        off_m = np.stack([off_m[..., 0], off_m[..., 1] + np.clip(-off_m[..., 1], 0, higher_m)], axis=-1)
        from_middle = (off_m - middle)[..., None, :] + outline
        return np.asarray(((from_middle / half[..., None, :]) ** 2).sum(axis=-1).max(axis=-1) <= 1)


def told_where(subject: Subject, cover_m: Floats, off_m: Floats) -> tuple[Bools, list[Ints]]:
    """In which pictures (F,) something else than the bust tells where the head is, near the cover, and by picture boxes
    (N, 4) px around that place where the cover is not sure to hold it.

    `cover_m` (F, 4) as of `covers_m`; `off_m` (F, 2) m to the right of and below the 3D, NaN where nothing is told.
    """
    told = np.isfinite(cover_m).all(axis=1) & (np.linalg.norm(off_m, axis=1) <= TOLD_M)
    beside = told & ~holds(cover_m, off_m, TOLD_SPARE_M, 0.0)
    reach = np.array(LARGE_HEAD_M) + TOLD_SPARE_M
    ears = subject.head + np.array([0.0, head_model.RAISED_M]) * subject.scale[:, None]
    boxes: list[Ints] = [np.zeros((0, 4), int)] * len(told)
    for i in np.flatnonzero(beside):
        ends = [ears[i] + (off_m[i] + side * reach) * subject.scale[i] for side in (-1, 1)]
        boxes[i] = np.concatenate([np.floor(ends[0] + 0.5), np.ceil(ends[1] + 0.5)]).astype(int)[None]
    return told, boxes


def covers_m(subject: Subject) -> Floats:
    """The covers (F, 4) m from the middle between the ears: left, top, right, bottom; NaN none."""
    ears = subject.head + np.array([0.0, head_model.RAISED_M]) * subject.scale[:, None]
    return (subject.edges - 0.5 - np.tile(ears, 2)) / subject.scale[:, None]
