"""How uncertain a label is: what the detections, the close cameras and its own camera leave open, carried to the pixel.

INPUTS   world points with their covariance given the cameras, the cameras that they were made with, the label's camera,
         the joint covariance of all of them, and their clocks
OUTPUTS  covariance (..., 2, 2) px^2 of the labels
A point moves with the cameras that it was triangulated from, and the label's own camera moves with them, too: a world
that is turned or shifted as a whole moves no label of a close camera. Therefore the joint covariance is carried, and
not each camera's own. A clock that is wrong shows the point where it is earlier or later; a maker's moves the point
against its motion. What clocks owe to the poses (`dior.clocks.clock`) is counted with these. A lens that is wrong moves
what it shows, and the poses that were found with it move back. Errors of the motion capture itself are not counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats
from dior.clocks.clock import Clock
from dior.geometry import camera as cam
from dior.geometry import covariance as cov
from dior.geometry.camera import Camera


@dataclass(frozen=True, eq=False)
class Timing:
    """The `clocks` by name of the cameras behind the points and of the label's own; the points' `velocity` (F, J, 3)
    m/s and the time `elapsed` (F,) s of the pictures after t0. `stamp_sigma` (F,) s is the standard error of the
    pictures' own stamps, where these were restored."""

    clocks: dict[str, Clock]
    velocity: Floats
    elapsed: Floats
    stamp_sigma: Floats | None = None


def of_labels(
    camera: Camera,
    points: Floats,
    noise: Floats,
    makers: Sequence[Camera],
    names: Sequence[str],
    joint: Floats,
    timing: Timing | None = None,
) -> Floats:
    """Covariance (..., 2, 2) px^2 of the labels of `camera` at world points (F, J, 3) m; NaN where it is not known.

    `noise` (F, J, 3, 3) m^2 given the cameras. `makers`: cameras that the points were triangulated from, none for
    motion capture. `joint` (6N, 6N), or with their lenses (9N, 9N): covariance of the errors of the cameras called
    `names`, in which are the makers and `camera`. Without `timing` the clocks are right.
    """
    by_point, by_camera = cov.projection(camera, points)
    each = len(joint) // len(names)
    by_all = np.zeros((*points.shape[:-1], 2, len(names), each))
    by_all[..., names.index(camera.name), :6] = by_camera
    if each == 9:
        by_all[..., names.index(camera.name), 6:] = cov.by_lens(camera, points)
    late: dict[str, Floats] = {}
    if timing:
        late[camera.name] = (by_point @ timing.velocity[..., None])[..., 0]
    if makers:
        seen = np.stack([cam.in_frame(c.intrinsics, cam.project(c, points)[0]) for c in makers])
        spread, moves = cov.triangulated(makers, points, seen[..., None, None] * np.eye(2), each == 9)
        moves = (by_point @ moves).reshape(*points.shape[:-1], 2, len(makers), each)
        for i, maker in enumerate(makers):
            by_all[..., names.index(maker.name), :] += moves[..., i, :]
            if timing:
                J = np.where(seen[i][..., None, None], cov.projection(maker, points)[0], 0.0)
                back = by_point @ spread @ np.swapaxes(J, -1, -2) @ J @ timing.velocity[..., None]
                late[maker.name] = late.get(maker.name, np.zeros(1)) - back[..., 0]
    out = by_point @ noise @ np.swapaxes(by_point, -1, -2)
    if timing:
        for name, moved in late.items():
            clock = timing.clocks[name]
            after = 1e-6 * (timing.elapsed - clock.middle_s)
            variance = clock.given[0] ** 2 + (after * clock.given[1]) ** 2
            if name == camera.name and timing.stamp_sigma is not None:
                variance = variance + timing.stamp_sigma**2
            out = out + variance[:, None, None, None] * moved[..., :, None] * moved[..., None, :]
            for by, gain in clock.gains.items():
                # a clock that was fitted to a camera which is not here keeps only its own error
                if by in names:
                    own = gain[0] + after[:, None] * gain[1]
                    by_all[..., names.index(by), :6] += moved[..., None] * own[:, None, None]
    by_all = by_all.reshape(*points.shape[:-1], 2, each * len(names))
    return out + by_all @ joint @ np.swapaxes(by_all, -1, -2)


def columns(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """sigma_u, sigma_v (px) and rho_uv, each (...,), of covariances (..., 2, 2)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
        rho = covariance[..., 0, 1] / (sigma[..., 0] * sigma[..., 1])
    return sigma[..., 0], sigma[..., 1], rho
