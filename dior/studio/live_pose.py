"""What the marks of one camera say while they are made: its pose and clock, which mark disagrees, what to mark next.

INPUTS   the marks as they are, and what the step `locate` is given besides
OUTPUTS  `Answer`: at once with the clock of the last search, and with a search of its own where there is time for it
World in metres, Z up; recorded pixels; seconds. Poses, clocks and their errors are those of dior/calibrate/locate.py.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.body import visibility
from dior.calibrate import locate
from dior.calibrate.marks import clock_from_marks, pnp, pose_grid
from dior.calibrate.marks import marks as hand_marks
from dior.calibrate.marks.marks import Marks, Motion, Stamps
from dior.calibrate.marks.pnp import Mark
from dior.clocks import lag
from dior.clocks.axis import ClockValues, sample, seconds
from dior.clocks.clock import NORMAL_95, OFFSET_SD_S, Clock
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import Camera, in_frame, project

# chosen: a mark that another marker explains to this is a mark of that one
SAME_PX = 4.0
# chosen: markers of a frame that are put in the order of what they help; the rest follows as the C3D has it
RANKED = 8
# chosen: frames with marks, at least, before nothing more is asked for (docs/formats.md, clocks from marks)
FRAMES = 3
# chosen: a further mark that makes labels better by less than this share is not worth the click
WORTH = 0.1


@dataclass(frozen=True, eq=False)
class Given:
    """What a camera is located from: its lens, its marks in the file `path`, and by sequence the C3D's markers, the
    stamps of its pictures, and (offset_s, drift_ppm, source) as a person gave it or assumed."""

    camera: Camera
    marks: Marks
    path: str
    motions: Mapping[str, Motion]
    stamps: Stamps
    clock: Mapping[str, ClockValues]
    ransac_px: float
    scope: str
    most_s: float = lag.WINDOW_S


@dataclass(frozen=True, eq=False)
class Answer:
    """What the marks say. `camera` with its pose and the marks `used`, with their places, `residual_px` and `inlier`
    (N,) of them; the `clock` by sequence that goes with it and those that were found, `clocks`; `spread` (6, 6): the
    covariance of the pose; `sd_px`: of a mark's coordinate; `sigma_m`, `sigma_deg` as of `Located`. `suspect`: index in
    `used` of the mark that the others contradict most, its distance px from where they put it, and the shift of the
    camera (m) it makes. `searched`: whether clocks were searched for these very marks. `notes`: what else is said.
    """

    camera: Camera
    used: Marks
    residual_px: Floats
    inlier: Bools
    clock: Mapping[str, ClockValues]
    spread: Floats
    sd_px: float
    sigma_m: float
    sigma_deg: float
    suspect: tuple[int, float, float] | None
    searched: bool
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def at_once(given: Given, known: Mapping[str, float]) -> Answer:
    """The pose with the offsets (s) that are `known`, and likely ones of the other sequences. Raises DiorError as
    `locate.locate`."""
    where = f"{given.path} ({given.scope})"
    locate.check_enough(where, len(given.marks))
    clock = dict(given.clock)
    for sequence in _free(given):
        offset = known.get(sequence)
        clock[sequence] = (_likely_offset(given, sequence) if offset is None else offset, 0.0, "assumed")
    args = given.path, given.camera.name, given.camera.intrinsics, given.motions, given.stamps, clock, given.scope
    used, _ = hand_marks.in_world(given.marks, *args)
    found = locate.locate(given.camera, used.xyz, used.uv, given.ransac_px, where)
    agreeing = used.only(found.inlier)
    spread = pnp.pose_covariance(found.jacobian, found.miss, agreeing.joint, agreeing.frame)
    return _answer(given, used, found, clock, spread)


def searched(given: Given) -> Answer:
    """Pose and clocks as the step `locate` finds them. Raises DiorError as it does."""
    found = locate.with_clocks(
        given.camera, given.marks, given.path, given.motions, given.stamps, given.clock, given.ransac_px, given.scope,
        given.most_s,
    )  # fmt: skip
    answer = _answer(given, found.used, found.located, found.clock, found.covariance[:6, :6])
    whole = any(code in ("frame_suspect", "frame_rejected") for _, _, code, _ in found.findings)
    notes = tuple(text for _, severity, _, text in found.findings if severity != "info")
    # marks of a frame that is wrong as a whole are not wrong one by one
    suspect = None if whole else answer.suspect
    return replace(answer, searched=True, clocks=found.clocks, notes=notes, suspect=suspect)


def _answer(
    given: Given, used: Marks, found: locate.Located, clock: Mapping[str, ClockValues], spread: Floats
) -> Answer:
    suspect = pnp.suspect(found.jacobian, found.miss)
    if suspect is not None:
        suspect = (int(np.flatnonzero(found.inlier)[suspect[0]]), *suspect[1:])
    return Answer(
        given.camera.at(found.wTc), used, found.residual_px, found.inlier, clock, spread, locate.click_sd_px(found),
        found.sigma_m, found.sigma_deg, suspect, searched=False,
    )  # fmt: skip


def _free(given: Given) -> list[str]:
    """Sequences with marks of C3D markers whose clock no person gave."""
    moving = ~np.isfinite(given.marks.xyz).all(axis=1)
    return [name for name in dict.fromkeys(given.marks.sequence[moving]) if given.clock[name][2] != "manual"]


def _likely_offset(given: Given, sequence: str) -> float:
    """The offset (s) with which a pose explains the marks of a sequence; 0 for too few. One that is nearer to 0 is
    likelier, as a frame alone tells hardly more than the phase of the step."""
    marks = given.marks.only(given.marks.sequence == sequence)
    t = hand_marks.times(
        marks, given.path, given.camera.name, given.camera.intrinsics, given.motions, given.stamps
    )  # fmt: skip
    at = clock_from_marks.places(marks, t, given.motions, {})
    lags = lag.window(clock_from_marks.LAGS_HZ, given.most_s)
    xyz = at.at(lags[:, None])[0]
    poses, cost = pose_grid.grid(given.camera.intrinsics, xyz, marks.uv, given.ransac_px)
    cost = cost / pnp.CLICK_SD_PX**2 + (lags / OFFSET_SD_S) ** 2
    for best in np.argsort(cost, kind="stable"):
        if not np.isfinite(cost[best]):
            break
        camera = given.camera.at(poses[best])
        there = xyz[best][np.isfinite(xyz[best]).all(axis=1)]
        if pnp.upright(camera.wTc) != -1 and not pnp.impossible(camera, there):
            return float(lags[best])
    return 0.0


def markers_at(given: Given, clock: Mapping[str, ClockValues], sequence: str, frames: Ints) -> Floats:
    """Where the markers of a sequence are on frames (F,) of the camera: (F, J, 3) m, NaN where missing."""
    motion, (numbers, stamps) = given.motions[sequence], given.stamps[sequence]
    # frames count from 0, without gaps
    at = seconds(stamps[np.searchsorted(numbers, frames)], motion.t0_ns, *clock[sequence][:2])
    return np.asarray(sample(motion.t, motion.xyz, at, hand_marks.longest_step(motion)), float)


@dataclass(frozen=True, eq=False)
class Seen:
    """The markers of a sequence on frames: `uv` (..., J, 2) px where the pose puts them, NaN outside of the picture;
    `hidden` (..., J): behind a part of the body; `xyz` (..., J, 3) m."""

    uv: Floats
    hidden: Bools
    xyz: Floats


def seen(given: Given, answer: Answer, sequence: str, frame: int) -> Seen:
    """Where the markers of a frame are by the answer."""
    found = seen_on(given, answer, sequence, np.array([frame]))
    return Seen(found.uv[0], found.hidden[0], found.xyz[0])


def seen_on(given: Given, answer: Answer, sequence: str, frames: Ints) -> Seen:
    """The same of frames (F,)."""
    xyz = markers_at(given, answer.clock, sequence, frames)
    uv, depth = project(answer.camera, xyz)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & in_frame(answer.camera.intrinsics, uv)
    hidden = visibility.hidden(answer.camera, xyz, given.motions[sequence].joints)
    return Seen(np.where(inside[..., None], uv, np.nan), hidden, xyz)


def unmarked(given: Given, answer: Answer, sequence: str, frame: int) -> list[Mark]:
    """The markers of a frame that can be seen and are not marked."""
    marks, joints = given.marks, given.motions[sequence].joints
    there = set(marks.joint[(marks.sequence == sequence) & (marks.frame == frame)])
    found = seen(given, answer, sequence, frame)
    free = np.isfinite(found.uv).all(axis=1) & ~found.hidden
    return [
        Mark(sequence, frame, joints[j], found.xyz[j]) for j in np.flatnonzero(free) if joints[j] not in there
    ]  # fmt: skip


def ranked(
    given: Given, answer: Answer, candidates: Sequence[Mark], most: int = RANKED
) -> list[tuple[Mark, float, float]]:
    """At most so many of the candidates, that first which helps the labels most, then that which helps most beside it,
    and so on; with the camera's share of a label, px (1 sigma of u or v), before and after."""
    left, spread, places = list(candidates), answer.spread, locate.label_places(given.motions)
    found: list[tuple[Mark, float, float]] = []
    while left and len(found) < most:
        best = pnp.best_next(answer.camera, spread, answer.sd_px, left, places)
        if best is None:
            break
        found.append(best)
        left = [mark for mark in left if mark is not best[0]]
        J = covariance.projection(answer.camera, best[0].xyz)[1]
        CJ = spread @ J.T
        spread = spread - CJ @ np.linalg.inv(J @ CJ + answer.sd_px**2 * np.eye(2)) @ CJ.T
    return found


