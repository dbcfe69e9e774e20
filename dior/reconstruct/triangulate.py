"""3D joints of an outdoor sequence from the detections of its close cameras.

INPUTS   cameras (`cameras` tables), detections, everybody in the pictures (`detected_people`), timeline; the subject's
         height (subjects.tsv) and config/people/<sequence>.yaml, where there are any
OUTPUTS  `skeletons_3d`: one row per instant and joint; `swaps`: which detections had left and right exchanged;
         `detections` again, of whom was chosen;
         `findings`: what a person should know about them, first of all which camera does not belong to the others
Where there is anybody else, the subject's detections are chosen now that the cameras are known (`which_person`); else
they are those of `detections`. World frame, metres. Two methods: `rays`, the paper's intersection, and `robust`, the
default.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Bools, Floats, Ints, Table, Texts
from dior.body import which_person
from dior.body.names import is_leg, swap_index
from dior.body.people_followed import UNKNOWN, mean_size
from dior.clocks.axis import blend
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables, culprit, multiview
from dior.geometry.camera import Camera
from dior.project import heights
from dior.reconstruct import bodies, detector_noise, everybody, robust
from dior.reconstruct.gates import implausible
from dior.reconstruct.swaps import exchange, find_exchanged, find_mistaken_limbs
from dior.reconstruct.timeline import nearest_frames, rate, stamps_of
from dior.tables import tables

METHODS = ("robust", "rays")
# a detector exchanges the sides of some walkers who turn away, but not those of most pictures; chosen
MOSTLY = 0.5


def by_rays(cameras: Sequence[Camera], uv: Floats) -> Floats:
    """The paper's ray intersection: points (..., 3) from pixels (V, ..., 2)."""
    directions = np.stack([cam.rays(c, view) for c, view in zip(cameras, uv, strict=True)])
    return multiview.intersect_rays(np.stack([c.centre for c in cameras]), directions)


def in_front(cameras: Sequence[Camera], points: Floats, used: Bools) -> Bools:
    """Whether points (..., 3) lie in front of every camera that was used (V, ...) for them."""
    depth = np.stack([cam.project(c, points)[1] for c in cameras])
    with np.errstate(invalid="ignore"):
        return np.all((depth > 0) | ~used, axis=0)


def observations(
    detections: Table, timeline: Table, cameras: Sequence[str], min_score: float
) -> tuple[Floats, Floats, list[str]]:
    """Detections at the instants: pixels (V, T, J, 2) and scores (V, T, J), NaN and 0 where missing, and the joints.

    A score below `min_score` is missing. Nothing is interpolated across a dropped frame or a missing detection.
    """
    uv, score = [], []
    names: list[str] = []
    for name in cameras:
        rows, line = tables.of_camera(detections, name), tables.of_camera(timeline, name)
        if not len(rows["u"]) or not len(line["instant"]):
            raise DiorError(f"camera {name}: no detections or no timeline; both need every close camera")
        values, joints = tables.grid(rows, "u", "v", "score")
        if names and names != joints:
            raise DiorError(f"camera {name}: its detections have other joints than the other cameras'")
        names = joints
        values[..., :2][~(values[..., 2] >= min_score)] = np.nan
        at = blend(values, line["frame_before"], line["frame_after"], line["weight"])
        uv.append(at[..., :2])
        score.append(np.where(np.isfinite(at).all(axis=-1), at[..., 2], 0.0))
    return np.stack(uv), np.stack(score), names


def crossed(detections: Table, timeline: Table, cameras: Sequence[str], min_score: float) -> tuple[Floats, list[str]]:
    """Each camera's detections at the moments of every camera's pictures, (V, V, T, J, 2) px, and the joints.

    As `observations` where both are the same camera; else as if its detections belonged to the pictures of the other.
    At instants that are spread over the sequence, as many as `culprit.judge` asks for.
    """
    lines = [tables.of_camera(timeline, name) for name in cameras]
    few = culprit.spread(len(lines[0]["frame_before"]), culprit.MOST_INSTANTS)
    lines = [tables.rows(line, few) for line in lines]
    longest = 1 + max(int(line["frame_after"].max()) for line in lines)
    out = []
    for name in cameras:
        values, joints = tables.grid(tables.of_camera(detections, name), "u", "v", "score")
        uv = np.where((values[..., 2] >= min_score)[..., None], values[..., :2], np.nan)
        uv = np.concatenate([uv, np.full((max(longest - len(uv), 0), *uv.shape[1:]), np.nan)])
        out.append([blend(uv, line["frame_before"], line["frame_after"], line["weight"]) for line in lines])
    return np.array(out), joints


