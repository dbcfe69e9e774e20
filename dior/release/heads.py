"""Where the subject's head is in every picture of a camera: what the release covers.

INPUTS   the skeleton, the camera's pose and clock, its `labels_2d`; the `heads` of an earlier release, if there are any
OUTPUTS  `heads` table: a row per picture with a box of whole pixels that holds the head; findings
The box is that of an ellipsoid as large as a head (`head_model`), projected and enlarged by SIGMAS of the labels'
uncertainty. It works where no face detector does: from behind, and at a distance where a head has three pixels. Its
edges are rounded outwards on a grid, so that a camera that is moved by a tenth of a pixel leaves most pictures of the
release as they are, byte by byte. All of them stay where the boxes of an earlier release are given: a box is kept as
long as it holds the head. Only the subject's head is known; somebody else in the picture is not covered.
"""

import sys
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Table, Texts
from dior.clocks import clock as on_axis
from dior.clocks.axis import seconds
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.release import head_model
from dior.tables import tables

# Of the labels' uncertainty. The ellipsoid is a head with its hair and somewhat more, so that 1.5 leave less than 0.1 %
# of a head outside (benchmarks/blur.py); 3 would cover five times its area at 60 m.
SIGMAS = 1.5
# An earlier box is kept while it holds the ellipsoid with this many, and is at most this many times as large as a new
# one. Chosen: smaller keeps fewer pictures as they were, larger covers less surely or more than the head.
KEPT_SIGMAS, KEPT_AREA = 0.5, 2.0
# where the labels have no known uncertainty, 1 sigma as a share of the head's half width and height; chosen, and said
# in a finding
UNKNOWN_SIGMA = 1 / 6
# The grid, px: the coarsest of which a box is at least this many wide and high. A head of 3 px in a box of 8 would be
# covered ten times over. Chosen: a coarser grid leaves more pictures as they are and covers more beside the head.
GRIDS, PER_BOX = (8, 4, 2, 1), 4
# m from the lens; chosen: twice what a head's ellipsoid reaches, nearer than that its outline is not the one projected
NEAR_M = 0.3
# of a single pixel, this much of its width or height may be left outside; chosen: without it a box that
# reaches a hair into the next pixel becomes a pixel larger
SLIVER = 0.15


def run(
    *,
    sequence: str,
    camera: str,
    cameras: list[Path],
    skeleton: Path,
    frames: Path,
    clocks: list[Path],
    labels: Path,
    before: Path | None,
    out: Path,
    findings: Path,
) -> None:
    """Write the head's box in every picture of one camera of one sequence.

    `cameras`, `clocks`: tables that hold the camera's pose and its clock. Raises DiorError where they do not, and where
    the labels are of other pictures. `before`: the table that an earlier release was made with, or None.
    """
    rows, view, middle, own, sigma = known(sequence, camera, cameras, skeleton, frames, clocks, labels)
    box, status = boxes(view, middle, own, sigma)
    box = np.where((status == "ok")[:, None], on_grid(box), np.nan)
    if before:
        box = kept(
            _earlier(before, rows, f"{sequence}, camera {camera}"), box, boxes(view, middle, own, sigma, KEPT_SIGMAS)[0]
        )
    tables.write(out, "heads", {"frame": rows["frame"], "status": status, **dict(zip(EDGES, box.T, strict=True))})
    said = _findings(f"{sequence}/{camera}", status, bool(np.isfinite(sigma).any()))
    for _, severity, _, text in said:
        print(f"{sequence}, {camera}: {severity}: {text}", file=sys.stderr)
    tables.write_findings(findings, said)


EDGES = ("u_min", "v_min", "u_max", "v_max")


def known(
    sequence: str, camera: str, cameras: list[Path], skeleton: Path, frames: Path, clocks: list[Path], labels: Path
) -> tuple[Table, Camera, Floats, Floats, Floats]:
    """The camera's rows of `frames`, and what `boxes` needs of them, as of `run`."""
    (placed,) = camera_tables.read_placed(cameras, [camera], sequence)
    rows = tables.of_camera(tables.read(frames, "frames", ["camera", "frame", "stamp_ns"]), camera)
    if camera not in (own_clocks := on_axis.read(clocks)):
        raise DiorError(f"{sequence}, camera {camera}: {', '.join(map(str, clocks))} has no clock of it")
    body, clock = tables.read(skeleton, "skeletons_3d"), own_clocks[camera]
    times = seconds(rows["stamp_ns"], body["stamp_ns"][0], clock.offset_s, clock.drift_ppm)
    sigma = _sigma(labels, tables.ordered_unique(body["joint"]), rows, f"{sequence}, camera {camera}")
    return rows, placed, *_heads(body, times), _everywhere(times, sigma)


def _heads(body: Table, times: Floats) -> tuple[Floats, Floats]:
    """The middle between the ears (F, 3) m at `times` (F,) s, and its own error (F,) m, of a `skeletons_3d` table."""
    points, joints = tables.grid(body, "x", "y", "z")
    instants = seconds(body["stamp_ns"].reshape(points.shape[:2])[:, 0], body["stamp_ns"][0])
    middle, own = head_model.centres(points, joints)
    filled = (body["status"] == "gap_filled").reshape(points.shape[:2])[:, head_model.used(joints)].any(axis=1)
    return head_model.at_times(times, instants, head_model.steady(instants, middle, filled), own)


