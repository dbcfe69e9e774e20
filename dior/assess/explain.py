"""Why 2D and 3D do not lie on each other at any time: the mistake that explains it, and the recording without it.

INPUTS   a `Recording` whose views do not fit its 3D, or each other
OUTPUTS  `Explained`: the recording put right as far as it can be, and the faults with their sizes
Tried are what users of datasets have found: cameras that were exchanged, 3D in another unit, axes or place than the
calibration, poses that are written otherwise (`body.wrong_world`), 2D of pictures of another size, one camera that was
moved. The first that brings every camera to the 3D is taken, the simplest first.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dior.arrays import Floats
from dior.assess.recording import Motion, Recording, View, common_grid, matched
from dior.body import plausible, wrong_world
from dior.body.names import swap_index
from dior.body.plausible import Fault
from dior.calibrate.clock import fit, from_cameras, from_mocap
from dior.calibrate.clock.from_cameras import TimedDetections, frame_by_frame
from dior.clocks import lag
from dior.clocks.axis import blend, bracket, sample
from dior.clocks.clock import NORMAL_95
from dior.geometry import culprit, multiview
from dior.geometry.camera import Camera, angle_deg
from dior.geometry.disagreeing_views import agreeing
from dior.geometry.triangulation import triangulated

# chosen: a camera whose joints lie nearer to the 3D, the median at its best time, belongs to it; of another person's
# walk or under a wrong pose it is several times as much, a detector has 2 to 5 cm
FITS_M = 0.15
# chosen: an explanation brings the cameras so many times nearer than they are
BETTER = 2.5
# chosen: another world of the 3D, which the views that agree tell, is another one where it brings it so much nearer
NEARER = 1.5
# of pictures that were resized before the detector was run: by what the pixels are to be multiplied, in steps
RESIZED = np.unique([*np.geomspace(0.2, 5.0, 65), *(a / b for a in range(1, 6) for b in range(1, 6))])
# chosen: less is how two tools or a detector and markers differ
LEAST_SCALE, LEAST_DEG, LEAST_SHIFT_M = 0.03, 2.0, 0.1
# chosen: pictures of a view by which explanations are compared; its time is told by more
COMPARED = 80
MAX_GAP = 2.5  # nominal periods that are bridged
SCALE_PARTS = 10  # of a recording, by which the interval of a scale is told; chosen


@dataclass(frozen=True, eq=False)
class Explained:
    """`recording` as it would be right; `faults` by what they are about: "" the recording, else a camera's name;
    `apart_m`: how far each view still is from the 3D, NaN where there is none."""

    recording: Recording
    faults: tuple[tuple[str, Fault], ...]
    apart_m: tuple[float, ...]


def explained(recording: Recording) -> Explained:
    """`Explained` of a recording, without a fault where everything fits as it is."""
    apart = misses(recording)
    if (brought := _brought(recording, apart)) is not None:
        return brought
    if all(_fits(one) for one in apart):
        return Explained(recording, (), apart)
    best = Explained(recording, (), apart)
    for faults, other in _alternatives(recording, apart):
        theirs = misses(other)
        worst = [max(one, FITS_M / 2) for one in theirs]
        better = np.mean(worst) * BETTER < np.mean([max(one, FITS_M / 2) for one in apart])
        if all(_fits(one) for one in theirs) and better:
            return Explained(other, faults, theirs)
        if better and sum(map(_fits, theirs)) > sum(map(_fits, best.apart_m)):
            best = Explained(other, faults, theirs)
    found, told, left = best.recording, list(best.faults), list(best.apart_m)
    for i, (fault, camera, apart_m) in _moved(found, best.apart_m):
        told.append((found.views[i].camera.name, fault))
        views = [replace(view, camera=camera) if j == i else view for j, view in enumerate(found.views)]
        found = replace(found, views=tuple(views))
        left[i] = apart_m
    return Explained(found, tuple(told), tuple(left))


def _brought(recording: Recording, apart: tuple[float, ...]) -> Explained | None:
    """The recording with its 3D in the world of its cameras, where these agree and that clearly brings it nearer."""
    if recording.motion is None or not agree(recording):
        return None
    for faults, other in _in_other_world(recording):
        theirs = misses(other)
        if faults and all(map(_fits, theirs)) and np.mean(theirs) * NEARER < np.mean(apart):
            return Explained(other, faults, theirs)
    return None


def misses(recording: Recording) -> tuple[float, ...]:
    """How far (m) each view is from the 3D at the time that suits it best; NaN where nothing is both seen and known."""
    if recording.motion is None:
        return (np.nan,) * len(recording.views)
    return tuple(_miss(view, recording)[0] for view in recording.views)


def _miss(view: View, recording: Recording) -> tuple[float, float]:
    """How far (m) a view is from the 3D, and at which lag (s)."""
    assert recording.motion is not None
    timed = tuple(name for name in recording.joints if name in from_cameras.TIMED) or recording.joints
    walker = recording.motion.only(timed)
    every = max(1, len(view.elapsed) // COMPARED)
    own = matched(replace(view, elapsed=view.elapsed[::every], uv=view.uv[::every]), recording.joints, walker)
    lags, costs = from_mocap.searched(view.camera, walker, own.uv, own.elapsed, lag.WINDOW_S)
    if not np.isfinite(costs).any():
        return np.nan, 0.0
    late = lag.lowest(lags, costs)
    return from_mocap.off_m(view.camera, walker, own.uv, own.elapsed, [late]), late


def _fits(apart_m: float) -> bool:
    return not apart_m > FITS_M


def _alternatives(
    recording: Recording, apart: Sequence[float]
) -> Iterator[tuple[tuple[tuple[str, Fault], ...], Recording]]:
    """Other ways in which the recording may be meant, with the faults that it then has.

    Where the views agree, none of them is another's.
    """
    if agree(recording):
        return
    yield from _exchanged(recording)
    yield from _in_other_world(recording)
    yield from _resized(recording, apart)


def agree(recording: Recording) -> bool:
    """Whether the rays of the views, of two or more, meet."""
    if len(recording.views) < 2:
        return False
    cameras = [view.camera for view in recording.views]
    return wrong_world.meeting(cameras, synced(recording)[1])[0] < wrong_world.MEETING_PX


def _exchanged(recording: Recording) -> Iterator[tuple[tuple[tuple[str, Fault], ...], Recording]]:
    """The 2D given to the cameras that it fits best."""
    from scipy.optimize import linear_sum_assignment

    views = recording.views
    if len(views) < 2:
        return
    cost = np.array([[_miss(given_to(view, other), recording)[0] for other in views] for view in views])
    rows, columns = linear_sum_assignment(np.minimum(np.nan_to_num(cost, nan=2 * FITS_M), 1.0))
    if (rows == columns).all():
        return
    names = [view.camera.name for view in views]
    yield (
        (("", exchange_fault([names[i] for i in rows if columns[i] != i])),),
        replace(recording, views=tuple(given_to(views[i], views[j]) for i, j in zip(rows, columns, strict=True))),
    )


def given_to(view: View, other: View) -> View:
    """A camera with the 2D of another one."""
    return replace(other, camera=view.camera)


def exchange_fault(names: Sequence[str]) -> Fault:
    listed = " and ".join([", ".join(names[:-1]), names[-1]])
    return Fault("exchanged", f"the 2D of {listed} is exchanged; give their files, or their poses, each other's names")


def _resized(recording: Recording, apart: Sequence[float]) -> Iterator[tuple[tuple[tuple[str, Fault], ...], Recording]]:
    """The views that do not fit, as if their 2D were of pictures of another size."""
    faults, views = [], []
    for view, off in zip(recording.views, apart, strict=True):
        if _fits(off):
            views.append(view)
            continue
        found = [(_miss(resized(view, by), recording)[0], by) for by in RESIZED.tolist()]
        least, by = min(found, key=lambda one: np.nan_to_num(one[0], nan=np.inf))
        if not _fits(least):
            return
        views.append(resized(view, by))
        faults.append((view.camera.name, _size_fault(view, by)))
    yield tuple(faults), replace(recording, views=tuple(views))


def resized(view: View, by: float) -> View:
    """The view with its pixels `by` times as large; pixel (0, 0) is the centre of the first."""
    return replace(view, uv=(view.uv + 0.5) * by - 0.5)


def _size_fault(view: View, by: float) -> Fault:
    lens = view.camera.intrinsics
    text = (
        f"the 2D is of pictures of about {lens.width / by:.0f} x {lens.height / by:.0f} px, and the calibration of "
        f"{lens.width} x {lens.height}: multiply the 2D by {by:.2f}, or scale the calibration"
    )
    return Fault("image_scale", text)


def _in_other_world(recording: Recording) -> Iterator[tuple[tuple[tuple[str, Fault], ...], Recording]]:
    """The cameras' poses read otherwise where their rays do not meet, and the 3D brought into their world."""
    if len(recording.views) < 2:
        return
    grid, uv = synced(recording)
    if len(grid) < culprit.LEAST_INSTANTS:
        return
    cameras = [view.camera for view in recording.views]
    reading, _ = wrong_world.other_reading(cameras, uv, recording.joints)
    faults: list[tuple[str, Fault]] = []
    if reading is not None:
        cameras = reading.cameras
        faults = [("", Fault("poses", f"the calibration {reading.words}; the views agree once that is put right"))]
        views = tuple(replace(v, camera=c) for v, c in zip(recording.views, cameras, strict=True))
        recording = replace(recording, views=views)
        yield tuple(faults), recording
    assert recording.motion is not None
    points = believed(cameras, uv)
    world = _aligned(recording.motion, grid, points, recording.joints)
    if world is None:
        return
    turned, own = _of_world(recording.motion, points, recording.joints, world, cameras)
    faults += [("", fault) for fault in world_faults(world)]
    views = tuple(replace(v, camera=c) for v, c in zip(recording.views, own, strict=True))
    yield tuple(faults), replace(recording, motion=turned, views=views)


