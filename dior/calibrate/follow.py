"""The clock of a camera without detections in one sequence: when the boxes, or the silhouettes in its pictures, are
where the known 3D goes.

INPUTS   the camera's YAML and pose, the sequence's skeleton and frames, boxes drawn around the subject, else the
         pictures; outdoors the close cameras that made the 3D; the clock given by hand, if any
OUTPUTS  `offsets` (one row), `clock_gains`, `clock_costs`, findings

For the long-range camera, after `align`. The time axis is that of the skeleton (dior/clocks/axis.py). The clock is
found with the pose as it is, and by how much an error of the pose moves it (`dior.clocks.clock`): also where the same
boxes placed the camera, both together are then what one fit of everything would say. Offsets of up to 2 s are found.
Where the data cannot tell, the clock is that of the stamps and its error unknown.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats
from dior.calibrate.outline import boxes_fit, clock_from_pictures, long_range_clock, seen_edges
from dior.calibrate.outline.seen_edges import EdgeObservations
from dior.calibrate.outline.walks import (
    FilmedWalk,
    by_close,
    constant_error,
    edged,
    from_boxes,
    from_pictures,
    limbs,
    margins,
    read_walk,
)
from dior.clocks import by_hand as hand_offsets
from dior.clocks import clock as clocks
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables, covariance
from dior.geometry.camera import Camera
from dior.project.camera_file import camera_settings
from dior.tables import tables

# chosen: standard error of the time by half a body that was read as a whole one; with it, labels that move fast are as
# often inside their ellipses as others (`python -m benchmarks.coverage`, level `real`: a wall hides the legs)
HALF_BODY_S = 0.05
FEWEST_BOXES = 4  # chosen: fewer are not meant to tell the clock (docs/formats.md); the pictures then do


def watched(
    walk: FilmedWalk, camera: Camera, settings: Mapping[str, Any], boxes: Path | None, data_root: Path
) -> tuple[EdgeObservations, str, tuple[float, float]]:
    """`EdgeObservations` of one walk, the method (table `offsets`), and the margins' prior (all edges, v to u) px.

    `settings` of the camera's YAML: what the boxes are around.
    """
    shown, edges = from_boxes(walk, boxes) if boxes else (np.zeros(0, int), np.zeros((0, 4)))
    if len(shown) >= FEWEST_BOXES:
        method, source, around = "boxes", "boxes", settings.get("align", {}).get("around", "body")
    else:
        ((shown, edges),) = from_pictures([walk], camera, data_root)
        method, source, around = "pictures", "silhouettes", "body"
    margin_px, split_px, _ = margins(settings, source)
    track, flesh_m, outline_m = edged(walk, around)
    seconds = walk.seconds[shown]
    points = track.at(seconds)
    nothing = np.full((*points.shape[:2], 2), np.nan)
    seen = seen_edges.EdgeObservations(
        points, edges, nothing, seconds, np.zeros(len(shown), int), constant_error([walk]), flesh_m, (track,),
        outline_m, limbs([walk], around), walk.most_s,
    )  # fmt: skip
    return seen, method, (margin_px, split_px)


def hidden_side(camera: Camera, seen: EdgeObservations, margin: tuple[float, float], occluder: str, where: str) -> str:
    """The side of the edges that is an occluder's, or "", as `boxes_fit.fit` reads it with the camera where it is.

    The clock is held at the lag that fits best with nothing hidden: the sides that are left tell it well enough.
    """
    readings = boxes_fit.READINGS[occluder]
    if len(readings) == 1:
        return readings[0]
    held = seen_edges.Freedom(turn=(0, 0, 0), shift=(0, 0, 0), margin_px=margin[0], margin_split_px=margin[1])
    seconds = seen.seconds + long_range_clock.best_lag(camera, held, seen)
    late = replace(seen, seconds=seconds, points=seen.tracks[0].at(seconds))
    try:
        return boxes_fit.fit(camera, held, late, where).camera.occluded
    except DiorError:
        # nothing is where the 3D goes
        return ""


def doubtful(camera: Camera, seen: EdgeObservations, pose_covariance: Floats) -> bool:
    """Whether the camera's pose (6, 6) is so little known along the body that half of it may have been read as whole
    (`occluder_doubtful` of `align`): the limbs that tell the time may be others then."""
    points = seen.points[np.isfinite(seen.points).all(axis=-1)]
    _, by_camera = covariance.projection(camera, points)
    spread = by_camera @ pose_covariance @ np.swapaxes(by_camera, -1, -2)
    along = np.sqrt(np.median(np.trace(spread, axis1=-2, axis2=-1)))
    return bool(along > boxes_fit.OTHER_LABELS * np.nanmedian(seen.edges[:, 3] - seen.edges[:, 1]))


def findings_of(scope: str, found: long_range_clock.ClockFromEdges) -> list[tuple[str, str, str, str]]:
    """Findings of an estimated clock: (scope, severity, code, text)."""
    if found.refused:
        text = f"the clock is not known: {found.refused}; its stamps are taken as they are. Draw boxes on more pictures"
        text += " in which the subject walks, or give the offset in config/offsets"
        return [(scope, "warning", "clock_unknown", text)]
    clock = found.clock
    late = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s
    text = (
        f"offset {1e3 * late:+.1f} ± {1.96e3 * clock.given[0]:.1f} ms in the middle, drift {clock.drift_ppm:+.0f} ± "
        f"{1.96 * clock.given[1]:.0f} ppm, by {found.count} edges of {clock.method}: {found.before_px:.2f} px rms "
        f"without it, {found.after_px:.2f} px with it. ± is a 95 % interval with the camera as it is"
    )
    return [(scope, "info", "clock_followed", text)]


def write(
    sequence: str,
    camera: str,
    clock: clocks.Clock,
    costs_px: Sequence[float] | Floats,
    findings: list[tuple[str, str, str, str]],
    written: clocks.ClockFiles,
    names: Sequence[str] = (),
    joint: Floats | None = None,
) -> None:
    """Write the tables of one camera's clock."""
    clocks.write(written.out, written.out_gains, sequence, {camera: clock}, names, joint)
    lags = long_range_clock.lags_of(costs_px)
    named = {"sequence": [sequence] * len(lags), "camera": [camera] * len(lags)}
    tables.write(written.out_costs, "clock_costs", {**named, "lag_s": lags, "cost_px": costs_px})
    tables.write_findings(written.findings, findings)


