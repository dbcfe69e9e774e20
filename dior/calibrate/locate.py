"""Locate a camera from hand-marked pairs: PnP with RANSAC, refined in recorded pixels (paper, indoor step 3), and with
the pose the camera's clock on every marked sequence that has none in config/offsets (`clock_from_marks`).

INPUTS   camera YAML, marks CSV, intrinsics, and for the marks' sequences the frames, mocap and offsets
OUTPUTS  cameras (one row with wTc), camera_covariance, offsets, clock_gains and clock_costs of the marked sequences,
         marks (residual in recorded px and inlier flag of every mark), findings

OpenCV sees ideal normalised points and K = I, so that the lens is the project's own; its cTw is inverted at once.
World in metres, Z up, floor at Z = 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Bools, Floats, Ints
from dior.calibrate.lens import realsense
from dior.calibrate.marks import clock_from_marks, odd_frame, pnp
from dior.calibrate.marks import marks as hand_marks
from dior.clocks import by_hand, lag
from dior.clocks.axis import nominal_fps
from dior.clocks.clock import Clock, write_all
from dior.errors import DiorError
from dior.geometry import camera_tables, covariance
from dior.geometry.camera import Camera, Intrinsics, inverse_pose, pose, project, undistort
from dior.geometry.camera_tables import unplaced
from dior.geometry.tape import check_above_floor
from dior.ingest.video_starts import search_s
from dior.project.camera_file import camera_settings
from dior.tables import tables
from dior.tables.tables import Finding

FEWEST = 4  # P3P has up to four solutions of three marks
# chosen: a pose that fewer of the marks agree on may as well be an accident of a minimal sample
SHARE_OF_CONSENSUS = 0.5
# chosen: enough for 4 good marks of 30 % (1 - e^-16); marks are few, so that it costs milliseconds
RANSAC_ITERATIONS, RANSAC_CONFIDENCE = 2000, 0.9999
ROUNDS, SAME_OFFSET_S = 10, 1e-6  # chosen: pose and clocks by turns, until the clocks move by less
UNCERTAIN_M, UNCERTAIN_DEG = 0.10, 1.0  # chosen: beyond these a person is asked for more marks


@dataclass(frozen=True, eq=False)
class Located:
    """`wTc` (4, 4) m; `residual_px` (N,) in recorded px, NaN where a mark cannot be projected; `inlier` (N,).

    `sigma_m` and `sigma_deg`: largest standard error of centre and rotation, from the residuals; NaN for 4 inliers.
    `jacobian` (2I, 6 + S), by the pose and by the offsets of S clocks that were found with it, and `miss` (I, 2) px of
    the I inliers; `other`: what to say of a second pose.
    """

    wTc: Floats
    residual_px: Floats
    inlier: Bools
    sigma_m: float
    sigma_deg: float
    jacobian: Floats
    miss: Floats
    other: str


def locate(camera: Camera, xyz: Floats, uv: Floats, ransac_px: float, where: str) -> Located:
    """Pose of `camera` from world points `xyz` (N, 3) m and recorded pixels `uv` (N, 2).

    RANSAC with minimal samples of AP3P finds the marks that agree within `ransac_px`; their pose minimises the squared
    residuals in recorded pixels, and the set of inliers is renewed until it does not change. The same marks give the
    same pose. Raises DiorError (beginning with `where`): fewer than 4 marks, no consensus, a pose that the marks leave
    open, the camera below the floor.
    """
    xyz, uv = np.asarray(xyz, float), np.asarray(uv, float)
    check_enough(where, len(xyz))
    needed = max(FEWEST, int(np.ceil(SHARE_OF_CONSENSUS * len(xyz))))
    inlier = _consensus(camera.intrinsics, xyz, uv, ransac_px)
    if inlier.sum() < FEWEST:
        raise _no_consensus(where, inlier, ransac_px)
    _check_spread(where, xyz[inlier])
    wTc = _start(camera.intrinsics, xyz[inlier], uv[inlier])
    for _ in range(20):
        wTc, J = refine(camera.at(wTc), xyz[inlier], uv[inlier])
        residual = residuals(camera.at(wTc), xyz, uv)
        with np.errstate(invalid="ignore"):
            agreeing = residual <= ransac_px
        if agreeing.sum() < needed:
            raise _no_consensus(where, agreeing, ransac_px)
        if (agreeing == inlier).all():
            break
        inlier = agreeing
    other = pnp.other_solution(camera.at(wTc), xyz[inlier], uv[inlier], refine)
    wTc, said = pnp.decide(camera.at(wTc), other, xyz[inlier], uv[inlier], where)
    check_above_floor(where, wTc[:3, 3], "are the marks on the right markers and is Z up?")
    wTc, J = refine(camera.at(wTc), xyz[inlier], uv[inlier])
    placed = camera.at(wTc)
    miss = project(placed, xyz[inlier])[0] - uv[inlier]
    residual = residuals(placed, xyz, uv)
    return Located(wTc, residual, inlier, *_standard_errors(J, residual[inlier]), J, miss, said)


def check_enough(where: str, count: int) -> None:
    """Refuse so few usable marks that no pose follows from them."""
    if count < FEWEST:
        raise DiorError(f"{where}: {count} usable marks, but at least {FEWEST} are needed; mark more points")


def _no_consensus(where: str, inlier: Bools, ransac_px: float) -> DiorError:
    return DiorError(
        f"{where}: only {inlier.sum()} of {len(inlier)} marks agree on a pose within {ransac_px:g} px; check the "
        "marked joints, the sequence's offset and the intrinsics"
    )


def _consensus(intrinsics: Intrinsics, xyz: Floats, uv: Floats, ransac_px: float) -> Bools:
    """Mask (N,) of the marks that agree on a pose, in ideal coordinates."""
    import cv2

    xy = undistort(intrinsics, uv)
    usable = np.flatnonzero(np.isfinite(xy).all(axis=1))
    inlier = np.zeros(len(xyz), bool)
    if len(usable) < FEWEST:
        return inlier
    focal = np.sqrt(intrinsics.fx * intrinsics.fy)
    cv2.setRNGSeed(0)
    found, _, _, index = cv2.solvePnPRansac(
        xyz[usable], xy[usable], np.eye(3), None, iterationsCount=RANSAC_ITERATIONS,
        reprojectionError=ransac_px / focal, confidence=RANSAC_CONFIDENCE, flags=cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    if found and index is not None:
        inlier[usable[index.ravel()]] = True
    return inlier


def _start(intrinsics: Intrinsics, xyz: Floats, uv: Floats) -> Floats:
    """wTc (4, 4) by SQPnP, a global solver that planar marks do not upset."""
    import cv2

    _, rotation, translation = cv2.solvePnP(xyz, undistort(intrinsics, uv), np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    return inverse_pose(pose(cv2.Rodrigues(rotation)[0], translation.ravel()))


def residuals(camera: Camera, xyz: Floats, uv: Floats) -> Floats:
    """Distance (N,) of recorded pixels from the projected points; NaN where a point cannot be projected."""
    return np.linalg.norm(project(camera, xyz)[0] - uv, axis=-1)


def refine(camera: Camera, xyz: Floats, uv: Floats) -> tuple[Floats, Floats]:
    """wTc (4, 4) near `camera.wTc` with the least squared residuals in recorded pixels, and its Jacobian (2N, 6).

    The parameters are a turn of the camera about its own axes (rad) and a shift of its centre (m).
    """
    from scipy.optimize import least_squares

    def miss(step: Floats) -> Floats:
        # a step that puts a point behind the camera must look bad, not missing
        return np.nan_to_num(project(covariance.moved(camera, step), xyz)[0] - uv, nan=1e4).ravel()

    fit = least_squares(miss, np.zeros(6), jac="3-point", x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return covariance.moved(camera, fit.x).wTc, fit.jac


def _check_spread(where: str, xyz: Floats) -> None:
    along, across, _ = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    if across < 1e-3 * along or along < 1e-6:
        raise DiorError(f"{where}: the marks are all on a line, which leaves the pose open; spread them more")


def _standard_errors(J: Floats, residual_px: Floats) -> tuple[float, float]:
    free = 2 * len(residual_px) - J.shape[1]
    if len(residual_px) <= FEWEST or free <= 0:
        return np.nan, np.nan
    spread = np.linalg.inv(J.T @ J) * (residual_px**2).sum() / free
    largest = [np.sqrt(np.linalg.eigvalsh(block)[-1]) for block in (spread[3:6, 3:6], spread[:3, :3])]
    return float(largest[0]), float(np.degrees(largest[1]))


def _findings(
    scope: str, path: AnyPath, marks: hand_marks.Marks, located: Located, ransac_px: float, whole: bool
) -> list[Finding]:
    """What to say of the marks and the pose; `whole`: a frame is said to be wrong as a whole."""
    inlier, residual = located.inlier, located.residual_px
    found = [
        (scope, "warning", "mark_rejected", f"{path} line {marks.line[i]}: {marks.joint[i]} on frame {marks.frame[i]} "
         f"of {marks.sequence[i]} is {_distance(residual[i])} from where the other marks put it (limit "
         f"{ransac_px:g} px); it was not used, mark it again")
        for i in np.flatnonzero(~inlier)
    ]  # fmt: skip
    if located.other:
        found.append((scope, "info", "second_pose", located.other))
    used = marks.only(inlier)
    wrong = pnp.suspect(located.jacobian, located.miss)
    # marks of a frame that is wrong as a whole are not wrong one by one
    if wrong and not whole:
        i, distance, shift = wrong
        found.append(
            (scope, "warning", "mark_suspect", f"{path} line {used.line[i]}: {used.joint[i]} on frame {used.frame[i]} "
             f"of {used.sequence[i]} is {distance:.1f} px from where the other {len(used) - 1} marks put it, more than "
             f"they scatter; it moves the camera by {1000 * shift:.0f} mm, look at it again")
        )  # fmt: skip
    text = (
        f"{inlier.sum()} of {len(inlier)} marks on {len(set(zip(marks.sequence, marks.frame, strict=True)))} frames "
        f"used, residual mean {residual[inlier].mean():.2f} px, worst {residual[inlier].max():.2f} px"
    )
    if inlier.sum() == FEWEST:
        found.append((scope, "warning", "pose_unchecked", f"{text}; 4 marks leave nothing to check them with"))
        return found
    text += f", standard error {1000 * located.sigma_m:.0f} mm and {located.sigma_deg:.2f} degrees"
    if located.sigma_m > UNCERTAIN_M or located.sigma_deg > UNCERTAIN_DEG:
        found.append((scope, "warning", "pose_uncertain", f"{text}; add marks that are spread more in space"))
    else:
        found.append((scope, "info", "pose_from_marks", text))
    return found


@dataclass(frozen=True, eq=False)
class LocatedWithClocks:
    """`located` and the marks `used` for it; the camera's `clock` on each sequence, sequence -> (offset_s, drift_ppm,
    source); `clocks`, sequence -> `Clock`, of those in which C3D markers are marked; `profile` as of
    `clock_from_marks.Found`; `covariance` (9, 9) of pose and lens (`dior.geometry.covariance`).
    """

    located: Located
    used: hand_marks.Marks
    clock: dict[str, tuple[float, float, str]]
    clocks: dict[str, Clock]
    profile: dict[str, tuple[Floats, Floats]]
    covariance: Floats
    findings: list[Finding]


def with_clocks(
    camera: Camera,
    marks: hand_marks.Marks,
    path: AnyPath,
    motions: Mapping[str, hand_marks.Motion],
    stamps: Mapping[str, tuple[Ints, Ints]],
    clock: Mapping[str, tuple[float, float, str]],
    ransac_px: float,
    scope: str,
    most_s: float = lag.WINDOW_S,
) -> LocatedWithClocks:
    """`LocatedWithClocks` from `marks`; a manual clock (sequence -> (offset_s, drift_ppm, source)) is not estimated.

    Marks of a sequence whose clock they do not determine are left out, or, where there is nothing else, used at offset
    0. `most_s`: how far off a clock may be.
    Other arguments as of `marks.in_world`. Raises DiorError as `locate`, `marks.times` and `clock_from_marks.search`
    do.
    """
    where = f"{path} ({scope})"
    all_marks, before = marks, clock
    t = hand_marks.times(marks, path, camera.name, camera.intrinsics, motions, stamps)
    manual = {sequence: one for sequence, one in clock.items() if one[2] == "manual"}
    at = clock_from_marks.places(marks, t, motions, manual, most_s)
    seen = clock_from_marks.search(camera, at, marks.uv, marks.frame, ransac_px, where)
    by_marks = {
        name: offset for name, offset in zip(at.names, seen.offsets.tolist(), strict=True) if np.isfinite(offset)
    }
    why_unknown = {name: why for name, why in zip(at.names, seen.why, strict=True) if name not in by_marks}
    unknown = np.isfinite(t) & np.isin(marks.sequence, list(why_unknown))
    # what nothing is known of moves no pose that can be had without it
    left_out = unknown & ((~unknown).sum() > FEWEST)
    findings = clock_from_marks.not_found(scope, why_unknown, left_out.any())
    marks, t = marks.only(~left_out), t[~left_out]

    given = {name: one for name, one in clock.items() if name not in by_marks}
    for _ in range(ROUNDS):
        clock = given | {name: (offset, 0.0, "estimated") for name, offset in by_marks.items()}
        used, lost = hand_marks.in_world(marks, path, camera.name, camera.intrinsics, motions, stamps, clock, scope)
        located = locate(camera, used.xyz, used.uv, ransac_px, where)
        inlier = np.isin(marks.line, used.line[located.inlier])
        at = clock_from_marks.places(marks.only(inlier), t[inlier], motions, given)
        offsets = np.array([by_marks[name] for name in at.names])
        better = clock_from_marks.refine(camera.at(located.wTc), at, marks.uv[inlier], offsets)[1]
        if (np.abs(better - offsets) < SAME_OFFSET_S).all():
            break
        by_marks |= dict(zip(at.names, better.tolist(), strict=True))

    every = clock_from_marks.places(marks, t, motions, given)
    beside = np.array([by_marks[name] for name in every.names])
    frame, placed = _frames(marks), camera.at(located.wTc)
    odd = odd_frame.faults(placed, every, marks.uv, beside, frame, ransac_px, _period_s(stamps))
    if len(odd) == 1:
        others = all_marks.only(~np.isin(all_marks.line, marks.line[odd[0].own]))
        args = path, motions, stamps, before, ransac_px, scope, most_s
        alone = _alone(camera, others, by_marks, odd[0], every.names, args)
        if alone is not None:
            found = odd_frame.findings(scope, path, marks, odd, stamps, left_out=True)
            return replace(alone, findings=found + alone.findings)
    findings += odd_frame.findings(scope, path, marks, odd, stamps, left_out=False)

    J, agreeing = clock_from_marks.jacobian(camera.at(located.wTc), at, offsets), marks.only(inlier)
    sigma_m, sigma_deg = _standard_errors(J, located.residual_px[located.inlier])
    located = replace(located, jacobian=J, sigma_m=sigma_m, sigma_deg=sigma_deg)
    lens = camera.intrinsics.sigma
    by_lens = covariance.by_lens(camera.at(located.wTc), used.xyz[located.inlier]).reshape(-1, 3)
    full, middle, across = clock_from_marks.uncertainty(
        J, t[inlier], located.miss, agreeing.joint, frame[inlier], lens * by_lens
    )
    for fault in odd:
        # which of them is right is not known, and it may be any
        step = odd_frame.change(placed, beside, fault)
        own = [*range(6), *(6 + at.names.index(name) for name in every.names if name in at.names)]
        moved = [*range(6), *(6 + s for s, name in enumerate(every.names) if name in at.names)]
        full[np.ix_(own, own)] += np.outer(step[moved], step[moved])
    joint = covariance.joined(full[:6, :6], lens * across, lens**2 * np.eye(3))
    clocks = clock_from_marks.clocks(camera.name, at.names, offsets, full, middle)
    findings += lost + clock_from_marks.findings(scope, clocks, full[:6, :6], agreeing)
    for name in dict.fromkeys(marks.sequence[np.isfinite(t)].tolist() + list(why_unknown)):
        if name not in clocks:
            clocks[name] = Clock(*clock[name])
    return LocatedWithClocks(located, used, dict(clock), clocks, seen.profile, joint, findings)


def _frames(marks: hand_marks.Marks) -> Ints:
    """The frame of each mark (N,): 0, 1, ..., in the order of the file."""
    names = dict.fromkeys(zip(marks.sequence, marks.frame.tolist(), strict=True))
    index = {name: i for i, name in enumerate(names)}
    return np.array([index[name] for name in zip(marks.sequence, marks.frame.tolist(), strict=True)], int)


def _period_s(stamps: Mapping[str, tuple[Ints, Ints]]) -> float:
    """The period of a camera's pictures."""
    return 1 / max(nominal_fps(ns) for _, ns in stamps.values() if len(ns) > 1)


