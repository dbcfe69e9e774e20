"""Left and right exchanged by a detector, or one limb taken for the other: decided from all views and over time.

A detector that sees a person from behind may call the left side right, or only the left leg. Every view alone looks
fine; together they do not meet. For each combination of exchanged views the paired joints are triangulated and their
disagreement taken; the sequence of combinations with the least total cost is found by dynamic programming (Viterbi
1967), first for the whole body, then for what is left of the legs and of the rest alone. Exchanging every view gives
the same pixels, so that the side itself is kept by the continuity of the 3D joints and a small price per exchanged
view.

Two views may also put both names on one limb. They agree with each other and not with the third, which is right. It
shows in that their left and their right limb lie on one another in both pictures.
"""

import itertools
import warnings
from collections.abc import Sequence

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table
from dior.body.names import LIMBS, is_leg, swap_index
from dior.geometry.camera import Camera
from dior.geometry.triangulation import Views, meet_in_blocks, rig_of, views_of
from dior.tables import tables

# The prices are chosen: lower ones find shorter exchanges, and more that are none. Of the 33 exchanged pictures of a
# real walk (tests/reconstruct/test_real_outdoor.py) they find all.
PERIOD_S = 1 / 30  # costs are of time: so much of it counts one, whatever the rate of the instants
CAP = 6.0  # an error counts up to this many times the usual one, so that one wild joint does not decide
PRICE_CHANGE = 1.0  # per view that begins or ceases to be exchanged, in units of the usual error: swaps come in runs
PRICE_SWAPPED = 0.02  # per view and `PERIOD_S`: of two equal explanations the one with fewer exchanged views
STEP_M = 0.1  # a mean movement of the paired joints between instants that costs one usual error
MOST_STATES = 32  # all combinations of five views; more take too long
PRICE_BEGIN = 4.0  # that two views begin or cease to take one limb for the other, in units of chi squared per equation
FITS = 4.0  # the two limbs lie on one another in a picture where half their joints do, up to this chi squared
JUMP_M_S = 4.5  # a limb's speed from which on its movement counts: that of the foot in the swing of a brisk walk
PRICE_WRONG = 0.3  # per `PERIOD_S`, the same


def combinations(views: int) -> Bools:
    """Which views are exchanged, (S, V) bool: all of them up to five views, else at most two at a time."""
    every = np.array(list(itertools.product((False, True), repeat=views)))
    return every if len(every) <= MOST_STATES else every[every.sum(axis=1) <= 2]


def exchange(values: Floats, swapped: Bools, names: Sequence[str]) -> Floats:
    """Exchange left and right joints of values (V, T, J, ...) where `swapped` (V, T) or (V, T, J) says so."""
    index = swap_index(names)
    mask = swapped if swapped.ndim == 3 else swapped[:, :, None]
    mask = mask.reshape(*mask.shape, *(1,) * (values.ndim - 3))
    return np.where(mask, values[:, :, index], values)


def in_table(table: Table, cameras: Sequence[str], joints: Sequence[str]) -> Bools:
    """What a `swaps` table says was exchanged, (V, T, J) bool."""
    legs = np.array([is_leg(name) for name in joints])
    parts = [tables.of_camera(table, camera) for camera in cameras]
    of = np.stack([np.where(part["swapped"].astype(bool), part["part"].astype(str), "") for part in parts])
    return np.isin(of, ("all", "legs"))[..., None] & legs | np.isin(of, ("all", "rest"))[..., None] & ~legs


def find_exchanged(cameras: Sequence[Camera], uv: Floats, weights: Floats, names: Sequence[str], fps: float) -> Bools:
    """Whether each joint of each view has the other side's name, (V, T, J) bool: the whole body, the legs or the rest.

    `cameras` V of them, `uv` (V, T, J, 2) recorded pixels, `weights` (V, T, J), `names` J joint names, `fps` the
    rate of the instants.
    """
    found = np.repeat(find_swaps(cameras, uv, weights, names, fps)[..., None], len(names), axis=2)
    uv, weights = exchange(uv, found, names), exchange(weights, found, names)
    legs = np.array([is_leg(name) for name in names])
    for part in (legs, ~legs):
        own = [name for name, inside in zip(names, part, strict=True) if inside]
        found[:, :, part] ^= find_swaps(cameras, uv[:, :, part], weights[:, :, part], own, fps)[..., None]
    found[:, :, swap_index(names) == np.arange(len(names))] = False
    return found


