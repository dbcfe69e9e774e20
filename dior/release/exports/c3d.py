"""C3D, the binary format of motion capture.

OUTPUTS  c3d/<subject>/<sequence>.c3d: mm, Z up, residual -1 where a point is missing
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dior.arrays import Floats
from dior.release.exports.fixed_rate import MILLIMETRES, AddWalk, regular
from dior.release.exports.recordings import Body, Release, ReleasedWalk

ABOUT = """\
`c3d/<subject>/<sequence>.c3d`: every joint or marker of a walk, mm, in the world of the release (Z up). Missing:
residual -1. The first frame is the first instant of the skeleton in the release.

`ezc3d.c3d("c3d/<subject>/<sequence>.c3d")["data"]["points"]`
"""


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddWalk]:
    """Yield `add(walk, body)`."""
    folder.mkdir()

    def add(walk: ReleasedWalk, body: Body) -> None:
        rate, points = regular(body, walk.skeleton)
        path = folder / walk.subject / f"{walk.sequence}.c3d"
        path.parent.mkdir(exist_ok=True)
        write(path, rate, points * MILLIMETRES, body.joints)

    yield add


def write(path: Path, rate: float, points: Floats, joints: Sequence[str]) -> None:
    """Write points (N, J, 3) mm at frames of `rate` Hz; NaN is missing."""
    import ezc3d

    file = ezc3d.c3d()
    parameters = file["parameters"]["POINT"]
    parameters["RATE"]["value"] = [rate]
    parameters["UNITS"]["value"] = ["mm"]
    parameters["LABELS"]["value"] = list(joints)
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    data = np.ones((4, points.shape[1], len(points)))
    data[:3] = points.transpose(2, 1, 0)
    missing = np.isnan(points).any(axis=-1).T
    data[:3, missing] = np.nan
    file["data"]["points"] = data
    file["data"]["meta_points"]["residuals"] = np.where(missing, -1.0, 0.0)[None]
    file.write(str(path))
