"""Which camera does not belong to the others: the one without which the rest agree, or two whose detections were
exchanged.

INPUTS   placed cameras; the detections of each at the moments of its own pictures and of every other camera's
OUTPUTS  `Verdict`: how far the views are apart as they are, and under each reading that explains it

A wrong pose draws every point, so that all cameras look wrong, and often an innocent one the most. So all of it is
tried: one camera is left out, or the detections of two change places. How far views are apart is the noise of a
detection by the residuals of their points, in px at fx 1680, the median over the parts of a walk: what is wrong for a
third of it (another person, a lost stretch) is no fault of a camera. Compared are the middles between left and right,
which stay where they are when a detector exchanges them.
Where a camera is left out, the pose that its own detections ask for says whether its pose is wrong, or what it sees.
World in metres, recorded pixels; NaN is missing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np

from dior.arrays import Floats, Ints
from dior.geometry import covariance
from dior.geometry.camera import REFERENCE_FX, Camera, angle_deg, project
from dior.geometry.triangulation import meet_in_blocks, rig_of, triangulated, views_of

Finding: TypeAlias = tuple[str, str, str, str]
# of the findings; they come first where findings are shown, since what is said of other cameras follows from them
CODES = ("culprit_camera", "culprit_exchanged", "culprit_unclear", "culprit_c3d")

# chosen: neighbours in time say the same, and more takes longer. Instants at most and at least, and points at most
MOST_INSTANTS, LEAST_INSTANTS, MOST_POINTS = 150, 30, 3000
PARTS = 10  # of a walk; chosen
FEWEST = 20  # points of a part that its median needs; chosen
LEAST_PARTS = 3  # chosen: fewer are no walk
# chosen: a reading explains views that are so many times as far apart as they are under it, and farther by so much at
# fx 1680, a third of a degree. Detectors err from view to view: right cameras of simulated walks stay below 1.4
# (`python -m benchmarks.culprit clean`), those of ../shared/data/real_outdoor below 2.0
EXPLAINS, LEAST_PX = 2.0, 9.0
# chosen: a camera that no pose explains only stands out by so many times; less is a worse detector
STANDS_OUT = 3.0
# chosen: readings that are no worse than so many times the best one, and a px, are as good; detectors err from view to
# view, so that right pairs of cameras differ by as much
ALIKE, ALIKE_PX = 1.35, 1.0
# chosen: views that are so far apart that labels are no use, as for `reprojection_error` in `report.lights`
FAR_APART_PX = 30.0
# chosen: a reading under which the views are farther apart is none, as detectors have 10-15 px of noise
AGREE_PX = 20.0
MEASURE = "median over the walk, px at fx 1680"
NOWHERE_PX = 500.0  # chosen: of rays that do not meet, and at most
STEPS, HUBER = 15, 2.0  # of a pose; residuals beyond this many times their median pull no harder; chosen
SETTLED = 1e-5  # chosen: rad and m
POINTS = 1500  # that a pose is found from; chosen: its error is then far below what is told


@dataclass(frozen=True)
class Pose:
    """Where a camera would have to stand for its detections: turned by (degrees) and moved by (m) from where it is
    placed, and how far all views are apart then, px at fx 1680."""

    turn_deg: float
    shift_m: float
    error_px: float


@dataclass(frozen=True)
class Reading:
    """One explanation: the indices of the `cameras`, one that is left out or two whose detections change places, and
    how far the views are apart then, px at fx 1680. `pose`: what would put right the one that is left out."""

    cameras: tuple[int, ...]
    error_px: float
    pose: Pose | None = None

    @property
    def exchange(self) -> bool:
        return len(self.cameras) == 2

    @property
    def posed(self) -> bool:
        """Whether another pose of the camera that is left out makes its detections agree with the others'."""
        return self.pose is not None and self.pose.error_px <= ALIKE * self.error_px + ALIKE_PX

    @property
    def least_px(self) -> float:
        """How far the views are apart with what explains them best."""
        return self.pose.error_px if self.pose is not None and self.posed else self.error_px

    @property
    def most_px(self) -> float:
        """The same where both have to agree: the other cameras, and all of them with the other pose."""
        return max(self.least_px, self.error_px)


@dataclass(frozen=True)
class Verdict:
    """`error_px`: how far all views are apart, px at fx 1680; `readings`: those that explain it and are as good as each
    other, the best first, none where all agree; `others`: the rest, the best first; `apart`: the views are too far
    apart, and nothing that was tried explains it."""

    error_px: float
    readings: tuple[Reading, ...]
    others: tuple[Reading, ...]
    apart: bool = False

    @property
    def suspects(self) -> tuple[int, ...]:
        """The cameras of the readings."""
        return tuple(sorted({one for reading in self.readings for one in reading.cameras}))


