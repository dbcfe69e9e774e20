"""Points from the views of a rig by weighted linear equations in ideal coordinates, many at once.

World in metres; pixels are recorded ones. Weights are 1/px, 0 for a view without a say.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.geometry import camera as cam
from dior.geometry import multiview


@dataclass(frozen=True, eq=False)
class Rig:
    """`linear` and `origin` of `multiview.equations`; `rows` (V, 3, 4): cTw from that origin; `cameras`."""

    cameras: tuple[cam.Camera, ...]
    linear: Floats
    origin: Floats
    rows: Floats


@dataclass(frozen=True, eq=False)
class Views:
    """What the views of a rig say, flat: coordinates x, y and weights w (V, N); 1/w is the noise of x and y."""

    rig: Rig
    x: Floats
    y: Floats
    w: Floats

    def at(self, columns: Ints | Bools | slice) -> "Views":
        """The views of some points."""
        return Views(self.rig, self.x[:, columns], self.y[:, columns], self.w[:, columns])


def rig_of(cameras: Sequence[cam.Camera]) -> Rig:
    cTw = np.stack([cam.inverse_pose(c.wTc) for c in cameras])
    linear, origin = multiview.equations(cTw)
    rows = cTw[:, :3].copy()
    rows[..., 3] += rows[..., :3] @ origin
    return Rig(tuple(cameras), linear, origin, rows)


def views_of(rig: Rig, uv: Floats, weights: Floats) -> Views:
    """`Views` of pixels (V, ..., 2) with weights (V, ...) in 1/px; a missing one has weight 0."""
    xy = [cam.undistort(c.intrinsics, view).reshape(-1, 2) for c, view in zip(rig.cameras, uv, strict=True)]
    x, y = (np.stack([view[:, i] for view in xy]) for i in range(2))
    w = weights.reshape(len(xy), -1) * np.array([c.intrinsics.fx for c in rig.cameras])[:, None]
    seen = np.isfinite(x + y) & (w > 0)
    if not seen.all():
        x, y, w = (np.where(seen, values, 0.0) for values in (x, y, w))
    return Views(rig, x, y, w)


def meet(views: Views) -> tuple[Floats, Floats]:
    """Points (3, N) from the rig's origin and their chi squared (N,); NaN where they meet nowhere.

    The equations are weighted by the depths of a first solution, which makes them the reprojection's own. A point
    behind a view that has a say is nowhere.
    """
    axes, shift = views.rig.rows[:, 2, :3], views.rig.rows[:, 2, 3:]
    says = views.w > 0
    with np.errstate(all="ignore"):
        first, _, _ = multiview.meet(views.rig.linear, views.x, views.y, views.w * views.w)
        w2 = views.w / (axes @ first + shift)
        w2 *= w2
        points, chi2, fine = multiview.meet(views.rig.linear, views.x, views.y, w2)
        fine &= ((axes @ points + shift > 0) | ~says).all(axis=0) & (says.sum(axis=0) >= 2)
    points[:, ~fine] = np.nan
    chi2[~fine] = np.nan
    return points, np.maximum(chi2, 0.0, out=chi2)


def meet_in_blocks(views: Views) -> tuple[Floats, Floats]:
    """`meet` of many points."""
    count = views.x.shape[1]
    points, chi2 = np.empty((3, count)), np.empty(count)
    for start in range(0, count, multiview.BLOCK):
        block = slice(start, start + multiview.BLOCK)
        points[:, block], chi2[block] = meet(views.at(block))
    return points, chi2


def residuals(views: Views, points: Floats) -> tuple[Floats, Floats]:
    """Whitened residuals (V, 2, N) of points (3, N), and their share (V, N) of 2 that the view's own say left over."""
    p = views.rig.rows[..., :3] @ points + views.rig.rows[..., 3:]
    scale = views.w / p[:, 2]
    left = np.stack([views.x * p[:, 2] - p[:, 0], views.y * p[:, 2] - p[:, 1]], axis=1) * scale[:, None]
    third = views.rig.rows[:, 2, :3, None]
    J = np.stack(
        [c[:, None] * third - views.rig.rows[:, i, :3, None] for i, c in enumerate((views.x, views.y))], axis=1
    )
    J = np.moveaxis(J * scale[:, None, None], -1, 0)  # (N, V, 2, 3)
    C = np.linalg.inv(np.einsum("nvai,nvaj->nij", J, J))
    return left, 2.0 - np.einsum("nvai,nij,nvaj->vn", J, C, J)
