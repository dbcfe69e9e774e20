"""TRC, the text format of marker tracks that OpenSim reads.

OUTPUTS  trc/<subject>/<sequence>.trc: mm, Y up
Layout as in OpenSim's TRCFileAdapter: a missing marker is three empty cells, and every row ends with a tab, since its
reader drops an empty cell at the end of a line.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np

from dior.arrays import Floats
from dior.release.exports.fixed_rate import AddWalk, file_per_walk
from dior.release.exports.recordings import Release

ABOUT = """\
`trc/<subject>/<sequence>.trc`: every joint or marker of a walk, mm, for OpenSim: X and Z are horizontal, Y is up
(X, Y, Z = x, z, -y of the release's world). Missing: empty. Time 0 is the first instant of the skeleton in the release.

`opensim.TimeSeriesTableVec3("trc/<subject>/<sequence>.trc")`
"""
KEYS = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames".split()


def writer(folder: Path, release: Release) -> AbstractContextManager[AddWalk]:
    """Yield `add(walk, body)`."""
    return file_per_walk(folder, ".trc", write)


def write(path: Path, rate: float, points: Floats, joints: Sequence[str]) -> None:
    """Write points (N, J, 3) mm at frames of `rate` Hz; NaN is missing."""
    path.write_text(text(path.name, rate, y_up(points), joints), encoding="utf-8")


def y_up(points: Floats) -> Floats:
    """Points (..., 3) of a world with Z up in one with Y up: turned by -90 degrees about x."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def text(name: str, rate: float, points: Floats, joints: Sequence[str]) -> str:
    """The file: points (N, J, 3) mm at frames of `rate` Hz."""
    frames, count = points.shape[:2]
    values = (f"{rate:g}", f"{rate:g}", frames, count, "mm", f"{rate:g}", 1, frames)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{name}",
        "\t".join(KEYS),
        "\t".join(map(str, values)),
        "Frame#\tTime\t" + "".join(f"{joint}\t\t\t" for joint in joints),
        "\t\t" + "".join(f"X{i}\tY{i}\tZ{i}\t" for i in range(1, count + 1)),
        "",
    ]
    missing = np.any(np.isnan(points), axis=-1)
    whole = "%d\t%.6f\t" + "%.3f\t" * (3 * count)
    flat = np.where(missing[..., None], np.nan, points).reshape(frames, -1).tolist()
    for i in range(frames):
        if not missing[i].any():
            lines.append(whole % (i + 1, i / rate, *flat[i]))
            continue
        cells = ["\t" if number != number else f"{number:.3f}\t" for number in flat[i]]
        lines.append(f"{i + 1}\t{i / rate:.6f}\t" + "".join(cells))
    return "\n".join(lines) + "\n"