@dataclass(frozen=True, eq=False)
class World:
    """By what the 3D gets into the calibration's world: `scale`, rotation `R` (3, 3), `shift` (3,) m, mirrored before
    (x to -x) or not; `half_scale`: half of the 95 % interval of the scale; `of_3d` and `of_cameras`: how tall (m) the
    person is in either."""

    scale: float
    R: Floats
    shift: Floats
    mirrored: bool
    half_scale: float
    of_3d: float
    of_cameras: float

    @property
    def turn_deg(self) -> float:
        return angle_deg(np.eye(3), self.R)

    def __call__(self, xyz: Floats) -> Floats:
        flipped = xyz * (-1, 1, 1) if self.mirrored else xyz
        return self.scale * flipped @ self.R.T + self.shift


def aligned(recording: Recording) -> World | None:
    """How the 3D of a recording whose views fit lies in the world of its calibration; None where that is not told."""
    if recording.motion is None or len(recording.views) < 2:
        return None
    grid, uv = synced(recording)
    if len(grid) < culprit.LEAST_INSTANTS:
        return None
    cameras = [view.camera for view in recording.views]
    if not wrong_world.meeting(cameras, uv)[0] < wrong_world.MEETING_PX:
        return None
    return _aligned(recording.motion, grid, believed(cameras, uv), recording.joints)