def _alone(
    camera: Camera,
    others: hand_marks.Marks,
    by_marks: Mapping[str, float],
    odd: odd_frame.Fault,
    names: Sequence[str],
    args: tuple[Any, ...],
) -> LocatedWithClocks | None:
    """What the `others` than an odd frame tell, None where they do not tell pose and clocks alone: too few, or not what
    they and the shape of the odd frame's marks tell. `names`: the sequences of its clocks; `args` of `with_clocks`."""
    frames = set(zip(others.sequence, others.frame.tolist(), strict=True))
    if len(others) <= 2 * FEWEST or any(sum(own == name for own, _ in frames) < 2 for name in by_marks):
        return None
    try:
        solved = with_clocks(camera, others, *args)
    except DiorError:
        return None
    offsets = np.array([solved.clock[name][0] for name in names])
    step = odd_frame.change(camera.at(solved.located.wTc), offsets, odd)[:6]
    doubted = any(code == "frame_suspect" for _, _, code, _ in solved.findings)
    return None if doubted or not odd_frame.same_pose(step, solved.covariance[:6, :6]) else solved


def _lens_models(scope: str, path: AnyPath, lens: Camera, marks: hand_marks.Marks, located: Located) -> list[Finding]:
    """Finding on how the inliers fit either model that a RealSense may have.

    The pose is refined for each, so that it cannot favour the one that it was found with.
    """
    xyz, uv = marks.xyz[located.inlier], marks.uv[located.inlier]
    if len(xyz) <= FEWEST:
        return []
    mean = []
    for assumed in (lens, realsense.as_other(lens)):
        assumed = assumed.at(located.wTc)
        mean.append(residuals(assumed.at(refine(assumed, xyz, uv)[0]), xyz, uv).mean())
    return [realsense.finding(scope, "the marks", lens.intrinsics.model, mean[0], mean[1], path)]