def taken_for(given: Given, answer: Answer, i: int) -> str:
    """The marker that a wrong mark `i` of `answer.used` fits, "" for none."""
    mark = answer.used.only(np.array([i]))
    sequence, frame = mark.sequence[0], int(mark.frame[0])
    if sequence not in given.motions:
        return ""
    joints = given.motions[sequence].joints
    off = np.linalg.norm(seen(given, answer, sequence, frame).uv - mark.uv, axis=1)
    off[[joint == mark.joint[0] for joint in joints]] = np.nan
    if not np.isfinite(off).any() or np.nanmin(off) > SAME_PX:
        return ""
    return joints[int(np.nanargmin(off))]


def clock_95_s(answer: Answer, sequence: str) -> float:
    """Half of the 95 % interval of the clock of a sequence, s; NaN where the marks do not tell it, 0 where a person
    gave it without an error."""
    clock = answer.clocks.get(sequence)
    if clock is None:
        return float("nan")
    return NORMAL_95 * float(clock.sigma(list(clock.gains), answer.spread)[0])


def enough(given: Given, answer: Answer, best: tuple[Mark, float, float] | None) -> bool:
    """Whether a further mark is hardly worth the click: marks on 3 frames, nothing to look at again, pose and clocks
    certain, and labels that the best mark makes better by less than a tenth."""
    frames = {(s, f) for s, f in zip(given.marks.sequence, given.marks.frame.tolist(), strict=True)}
    clocks = [clock_95_s(answer, name) for name in _free(given)]
    certain = answer.sigma_m <= locate.UNCERTAIN_M and answer.sigma_deg <= locate.UNCERTAIN_DEG
    return bool(
        answer.searched
        and len(frames) >= FRAMES
        and answer.suspect is None
        and answer.inlier.all()
        and not answer.notes
        and certain
        and all(half <= clock_from_marks.UNCERTAIN_S for half in clocks)
        and (best is None or best[2] > (1 - WORTH) * best[1])
    )


def refusal(error: DiorError, given: Given) -> str:
    """What an error of the solvers says, without the file that the page is of."""
    text = str(error).removeprefix(f"{given.path} ({given.scope})").lstrip(":, ")
    return text[:1].upper() + text[1:] + "."
