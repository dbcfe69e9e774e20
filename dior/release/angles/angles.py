"""`dior angles`: joint angles of walks by OpenSim's inverse kinematics, with standard errors.

INPUTS   a project whose workflow has run: its tables `skeletons_3d` below results/
OUTPUTS  a new folder with, of each walk, <sequence>.csv (a row an instant: every angle and its sigma, degrees), .mot
         (the angles, degrees, and where the pelvis is, m), .osim (the model of that body) and .trc (its points)
OpenSim's world: metres (TRC: mm), Y up, X, Y, Z = x, z, -y of dior's. Model, names and signs: inverse.py.
"""

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.errors import DiorError, many
from dior.gait.tracks import REFINED_S
from dior.geometry.covariance import point_covariance
from dior.progress import reporting
from dior.project import project as projects
from dior.release.angles import inverse
from dior.release.angles.draws import drawn
from dior.release.angles.segments import skeleton_of
from dior.release.exports import trc
from dior.release.exports.fixed_rate import regular
from dior.release.exports.recordings import Body
from dior.tables import tables
from dior.tables.files import folder_written_whole, write_text
from dior.tables.tables import Column

NEEDS = "`dior angles` needs OpenSim; install it: pip install -e '.[angles]'"
# chosen: of ten draws a sigma is known to a quarter, and they take about twice as long as the angles themselves
DRAWS = 10
DRAWN_HZ = 25.0


@dataclass(frozen=True, eq=False)
class Walk:
    """Frames at `rate` Hz from `stamp_ns` on: points (T, J, 3) m of `names`, Z up, NaN where missing; `covariance`
    (T, J, 3, 3) m^2, NaN where nobody knows it, `lasting` (T, J) and `noise_time_s` as `draws.drawn` has them."""

    rate: float
    stamp_ns: int
    names: tuple[str, ...]
    points: Floats
    covariance: Floats
    lasting: Floats
    noise_time_s: float


@dataclass(frozen=True, eq=False)
class Angles:
    """Angles (T,) degrees and their `sigma` by name; the pelvis' `shifts` (T,) m."""

    degrees: dict[str, Floats]
    sigma: dict[str, Floats]
    shifts: dict[str, Floats]


def run(project: Path, sequences: list[str] | None = None, *, out: Path) -> None:
    """Write joint angles of walks of a project, with what the errors of the 3D leave open.

    `project`: folder that holds config/; `sequences`: the walks, all if none is named; `out`: folder to write, which
    must not be there yet.
    Raises DiorError where OpenSim is not installed, for a sequence that is not there or has no 3D, and where no walk
    has legs and a pelvis.
    """
    quiet_opensim()
    if os.path.lexists(out):
        raise DiorError(f"{out}: is there already; name a folder that is not")
    found = projects.load(project)
    chosen = {name: found.root / found.skeleton_table(name) for name in found.named(sequences)}
    for name, path in chosen.items():
        if not path.is_file():
            raise DiorError(f"{path}: is not there, so {name} has no 3D; run the workflow first")
    said = []
    with folder_written_whole(out) as folder:
        for name, path in chosen.items():
            try:
                said.append(f"{out}/{name}.csv: {write(folder, name, read(path))}")
            except DiorError as error:
                if sequences:
                    raise DiorError(f"{name}: {error}") from None
                print(f"{name}: {error}", file=sys.stderr)
        if not said:
            raise DiorError(f"{project}: no walk has joint angles; the lines before say why")
    print("\n".join(said))


def quiet_opensim() -> None:
    """Keep OpenSim from writing its log into the folder that somebody is in. Raises DiorError where it is missing."""
    try:
        import opensim
    except ImportError:
        raise DiorError(NEEDS) from None
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")


def read(path: AnyPath) -> Walk:
    """The 3D of a table `skeletons_3d`. Raises DiorError for stamps that are on no grid."""
    table = tables.read(path, "skeletons_3d")
    points, names = tables.grid(table, "x", "y", "z")
    shape = points.shape[:2]
    stamps = table["stamp_ns"].reshape(shape)[:, 0]
    covariance = point_covariance(table, shape).reshape(*shape, 9)
    lasting = table["constant_share"].reshape(shape).astype(float)
    # what is known of a point goes with it onto the grid
    about = np.concatenate([points, covariance, lasting[..., None]], axis=-1)
    rate, about = regular(Body(tuple(names), stamps, about), path)
    told = tables.metadata(path).get("noise_time_s")
    covariance = about[..., 3:12].reshape(*about.shape[:2], 3, 3)
    noise_time_s = float(told) if told else REFINED_S
    return Walk(rate, int(stamps[0]), tuple(names), about[..., :3], covariance, about[..., 12], noise_time_s)