def find_swaps(cameras: Sequence[Camera], uv: Floats, weights: Floats, names: Sequence[str], fps: float) -> Bools:
    """Whether each view's left and right are exchanged, (V, T) bool. The same arguments as `find_exchanged`."""
    index = swap_index(names)
    paired = np.flatnonzero(index != np.arange(len(names)))
    views, count = uv.shape[:2]
    if not len(paired) or views < 2:
        return np.zeros((views, count), bool)
    where = {joint: i for i, joint in enumerate(paired)}
    mirror = np.array([where[index[joint]] for joint in paired])
    states = combinations(views)
    errors, points = _every_state(cameras, uv[:, :, paired], weights[:, :, paired], states, mirror)
    return states[_cheapest_path(errors, points, states, fps)].T


def _every_state(
    cameras: Sequence[Camera], uv: Floats, weights: Floats, states: Bools, mirror: Ints
) -> tuple[Floats, Floats]:
    """Disagreement (S, T, J) px per equation to spare and points (S, T, J, 3) of the paired joints in every state.

    Exchanging all views gives the mirrored joints, so that half the states need no work. NaN where fewer than two views
    see a joint, infinite where they meet nowhere.
    """
    views, count, joints = uv.shape[:3]
    rig = rig_of(cameras)
    said = views_of(rig, uv, weights)
    x, y, w = (values.reshape(views, count, joints) for values in (said.x, said.y, said.w))
    errors, points = np.empty((len(states), count, joints)), np.empty((len(states), count, joints, 3))
    number = {tuple(state): i for i, state in enumerate(states.tolist())}
    done = set()
    for i, state in enumerate(states.tolist()):
        opposite = number.get(tuple(not flag for flag in state))
        if opposite in done:
            errors[i], points[i] = errors[opposite][:, mirror], points[opposite][:, mirror]
            continue
        done.add(i)
        turned = [mirror if flag else slice(None) for flag in state]
        at = Views(rig, *(np.stack([a[v][:, turned[v]] for v in range(views)]).reshape(views, -1) for a in (x, y, w)))
        p, chi2 = meet_in_blocks(at)
        seen = (at.w > 0).sum(axis=0)
        error = np.where(np.isfinite(chi2), np.sqrt(chi2 / np.maximum(2 * seen - 3, 1)), np.inf)
        errors[i] = np.where(seen >= 2, error, np.nan).reshape(count, joints)
        points[i] = p.T.reshape(count, joints, 3)
    return errors, points


def _cheapest_path(errors: Floats, points: Floats, states: Bools, fps: float) -> Ints:
    """Index (T,) of the best state per instant. `errors` (S, T, J) px, `points` (S, T, J, 3) m.

    Disagreement costs by the time that it lasts, a change of state and the way that the joints move once.
    """
    with warnings.catch_warnings():
        # an instant that nobody saw is NaN throughout; it costs nothing below
        warnings.filterwarnings("ignore", "(Mean of empty slice|All-NaN)", RuntimeWarning)
        usual = np.nanmedian(np.nanmin(np.nanmean(errors, axis=2), axis=0))
        usual = usual if np.isfinite(usual) and usual > 0 else 1.0
        unary = np.nanmean(np.minimum(errors / usual, CAP), axis=2)
        unary = np.where(np.isfinite(unary), unary, 0.0) + PRICE_SWAPPED * states.sum(axis=1)[:, None]
    change = PRICE_CHANGE * (states[:, None] != states[None]).sum(axis=-1)
    return cheapest_path(unary / (PERIOD_S * fps), change + _movement(points))


def cheapest_path(unary: Floats, change: Floats) -> Ints:
    """Index (T,) of the state per instant with the least total cost (Viterbi).

    `unary` (S, T), `change` (T - 1, S, S) or (S, S): cost of a state (second axis) after another (last axis).
    """
    states, count = unary.shape
    change = np.broadcast_to(change, (max(count - 1, 0), states, states))
    total, came = unary[:, 0], np.zeros((count, states), int)
    for t in range(1, count):
        reach = total[None] + change[t - 1]
        came[t] = reach.argmin(axis=1)
        total = reach.min(axis=1) + unary[:, t]
    path = np.empty(count, int)
    path[-1] = total.argmin()
    for t in range(count - 1, 0, -1):
        path[t - 1] = came[t, path[t]]
    return path