def judge(cameras: Sequence[Camera], crossed: Floats, mirror: Ints) -> Verdict:
    """`Verdict` on V cameras from `crossed` (V, V, T, J, 2) px: the detections of the first at the moments of the
    pictures of the second, NaN where missing.

    `mirror` (J,): the joint of the other side. Where two cameras' detections were exchanged, their frames were counted
    by each other's pictures, too. Two cameras can only tell that they do not agree.
    """
    views, each = len(cameras), np.arange(len(cameras))
    most = min(max(MOST_POINTS // len(mirror), LEAST_INSTANTS), MOST_INSTANTS)
    crossed = middles(crossed[:, :, spread(crossed.shape[2], most)], mirror)
    uv = crossed[each, each]
    given = apart(cameras, uv)
    exchanges = [_exchanged(cameras, crossed, pair) for pair in combinations(range(views), 2)]
    if views < 3:
        far = bool(given > FAR_APART_PX)
        return Verdict(given, (), tuple(exchanges) if far else (), far)
    found = [_without(cameras, uv, view) for view in range(views)] + exchanges
    found = sorted((one for one in found if np.isfinite(one.least_px)), key=lambda one: one.least_px)
    if not found or not np.isfinite(given):
        return Verdict(given, (), ())
    best = min(found, key=lambda one: one.most_px)
    limit = min(ALIKE * best.most_px + ALIKE_PX, AGREE_PX)
    alike = [one for one in found if one.most_px <= limit and _explains(given, one.least_px)]
    # a pose that puts all right is a better reason than detections that happen to disagree with everybody
    kept = [one for one in alike if one.exchange or one.posed]
    if not kept and given >= STANDS_OUT * best.error_px:
        kept = alike
    others = tuple(one for one in found if one not in kept)
    return Verdict(given, tuple(kept), others, not kept and bool(given > FAR_APART_PX))


def findings(scope: str, names: Sequence[str], verdict: Verdict, files: str) -> list[Finding]:
    """What is to be said of a `Verdict` on the cameras `names` of `scope`; `files` holds their detections, in words."""
    given = f"{verdict.error_px:.1f} px"
    if not verdict.readings:
        text = _unexplained(names, verdict, given)
        return [(scope, "error", "culprit_unclear", text)] if verdict.apart else []
    where = "/".join((scope, *(names[i] for i in verdict.suspects)))
    if len(verdict.readings) > 1:
        ways = "; ".join(_words(one, names) for one in verdict.readings)
        text = (
            f"one of {_list(names, verdict.suspects)} does not belong to the others, and it cannot be told which: all "
            f"views are {given} apart as they are; {ways} ({MEASURE}); look at the poses of these cameras in "
            f"config/sessions and at {files}"
        )
        return [(where, "error", "culprit_unclear", text)]
    (one,) = verdict.readings
    beside = f", with anything else {min(other.error_px for other in verdict.others):.1f} px or more"
    if one.exchange:
        both = _list(names, one.cameras, "and")
        text = (
            f"the detections of {both} are exchanged: all views are {given} apart as they are, {one.error_px:.1f} px "
            f"with these exchanged{beside} ({MEASURE}); give {files} of these two each other's names, or their poses "
            "in config/sessions where every walk of the session says so"
        )
        return [(where, "error", "culprit_exchanged", text)]
    name = names[one.cameras[0]]
    if one.pose is not None and one.posed:
        why = (
            f"all agree to {one.pose.error_px:.1f} px if it is turned by {one.pose.turn_deg:.1f} degrees and moved by "
            f"{one.pose.shift_m:.2f} m, so that it is its pose (or its clock): measure it again, and see in "
            "config/sessions that it is not another session's"
        )
    else:
        why = (
            f"no pose makes its detections agree: are they, in {files}, another camera's, walk's or person's, or is "
            "its lens or its clock wrong?"
        )
    text = (
        f"{name} does not belong to the others: all views are {given} apart, without it {one.error_px:.1f} px"
        f"{beside} ({MEASURE}); {why}"
    )
    return [(where, "error", "culprit_camera", text)]


def _unexplained(names: Sequence[str], verdict: Verdict, given: str) -> str:
    """What is said where the views are too far apart and nothing explains it."""
    if len(names) == 2:
        ways = "".join(f", {_words(one, names)}" for one in verdict.others)
        return (
            f"{_list(names, (0, 1), 'and')} do not agree: they are {given} apart{ways} ({MEASURE}), and with two "
            "cameras it cannot be told which of them is wrong: check the poses, the detections and the clocks of both"
        )
    best = f", at best {_words(verdict.others[0], names)}" if verdict.others else ""
    return (
        f"the cameras do not agree: all views are {given} apart ({MEASURE}), and neither one camera less nor two whose "
        f"detections are exchanged explain it{best}; it cannot be told which are wrong: more than one is, or their "
        "clocks are"
    )


def _words(one: Reading, names: Sequence[str]) -> str:
    """A reading with its number."""
    if one.exchange:
        return f"with the detections of {_list(names, one.cameras, 'and')} exchanged {one.error_px:.1f} px"
    turned = one.pose is not None and one.posed
    pose = f" (or turned by {one.pose.turn_deg:.1f} degrees)" if turned and one.pose else ""
    return f"without {names[one.cameras[0]]} {one.error_px:.1f} px{pose}"


def _list(names: Sequence[str], which: Sequence[int], word: str = "or") -> str:
    *first, last = [names[i] for i in which]
    return f"{', '.join(first)} {word} {last}" if first else last


def middles(uv: Floats, mirror: Ints) -> Floats:
    """The middles (..., K, 2) between the sides of pixels uv (..., J, 2), and the joints that have no other side."""
    first = np.flatnonzero(np.arange(len(mirror)) <= mirror)
    return (uv[..., first, :] + uv[..., mirror[first], :]) / 2


def apart(cameras: Sequence[Camera], uv: Floats) -> float:
    """How far the views of pixels uv (V, T, K, 2) are apart: the noise of a detection, px at fx 1680.

    By the median of its part of the walk, whose share of the noise follows from chi squared (as `reconstruct.robust`
    has it). NaN where too little is seen.
    """
    scale = np.array([REFERENCE_FX / c.intrinsics.fx for c in cameras])
    known = np.isfinite(uv).all(axis=-1)
    views = views_of(rig_of(cameras), uv, known * scale[:, None, None])
    _, chi2 = meet_in_blocks(views)
    seen = (views.w > 0).sum(axis=0)
    degrees = np.maximum(2 * seen - 3, 1)
    square = np.where(np.isfinite(chi2), chi2 / (degrees * (1 - 2 / (9 * degrees)) ** 3), NOWHERE_PX**2)
    square = np.where(seen >= 2, np.minimum(square, NOWHERE_PX**2), np.nan).reshape(uv.shape[1:3])
    parts = [part[np.isfinite(part)] for part in np.array_split(square, PARTS)]
    told = [float(np.median(part)) for part in parts if len(part) >= FEWEST]
    return float(np.sqrt(np.median(told))) if len(told) >= LEAST_PARTS else np.nan


def resected(camera: Camera, points: Floats, uv: Floats) -> Camera:
    """The camera where its detections uv (N, 2) px of points (N, 3) m ask it to be; robust Gauss-Newton steps from
    where it is."""
    known = np.flatnonzero(np.isfinite(points).all(axis=1) & np.isfinite(uv).all(axis=1))
    known = known[spread(len(known), POINTS)]
    points, uv = points[known], uv[known]
    for _ in range(STEPS):
        miss = uv - project(camera, points)[0]
        there = np.isfinite(miss).all(axis=1)
        if there.sum() < FEWEST:
            break
        _, by_camera = covariance.projection(camera, points[there])
        miss = miss[there]
        length = np.linalg.norm(miss, axis=1)
        pull = np.minimum(1.0, HUBER * np.median(length) / np.maximum(length, 1e-9))[:, None, None]
        J = by_camera.reshape(-1, 6)
        weighted = (by_camera * pull).reshape(-1, 6)
        step = np.linalg.lstsq(weighted.T @ J, weighted.T @ miss.ravel(), rcond=None)[0]
        camera = covariance.moved(camera, step)
        if np.abs(step).max() < SETTLED:
            break
    return camera


def _explains(given: float, error_px: float) -> bool:
    return bool(given >= EXPLAINS * error_px and given**2 - error_px**2 >= LEAST_PX**2)


def _without(cameras: Sequence[Camera], uv: Floats, view: int) -> Reading:
    """The reading without a camera, with the pose that its own detections ask for."""
    rest = [i for i in range(len(cameras)) if i != view]
    points = triangulated([cameras[i] for i in rest], uv[rest])
    before = cameras[view]
    after = resected(before, points.reshape(-1, 3), uv[view].reshape(-1, 2))
    error = apart([after if i == view else camera for i, camera in enumerate(cameras)], uv)
    shift = float(np.linalg.norm(after.centre - before.centre))
    pose = Pose(angle_deg(before.wRc, after.wRc), shift, error) if np.isfinite(error) else None
    return Reading((view,), apart([cameras[i] for i in rest], uv[rest]), pose)


def _exchanged(cameras: Sequence[Camera], crossed: Floats, pair: tuple[int, int]) -> Reading:
    of = np.arange(len(cameras))
    of[list(pair)] = pair[::-1]
    return Reading(pair, apart(cameras, crossed[of, np.arange(len(cameras))]))


def spread(count: int, most: int) -> Ints:
    """At most so many indices of `count`, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)) if count else np.zeros(0, int)
