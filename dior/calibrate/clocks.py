"""The clocks of a sequence: every camera against the motion capture indoors, the close cameras against each other.

INPUTS   cameras and their covariance, detections, frames, indoors the mocap and what locate found from marks;
         config/offsets/<sequence>.yaml where a person overrides
OUTPUTS  `offsets` and `clock_gains` (dior/clocks/clock.py), `clock_costs` (how well each lag fits),
         `detection_offsets` (indoors: where detections lie beside the joints, for `evaluate.turned`), findings
Indoors in the order of how certain they are: detections (`clock.from_mocap`), marks (locate), silhouettes in the
pictures (`outline.clock_from_pictures`). Outdoors the first close camera by name is the reference
(`clock.from_cameras`). A long-range camera's clock is `follow`'s. Where the data cannot tell, the clock is zero, its
sigma is null and a finding says why.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import Floats, Table
from dior.calibrate.marks.marks import read_motion
from dior.clocks import by_hand as given_by
from dior.clocks import clock as on_axis
from dior.clocks import lag
from dior.clocks.axis import instants, rates
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.ingest.video_starts import loose_s, search_s
from dior.tables import tables

# chosen: pictures; cameras that run free on one network's time are nearer to each other
FAR_OFF = 0.9
# chosen: joints of detectors and of markers are 0.04-0.08 m apart where the C3D is the recording's, and 0.35 m or more
# with another walk's (`python -m benchmarks.culprit c3d lab`)
APART_M = 0.2
# chosen: clocks that are so many pictures and standard errors apart are of other pictures, as joints of detectors and
# of markers differ by a third of one; beyond MANY it is no counting from 1
A_PICTURE, MANY_PICTURES, CERTAIN = 0.7, 1.4, 4.0
NONE = np.zeros(0)
# of a camera: how far (2,) m right of and below each joint its detections lie, and px per m there
Aside: TypeAlias = tuple[Mapping[str, Floats], float]


@dataclass(frozen=True)
class Placed:
    """The cameras and their poses.

    `cameras`: `cameras` tables of those called `names`; `names`: in the order of the session; `covariance`: their
    `camera_covariance` tables.
    """

    cameras: list[Path]
    names: list[str]
    covariance: list[Path]


@dataclass(frozen=True)
class Detected:
    """The detections, and which of them count.

    `detections`: a table or None; `min_score`: score from which a detection counts; `max_gap`: nominal periods between
    two pictures over which is interpolated; `everybody_seen`: table `detected_people`.
    """

    detections: Path | None
    min_score: float
    max_gap: float
    everybody_seen: Path | None = None


@dataclass(frozen=True)
class Indoors:
    """What tells the clocks indoors besides.

    `mocap`: the mocap table, None outdoors; `marked`: `offsets` and `clock_gains` tables that locate wrote.
    """

    mocap: Path | None
    marked: list[Path]


def run(
    *,
    sequence: str,
    placed: Placed,
    detected: Detected,
    frames: Path,
    indoors: Indoors,
    offsets: Path | None,
    data_root: Path,
    written: on_axis.ClockFiles,
    out_aside: Path,
) -> None:
    """Write the clocks of one sequence, and indoors where its detections lie beside the joints.

    `offsets`: the YAML file of clocks given by hand, or None; `out_aside`: table `detection_offsets`, empty outdoors.
    """
    names, covariance, mocap, min_score = placed.names, placed.covariance, indoors.mocap, detected.min_score
    rig = camera_tables.read_placed(placed.cameras, names, sequence)
    pictures = tables.read(frames, "frames")
    manual = given_by.by_hand(offsets, tables.ordered_unique(pictures["camera"]))
    seen = tables.read(detected.detections, "detections") if detected.detections else None
    by_marks = _by_marks(indoors.marked, sequence)
    if mocap:
        known = _Known(mocap, by_marks, manual, search_s(frames, absolute=True))
        estimates, off, aside = _indoors(sequence, rig, seen, pictures, known, min_score, data_root)
    else:
        off, aside = {}, {}
        estimates = _outdoors(sequence, rig, seen, pictures, detected, search_s(frames))
    joint = camera_tables.read_camera_covariance(covariance, names) if covariance else None
    used = {name: manual.get(name, clock) for name, (clock, *_) in estimates.items()}
    on_axis.write(written.out, written.out_gains, sequence, used, names, joint)
    tables.write(written.out_costs, "clock_costs", _costs(sequence, estimates))
    period, loose = 1 / rates(pictures, names)[1], loose_s(frames)
    tables.write(out_aside, "detection_offsets", _aside_columns(sequence, aside))
    found = _beside_mocap(sequence, off) + beside_marks(sequence, estimates, by_marks, names, joint, period)
    found += findings_of(sequence, estimates, manual, names, joint, period, bool(mocap), loose)
    tables.write_findings(written.findings, found)


@dataclass(frozen=True)
class _Known:
    """What is known of the clocks indoors before: the `mocap` table, clocks by marks, `marked`, and by hand, `manual`,
    and how far (s) the others may be off, `most_s`."""

    mocap: Path
    marked: Mapping[str, on_axis.Clock]
    manual: Mapping[str, on_axis.Clock]
    most_s: float


def _indoors(
    sequence: str,
    rig: list[Camera],
    seen: Table | None,
    pictures: Table,
    known: _Known,
    min_score: float,
    data_root: Path,
) -> tuple[dict[str, on_axis.Estimate], dict[str, float], dict[str, Aside]]:
    """By camera: `Clock`, lags, costs, why it is not known or "", how far (m) its detections are from the joints, and
    to which side where they tell the clock.

    Pictures are read only where nothing else tells.
    """
    from dior.calibrate.bundle import window
    from dior.calibrate.clock import from_mocap

    mocap, manual = known.mocap, known.manual
    _, motion = read_motion(mocap)
    by_marks = known.marked
    found, off = {}, {}
    aside: dict[str, Aside] = {}
    for camera in rig:
        rows = tables.of_camera(pictures, camera.name)
        elapsed = (rows["stamp_ns"] - motion.t0_ns) / 1e9
        tried = []
        if seen is not None and (seen["camera"] == camera.name).any():
            uv, joints = window.confident(seen, camera.name, len(elapsed), min_score, sequence)
            walker = from_mocap.walker_of(motion.t, motion.xyz, motion.joints, joints)
            uv = uv[:, [joints.index(name) for name in walker.names]]
            tried.append(from_mocap.from_detections(camera, walker, uv, elapsed, known.most_s))
            clock, lags, costs, why = tried[-1]
            if not why:
                aside[camera.name] = from_mocap.aside_m(camera, walker, uv, elapsed, clock)
            late = [lag.lowest(lags, costs)] if np.isfinite(costs).any() else []
            late += [manual[camera.name].offset_s] if camera.name in manual else []
            off[camera.name] = from_mocap.off_m(camera, walker, uv, elapsed, late)
        if not (tried and not tried[-1][3]) and camera.name in by_marks:
            clock = by_marks[camera.name]
            tried.append((clock, NONE, NONE, "" if clock.source != "assumed_zero" else "its marks do not tell"))
        if camera.name in manual and not tried:
            tried.append((on_axis.Clock(0.0), NONE, NONE, "there are no detections and no marks of it"))
        elif all(one[3] for one in tried):
            tried.append(_by_pictures(camera, mocap, rows, data_root, f"{sequence}, {camera.name}", known.most_s))
        clear = [one for one in tried if not one[3]]
        found[camera.name] = (clear or tried)[0]
    return found, off, aside


def _by_marks(marked: Sequence[Path], sequence: str) -> dict[str, on_axis.Clock]:
    """The clocks that `locate` found from marks, by camera."""
    kinds = {kind: [path for path in marked if f".{kind}." in Path(path).name] for kind in ("clocks", "clock_gains")}
    return on_axis.read(kinds["clocks"], kinds["clock_gains"], sequence)


def beside_marks(
    sequence: str,
    estimates: Mapping[str, on_axis.Estimate],
    by_marks: Mapping[str, on_axis.Clock],
    names: Sequence[str],
    joint: Floats | None,
    period_s: float,
) -> list[tuple[str, str, str, str]]:
    """Whether the clocks from detections or pictures and those `by_marks` differ by a picture; arguments as of
    `findings_of`. Compared in the middle of the marks."""
    found = []
    for name, marks in by_marks.items():
        clock, _, _, why = estimates.get(name, (marks, NONE, NONE, ""))
        if why or clock.method == marks.method or {clock.source, marks.source} != {"estimated"}:
            continue
        apart = marks.late_s - clock.offset_s - 1e-6 * clock.drift_ppm * marks.middle_s
        sigma = np.hypot(marks.sigma(names, joint)[0], _sigma_at(clock, marks.middle_s, names, joint))
        pictures = apart / period_s
        if not abs(apart) > CERTAIN * sigma or abs(pictures) < A_PICTURE:
            continue
        text = (
            f"the clock by its marks is {abs(apart):.4f} ± {on_axis.NORMAL_95 * sigma:.4f} s (95 %) or "
            f"{abs(pictures):.1f} pictures {'before' if apart < 0 else 'after'} that from {clock.method}: "
        )
        if abs(pictures) > MANY_PICTURES:
            ask = "are the marks, in its .marks.csv, of these pictures, and the detections of this walk?"
        elif apart < 0:
            ask = "do the frames of its .marks.csv count from 1? The first picture is frame 0"
        else:
            ask = "do the detections count from 1 (`detector.first_frame`), or are the marks of the pictures before?"
        found.append((f"{sequence}/{name}", "warning", "marks_clock", text + ask))
    return found


def _sigma_at(clock: on_axis.Clock, at_s: float, names: Sequence[str], joint: Floats | None) -> float:
    """Standard error (s) of a clock `at_s` after t0."""
    along = np.array([1.0, 1e-6 * (at_s - clock.middle_s)])
    return float(np.sqrt(along @ clock.covariance(names, joint) @ along))


def _beside_mocap(sequence: str, off: Mapping[str, float]) -> list[tuple[str, str, str, str]]:
    """Whether the detections of each camera lie on the motion capture; `off` m. Their first word is the distance.

    All cameras of a sequence together tell whose fault it is (`report.lights.by_mocap`).
    """
    what = "m beside its detections are the joints of the motion capture (median, at the lag that fits best)"
    return [
        (
            f"{sequence}/{name}",
            "error" if metres > APART_M else "info",
            "mocap_apart" if metres > APART_M else "mocap_agrees",
            f"{metres:.2f} {what}",
        )
        for name, metres in off.items()
        if np.isfinite(metres)
    ]


def _aside_columns(sequence: str, aside: Mapping[str, Aside]) -> dict[str, list[Any]]:
    """Columns of `detection_offsets`, a row for each camera and joint."""
    each = [(name, joint, *by, scale) for name, (own, scale) in aside.items() for joint, by in own.items()]
    camera, joints, right, down, px_per_m = zip(*each, strict=True) if each else ((),) * 5
    columns = {"camera": camera, "joint": joints, "right_m": right, "down_m": down, "px_per_m": px_per_m}
    return {"sequence": [sequence] * len(each)} | {key: list(values) for key, values in columns.items()}


def _by_pictures(
    camera: Camera, mocap: Path, rows: Table, data_root: Path, where: str, most_s: float
) -> on_axis.Estimate:
    from dior.calibrate.outline import clock_from_pictures

    clock, lags, costs = clock_from_pictures.from_pictures(
        camera, tables.read(mocap, "skeletons_3d"), rows, data_root, where, most_s
    )
    return clock, lags, costs, "" if clock.source == "estimated" else "neither detections, marks nor pictures tell it"


def _outdoors(
    sequence: str,
    rig: list[Camera],
    seen: Table | None,
    pictures: Table,
    detected: Detected,
    most_s: float,
) -> dict[str, on_axis.Estimate]:
    from dior.calibrate.bundle import window
    from dior.calibrate.clock import from_cameras, from_two_people

    reference = rig[0].name
    if seen is None or len(rig) < 2:
        why = "there are no detections of it" if len(rig) > 1 else ""
        known = on_axis.Clock(0.0, source="reference", given=(0.0, 0.0))
        return {
            c.name: (known, NONE, NONE, "") if c.name == reference else (on_axis.Clock(0.0), NONE, NONE, why)
            for c in rig
        }
    found = window.recorded(rig, seen, pictures, detected.min_score, detected.max_gap, sequence, most_s)
    grid = instants(found.fps, max(own.elapsed[-1] for own in found.seen))
    if detected.everybody_seen:
        everybody = tables.read(detected.everybody_seen, "detected_people")
        alone, left_out = window.alone(found, rig, everybody)
        if window.are_few(left_out, [found]):
            found = alone
        elif said := from_two_people.from_two_people(
            rig, found.seen, found.names, everybody, detected.min_score, grid, found.fps
        ):
            return said
    return from_cameras.from_detections(rig, found.seen, found.names, grid, found.fps)


def _costs(sequence: str, estimates: Mapping[str, on_axis.Estimate]) -> dict[str, Any]:
    lags = [
        (name, lag, cost)
        for name, (_, lags, costs, _) in estimates.items()
        for lag, cost in zip(lags, costs, strict=True)
    ]
    camera, lag, cost = zip(*lags, strict=True) if lags else ((), (), ())
    return {
        "sequence": [sequence] * len(lags),
        "camera": list(camera),
        "lag_s": np.array(lag, float),
        "cost_px": np.array(cost, float),
    }


def findings_of(
    sequence: str,
    estimates: Mapping[str, on_axis.Estimate],
    manual: Mapping[str, on_axis.Clock],
    names: Sequence[str],
    joint: Floats | None,
    period_s: float,
    indoor: bool,
    loose: float = 0.0,
) -> list[tuple[str, str, str, str]]:
    """What was found of each clock: `estimates` by camera, and how far those by hand, `manual`, are from them.

    `names`, `joint`: the cameras' covariance; `period_s` of the pictures; `loose`: how far off (s) the starts of videos
    may be.
    """
    found = []
    for name, (clock, _, _, why) in estimates.items():
        scope = f"{sequence}/{name}"
        hand = manual.get(name)
        if clock.source == "reference":
            continue
        if why:
            used = f"{hand.offset_s:+.4f} s of config/offsets counts" if hand else "it is taken as 0 with unknown error"
            advice = "" if hand else f"; give it in config/offsets/{sequence}.yaml"
            text = f"its clock cannot be told: {why}; {used}{advice}"
            found.append((scope, "info" if hand else "warning", "clock_unknown", text))
            continue
        half, known = on_axis.NORMAL_95 * clock.sigma(names, joint), ""
        if not np.isfinite(half).all():
            half, known = on_axis.NORMAL_95 * np.array(clock.given), ", if the cameras' poses are right"
        text = (
            f"offset {clock.late_s:+.4f} ± {half[0]:.4f} s in the middle, drift {clock.drift_ppm:+.0f} ± "
            f"{half[1]:.0f} ppm (95 %{known}), from {clock.method}"
        )
        apart = _apart(hand, clock) if hand else 0.0
        if hand and abs(apart) > on_axis.doubtful_s(np.hypot(half[0] / on_axis.NORMAL_95, hand.given[0])):
            by_hand = (
                f"the clock given by hand is {abs(apart) / period_s:.1f} pictures off: config/offsets/{sequence}.yaml "
                f"says {clock.late_s + apart:+.4f} s in the middle, the recording: {text}"
            )
            found.append((scope, "warning", "clock_contradicts", by_hand))
        elif not indoor and abs(clock.late_s) > max(FAR_OFF * period_s, loose) and not hand:
            found.append(
                (scope, "warning", "clock_off", f"{text}: {abs(clock.late_s) / period_s:.1f} pictures from "
                 "the reference. That is put right if its computer's time or its stamps are off; if the numbers of its "
                 "detections slipped it looks the same, and then its labels are as much early or late: look at both")
            )  # fmt: skip
        else:
            found.append((scope, "info", "clock_found", text))
    return found


def _apart(hand: on_axis.Clock, clock: on_axis.Clock) -> float:
    """How far (s) a clock by hand is from the estimate in the middle of the recording."""
    return hand.offset_s + 1e-6 * hand.drift_ppm * clock.middle_s - clock.late_s
