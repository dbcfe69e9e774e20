"""Did a camera move in the course of a session? Told by its residuals, walk by walk.

INPUTS   cameras of a session; of each of its outdoor sequences the detections, timeline and swaps
OUTPUTS  `camera_turns`: by which turn each camera, alone, would agree better in a sequence than in the others; findings
         that name the camera and the first sequence after a change, in the sequences whose labels it draws aside
For every walk the bundle's normal equations are reduced to one camera (Hartley and Zisserman A6.3, p. 608): the points
may give way, so that a camera that moved is not hidden by the points that it pulled along. A detector's offsets, which
depend on the joint and on the side of the body that a camera sees, are no motion: only equal joints and headings are
compared between walks, and what all walks share cancels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self, TypeAlias

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.body.names import swap_index
from dior.geometry import camera as cam
from dior.geometry import camera_tables, culprit
from dior.geometry import covariance as cov
from dior.geometry.camera import Camera
from dior.geometry.disagreeing_views import DROP_FACTOR, by_dropping, usual_error
from dior.reconstruct.swaps import exchange, in_table
from dior.reconstruct.triangulate import crossed, observations
from dior.tables import tables

# the turn (3,) rad, its covariance (3, 3) and how much of the squared residuals it explains, px^2
Turn: TypeAlias = tuple[Floats, Floats, float]

MOST_INSTANTS = 600  # of a sequence; chosen: neighbours in time say the same, and more takes longer
HEADINGS = 16  # chosen: finer cells have fewer moments, coarser ones mix sides of the body
FEWEST = 3  # moments of a joint and heading that both sides of a comparison need; chosen
FEWEST_CELLS = 20  # chosen: several times the three unknowns
LEAST_DEG = 0.1  # less is no reason to measure a camera again; chosen: 1 cm of shift, 5 m away
SURE = 20.0  # squared distance in standard errors, 3 degrees of freedom: by chance once in six thousand
ALIKE = 0.8  # chosen: cameras that explain so much of what the best one does may be it as well
FLOOR_DEG = 0.01  # added to a turn's standard error; chosen: a tenth of what is told
# how walks differ where a session has two, which do not tell; chosen: a clock that is known to 4 ms puts a walker
# 5 mm aside, 5 m away
UNTOLD_DEG = 0.05
# walks beyond one on each side that tell how walks differ; where fewer do, a turn's covariance is so many times what
# its cells say, whose errors a detector and a lens share. Chosen: the least at which `benchmarks.bumps 60` has no false
# alarm of 2 and 4 walks at `real`
TELLING, SHARED = 4, 9.0
HUBER = 2.0  # residuals beyond this many times their median pull no harder; chosen


@dataclass(frozen=True, eq=False)
class Normal:
    """Of one sequence, K cells (joint and heading): moments in each (K,), and per camera (V) alone the normal equations
    of its turn, points eliminated: `H` (V, K, 3, 3) and `g` (V, K, 3) in px^2.
    """

    count: np.ndarray
    H: np.ndarray
    g: np.ndarray

    def __add__(self, other: Self) -> Self:
        return replace(self, count=self.count + other.count, H=self.H + other.H, g=self.g + other.g)


@dataclass(frozen=True)
class Change:
    """Camera (index) that moved before the sequence `first` (index), by how much, and what that explains, px^2;
    `others`: the cameras that explain nearly as much, the best first."""

    camera: int
    first: int
    turn_deg: float
    gain: float
    others: tuple[int, ...] = ()


def normal(cameras: Sequence[Camera], uv: Floats, weights: Floats, names: Sequence[str]) -> Normal:
    """`Normal` from pixels uv (V, T, J, 2) and weights (V, T, J) of one sequence, joints called `names`."""
    limit = DROP_FACTOR * usual_error(cameras, uv, weights)
    points, _, used, good = by_dropping(cameras, uv, weights, limit, limit)
    used &= good & np.isfinite(points).all(axis=-1)
    off, J, C = [], [], []
    for camera, seen, use in zip(cameras, uv, used, strict=True):
        by_point, by_camera = cov.projection(camera, points)
        off.append(np.where(use[..., None], seen - cam.project(camera, points)[0], 0.0))
        J.append(np.where(use[..., None, None], by_point, 0.0))
        C.append(np.where(use[..., None, None], by_camera[..., :3], 0.0))
    known = np.all(used, axis=0)  # every view: otherwise it is other views that are compared
    miss = _bounded(np.stack(off), known)
    N = np.where(known[..., None, None], sum(_t(j) @ j for j in J), np.eye(3))
    inverse = np.linalg.inv(N)
    pull = sum(_t(j) @ m[..., None] for j, m in zip(J, miss, strict=True))
    cell = np.where(known, np.arange(len(names)) * HEADINGS + _heading(points, names)[:, None], -1)
    keep, total = cell >= 0, len(names) * HEADINGS
    H, g = [], []
    for v in range(len(cameras)):
        W = _t(C[v]) @ J[v]
        each_H = _t(C[v]) @ C[v] - W @ inverse @ _t(W)
        each_g = (_t(C[v]) @ miss[v][..., None] - W @ inverse @ pull)[..., 0]
        H.append(_sums(cell[keep], each_H[keep].reshape(-1, 9), total).reshape(total, 3, 3))
        g.append(_sums(cell[keep], each_g[keep], total))
    return Normal(np.bincount(cell[keep], minlength=total).astype(float), np.stack(H), np.stack(g))


def _t(matrix: Floats) -> Floats:
    return np.swapaxes(matrix, -1, -2)


def _bounded(miss: Floats, known: Bools) -> Floats:
    """Residuals (V, T, J, 2) px, shortened to twice the median of their camera where they are longer."""
    length = np.linalg.norm(miss, axis=-1)
    usual = np.array([np.median(one[known]) if known.any() else 1.0 for one in length])[:, None, None]
    return miss * np.minimum(1.0, HUBER * usual / np.maximum(length, 1e-9))[..., None]


def _heading(points: Floats, names: Sequence[str]) -> Ints:
    """Heading of the body in the world (T,), 0 to 15, from the hips of points (T, J, 3); -8000 where not known."""
    if "left_hip" not in names or "right_hip" not in names:
        return np.zeros(len(points), int)
    left, right = (points[:, list(names).index(f"{side}_hip")] for side in ("left", "right"))
    across = left - right
    angle = np.arctan2(across[:, 1], across[:, 0])
    heading = np.round(np.nan_to_num(angle) / (2 * np.pi / HEADINGS)).astype(int) % HEADINGS
    return np.where(np.isfinite(angle), heading, -1000 * HEADINGS)


def _sums(cell: Ints, values: Floats, total: int) -> Floats:
    return np.stack([np.bincount(cell, column, minlength=total) for column in values.T], axis=-1)


def turn(before: Normal, after: Normal, camera: int) -> Turn | None:
    """By which turn (3,) rad a camera, alone, stands otherwise in one `Normal` than in another; its covariance (3, 3);
    and how much of the squared residuals that explains, px^2.

    Of a bump the turn is what shows: 1 cm of shift looks like 0.1 degrees, 5 m away.

    None where they share too few joints and headings.
    """
    both = (before.count >= FEWEST) & (after.count >= FEWEST)
    if both.sum() < FEWEST_CELLS:
        return None
    a, b = before.count[both], after.count[both]
    weight = a * b / (a + b)
    H = (before.H[camera][both] + after.H[camera][both]) / (a + b)[:, None, None]
    apart = after.g[camera][both] / b[:, None] - before.g[camera][both] / a[:, None]
    inverse = np.linalg.inv(np.tensordot(weight, H, 1))
    step = inverse @ (weight @ apart)
    left = weight[:, None] * (apart - H @ step)
    return step, inverse @ (left.T @ left) @ inverse, float(weight @ apart @ step)


def find_change(found: Sequence[Normal]) -> Change | None:
    """The `Change` of a session from the `Normal`s of its sequences in order of recording, or None.

    Only the clearest one: where it is put right, the next shows.
    """
    each: dict[int, list[Change]] = {}
    sure = set()
    for v in range(len(found[0].g) if len(found) > 1 else 0):
        for first in range(1, len(found)):
            before, after = _sum(found[:first]), _sum(found[first:])
            known = turn(before, after, v)
            if known is None:
                continue
            degrees = float(np.degrees(np.linalg.norm(known[0])))
            each.setdefault(first, []).append(Change(v, first, degrees, known[2]))
            spread = _spread(found, first, v, known[1])
            if degrees >= LEAST_DEG and float(known[0] @ np.linalg.solve(spread, known[0])) >= SURE:
                sure.add(each[first][-1])
    if not sure:
        return None
    # which camera it was: the one that explains most; the others only give way, though one may be told more surely
    first = max(sure, key=lambda change: change.gain).first
    best, *rest = sorted(each[first], key=lambda change: -change.gain)
    return replace(best, others=tuple(one.camera for one in rest if one.gain >= ALIKE * best.gain))


def _sum(found: Sequence[Normal]) -> Normal:
    return sum(found[1:], found[0])


def _spread(found: Sequence[Normal], first: int, camera: int, of_cells: Floats) -> Floats:
    """Covariance (3, 3) of a camera's turn between the walks before `first` and the others; `of_cells`: as its cells
    say.

    Added is how the walks on either side differ among themselves. Each is compared with all of the other side: compared
    with all others, those of its own side that walk otherwise would hold back its part of a bump, and look like a
    scatter as large as the bump itself. Its off-diagonal is left out: a few walks tell no more.
    """
    sides = found[:first], found[first:]
    left = []
    for own, other in (sides, sides[::-1]):
        turns = [known[0] for one in own if (known := turn(_sum(other), one, camera)) is not None]
        if turns:
            left.append(np.array(turns) - np.mean(turns, axis=0))
    telling = sum(len(side) - 1 for side in left)
    if telling:
        squared = (np.concatenate(left) ** 2).sum(axis=0) / telling * sum(1 / len(side) for side in left)
    else:
        squared = np.full(3, np.radians(UNTOLD_DEG) ** 2)
    return (1.0 if telling >= TELLING else SHARED) * of_cells + np.diag(squared + np.radians(FLOOR_DEG) ** 2)


def run(
    *,
    session: str,
    sequences: list[str],
    names: list[str],
    cameras: list[Path],
    detections: list[Path],
    timelines: list[Path],
    swaps: list[Path],
    min_score: float,
    adjusted: list[str],
    out: Path,
    findings: Path,
) -> None:
    """Write the corrections of the cameras `names` in the `sequences` of a session, in order of recording.

    `detections`, `timelines` and `swaps`: a file for each of the sequences; `adjusted`: those that the cameras were
    adjusted with, if any.
    """
    placed = camera_tables.read_cameras(cameras)
    rig = [placed[name] for name in names]
    found, told, wrong = [], [], []
    for i, paths in enumerate(zip(detections, timelines, swaps, strict=True)):
        detected, line = tables.read(paths[0], "detections"), tables.read(paths[1], "timeline")
        uv, score, joints = observations(detected, line, names, min_score)
        verdict = culprit.judge(rig, crossed(detected, line, names, min_score)[0], swap_index(joints))
        if not _of_cameras(verdict):
            continue
        told.append(i)
        wrong.append(verdict.suspects)
        swapped = in_table(tables.read(paths[2], "swaps"), names, joints)
        uv, score = exchange(uv, swapped, joints), exchange(score, swapped, joints)
        chosen = np.unique(np.linspace(0, uv.shape[1] - 1, min(uv.shape[1], MOST_INSTANTS)).round().astype(int))
        found.append(normal(rig, uv[:, chosen], score[:, chosen], joints))
    change = find_change(found)
    rows = [
        (session, sequence, name, *_row(_against_others(found, told.index(s), v) if s in told else None))
        for s, sequence in enumerate(sequences)
        for v, name in enumerate(names)
    ]
    keys = tables.columns_of("camera_turns")
    tables.write(out, "camera_turns", {key: [row[i] for row in rows] for i, key in enumerate(keys)})
    also = (
        [] if change is None else [sequences[s] for s, who in zip(told, wrong, strict=True) if who == (change.camera,)]
    )
    tables.write_findings(findings, _findings(session, names, [sequences[s] for s in told], change, also, adjusted))


def _of_cameras(verdict: culprit.Verdict) -> bool:
    """Whether what the views of a sequence disagree in may come from how one camera stands.

    Exchanged detections, and those of another walk, look like cameras that turned.
    """
    return not verdict.apart and all(one.posed for one in verdict.readings)


def _against_others(found: Sequence[Normal], s: int, v: int) -> Turn | None:
    """`turn` of camera v in sequence s against the other sequences."""
    others = [one for i, one in enumerate(found) if i != s]
    return turn(_sum(others), found[s], v) if others else None


def _row(known: Turn | None) -> tuple[float, ...]:
    """A turn about the camera's three axes and its sigma, degrees."""
    if known is None:
        return (np.nan,) * 6
    return (*np.degrees(known[0]).tolist(), *np.degrees(np.sqrt(np.diag(known[1]))).tolist())