@dataclass(frozen=True)
class Placed:
    """The poses of the camera and of those that the 3D was triangulated from.

    `cameras`: tables `cameras` with its pose and those called `makers`; `makers`: cameras that the skeleton was
    triangulated from (none indoors); `covariance`: the `camera_covariance` tables of all.
    """

    cameras: list[Path]
    makers: list[str]
    covariance: list[Path]


@dataclass(frozen=True)
class ByHand:
    """What a person gave.

    `offsets`: the file of clocks given by hand, or None; `boxes`: those drawn, CSV, or None.
    """

    offsets: Path | None
    boxes: Path | None


def run(
    *,
    sequence: str,
    camera: str,
    camera_file: Path,
    placed: Placed,
    skeleton: Path,
    frames: Path,
    given: ByHand,
    data_root: Path,
    written: clocks.ClockFiles,
) -> None:
    """Write the clock of one camera in one sequence."""
    scope, makers = f"{sequence}/{camera}", placed.makers
    names = list(dict.fromkeys([*makers, camera]))
    rig = dict(zip(names, camera_tables.read_placed(placed.cameras, names, sequence), strict=True))
    walk = read_walk(sequence, camera, skeleton, frames, given.offsets)
    cam.check_picture_size(rig[camera].intrinsics, walk.rows["width"][0], walk.rows["height"][0], scope)
    if walk.held:
        by_hand = hand_offsets.by_hand(given.offsets, tables.ordered_unique(tables.read(frames, "frames")["camera"]))
        write(sequence, camera, by_hand[camera], [], [], written)
        return
    settings = camera_settings(camera_file)
    seen, method, margin = watched(walk, rig[camera], settings, given.boxes, data_root)
    occluder = settings.get("align", {}).get("occluder", "auto")
    # without edges or 3D there is no side to read; the estimate says what that means for the clock
    enough = np.isfinite(seen.edges).sum() >= long_range_clock.FEWEST
    there = np.isfinite(cam.project(rig[camera], seen.points)[0]).any()
    side = hidden_side(rig[camera], seen, margin, occluder, scope) if enough and there else ""
    close = [rig[name] for name in makers]
    derivative = (list(makers), partial(by_close, close)) if makers else None
    trails_m = clock_from_pictures.TRAILS_M if method == "pictures" else 0.0
    found = long_range_clock.estimate(rig[camera], seen, method, margin, side, derivative, trails_m)
    joint = camera_tables.read_camera_covariance(placed.covariance, names) if placed.covariance else None
    at = slice(6 * names.index(camera), 6 * names.index(camera) + 6)
    if joint is not None and not found.refused and doubtful(rig[camera], seen, joint[at, at]):
        wide = float(np.hypot(found.clock.given[0], HALF_BODY_S)), found.clock.given[1]
        found = replace(found, clock=replace(found.clock, given=wide))
    write(sequence, camera, found.clock, found.costs_px, findings_of(scope, found), written, names, joint)