def believed(cameras: Sequence[Camera], uv: Floats) -> Floats:
    """Points (T, J, 3) of the 2D (V, T, J, 2) that agrees with the others."""
    return triangulated(cameras, np.where(agreeing(cameras, uv)[..., None], uv, np.nan))


def _aligned(motion: Motion, grid: Floats, points: Floats, joints: Sequence[str]) -> World | None:
    """`World` by which a motion gets onto points (T, J, 3) at `grid` (T,) s, at the lag at which it does best."""
    walker = motion.only(tuple(joints))
    target = points[:, [list(joints).index(name) for name in walker.names]]
    every = max(1, len(grid) // from_mocap.SEARCHED)
    target, at = target[::every], grid[::every]
    lags = lag.window(from_mocap.STEPS_HZ / 4)
    gap = MAX_GAP * float(np.median(np.diff(walker.t)))
    best = None
    for late in lags.tolist():
        source = blend(walker.points, *bracket(walker.t, at + late, gap))
        known = np.isfinite(source).all(axis=-1) & np.isfinite(target).all(axis=-1)
        if known.sum() < fit.FEWEST:
            continue
        for mirrored in (False, True):
            a, b = source[known] * (-1 if mirrored else 1, 1, 1), target[known]
            s, R, t = multiview.similarity(a, b)
            off = float(np.median(np.linalg.norm(s * a @ R.T + t - b, axis=1)))
            # a mirror image has to be clearly better
            worth = off * (1.5 if mirrored else 1.0)
            if best is None or worth < best[0]:
                best = worth, late, mirrored, s, R, t
    if best is None:
        return None
    _, late, mirrored, s, R, t = best
    source = blend(walker.points, *bracket(walker.t, at + late, gap)) * (-1 if mirrored else 1, 1, 1)
    half = NORMAL_95 * float(np.hypot(_spread(source, target), _spread_by_joints(source, target)))
    tall = plausible.stature(walker.points, walker.names), plausible.stature(target, walker.names)
    return World(s, R, t, mirrored, half, *tall)


def _spread(source: Floats, target: Floats) -> float:
    """1 sigma of the scale from source to target (T, J, 3) by parts of the time that are left out."""
    parts = []
    for first, last in pairwise(np.linspace(0, len(source), SCALE_PARTS + 1).round().astype(int)):
        a, b = np.delete(source, slice(first, last), 0), np.delete(target, slice(first, last), 0)
        parts.append(multiview.similarity(a.reshape(-1, 3), b.reshape(-1, 3))[0])
    return float(np.sqrt((len(parts) - 1) * np.var(parts)))


def _spread_by_joints(source: Floats, target: Floats) -> float:
    """1 sigma of the same by joints that are left out: where a detector puts a joint is wrong all the time."""
    joints = range(source.shape[1])
    parts = [
        multiview.similarity(np.delete(source, j, 1).reshape(-1, 3), np.delete(target, j, 1).reshape(-1, 3))[0]
        for j in joints
    ]
    return float(np.sqrt((len(parts) - 1) * np.var(parts)))


def _of_world(
    motion: Motion, points: Floats, joints: Sequence[str], world: World, cameras: Sequence[Camera]
) -> tuple[Motion, list[Camera]]:
    """3D and cameras in one world of metres: that of the calibration, unless the person is no person there."""
    low, high = plausible.LIMITS["stature_m"]
    by = world.of_3d / world.of_cameras if low <= world.of_3d <= high and not low <= world.of_cameras <= high else 1.0
    placed = []
    for camera in cameras:
        wTc = camera.wTc.copy()
        wTc[:3, 3] *= by
        placed.append(camera.at(wTc))
    return motion.at(by * world(motion.xyz)), placed


def world_faults(world: World) -> list[Fault]:
    """What is wrong of a world that is not the calibration's, in words with its size."""
    found = []
    low, high = plausible.LIMITS["stature_m"]
    if abs(world.scale - 1) - world.half_scale > LEAST_SCALE:
        sized = f"the 3D times {world.scale:.4g} ± {world.half_scale:.2g} is the calibration's size"
        tall = f"the person is {world.of_3d:.3g} m tall in the 3D and {world.of_cameras:.3g} m in the calibration"
        which = ""
        if not low <= world.of_3d <= high:
            which = f", so that the 3D is {wrong_world.scale_words(1 / world.scale, wrong_world.UNIT_RATIO)}"
        elif not low <= world.of_cameras <= high:
            which = f", so that the calibration is {wrong_world.scale_words(world.scale, wrong_world.UNIT_RATIO)}"
        found.append(Fault("world_scale", f"{sized}: {tall}{which}"))
    axes = _axes_words(world)
    if world.mirrored:
        found.append(
            Fault("world_left_handed", f"the 3D is the mirror image of what the cameras see (left-handed axes){axes}")
        )
    elif world.turn_deg > LEAST_DEG:
        text = f"the 3D is turned by {world.turn_deg:.1f} degrees from the calibration's world{axes}"
        found.append(Fault("world_axes", text))
    elif (shift := float(np.linalg.norm(world.shift))) > LEAST_SHIFT_M and not found:
        x, y, z = world.shift
        text = f"the 3D lies {shift:.2f} m beside the calibration's world: add ({x:+.2f}, {y:+.2f}, {z:+.2f}) m"
        found.append(Fault("world_shift", text))
    return found


def _axes_words(world: World) -> str:
    """Which axis of the 3D is which of the calibration's, where they are along each other."""
    M = world.R * (-1 if world.mirrored else 1, 1, 1)
    axes = np.abs(M).argmax(axis=1)
    if sorted(axes) != [0, 1, 2] or np.abs(M).max(axis=1).min() < np.cos(np.radians(LEAST_DEG)):
        return ""
    words = [f"{'-' if M[i, j] < 0 else ''}{'xyz'[j]}" for i, j in enumerate(axes.tolist())]
    return f": the calibration's (x, y, z) are its ({', '.join(words)})"


def _moved(recording: Recording, apart: Sequence[float]) -> Iterator[tuple[int, tuple[Fault, Camera, float]]]:
    """Cameras that do not fit, where others do, with the pose that their 2D asks for."""
    if recording.motion is None or not any(_fits(one) and np.isfinite(one) for one in apart):
        return
    walker = recording.motion.only(recording.joints)
    known = [i for i, one in enumerate(apart) if _fits(one) and np.isfinite(one)]
    late = float(np.median([_miss(recording.views[i], recording)[1] for i in known]))
    gap = MAX_GAP * float(np.median(np.diff(walker.t)))
    for i, off in enumerate(apart):
        if _fits(off):
            continue
        view = matched(recording.views[i], recording.joints, walker)
        points = blend(walker.points, *bracket(walker.t, view.elapsed + late, gap))
        camera = culprit.resected(view.camera, points.reshape(-1, 3), view.uv.reshape(-1, 2))
        left = _miss(replace(recording.views[i], camera=camera), recording)[0]
        if not _fits(left):
            continue
        turn = angle_deg(view.camera.wRc, camera.wRc)
        shift = float(np.linalg.norm(camera.centre - view.camera.centre))
        text = (
            f"its pose is wrong: its 2D fits once it is turned by {turn:.1f} degrees and moved by {shift:.2f} m; "
            "calibrate it again, or take the right session's calibration"
        )
        yield i, (Fault("pose", text), camera, left)


def synced(recording: Recording) -> tuple[Floats, Floats]:
    """Moments (T,) s and the 2D (V, T, J, 2) at them, the cameras' clocks put right where the views tell them."""
    grid = common_grid(recording.views)
    if len(grid) < culprit.LEAST_INSTANTS:
        return grid, np.zeros((len(recording.views), 0, len(recording.joints), 2))
    late = np.zeros(len(recording.views))
    uv = _at(recording.views, grid, late)
    cameras = [view.camera for view in recording.views]
    if wrong_world.meeting(cameras, uv)[0] < wrong_world.MEETING_PX:
        return grid, uv
    clocks = clocks_of(recording, grid)
    late = np.array([clocks[c.name][0].late_s for c in cameras])
    return grid, _at(recording.views, grid, late)


def _at(views: Sequence[View], grid: Floats, late: Floats) -> Floats:
    return np.stack([
        sample(view.elapsed + own, view.uv, grid, MAX_GAP / view.fps) for view, own in zip(views, late, strict=True)
    ])  # fmt: skip


def clocks_of(recording: Recording, grid: Floats) -> dict[str, from_cameras.Estimate]:
    """The clocks of the views against the first one's."""
    seen = [TimedDetections(view.elapsed, view.uv, MAX_GAP / view.fps) for view in recording.views]
    cameras = [view.camera for view in recording.views]
    return from_cameras.from_detections(cameras, seen, list(recording.joints), grid, recording.views[0].fps)


def judged(recording: Recording) -> culprit.Verdict | None:
    """Which camera does not belong to the others, of three or more."""
    grid = common_grid(recording.views)
    if len(recording.views) < 3 or len(grid) < culprit.LEAST_INSTANTS:
        return None
    crossed = np.stack([
        np.stack([
            sample(one.elapsed, frame_by_frame(view.uv, len(one.elapsed)), grid, MAX_GAP / one.fps)
            for one in recording.views
        ])
        for view in recording.views
    ])  # fmt: skip
    cameras = [view.camera for view in recording.views]
    return culprit.judge(cameras, crossed, swap_index(list(recording.joints)))
