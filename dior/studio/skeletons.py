"""The 3D of a walk in a camera's pictures: where it is from, by which clock it is taken, and the lines to draw of it.

INPUTS   `skeletons_3d` of the last run, or indoors the motion capture before any; clocks by hand and of that run
OUTPUTS  points (F, J, 3) m at the pictures' times, lines px in the recorded picture
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.body import names
from dior.calibrate.outline import tracks
from dior.clocks import by_hand
from dior.clocks import clock as on_axis
from dior.clocks.axis import seconds
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.project.contents import Project
from dior.studio.workspace import Workspace, state_of

SIDES = ("left", "right", "middle")
# joints and markers of the feet, by which a clock is seen best: they are the fastest
FEET = re.compile(r"(left|right)_(ankle|heel|foot_index|big_toe|small_toe)|[LR](ANK|HEE|TOE)")


class NotYet(DiorError):
    """What a page is about is made by a later step, or by hand before: it says so and shows nothing."""


@dataclass(frozen=True, eq=False)
class Body:
    """The `track` of the `joints` on the walk's axis, which begins at `t0_ns`; `source`: what it is from, in words."""

    track: tracks.BodyTrack
    t0_ns: int
    joints: list[str]
    source: str

    def at(self, stamps_ns: Ints, offset_s: float, drift_ppm: float) -> Floats:
        """Points (F, J, 3) m at pictures of these header stamps (F,)."""
        return self.track.at(seconds(stamps_ns, self.t0_ns, offset_s, drift_ppm))


def body_of(workspace: Workspace, walk: str) -> Body:
    """The `Body` of a walk. Raises NotYet where there is none, and DiorError as `Workspace.motion`."""
    project = workspace.project()
    path = project.skeleton_table(walk)
    table = workspace.result(path, "skeletons_3d")
    if table is not None:
        return workspace.kept(("body", walk), state_of([path]), lambda: Body(*tracks.read(table), path))
    if project.indoor(walk):
        motion = workspace.motion(walk)
        return Body(tracks.BodyTrack(motion.t, motion.xyz), motion.t0_ns, motion.joints, "the motion capture")
    raise NotYet(f"{walk} has no 3D yet ({path}): `dior run` makes it of the close cameras")


def clock_file(project: Project, walk: str, camera: str, kind: str = "") -> str:
    """The table of a camera's clock in a walk, or of that `kind` beside it: ".costs", ".findings"."""
    [path] = project.clock_tables(walk, [camera], kind)
    return path


def clock_of_run(workspace: Workspace, walk: str, camera: str) -> on_axis.Clock | None:
    """The camera's clock that the last run made labels with, None where there was none."""
    path = clock_file(workspace.project(), walk, camera)
    if not Path(path).is_file():
        return None
    found: on_axis.Clock | None = on_axis.read([path], sequence=walk).get(camera)
    return found


def clock_by_hand(project: Project, walk: str, camera: str) -> on_axis.Clock | None:
    """The camera's clock in config/offsets, None where nobody gave one. Raises DiorError for a file that is wrong."""
    given = by_hand.by_hand(offsets_file(walk), project.cameras_of(walk))
    return given.get(camera)


def offsets_file(walk: str) -> str:
    """Where clocks of a walk are given by hand."""
    return f"config/offsets/{walk}.yaml"


def clock_of(workspace: Workspace, walk: str, camera: str) -> on_axis.Clock:
    """The clock by hand, else of the last run, else that of the stamps, whose error is not known."""
    given = clock_by_hand(workspace.project(), walk, camera)
    return given or clock_of_run(workspace, walk, camera) or on_axis.Clock(0.0)


def pose_of_run(project: Project, session: str, camera: str) -> Camera | None:
    """The camera where the last run has it, None where it has not placed it."""
    path = project.final_cameras(session, camera)
    found = camera_tables.read_cameras(path).get(camera) if Path(path).is_file() else None
    return found if found is not None and found.wTc is not None else None


def lines(camera: Camera, points: Floats, joints: Sequence[str]) -> list[dict[str, list[list[float]]]]:
    """Of each picture the bones by their side of the body: (u, v, u, v) px each; points (F, J, 3) m."""
    uv = cam.project(camera, points)[0]
    bones = names.bones_of(joints)
    ends = np.round(uv[:, bones].reshape(len(uv), len(bones), 4), 2)
    known = np.asarray(np.isfinite(ends).all(axis=-1))
    side = [side_of_bone(joints[a], joints[b]) for a, b in bones]
    mine = {name: np.array([one == name for one in side], bool) for name in SIDES}
    return [
        {name: one[there & which].tolist() for name, which in mine.items()}
        for one, there in zip(ends, known, strict=True)
    ]


def side_of_bone(one: str, other: str) -> str:
    """Left or right where an end is there and none on the other side, else middle."""
    sides = {names.side_of(one), names.side_of(other)} - {"middle"}
    return sides.pop() if len(sides) == 1 else "middle"


def around(camera: Camera, points: Floats) -> Floats:
    """Boxes (F, 4) px around the projected points (F, J, 3) m, NaN of pictures without any."""
    uv = cam.project(camera, points)[0]
    known: Bools = np.asarray(np.isfinite(uv).all(axis=-1))[..., None]
    low = np.where(known, uv, np.inf).min(axis=1, initial=np.inf)
    high = np.where(known, uv, -np.inf).max(axis=1, initial=-np.inf)
    found = np.concatenate([low, high], axis=1)
    return np.where(np.isfinite(found).all(axis=1)[:, None], found, np.nan)
