"""The figures of a release must be those of its tables.

INPUTS   the tables of each walk (evidence.py), metrics.csv. OUTPUTS: problems as (path, sentence)
What a walk's labels, detections, boxes and marks give is computed by the functions that made metrics.csv
(dior/evaluate/); means over walks, people and cameras are pooled again from the rows of the walks. Not recomputed is
what needs more than a release holds: errors to the truth, of the adjustment, of other detectors, what fits without a
box and the boxes of other drawers say, and the swaps that were found. Where left and right were exchanged the release
does not say in which pictures, so that a reprojection error may be anything between its least and its largest.
metrics.csv has six significant digits: a figure may differ by one in the last of them, where another machine's
arithmetic rounds the other way.
"""

import csv
import io
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from dior.arrays import Floats, Table
from dior.body.names import is_leg, swap_index
from dior.evaluate import bootstrap, labels_in_boxes, metrics, reprojection, rows
from dior.evaluate.grids import LabelGrid, distance, onto, value_grid
from dior.geometry.camera import occluded_edge
from dior.release.layout import IN_PICTURE
from dior.release.verify.evidence import Evidence, Walk
from dior.release.verify.walk_checks import Problem
from dior.tables import tables
from dior.tables.words import WITHOUT_3D

PATH = "metrics.csv"
# one in the sixth digit of a number that begins with 1, and what the sum of such roundings adds
DIGITS = 1.1e-5
KEY = ("metric", "tool", "subject", "sequence", "camera", "role", "joint")
# a row of metrics.csv by its columns; its value and its interval are NaN where they are empty
Figure: TypeAlias = dict[str, Any]


class Expected(NamedTuple):
    """What a figure may be: its value and its count, each from the least to the largest."""

    low: float
    high: float
    n_low: int
    n_high: int


# (metric, camera, joint) of a walk
Figures: TypeAlias = dict[tuple[str, str, str], Expected]
RECOMPUTED = (
    "coverage", "in_picture_share", "reprojection_error", "in_box_share", "in_box_expected", "box_iou", "box_offset_u",
    "box_offset_v", "box_width_difference", "box_height_difference", "held_back_share", "held_back_expected",
    "held_back_offset_u", "held_back_offset_v", "mark_error", "check_error",
)  # fmt: skip


def of_walk(walk: Walk) -> Figures:
    """The figures of one walk that its tables give."""
    marks = walk.of("marks").get("")
    outdoor = walk.rig.environment.get(walk.sequence) != "indoor"
    min_score = walk.rig.settings.get("detector.min_score")
    out: Figures = {}
    for name, labels in walk.of("labels_2d").items():
        camera = walk.rig.camera(walk.sequence, name)
        if camera is None or not len(labels["frame"]):
            continue
        grid = _grid(name, labels)
        found = [("coverage", *_twice((~grid.missing).astype(float)), True)]
        found.append(("in_picture_share", *_twice(np.where(grid.missing, np.nan, grid.in_frame)), False))
        detected = walk.of("detections").get(name)
        if detected and outdoor and min_score is not None and camera.role == "close":
            if reprojection.comparable(grid, detected):
                found.append(("reprojection_error", *_reprojection(grid, detected, min_score), True))
        drawn = walk.of("boxes").get(name)
        if drawn and camera.role == "long_range":
            edges = np.stack([drawn[key] for key in ("u_min", "v_min", "u_max", "v_max")], axis=-1)
            hand = labels_in_boxes.of_frames(grid, drawn["frame"], edges)
            fitted = labels_in_boxes.figures(grid, hand, occluded_edge(camera))
            found += [(metric, *_twice(values), False) for metric, _, values in fitted]
        if marks and (checked := _checked(grid, tables.of_camera(marks, name))) is not None:
            found.append(("check_error", *_twice(distance(grid.uv, checked)), True))
        out |= _figures(found, name, grid.joints)
    if marks:
        used = tables.rows(marks, marks["kind"] == "mark")
        for name in sorted(set(used["camera"])):
            residual = tables.of_camera(used, name)["residual_px"][:, None]
            out |= _figures([("mark_error", *_twice(residual), False)], name, [])
    return out


def _grid(camera: str, labels: Table) -> LabelGrid:
    """As dior/evaluate/grids.py makes it of a file."""
    uv, joints = tables.grid(labels, "u", "v")
    shape = uv.shape[:2]
    status = labels["status"].reshape(shape)
    inside = np.isin(status, IN_PICTURE)
    frames, stamps = (labels[key].reshape(shape)[:, 0] for key in ("frame", "stamp_ns"))
    pixels = np.where(inside[..., None], uv.astype(float), np.nan)
    return LabelGrid(camera, frames, stamps, joints, pixels, inside, np.isin(status, WITHOUT_3D))


