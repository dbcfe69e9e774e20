"""Place the long-range camera: by hand boxes, silhouettes or clicked joints around the known walker, or by eye.

INPUTS   camera YAML (`locate: align`, `tape`, and `align` or `nudge`), intrinsics; with `align` the skeletons and
         frames of the sequences it lists, their boxes, marks or pictures, and the clocks given by hand; the close
         cameras and their covariance
OUTPUTS  cameras (one row with wTc), camera_covariance (rows of this camera), left_out_boxes, findings

By eye: `wRc = Rz(azimuth + da) Rx(elevation + de)` with the look-at angles of the un-nudged centre, then the centre
moves `distance_m` away from the target, horizontally; the aim is not recomputed (design, section 2; the paper's
long-range refinement). In the picture, by about f times the angle: a positive azimuth turns the camera to the left and
moves the labels right, a positive elevation turns it up and moves them down, a positive distance shrinks them.

With `align` this is only the start, and `boxes_fit` does the rest. The 3D is that of the close cameras, so the camera
takes over the world's errors: its covariance has blocks with theirs. The camera's clock in each sequence is fitted
with the pose (`dior follow` tells what it is), unless config/offsets says it. World in metres, Z up.

So that boxes may judge what they placed, each is also left out of a fit (`left_out`): a fifth of them at a time.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats, Ints, Table
from dior.calibrate.outline import boxes_fit, edge_errors, seen_edges
from dior.calibrate.outline import drawers as other_drawers
from dior.calibrate.outline.walks import FilmedWalk, by_close, from_boxes, gather, margins, read_walk
from dior.clocks import lag
from dior.clocks.clock import DRIFT_SD_PPM, OFFSET_SD_S
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables, covariance
from dior.geometry.camera import Camera, pose
from dior.geometry.camera_tables import unplaced
from dior.geometry.multiview import look_at_angles, rotation_x, rotation_z
from dior.geometry.tape import check_above_floor, look_at_pose
from dior.ingest.video_starts import MOST_SIGMAS
from dior.project import boxes as hand_boxes
from dior.project.camera_file import camera_settings
from dior.tables import tables

# chosen: a person pays out the tape along the sight and sets the tripod down beside it, with its height measured
ACROSS_M, HEIGHT_M = 0.1, 0.05
FOCAL_SIGMA = 0.03  # chosen: of the log of the focal length; a zoom or a lens that is focused anew changes it as much
FEW_AGREE = 0.6  # chosen: share of the edges below which a person is to look at what was drawn
# chosen: a camera that is not level, where nobody says so: boxes that agree less than FEW_AGREE or more loosely than
# this (px at fx 760) are tried with cameras a quarter turn apart, each of which finds a roll 60 degrees from it; one
# that ends turned by more than this is rolled, and fitted again from there
LOOSE_PX, TRIED_DEG, LEVEL_DEG = 3.0, (90.0, 180.0, 270.0), 10.0
FAR_FROM_TAPE = 3.0  # sd of the tape: 0.3 % of correct measurements are further off


def aligned_pose(where: AnyPath, tape: Mapping[str, Any], nudge: Mapping[str, Any]) -> Floats:
    """wTc (4, 4) from the sections `tape` and `nudge` of a camera's YAML (degrees and metres).

    Raises DiorError for a camera straight above its target, which has no horizontal direction to move in.
    """
    look_at_pose(where, tape)
    centre, target = (np.array(tape.get(key, (0, 0, 0)), float) for key in ("position_m", "target_m"))
    azimuth, elevation = look_at_angles(centre, target)
    azimuth += np.radians(nudge.get("azimuth_deg", 0.0))
    elevation += np.radians(nudge.get("elevation_deg", 0.0))
    away = (centre - target) * (1, 1, 0)
    distance = nudge.get("distance_m", 0.0)
    if distance and np.linalg.norm(away) < 1e-3:
        raise DiorError(f"{where}: nudge.distance_m has no direction for a camera straight above its target")
    if distance <= -np.linalg.norm(away) and distance:
        raise DiorError(f"{where}: nudge.distance_m {distance:g} moves the camera past its target")
    moved = centre + (distance * away / np.linalg.norm(away) if distance else 0.0)
    check_above_floor(where, moved, "tape.position_m is x, y, z with Z up from the floor")
    roll = np.radians(tape.get("roll_deg", 0.0))
    return pose(rotation_z(azimuth) @ rotation_x(elevation) @ rotation_z(roll), moved)


def freedom(settings: Mapping[str, Any], held: Sequence[bool], most_s: float = lag.WINDOW_S) -> seen_edges.Freedom:
    """`seen_edges.Freedom` of a camera's YAML: how far the tape is trusted, by what `align.fit` says.

    `held`: of each walk, whether its clock was given by hand; `most_s`: how far off the others may be.
    """
    sigma = settings["tape"].get("sigma_m", 0.05)
    beside = (min(sigma, ACROSS_M), min(sigma, HEIGHT_M))
    how = settings["align"].get("fit", "range")
    shift = (sigma,) * 3 if how == "position" else (sigma, *beside)
    margin_px, split_px, habit_px = margins(settings)
    return seen_edges.Freedom(
        shift=shift,
        focal=FOCAL_SIGMA if how == "focal" else 0.0,
        margin_px=margin_px,
        margin_split_px=split_px,
        habit_px=habit_px,
        clock_s=tuple(0.0 if known else max(OFFSET_SD_S, most_s / MOST_SIGMAS) for known in held),
        drift_ppm=tuple(0.0 if known else DRIFT_SD_PPM for known in held),
    )


def fit_any_roll(
    start: Camera,
    trusted: seen_edges.Freedom,
    seen: seen_edges.EdgeObservations,
    where: str,
    derivative: boxes_fit.Derivative,
    occluder: str,
) -> tuple[boxes_fit.Fitted, float]:
    """`boxes_fit.fit` from the start, or where that does not agree from one that is `rolled`, or with clocks that are
    further off than is searched, which a turned camera may feign; by how much it is turned (degrees), 0 for level.
    """
    turned = partial(rolled, start)
    fitted, by = boxes_fit.fit(start, trusted, seen, where, derivative, occluder), 0.0
    compared = _compared(fitted, seen)
    if (
        np.abs(compared) <= boxes_fit.CUT * fitted.sd_px
    ).mean() < FEW_AGREE or fitted.sd_px > LOOSE_PX * start.intrinsics.fx / 760:
        tried = [(fitted, by)]
        ways = [(degrees, trusted, seen) for degrees in TRIED_DEG]
        if seen.tracks and (far_s := lag.furthest(float(np.ptp(seen.seconds)))) > seen.most_s:
            loose = tuple(far_s / MOST_SIGMAS if sd_s else 0.0 for sd_s in trusted.clock_s)
            ways.append((0.0, replace(trusted, clock_s=loose), replace(seen, most_s=far_s)))
        for degrees, free, those in ways:
            # a wrong roll may come to nothing
            with suppress(DiorError):
                tried.append((boxes_fit.fit(turned(degrees), free, those, where, derivative, occluder), degrees))
        scale = boxes_fit.CUT * min(one.sd_px for one, _ in tried)
        fitted, by = min(tried, key=lambda one: -edge_errors.weights(_compared(one[0], seen), scale).mean())
    ends = by + float(np.degrees(fitted.values[2]))
    if abs(ends - by) > LEVEL_DEG:
        by = ends
        fitted = boxes_fit.fit(turned(by), trusted, seen, where, derivative, occluder)
    return fitted, (by + 180) % 360 - 180


def _far_off(camera: str, walks: Sequence[FilmedWalk], fitted: boxes_fit.Fitted) -> list[tuple[str, str, str, str]]:
    """Findings on clocks that are further off than they are searched."""
    return [
        (
            f"{walk.name}/{camera}", "warning", "clock_unknown",
            f"what was drawn or seen fits the camera where it was measured if its clock is {late_s:+.1f} s off, more "
            f"than the {walk.most_s:.1f} s that are searched; give that as offset_s in config/offsets/{walk.name}.yaml",
        )
        for walk, late_s in zip(walks, fitted.clocks[:, 0].tolist(), strict=True)
        if not walk.held and abs(late_s) > walk.most_s
    ]  # fmt: skip


def rolled(start: Camera, degrees: float) -> Camera:
    """The camera turned about its axis."""
    return start.at(pose(start.wRc @ rotation_z(np.radians(degrees)), start.centre))


def _compared(fitted: boxes_fit.Fitted, seen: seen_edges.EdgeObservations) -> Floats:
    """Residuals (N,) px of all edges that are not an occluder's and of all clicks; 1e9 for what the fit has no body at.

    A wrong roll may run out of the walk's time, where nothing contradicts it.
    """
    edges = np.isfinite(seen.edges)
    if (side := cam.occluded_edge(fitted.camera)) is not None:
        edges[:, side] = False
    each = np.concatenate([fitted.residual[edges], fitted.click_residual[np.isfinite(seen.clicks)]])
    return np.nan_to_num(each, nan=1e9)


def _residuals(fitted: boxes_fit.Fitted) -> Floats:
    """All residuals (N,) px, of edges and clicks."""
    each = np.concatenate([fitted.residual.ravel(), fitted.click_residual.ravel()])
    return each[np.isfinite(each)]


def left_out(
    start: Camera,
    trusted: seen_edges.Freedom,
    seen: seen_edges.EdgeObservations,
    fitted: boxes_fit.Fitted,
    fold: Ints,
    where: str,
) -> Floats:
    """How far (F, 2) px the labels of each picture move where its box is left out of the fit, in the mean over joints.

    `fold` (F,): in which fit each is; NaN where too little is left.
    """
    before, moved = cam.project(fitted.camera, fitted.points)[0], np.full((len(fold), 2), np.nan)
    for number in np.unique(fold):
        mine = fold == number
        others = replace(seen, edges=np.where(mine[:, None], np.nan, seen.edges))
        if np.isfinite(others.edges).sum() < boxes_fit.FEWEST:
            continue
        try:
            camera, points = boxes_fit.again(start, trusted, others, fitted, where)
        except DiorError:
            continue
        step = cam.project(camera, points[mine])[0] - before[mine]
        known = np.isfinite(step).all(axis=-1, keepdims=True)
        count = known.sum(axis=1)
        moved[mine] = np.where(count > 0, np.where(known, step, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
    return moved


def _left_out_columns(camera: str, drawn: Mapping[str, Ints], moved: Floats) -> Table:
    """Columns of `left_out_boxes` of the frames `drawn` by sequence, whose labels are `moved` (F, 2) px or NaN."""
    known = np.isfinite(moved).all(axis=1)
    names = np.repeat(np.array(list(drawn), object), [len(frames) for frames in drawn.values()])
    return {
        "sequence": names[known],
        "camera": np.full(known.sum(), camera, object),
        "frame": np.concatenate(list(drawn.values()))[known],
        "shift_u": moved[known, 0],
        "shift_v": moved[known, 1],
    }


def joint_covariance(fitted: boxes_fit.Fitted, close_covariance: Floats | None, range_m: float) -> Floats:
    """(6 + 6V, 6 + 6V) of this camera and the V close ones, whose errors it takes over. NaN of them is none known."""
    T = boxes_fit.to_pose(fitted.camera, range_m)
    own = T @ fitted.covariance @ T.T
    if close_covariance is None or not np.isfinite(close_covariance).all():
        return own
    by_close_ones = T @ fitted.by_cameras
    cross = by_close_ones @ close_covariance
    return np.block([[own + cross @ by_close_ones.T, cross], [cross.T, close_covariance]])


def found_out(
    scope: str,
    walks: Sequence[FilmedWalk],
    seen: seen_edges.EdgeObservations,
    fitted: boxes_fit.Fitted,
    pose_covariance: Floats,
    taped: Floats,
    habit_px: float,
) -> list[tuple[str, str, str, str]]:
    """What the fit found, with 95 % intervals: (scope, severity, code, text).

    `taped`: standard errors of the tape (3,) m; `habit_px`: of an edge that is drawn further out in every box.
    """
    edge = np.isfinite(fitted.residual)
    residual = _residuals(fitted)
    agreed = np.abs(residual) <= boxes_fit.CUT * fitted.sd_px
    half = 1.96 * np.sqrt(np.diagonal(pose_covariance))
    turn = np.degrees(fitted.values[:3]) * (1, -1, 1)
    turn_half = np.degrees(half[:3])
    spread = 1.96 * np.sqrt(np.diagonal(fitted.covariance))
    focal = f", focal length {100 * np.expm1(fitted.values[6]):+.2f} ± {100 * spread[6]:.2f} %" if spread[6] else ""
    drawn = ""
    if edge.any():
        drawn = (
            f"; the boxes are {fitted.values[7]:.1f} ± {spread[7]:.1f} px too large along u and "
            f"{fitted.values[8]:.1f} ± {spread[8]:.1f} px along v, on each edge"
        )
    if habit_px:
        drawn += f" (that one of them is further out in every box, by {habit_px:.2g} px, is in the intervals)"
    text = (
        f"turned from its start by {turn[1]:+.3f} ± {turn_half[1]:.3f} degrees to the left, "
        f"{turn[0]:+.3f} ± {turn_half[0]:.3f} up and {turn[2]:+.2f} ± {turn_half[2]:.2f} about its axis, moved "
        f"{fitted.values[3]:+.2f} ± {spread[3]:.2f} m along its sight{focal}{drawn}. {len(seen.points)} pictures of "
        f"{', '.join(walk.name for walk in walks)}: {agreed.mean():.0%} of {len(residual)} edges and clicks agree, "
        f"rms {np.sqrt((residual[agreed] ** 2).mean()):.2f} px. ± is a 95 % interval"
    )
    late = [
        f"{walk.name} {1e3 * clock[0]:+.0f} ± {1.96e3 * sigma[0]:.0f} ms"
        for walk, clock, sigma in zip(walks, fitted.clocks, fitted.clock_sigma, strict=True)
        if not walk.held
    ]
    if late:
        text += f"; its clock, fitted with it: {', '.join(late)}"
    _, J = covariance.projection(fitted.camera, np.nanmean(fitted.points, axis=(0, 1)))
    middle = 1.96 * np.sqrt(np.diagonal(J @ pose_covariance @ J.T))
    text += (
        f"; in the middle of the walks the camera's part of a label is ± {middle[0]:.2f} px in u, {middle[1]:.2f} in v"
    )
    found = [(scope, "info", "camera_aligned", text)]
    if agreed.mean() < FEW_AGREE:
        found.append(
            (scope, "warning", "align_disagrees", f"only {agreed.mean():.0%} of the edges agree with one camera; is "
             "everything drawn around the subject, is the clock right, is the tape right within its sigma_m?")
        )  # fmt: skip
    if fitted.camera.occluded:
        side = {"below": "lower", "above": "upper"}[fitted.camera.occluded]
        found.append(
            (scope, "info", "occluder", f"the {side} edges are read as those of something that hides the body beyond; "
             "say align.occluder: none if nothing does")
        )  # fmt: skip
    if fitted.ahead < boxes_fit.DOUBTFUL:
        found.append(
            (scope, "warning", "occluder_doubtful", "it cannot be told whether something hides a part of the body in "
             "the boxes; say align.occluder: none, below or above")
        )  # fmt: skip
    moved = fitted.values[3:6] / np.maximum(taped, 1e-9)
    if np.abs(moved).max() > FAR_FROM_TAPE:
        found.append(
            (scope, "warning", "far_from_tape", f"the camera ends {np.linalg.norm(fitted.values[3:6]):.2f} m from its "
             "tape position, more than 3 times the tape's sigma_m; measure again")
        )  # fmt: skip
    return found


@dataclass(frozen=True)
class Walks:
    """The walks that the camera is aligned with.

    `skeletons` and `frames`: a file per sequence of the YAML's `align.sequences`, where a bump splits the session of
    those of its part; none without that section.
    """

    skeletons: list[Path]
    frames: list[Path]


@dataclass(frozen=True)
class ByHand:
    """What a person gave about these walks.

    `offsets`: YAML files with clocks; `boxes`: those drawn, a CSV file per sequence; `marks`: the CSV file of joints
    clicked in the camera's pictures, or None.
    """

    offsets: list[Path]
    boxes: list[Path]
    marks: Path | None


@dataclass(frozen=True)
class CloseCameras:
    """The close cameras, which the 3D was triangulated from.

    `close`: their `cameras` tables; `close_covariance`: their `camera_covariance` tables.
    """

    close: list[Path]
    close_covariance: list[Path]


def run(
    *,
    session: str,
    camera: str,
    camera_file: Path,
    intrinsics: Path,
    filmed: Walks,
    given: ByHand,
    data_root: Path,
    triangulated_by: CloseCameras,
    out: Path,
    out_covariance: Path,
    out_without: Path,
    findings: Path,
) -> None:
    """Write the aligned camera, its covariance, what it would be without each box, and findings."""
    settings = camera_settings(camera_file, needs="align")
    lens = unplaced(intrinsics, camera)
    start = lens.at(aligned_pose(camera_file, settings["tape"], settings.get("nudge", {})), settings["locate"])
    how = settings.get("align")
    if not how:
        camera_tables.write_cameras(out, [start], session)
        camera_tables.write_camera_covariance(out_covariance, [camera], np.full((6, 6), np.nan), session)
        tables.write(out_without, "left_out_boxes", {})
        tables.write_findings(findings, [])
        return
    scope = f"{session}/{camera}"
    skeletons, frames, boxes, offsets = (
        {Path(path).name.split(".")[0]: path for path in paths}
        for paths in (filmed.skeletons, filmed.frames, given.boxes, given.offsets)
    )
    walks = [read_walk(name, camera, skeletons[name], frames[name], offsets.get(name)) for name in sorted(skeletons)]
    cam.check_picture_size(lens.intrinsics, walks[0].rows["width"][0], walks[0].rows["height"][0], scope)
    seen = gather(walks, start, how["from"], boxes, data_root, given.marks, how.get("around", "body"))
    close, close_covariance = triangulated_by.close, triangulated_by.close_covariance
    rig = (
        [c for c in camera_tables.read_cameras(close).values() if c.wTc is not None and c.role == "close"]
        if close
        else []
    )
    derivative = partial(by_close, rig) if rig else None
    compared, prior_px = other_drawers.Apart(), margins(settings)[2]
    if how["from"] == "boxes":
        by_drawer = [hand_boxes.read_drawers(boxes[walk.name], walk.rows["frame"], walk.size) for walk in walks]
        compared = other_drawers.apart(by_drawer)
        settings = settings | {"align": how | {"habit_px": other_drawers.habit(prior_px, compared)}}
    trusted = freedom(settings, [walk.held for walk in walks], max(walk.most_s for walk in walks))
    by_roll: list[tuple[str, str, str, str]] = []
    degrees = 0.0
    if "roll_deg" in settings["tape"]:
        fitted = boxes_fit.fit(start, trusted, seen, scope, derivative, how.get("occluder", "auto"))
    else:
        fitted, degrees = fit_any_roll(start, trusted, seen, scope, derivative, how.get("occluder", "auto"))
        if degrees:
            text = (
                f"what was drawn or seen fits a camera that is turned by {degrees:.0f} degrees about its axis; if it "
                f"is mounted so, say tape.roll_deg: {degrees:.0f}"
            )
            if loose := [walk.name for walk in walks if not walk.held]:
                text += (
                    f"; if it is level, its clock may be further off than the {walks[0].most_s:.1f} s that are "
                    f"searched: say tape.roll_deg: 0 and give its offset_s in config/offsets/{loose[0]}.yaml"
                )
            by_roll.append((scope, "warning", "camera_rolled", text))
    by_roll += _far_off(camera, walks, fitted)
    check_above_floor(camera_file, fitted.camera.centre, "are the boxes the subject's, and is the tape right?")
    known = None
    if rig and close_covariance:
        known = camera_tables.read_camera_covariance(close_covariance, [c.name for c in rig])
    range_m = float(np.nanmedian(cam.project(fitted.camera, fitted.points)[1]))
    spread = joint_covariance(fitted, known, range_m)
    all_names = [camera, *(c.name for c in rig)][: len(spread) // 6]
    camera_tables.write_cameras(out, [fitted.camera], session)
    camera_tables.write_camera_covariance(out_covariance, all_names, spread, session, own=[camera])
    without: Table = {}
    if how["from"] == "boxes":
        drawn = {walk.name: walk.rows["frame"][from_boxes(walk, boxes[walk.name])[0]] for walk in walks}
        fold = np.concatenate([hand_boxes.folds(shown) for shown in drawn.values()])
        moved = left_out(rolled(start, degrees), trusted, seen, fitted, fold, scope)
        without = _left_out_columns(camera, drawn, moved)
    tables.write(out_without, "left_out_boxes", without)
    found = found_out(scope, walks, seen, fitted, spread[:6, :6], np.array(trusted.shift), trusted.habit_px)
    found += other_drawers.findings(scope, compared, prior_px, trusted.habit_px)
    tables.write_findings(findings, by_roll + found)
