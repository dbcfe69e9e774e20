"""Where the head is in the world, from whatever joints or markers of it there are, and how large it is.

INPUTS   world points (F, J, 3) m, joints or Plug-in-Gait markers, Z up; their times
OUTPUTS  the middle between the ears (F, 3) m with its own error (F,) m; half lengths of an ellipsoid that holds a head
The ellipsoid is round about the vertical: which way somebody looks is what detectors tell worst, and a head turned away
has to be covered as well. It is in metres, not in statures: heads differ less than people do.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.names import mirrored

# places (forward, left, up) m in the head's axes by joint
Places: TypeAlias = dict[str, tuple[float, float, float]]
# Half lengths (horizontal, vertical) m, and how far the ellipsoid's middle is above that between the ears. A man's head
# is 0.20 m long, 0.15 m broad and 0.23 m high on average, his nose 0.02 m before it; the rest is hair and larger heads.
# Chosen; `python -m benchmarks.blur` prints how much of the simulated heads they cover.
RADII_M = (0.15, 0.20)
RAISED_M = 0.01
# Places in the head's axes (forward, left, up) m, from the middle between the ears: detectors put the face where a
# mean one has it, and Plug-in-Gait's four markers are on the temples and behind them (Vicon, Plug-in Gait reference).
# Chosen by the proportions of a head as large as that of RADII_M.
HEAD = {
    "nose": (0.115, 0.0, -0.025),
    "left_ear": (0.0, 0.075, 0.0),
    "left_eye": (0.090, 0.032, 0.020),
    "left_eye_inner": (0.095, 0.017, 0.020),
    "left_eye_outer": (0.083, 0.047, 0.020),
    "left_mouth": (0.092, 0.025, -0.060),
    "head": (0.0, 0.0, 0.130),
    "LFHD": (0.075, 0.060, 0.050),
    "LBHD": (-0.075, 0.060, 0.050),
}
# the same of what is below it, for recordings without a face; chosen: good to TRUNK_SIGMA_M, as a neck bends
TRUNK = {
    "neck": (-0.02, 0.0, -0.20),
    "left_shoulder": (-0.02, 0.19, -0.20),
    "LSHO": (-0.02, 0.17, -0.15),
    "C7": (-0.09, 0.0, -0.14),
    "CLAV": (0.05, 0.0, -0.21),
}
TRUNK_SIGMA_M = 0.04
# How a head moves where nobody sees it: a straight line at one speed, but for an acceleration of this much (m/s^2; of
# simulated walkers it is 1.5 rms, of runners 7, mostly up and down). Beyond these times it may be anywhere.
ACCELERATION, MAX_GAP_S, MAX_BEYOND_S = 1.5, 0.5, 0.15
# s, over which the speed at an end of what is known is fitted; chosen: 5 instants at 30 Hz
SPEED_S = 0.15
# Two cameras may agree on a stranger for a moment. The head is on the longest chain of instants in which it goes no
# further than at SLOW_M_S or FASTER times its own usual speed, and JUMP_M for noise and steps; after AWAY_S it may be
# anywhere. Chosen: wider lets a stranger in who passes close by, narrower leaves out the head of who turns.
SLOW_M_S, FASTER, JUMP_M, AWAY_S = 1.5, 1.5, 0.08, 1.0


def _with_mirrored(places: Places) -> Places:
    other = {mirrored(name): (f, -side, u) for name, (f, side, u) in places.items() if mirrored(name) != name}
    return places | other


HEAD, TRUNK = _with_mirrored(HEAD), _with_mirrored(TRUNK)


def centres(points: Floats, names: Sequence[str]) -> tuple[Floats, Floats]:
    """The middle between the ears (F, 3) m of points (F, J, 3) called `names`, and its error (F,) m, 1 sigma, beyond
    that of the points; NaN where neither head nor shoulders are known."""
    left = _left(points, names, HEAD)
    left = np.where(np.isfinite(left), left, _left(points, names, TRUNK))
    by_head, by_trunk = (_fitted(points, names, places, left) for places in (HEAD, TRUNK))
    known = np.isfinite(by_head[:, 0])
    middle = np.where(known[:, None], by_head, by_trunk)
    sigma = np.where(known, 0.0, TRUNK_SIGMA_M)
    return middle, np.where(np.isfinite(middle[:, 0]), sigma, np.nan)


def used(names: Sequence[str]) -> Bools:
    """Which of the joints `names` tell where the head is: (J,) bool; those of the trunk where there is no other."""
    of_head = np.array([name in HEAD for name in names], bool)
    return of_head if of_head.any() else np.array([name in TRUNK for name in names], bool)


def _left(points: Floats, names: Sequence[str], places: Places) -> Floats:
    """Horizontal unit vector (F, 3) to the person's left, from the pairs there are; NaN without any."""
    at = {name: i for i, name in enumerate(names)}
    pairs = [(at[n], at[mirrored(n)]) for n, (_, left, _) in places.items() if left > 0 and {n, mirrored(n)} <= {*at}]
    if not pairs:
        return np.full((len(points), 3), np.nan)
    apart = np.nansum([points[:, i] - points[:, j] for i, j in pairs], axis=0) * (1.0, 1.0, 0.0)
    length = np.linalg.norm(apart, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(length > 0, apart / np.where(length > 0, length, 1.0), np.nan)


def _fitted(points: Floats, names: Sequence[str], places: Places, left: Floats) -> Floats:
    """Mean (F, 3) of where each joint of `places` says that the middle between the ears is."""
    up = np.array([0.0, 0.0, 1.0])
    axes = np.stack([np.cross(left, up), left, np.broadcast_to(up, left.shape)], axis=1)
    mine = [i for i, name in enumerate(names) if name in places]
    if not mine:
        return np.full((len(points), 3), np.nan)
    each = points[:, mine] - np.array([places[names[i]] for i in mine]) @ axes
    known = np.isfinite(each).all(axis=-1)
    count = known.sum(axis=1)[:, None]
    total = np.where(known[..., None], each, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def steady(times: Floats, middle: Floats, filled: Bools) -> Floats:
    """The same (F, 3) m at ascending `times` (F,) s without what is somebody else's: NaN off the longest chain.

    `filled` (F,) bool: what was put between others, which goes with those.
    """
    known = np.isfinite(middle[:, 0])
    seen = np.flatnonzero(known & ~filled)
    if not len(seen):
        return middle
    good = np.zeros(len(times), bool)
    good[seen] = _longest(times[seen], middle[seen])
    after = np.searchsorted(seen, np.arange(len(times)))
    before, after = seen[np.maximum(after - 1, 0)], seen[np.minimum(after, len(seen) - 1)]
    good |= known & filled & good[before] & good[after]
    return np.where(good[:, None], middle, np.nan)


def _longest(t: Floats, at: Floats) -> Bools:
    """Whether each point `at` (N, 3) at ascending `t` (N,) s is on the longest chain: (N,) bool."""
    limit = _usual_speed(t, at)
    length, came = np.ones(len(t), int), np.full(len(t), -1)
    longest_before = 0
    best_so_far, best_at = np.zeros(len(t), int), np.zeros(len(t), int)
    for j in range(len(t)):
        while t[j] - t[longest_before] > AWAY_S:
            longest_before += 1
        # as a rule the instant before is near, and the end of the longest chain up to there
        if longest_before < j and best_at[j - 1] == j - 1:
            if math.dist(at[j - 1], at[j]) <= limit * (t[j] - t[j - 1]) + JUMP_M:
                came[j], best_at[j] = j - 1, j
                length[j] = best_so_far[j] = length[j - 1] + 1
                continue
        far = np.linalg.norm(at[longest_before:j] - at[j], axis=1)
        near = np.flatnonzero(far <= limit * (t[j] - t[longest_before:j]) + JUMP_M) + longest_before
        found = [near[np.argmax(length[near])]] if len(near) else []
        if longest_before:
            found.append(best_at[longest_before - 1])
        if found:
            came[j] = max(found, key=lambda i: length[i])
            length[j] += length[came[j]]
        best_at[j] = j if j == 0 or length[j] > best_so_far[j - 1] else best_at[j - 1]
        best_so_far[j] = length[best_at[j]]
    good, j = np.zeros(len(t), bool), best_at[-1]
    while j >= 0:
        good[j] = True
        j = came[j]
    return good


def _usual_speed(t: Floats, at: Floats) -> float:
    """Speed (m/s) that a head of this recording does not exceed for long."""
    step = np.searchsorted(t, t + 0.2)
    first = np.flatnonzero((step < len(t)) & (t[np.minimum(step, len(t) - 1)] - t < 0.4))
    if not len(first):
        return SLOW_M_S
    speed = np.linalg.norm(at[step[first]] - at[first], axis=1) / (t[step[first]] - t[first])
    return max(SLOW_M_S, FASTER * float(np.median(speed)), float(np.percentile(speed, 90)))


def at_times(when: Floats, times: Floats, middle: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Middles (P, 3) m and their own error (P,) m at `when` (P,) s, from those at `times` (F,) s, NaN where missing.

    On a straight line at one speed between what is known, and a little beyond it; the error grows with the time from
    there, and where that is too long ago there is nothing.
    """
    known = np.isfinite(middle[:, 0])
    t, at, own = times[known], middle[known], sigma[known]
    out, error = np.full((len(when), 3), np.nan), np.full(len(when), np.nan)
    if len(t) < 2:
        return out, error
    after = np.clip(np.searchsorted(t, when), 1, len(t) - 1)
    gap, since = t[after] - t[after - 1], when - t[after - 1]
    inside = (since >= 0) & (since <= gap) & (gap <= MAX_GAP_S)
    share = (since / gap)[:, None]
    out[inside] = (at[after - 1] * (1 - share) + at[after] * share)[inside]
    error[inside] = np.hypot(own[after - 1], ACCELERATION / 2 * since * (gap - since))[inside]
    for end, beyond in ((0, t[0] - when), (-1, when - t[-1])):
        near = np.abs(t - t[end]) <= SPEED_S
        mine = (beyond > 0) & (beyond <= MAX_BEYOND_S)
        if near.sum() < 2 or not mine.any():
            continue
        speed = np.polyfit(t[near] - t[end], at[near], 1)[0]
        out[mine] = at[end] + (when[mine] - t[end])[:, None] * speed
        error[mine] = np.hypot(own[end], ACCELERATION / 2 * (beyond[mine] + SPEED_S) * beyond[mine])
    return out, error