def _findings(
    session: str,
    names: Sequence[str],
    sequences: Sequence[str],
    change: Change | None,
    also: Sequence[str] = (),
    adjusted: Sequence[str] = (),
) -> list[tuple[str, str, str, str]]:
    """The finding of a change; `also`: the sequences in which `triangulate` named its camera as well.

    Where the cameras were `adjusted` with sequences on one side of it alone, their poses are right there, and it is a
    finding of each sequence on the other side; else of the session.
    """
    if change is None:
        return []
    name, first = names[change.camera], sequences[change.first]
    folder = session.partition("@")[0]
    doubt = "".join(f" (or {names[i]}: that explains nearly as much)" for i in change.others[:1])
    text = (
        f"{name}{doubt} was turned by {change.turn_deg:.2f} degrees between {sequences[change.first - 1]} and {first}, "
        f"by its residuals against the other cameras; if it was bumped, config/sessions/{folder}/{name}@{first}.yaml "
        f"says where it stands from {first} on"
    )
    if also:
        text += f"; that it does not belong to the others in {', '.join(also)} is the same fault"
    sides = sequences[: change.first], sequences[change.first :]
    right = [any(one in adjusted for one in side) for side in sides]
    aside = [session] if right[0] == right[1] else sides[right.index(False)]
    return [(f"{scope}/{name}", "error", "camera_bumped", text) for scope in aside]
