"""The bundle adjustment itself: cameras that are placed about right, and their clocks, by what they see together.

INPUTS   placed cameras with priors; their detections, or sequences whose clocks are found by turns with the poses
OUTPUTS  `outcome.Adjusted`
"""

from collections.abc import Sequence

import numpy as np

from dior.arrays import Bools, Floats
from dior.calibrate.bundle import beginning, bundle, facts, in_adjustment, reduced, starts, uncertainty
from dior.calibrate.bundle.outcome import Adjusted, check_end, in_front
from dior.clocks import ray_lags
from dior.errors import DiorError
from dior.geometry import disagreeing_views
from dior.geometry.camera import REFERENCE_FX, Camera, reprojection_errors
from dior.geometry.triangulation import triangulated

# chosen: at most, where the detections that agree do not settle
ROUNDS = 5
TURNS, QUICK_TURNS = 8, 1  # chosen, with unknown clocks: at most; while these are still found from fewer moments
# chosen: an initial solution is tried again where fewer than 90 % of the joints were in front of the cameras
SAMPLE_ROUNDS, MOST_USABLE = 3, 0.9
LENS_SIGMA = 0.003  # chosen: a board and the maker differ by 0.1 to 0.6 % in fx (`lens.board`)
# joints of each camera that the initial solution is found from. Three and six seeds of benchmarks.adjustment with 500
# end where they do with 2000 (3D 59.70 and 59.68 mm at `real`, starts 30 cm and 10 degrees off included), in a quarter
# of the time (1.0 and 3.8 s)
SAMPLE = 500
SETTLED = 0.001  # chosen: the rounds end where a thousandth of the detections changes sides


