"""A walk in 3D as the tools of motion analysis want it: frames of a fixed rate.

INPUTS   `Body` of a walk (recordings.py): instants with stamps
OUTPUTS  rate (Hz) and points on a regular grid from the first instant, NaN where there is none
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.clocks.axis import nominal_fps
from dior.errors import DiorError
from dior.release.exports.recordings import Body, ReleasedWalk

# frames that a stamp may be off the grid of the rate; chosen: half of where it would be the next frame's
OFF_GRID = 0.25
# what a format about walks does with each walk and its body
AddWalk: TypeAlias = Callable[[ReleasedWalk, Body], None]
# writes a file at a path: rate (Hz), points (N, J, 3) mm, NaN where there is none, names of the joints
WriteWalk: TypeAlias = Callable[[Path, float, Floats, Sequence[str]], None]


@contextmanager
def file_per_walk(folder: Path, suffix: str, write: WriteWalk) -> Iterator[AddWalk]:
    """Yield `add(walk, body)`, which writes `<subject>/<sequence><suffix>` below the new `folder`."""
    folder.mkdir()

    def add(walk: ReleasedWalk, body: Body) -> None:
        rate, points = regular(body, walk.skeleton)
        path = folder / walk.subject / f"{walk.sequence}{suffix}"
        path.parent.mkdir(exist_ok=True)
        write(path, rate, points * 1000.0, body.joints)

    yield add


def regular(body: Body, where: AnyPath) -> tuple[float, Floats]:
    """Rate (Hz) and points (N, J, 3) m at frames 0, 1, ... of it, from the first instant to the last.

    Instants that lack are NaN. Raises DiorError for fewer than two instants and for stamps that are on no grid.
    """
    stamps = body.stamp_ns
    if len(stamps) < 2:
        raise DiorError(f"{where}: {len(stamps)} instants; a walk in 3D needs two to have a rate")
    elapsed = (stamps - stamps[0]) / 1e9
    rate = nominal_fps(stamps)
    # a standard rate that is half a frame off in the end is not the rate of these stamps
    slots = np.rint(elapsed * rate).astype(int)
    if np.abs(elapsed * rate - slots).max() > OFF_GRID:
        rate = round(float(1e9 / np.median(np.diff(stamps))), 6)
        slots = np.rint(elapsed * rate).astype(int)
    if np.abs(elapsed * rate - slots).max() > OFF_GRID or (np.diff(slots) < 1).any():
        raise DiorError(f"{where}: its stamps are not on a grid of {rate} Hz; is the clock of its recording right?")
    points = np.full((slots[-1] + 1, *body.points.shape[1:]), np.nan)
    points[slots] = body.points
    return rate, points
