"""What comes of an adjustment: whether it is refused, and what it says of itself.

INPUTS   `Adjusted`, the cameras as placed
OUTPUTS  a DiorError, or rows of `metrics` and findings

A reprojection error is the mean distance in recorded pixels. World in metres, Z up, floor at Z = 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.plausible import OTHERS_WALK
from dior.calibrate.bundle import reduced
from dior.calibrate.bundle.bundle import Prior
from dior.calibrate.bundle.facts import Fact
from dior.calibrate.bundle.starts import Tried
from dior.calibrate.bundle.uncertainty import Tracks, Uncertainty, scale_sigma
from dior.errors import DiorError
from dior.geometry.camera import Camera, angle_deg, project
from dior.geometry.tape import check_above_floor
from dior.tables.tables import Finding

# chosen: what a person should see: an uncertainty of the scale of 2 % is 3.5 cm of a person's height, and 2 % of the
# detections in disagreement are a few wrong limbs
DOUBTFUL_SCALE, WORTH_TELLING = 0.02, 0.02
# chosen: as many disagree where a camera follows somebody else or the cameras end in a wrong world
MOST_DISAGREEING = 0.3
# chosen: a body is judged as a whole where a camera has so many of its joints; a detector that guesses limbs lifts the
# mean error, but puts no body elsewhere
FEWEST_JOINTS, WHOLE_BODY_SHARE = 8, 1 / 3


@dataclass(frozen=True, eq=False)
class Adjusted:
    """`cameras`, `points` (N, 3) m with NaN where left out, and the errors (V, N) px before and after of those used.

    `disagreeing` is the share of the detections that were left out, `iterations` are those of the last round.
    `uncertainty`: `uncertainty.Uncertainty`, None where the points' joints are not known; `facts`: `facts.Fact`s with
    what the adjusted world says of them, [(fact, value)]; `starts`: `starts.Tried`. `uv` and `tracks` of the points;
    `clocks` (S, V, 2), their standard errors and `fits`: of `in_adjustment`, S = 0 where the clocks were known.
    """

    cameras: list[Camera]
    points: Floats
    before_px: Floats
    after_px: Floats
    disagreeing: float
    iterations: int
    uncertainty: Uncertainty | None = None
    facts: tuple[tuple[Fact, float], ...] = ()
    starts: tuple[Tried, ...] = ()
    uv: Floats | None = None
    tracks: Tracks | None = None
    clocks: Floats = field(default_factory=lambda: np.zeros((0, 0, 2)))
    clocks_sigma: Floats = field(default_factory=lambda: np.zeros((0, 0, 2)))
    fits: tuple[Any, ...] = ()

    @property
    def left_out(self) -> int:
        """Number of points that took no part."""
        return int(np.isnan(self.points[:, 0]).sum())


def in_front(cameras: Sequence[Camera], uv: Floats, points: Floats) -> Bools:
    """Mask (N,) of the finite points that every camera which sees them has in front of it, inside its lens model."""
    projected = np.stack([project(camera, points)[0] for camera in cameras])
    ahead = np.isfinite(projected) | ~np.isfinite(uv)
    return np.asarray(ahead.all(axis=(0, 2)) & np.isfinite(points).all(axis=1))


def check_end(done: Adjusted, uv: Floats, limit_px: float, where: str) -> None:
    behind = ~in_front(done.cameras, uv, done.points) & np.isfinite(done.points[:, 0])
    if behind.any():
        raise DiorError(
            f"{where}: {behind.sum()} of {len(behind)} adjusted joints are behind a camera that sees them; place the "
            "cameras better"
        )
    for camera in done.cameras:
        check_above_floor(f"{where}, {camera.name} after the adjustment", camera.centre, "place the cameras better")
    if done.left_out > 0.5 * len(done.points):
        raise DiorError(
            f"{where}: {done.left_out} of {len(done.points)} joints fit no point in front of the cameras that see "
            "them; place the cameras better (tape.position_m, tape.target_m)"
        )
    if done.disagreeing > MOST_DISAGREEING:
        raise DiorError(
            f"{where}: {done.disagreeing:.0%} of the detections disagree with the other views of their joint, more "
            f"than {MOST_DISAGREEING:.0%}; a local minimum or wrong detections, so place the cameras better "
            f"(tape.position_m, tape.target_m) or choose other instants in session.yaml; {OTHERS_WALK}"
        )
    mean = np.nanmean(done.after_px)
    if mean > limit_px and whole_body_off(done, uv) > WHOLE_BODY_SHARE * limit_px:
        means = {c.name: float(np.nanmean(error)) for c, error in zip(done.cameras, done.after_px, strict=True)}
        per_camera = ", ".join(f"{name} {value:.1f}" for name, value in means.items())
        worst = max(done.cameras, key=lambda camera: means[camera.name] / camera.intrinsics.fx).name
        raise DiorError(
            f"{where}: the adjustment ends at a mean of {mean:.1f} px ({per_camera}), above the limit of "
            f"{limit_px:.1f} px (adjust.max_mean_px scaled by fx), a local minimum or wrong detections; place the "
            f"cameras better (tape.position_m, tape.target_m), first {worst}, which fits worst for its focal length, "
            f"and look at its detections and intrinsics; {OTHERS_WALK}"
        )


def whole_body_off(done: Adjusted, uv: Floats) -> float:
    """How far (px) the detections uv (V, N, 2) of a picture are beside the points that they made, as one: the length of
    the median over joints, in the mean over pictures with `FEWEST_JOINTS`. Infinite where no picture has as many, or
    the points' joints are not known."""
    if done.tracks is None:
        return np.inf
    order = np.argsort(done.tracks.moment, kind="stable")
    starts = np.flatnonzero(np.diff(done.tracks.moment[order])) + 1
    lengths = []
    for camera, seen in zip(done.cameras, uv, strict=True):
        off = seen - project(camera, done.points)[0]
        for at in np.split(order, starts):
            known = off[at][np.isfinite(off[at]).all(axis=1)]
            if len(known) >= FEWEST_JOINTS:
                lengths.append(float(np.linalg.norm(np.median(known, axis=0))))
    return float(np.mean(lengths)) if lengths else np.inf