def adjust(
    cameras: Sequence[Camera],
    observed: Floats | in_adjustment.Sequences,
    priors: Sequence[bundle.Prior],
    huber_px: float,
    max_mean_px: float,
    where: str,
    tracks: uncertainty.Tracks | None = None,
    known: Sequence[facts.Known] = (),
    marked: facts.Marked | None = None,
    lens_sigma: float | Floats = LENS_SIGMA,
    start_priors: Sequence[bundle.Prior] | None = None,
) -> Adjusted:
    """Adjust V cameras to the detections `observed`: recorded px (V, N, 2), NaN where not seen.

    Where clocks are unknown `observed` is `in_adjustment.Sequences`: they are found by turns with the poses, and the
    pixels and `tracks` are made from it.

    `priors` are `bundle.Prior`, one per camera; `start_priors`, where they differ, hold the cameras while the starts
    are compared, which knows no metric facts. `huber_px`, where the loss turns linear, and `max_mean_px`, above
    which the result is refused, are for fx 1680 and scaled by each camera's (and the mean) fx. `tracks`
    (`uncertainty.Tracks`) says what the points are; `known` are metric facts (`facts.KeypointDistance` and so on),
    `marked` (`facts.Marked`) points that a person marked for them. A sample of the points comes first
    (`sampled`); points that the placed cameras put behind one of them are left out at first and
    tried again from the adjusted cameras, which also tell the detections that disagree.
    Raises DiorError (beginning with `where`), see `bundle.optimise` and the checks below.
    """
    timed = observed if isinstance(observed, in_adjustment.Sequences) else None
    values = clocks_sigma = np.zeros((0, len(cameras), 2))
    fits: list[in_adjustment.Fit | None] = []
    if isinstance(observed, in_adjustment.Sequences):
        values = observed.start(cameras, *how_far_off(cameras, start_priors or priors))
        uv, tracks, _ = observed.observations(values)
    else:
        uv = observed
    beginning.check_start(cameras, uv, where)
    beginning.check_shared(cameras, uv, where)
    focal = np.array([camera.intrinsics.fx for camera in cameras])
    sigma = huber_px * focal / REFERENCE_FX / bundle.HUBER

    few = uv[:, sample(np.all(np.isfinite(uv), axis=-1))]

    def attempt(start: Sequence[Camera]) -> list[Camera]:
        return sampled(start, few, start_priors or priors, sigma, where)

    chosen, tried = starts.best(cameras, few, attempt, where)
    adjusted, settled = chosen.cameras, timed is None or bool(timed.held.all())
    walked = in_adjustment.Walked()
    agreed: Floats | None = None
    for turn in range(ROUNDS if timed is None else TURNS):
        if timed is not None and not settled:
            before, last = values, turn >= QUICK_TURNS
            found, fits = timed.fitted(adjusted, values, last)
            walked = walked.on(found - values)
            values = values + walked.went
            settled = last and in_adjustment.settled(before, values, fits)
            uv, tracks, _ = timed.observations(values)
        kept = agreeing(adjusted, uv) if agreed is None else agreed
        points = triangulated(adjusted, kept)
        used = _usable(adjusted, kept, points)
        _check_aim(adjusted, kept, used, where)
        observed_px = np.where(used[:, None], kept, np.nan)
        solved, stated = metric(adjusted, observed_px, points, priors, sigma, tracks, known, marked, where)
        adjusted = solved.cameras
        # the pixels change with the clocks as long as these are not settled
        agreed = agreeing(adjusted, uv) if settled else None
        if agreed is not None and (np.isfinite(agreed) != np.isfinite(kept)).mean() < SETTLED:
            break
    count = uv.shape[1]
    points = np.where(used[:, None], solved.points[:count], np.nan)
    start = np.where(used[:, None], triangulated(cameras, observed_px), np.nan)
    before, after = reprojection_errors(cameras, start, observed_px), reprojection_errors(adjusted, points, observed_px)
    disagreeing = 1 - np.isfinite(kept).sum() / np.isfinite(uv).sum()
    spread = None if tracks is None else uncertainty.of(solved, tracks, lens_sigma)
    if timed is not None and spread is not None and tracks is not None:
        fits = timed.compared(adjusted, values, fits or [None] * len(values))
        spread, clocks_sigma = in_adjustment.with_errors(spread, solved, tracks, timed, fits)
    noise = solved.linear.noise * solved.linear.variance[:, None, None]
    measured = tuple((fact, fact.measured(adjusted, solved.points, noise)) for fact in stated if fact.measured)
    done = Adjusted(
        adjusted, points, before, after, float(disagreeing), solved.iterations, spread, measured, tuple(tried), uv,
        tracks, values, clocks_sigma, tuple(fits),
    )  # fmt: skip
    check_end(done, observed_px, max_mean_px * focal.mean() / REFERENCE_FX, where)
    return done


def how_far_off(cameras: Sequence[Camera], priors: Sequence[bundle.Prior]) -> tuple[Floats, Floats]:
    """How far (rad, m) each camera may be off before anything is adjusted, 1 sigma."""
    by_tape = np.array([prior.sigma_rad > np.radians(ray_lags.AIM_DEG) for prior in priors])
    turns = np.where(by_tape, np.radians(ray_lags.AIM_DEG), [prior.sigma_rad for prior in priors])
    return turns, np.minimum([prior.sigma_m for prior in priors], ray_lags.MOST_SHIFT_M)


def sampled(
    cameras: Sequence[Camera], uv: Floats, priors: Sequence[bundle.Prior], sigma: Floats, where: str
) -> list[Camera]:
    """The cameras adjusted by GTSAM to points uv (V, N, 2), those that the start puts behind a camera later."""
    adjusted, agreed = list(cameras), uv
    for _ in range(SAMPLE_ROUNDS):
        points = triangulated(adjusted, agreed)
        usable = _usable(adjusted, agreed, points)
        _check_aim(adjusted, agreed, usable, where)
        graph, values = bundle.build(adjusted, agreed[:, usable], points[usable], priors, sigma)
        found = bundle.optimise(graph, values, where)
        poses = bundle.poses(found.values, len(cameras))
        adjusted = [camera.at(wTc) for camera, wTc in zip(cameras, poses, strict=True)]
        if usable.mean() > MOST_USABLE:
            break
        agreed = agreeing(adjusted, uv)
    return adjusted