def _twice(values: Floats) -> tuple[Floats, Floats]:
    return values, values


def _reprojection(grid: LabelGrid, detected: Table, min_score: float) -> tuple[Floats, Floats]:
    """The least and the largest distance (F, J) px of each label from its detection, left and right exchanged or not.

    The least is NaN where the detector was not sure enough one way or the other: there may be no distance. As
    `dior.evaluate.reprojection.errors`, which is told what was exchanged.
    """
    values, frames, joints = value_grid(detected, "frame", "u", "v", "score")
    legs = np.array([is_leg(name) for name in joints])[:, None]
    turned = values[:, swap_index(joints)]
    each = []
    for one in (values, turned, np.where(legs, turned, values), np.where(legs, values, turned)):
        found = onto(grid.frames, grid.joints, one, frames, joints)
        with np.errstate(invalid="ignore"):
            each.append(np.where(found[..., 2] >= min_score, distance(grid.uv, found[..., :2]), np.nan))
    return np.minimum.reduce(each), np.fmax.reduce(each)


def _checked(grid: LabelGrid, marks: Table) -> Floats | None:
    """Hand checks (F, J, 2) px of one camera, None without any."""
    mine = tables.rows(marks, marks["kind"] == "check")
    if not len(mine["frame"]):
        return None
    at = {frame: i for i, frame in enumerate(grid.frames.tolist())}
    checked = np.full(grid.uv.shape, np.nan)
    for frame, joint, u, v in zip(*(mine[key].tolist() for key in ("frame", "joint", "u", "v")), strict=True):
        if frame in at and joint in grid.joints:
            checked[at[frame], grid.joints.index(joint)] = u, v
    return checked


def _figures(measured: Iterable[tuple[str, Floats, Floats, bool]], camera: str, joints: list[str]) -> Figures:
    """Means of least and largest `values` (F, J) of each metric, over all joints and, where asked for, by joint."""
    out: Figures = {}
    for metric, low, high, by_joint in measured:
        parts = [("", low, high)] + [(joint, low[:, j], high[:, j]) for j, joint in enumerate(joints) if by_joint]
        for joint, least, most in parts:
            if one := _expected(least, most):
                out[metric, camera, joint] = one
    return out


def _expected(low: Floats, high: Floats) -> Expected | None:
    if low is high or np.array_equal(low, high, equal_nan=True):
        found = rows.mean_row("", low, "")
        return Expected(found[0].value, found[0].value, found[0].n, found[0].n) if found else None
    # only distances are uncertain, none of which is negative
    n_low, n_high = (int(np.isfinite(values).sum()) for values in (low, high))
    most = float(np.nansum(high) / n_low) if n_low else np.inf
    return Expected(float(np.nansum(low) / n_high), most, n_low, n_high) if n_high else None


def check(release: Evidence) -> list[Problem]:
    """Compare metrics.csv with what the tables of the walks give, and its means with its own rows."""
    try:
        stated = {tuple(row[key] for key in KEY): row for row in read(release.files[PATH].read())}
    except ValueError as error:
        return [(PATH, f"is not as dior writes it: {error}")]
    sentences = [*_of_walks(stated, release), *_pooled(stated)]
    return [(PATH, text) for text in sentences]


def read(content: bytes) -> Iterator[Figure]:
    """Yield the rows of metrics.csv. Raises ValueError for a cell that is no number where there must be one."""
    for number, row in enumerate(csv.DictReader(io.StringIO(content.decode())), start=2):
        try:
            numbers = {key: float(row[key]) if row[key] else np.nan for key in ("value", "low", "high")}
            yield {**row, **numbers, "n": int(row["n"])}
        except (TypeError, ValueError, KeyError):
            raise ValueError(f"line {number} has no value or no count") from None


