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

    def at(self, rows: slice) -> "Timing":
        """Of some of the pictures."""
        sigma = None if self.stamp_sigma is None else self.stamp_sigma[rows]
        return Timing(self.clocks, self.velocity[rows], self.elapsed[rows], sigma)


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
    rows = max(1, cam.BLOCK // int(np.prod(points.shape[1:-1])))
    blocks = [slice(start, start + rows) for start in range(0, len(points), rows)]
    each = [_of_block(camera, points[at], noise[at], makers, names, joint, timing and timing.at(at)) for at in blocks]
    return np.concatenate([np.empty((0, *points.shape[1:-1], 2, 2)), *each])


def _of_block(
    camera: Camera,
    points: Floats,
    noise: Floats,
    makers: Sequence[Camera],
    names: Sequence[str],
    joint: Floats,
    timing: Timing | None,
) -> Floats:
    """`of_labels` of so few points that what is made of them stays in the cache of a processor."""
    each = len(joint) // len(names)
    along = np.moveaxis(points, -1, 0)
    views = {name: cov.linear(c, along, each == 9) for name, c in {c.name: c for c in (camera, *makers)}.items()}
    _, by_point, by_camera = views[camera.name]
    by_all = np.zeros((len(names), each, 2, *points.shape[:-1]))
    by_all[names.index(camera.name)] = np.swapaxes(by_camera, 0, 1)
    velocity = np.moveaxis(timing.velocity, -1, 0)[:, None] if timing else np.zeros((3, 1))
    late = {camera.name: cov.product(by_point, velocity)[:, 0]} if timing else {}
    if makers:
        seen = np.stack([cam.in_frame(c.intrinsics, np.moveaxis(views[c.name][0], 0, -1)) for c in makers])
        by_maker = [np.where(shown, views[c.name][1], 0.0) for c, shown in zip(makers, seen, strict=True)]
        say = seen[:, None, None] * np.eye(2).reshape(2, 2, *(1,) * len(along.shape[1:]))
        for maker, shown, J, pull in zip(makers, seen, by_maker, cov.inherited(by_maker, say)[1], strict=True):
            pull = cov.product(by_point, pull)
            moves = cov.product(pull, np.where(shown, views[maker.name][2], 0.0))
            by_all[names.index(maker.name)] += np.swapaxes(moves, 0, 1)
            if timing:
                back = cov.product(pull, cov.product(J, velocity))[:, 0]
                late[maker.name] = late.get(maker.name, 0.0) + back
    out = cov.product(cov.product(by_point, np.moveaxis(noise, (-2, -1), (0, 1))), np.swapaxes(by_point, 0, 1))
    if timing:
        for name, moved in late.items():
            clock = timing.clocks[name]
            after = 1e-6 * (timing.elapsed - clock.middle_s)
            variance = clock.given[0] ** 2 + (after * clock.given[1]) ** 2
            if name == camera.name and timing.stamp_sigma is not None:
                variance = variance + timing.stamp_sigma**2
            out += variance[:, None] * moved[:, None] * moved
            for by, gain in clock.gains.items():
                # a clock that was fitted to a camera which is not here keeps only its own error
                if by in names:
                    own = gain[0][:, None] + gain[1][:, None] * after
                    by_all[names.index(by), :6] += moved * own[:, None, :, None]
    by_all = by_all.reshape(each * len(names), 2, -1)
    carried = (joint @ by_all.reshape(len(joint), -1)).reshape(by_all.shape)
    out += np.einsum("kap,kbp->abp", by_all, carried).reshape(out.shape)
    return cov.matrices(out)


def columns(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """sigma_u, sigma_v (px) and rho_uv, each (...,), of covariances (..., 2, 2)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
        rho = covariance[..., 0, 1] / (sigma[..., 0] * sigma[..., 1])
    return sigma[..., 0], sigma[..., 1], rho
