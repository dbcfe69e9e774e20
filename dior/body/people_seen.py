"""Who is where: the people that several placed cameras see together, before it is known which of them is the subject.

INPUTS   placed cameras, the people that each camera's detector gave at some instants: pixels (V, K, T, J, 2) of at most
         K people a view, whether a joint counts (V, K, T, J), and the track (V, K, T) of each, -1 for nobody
OUTPUTS  `Sighting`s: a body at an instant, with the views whose rays meet in it, or of one view alone
World metres, Z up, floor at Z = 0; recorded pixels. Errors are in sizes of the body in the picture, so that they mean
the same near and far. Of left and right joints the middles are compared: a detector that exchanges them has not found
another person.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.body.names import swap_index
from dior.body.plausible import stature
from dior.body.proportions import SHANK, STATURE_SHARE, THIGH, TRUNK
from dior.geometry import camera as cam
from dior.geometry import covariance
from dior.geometry.camera import Camera
from dior.geometry.triangulation import meet_in_blocks, rig_of, views_of

# joints that are far apart on every body and that all detectors have; of other sets all joints are taken
KEY = tuple(
    f"{side}_{part}" for part in "hip shoulder knee ankle elbow wrist ear".split() for side in ("left", "right")
)
KEY = (*KEY, "nose")
FEWEST = 4  # middles of joints that two views must share; chosen: a trunk and one limb
# a pair of views meets in one body up to this median error, in sizes of the body in the picture. Chosen: detectors err
# by 0.02; another person who stands half a metre aside is 0.1 off
MEETS = 0.04
# chosen: a detection this near to a body belongs to it, though the rays do not meet well
NEAR = 0.1
# chosen: from the highest to the lowest key joint of anybody upright who walks there, m; two rays of different people
# that meet by chance meet too near or too far, in a giant or a dwarf
SPAN_M = (0.8, 2.2)
ANKLE_M = 0.08  # height of an ankle that stands; chosen, as Drillis and Contini's 0.039 of the stature and a sole
# chosen: so far, m, may a foot on the floor by one view be from the body's middle: half a step, a foot that is up
FOOT_M = 0.6
TALL_M = 1.7  # of the bones that errors make longer; chosen, anybody's
EAR_SHARE = 0.936  # of the stature, Drillis and Contini (1966): the eyes' height, in which the ears are


@dataclass(frozen=True, eq=False)
class Sighting:
    """A body at instant `t`: its `place` (3,) m between the hips, `members` (V,) the person of each view or -1, whose
    rays `meet` (V,) in it and who stands there by that view alone; others lie near.

    `middles` (M, 3) m of its joints, NaN where not known; `stature` m, NaN where the joints do not tell; `alone`: one
    view only, whose place is that of the feet on the floor; `sure`: two views or more have no other person whose rays
    meet as well; `longer`: by how much the detector's errors make `stature` longer in the mean, m.
    """

    t: int
    place: Floats
    members: Ints
    middles: Floats
    stature: float
    alone: bool
    meet: Bools
    sure: bool = True
    longer: float = 0.0


@dataclass(frozen=True, eq=False)
class Joints:
    """What is compared: the `columns` of the joints, the names `of` them, and pairs (M, 2) whose middles are taken."""

    columns: Ints
    names: tuple[str, ...]
    pairs: Ints


def joints_of(names: Sequence[str]) -> Joints:
    """The `Joints` of a detector's."""
    columns = [i for i, name in enumerate(names) if name in KEY] or list(range(len(names)))
    own = tuple(names[i] for i in columns)
    mirror = swap_index(own)
    return Joints(np.array(columns), own, np.array([(i, m) for i, m in enumerate(mirror.tolist()) if i <= m]))


def sightings(
    cameras: Sequence[Camera], uv: Floats, seen: Bools, names: Sequence[str], meets: float = MEETS
) -> list[list[Sighting]]:
    """The `Sighting`s of each instant. `meets`: the largest error of rays that meet; larger while poses are rough.

    Of the sets of people, one of a view, whose rays meet, those of the most views come first, then the best.
    """
    joints = joints_of(names)
    uv, seen = uv[:, :, :, joints.columns], seen[:, :, :, joints.columns]
    size = sizes(uv, seen)
    middle, both = middles(uv, seen, joints)
    sets = _meeting(cameras, middle, both, size, meets)
    out = []
    for t, chosen in enumerate(_disjoint(sets, uv.shape[2])):
        bodies = [_body(cameras, joints, uv[:, :, t], seen[:, :, t], t, *one) for one in chosen]
        known = [body for body in bodies if body is not None]
        out.append(_with_others(cameras, joints, uv[:, :, t], seen[:, :, t], size[:, :, t], t, known))
    return out


