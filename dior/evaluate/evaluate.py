"""The figures of one sequence: how good its labels are, by every yardstick that the sequence offers.

INPUTS   the sequence's `labels_2d` (one file per camera), `skeletons_3d`, and where there are any: `detections`,
         hand boxes with the poses of their cameras and `left_out_boxes`, `marks` and hand checks, `swaps`, the truth's
         folder.
OUTPUTS  results/evaluate/<sequence>.parquet         `metrics`, every row a mean with its count
         results/evaluate/<sequence>.frames.parquet  `frame_metrics`, the same per picture, for the report's timelines
         results/evaluate/<sequence>.checks.parquet  `check_errors`, every hand check, for quantiles over sequences
         results/evaluate/<sequence>.quantiles.parquet  `label_quantiles`, how sigmas and measured errors are spread
         results/evaluate/<sequence>.findings.parquet  what only all cameras of a sequence together tell (`turned`)

Pixels are recorded (distorted) pixels, lengths metres, shares 0 to 1.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.errors import DiorError, nearest
from dior.evaluate import checks as check_files
from dior.evaluate import label_errors, labels_in_boxes, reprojection, rows, turned
from dior.evaluate import truth as against
from dior.evaluate.grids import LabelGrid, distance, label_grids, onto, value_grid
from dior.geometry.camera import Camera, occluded_edge
from dior.geometry.camera_tables import read_cameras
from dior.project import boxes as hand_boxes
from dior.tables import tables

# rows of `metrics` and of `frame_metrics`
Measured: TypeAlias = tuple[list[rows.Row], list[Table]]

# the simulated clocks are off by tenths of a second at most; a second means other instants
INSTANT_TOLERANCE_NS = 1_000_000_000


@dataclass(frozen=True)
class Detected:
    """What the labels were made of, where they were made of detections.

    `detections`: their table, or None; `min_score`: score below which a detection is not compared with; `swaps`: where
    left and right were exchanged, or None; `aside`: indoors the tables `detection_offsets` of the cameras.
    """

    detections: Path | None
    min_score: float
    swaps: Path | None
    aside: list[Path]


@dataclass(frozen=True)
class Yardsticks:
    """What the labels are compared with.

    `boxes`: camera -> CSV; `left_out`: tables `left_out_boxes`; `marks`: `marks` tables; `checks`: camera -> CSV;
    `truth`: the folder with `labels_2d.parquet` and `skeletons_3d.parquet`, or None.
    """

    boxes: dict[str, Path]
    left_out: list[Path]
    marks: list[Path]
    checks: dict[str, Path]
    truth: Path | None


def run(
    *,
    sequence: str,
    subject: str,
    labels: list[Path],
    skeleton: Path | None,
    cameras: list[Path],
    roles: dict[str, str],
    detected: Detected,
    yardsticks: Yardsticks,
    out: Path,
    out_frames: Path,
    out_checks: Path,
    out_quantiles: Path,
    findings: Path,
) -> None:
    """Evaluate one sequence.

    `labels`: label files; `skeleton`: their 3D, or None; `cameras`: the poses of its cameras; `roles`:
    camera -> close | long_range.
    """
    boxes, checks, truth = yardsticks.boxes, yardsticks.checks, yardsticks.truth
    grids = label_grids(labels)
    for camera in [*boxes, *checks]:
        if camera not in grids:
            raise DiorError(f"sequence {sequence}: there are no labels of camera '{camera}'{nearest(camera, grids)}")
    found, per_frame = _coverage(grids, roles)
    rig = read_cameras(cameras)
    sizes = {name: (camera.intrinsics.width, camera.intrinsics.height) for name, camera in rig.items()}
    spread = label_errors.sigmas(labels, rig)
    true = label_grids([Path(truth) / "labels_2d.parquet"]) if truth else {}
    found += _sigmas(grids, roles, spread)
    for part, part_frames in (
        _reprojection(grids, roles, detected.detections, detected.swaps, detected.min_score),
        _boxes(grids, roles, yardsticks, rig, sequence),
        _truth_2d(grids, roles, true),
    ):
        found += part
        per_frame += part_frames
    checked = {
        camera: check_files.check_points(path, sequence, grids[camera], sizes.get(camera))
        for camera, path in checks.items()
    }
    found += _marks(roles, yardsticks.marks, sequence) + _checks(grids, roles, checked)
    found += _swaps(roles, detected.swaps) + _truth_3d(skeleton, truth, sequence)
    tables.write(out, "metrics", rows.metric_columns(found, subject, sequence))
    tables.write(out_frames, "frame_metrics", _stacked(per_frame, subject, sequence))
    each = [check_files.error_columns(grids[camera], checked[camera], roles[camera]) for camera in sorted(checked)]
    tables.write(out_checks, "check_errors", _stacked(each, subject, sequence))
    quantiles = _quantiles(grids, roles, spread, checked, true)
    tables.write(out_quantiles, "label_quantiles", _stacked(quantiles, subject, sequence))
    tables.write_findings(findings, turned.turned(sequence, turned.read(detected.aside)))


def _stacked(parts: Sequence[Table], subject: str, sequence: str) -> Table:
    columns = rows.stacked(parts)
    count = len(columns.get("camera", ()))
    return columns | {
        "subject": np.full(count, subject, dtype=object),
        "sequence": np.full(count, sequence, dtype=object),
    }


def _summed(
    metric: str, unit: str, measured: Iterable[tuple[LabelGrid, Floats]], roles: dict[str, str], by_joint: bool = True
) -> Measured:
    """Rows by camera, by camera and joint, and by frame of `measured`: (LabelGrid, values (F, J)) pairs."""
    found, per_frame = [], []
    for grid, values in measured:
        role = roles[grid.camera]
        found += rows.mean_row(metric, values, unit, grid.camera, role)
        if by_joint:
            found += rows.joint_rows(metric, values, grid.joints, unit, grid.camera, role)
        per_frame.append(rows.frame_rows(metric, values, grid, role))
    return found, per_frame


def _coverage(grids: dict[str, LabelGrid], roles: dict[str, str]) -> Measured:
    measured = [(grid, (~grid.missing).astype(float)) for grid in grids.values()]
    found, per_frame = _summed("coverage", "share", measured, roles)
    inside = [(grid, np.where(grid.missing, np.nan, grid.in_frame)) for grid in grids.values()]
    return found + _summed("in_picture_share", "share", inside, roles, by_joint=False)[0], per_frame


def _sigmas(
    grids: dict[str, LabelGrid], roles: dict[str, str], spread: dict[str, tuple[Floats, Floats]]
) -> list[rows.Row]:
    """How well each camera's labels say that they are known, and how large the person is in its pictures."""
    found = []
    for camera, grid in grids.items():
        px, m = spread[camera]
        boxes = labels_in_boxes.label_boxes(grid)
        found += rows.mean_row("label_sigma", px, "px", camera, roles[camera])
        found += rows.joint_rows("label_sigma", px, grid.joints, "px", camera, roles[camera])
        found += rows.mean_row("label_sigma_m", m, "m", camera, roles[camera])
        found += rows.mean_row("person_height", boxes[:, 3] - boxes[:, 1], "px", camera, roles[camera])
    return found