def shift_and_turn(before: Camera, after: Camera) -> tuple[float, float]:
    """How far a camera is from where it was (m) and by how much it is turned (degrees)."""
    return float(np.linalg.norm(after.centre - before.centre)), angle_deg(before.wRc, after.wRc)


def metrics(done: Adjusted) -> dict[str, Any]:
    rows = []
    for metric, errors in (("adjust_error_before", done.before_px), ("adjust_error_after", done.after_px)):
        for camera, error in zip(done.cameras, errors, strict=True):
            rows.append((metric, camera.name, camera.role, np.nanmean(error), np.isfinite(error).sum()))
        rows.append((metric, "", "", np.nanmean(errors), np.isfinite(errors).sum()))
    keys = ("metric", "camera", "role", "value", "n")
    return {**dict(zip(keys, map(list, zip(*rows, strict=True)), strict=True)), "unit": ["px"] * len(rows)}


def findings(session: str, placed: Sequence[Camera], priors: Sequence[Prior], done: Adjusted) -> list[Finding]:
    text = (
        f"mean reprojection error {np.nanmean(done.before_px):.2f} px as placed, {np.nanmean(done.after_px):.2f} px "
        f"adjusted ({len(done.points) - done.left_out} joints, {done.iterations} iterations), in recorded pixels; "
        "it does not vouch for the scale"
    )
    found = [(session, "info", "adjusted", text)]
    if done.left_out:
        text = f"{done.left_out} of {len(done.points)} joints were left out, being behind a camera that sees them"
        found.append((session, "warning", "adjust_left_out", text))
    if done.disagreeing > 0:
        text = (
            f"{done.disagreeing:.1%} of the detections were left out, disagreeing with the other views of their joint"
        )
        found.append((session, "warning" if done.disagreeing > WORTH_TELLING else "info", "adjust_disagreeing", text))
    if done.iterations >= reduced.MOST_ITERATIONS:
        text = f"the adjustment was stopped after {done.iterations} iterations, before it had settled"
        found.append((session, "warning", "adjust_not_settled", text))
    found += _known_to(session, done)
    if any(not one.cameras for one in done.starts) or len(done.starts) > 2:
        ends = ", ".join(f"{s.name} {s.cost_px:.1f} px" if s.cameras else f"{s.name} failed" for s in done.starts)
        text = f"the starts did not all end in the same world, the best one counts (at fx 1680): {ends}"
        found.append((session, "warning", "adjust_starts", text))
    for before, after, prior in zip(placed, done.cameras, priors, strict=True):
        distance, angle = shift_and_turn(before, after)
        text = f"{before.name} moved {distance:.3f} m and turned {angle:.1f} degrees from where it was placed"
        if distance > 3 * prior.sigma_m:
            text += f", more than 3 times its sigma of {prior.sigma_m:g} m; measure it again"
            found.append((f"{session}/{before.name}", "warning", "camera_moved_far", text))
        else:
            found.append((f"{session}/{before.name}", "info", "camera_moved", text))
    return found


def _known_to(session: str, done: Adjusted) -> list[Finding]:
    """Findings: how well each camera and the scale are known, and what the adjusted world says of each metric fact."""
    if done.uncertainty is None:
        return []
    variance = np.diag(done.uncertainty.covariance).reshape(-1, 6)
    turns, shifts = (np.sqrt(part.sum(axis=1) / 3) for part in (variance[:, :3], variance[:, 3:]))
    each = (
        f"{camera.name} {100 * shift:.1f} cm, {np.degrees(turn):.2f} degrees"
        for camera, shift, turn in zip(done.cameras, shifts, turns, strict=True)
    )
    scale = scale_sigma(done.cameras, done.uncertainty.covariance)
    text = (
        f"1 sigma in each axis: {'; '.join(each)}; the scale is known to {100 * scale:.1f} % (95 % of the time within "
        f"{196 * scale:.1f} %)"
    )
    found = [(session, "warning" if scale > DOUBTFUL_SCALE else "info", "adjust_uncertainty", text)]
    for fact, value in done.facts:
        off = abs(value - fact.known) / fact.sigma
        text = f"{fact.name}: {value:.3f} {fact.unit}, measured {fact.known:.3f} ± {fact.sigma:.3f} {fact.unit}"
        if off > 3:
            text += f", {off:.1f} sigmas apart; measure it again"
        found.append((session, "warning" if off > 3 else "info", "metric_fact", text))
    return found
