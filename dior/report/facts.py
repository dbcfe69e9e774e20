"""What the step `page` leaves of a sequence for the index, which then reads no table of all pictures again.

INPUTS   `frame_metrics` by camera, figures, findings, clocks and the 3D of one sequence
OUTPUT   facts.json, a `Facts` as text: some kilobytes, whatever the length of the walk
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats, Ints, Table
from dior.errors import DiorError
from dior.report import beside_boxes, worst_pictures
from dior.report.beside_boxes import Offset
from dior.report.lights import Finding
from dior.tables import result_checksums, tables

# points m, null where one is not known
Points: TypeAlias = list[list[float] | None]
# metric -> (stamp_ns (N,), value (N,), n (N,)) of a camera, of table `frame_metrics`
ByMetric: TypeAlias = dict[str, tuple[Ints, Floats, Ints]]
# lag in the middle, low, high ms of its 95 % interval, and the `source` of table `offsets`
Clock: TypeAlias = tuple[float, float, float, str]
# the values of these are pooled over all recordings, in the middles of PARTS equal parts of each
POOLED = ("reprojection_error", "error_to_truth_2d")
# chosen: the 99th percentile, where the figure of them ends, lies between two
PARTS = 100
MIDDLES = (np.arange(PARTS) + 0.5) / PARTS
# of a walk that is drawn; chosen: a curve looks smooth, the file stays small
POINTS = 240


@dataclass(frozen=True)
class Recording:
    """A camera in a sequence: `figures` by metric; `offset` of its labels beside hand boxes; how many `pictures` have
    labels, and how many `labels` there are; its `clock`; `spread`: metric of POOLED -> (values in MIDDLES, their
    number); `worst`: metric of the index -> (value, frame) of its worst picture."""

    figures: dict[str, float]
    offset: Offset | None
    pictures: int
    labels: int
    clock: Clock | None
    spread: dict[str, tuple[list[float], int]]
    worst: dict[str, tuple[float, int]]


@dataclass(frozen=True)
class Facts:
    """Of a sequence: its `findings`; `recordings` by camera; `walk`: points [x, y, z] m of the mean of the joints, null
    where none is known; `pose`: one whole pose, (points, joints); whether it is `in_3d`."""

    sequence: str
    findings: list[Finding]
    recordings: dict[str, Recording]
    walk: Points
    pose: tuple[Points, list[str]] | None
    in_3d: bool


def array_of(points: Points) -> Floats:
    """Points as (N, 3) m, NaN where one is not known."""
    return np.array([[np.nan] * 3 if one is None else one for one in points], float).reshape(-1, 3)


def as_text(facts: Facts) -> str:
    """A facts.json."""
    return json.dumps(asdict(facts), sort_keys=True, separators=(",", ":")) + "\n"


def read(path: AnyPath) -> Facts:
    """The `Facts` of a file. Raises DiorError where there is none, or it is not what its job wrote."""
    if not Path(path).is_file():
        raise DiorError(f"{path}: there is no such file; run the step page")
    told = json.loads(result_checksums.read_text(path))
    pose = told["pose"]
    return Facts(
        told["sequence"],
        [(scope, severity, code, text) for scope, severity, code, text in told["findings"]],
        {camera: _recording(one) for camera, one in told["recordings"].items()},
        told["walk"],
        (pose[0], pose[1]) if pose else None,
        told["in_3d"],
    )


def _recording(told: dict[str, Any]) -> Recording:
    offset, clock = told["offset"], told["clock"]
    return Recording(
        told["figures"],
        Offset(tuple(offset["uv"]), tuple(offset["sigma"]), offset["n"]) if offset else None,
        told["pictures"],
        told["labels"],
        tuple(clock) if clock else None,
        {metric: (values, n) for metric, (values, n) in told["spread"].items()},
        {metric: (value, frame) for metric, (value, frame) in told["worst"].items()},
    )


def by_camera(table: Table) -> dict[str, ByMetric]:
    """camera -> metric -> values of a table `frame_metrics` of one sequence."""
    found: dict[str, ByMetric] = {}
    for camera in tables.ordered_unique(table["camera"]):
        own = tables.of_camera(table, camera)
        found[camera] = {}
        for metric in tables.ordered_unique(own["metric"]):
            rows = own["metric"] == metric
            found[camera][metric] = own["stamp_ns"][rows], own["value"][rows], own["n"][rows]
    return found


def recording(
    figures: dict[str, float], measured: ByMetric, clock: Clock | None, worst: Mapping[str, tuple[float, int]]
) -> Recording:
    """The `Recording` of a camera; `measured`: its `frame_metrics`, `worst`: its worst pictures by metric."""
    coverage = measured.get("coverage")
    return Recording(
        figures,
        beside_boxes.of_recording(measured, figures.get("person_height", np.nan)),
        len(coverage[1]) if coverage else 0,
        int(np.rint(coverage[1] * coverage[2]).sum()) if coverage else 0,
        clock,
        {metric: spread_of(measured[metric][1]) for metric in POOLED if metric in measured},
        dict(worst),
    )


def spread_of(values: Floats) -> tuple[list[float], int]:
    """What is kept of values (N,): those in MIDDLES, to five digits, and how many there are."""
    known = values[np.isfinite(values)]
    if not len(known):
        return [], 0
    return [float(f"{value:.5g}") for value in np.quantile(known, MIDDLES)], len(known)


def pooled(spreads: Iterable[tuple[list[float], int]]) -> tuple[Floats, Floats, int]:
    """Values (V,) in their order, the share (V,) of all that is below each, and how many all are, of `Recording.spread`
    of several recordings."""
    values, counts = zip(*spreads, strict=True)
    every, weight = np.concatenate(values), np.repeat(np.array(counts, float) / PARTS, PARTS)
    order = np.argsort(every, kind="stable")
    share = (np.cumsum(weight[order]) - weight[order] / 2) / weight.sum()
    return every[order], share, sum(counts)


def worst_of(table: Table) -> dict[str, dict[str, tuple[float, int]]]:
    """camera -> metric -> (value, frame) of the worst picture, of a table `frame_metrics` of one sequence."""
    found: dict[str, dict[str, tuple[float, int]]] = {}
    for metric, sign, *_ in worst_pictures.SECTIONS.values():
        for (_, camera), worst in worst_pictures.by_recording(table, metric, sign).items():
            found.setdefault(camera, {})[metric] = worst
    return found


def walk_of(path: AnyPath) -> tuple[Points, tuple[Points, list[str]] | None]:
    """Of a `skeletons_3d` file: the mean of the joints at about POINTS instants, to the millimetre, and one whole pose.

    The pose, (points (J, 3), joints), is the one with most joints nearest to the middle.
    """
    table = tables.read_coded(path, "skeletons_3d", ["joint", "instant", "x", "y", "z"])
    instant, joint = table["instant"], table["joint"]
    if not len(instant):
        return [], None
    each = int(np.searchsorted(instant, instant[0], side="right"))
    points = np.stack([table[c].astype(float).reshape(-1, each) for c in "xyz"], axis=-1)
    known = np.isfinite(points).all(axis=-1)
    n = known.sum(axis=1)
    if not n.any():
        return [], None
    with np.errstate(invalid="ignore", divide="ignore"):
        walk = np.where(known[..., None], points, 0.0).sum(axis=1) / n[:, None]
    best = np.flatnonzero(n == n.max())
    middle = best[np.abs(best - len(n) // 2).argmin()]
    names = [joint.words[i] for i in joint.index[:each]]
    return _to_mm(walk[:: max(1, len(walk) // POINTS)]), (_to_mm(points[middle]), names)


def _to_mm(points: Floats) -> Points:
    return [one.tolist() if np.isfinite(one).all() else None for one in np.round(points, 3) + 0.0]