def _quantiles(
    grids: dict[str, LabelGrid],
    roles: dict[str, str],
    spread: dict[str, tuple[Floats, Floats]],
    checked: dict[str, Floats],
    true: dict[str, LabelGrid],
) -> list[Table]:
    """Columns of `label_quantiles` by camera and metric."""
    found = []
    for camera, grid in grids.items():
        each = [("label_sigma", spread[camera][0]), ("label_sigma_m", spread[camera][1])]
        each += [("check_error", distance(grid.uv, checked[camera]))] if camera in checked else []
        each += [("error_to_truth_2d", against.errors_2d(grid, true[camera]))] if camera in true else []
        found += [label_errors.quantile_columns(metric, values, camera, roles[camera]) for metric, values in each]
    return found


def _reprojection(
    grids: dict[str, LabelGrid], roles: dict[str, str], detections: Path | None, swaps: Path | None, min_score: float
) -> Measured:
    if detections is None:
        return [], []
    table = tables.read(detections, "detections", ["camera", "frame", "joint", "u", "v", "score"])
    exchanged = tables.read(swaps, "swaps", ["camera", "frame", "swapped", "part"]) if swaps else None
    measured = []
    for camera, grid in grids.items():
        own = tables.of_camera(table, camera)
        if roles[camera] != "close" or not reprojection.comparable(grid, own):
            continue
        turned = tables.of_camera(exchanged, camera) if exchanged else None
        measured.append((grid, reprojection.errors(grid, own, min_score, turned)))
    return _summed("reprojection_error", "px", measured, roles)


def _boxes(
    grids: dict[str, LabelGrid], roles: dict[str, str], drawn: Yardsticks, rig: dict[str, Camera], sequence: str
) -> Measured:
    found, per_frame = [], []
    for camera, path in sorted(drawn.boxes.items()):
        if roles[camera] != "long_range":
            continue
        grid, edge, lens = grids[camera], occluded_edge(rig[camera]), rig[camera].intrinsics
        drawers = hand_boxes.read_drawers(path, grid.frames, (lens.width, lens.height))
        used, *others = drawers.values() or [hand_boxes.NONE]
        hand = labels_in_boxes.of_frames(grid, *used)
        figures = labels_in_boxes.figures(grid, hand, edge)
        figures += labels_in_boxes.left_out(grid, hand, *_left_out(drawn.left_out, sequence, camera), edge)
        for metric, unit, values in figures:
            rows_of, frames_of = _summed(metric, unit, [(grid, values)], roles, by_joint=False)
            found += rows_of
            per_frame += frames_of
        found += _other_drawers(grid, others, edge, roles[camera])
    return found, per_frame


