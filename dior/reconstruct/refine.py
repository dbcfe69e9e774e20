"""3D joints smoothed over the whole sequence.

INPUTS   `skeletons_3d` of triangulate, with covariances and the time constant of the errors (its metadata)
OUTPUTS  `skeletons_3d`: the same rows, smoothed; short gaps bridged as `gap_filled`; `findings`
World frame, metres. Every joint follows the best path through all its points (`smooth`): jerk as small as the joint's
own movement asks for (by likelihood), noise correlated in time as the residuals show. A constant error cannot be
smoothed away: it is left in the covariance. Then the bones get their lengths back, as far as these are constant.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.geometry.covariance import point_covariance
from dior.reconstruct.smooth import smooth
from dior.reconstruct.timeline import instants_within, rate
from dior.reconstruct.triangulate import Skeleton, write_skeleton
from dior.tables import tables

# m/s^3 of a joint, from a head to a foot that meets the floor; chosen: wide enough that neither end is the likeliest
JERKS = np.geomspace(10.0, 10000.0, 9)
# chosen: jerk is not white, where a foot lands it is larger than where it is likeliest; more leaves more noise
MARGIN = 1.5
LEARN_S = 40 / 3  # that a joint's jerk is learned from; chosen: a dozen strides, more takes longer
LEAST_S = 1 / 3  # a joint that is seen for less is left as it is; chosen: the swing of a leg
# no landmark of a body keeps its distance to another better than this; chosen
LEAST_SD_M = 0.003
# covariances are averaged over so many time constants of the noise to either side; chosen: less follows the scores of
# single pictures, more misses where a joint is hidden
STEADY = 1.5
RIGID = tuple(
    pair
    for side in ("left", "right")
    for pair in (
        (f"{side}_shoulder", f"{side}_elbow"),
        (f"{side}_elbow", f"{side}_wrist"),
        (f"{side}_hip", f"{side}_knee"),
        (f"{side}_knee", f"{side}_ankle"),
        (f"{side}_ankle", f"{side}_heel"),
        (f"{side}_heel", f"{side}_foot_index"),
        (f"{side}_heel", f"{side}_big_toe"),
    )
) + (("left_hip", "right_hip"), ("left_ear", "right_ear"))


def run(*, sequence: str, subject: str, skeleton: Path, max_gap_s: float, out: Path, findings: Path) -> None:
    """Write the refined skeleton of one sequence."""
    table = tables.read(skeleton, "skeletons_3d")
    about = tables.metadata(skeleton)
    points, joints = tables.grid(table, "x", "y", "z")
    shape = points.shape[:2]
    stamps = table["stamp_ns"].reshape(shape)[:, 0]
    given = Skeleton(
        points, table["status"].astype(str).reshape(shape), table["n_views"].reshape(shape),
        table["residual_px"].reshape(shape), point_covariance(table, shape),
        np.nan_to_num(table["constant_share"].astype(float).reshape(shape)), float(about.get("noise_time_s", 0.0)),
    )  # fmt: skip
    found = over_time(given, joints, rate(stamps), max_gap_s)
    write_skeleton(out, subject, sequence, found.columns(joints, stamps))
    filled = found.status == "gap_filled"
    text = f"{filled.mean():.1%} of the 3D joints were bridged over gaps of at most {max_gap_s:g} s"
    tables.write_findings(findings, [(sequence, "info", "gaps_bridged", text)] if filled.any() else [])


def over_time(given: Skeleton, names: Sequence[str], fps: float, max_gap_s: float) -> Skeleton:
    """The `Skeleton` smoothed, with short gaps bridged but for what is suspect."""
    points, covariance, filled, constant = refined(
        given.points, given.covariance, names, fps, given.time_s, given.constant_share, max_gap_s
    )
    left_open = given.status == "suspect"
    filled = filled & ~left_open
    return replace(
        given,
        points=np.where(left_open[..., None], np.nan, points),
        status=np.where(filled, "gap_filled", given.status),
        n_views=np.where(filled, 0, given.n_views),
        covariance=np.where(left_open[..., None, None], np.nan, covariance),
        constant_share=np.where(left_open, np.nan, constant),
    )


def refined(
    points: Floats,
    covariance: Floats,
    names: Sequence[str],
    fps: float,
    time_s: float,
    constant_share: Floats | float,
    max_gap_s: float,
) -> tuple[Floats, Floats, Bools, Floats]:
    """Smoothed points (T, J, 3), their covariance (T, J, 3, 3), which were bridged (T, J), and which share of their
    variance is constant (T, J).

    The noise is autoregressive with the time constant `time_s`, but for the share `constant_share` (T, J) of its
    variance, which is a constant error.
    """
    known = np.all(np.isfinite(points), axis=-1) & np.all(np.isfinite(covariance), axis=(-1, -2))
    enough = np.flatnonzero(known.sum(axis=0) >= round(LEAST_S * fps))
    filled = np.zeros(known.shape, bool)
    constant_share = np.array(np.broadcast_to(constant_share, known.shape), float)
    if not len(enough):
        return points, covariance, filled, constant_share
    share = constant_share[:, enough, None, None]
    given = np.where(known[..., None], points, np.nan)[:, enough]
    # the constant error moves path and points alike: the smoother is not to know of it
    half = round(STEADY * time_s * fps)
    noise = _steady((1 - share) * covariance[:, enough], known[:, enough], half)
    ar1 = float(np.exp(-1 / (fps * time_s))) if time_s > 0 else 0.0
    path, spread, _ = smooth(given, noise, ar1, learned(given, noise, ar1, fps))
    gaps = _short_gaps(known[:, enough], instants_within(max_gap_s, fps))
    constant = _carried(_steady(share * covariance[:, enough], known[:, enough], half), known[:, enough])
    path, spread = with_bones(path, spread, constant, [names[j] for j in enough.tolist()])
    there = known[:, enough] | gaps
    points, covariance = points.copy(), covariance.copy()
    points[:, enough] = np.where(there[..., None], path, np.nan)
    covariance[:, enough] = np.where(there[..., None, None], spread + constant, np.nan)
    filled[:, enough] = gaps
    whole = np.trace(spread + constant, axis1=-2, axis2=-1)
    constant_share[:, enough] = np.trace(constant, axis1=-2, axis2=-1) / whole
    return points, covariance, filled, constant_share


def learned(points: Floats, noise: Floats, ar1: float, fps: float) -> Floats:
    """Standard deviation (J,) m of third differences under which the points are most likely, of `JERKS`."""
    known = np.all(np.isfinite(points), axis=-1)
    # where most is known
    length = round(LEARN_S * fps)
    seen = np.convolve(known.sum(axis=1), np.ones(min(length, len(known))), "valid")
    rows = slice(int(seen.argmax()), int(seen.argmax()) + length)
    likelihood = []
    for jerk in JERKS:
        sd = np.full(points.shape[1], jerk / fps**3)
        likelihood.append(smooth(points[rows], noise[rows], ar1, sd)[2])
    return MARGIN * JERKS[np.argmax(likelihood, axis=0)] / fps**3


def _steady(covariance: Floats, known: Bools, half: int) -> Floats:
    """Covariances (T, J, 3, 3), the mean of those known at most `half` instants away.

    A detector's scores, and so the covariances, change from picture to picture faster than its errors do. Taken at
    their word, two points with the same error of different size would tell the smoother what that error is.
    """
    count = len(covariance)
    sums = np.cumsum(np.where(known[..., None, None], covariance, 0.0), axis=0)
    counts = np.cumsum(known, axis=0)
    low, high = np.arange(count) - half - 1, np.minimum(np.arange(count) + half, count - 1)
    first = np.maximum(low, 0)
    total = sums[high] - np.where((low >= 0)[:, None, None, None], sums[first], 0.0)
    n: Ints = counts[high] - np.where((low >= 0)[:, None], counts[first], 0)
    return np.where((n > 0)[..., None, None], total / np.maximum(n, 1)[..., None, None], np.nan)


def _short_gaps(known: Bools, most: int) -> Bools:
    """Missing (T, J) between known instants at most `most` + 1 apart."""
    count = len(known)
    at = np.arange(count)[:, None]
    before = np.maximum.accumulate(np.where(known, at, -1), axis=0)
    after = np.minimum.accumulate(np.where(known, at, count)[::-1], axis=0)[::-1]
    return ~known & (before >= 0) & (after < count) & (after - before - 1 <= most)


def _carried(covariance: Floats, known: Bools) -> Floats:
    """Covariances (T, J, 3, 3), those of the last known instant where there is none."""
    at = np.maximum.accumulate(np.where(known, np.arange(len(known))[:, None], 0), axis=0)
    first = known.argmax(axis=0)
    at = np.maximum(at, first)
    return covariance[at, np.arange(known.shape[1])]


def with_bones(path: Floats, spread: Floats, constant: Floats, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Path (T, J, 3) and its covariance (T, J, 3, 3) after the rigid segments were given their lengths.

    A length is the median over the sequence; how well it holds is what its scatter has over the path's own uncertainty,
    and the constant error of its ends, which the median has too. One update per bone, as of a Kalman filter.
    """
    path, spread = path.copy(), spread.copy()
    for one, two in RIGID:
        if one not in names or two not in names:
            continue
        a, b = names.index(one), names.index(two)
        d = path[:, b] - path[:, a]
        length = np.linalg.norm(d, axis=-1)
        n = d / np.maximum(length, 1e-9)[:, None]
        Ca, Cb = (np.einsum("tij,tj->ti", spread[:, j], n) for j in (a, b))
        own = np.einsum("ti,ti->t", n, Ca + Cb)
        bias = np.einsum("ti,tij,tj->t", n, constant[:, a] + constant[:, b], n)
        usual = np.median(length)
        scatter = (1.4826 * np.median(np.abs(length - usual))) ** 2
        soft = max(scatter - np.median(own), LEAST_SD_M**2) + np.median(bias)
        gain = 1 / (own + soft)
        off = usual - length
        path[:, a] -= Ca * (gain * off)[:, None]
        path[:, b] += Cb * (gain * off)[:, None]
        spread[:, a] -= gain[:, None, None] * Ca[:, :, None] * Ca[:, None]
        spread[:, b] -= gain[:, None, None] * Cb[:, :, None] * Cb[:, None]
    return path, spread