@dataclass(frozen=True)
class Limits:
    """What a detection and a joint must keep to; see config.yaml."""

    min_score: float
    max_error_px: float
    max_speed: float
    max_body_speed: float
    max_bone_change: float


@dataclass(frozen=True)
class Told:
    """What tells the subject from others.

    `everybody_seen`: table `detected_people`; `people`: subjects.tsv, where the subject's height is known; `bodies`:
    table `bodies`, how tall they are by the same cameras; `seeds`: YAML file in which somebody pointed at the subject.
    """

    everybody_seen: Path | None = None
    people: Path | None = None
    bodies: Path | None = None
    seeds: Path | None = None


def run(
    *,
    sequence: str,
    subject: str,
    cameras: list[Path],
    names: list[str],
    detections: Path,
    timeline: Path,
    method: str,
    limits: Limits,
    out: Path,
    out_swaps: Path,
    findings: Path,
    told: Told,
    out_detections: Path | None = None,
) -> None:
    """Triangulate one sequence from the cameras `names`, whose poses are in the `cameras` tables."""
    given = gathered(sequence, subject, cameras, names, detections, timeline, method, limits.min_score, told)
    rig, joints, stamps, frames = given.rig, given.seen.names, given.stamps, given.frames
    choice, seen = given.choice, given.seen
    uv, score = (given.uv, given.score) if choice is None else everybody.picked(seen, choice)
    mine = everybody.of_subject(given.detected, given.others, seen, choice, names, frames)
    if out_detections:
        tables.write(out_detections, "detections", mine)
    found, corrected = solved(rig, uv, score, joints, seen.fps, method, limits)
    if choice:
        word = which_person.words(choice.state)[:, None]
        found = found.known_only(np.where(word == "", found.status, word))
    about = {"noise_time_s": f"{found.time_s:.6g}"}
    write_skeleton(out, subject, sequence, found.columns(joints, stamps), about)
    write_swaps(out_swaps, names, stamps, frames, corrected.swapped, joints)
    judged = mine if choice and np.mean(choice.state == which_person.OWN) > MOSTLY else given.detected
    notes = _culprit(sequence, rig, judged, given.line, limits.min_score, choice is not None)
    notes += _findings(sequence, names, np.any(corrected.swapped, axis=2), found.status)
    notes += _mistaken_findings(sequence, names, corrected.mistaken)
    if choice:
        notes += everybody.findings(sequence, choice, names, frames, seen.fps, given.measured)
    tables.write_findings(findings, notes)


@dataclass(frozen=True, eq=False)
class Given:
    """What the close cameras `rig` have of a sequence: the subject's detections as the step `detections` has them, `uv`
    (V, T, J, 2) px and `score` (V, T, J); everybody `seen`, and who of them is the subject (`choice`, None where there
    is nobody else); `stamps` (T,) ns and `frames` (V, T) of the instants; the tables `line`, `detected` and `others`;
    `measured`: the subject's height is known."""

    rig: list[Camera]
    uv: Floats
    score: Floats
    seen: which_person.Seen
    choice: which_person.Choice | None
    stamps: Ints
    frames: Ints
    line: Table
    detected: Table
    others: Table | None
    measured: bool