def _next_mark(
    scope: str,
    camera: Camera,
    located: Located,
    spread: Floats,
    marks: hand_marks.Marks,
    motions: Mapping[str, hand_marks.Motion],
    stamps: Mapping[str, tuple[Ints, Ints]],
    clock: Mapping[str, tuple[float, float, str]],
) -> list[Finding]:
    """Finding on the marker, on a picture with marks, that would make the labels on the walks most certain."""
    candidates = hand_marks.unmarked(marks, camera, motions, stamps, clock)
    best = pnp.best_next(camera, spread, click_sd_px(located), candidates, label_places(motions))
    if best is None:
        return []
    mark, before, after = best
    text = (
        f"the camera's part of a label is {before:.2f} px (1 sigma of u or v); of all further marks on these pictures, "
        f"{mark.joint} on frame {mark.frame} of {mark.sequence} would help most, to {after:.2f} px"
    )
    return [(scope, "info", "next_mark", text)]


def click_sd_px(located: Located) -> float:
    """Standard deviation of a mark's coordinate, as the residuals have it."""
    return float(np.sqrt(pnp.variance(located.miss, located.miss.size - located.jacobian.shape[1])))


def label_places(motions: Mapping[str, hand_marks.Motion]) -> Floats:
    """Places (P, 3) m at which labels will be: the markers at some 20 instants of each walk."""
    places = np.concatenate([motion.xyz[:: max(1, len(motion.t) // 20)].reshape(-1, 3) for motion in motions.values()])
    return np.asarray(places[np.isfinite(places).all(axis=1)], float)


def _distance(residual_px: float) -> str:
    return f"{residual_px:.1f} px" if np.isfinite(residual_px) else "behind the camera or outside of the lens model"


@dataclass(frozen=True)
class ByHand:
    """What a person gave: marks, and clocks where known.

    `marks`: the CSV file of the camera's marks; `sequences`: those whose marks are used, as the file may have marks of
    people without consent; `offsets`: YAML files with clocks, named by their sequence.
    """

    marks: Path
    sequences: list[str]
    offsets: list[Path]


@dataclass(frozen=True)
class Recorded:
    """The motion capture and the pictures of the sequences.

    `mocap`: tables `skeletons_3d`, a file per sequence; `frames`: tables `frames`, named by their sequence.
    """

    mocap: list[Path]
    frames: list[Path]


@dataclass(frozen=True)
class Written:
    """The files that the step writes.

    `out`: table `cameras`; `out_covariance`: table `camera_covariance`; `out_clocks`: table `offsets`;
    `out_clock_gains`: table `clock_gains`; `out_clock_costs`: table `clock_costs`; `out_marks`: table `marks` with the
    residuals; `findings`: table `findings`.
    """

    out: Path
    out_covariance: Path
    out_clocks: Path
    out_clock_gains: Path
    out_clock_costs: Path
    out_marks: Path
    findings: Path


def run(
    *,
    session: str,
    camera: str,
    camera_file: Path,
    intrinsics: Path,
    given: ByHand,
    recorded: Recorded,
    ransac_px: float,
    written: Written,
) -> None:
    """Write the located camera, its covariance, its clocks, its marks with residuals, and findings.

    Raises DiorError as `locate`, `clock_from_marks.search` and the readers do.
    """
    settings = camera_settings(camera_file, needs="marks")
    lens = unplaced(intrinsics, camera)
    motions = dict(hand_marks.read_motion(path) for path in recorded.mocap)
    stamps, known, most_s = {}, {camera}, lag.WINDOW_S
    for path in recorded.frames:
        table = tables.read(path, "frames", ["camera", "frame", "stamp_ns"])
        known |= set(table["camera"])
        mine = tables.of_camera(table, camera)
        stamps[Path(path).stem] = mine["frame"], mine["stamp_ns"]
        most_s = max(most_s, search_s(path, absolute=True))
    files = {Path(path).stem: path for path in given.offsets}
    clock = {sequence: by_hand.read(files.get(sequence), sorted(known))[camera] for sequence in stamps}

    scope = f"{session}/{camera}"
    read = hand_marks.read(given.marks)
    read = read.only(np.isin(read.sequence, list(given.sequences)))
    solved = with_clocks(lens, read, given.marks, motions, stamps, clock, ransac_px, scope, most_s)
    located, used, spread = solved.located, solved.used, solved.covariance
    whole = any(code == "frame_suspect" for _, _, code, _ in solved.findings)
    found = solved.findings + _findings(scope, given.marks, used, located, ransac_px, whole)
    if realsense.is_ambiguous(settings["topic"], lens.intrinsics):
        found += _lens_models(scope, camera_file, lens, used, located)
    found += _next_mark(scope, lens.at(located.wTc), located, spread[:6, :6], used, motions, stamps, solved.clock)
    camera_tables.write_cameras(written.out, [lens.at(located.wTc, settings["locate"])], session)
    camera_tables.write_camera_covariance(written.out_covariance, [camera], spread, session)
    each = {sequence: {camera: one} for sequence, one in solved.clocks.items()}
    write_all(written.out_clocks, written.out_clock_gains, each, [camera], spread[:6, :6])
    tables.write(written.out_clock_costs, "clock_costs", clock_from_marks.costs(camera, solved.profile))
    tables.write(written.out_marks, "marks", _columns(session, camera, used, located))
    tables.write_findings(written.findings, found)


def _columns(session: str, camera: str, marks: hand_marks.Marks, located: Located) -> dict[str, Any]:
    return {
        "session": [session] * len(marks),
        "camera": [camera] * len(marks),
        "sequence": marks.sequence,
        "frame": marks.frame,
        "joint": marks.joint,
        **dict(zip("uv", marks.uv.T, strict=True)),
        **dict(zip("xyz", marks.xyz.T, strict=True)),
        "residual_px": located.residual_px,
        "inlier": located.inlier,
    }