def _movement(points: Floats) -> Floats:
    """What it costs (T - 1, S, S) that joints (S, T, J, 3) m move from one state (last axis) to another (second)."""
    states, count, joints = points.shape[:3]
    out = np.empty((count - 1, states, states))
    p = np.ascontiguousarray(np.moveaxis(points, -1, 0))
    for now in range(states):
        for before in range(states):
            d = p[:, now, 1:] - p[:, before, :-1]
            moved = np.minimum(np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / STEP_M, CAP)
            known = np.isfinite(moved)
            out[:, now, before] = np.where(known, moved, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return out


def find_mistaken_limbs(
    cameras: Sequence[Camera], uv: Floats, score: Floats, sigma: Floats, names: Sequence[str], fps: float
) -> Bools:
    """Where several views put both names on one limb: (V, T, J) bool, of the name that is wrong.

    `uv` with exchanged sides already turned back, `sigma` (V, T, J) px, `fps` the rate of the instants. Compared are,
    per limb and instant, chi squared of the limb's own views, and that of some views' pixels from the point of the
    other limb, the rest being right. One of two names on one limb is right: where both would be wrong, the limbs only
    lie on one another in these pictures, and it is something else that the other views do not agree with.
    """
    views, count, joints = uv.shape[:3]
    out = np.zeros((views, count, joints), bool)
    at = {name: i for i, name in enumerate(names)}
    weights = np.where(np.isfinite(uv).all(axis=-1), score, 0.0) / sigma
    found: dict[tuple[str, ...], tuple[list[int], Bools]] = {}
    for limb, other in LIMBS:
        pairs = [(at[a], at[b]) for a, b in zip(limb, other, strict=True) if a in at and b in at]
        if not pairs:
            continue
        own, others = (list(side) for side in zip(*pairs, strict=True))
        found[limb] = own, _mistaken_views(cameras, uv, weights, own, others, fps)
    for limb, other in LIMBS:
        if limb in found:
            own, wrong = found[limb]
            out[:, :, own] = (wrong & ~found[other][1].any(axis=0))[..., None]
    return out


def _mistaken_views(
    cameras: Sequence[Camera], uv: Floats, weights: Floats, own: list[int], others: list[int], fps: float
) -> Bools:
    """Views (V, T) whose limb `own` lies on the limb `others` (joint indices) while they are the more."""
    views, count = uv.shape[:2]
    rig = rig_of(cameras)
    w = weights[:, :, own]
    points, chi2 = meet_in_blocks(views_of(rig, uv[:, :, own], w))
    seen = (w > 0).sum(axis=0)
    chi2 = np.where(seen >= 2, chi2.reshape(seen.shape), np.nan)
    tried = [np.zeros(views, bool)]
    apart = np.linalg.norm(uv[:, :, own] - uv[:, :, others], axis=-1) ** 2
    w_apart = 1 / (1 / np.maximum(w, 1e-9) ** 2 + 1 / np.maximum(weights[:, :, others], 1e-9) ** 2)
    apart = np.where((w > 0) & (weights[:, :, others] > 0), apart * w_apart, np.nan)
    costs = [_mean_cost(chi2 / np.maximum(2 * seen - 3, 1))]
    for kept in itertools.product((False, True), repeat=views):
        wrong = np.array(kept)
        if wrong.sum() < 2 or wrong.sum() > 3:
            continue
        on_other = np.where(wrong[:, None, None], apart, 0.0).sum(axis=0) / (2 * wrong.sum())
        if views - wrong.sum() >= 2:
            _, rest = meet_in_blocks(views_of(rig, uv[:, :, own], np.where(wrong[:, None, None], 0.0, w)))
            left = np.where(wrong[:, None, None], 0.0, w > 0).sum(axis=0)
            rest = rest.reshape(seen.shape) / np.maximum(2 * left - 3, 1)
            on_other = np.maximum(on_other, rest)
        tried.append(wrong)
        costs.append(_fit(on_other) + PRICE_WRONG)
    states = np.stack(tried)
    change = np.tile(PRICE_BEGIN * (1.0 - np.eye(len(states))), (max(count - 1, 0), 1, 1))
    # the third view may see both limbs in one place, too; but then the limb has jumped onto the other
    jump = _movement(points.T.reshape(1, count, len(own), 3))[:, 0, 0]
    change[:, 0, 0] += np.maximum(jump - JUMP_M_S / fps / STEP_M, 0.0)
    return states[cheapest_path(np.stack(costs) / (PERIOD_S * fps), change)].T


def _fit(per_degree: Floats) -> Floats:
    """Median over joints (T, J) where it is small, else out of the question."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN", RuntimeWarning)
        middle = np.nanmedian(per_degree, axis=1)
    return np.where(middle <= FITS, middle, CAP**2 * len(per_degree))


def _mean_cost(per_degree: Floats) -> Floats:
    """Mean over joints (T, J), each at most `CAP` squared; 0 where nothing is known."""
    known = ~np.isnan(per_degree)
    cost = np.where(known, np.minimum(per_degree, CAP**2), 0.0).sum(axis=1)
    return cost / np.maximum(known.sum(axis=1), 1)