def _of_walks(stated: dict[tuple[str, ...], Figure], release: Evidence) -> Iterator[str]:
    """Yield what is wrong with the figures of single cameras in single walks."""
    expected: dict[tuple[str, ...], Expected] = {
        (metric, "", walk.who, walk.sequence, camera, _role(release, walk.sequence, camera), joint): one
        for walk in release.walks
        for (metric, camera, joint), one in walk.figures.items()
    }
    mine = {key: row for key, row in stated.items() if key[0] in RECOMPUTED and key[3] and key[4] and not key[1]}
    yield from _some([key for key in mine if key not in expected], "has figures of what the tables do not have", _named)
    lacking = [key for key, one in expected.items() if key not in stated and one.n_low]
    yield from _some(lacking, "lacks figures that the tables give", _named)
    wrong = [key for key, one in expected.items() if key in stated and not _agrees(stated[key], one)]

    def told(key: tuple[str, ...]) -> str:
        row, one = stated[key], expected[key]
        return f"{_named(key)} is {row['value']:.6g} of {row['n']}, the tables give {_between(one)}"

    yield from _some(wrong, "has figures that are not those of the tables", told)


def _role(release: Evidence, sequence: str, camera: str) -> str:
    one = release.rig.camera(sequence, camera)
    return one.role if one else ""


def _agrees(row: Figure, one: Expected) -> bool:
    near = DIGITS * max(abs(one.low), abs(row["value"]))
    return one.n_low <= row["n"] <= one.n_high and one.low - near <= row["value"] <= one.high + near


def _between(one: Expected) -> str:
    value = f"{one.low:.6g}" if one.low == one.high else f"{one.low:.6g} to {one.high:.6g}"
    return f"{value} of {one.n_low}" + (f" to {one.n_high}" if one.n_high > one.n_low else "")


def _pooled(stated: dict[tuple[str, ...], Figure]) -> Iterator[str]:
    """Yield what is wrong with the means over walks, cameras and people."""
    base = [row for row in stated.values() if row["sequence"] and (row["camera"] or not row["role"])]
    pooled = _means(base)
    largest: dict[str, float] = {}
    for row in base:
        largest[row["metric"]] = max(largest.get(row["metric"], 0.0), abs(row["value"]))

    def differs(key: tuple[str, ...]) -> bool:
        ours, theirs = pooled[key], stated[key]
        near = DIGITS * largest.get(key[0], 0.0)
        return ours["n"] != theirs["n"] or any(
            not np.isclose(ours[name], theirs[name], rtol=DIGITS, atol=near, equal_nan=True)
            for name in ("value", "low", "high")
        )

    def told(key: tuple[str, ...]) -> str:
        ours, theirs = pooled[key], stated[key]
        shown = (
            "{value:.6g} ({low:.6g} to {high:.6g}) of {n}".format(**row).replace(" (nan to nan)", "")
            for row in (theirs, ours)
        )
        return f"{_named(key)} is " + ", its rows give ".join(shown)

    # a session's adjustment has rows of its own, of no walk
    of_sessions = {row["metric"] for row in stated.values()} - set(largest)
    nowhere = [key for key in stated if key not in pooled and key[0] not in of_sessions]
    yield from _some(nowhere, "has pooled figures that are of no row", _named)
    yield from _some([key for key in pooled if key not in stated], "lacks pooled figures", _named)
    wrong = [key for key in pooled if key in stated and differs(key)]
    yield from _some(wrong, "has pooled figures that are not those of their rows", told)


def _means(base: list[Figure]) -> dict[tuple[str, ...], Figure]:
    """Pooled rows by KEY of the rows `base` of walks, and these themselves, as `dior.evaluate.metrics.merged`."""
    found = {tuple(row[key] for key in KEY): row for row in base}
    for pools, with_joint in ((metrics.POOLS, False), (metrics.JOINT_POOLS, True)):
        mine = [row for row in base if bool(row["joint"]) == with_joint]
        for pool in pools:
            groups: dict[tuple[str, ...], dict[str, list[float]]] = {}
            for row in mine:
                key = tuple(row[name] if name in pool else "" for name in KEY)
                person = groups.setdefault(key, {}).setdefault(row["subject"], [0.0, 0])
                person[0] += row["n"] * row["value"]
                person[1] += row["n"]
            for key, people in groups.items():
                sums, n = np.array(list(people.values())).T
                low, high = bootstrap.NOTHING if "subject" in pool else bootstrap.of_mean(sums, n)
                value = float(sums.sum() / n.sum())
                found.setdefault(key, {"value": value, "low": low, "high": high, "n": int(n.sum())})
    return found


def _some(keys: list[tuple[str, ...]], what: str, told: Any) -> Iterator[str]:
    """Yield one sentence for all `keys`, with the first of them; nothing without any."""
    if keys:
        yield f"{what}: {len(keys)}, first {told(min(keys))}"


def _named(key: tuple[str, ...]) -> str:
    return " ".join(filter(None, key))