def metric(
    cameras: Sequence[Camera],
    uv: Floats,
    points: Floats,
    priors: Sequence[bundle.Prior],
    sigma: Floats,
    tracks: uncertainty.Tracks | None,
    known: Sequence[facts.Known],
    marked: facts.Marked | None,
    where: str,
) -> tuple[reduced.Solved, list[facts.Fact]]:
    """`reduced.Solved` of all points uv (V, N, 2) recorded px and the metric facts, and these as `facts.Fact`."""
    taking_part = np.isfinite(points).all(axis=1) & (np.isfinite(uv).all(axis=-1).sum(axis=0) >= 2)
    each = np.broadcast_to(sigma[:, None], uv.shape[:2])
    if marked is not None:
        uv = np.concatenate([uv, marked.uv], axis=1)
        points = np.concatenate([points, triangulated(cameras, marked.uv)])
        each = np.concatenate([each, np.full(marked.uv.shape[:2], marked.sigma_px)], axis=1)
    ideal = np.stack([bundle.ideal_pixels(c.intrinsics, seen) for c, seen in zip(cameras, uv, strict=True)])
    ideal[:, : len(taking_part)][:, ~taking_part] = np.nan
    about = facts.About([c.name for c in cameras], tracks, taking_part, points, marked, where)
    stated = [facts.placed(view, prior) for view, prior in enumerate(priors)]
    stated += [one for fact in known for one in fact.made(about)]
    points = np.where(np.isfinite(points), points, 0.0)
    return reduced.solve(cameras, reduced.Observed(ideal, each, len(taking_part)), points, stated), stated


def agreeing(cameras: Sequence[Camera], uv: Floats) -> Floats:
    """The detections uv (V, N, 2), NaN for those that disagree with the other views of their point."""
    return np.where(disagreeing_views.agreeing(cameras, uv)[..., None], uv, np.nan)


def sample(seen: Bools) -> Bools:
    """Mask (N,) of points: of those that two cameras see, `SAMPLE` of each camera; seen (V, N).

    They are spread by chance, the same at every run.
    """
    order = np.random.default_rng(0).permutation(seen.shape[1])
    sampled = np.zeros(seen.shape[1], bool)
    for own in seen & (seen.sum(axis=0) >= 2):
        sampled[order[own[order]][:SAMPLE]] = True
    return sampled


def _usable(cameras: Sequence[Camera], uv: Floats, points: Floats) -> Bools:
    """Mask (N,) of the points that are fit for a start: in front, and not off by more than a picture.

    A point nearly in the plane of a camera's centre is projected so far away that its slope tells nothing.
    """
    size = np.array([[max(camera.intrinsics.width, camera.intrinsics.height)] for camera in cameras])
    with np.errstate(invalid="ignore"):
        near = ~(reprojection_errors(cameras, points, uv) > size)
    return in_front(cameras, uv, points) & near.all(axis=0)


def _check_aim(cameras: Sequence[Camera], uv: Floats, used: Bools, where: str) -> None:
    """Refuse cameras whose joints cannot be in front of all of them, naming the one without which they can."""
    seen = np.asarray(np.isfinite(uv).all(axis=-1))
    if (seen[:, used].sum(axis=1) >= beginning.FEWEST_SEEN).all():
        return
    without = []
    for view in range(len(cameras)):
        rest = [i for i in range(len(cameras)) if i != view]
        others = [cameras[i] for i in rest]
        without.append(_usable(others, uv[rest], triangulated(others, uv[rest])).sum())
    culprit = cameras[int(np.argmax(without))].name
    raise DiorError(
        f"{where}: as placed, the cameras have {used.sum()} of {len(used)} joints in front of them, without {culprit} "
        f"it would be {max(without)}; check the tape.position_m and tape.target_m of {culprit} and its detections"
    )
