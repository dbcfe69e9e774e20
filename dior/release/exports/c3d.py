"""C3D, the binary format of motion capture.

OUTPUTS  c3d/<subject>/<sequence>.c3d: mm, Z up, residual -1 where a point is missing
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np

from dior.arrays import Floats
from dior.release.exports.fixed_rate import AddWalk, file_per_walk
from dior.release.exports.recordings import Release
from dior.tables.files import check_written

ABOUT = """\
`c3d/<subject>/<sequence>.c3d`: every joint or marker of a walk, mm, in the world of the release (Z up). Missing:
residual -1. The first frame is the first instant of the skeleton in the release.

`ezc3d.c3d("c3d/<subject>/<sequence>.c3d")["data"]["points"]`
"""


def writer(folder: Path, release: Release) -> AbstractContextManager[AddWalk]:
    """Yield `add(walk, body)`."""
    return file_per_walk(folder, ".c3d", write)


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
    check_written(path, 16 * missing.size)
