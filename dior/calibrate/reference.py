"""Cameras of somebody else's calibration: is its world one, what does the walk say of it, how well is it known?

INPUTS   the placed cameras of a session with `locate: reference`, their YAML, marks with x, y, z; of one outdoor walk
         the detections, frames and clocks given by hand
OUTPUTS  `cameras` (as placed, or in the walk's world), `camera_covariance`, findings

A calibration under which no walk can be reconstructed (another unit, inverted poses, a left-handed world, another axis
up) is refused by name, before clocks and 3D fail of it (`body.wrong_world`). `reference.world: from_walk` takes the
floor and the vertical from the walk, `from_marks` from three measured points or more; both leave the size, and where
the cameras stand to each other, as they are. A pose's standard errors are those of the YAML, else those that the walk
tells (`bundle.given_poses`), for the long-range camera of the calibration too; where neither is there they are null,
and a finding says so. The poses themselves are not adjusted: that is `adjust`. World in metres, Z up.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats
from dior.body import plausible, world_of_walk, wrong_world
from dior.calibrate.bundle import given_poses, in_adjustment
from dior.calibrate.bundle import window as seen_in
from dior.calibrate.bundle.given_poses import PoseErrors
from dior.calibrate.marks import world_of_points
from dior.calibrate.marks.marks import Marks
from dior.calibrate.marks.marks import read as read_marks
from dior.calibrate.readers import given
from dior.clocks import by_hand as clocks
from dior.errors import DiorError
from dior.geometry import camera_tables, covariance
from dior.geometry.camera import Camera
from dior.geometry.tape import check_above_floor
from dior.project import heights
from dior.project.camera_file import camera_settings
from dior.tables import tables
from dior.tables.tables import Finding

# chosen: instants of the walk that take part, spread over it
INSTANTS = 150
# chosen: two strides. On simulated walks the vertical is found to 0.4 degrees (median), on the 0.9 m of a balancing
# beam in real_outdoor it is 14 degrees off
LEAST_WAY_M = 2.5
# chosen: a tape and a click on a post's foot are good to half as much
MOST_OFF_M = 0.05


@dataclass(frozen=True)
class WalkFiles:
    """What the cameras recorded of a walk.

    `sequence`: its name, "" where no walk tells; `subject`: who walks; `detections`: its table; `frames`: its table;
    `offsets`: the YAML with clocks given by hand; `people`: the subjects.tsv that may have the height of `subject`.
    """

    sequence: str
    subject: str
    detections: Path | None
    frames: Path | None
    offsets: Path | None
    people: Path | None


@dataclass(frozen=True)
class Choices:
    """Which detections count, see `adjust` in config.yaml.

    `min_score`: score from which one counts; `huber_px`: residual in px beyond which a keypoint pulls no harder;
    `max_gap`: nominal periods between two pictures over which is interpolated.
    """

    min_score: float
    huber_px: float
    max_gap: float


def run(
    *,
    session: str,
    cameras: list[Path],
    camera_files: list[Path],
    marks: list[Path],
    marked: list[str],
    walk: WalkFiles,
    choices: Choices,
    out: Path,
    out_covariance: Path,
    findings: Path,
) -> None:
    """Write the reference cameras of a session, their covariance and findings.

    `marks`: marks CSVs of the cameras, where the world is that of marked points; `marked`: the sequences of which these
    are used.
    """
    rig = list(camera_tables.read_cameras(cameras).values())
    yamls = {Path(path).stem.partition("@")[0]: path for path in camera_files}
    settings = {camera.name: camera_settings(yamls[camera.name])["reference"] for camera in rig}
    where = f"session {session}"
    world = _world(settings, where)
    from_walk = world == "from_walk"
    close = [camera for camera in rig if camera.role == "close"]
    found: list[Finding] = []
    timed = None
    if world == "from_marks":
        by = world_of_points.rebased(rig, _points(marks, marked), where)
        rig = [camera.at(by.bTw @ camera.wTc) for camera in rig]
        close = [camera for camera in rig if camera.role == "close"]
        found.append(_moved_by_points(session, by))
    if walk.detections and walk.frames and len(close) > 1:
        timed = recorded(close, walk, walk.detections, walk.frames, choices)
        motion = checked(close, timed, walk, settings[close[0].name], f"{where}, {walk.sequence}", not from_walk)
        if from_walk:
            joints = timed.recorded[0].names
            bTw = world_of_walk.rebased(motion, joints)
            rig = [camera.at(bTw @ camera.wTc) for camera in rig]
            close = [camera for camera in rig if camera.role == "close"]
            found.append(_moved(session, walk.sequence, bTw, motion, joints))
    elif from_walk:
        raise DiorError(
            f"{where}: `reference.world: from_walk` needs an outdoor walk with detections of two close cameras with "
            "`locate: reference`; export the calibration with Z up and the floor at Z = 0 instead"
        )
    for camera in rig:
        check_above_floor(yamls[camera.name], camera.centre, "does reference.convention match the file, and is Z up?")
    estimated = None
    if timed is not None and any("sigma_m" not in one or "sigma_deg" not in one for one in settings.values()):
        lens_sigma = np.array([camera.intrinsics.sigma for camera in close])
        estimated = given_poses.of(close, timed, choices.huber_px, lens_sigma)
    errors = {name: errors_of(one, estimated) for name, one in settings.items()}
    found += _known(session, walk.sequence, errors, estimated)
    camera_tables.write_cameras(out, rig, session)
    camera_tables.write_camera_covariance(out_covariance, [c.name for c in rig], spread(rig, errors), session)
    tables.write_findings(findings, found)


def _world(settings: Mapping[str, dict[str, Any]], where: str) -> str:
    """What `reference.world` is, of all cameras."""
    worlds = {name: one["world"] for name, one in settings.items()}
    if len(set(worlds.values())) > 1:
        each = ", ".join(f"{name} {world}" for name, world in worlds.items())
        raise DiorError(f"{where}: reference.world must be the same for every reference camera, and is {each}")
    return next(iter(worlds.values()))


def _points(paths: Sequence[Path], sequences: Sequence[str]) -> dict[str, Marks]:
    """The marks by camera that are of some sequences."""
    found = {Path(path).name.partition(".")[0].partition("@")[0]: read_marks(path) for path in paths}
    return {name: own.only(np.isin(own.sequence.astype(str), sequences)) for name, own in found.items()}


def recorded(
    close: Sequence[Camera], walk: WalkFiles, detections: Path, frames: Path, choices: Choices
) -> in_adjustment.Sequences:
    """The joints of the walk as the close cameras have them, at instants spread over it."""
    pictures = tables.read(frames, "frames", ["camera", "frame", "stamp_ns"])
    clock = clocks.read(walk.offsets, tables.ordered_unique(pictures["camera"]))
    seen = tables.read(detections, "detections")
    own = seen_in.recorded(close, seen, pictures, choices.min_score, choices.max_gap, walk.sequence)
    last = int(max(one.elapsed[-1] for one in own.seen) * own.fps)
    step = max(1, last // INSTANTS)
    window = {"first": 0, "count": last // step + 1, "step": step}
    names = [camera.name for camera in close]
    return in_adjustment.of([own], [window], names, [[clock[name] for name in names]], 2)


def checked(
    close: Sequence[Camera],
    timed: in_adjustment.Sequences,
    walk: WalkFiles,
    reference: Mapping[str, Any],
    where: str,
    vertical: bool,
) -> Floats:
    """The walk's joints (T, J, 3) by the calibration; raises DiorError where that is none, with what is wrong with it.

    Clocks that nobody gave are taken as stamped: a walker is as tall with them, and stands as upright.
    """
    window, own = timed.windows[0], timed.recorded[0]
    seconds = (window["first"] + window["step"] * np.arange(window["count"])) / own.fps
    uv = np.stack([one.at(seconds, clock, 0.0) for one, clock in zip(own.seen, timed.given[0], strict=True)])
    found, points = wrong_world.of_poses(
        close,
        uv,
        own.names,
        _person(walk),
        reference.get("convention", "cTw"),
        vertical,
        given.METRES[reference.get("units", "m")],
    )
    if found:
        raise DiorError(
            f"{where}: the reference calibration {reference['file']} " + ", and ".join(fault.text for fault in found)
        )
    return points


def _person(walk: WalkFiles) -> wrong_world.Person | None:
    height = heights.of(walk.subject, walk.people)
    return wrong_world.Person(walk.subject, *height) if height else None


def _moved(session: str, sequence: str, bTw: Floats, motion: Floats, joints: Sequence[str]) -> Finding:
    """What became of the world, a warning where the walk is too short to tell the floor's tilt."""
    turn = np.degrees(np.arccos(np.clip(bTw[2, 2], -1, 1)))
    text = (
        f"the world is that of the walk of {sequence}: Z = 0 is the floor under its feet, X its way (the calibration's "
        f"vertical is turned by {turn:.1f} degrees, its origin is at {', '.join(f'{x:.2f}' for x in bTw[:3, 3])} m)"
    )
    way = extent(plausible.middle(motion, joints, "hip") @ bTw[0, :3])
    if way > LEAST_WAY_M:
        return (session, "info", "reference_world", text)
    text += (
        f"; the way is {way:.1f} m long, and below {LEAST_WAY_M:g} m a lean of the body is taken for the floor's tilt"
    )
    return (session, "warning", "reference_world", text)


