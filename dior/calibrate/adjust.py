"""Bundle adjustment of the close cameras of a session (paper, outdoor steps 3 to 5).

INPUTS   placed cameras, their YAML (tape priors) and marks of the AprilTag; detections, frames and offsets of the
         window's sequences
OUTPUTS  cameras (adjusted wTc) and their joint covariance, metrics (mean reprojection error before and after), findings

Poses and points are free, intrinsics fixed. Points are joints at the window's instants (a fixed list, so that a new
sequence does not move old labels), on the nominal grid t0 + k/fps of their sequence. Where no person gave a camera's
clock, it is found by turns with the poses (`bundle.in_adjustment`).
The start is the best of several (`bundle.starts`): GTSAM's solution of a sample of the joints. All joints and the
metric facts of the session follow with the points eliminated (`bundle.reduced`), and from that the joint covariance of
the cameras (`bundle.uncertainty`); what each solver is for stands in `dior.calibrate.bundle`.
What holds the gauge besides the facts: every tape-measured camera keeps to its measured position with the tape's sigma,
one without a tape to its placed position with 5 cm; a camera that was aimed by look-at keeps to that rotation with 30
degrees, which decides only what nothing else does (two cameras could turn about the line between them),
another with 2 degrees. A camera that was placed by the AprilTag keeps to where it saw the corners instead, and to its
tape where there is one.
Detections that disagree with the other views of their joint (another person, exchanged sides, a wrong limb) take no
part: they are looked for from the adjusted cameras, and the adjustment is repeated without them.
A reprojection error is the mean distance in recorded pixels. World in metres, Z up, floor at Z = 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats
from dior.body import plausible as people
from dior.calibrate.bundle import (
    adjustment,
    bundle,
    culprits,
    in_adjustment,
    outcome,
    starts,
)
from dior.calibrate.bundle import window as seen_in
from dior.calibrate.bundle.outcome import Adjusted
from dior.calibrate.lens import realsense
from dior.clocks import by_hand as clocks
from dior.errors import DiorError, many, nearest
from dior.geometry import camera_tables, covariance
from dior.geometry.camera import REFERENCE_FX, Camera, pose, reprojection_errors
from dior.geometry.multiview import rotation_z
from dior.geometry.triangulation import triangulated
from dior.ingest.video_starts import search_s
from dior.project import heights
from dior.project.camera_file import camera_settings
from dior.tables import tables
from dior.tables.tables import Finding

# chosen: how far an aim by eye may be off; it decides only what nothing else does
AIM_SIGMA_DEG = 30.0
PLACED_SIGMA_M, PLACED_SIGMA_DEG = 0.05, 2.0  # chosen: of a placement by another's calibration
TAPE_SIGMA_M = 0.05  # chosen: of a tape, where the YAML does not say
UNKNOWN_M = 1000.0  # no tape at all
MARK_SIGMA_PX = 1.0  # chosen: a click at full zoom


def _sampled_cost(cameras: Sequence[Camera], priors: Sequence[bundle.Prior], huber_px: float) -> culprits.Cost:
    """What it costs (`culprits.Cost`) to adjust some of the cameras to a sample of what they have, from as placed."""

    def cost(views: Sequence[int], timed: in_adjustment.Sequences) -> tuple[float, float]:
        own, held = [cameras[i] for i in views], [priors[i] for i in views]
        uv, _, _ = timed.observations(timed.start(own, *adjustment.how_far_off(own, held)))
        few = uv[:, adjustment.sample(np.all(np.isfinite(uv), axis=-1))]
        sigma = huber_px * np.array([camera.intrinsics.fx for camera in own]) / REFERENCE_FX / bundle.HUBER
        adjusted = adjustment.sampled(own, few, held, sigma, "")
        strain = sum(
            float(((camera.centre - prior.position) ** 2).sum()) / prior.sigma_m**2
            for camera, prior in zip(adjusted, held, strict=True)
        )
        return starts.cost(adjusted, few), strain

    return cost


def prior_of(camera: Camera, settings: dict[str, Any]) -> bundle.Prior:
    """The `bundle.Prior` of a placed camera from its YAML (see the module's docstring)."""
    tape = settings.get("tape", {"position_m": camera.centre, "sigma_m": PLACED_SIGMA_M})
    turn = AIM_SIGMA_DEG if camera.locate == "tape" else PLACED_SIGMA_DEG
    return bundle.Prior(
        np.array(tape["position_m"], float), tape.get("sigma_m", TAPE_SIGMA_M), camera.wRc, np.radians(turn)
    )


def beside_tag(prior: bundle.Prior, camera: Camera, settings: dict[str, Any]) -> bundle.Prior:
    """The prior of a camera whose tag's corners take part themselves: only its tape is left of it."""
    if camera.locate != "apriltag":
        return prior
    return replace(prior, sigma_m=prior.sigma_m if "tape" in settings else UNKNOWN_M, sigma_rad=np.pi)


@dataclass(frozen=True)
class Walks:
    """What the cameras recorded of the sequences, in files named by their sequence.

    `detections`: tables `detections`; `frames`: tables `frames`; `offsets`: YAML files with clocks given by hand;
    `window`: which instants of each sequence take part; `everybody_seen`: tables `detected_people`.
    """

    detections: list[Path]
    frames: list[Path]
    offsets: list[Path]
    window: dict[str, Any]
    everybody_seen: list[Path] = field(default_factory=list)


@dataclass(frozen=True)
class Choices:
    """How the adjustment is made; see `adjust` in config.yaml.

    `min_score`: score from which a detection counts; `min_views`: least number of cameras that see a joint; `huber_px`:
    residual in px beyond which a keypoint pulls no harder; `max_mean_px`: mean residual in px above which the session
    is refused;
    `max_gap`: nominal periods between two pictures over which is interpolated.
    """

    min_score: float
    min_views: int
    huber_px: float
    max_mean_px: float
    max_gap: float


@dataclass(frozen=True)
class Measured:
    """What is known in metres, and where it is in the pictures.

    `known`: metric facts (`Project.metric_facts`); `marks`: marks CSVs of the close cameras; `marked`: the sequences of
    which these are used; `tags`: tables `marks` that place wrote of cameras that see the AprilTag; `people`: the
    subjects.tsv that has the heights of whom `known` names without.
    """

    known: dict[str, Any]
    marks: list[Path]
    marked: list[str]
    tags: list[Path]
    people: Path | None = None


@dataclass(frozen=True)
class Written:
    """The files that the step writes.

    `out`: table `cameras`; `out_covariance`: table `camera_covariance`; `out_metrics`: table `metrics`; `findings`:
    table `findings`.
    """

    out: Path
    out_covariance: Path
    out_metrics: Path
    findings: Path


def run(
    *,
    session: str,
    cameras: list[Path],
    camera_files: list[Path],
    walks: Walks,
    choices: Choices,
    measured: Measured,
    physics: dict[str, Any],
    written: Written,
) -> None:
    """Write the adjusted cameras, metrics and findings.

    `camera_files`: the YAML files, named by their camera; `physics`: limits (`dior.body.plausible`).
    """
    window, known = walks.window, heights.filled(measured.known, measured.people)
    huber_px, max_mean_px = choices.huber_px, choices.max_mean_px
    placed = list(camera_tables.read_cameras(cameras).values())
    intrinsics_sigma = np.array([camera.intrinsics.sigma for camera in placed])
    yamls = {Path(path).stem.partition("@")[0]: path for path in camera_files}
    settings = {name: camera_settings(path) for name, path in yamls.items()}
    for camera in placed:
        if camera.name not in settings:
            raise DiorError(f"session {session}: no YAML for {camera.name}{nearest(camera.name, settings)}")
    found: list[Finding] = []
    files = {
        kind: {Path(path).name.partition(".")[0]: path for path in paths}
        for kind, paths in (("detections", walks.detections), ("frames", walks.frames), ("offsets", walks.offsets))
    }
    recorded, given = [], []
    for sequence in window:
        where = f"session {session}, {sequence}"
        for kind in ("detections", "frames"):
            if sequence not in files[kind]:
                raise DiorError(f"{where}: no {kind} are given for it{nearest(sequence, files[kind])}")
        pictures = tables.read(files["frames"][sequence], "frames", ["camera", "frame", "stamp_ns"])
        clock = clocks.read(files["offsets"].get(sequence), tables.ordered_unique(pictures["camera"]))
        seen = tables.read(files["detections"][sequence], "detections")
        most_s = search_s(files["frames"][sequence])
        recorded.append(seen_in.recorded(placed, seen, pictures, choices.min_score, choices.max_gap, where, most_s))
        given.append([clock[camera.name] for camera in placed])
    placed, rolled = _as_mounted(placed, settings, recorded, session)
    found += rolled
    start_priors = [prior_of(camera, settings[camera.name]) for camera in placed]
    priors = [beside_tag(p, c, settings[c.name]) for p, c in zip(start_priors, placed, strict=True)]
    names = [camera.name for camera in placed]
    corners = seen_in.tag_corners(placed, measured.tags, f"session {session}")
    stated = seen_in.metric_facts(known, list(window)) + corners
    clicked = {Path(path).name.partition(".")[0].partition("@")[0]: path for path in measured.marks}
    wanted = seen_in.names_of_marks(known) - set(names)
    points = seen_in.marked(clicked, names, wanted, measured.marked, MARK_SIGMA_PX)
    cost = _sampled_cost(placed, start_priors, huber_px)

    def timed_of(recorded: Sequence[seen_in.Recorded]) -> in_adjustment.Sequences:
        return in_adjustment.of(recorded, list(window.values()), names, given, choices.min_views)

    def solved(timed: in_adjustment.Sequences) -> tuple[Adjusted | None, DiorError | np.linalg.LinAlgError | None]:
        """Where the adjustment ends, and what is wrong with it."""
        try:
            done = adjustment.adjust(
                placed, timed, priors, huber_px, max_mean_px, f"session {session}", None, stated, points,
                intrinsics_sigma, start_priors,
            )  # fmt: skip
        except (DiorError, np.linalg.LinAlgError) as error:
            return None, error
        try:
            _check_people(done, timed, session, list(window), known, physics)
        except DiorError as error:
            return done, error
        return done, None

    def far_off() -> str:
        off = adjustment.how_far_off(placed, start_priors)
        return culprits.far_off(timed, list(window), cost, lambda wide: wide.start(placed, *off))

    alone, left_out = _alone(recorded, placed, list(window), walks.everybody_seen)
    tried = [recorded]
    if left_out:
        tried.insert(0 if seen_in.are_few(left_out, recorded) else 1, alone)
    for own in tried:
        timed = timed_of(own)
        done, wrong = solved(timed)
        if not wrong:
            break
    if own is alone:
        text = f"made without the {many(left_out, 'picture')} in which somebody else is seen, too"
        found.append((session, "info", "others_left_out", text))
    if wrong or done is None:
        said = str(wrong) if isinstance(wrong, DiorError) else f"session {session}: the adjustment diverges"
        why = far_off() or ("" if done else culprits.sentence(placed, timed, list(window), cost))
        raise DiorError((why and f"session {session}: {why}. Without that: ") + said) from wrong
    uv, _, parts = timed.observations(done.clocks)
    for sequence, part, instants in zip(window, parts, window.values(), strict=True):
        text = f"{len(part.joint)} joints at {part.count} of {instants['count']} instants of {sequence} used"
        found.append((session, "info" if len(part.joint) else "warning", "adjust_window", text))
    by_itself = _by_detections_alone(placed, priors, huber_px, max_mean_px, start_priors, timed, intrinsics_sigma)
    found += in_adjustment.findings(session, list(window), timed, done, by_itself)
    found += outcome.findings(session, placed, priors, done)
    found += _lens_models(
        session, yamls, {name: s["topic"] for name, s in settings.items()}, done, uv, start_priors, huber_px
    )
    camera_tables.write_cameras(written.out, done.cameras, session)
    if done.uncertainty is not None:
        known_to = done.uncertainty
        spread = covariance.joined(known_to.covariance, known_to.across, known_to.lenses)
        camera_tables.write_camera_covariance(written.out_covariance, names, spread, session)
    tables.write(written.out_metrics, "metrics", outcome.metrics(done))
    tables.write_findings(written.findings, found)


def _check_people(
    done: Adjusted,
    timed: in_adjustment.Sequences,
    session: str,
    sequences: Sequence[str],
    known: Mapping[str, Any],
    physics: dict[str, Any],
) -> None:
    """Raises DiorError where the joints of a sequence are no person's, or not of the one who was measured."""
    _, tracks, parts = timed.observations(done.clocks)
    for i, (sequence, part) in enumerate(zip(sequences, parts, strict=True)):
        skeleton = np.full((len(part.seconds), len(part.names), 3), np.nan)
        skeleton[part.instant, part.joint] = done.points[tracks.sequence == i]
        scope = f"session {session}, {sequence}"
        people.check(skeleton, part.names, scope, physics, part.seconds)
        for person in known.get("heights", []):
            if sequence in person["sequences"]:
                share = (people.LIMITS | physics)["stature_share"]
                people.check_height(
                    skeleton, part.names, scope, person["subject"], person["height_m"], person["sigma_m"], share
                )


def _alone(
    recorded: Sequence[seen_in.Recorded], cameras: Sequence[Camera], sequences: Sequence[str], paths: Sequence[Path]
) -> tuple[list[seen_in.Recorded], int]:
    """What was recorded without the pictures in which several people are seen, and how many of these there are."""
    files = {Path(path).name.partition(".")[0]: path for path in paths}
    out, left_out = [], 0
    for sequence, own in zip(sequences, recorded, strict=True):
        if sequence in files:
            own, count = seen_in.alone(own, cameras, tables.read(files[sequence], "detected_people"))
            left_out += count
        out.append(own)
    return out, left_out


def _as_mounted(
    placed: Sequence[Camera], settings: Mapping[str, dict[str, Any]], recorded: Sequence[seen_in.Recorded], session: str
) -> tuple[list[Camera], list[Finding]]:
    """The cameras that a tape placed, level as far as it knows, turned about their axes as the people in their pictures
    say, where the YAML does not; and findings.
    """
    out, found = [], []
    for i, camera in enumerate(placed):
        angle = 0.0
        if camera.locate == "tape" and "roll_deg" not in settings[camera.name].get("tape", {}):
            seen = max(recorded, key=lambda one: len(one.seen[i].uv))
            angle = starts.roll(camera, seen.seen[i].uv, seen.names)
        out.append(camera.at(pose(camera.wRc @ rotation_z(angle), camera.centre)) if angle else camera)
        if angle:
            text = (
                f"the people in the pictures stand as if the camera was turned by {np.degrees(angle):.0f} degrees "
                "about its axis, and the adjustment starts there; if it is mounted so, say tape.roll_deg: "
                f"{np.degrees(angle):.0f}, if not, its detections are of turned pictures"
            )
            found.append((f"{session}/{camera.name}", "warning", "camera_rolled", text))
    return out, found


def _by_detections_alone(
    cameras: Sequence[Camera],
    priors: Sequence[bundle.Prior],
    huber_px: float,
    max_mean_px: float,
    start_priors: Sequence[bundle.Prior],
    timed: in_adjustment.Sequences,
    lens_sigma: Floats,
) -> Adjusted | None:
    """`Adjusted` with the clocks that were given by hand free, to compare them; None where there is none, or no answer.

    Cameras give way to a wrong clock, so that it takes an adjustment of its own to see it.
    """
    free = timed.freed()
    if (free.held == timed.held).all():
        return None
    try:
        return adjustment.adjust(
            cameras, free, priors, huber_px, max_mean_px, "", lens_sigma=lens_sigma, start_priors=start_priors
        )  # fmt: skip
    except DiorError:
        return None


def _lens_models(
    session: str,
    yamls: Mapping[str, Path],
    topics: Mapping[str, str],
    done: Adjusted,
    uv: Floats,
    priors: Sequence[bundle.Prior],
    huber_px: float,
) -> list[Finding]:
    """Findings on how the joints fit either model that a RealSense may have; `yamls` and `topics` by camera.

    The cameras are adjusted again for the other model, so that the poses cannot favour the one they were found with.
    """
    doubtful = [i for i, c in enumerate(done.cameras) if realsense.is_ambiguous(topics[c.name], c.intrinsics)]
    if not doubtful:
        return []
    few = adjustment.sample(np.isfinite(done.after_px))
    # the same detections for both
    seen = np.where(np.isfinite(done.after_px)[..., None], uv, np.nan)[:, few]
    assumed = [realsense.as_other(c) if i in doubtful else c for i, c in enumerate(done.cameras)]
    sigma = huber_px * np.array([c.intrinsics.fx for c in assumed]) / REFERENCE_FX / bundle.HUBER
    try:
        other = adjustment.sampled(assumed, seen, priors, sigma, "")
        other_px = reprojection_errors(other, triangulated(other, seen), seen)
    except DiorError:
        other_px = np.full((len(assumed), 1), np.inf)
    found = []
    for i in doubtful:
        camera = done.cameras[i]
        mean_px, other_mean_px = (float(np.nanmean(errors[i])) for errors in (done.after_px[:, few], other_px))
        scope = f"{session}/{camera.name}"
        found.append(
            realsense.finding(scope, "the joints", camera.intrinsics.model, mean_px, other_mean_px, yamls[camera.name])
        )
    return found
