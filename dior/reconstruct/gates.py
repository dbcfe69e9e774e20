"""What a body cannot do: be somewhere else the next instant, or have bones of other lengths.

INPUTS   triangulated joints (T, J, 3) m, their covariance, the rate of the instants
OUTPUTS  which joints are implausible (T, J)
Two views that agree on another person, or on a wrong thing, pass every test in pixels; they do not pass these.
"""

from collections.abc import Sequence

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.names import bones_of
from dior.reconstruct.timeline import instants_within

SIGMAS = 4.0  # a gate opens by so many standard deviations of what it looks at; chosen
MOST_MISSING_S = 0.5  # after a longer gap the body may be anywhere; chosen: at 8 m/s that is 4 m, most of a walkway
BODY = ("left_hip", "right_hip", "left_shoulder", "right_shoulder", "LASI", "RASI", "LSHO", "RSHO")
# What a way costs, as the share of the instants that it takes at the highest speed: a way there and back is not worth
# the fewer instants that it explains. Below 1, or the fastest would be a stranger; chosen: a
# limb may move faster than the body for longer, so that its way costs less.
DETOUR_BODY, DETOUR_JOINT = 0.8, 0.35
FEWEST_S = 1 / 3  # a bone's usual length needs so much of it; chosen: the swing of a leg, 10 pictures at 30 Hz


def implausible(
    points: Floats,
    covariance: Floats,
    names: Sequence[str],
    fps: float,
    max_speed: float,
    max_body_speed: float,
    max_bone_change: float,
) -> Bools:
    """Whether (T, J) each known joint cannot be where it is.

    First the middle of the body, with all its joints, then each joint: the best history is kept in which it moves no
    faster than the speed (m/s). Then bones whose length is off their median by more than the share `max_bone_change`.
    """
    known = np.all(np.isfinite(points), axis=-1)
    variance = np.where(known, np.trace(covariance, axis1=-2, axis2=-1), np.nan)
    trunk = [names.index(name) for name in BODY if name in names] or list(range(len(names)))
    few = known[:, trunk].sum(axis=1)
    weight = known[:, trunk] / np.maximum(few, 1)[:, None]
    middle = np.einsum("tj,tjx->tx", weight, np.where(known[..., None], points, 0.0)[:, trunk])
    spread = np.einsum("tj,tj->t", weight, np.where(known, variance, 0.0)[:, trunk])
    stranger = (few > 0) & ~_reachable(
        middle[:, None], spread[:, None], few[:, None] > 0, fps, max_body_speed, DETOUR_BODY
    )[:, 0]
    bad = known & stranger[:, None]
    bad |= known & ~bad & ~_reachable(points, variance, known & ~bad, fps, max_speed, DETOUR_JOINT)
    return bad | _odd_bones(points, variance, known & ~bad, names, fps, max_bone_change)


def _reachable(points: Floats, variance: Floats, known: Bools, fps: float, speed: float, detour: float) -> Bools:
    """Which of the known points (T, K, 3) belong to the best history without a jump, (T, K) bool, each k on its own.

    The best has the most instants, less `detour` of those that its way takes at `speed`. Dynamic programming over the
    instants: a point follows one of the last `MOST_MISSING_S` that is near enough for the time in between, or anything
    before.
    """
    count, each = known.shape
    window = max(1, instants_within(MOST_MISSING_S, fps))
    worth, previous = np.full((count, each), -np.inf), np.full((count, each), -1)
    highest, where = np.zeros(each), np.full(each, -1)  # of what is older than the window
    columns = np.arange(each)
    for t in range(count):
        older = t - window - 1
        if older >= 0:
            more = worth[older] > highest
            highest, where = np.where(more, worth[older], highest), np.where(more, older, where)
        since = np.arange(max(0, t - window), t)
        best, before = highest, where
        if len(since):
            far = np.sqrt(((points[since] - points[t]) ** 2).sum(axis=-1))
            reach = speed * (t - since)[:, None] / fps + SIGMAS * np.sqrt(variance[since] + variance[t])
            gain = np.where(known[since] & (far <= reach), worth[since] - detour * fps / speed * far, -np.inf)
            last = gain.argmax(axis=0)
            better = gain[last, columns] > highest
            best = np.where(better, gain[last, columns], highest)
            before = np.where(better, since[last], where)
        worth[t] = np.where(known[t], best + 1, -np.inf)
        previous[t] = before
    keep = np.zeros((count, each), bool)
    at = np.where(known.any(axis=0), worth.argmax(axis=0), -1)
    while (at >= 0).any():
        on = columns[at >= 0]
        keep[at[on], on] = True
        at[on] = previous[at[on], on]
    return keep


def _odd_bones(points: Floats, variance: Floats, known: Bools, names: Sequence[str], fps: float, most: float) -> Bools:
    """Joints (T, J) at the end of bones that are too long or too short. Of the two ends the one with more such bones.

    With as many at both ends it is the farther one from the trunk, which detectors get wrong more often.
    """
    bones = bones_of(names)
    bad = np.zeros(known.shape, bool)
    if not len(bones):
        return bad
    a, b = bones.T
    with np.errstate(invalid="ignore"):
        length = np.where(known[:, a] & known[:, b], np.linalg.norm(points[:, a] - points[:, b], axis=-1), np.nan)
    enough = np.isfinite(length).sum(axis=0) >= round(FEWEST_S * fps)
    usual = np.full(len(bones), np.nan)
    usual[enough] = np.nanmedian(length[:, enough], axis=0)
    with np.errstate(invalid="ignore"):
        odd = np.abs(length - usual) > most * usual + SIGMAS * np.sqrt(variance[:, a] + variance[:, b])
    count = np.zeros(known.shape, int)
    for bone, (one, two) in enumerate(bones):
        count[:, one] += odd[:, bone]
        count[:, two] += odd[:, bone]
    for bone, (one, two) in enumerate(bones):
        near = count[:, one] > count[:, two]
        bad[:, one] |= odd[:, bone] & near
        bad[:, two] |= odd[:, bone] & ~near
    return bad
