"""The frame whose marks do not belong to the others: its picture was scrolled or scaled, or is another one.

INPUTS   a camera and clocks that all marks were fitted with, and the marks
OUTPUTS  which frame, by how much, and whether it can be told

A frame that is shifted as a whole draws the pose towards it until every mark is within the limit of a misclick, and no
mark stands out. So each frame in turn may lie beside where the pose puts it, shifted and scaled, or be of another
time. The shape of its marks still helps the pose, so that far less shows than if the other frames had to tell it alone.
The frame with whose own fault all marks agree best is the wrong one, as in `dior.geometry.culprit`; of two frames it
cannot be told, as a shift of one is the opposite of the other's.
World in metres, Z up; recorded pixels; seconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dior.arrays import AnyPath, Bools, Floats, Ints
from dior.calibrate.marks import clock_from_marks, pnp
from dior.calibrate.marks.clock_from_marks import STAMP_SD_S, Places
from dior.calibrate.marks.marks import Marks, Stamps
from dior.geometry import covariance
from dior.geometry.camera import Camera, project
from dior.geometry.rotation import rotvec
from dior.tables.tables import Finding

FEWEST = 4  # chosen: marks of a frame that can be said to be shifted together
# chosen, chi2 of the numbers of a fault: nothing is said of right frames (`python -m benchmarks.odd_frames`)
CERTAIN = 30.0
# chosen: less is no scrolled picture, but how people click
LEAST_PX, LEAST_PICTURES = 3.0, 0.5
# chosen: beyond, all marks of a frame fall into one point, which fits anything
MOST_SCALE = 2.0
# chosen, chi2: what fits worse by less may as well be the reason (e^10)
ALIKE = 20.0
# chosen: steps of Gauss and Newton, the second half without single marks that are wrong
STEPS = 10


@dataclass(frozen=True, eq=False)
class Fault:
    """A fault of the marks `own` (N,) of one frame: where they lie, `shift_px` (2,) beside where the pose puts them,
    `growth` of their distances (0 for none) with its `growth_sigma`; or how much later than it says the picture is,
    `late_s` (0 for none).

    `chi2` of these numbers; `cost` px^2 of all marks with the fault and the `variance` px^2 of a coordinate; the
    `camera` and `offsets` (S,) s with it.
    """

    own: Bools
    shift_px: Floats
    growth: float
    growth_sigma: float
    late_s: float
    chi2: float
    cost: float
    variance: float
    camera: Camera
    offsets: Floats


def faults(
    camera: Camera, at: Places, uv: Floats, offsets: Floats, frames: Ints, limit_px: float, period_s: float
) -> list[Fault]:
    """`Fault`s that explain the marks at `uv` (N, 2) px as well as each other, of each frame its best one, the
    clearest first; empty where all frames agree.

    `frames` (N,): 0, 1, ... of the marks; `camera` and `offsets` (S,) s are those of the fit to all, `limit_px` is that
    of a single mark and `period_s` that of the pictures.
    """
    count = int(frames.max(initial=-1)) + 1
    best = []
    for one in range(count) if count > 1 else ():
        own = frames == one
        if own.sum() < FEWEST:
            continue
        begin, used = _without(camera, at, uv, offsets, own, limit_px) if count > 2 else ((camera, offsets), own | True)
        ways = (False, True) if (at.clock[own] >= 0).any() else (False,)
        tried = [_fault(*begin, at, uv, own, used, late, limit_px) for late in ways]
        best += sorted((fault for fault in tried if fault is not None), key=lambda fault: fault.cost)[:1]
    if not best:
        return []
    first = min(best, key=lambda fault: fault.cost)
    limit = first.cost + ALIKE * first.variance
    alike = sorted((fault for fault in best if fault.cost < limit), key=lambda fault: -fault.chi2)
    return alike if _stands_out(alike[0], period_s) else []


def _stands_out(fault: Fault, period_s: float) -> bool:
    far = np.linalg.norm(fault.shift_px) > LEAST_PX or abs(fault.late_s) > LEAST_PICTURES * period_s
    return bool(far and fault.chi2 > CERTAIN)


def _without(
    camera: Camera, at: Places, uv: Floats, offsets: Floats, own: Bools, limit_px: float
) -> tuple[tuple[Camera, Floats], Bools]:
    """Camera and offsets by the frames that are not `own` (N,), and the marks (N,) without the wrong ones of these."""
    rest = at.only(~own)
    # where the wrong frame drew the pose, good marks may be far from it
    wTc, begin = clock_from_marks.refine(camera, rest, uv[~own], offsets)
    end = clock_from_marks.arrive(camera.at(wTc), rest, uv[~own], begin, int(rest.clock.max()), limit_px)
    used = np.ones(len(uv), bool)
    if end is None:
        return (camera, offsets), used
    used[np.flatnonzero(~own)] = end.inlier
    return (end.camera, end.offsets), used


def _fault(
    camera: Camera, offsets: Floats, at: Places, uv: Floats, own: Bools, used: Bools, late: bool, limit_px: float
) -> Fault | None:
    """The `Fault` of a frame fitted together with pose and clocks, of its time or of its place; None where the marks do
    not tell."""
    middle = uv[own].mean(axis=0)
    size = float(np.sqrt(((uv[own] - middle) ** 2).sum(axis=1).mean()))
    across = own[:, None] * (uv - middle) / max(size, 1.0)
    numbers = np.zeros(1 if late else 3)
    known = 6 + len(offsets)
    for step in range(STEPS + 1):
        part = replace(at, t=at.t + own * numbers[0]) if late else at
        xyz, velocity = part.at(offsets)
        by_point, _ = covariance.projection(camera, xyz)
        miss = project(camera, xyz)[0] - uv
        if late:
            by_fault = own[:, None, None] * np.einsum("nij,nj->ni", by_point, velocity)[:, :, None]
        else:
            by_fault = np.concatenate([own[:, None, None] * np.eye(2), across[:, :, None]], axis=2)
            miss = miss + by_fault @ numbers
        if step == STEPS // 2:
            used = used & (np.nan_to_num(np.linalg.norm(miss, axis=1), nan=np.inf) <= limit_px)
        J = np.concatenate([clock_from_marks.jacobian(camera, part, offsets).reshape(len(uv), 2, -1), by_fault], axis=2)
        use = used & np.isfinite(miss).all(axis=1) & np.isfinite(J).all(axis=(1, 2))
        # a clock that no mark tells any more leaves it open
        A, b = J[use].reshape(-1, J.shape[2]), miss[use].ravel()
        if (use & own).sum() < FEWEST or len(b) <= A.shape[1] or np.linalg.matrix_rank(A) < A.shape[1]:
            return None
        if step < STEPS:
            change = -np.linalg.solve(A.T @ A, A.T @ b)
            camera = camera.at(covariance.moved(camera, change[:6]).wTc)
            offsets, numbers = offsets + change[6:known], numbers + change[known:]
    if not late and not 1 / MOST_SCALE < 1 - numbers[2] / max(size, 1.0) < MOST_SCALE:
        return None
    variance = pnp.variance(b, len(b) - A.shape[1])
    # what the lens does to the marks looks like a shift where the others do not take it away
    solve = np.linalg.solve(A.T @ A, A.T)[known:]
    by_lens = camera.intrinsics.sigma * solve @ covariance.by_lens(camera, xyz[use]).reshape(-1, 3)
    spread = variance * np.linalg.inv(A.T @ A)[known:, known:] + by_lens @ by_lens.T
    if late:
        spread = spread + STAMP_SD_S**2
    square = np.minimum(np.nan_to_num((miss**2).sum(axis=1), nan=limit_px**2), limit_px**2)
    return Fault(
        own,
        np.zeros(2) if late else numbers[:2],
        0.0 if late else float(numbers[2]) / max(size, 1.0),
        0.0 if late else float(np.sqrt(spread[2, 2])) / max(size, 1.0),
        float(numbers[0]) if late else 0.0,
        float(numbers @ np.linalg.solve(spread, numbers)),
        float(square.sum()),
        variance,
        camera,
        offsets,
    )


def change(camera: Camera, offsets: Floats, fault: Fault) -> Floats:
    """How the pose and the clocks (6 + S,) change by a fault, in the terms of `dior.geometry.covariance`."""
    turn = rotvec(camera.wRc.T @ fault.camera.wRc)
    return np.concatenate([turn, fault.camera.centre - camera.centre, fault.offsets - offsets])


def same_pose(step: Floats, spread: Floats) -> bool:
    """Whether poses that are `step` (6,) apart may be one by the covariance (6, 6) of the one that is less certain."""
    return bool(step @ np.linalg.solve(spread, step) < CERTAIN)


def findings(
    scope: str, path: AnyPath, marks: Marks, found: Sequence[Fault], stamps: Stamps, left_out: bool
) -> list[Finding]:
    """What to say of the faults `found`; `left_out`: the frame of the only one is not used."""
    if not found:
        return []
    first = found[0]
    if left_out:
        text = f"{_words(path, marks, first, stamps)} They are not used, mark them again"
        return [(scope, "warning", "frame_rejected", text)]
    if len(found) == 1:
        text = (
            f"{_words(path, marks, first, stamps)} They are used, as the others do not tell the camera alone, and its "
            "sigma is as wide as they disagree"
        )
        return [(scope, "warning", "frame_suspect", text)]
    names = " and ".join(_frame(marks, fault) for fault in found)
    text = (
        f"{path}: the marks of {names} do not agree, and it cannot be told which are wrong; if it is the first, "
        f"{_words(path, marks, first, stamps)} Mark another frame"
    )
    return [(scope, "warning", "frame_suspect", text)]


def _frame(marks: Marks, fault: Fault) -> str:
    first = int(np.argmax(fault.own))
    return f"frame {marks.frame[first]} of {marks.sequence[first]}"


def _words(path: AnyPath, marks: Marks, fault: Fault, stamps: Stamps) -> str:
    line = marks.line[fault.own]
    what = f"the {len(line)} marks of {_frame(marks, fault)} ({path}, lines {line.min()}-{line.max()})"
    if fault.late_s:
        number = int(marks.frame[fault.own][0])
        frames, ns = stamps[marks.sequence[fault.own][0]]
        true = int(frames[np.argmin(np.abs((ns - ns[frames == number][0]) / 1e9 - fault.late_s))])
        return (
            f"{what} are where the other frames put them {abs(fault.late_s):.3f} s "
            f"{'later' if fault.late_s > 0 else 'earlier'}: was it picture {true} that was marked?"
        )
    right, down = fault.shift_px
    # chosen: 4 sigma
    grown = abs(fault.growth) > 4 * fault.growth_sigma
    scaled = f", {100 * abs(fault.growth):.1f} % too far {'apart' if fault.growth > 0 else 'together'}" if grown else ""
    return (
        f"{what} lie {abs(right):.0f} px {'right' if right > 0 else 'left'} of and {abs(down):.0f} px "
        f"{'below' if down > 0 else 'above'} where the other frames put them{scaled}: is it the right picture number, "
        "was the picture scrolled or scaled?"
    )