def _moved_by_points(session: str, by: world_of_points.Rebased) -> Finding:
    """What became of the world, a warning where the points contradict the calibration."""
    worst = int(by.off_m.argmax())
    text = (
        f"the world is that of {len(by.names)} marked points ({', '.join(by.names)}): {by.names[worst]} is furthest "
        f"off, by {100 * by.off_m[worst]:.1f} cm, so that the floor's tilt is known to "
        f"{np.degrees(by.tilt_rad):.2f} degrees (1 sigma) or better"
    )
    off = by.off_m[worst] > MOST_OFF_M
    return (session, "warning" if off else "info", "reference_world", text)


def extent(along: Floats) -> float:
    """From the least to the greatest of values (T,), NaN left out; 0 where there is none."""
    known = along[np.isfinite(along)]
    return float(np.ptp(known)) if len(known) else 0.0


def errors_of(reference: Mapping[str, Any], estimated: PoseErrors | None) -> PoseErrors | None:
    """A camera's `PoseErrors`: those that its YAML says, the others as estimated; None where one is not known."""
    if estimated is None and not {"sigma_m", "sigma_deg"} <= set(reference):
        return None
    turn_rad, shift_m = (0.0, 0.0) if estimated is None else (estimated.turn_rad, estimated.shift_m)
    turn_rad = float(np.radians(reference["sigma_deg"])) if "sigma_deg" in reference else turn_rad
    return PoseErrors(turn_rad, float(reference.get("sigma_m", shift_m)))


