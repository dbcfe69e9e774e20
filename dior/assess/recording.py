"""A recording of somebody else's dataset: what each camera saw of one person, and where the joints were in 3D.

World in metres, Z up; recorded pixels; seconds on one time axis by the dataset's own word; NaN is missing.
"""

from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats
from dior.body.names import MLKIT_33
from dior.body.wrong_world import of_markers
from dior.calibrate.clock.from_mocap import WalkerJoints, walker_of
from dior.geometry.camera import Camera


@dataclass(frozen=True, eq=False)
class View:
    """A camera as the dataset places it, and its 2D keypoints `uv` (F, J, 2) px at `elapsed` (F,) s, ascending.

    `fps`: pictures per second.
    """

    camera: Camera
    elapsed: Floats
    uv: Floats
    fps: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Joints or markers called `names` at `t` (I,) s, `xyz` (I, N, 3)."""

    t: Floats
    xyz: Floats
    names: tuple[str, ...]

    @property
    def of_markers(self) -> bool:
        return of_markers(self.names)

    def only(self, names: tuple[str, ...]) -> WalkerJoints:
        """The joints that are among `names`, of the markers or as they are."""
        wanted = [name for name in names if name in (MLKIT_33 if self.of_markers else self.names)]
        return walker_of(self.t, self.xyz, list(self.names), wanted)

    def at(self, xyz: Floats) -> "Motion":
        return Motion(self.t, xyz, self.names)


@dataclass(frozen=True, eq=False)
class Recording:
    """`name`; the `views` with their `joints` (J), one order for all; `motion`, None where there is no 3D.

    `notes`: what was taken for what, in words.
    """

    name: str
    joints: tuple[str, ...]
    views: tuple[View, ...]
    motion: Motion | None
    notes: tuple[str, ...] = ()


def matched(view: View, joints: tuple[str, ...], walker: WalkerJoints) -> View:
    """The view with the walker's joints only, in their order."""
    index = [joints.index(name) for name in walker.names]
    return View(view.camera, view.elapsed, view.uv[:, index], view.fps)


def common_grid(views: tuple[View, ...] | list[View]) -> Floats:
    """Moments (T,) s, at the rate of the first view, at which every view has pictures; empty where there are none."""
    first, last = max(view.elapsed[0] for view in views), min(view.elapsed[-1] for view in views)
    count = int(np.floor((last - first) * views[0].fps + 1e-6)) + 1
    return first + np.arange(max(count, 0)) / views[0].fps
