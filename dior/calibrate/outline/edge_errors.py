"""How edges of boxes and clicks err: outliers, errors that last, and joints whose 3D is off.

INPUTS   residuals (N,) px of a fit (`dior.calibrate.outline.boxes_fit`), the pictures they are of
OUTPUTS  weights, by how much intervals widen, covariances
World in metres, recorded pixels.
"""

from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats, Ints
from dior.calibrate.outline.seen_edges import EdgeObservations
from dior.clocks import persistence
from dior.geometry.camera import Camera

LEAST_SD_PX = 0.3  # chosen: nobody draws a box better, no silhouette is known better
STANDS_M_S = 0.2  # chosen: a body that moves slower turns on the spot and shows no side of its own


@dataclass(frozen=True, eq=False)
class EdgeResiduals:
    """N coordinates: picture, joint, axis, side (-1 for a click), residual px, derivatives by the parameters (N, 9+2K),
    by the 3D point (N, 3) and by the camera (N, 6)."""

    frame: Ints
    joint: Ints
    axis: Ints
    kind: Ints
    residual: Floats
    J: Floats
    by_point: Floats
    by_camera: Floats


def weights(residual: Floats, scale: float) -> Floats:
    """Geman-McClure: an edge that is far off does not pull at all."""
    return 1 / (1 + (residual / scale) ** 2) ** 2


def slopes(residual: Floats, scale: float) -> Floats:
    """Derivative of the weighted residual by the residual."""
    z2 = (residual / scale) ** 2
    return (1 - 3 * z2) / (1 + z2) ** 3


def spread(residual: Floats) -> float:
    """Standard deviation (px) of most of the residuals."""
    return max(1.4826 * np.median(np.abs(residual)), LEAST_SD_PX)


def inflation(rows: EdgeResiduals, weight: Floats, seen: EdgeObservations) -> float:
    """By how much errors alike in time widen the intervals: `dior.clocks.persistence.inflation_at`.

    A side (or joint and axis) of one walk is a series; the mean of each side is subtracted.
    """
    label = np.where(rows.kind >= 0, rows.kind, 4 + 2 * rows.joint + rows.axis)
    own = weight * rows.residual
    for k in np.unique(label):
        own[label == k] -= own[label == k].mean()
    series = seen.walk[rows.frame] * (label.max() + 1) + label
    return persistence.inflation_at(own, seen.seconds[rows.frame], series)


def of_bias(pull: Floats, rows: EdgeResiduals, camera: Camera, points: Floats, seen: EdgeObservations) -> Floats:
    """Covariance (P, P) of parameters that residuals move by `pull` (P, N), from joints that are off by `seen.bias_m`
    alike in every picture that shows the same side of the body; `points` (F, J, 3) m."""
    out = np.zeros((len(pull), len(pull)))
    if not seen.bias_m:
        return out
    group = rows.joint * 5 + way_seen(camera, points, seen.seconds, seen.walk)[rows.frame]
    for g in np.unique(group):
        mine = group == g
        G = pull[:, mine] @ rows.by_point[mine]
        out += seen.bias_m**2 * G @ G.T
    return out


def of_outline(pull: Floats, rows: EdgeResiduals, camera: Camera, points: Floats, seen: EdgeObservations) -> Floats:
    """Covariance (P, P) of parameters that residuals move by `pull` (P, N), from an outline that lies further out than
    it does by `seen.outline_m`: above and below alike in every picture, beside alike while the same side is seen."""
    out = np.zeros((len(pull), len(pull)))
    edge = rows.kind >= 0
    if not seen.outline_m or not edge.any():
        return out
    way = way_seen(camera, points, seen.seconds, seen.walk)[rows.frame]
    group = np.where(rows.axis == 0, 5 * rows.kind + way, 5 * rows.kind)
    scale = np.linalg.norm(rows.by_point, axis=1)
    for g in np.unique(group[edge]):
        mine = edge & (group == g)
        G = pull[:, mine] @ scale[mine]
        out += seen.outline_m**2 * np.outer(G, G)
    return out


def of_habit(pull: Floats, rows: EdgeResiduals, habit_px: float) -> Floats:
    """Covariance (P, P) of parameters that residuals move by `pull` (P, N), from edges each of whose four sides lies
    further out by `habit_px` (sd) in every box."""
    by_side = np.stack([pull[:, rows.kind == side].sum(axis=1) for side in range(4)], axis=1)
    return habit_px**2 * by_side @ by_side.T


def way_seen(camera: Camera, points: Floats, seconds: Floats, walk: Ints) -> Ints:
    """0 to 4 (F,): whether the body of points (F, J, 3) m goes away, right, towards the camera or left, or stands."""
    known = np.all(np.isfinite(points), axis=-1)[..., None]
    middle = np.where(known, points, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    ahead = camera.wRc[:, 2] * (1, 1, 0)
    right = np.cross(ahead, (0, 0, 1))
    side = np.full(len(points), 4)
    for k in np.unique(walk):
        mine = np.flatnonzero(walk == k)
        if len(mine) < 2:
            continue
        speed = np.gradient(middle[mine], axis=0) / np.maximum(np.gradient(seconds[mine]), 1e-6)[:, None]
        quarter = np.round(np.arctan2(speed @ right, speed @ ahead) / (np.pi / 2)).astype(int) % 4
        moves = np.hypot(speed @ ahead, speed @ right) > STANDS_M_S * np.linalg.norm(ahead)
        side[mine] = np.where(moves, quarter, 4)
    return side
