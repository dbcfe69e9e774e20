"""When the feet of a walker strike the floor and leave it, and the parameters of his gait, with their errors.

INPUTS   `skeletons_3d` of refine (or triangulate) outdoors, of mocap indoors
OUTPUTS  results/gait/<sequence>.parquet           `gait_parameters` of the whole walk
         results/gait/<sequence>.events.parquet    `gait_events`
         results/gait/<sequence>.steps.parquet     `gait_steps`, every step and stride
         results/gait/<sequence>.findings.parquet  why there are none, a note
World in metres, Z up; seconds after the walk's first instant, on the clock of the 3D's stamps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Ints, Table
from dior.gait import events, parameters, tracks
from dior.gait.events import Events
from dior.gait.parameters import IN_95, Pooled, Row
from dior.geometry.covariance import point_covariance
from dior.tables import tables
from dior.tables.gait_parameters import PARAMETERS


@dataclass(frozen=True, eq=False)
class Gait:
    """Of one walk: the `tracks`, None where the 3D has no pelvis, heel or toe; its events, steps and strides, and the
    parameters of all of it, in the order of `PARAMETERS`."""

    tracks: tracks.Tracks | None
    events: Events | None
    rows: tuple[Row, ...] = ()
    pooled: tuple[Pooled, ...] = ()


def run(
    *, sequence: str, subject: str, skeleton: Path, out: Path, out_events: Path, out_steps: Path, findings: Path
) -> None:
    """Write the gait of one sequence.

    `out_events`: table `gait_events` to write; `out_steps`: table `gait_steps` to write.
    """
    table = tables.read(skeleton, "skeletons_3d")
    told = tables.metadata(skeleton).get("noise_time_s")
    gait = of_skeleton(table, float(told) if told else None)
    whose = {"subject": subject, "sequence": sequence}
    stamps = np.unique(table["stamp_ns"])
    tables.write(out_events, "gait_events", _of(whose, event_columns(gait.events, stamps)))
    tables.write(out_steps, "gait_steps", _of(whose, step_columns(gait.rows)))
    tables.write(out, "gait_parameters", _of(whose, parameter_columns(gait.pooled)))
    text = lacks(gait)
    tables.write_findings(findings, [(sequence, "info", "no_gait", text)] if text else [])


def of_skeleton(table: Table, noise_time_s: float | None = None) -> Gait:
    """`Gait` of a table `skeletons_3d`; `noise_time_s`: in which the errors of joints forget, None as refine leaves it
    and for markers, whose errors nobody knows."""
    points, joints = tables.grid(table, "x", "y", "z")
    shape = points.shape[:2]
    if not len(points):
        return Gait(None, None)
    stamps = table["stamp_ns"].reshape(shape)[:, 0]
    covariance = point_covariance(table, shape)
    lasting = table["constant_share"].reshape(shape).astype(float)
    if not np.isfinite(covariance).any():
        noise_time_s = 0.0
    elif noise_time_s is None:
        noise_time_s = tracks.REFINED_S
    seconds = (stamps - stamps[0]) / 1e9
    track = tracks.of_joints(seconds, points.astype(float), joints, covariance, lasting, noise_time_s)
    if track is None:
        return Gait(None, None)
    found = events.find(track)
    rows, pooled = parameters.of_walk(track, found)
    return Gait(track, found, tuple(rows), (*pooled, *_counted(found)))


def _counted(found: Events) -> list[Pooled]:
    """What of a walk is counted, and its treadmill."""
    belt = float(np.linalg.norm(found.belt))
    none = np.nan
    left_out = int((found.reason != "").sum())
    return [
        Pooled("belt_speed", "both", belt, found.belt_sigma, none, 1, "")
        if belt
        else Pooled("belt_speed", "both", none, none, none, 0, "no_treadmill"),
        Pooled("turns", "both", float(len(found.turns)), none, none, len(found.turns), ""),
        Pooled("left_out", "both", float(left_out), none, none, left_out, ""),
    ]


def lacks(gait: Gait) -> str:
    """Why a walk has no parameters of gait, as a sentence, "" where it has."""
    if gait.tracks is None or gait.events is None:
        return (
            "no gait events: the 3D has no pelvis, heels and toes of both feet (LHEE, LTOE, ... or left_heel, "
            "left_foot_index, ...)"
        )
    if not all(np.isfinite(one).all(axis=-1).any() for one in (gait.tracks.pelvis, gait.tracks.heel, gait.tracks.toe)):
        return "no gait events: nobody's feet are known in 3D"
    if not len(gait.events.seconds):
        return "no gait events: nobody takes a step in it, or too little is known at a time"
    if not gait.rows:
        return "no step is left to measure: none lies whole between turns, times of standing, and the ends of the 3D"
    return ""


def _of(whose: dict[str, str], columns: dict[str, tables.Column]) -> dict[str, tables.Column]:
    count = len(next(iter(columns.values())))
    return {key: np.full(count, word, object) for key, word in whose.items()} | columns


def event_columns(found: Events | None, stamps: Ints) -> dict[str, tables.Column]:
    """Columns of `gait_events` but for whose they are; `stamps` (T,) ns of the instants."""
    if found is None or not len(found.seconds):
        return {"time_s": np.zeros(0)}
    sigma = found.whole_sigma_s()
    stamp_ns = stamps[0] + np.rint(found.seconds * 1e9).astype(np.int64)
    after = np.clip(np.searchsorted(stamps, stamp_ns), 1, len(stamps) - 1)
    instant = after - (stamp_ns - stamps[after - 1] <= stamps[after] - stamp_ns)
    return {
        "foot": np.array(tracks.SIDES, object)[found.side],
        "event": np.where(found.strike, "heel_strike", "toe_off").astype(object),
        "stamp_ns": stamp_ns,
        "instant": instant,
        "time_s": found.seconds,
        "sigma_s": sigma,
        "low_s": found.seconds - IN_95 * sigma,
        "high_s": found.seconds + IN_95 * sigma,
        "reason": found.reason,
    }


def _spread(values: Sequence[float], sigmas: Sequence[float]) -> dict[str, tables.Column]:
    value, sigma = np.array(values, float), np.array(sigmas, float)
    return {"value": value, "sigma": sigma, "low": value - IN_95 * sigma, "high": value + IN_95 * sigma}


def step_columns(rows: Sequence[Row]) -> dict[str, tables.Column]:
    """Columns of `gait_steps` but for whose they are."""
    return {
        "parameter": np.array([row.name for row in rows], object),
        "foot": np.array([tracks.SIDES[row.side] for row in rows], object),
        "start_s": np.array([row.start for row in rows], float),
        "end_s": np.array([row.end for row in rows], float),
        **_spread([row.value for row in rows], [row.sigma for row in rows]),
        "unit": np.array([PARAMETERS[row.name][0] for row in rows], object),
    }


def parameter_columns(pooled: Sequence[Pooled]) -> dict[str, tables.Column]:
    """Columns of `gait_parameters` but for whose they are."""
    return {
        "parameter": np.array([one.name for one in pooled], object),
        "side": np.array([one.side for one in pooled], object),
        **_spread([one.value for one in pooled], [one.sigma for one in pooled]),
        "sd": np.array([one.sd for one in pooled], float),
        "n": np.array([one.count for one in pooled], int),
        "unit": np.array([PARAMETERS[one.name][0] for one in pooled], object),
        "reason": np.array([one.reason for one in pooled], object),
    }


def read(path: AnyPath) -> dict[tuple[str, str], dict[str, float]]:
    """(parameter, side) -> value, sigma, low, high, sd and n of a table `gait_parameters`."""
    table = tables.read(path, "gait_parameters")
    keys = ("value", "sigma", "low", "high", "sd", "n")
    cells = zip(*(table[key].tolist() for key in keys), strict=True)
    names = zip(table["parameter"].tolist(), table["side"].tolist(), strict=True)
    return {name: dict(zip(keys, row, strict=True)) for name, row in zip(names, cells, strict=True)}