def _left_out(paths: Iterable[Path], sequence: str, camera: str) -> tuple[Ints, Floats]:
    """Frames (B,) and shifts (B, 2) px of `left_out_boxes` of one camera."""
    each = []
    for path in paths:
        table = tables.of_camera(tables.read(path, "left_out_boxes"), camera)
        each.append(tables.rows(table, table["sequence"] == sequence))
    frames = np.concatenate([np.zeros(0, np.int64), *(table["frame"] for table in each)])
    shift = [np.stack([table["shift_u"], table["shift_v"]], axis=-1) for table in each]
    return frames, np.concatenate([np.zeros((0, 2)), *shift])


def _other_drawers(grid: LabelGrid, drawn: Iterable[hand_boxes.Boxes], edge: int | None, role: str) -> list[rows.Row]:
    """The figures by the boxes of the other drawers, each with his own margin and spread, of all their boxes together.

    Only in sum: a picture that two of them drew would have two values.
    """
    by_metric: dict[str, list[Floats]] = {}
    for boxes in drawn:
        hand = labels_in_boxes.of_frames(grid, *boxes)
        there = np.array(np.isfinite(hand).all(axis=1))
        for metric, _, values in labels_in_boxes.judged("other_drawer", grid, hand, there, edge):
            by_metric.setdefault(metric, []).append(values)
    return [
        row
        for metric, parts in by_metric.items()
        for row in rows.mean_row(metric, np.concatenate(parts), "share", grid.camera, role)
    ]


def _marks(roles: dict[str, str], marks: list[Path], sequence: str) -> list[rows.Row]:
    return [
        row
        for camera, errors in check_files.mark_errors(marks, sequence).items()
        for row in rows.mean_row("mark_error", errors, "px", camera, roles.get(camera, ""))
    ]


def _checks(grids: dict[str, LabelGrid], roles: dict[str, str], checked: dict[str, Floats]) -> list[rows.Row]:
    measured = [(grids[camera], distance(grids[camera].uv, checked[camera])) for camera in sorted(checked)]
    return _summed("check_error", "px", measured, roles)[0]


def _swaps(roles: dict[str, str], swaps: Path | None) -> list[rows.Row]:
    if swaps is None:
        return []
    table = tables.read(swaps, "swaps", ["camera", "swapped"])
    return [
        row
        for camera in sorted(tables.ordered_unique(table["camera"]))
        for row in rows.mean_row(
            "swapped_share",
            tables.of_camera(table, camera)["swapped"].astype(float),
            "share",
            camera,
            roles.get(camera, ""),
        )
    ]


def _truth_2d(grids: dict[str, LabelGrid], roles: dict[str, str], true: dict[str, LabelGrid]) -> Measured:
    measured = [(grid, against.errors_2d(grid, true[camera])) for camera, grid in grids.items() if camera in true]
    return _summed("error_to_truth_2d", "px", measured, roles)


def _truth_3d(skeleton: Path | None, truth: Path | None, sequence: str) -> list[rows.Row]:
    if truth is None or skeleton is None:
        return []
    columns = ["joint", "instant", "stamp_ns", "x", "y", "z"]
    ours, theirs = (
        tables.read(path, "skeletons_3d", columns) for path in (skeleton, Path(truth) / "skeletons_3d.parquet")
    )
    points, instants, joints = value_grid(ours, "instant", "x", "y", "z")
    true, true_instants, true_joints = value_grid(theirs, "instant", "x", "y", "z")
    stamps, true_stamps = (
        t["stamp_ns"].reshape(-1, max(len(names), 1))[:, 0] for t, names in ((ours, joints), (theirs, true_joints))
    )
    _, here, there = np.intersect1d(instants, true_instants, return_indices=True)
    against.check_instants(stamps[here], true_stamps[there], INSTANT_TOLERANCE_NS, f"sequence {sequence}")
    plain, aligned = against.errors_3d(points, onto(instants, joints, true, true_instants, true_joints))
    return [
        *rows.mean_row("error_to_truth_3d", plain, "m"),
        *rows.joint_rows("error_to_truth_3d", plain, joints, "m"),
        *rows.mean_row("error_to_truth_3d_aligned", aligned, "m"),
        *rows.joint_rows("error_to_truth_3d_aligned", aligned, joints, "m"),
    ]