def gathered(
    sequence: str,
    subject: str,
    cameras: list[Path],
    names: list[str],
    detections: Path,
    timeline: Path,
    method: str,
    min_score: float,
    told: Told,
) -> Given:
    """`Given` from the files; arguments as of `run`."""
    if method not in METHODS:
        raise DiorError(f"config/config.yaml: triangulate.method is '{method}', not one of {', '.join(METHODS)}")
    rig = camera_tables.read_placed(cameras, names, sequence)
    line = tables.read(timeline, "timeline")
    detected = tables.read(detections, "detections")
    uv, score, _ = observations(detected, line, names, min_score)
    stamps = stamps_of(line)
    fps = rate(stamps)
    frames = nearest_frames(line, names)
    others = tables.read(told.everybody_seen, "detected_people") if told.everybody_seen else None
    seen = everybody.at_instants(detected, others, line, names, min_score, fps)
    height = heights.of(subject, told.people)
    by_tape = which_person.by_tape(*height) if height else UNKNOWN
    known = mean_size([bodies.of_other_walks(told.bodies, subject, sequence), by_tape])
    choice = which_person.choose(rig, seen, known, everybody.seeds_of(told.seeds, seen, names, frames))
    return Given(rig, uv, score, seen, choice, stamps, frames, line, detected, others, height is not None)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The 3D of somebody: `points` (T, J, 3) m and their `covariance` (T, J, 3, 3) m^2, NaN but where `status` (T, J)
    is ok; `n_views` and `residual` px (T, J); `constant_share` (T, J) of the variance, the rest of which dies away with
    the time constant `time_s`."""

    points: Floats
    status: Texts
    n_views: Ints
    residual: Floats
    covariance: Floats
    constant_share: Floats
    time_s: float

    def known_only(self, status: Texts) -> "Skeleton":
        """The same with another status, and without what is not ok."""
        ok = status == "ok"
        return replace(
            self,
            points=np.where(ok[..., None], self.points, np.nan),
            status=status,
            covariance=np.where(ok[..., None, None], self.covariance, np.nan),
            constant_share=np.where(ok, self.constant_share, np.nan),
        )

    def columns(self, joints: Sequence[str], stamps: Ints) -> dict[str, tables.Column]:
        """The columns of `skeletons_3d` but for whose it is."""
        return columns(
            joints, stamps, self.points, self.status, self.n_views, self.residual, self.covariance, self.constant_share
        )


@dataclass(frozen=True, eq=False)
class Corrected:
    """Which detections (V, T, J) had left and right `swapped`, and which were `mistaken` for the other limb."""

    swapped: Bools
    mistaken: Bools


def solved(
    rig: Sequence[Camera],
    uv: Floats,
    score: Floats,
    joints: Sequence[str],
    fps: float,
    method: str,
    limits: Limits,
) -> tuple[Skeleton, Corrected]:
    """The `Skeleton` of one person from detections uv (V, T, J, 2) px with scores (V, T, J), and what was corrected."""
    swapped = np.zeros(uv.shape[:3], bool)
    mistaken = np.zeros(uv.shape[:3], bool)
    if method == "robust":
        other = robust.strangers(rig, uv, score, fps, swap_index(joints))
        score = np.where(other[..., None], 0.0, score)
        swapped = find_exchanged(rig, uv, score, joints, fps)
        uv, score = exchange(uv, swapped, joints), exchange(score, swapped, joints)
        noise = detector_noise.estimated(rig, uv, score, fps, joints)
        mistaken = find_mistaken_limbs(rig, uv, score, noise.sigma, joints, fps)
        score = np.where(mistaken, 0.0, score)
        found = robust.triangulate(rig, uv, score, fps, noise.sigma)
        points, used, residual = found.points, found.used, found.residual
        good = found.scaled <= limits.max_error_px  # false for NaN
    else:
        used = score > 0
        points = by_rays(rig, np.where(used[..., None], uv, np.nan))
        errors = np.where(used, cam.reprojection_errors(rig, points, uv), 0.0)
        residual = errors.sum(axis=0) / np.maximum(used.sum(axis=0), 1)
        good = np.ones(residual.shape, bool)
        noise = detector_noise.estimated(rig, uv, score, fps, joints)
        found = robust.Points(points, used, residual, residual, noise.sigma)
    time_s, constant_share = robust.error_correlation(rig, uv, score, found, fps, noise)
    weights = np.where(used, score, 0.0) / noise.sigma
    covariance = robust.covariance(rig, points, weights, noise.own)
    enough = (used.sum(axis=0) >= 2) & np.all(np.isfinite(points), axis=-1)
    good &= in_front(rig, points, used)
    if method == "robust":
        sound = np.where((enough & good)[..., None], points, np.nan)
        speeds = (limits.max_speed, limits.max_body_speed)
        good &= ~implausible(sound, covariance, joints, fps, *speeds, limits.max_bone_change)
    status = np.where(~enough, "too_few_views", np.where(good, "ok", "rejected"))
    residual = np.where(enough, residual, np.nan)
    skeleton = Skeleton(points, status, used.sum(axis=0), residual, covariance, constant_share, time_s)
    return skeleton.known_only(status), Corrected(swapped, mistaken)


def _culprit(
    sequence: str, rig: Sequence[Camera], detections: Table, timeline: Table, min_score: float, several: bool
) -> list[tuple[str, str, str, str]]:
    """What is said of a camera that does not belong to the others.

    Where `several` people were followed, detections that no pose explains are for `which_person` to judge.
    """
    names = [camera.name for camera in rig]
    seen, joints = crossed(detections, timeline, names, min_score)
    verdict = culprit.judge(rig, seen, swap_index(joints))
    if several and not all(one.exchange or one.posed for one in verdict.readings):
        return []
    return culprit.findings(sequence, names, verdict, f"the files of the detections of {sequence}")


def write_skeleton(
    path: AnyPath,
    subject: str,
    sequence: str,
    known: dict[str, tables.Column],
    metadata: dict[str, str] | None = None,
) -> None:
    """Write `skeletons_3d` of what is `known` (`columns`)."""
    once = np.zeros(len(known["instant"]), int)
    own = {"subject": tables.Repeated([subject], once), "sequence": tables.Repeated([sequence], once)}
    tables.write(path, "skeletons_3d", own | known, metadata)


def columns(
    joints: Sequence[str],
    stamps: Ints,
    points: Floats,
    status: Texts,
    n_views: Ints,
    residual: Floats,
    covariance: Floats | None = None,
    constant_share: Floats | None = None,
) -> dict[str, tables.Column]:
    """The columns of `skeletons_3d` but for whose it is, of points (T, J, 3) m, their covariance (T, J, 3, 3) m^2, the
    share of it that is constant (T, J), and what is known about them (T, J)."""
    count, each = points.shape[:2]
    return {
        "joint": tables.Repeated(joints, np.tile(np.arange(each), count)),
        "instant": np.repeat(np.arange(count), each),
        "stamp_ns": np.repeat(stamps, each),
        **{axis: points[..., i].ravel() for i, axis in enumerate("xyz")},
        **({} if covariance is None else sigmas(covariance.reshape(-1, 3, 3))),
        **({} if constant_share is None else {"constant_share": constant_share.ravel()}),
        "n_views": n_views.ravel(),
        "residual_px": residual.ravel(),
        "status": status.ravel(),
    }


def sigmas(covariance: Floats) -> dict[str, Floats]:
    """The columns of `skeletons_3d` that say a covariance (N, 3, 3) m^2."""
    sd = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    axes = "xyz"
    pairs = ((0, 1), (0, 2), (1, 2))
    return {f"sigma_{axis}": sd[:, i] for i, axis in enumerate(axes)} | {
        f"rho_{axes[i]}{axes[j]}": covariance[:, i, j] / (sd[:, i] * sd[:, j]) for i, j in pairs
    }


def write_swaps(
    path: AnyPath, names: Sequence[str], stamps: Ints, frames: Ints, swapped: Bools, joints: Sequence[str]
) -> None:
    """Write `swaps` from the nearest frames (V, T) and swapped (V, T, J)."""
    count = len(stamps)
    legs = np.array([is_leg(name) for name in joints])
    of_legs, of_rest = swapped[:, :, legs].any(axis=2).ravel(), swapped[:, :, ~legs].any(axis=2).ravel()
    tables.write(
        path,
        "swaps",
        {
            "camera": np.repeat(names, count).astype(object),
            "instant": np.tile(np.arange(count), len(names)),
            "stamp_ns": np.tile(stamps, len(names)),
            "frame": frames.ravel(),
            "swapped": of_legs | of_rest,
            "part": np.select([of_legs & of_rest, of_legs, of_rest], ["all", "legs", "rest"], ""),
        },
    )


def _findings(sequence: str, names: Sequence[str], swapped: Bools, status: Texts) -> list[tuple[str, str, str, str]]:
    found = []
    for name, row in zip(names, swapped, strict=True):
        n = int(row.sum())
        text = f"left and right exchanged at {n} of {len(row)} instants"
        if n > MOSTLY * len(row):
            text = f"the detector is swapped: {text}, so its pictures or its joints are mirrored; they are turned back"
            found.append((f"{sequence}/{name}", "warning", "detector_swapped", text))
        elif n:
            found.append((f"{sequence}/{name}", "info", "left_right_swapped", text))
    missing = np.mean(status != "ok")
    if missing > 0.1:
        text = f"{missing:.0%} of the 3D joints could not be triangulated: {_shares(status)}"
        found.append((sequence, "warning", "missing_3d", text))
    return found


def _mistaken_findings(sequence: str, names: Sequence[str], mistaken: Bools) -> list[tuple[str, str, str, str]]:
    """Where a camera's detections (V, T, J) put both sides' names on one limb together with another camera's."""
    text = "with another camera, one limb was taken for the other at {} of {} instants; left out there"
    hit = np.any(mistaken, axis=2)
    return [
        (f"{sequence}/{name}", "info", "limb_taken_for_other", text.format(int(row.sum()), len(row)))
        for name, row in zip(names, hit, strict=True)
        if row.any()
    ]


def _shares(status: Texts) -> str:
    words, counts = np.unique(status[status != "ok"], return_counts=True)
    return ", ".join(f"{word} {n / status.size:.0%}" for word, n in zip(words, counts, strict=True))