def sizes(uv: Floats, seen: Bools) -> Floats:
    """Diagonal (...,) px, at least 1, of the box around joints (..., J, 2) that are `seen`; NaN where none is."""
    low = np.where(seen[..., None], uv, np.inf).min(axis=-2)
    high = np.where(seen[..., None], uv, -np.inf).max(axis=-2)
    with np.errstate(invalid="ignore"):
        size = np.maximum(np.hypot(*np.moveaxis(high - low, -1, 0)), 1.0)
    return np.where(seen.any(axis=-1), size, np.nan)


def middles(uv: Floats, seen: Bools, joints: Joints) -> tuple[Floats, Bools]:
    """Middles (..., M, 2) of joints (..., J, 2) and of their mirrors, and whether both are seen (..., M)."""
    a, b = joints.pairs.T
    return (uv[..., a, :] + uv[..., b, :]) / 2, seen[..., a] & seen[..., b]


def _meeting(
    cameras: Sequence[Camera], middle: Floats, both: Bools, size: Floats, meets: float
) -> dict[tuple[int, ...], Floats]:
    """Sets of people, the one of each view or -1, by their error (T,) in body sizes; infinite if they do not meet."""
    views, each, count = size.shape
    found: dict[tuple[int, ...], Floats] = {}
    nowhere = np.full(count, np.inf)
    for some in range(2, views + 1):
        for chosen in combinations(range(views), some):
            for people in product(range(each), repeat=some):
                members = tuple(people[chosen.index(v)] if v in chosen else -1 for v in range(views))
                there: Bools = np.all(np.isfinite(size[chosen, people]), axis=0)
                for out in range(some) if some > 2 else ():
                    rest = tuple(-1 if v == chosen[out] else who for v, who in enumerate(members))
                    there &= np.isfinite(found.get(rest, nowhere))
                if there.any():
                    error = np.full(count, np.inf)
                    error[there] = _error(cameras, chosen, people, middle, both, size, there)
                    error[error > meets] = np.inf
                    found[members] = error
    return found