def write(folder: Path, name: str, walk: Walk) -> str:
    """Write the files of a walk called `name`; returns what is in them. Raises DiorError where there are no angles."""
    angles = angles_of(walk, name, folder)
    count = len(walk.points)
    seconds = np.arange(count) / walk.rate
    write_text(folder / f"{name}.mot", mot(name, seconds, angles.degrees | angles.shifts))
    columns = {"time_s": seconds, "stamp_ns": walk.stamp_ns + np.rint(1e9 * seconds).astype(np.int64)}
    write_text(folder / f"{name}.csv", csv(columns, angles))
    middle = [float(np.nanmedian(one)) for one in angles.sigma.values() if np.isfinite(one).any()]
    typical = f", sigma {np.median(middle):.1f} degrees in the median" if middle else ""
    return f"{many(len(angles.degrees), 'angle')} at {many(count, 'instant')}{typical}"


def angles_of(walk: Walk, name: str, folder: Path, draws: int = DRAWS) -> Angles:
    """`Angles` of a walk, whose model and points are written to `folder`. Raises DiorError where there are none."""
    values = _solved(walk.points, walk.names, walk.rate, name, folder)
    every = max(1, int(walk.rate / DRAWN_HZ))
    at = slice(None, None, every)
    random = np.random.default_rng(0)
    angles = [key for key in values if key not in inverse.SHIFTS]
    off: dict[str, list[Floats]] = {key: [] for key in angles}
    with TemporaryDirectory() as part:
        for _ in reporting(range(draws), draws, "draws", name):
            points = drawn(random, walk.rate, walk.points, walk.covariance, walk.lasting, walk.noise_time_s)
            found = _solved(points[at], walk.names, walk.rate / every, name, Path(part))
            for key in angles:
                off[key].append((found[key] - values[key][at] + 180.0) % 360.0 - 180.0)
    times = np.arange(len(walk.points), dtype=float)
    sigma = {key: _between(times, times[at], _spread(off[key]), values[key]) for key in angles}
    return Angles({key: values[key] for key in angles}, sigma, {key: values[key] for key in inverse.SHIFTS})


def _solved(points: Floats, names: Sequence[str], rate: float, name: str, folder: Path) -> dict[str, Floats]:
    """Angles (T,) degrees and shifts m of points (T, J, 3) m, Z up; writes `name`.trc and .osim."""
    up = trc.y_up(points)
    skeleton = skeleton_of(up, names)
    used = [marker for segment in skeleton.segments for marker in segment.markers]
    of = [list(names).index(marker) for marker in used]
    path = folder / f"{name}.trc"
    write_text(path, trc.text(path.name, rate, 1000 * up[:, of], used))
    model = inverse.model_of(skeleton, name)
    model.printToXML(str(folder / f"{name}.osim"))
    known = np.isfinite(up[:, of])
    seen = {marker: np.asarray(known[:, i].all(axis=-1)) for i, marker in enumerate(used)}
    return inverse.solved(skeleton, model, path, seen)


def _spread(off: list[Floats]) -> Floats:
    """Standard deviation (D,) of draws (D,), NaN where one lacks."""
    return np.asarray(np.std(off, axis=0, ddof=1)) if len(off) > 1 else np.full_like(off[0], np.nan)


def _between(times: Floats, at: Floats, sigma: Floats, values: Floats) -> Floats:
    """`sigma` of the frames `at` at all `times` (T,) where there are values (T,)."""
    known = np.isfinite(sigma)
    if not known.any():
        return np.full(len(times), np.nan)
    return np.where(np.isfinite(values), np.interp(times, at[known], sigma[known]), np.nan)


def mot(name: str, seconds: Floats, columns: Mapping[str, Floats]) -> str:
    """A motion file of OpenSim: coordinates (T,) by name; nan where not known."""
    head = [name, "version=1", f"nRows={len(seconds)}", f"nColumns={len(columns) + 1}", "inDegrees=yes", "endheader"]
    lines = ["\t".join(["time", *columns])]
    lines += ["\t".join(f"{value:.6f}" for value in row) for row in zip(seconds, *columns.values(), strict=True)]
    return "\n".join([*head, *lines]) + "\n"


def csv(columns: Mapping[str, Column], angles: Angles) -> str:
    """A row an instant: `columns`, then each angle and its sigma, degrees; empty where not known."""
    keys = [word for key in angles.degrees for word in (key, f"{key}_sigma")]
    cells = [one for key in angles.degrees for one in (angles.degrees[key], angles.sigma[key])]
    lines = [",".join([*columns, *keys])]
    for i, (time, stamp) in enumerate(zip(*columns.values(), strict=True)):
        row = [f"{one[i]:.3f}" if np.isfinite(one[i]) else "" for one in cells]
        lines.append(",".join([f"{time:.6f}", str(stamp), *row]))
    return "\n".join(lines) + "\n"