def _sigma(labels: Path, joints: list[str], rows: Table, where: str) -> Floats:
    """Uncertainty (F, 2) px of the labels of the head, the mean over its joints; NaN where none is known."""
    table = tables.read(labels, "labels_2d", ["frame", "joint", "sigma_u", "sigma_v"])
    values, named = tables.grid(table, "frame", "sigma_u", "sigma_v")
    if named != joints or not np.array_equal(values[:, 0, 0], rows["frame"]):
        raise DiorError(f"{where}: {labels} has labels of other joints or pictures; run reproject again")
    mine = values[:, head_model.used(joints), 1:]
    known = np.all(np.isfinite(mine), axis=-1)
    count = known.sum(axis=1)[:, None]
    return np.where(count > 0, np.where(known[..., None], mine, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def _everywhere(times: Floats, sigma: Floats) -> Floats:
    """Sigma (F, 2) px with those of the nearest pictures where there is none; NaN where there is none at all."""
    known = np.isfinite(sigma).all(axis=1)
    if not known.any():
        return sigma
    return np.stack([np.interp(times, times[known], sigma[known, i]) for i in range(2)], axis=1)


def boxes(camera: Camera, middle: Floats, own: Floats, sigma: Floats, sigmas: float = SIGMAS) -> tuple[Floats, Texts]:
    """Box (F, 4) px (u_min, v_min, u_max, v_max) of the head in every picture, and its status (F,).

    `middle` (F, 3) m between the ears with its own error `own` (F,) m, `sigma` (F, 2) px of the labels, NaN unknown;
    the box is larger than the ellipsoid by `sigmas` of all that.
    """
    centre = middle + (0.0, 0.0, head_model.RAISED_M)
    uv, depth = cam.project(camera, _outline(camera, centre))
    low, high = (_extreme(uv, pick) for pick in (np.fmin, np.fmax))
    half = (high - low) / 2
    with np.errstate(invalid="ignore"):
        error = np.hypot(np.where(np.isfinite(sigma), sigma, UNKNOWN_SIGMA * half), own[:, None] * _scale(half))
        box = np.concatenate([low - sigmas * error, high + sigmas * error], axis=1)
        lens = camera.intrinsics
        outside = (box[:, 0] >= lens.width - 0.5) | (box[:, 1] >= lens.height - 0.5) | (box[:, 2:] < -0.5).any(axis=1)
        # a head at the lens: no box is sure to hold it
        unknown = ~(np.linalg.norm(centre - camera.centre, axis=1) >= NEAR_M)
    behind = (depth <= 0).all(axis=1)
    unknown |= (depth <= 0).any(axis=1) & ~behind
    nowhere = behind | ~np.isfinite(box).all(axis=1) | outside
    return box, np.where(unknown, "unknown", np.where(nowhere, "out_of_frame", "ok")).astype(object)


def _extreme(uv: Floats, pick: np.ufunc) -> Floats:
    return pick.reduce(uv, axis=1)


def _scale(half: Floats) -> Floats:
    """Pixels per metre (F, 2) at the head, from its half width and height px."""
    return half / np.array(head_model.RADII_M)


def _outline(camera: Camera, centre: Floats) -> Floats:
    """Points (F, 4, 3) m of the ellipsoid that a camera sees furthest right, left, down and up."""
    sight = centre - camera.centre
    sight = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    horizontal, vertical = head_model.RADII_M
    radii = np.array([horizontal, horizontal, vertical])
    points = []
    for axis in camera.wRc.T[:2]:
        across = axis - (sight @ axis)[:, None] * sight
        # where the ellipsoid's surface is furthest along `across`
        reach = radii**2 * across
        reach = reach / np.linalg.norm(radii * across, axis=1, keepdims=True)
        points += [centre + reach, centre - reach]
    return np.stack(points, axis=1)


def on_grid(box: Floats) -> Floats:
    """Edges (F, 4) of whole pixels around boxes (F, 4) px: first column and row, and those after the last.

    Rounded outwards to a grid of 8 px, of 4, 2 or 1 px where the box is less than four of these wide or high.
    """
    edges = box + 0.5
    with np.errstate(invalid="ignore"):
        small = np.minimum(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1])
        grid = np.select([small >= PER_BOX * g for g in GRIDS[:-1]], GRIDS[:-1], GRIDS[-1])[:, None]
        spared = np.where(grid == 1, SLIVER, 0.0)
    low, high = np.floor(edges[:, :2] / grid + spared), np.ceil(edges[:, 2:] / grid - spared)
    return np.concatenate([low, high], axis=1) * grid


def _earlier(path: Path, rows: Table, where: str) -> Floats:
    """Edges (F, 4) of an earlier `heads` table. Raises DiorError where it is of other pictures."""
    table = tables.read(path, "heads")
    if not np.array_equal(table["frame"], rows["frame"]):
        raise DiorError(f"{where}: {path} is of other pictures; the recording has changed, so delete it")
    return np.stack([table[key] for key in EDGES], axis=1)


def kept(before: Floats, edges: Floats, least: Floats) -> Floats:
    """Edges (F, 4) on the grid, those of `before` where they still hold the boxes `least` (F, 4) px and little more."""

    def area(box: Floats) -> Floats:
        return (box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1])

    with np.errstate(invalid="ignore"):
        inside = (before[:, :2] <= least[:, :2] + 0.5 + SLIVER) & (before[:, 2:] >= least[:, 2:] + 0.5 - SLIVER)
        same = inside.all(axis=1) & np.isfinite(edges).all(axis=1) & (area(before) <= KEPT_AREA * area(edges))
    return np.where(same[:, None], before, edges)


def _findings(scope: str, status: Texts, certain: bool) -> list[tuple[str, str, str, str]]:
    found = []
    lost = int((status == "unknown").sum())
    if lost:
        text = f"{lost} of {len(status)} pictures are not released: where the head is in them is not known"
        found.append((scope, "warning", "head_unknown", text))
    if not certain and (status == "ok").any():
        text = (
            "how certain the labels are is not known; the head is covered with half its size around it, so look at it"
        )
        found.append((scope, "warning", "head_uncertain", text))
    return found