def _error(
    cameras: Sequence[Camera],
    chosen: tuple[int, ...],
    people: tuple[int, ...],
    middle: Floats,
    both: Bools,
    size: Floats,
    there: Bools,
) -> Floats:
    """Median error (n,), in body sizes, of one set of people at the instants `there`; infinite where it is nobody."""
    rows = np.flatnonzero(there)
    uv, w = middle[chosen, people][:, rows], both[chosen, people][:, rows].astype(float)
    rig = rig_of([cameras[v] for v in chosen])
    points, chi2 = meet_in_blocks(views_of(rig, uv, w))
    shape = w.shape[1:]
    say = (w > 0).sum(axis=0)
    error = np.sqrt(chi2.reshape(shape) / np.maximum(2 * say - 3, 1))
    # what lies behind a camera is not met at all
    error = np.where(say >= 2, np.nan_to_num(error, nan=np.inf), np.nan)
    count = (say >= 2).sum(axis=1)
    ordered = np.sort(error, axis=1)
    median = ordered[np.arange(len(rows)), np.maximum(count - 1, 0) // 2]
    height = (points[2] + rig.origin[2]).reshape(shape)
    known = np.isfinite(height) & (say >= 2)
    span = np.where(known, height, -np.inf).max(axis=1) - np.where(known, height, np.inf).min(axis=1)
    upright = (span <= SPAN_M[1]) & ((span >= SPAN_M[0]) | (count < shape[1] / 2))
    return np.where((count >= FEWEST) & upright, median / size[chosen, people][:, rows].mean(axis=0), np.inf)


def _disjoint(sets: dict[tuple[int, ...], Floats], count: int) -> Iterator[list[tuple[tuple[int, ...], bool]]]:
    """Per instant the sets that share nobody, those of the most views first, then the best; and if each is sure."""
    names = list(sets)
    views = np.array([_count(members) for members in names], int)
    errors = np.array([sets[members] for members in names]).reshape(len(names), count)
    for t in range(count):
        meeting = np.flatnonzero(np.isfinite(errors[:, t]))
        taken: set[tuple[int, int]] = set()
        chosen = []
        for i in meeting[np.lexsort((errors[meeting, t], -views[meeting]))].tolist():
            people = {(v, who) for v, who in enumerate(names[i]) if who >= 0}
            if not people & taken:
                taken |= people
                chosen.append(names[i])
        others = [names[i] for i in meeting.tolist()]
        yield [(members, _sure(members, chosen, others)) for members in chosen]


def _sure(members: tuple[int, ...], chosen: Sequence[tuple[int, ...]], meeting: Sequence[tuple[int, ...]]) -> bool:
    """Whether two views of a set or more have nobody else whose rays meet those of the other views as well.

    Another of the sets that are `meeting` speaks against it where it has as many views, takes nobody whom more views
    see elsewhere, and is no more like another of the `chosen` sets.
    """
    views = _count(members)
    bound = {(v, who) for other in chosen if _count(other) > views for v, who in enumerate(other)}
    told = {v for v, who in enumerate(members) if who >= 0}
    for other in meeting:
        alike = _alike(other, members)
        if not alike or _count(other) < views or alike < max(_alike(other, one) for one in chosen):
            continue
        against = {(v, who) for v, who in enumerate(other) if who >= 0 and -1 < members[v] != who}
        if not against & bound:
            told -= {v for v, _ in against}
    return len(told) >= 2


def _alike(one: tuple[int, ...], other: tuple[int, ...]) -> int:
    """How many people two sets have in common."""
    return sum(a == b >= 0 for a, b in zip(one, other, strict=True))


def _count(members: tuple[int, ...]) -> int:
    """How many views a set has."""
    return sum(who >= 0 for who in members)


def _body(
    cameras: Sequence[Camera], joints: Joints, uv: Floats, seen: Bools, t: int, members: Sequence[int], sure: bool
) -> Sighting | None:
    """The body of several views at one instant; uv (V, K, J, 2), seen (V, K, J). None where they meet nowhere."""
    views = [v for v, who in enumerate(members) if who >= 0]
    own = uv[views, [members[v] for v in views]]
    say = seen[views, [members[v] for v in views]]
    rig = rig_of([cameras[v] for v in views])
    middle, both = middles(own, say, joints)
    stacked = np.concatenate([own, middle], axis=1)[:, None]
    points, chi2 = meet_in_blocks(views_of(rig, stacked, np.concatenate([say, both], axis=1)[:, None].astype(float)))
    points = points.T + rig.origin
    limit = 2 * MEETS * float(np.mean(sizes(own, say)))
    free = np.maximum(2 * np.concatenate([say, both], axis=1).sum(axis=0) - 3, 1)
    good = np.sqrt(chi2 / free) <= limit  # false for NaN
    points = np.where(good[:, None], points, np.nan)
    each = len(joints.names)
    place = _place(points[each:], joints)
    if not np.isfinite(place).all():
        return None
    meet = np.array(members) >= 0
    for v, one, there in zip(views, own, say, strict=True):
        foot = _foot(cameras[v], joints, one, there)
        meet[v] = foot is None or np.linalg.norm((foot - place)[:2]) <= FOOT_M
    return Sighting(
        t,
        place,
        np.array(members),
        points[each:],
        stature(points[None, :each], joints.names),
        False,
        meet,
        sure,
        _longer([cameras[v] for v in views], place, chi2[:each][good[:each]], free[:each][good[:each]]),
    )


def _longer(cameras: Sequence[Camera], place: Floats, chi2: Floats, free: Ints) -> float:
    """By how much errors make the bones that tell a stature longer in the mean, as a difference of it, m.

    `chi2` px^2 and degrees of freedom `free` (J,) of the joints of a body at `place` (3,) m. Of a vertical bone of
    length L between two joints whose places vary by s^2 along each horizontal axis, the mean length is L + 2 s^2 / L,
    to second order; the trunk is between middles of two joints. From two cameras that face each other, s is a multiple
    of what it is from cameras around; triangulation itself makes bones shorter there, by up to half of this.
    """
    if not len(chi2):
        return 0.0
    # the median of chi squared, by Wilson and Hilferty (1931)
    variance = np.median(chi2 / free / (1 - 2 / (9 * free)) ** 3)
    spread, _ = covariance.triangulated(cameras, place, np.broadcast_to(np.eye(2), (len(cameras), 2, 2)))
    by_bone = (1 / THIGH + 1 / SHANK + 0.5 / TRUNK) / (STATURE_SHARE * TALL_M)
    return float(variance * (spread[0, 0] + spread[1, 1]) * by_bone)


def _place(middle: Floats, joints: Joints) -> Floats:
    """Where a body is (3,): the middle of its hips, or of what is known of it."""
    for part in ("left_hip", "left_shoulder"):
        if part in joints.names:
            at = middle[np.flatnonzero(joints.pairs[:, 0] == joints.names.index(part))]
            if np.isfinite(at).all():
                return at[0]
    known = np.isfinite(middle).all(axis=1)
    return middle[known].mean(axis=0) if known.any() else np.full(3, np.nan)


def _with_others(
    cameras: Sequence[Camera], joints: Joints, uv: Floats, seen: Bools, size: Floats, t: int, bodies: list[Sighting]
) -> list[Sighting]:
    """The bodies of several views with the people of other views that are near them, and the people who are left."""
    left = {(v, k) for v, k in np.argwhere(np.isfinite(size)).tolist()}
    left -= {(v, int(who)) for body in bodies for v, who in enumerate(body.members) if who >= 0}
    for body in bodies:
        for v, k in sorted(left):
            if body.members[v] < 0:
                middle, both = middles(uv[v, k], seen[v, k], joints)
                if away(cameras[v], body.middles, middle, both, size[v, k]) <= NEAR:
                    body.members[v] = k
                    left.discard((v, k))
    return bodies + [
        alone for v, k in sorted(left) if (alone := _alone(cameras, joints, uv[v, k], seen[v, k], t, v, k)) is not None
    ]


def away(camera: Camera, body: Floats, middle: Floats, both: Bools, size: Floats) -> Floats:
    """How far middles (..., M, 2) px, where `both` (..., M), lie from a projected `body` (..., M, 3) m.

    The median of the distances (...,) in the body's `size` (...,) px; infinite where too little is known of both.
    """
    with np.errstate(invalid="ignore"):
        projected, depth = cam.project(camera, body)
        off = np.linalg.norm(projected - middle, axis=-1)
    known = both & np.isfinite(off) & (depth > 0)
    count = known.sum(axis=-1)
    ordered = np.sort(np.where(known, off, np.inf), axis=-1)
    median = np.take_along_axis(ordered, np.maximum(count - 1, 0)[..., None] // 2, axis=-1)[..., 0]
    return np.where(count >= FEWEST, median / size, np.inf)


def _foot(camera: Camera, joints: Joints, uv: Floats, seen: Bools) -> Floats | None:
    """Where (3,) the lower foot of a detection meets the floor; None where it does not."""
    at = {name: i for i, name in enumerate(joints.names)}
    feet = [at[name] for name in ("left_ankle", "right_ankle") if name in at and seen[at[name]]]
    if not feet:
        return None
    # the lower one of the world: the camera may be upside down
    rays = cam.rays(camera, uv[feet])
    ray = rays[int((rays[:, 2] / np.linalg.norm(rays, axis=1)).argmin())]
    if ray[2] * (ANKLE_M - camera.centre[2]) <= 0:
        return None
    return np.asarray(camera.centre + ray * (ANKLE_M - camera.centre[2]) / ray[2])


def _alone(
    cameras: Sequence[Camera], joints: Joints, uv: Floats, seen: Bools, t: int, view: int, person: int
) -> Sighting | None:
    """A body that one view sees: where its lower foot meets the floor, its stature from the ears above; or None."""
    camera = cameras[view]
    place = _foot(camera, joints, uv, seen)
    if place is None:
        return None
    at = {name: i for i, name in enumerate(joints.names)}
    tall = np.nan
    ears = [at[name] for name in ("left_ear", "right_ear", "nose") if name in at and seen[at[name]]]
    if ears:
        up = cam.rays(camera, uv[ears].mean(axis=0))
        across = np.linalg.norm(up[:2])
        tall = (camera.centre[2] + up[2] / across * np.linalg.norm((place - camera.centre)[:2])) / EAR_SHARE
    members = np.full(len(cameras), -1)
    members[view] = person
    return Sighting(t, place, members, np.full((len(joints.pairs), 3), np.nan), float(tall), True, members >= 0)