def spread(rig: Sequence[Camera], errors: Mapping[str, PoseErrors | None]) -> Floats:
    """Joint covariance (9V, 9V) of the cameras with their lenses, each on its own; NaN where errors are not known."""
    count = len(rig)
    poses, lenses = np.zeros((6 * count, 6 * count)), np.zeros((3 * count, 3 * count))
    for i, camera in enumerate(rig):
        known, own = errors[camera.name], slice(6 * i, 6 * i + 6)
        poses[own, own] = np.full((6, 6), np.nan) if known is None else known.covariance()
        lenses[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = np.eye(3) * camera.intrinsics.sigma**2
    return covariance.joined(poses, np.zeros((6 * count, 3 * count)), lenses)


def _known(
    session: str, sequence: str, errors: Mapping[str, PoseErrors | None], estimated: PoseErrors | None
) -> list[Finding]:
    found: list[Finding] = []
    if estimated is not None:
        text = (
            f"by the walk of {sequence} each reference camera is known to {np.degrees(estimated.turn_rad):.2f} degrees "
            f"and {100 * estimated.shift_m:.1f} cm (1 sigma in each axis)"
        )
        found.append((session, "info", "reference_uncertainty", text))
    for name, known in errors.items():
        if known is None:
            text = (
                "nobody says how well the reference pose is known, and there is no outdoor walk of two such close "
                "cameras that tells: its labels have no sigma; give reference.sigma_m and reference.sigma_deg"
            )
            found.append((f"{session}/{name}", "warning", "reference_uncertainty_unknown", text))
    return found
