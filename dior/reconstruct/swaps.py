"""Left and right exchanged by a detector: decided per camera and instant from all views and over time.

A detector that sees a person from behind may call the left side right. Every view alone looks fine; together they do
not meet. For each combination of exchanged views the paired joints are triangulated and their reprojection error
taken; the sequence of combinations with the least total cost is found by dynamic programming (Viterbi 1967). Exchanging
every view gives the same pixels, so that the side itself is kept by the continuity of the 3D joints and a small price
per exchanged view.
"""

import itertools
import warnings

import numpy as np

from dior import camera as cam
from dior import geometry
from dior.skeletons import swap_index

CAP = 6.0  # an error counts up to this many times the usual one, so that one wild joint does not decide
PRICE_CHANGE = 1.0  # per view and instant, in units of the usual error: swaps come in runs
PRICE_SWAPPED = 0.02  # per view and instant: of two equal explanations the one with fewer exchanged views
STEP_M = 0.1  # a mean movement of the paired joints between instants that costs one usual error
MOST_STATES = 32


def combinations(views):
    """Which views are exchanged, (S, V) bool: all of them up to five views, else at most two at a time."""
    every = np.array(list(itertools.product((False, True), repeat=views)))
    return every if len(every) <= MOST_STATES else every[every.sum(axis=1) <= 2]


def exchange(values, swapped, names):
    """Exchange left and right joints of values (V, T, J, ...) where `swapped` (V, T) says so."""
    index = swap_index(names)
    mask = swapped.reshape(*swapped.shape, *(1,) * (values.ndim - 2))
    return np.where(mask, values[:, :, index], values)


def find_swaps(cameras, uv, weights, names):
    """Whether each view's left and right are exchanged, (V, T) bool.

    `cameras` V of them, `uv` (V, T, J, 2) recorded pixels, `weights` (V, T, J), `names` J joint names.
    """
    index = swap_index(names)
    paired = np.flatnonzero(index != np.arange(len(names)))
    views, count = uv.shape[:2]
    if not len(paired) or views < 2:
        return np.zeros((views, count), bool)
    where = {joint: i for i, joint in enumerate(paired)}
    mirror = np.array([where[index[joint]] for joint in paired])
    uv, weights = uv[:, :, paired], weights[:, :, paired]
    xy = np.stack([cam.undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    cTw = [cam.inverse_pose(c.wTc) for c in cameras]
    states = combinations(views)
    errors, points = [], []
    for state in states:
        turned = [np.arange(len(paired)) if not flag else mirror for flag in state]
        at = [np.stack([a[v][:, turned[v]] for v in range(views)]) for a in (uv, xy, weights)]
        point = geometry.triangulate(cTw, at[1], at[2])
        seen = np.stack([cam.project(c, point)[0] for c in cameras])
        focal = np.array([c.intrinsics.fx for c in cameras])[:, None, None]
        errors.append(np.linalg.norm(seen - at[0], axis=-1) / focal)
        points.append(point)
    return states[_cheapest_path(np.stack(errors), np.stack(points), states)].T


def _cheapest_path(errors, points, states):
    """Index (T,) of the best state per instant. `errors` (S, V, T, J) rad, `points` (S, T, J, 3) m."""
    with warnings.catch_warnings():
        # an instant that nobody saw is NaN throughout; it costs nothing below
        warnings.filterwarnings("ignore", "(Mean of empty slice|All-NaN)", RuntimeWarning)
        usual = np.nanmedian(np.nanmin(np.nanmean(errors, axis=(1, 3)), axis=0))
        usual = usual if np.isfinite(usual) and usual > 0 else 1.0
        unary = np.nanmean(np.minimum(errors / usual, CAP), axis=(1, 3))
        unary = np.where(np.isfinite(unary), unary, 0.0) + PRICE_SWAPPED * states.sum(axis=1)[:, None]
    change = PRICE_CHANGE * (states[:, None] != states[None]).sum(axis=-1)
    count = unary.shape[1]
    total, came = unary[:, 0], np.zeros((count, len(states)), int)
    for t in range(1, count):
        reach = total[None] + change + _movement(points[:, t], points[:, t - 1])
        came[t] = reach.argmin(axis=1)
        total = reach.min(axis=1) + unary[:, t]
    path = np.empty(count, int)
    path[-1] = total.argmin()
    for t in range(count - 1, 0, -1):
        path[t - 1] = came[t, path[t]]
    return path


def _movement(now, before):
    """What it costs (S, S) that joints `before` (S, J, 3) m in one state are at `now` (S, J, 3) in another."""
    moved = np.minimum(np.linalg.norm(now[:, None] - before[None], axis=-1) / STEP_M, CAP)
    known = np.isfinite(moved)
    return np.where(known, moved, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
