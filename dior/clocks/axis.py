"""One time axis for all recordings of a sequence, and interpolation on it.

t = (stamp_ns - t0_ns)/1e9 * (1 + 1e-6 drift_ppm) + offset_s (design, section 8), in seconds: after the first stored
C3D frame indoors, the time of the reference camera outdoors.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table, Texts
from dior.errors import DiorError
from dior.geometry.covariance import point_covariance
from dior.tables import tables

# Hz, of cameras as they are sold; 29.97 and 30, 59.94 and 60 are a part in 1000 apart, so a rate counts as the standard
# one within less than half of that
RATES = np.array([15, 24, 25, 29.97, 30, 50, 59.94, 60, 90, 100, 120])
SAME_RATE = 4e-4
SAME_TIME_S = 1e-6  # chosen: above the rounding of stamps in ns, far below what a walker moves in

# a clock as it is used: offset_s, drift_ppm and its source (table `offsets`)
ClockValues: TypeAlias = tuple[float, float, str]
# what `bracket` gives: the frames before and after each query, and the weight of the later
Bracket: TypeAlias = tuple[Ints, Ints, Floats]


def nominal_fps(stamps_ns: Ints) -> float:
    """Rate (Hz) of a recording from its stamps (F,) ns, F > 1: by the median period, or the standard rate near it."""
    fps = 1e9 / np.median(np.diff(stamps_ns))
    standard = RATES[np.argmin(np.abs(RATES - fps))]
    return float(standard) if abs(standard / fps - 1) < SAME_RATE else round(float(fps), 3)


def bracket(times: Floats, queries: Floats, max_gap_s: float) -> Bracket:
    """Frames around each query: indices before and after (Q,), -1 for none, and the weight (Q,) of the later.

    `times` (F,) s, in any order: a picture may be recorded after a later one. A query between frames further apart than
    `max_gap_s` has none (a drop), nor has one outside the recording. A query within a microsecond
    of a frame is that frame, with weight 0.
    """
    times, queries = np.asarray(times, float), np.asarray(queries, float)
    order = None if (np.diff(times) >= 0).all() else np.argsort(times, kind="stable")
    times = times if order is None else times[order]
    after = np.searchsorted(times, queries)
    nearest = np.clip(after, 0, len(times) - 1)
    nearest = np.where(
        np.abs(times[np.maximum(nearest - 1, 0)] - queries) < np.abs(times[nearest] - queries),
        np.maximum(nearest - 1, 0),
        nearest,
    )
    exact = np.abs(times[nearest] - queries) < SAME_TIME_S
    before, after = np.clip(after - 1, 0, len(times) - 1), np.clip(after, 0, len(times) - 1)
    gap = times[after] - times[before]
    inside = (queries > times[0]) & (queries < times[-1]) & (gap <= max_gap_s)
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(gap > 0, (queries - times[before]) / gap, 0.0)
    before = np.where(exact, nearest, np.where(inside, before, -1))
    after = np.where(exact, nearest, np.where(inside, after, -1))
    weight = np.where(exact | (before < 0), 0.0, weight)
    if order is not None:
        before, after = (np.where(each < 0, -1, order[each]) for each in (before, after))
    return before, after, weight


def blend(values: Floats, before: Ints, after: Ints, weight: Floats) -> Floats:
    """Values (F, ...) at bracketed queries (Q, ...): linear, NaN where there is no bracket or an end is missing."""
    values = np.asarray(values, float)
    w = weight.reshape(-1, *(1,) * (values.ndim - 1))
    # in place: what is interpolated is large, and memory that is new costs more than the sums
    mixed, later = values[before], values[after]
    mixed *= 1 - w
    later *= w
    mixed += later
    mixed[before < 0] = np.nan
    return mixed


def along_curve(times: Floats, values: Floats, slopes: Floats, where: Bracket) -> Floats:
    """As `blend` of values (F, ...) at `times` (F,) s, along the cubic that has the `slopes` (F, ...) per second, too.

    A foot that lands slows down by 30 m/s^2: half way between two pictures at 30 Hz a straight line is 4 mm beside it.
    """
    before, after, weight = where
    straight = blend(values, *where)
    w = weight.reshape(-1, *(1,) * (straight.ndim - 1))
    step = (times[after] - times[before]).reshape(w.shape)
    rise = values[after] - values[before]
    bend = (1 - w) * (step * slopes[before] - rise) + w * (rise - step * slopes[after])
    curve: Floats = straight + w * (1 - w) * bend
    return curve


def sample(times: Floats, values: Floats, queries: Floats, max_gap_s: float) -> Floats:
    """Values (F, ...) recorded at `times` (F,) s, interpolated at `queries` (Q,) s; never across a drop."""
    return blend(values, *bracket(times, queries, max_gap_s))


def instants(fps: float, last_s: float) -> Floats:
    """Times (I,) s of the regular grid 0, 1/fps, ... that ends at or before `last_s`."""
    return np.arange(int(np.floor(last_s * fps + 1e-6)) + 1) / fps


def start_ns(frames: Table, mocap: Table | None = None) -> int:
    """t0 of a sequence (ns): the first instant of its `mocap` (a skeletons_3d table), which ingest has put on the
    trigger log's clock or else the pictures'; without mocap the earliest picture stamp of all cameras."""
    return int((frames if mocap is None else mocap)["stamp_ns"].min())


def rates(frames: Table, cameras: Sequence[str]) -> tuple[dict[str, float], float]:
    """Nominal frame rate (Hz) of each camera, by name, and that of the instants: the first camera's by name."""
    own = {}
    for camera in cameras:
        stamps = frames["stamp_ns"][frames["camera"] == camera]
        if len(stamps) < 2:
            raise DiorError(f"camera {camera}: {len(stamps)} pictures in the frames table; is its topic right?")
        own[camera] = nominal_fps(stamps)
    return own, own[min(own)]


def camera_seconds(frames: Table, camera: str, t0_ns: int, clock: ClockValues | tuple[float, float]) -> Floats:
    """Times (F,) s of a camera's pictures on the sequence's axis; `clock` is (offset_s, drift_ppm, source)."""
    stamps = frames["stamp_ns"][frames["camera"] == camera]
    if not len(stamps):
        raise DiorError(f"camera {camera}: no pictures in the frames table; is its topic right?")
    return seconds(stamps, t0_ns, clock[0], clock[1])


def seconds(stamp_ns: Ints | int, t0_ns: int | np.int64, offset_s: float = 0.0, drift_ppm: float = 0.0) -> Floats:
    """Time (...,) s of header stamps (...,) int64 ns.

    The subtraction is done on integers: a stamp since 1970 as a float64 is only good to 0.2 us.
    """
    elapsed = np.asarray(stamp_ns, np.int64) - np.int64(t0_ns)
    return elapsed / 1e9 * (1 + 1e-6 * drift_ppm) + offset_s


@dataclass(frozen=True, eq=False)
class Moving:
    """A `skeletons_3d` table as arrays, made once for all cameras of a sequence.

    `joints` (J,); `stamps_ns` (I,) of the instants; `points` (I, J, 3) m; `status` (I, J); `skeleton`: the table.
    """

    joints: list[str]
    stamps_ns: Ints
    points: Floats
    status: Texts
    skeleton: Table

    @cached_property
    def grid(self) -> Floats:
        """Times (I,) s of the instants after the first."""
        return seconds(self.stamps_ns, self.stamps_ns[0])

    @cached_property
    def noise(self) -> Floats:
        """Covariance (I, J, 3, 3) m^2 of the points given the cameras."""
        return point_covariance(self.skeleton, self.points.shape[:2])

    @cached_property
    def velocity(self) -> Floats:
        """Velocities (I, J, 3) m/s, 0 where a joint has no neighbour in time."""
        if len(self.grid) < 2:
            return np.zeros(self.points.shape)
        ahead = np.diff(self.points, axis=0) / np.diff(self.grid)[:, None, None]
        nothing = np.full((1, *self.points.shape[1:]), np.nan)
        before, after = np.concatenate([nothing, ahead]), np.concatenate([ahead, nothing])
        both = np.where(np.isfinite(before) & np.isfinite(after), (before + after) / 2, np.fmax(before, after))
        return np.nan_to_num(both)

    def around(self, stamps_ns: Ints, offset_s: float, drift_ppm: float) -> Bracket:
        """`bracket` of pictures; other arguments as of `seconds`."""
        gap = 1.5 * np.median(np.diff(self.grid)) if len(self.grid) > 1 else SAME_TIME_S
        return bracket(self.grid, seconds(stamps_ns, self.stamps_ns[0], offset_s, drift_ppm), gap)

    def at_pictures(self, stamps_ns: Ints, offset_s: float, drift_ppm: float) -> tuple[Floats, Floats, Bools]:
        """At the pictures' stamps: points (F, J, 3) m, their velocities (F, J, 3) m/s, if a gap was bridged (F, J).

        Along the curve through the instants that has their velocities (`along_curve`), never across a missing one.
        Before the first instant and after the last there is nothing, and the velocity is 0.
        """
        before, after, weight = where = self.around(stamps_ns, offset_s, drift_ppm)
        filled = self.status == "gap_filled"
        bridged = (filled[before] | (filled[after] & (weight[:, None] > 0))) & (before >= 0)[:, None]
        points = along_curve(self.grid, self.points, self.velocity, where)
        return points, np.nan_to_num(blend(self.velocity, *where)), bridged

    def noise_at_pictures(self, stamps_ns: Ints, offset_s: float, drift_ppm: float) -> Floats:
        """Covariance (F, J, 3, 3) m^2 of the points at pictures, given the cameras.

        Interpolated as if the errors of neighbouring instants were the same: a detector's nearly are.
        """
        return blend(self.noise, *self.around(stamps_ns, offset_s, drift_ppm))

    def said_at_pictures(self, stamps_ns: Ints, offset_s: float, drift_ppm: float, word: str) -> Bools:
        """Whether an instant beside a picture says `word` of a joint in its status, (F, J)."""
        status = self.status == word
        after = np.searchsorted(self.grid, seconds(stamps_ns, self.stamps_ns[0], offset_s, drift_ppm))
        after = np.clip(after, 0, len(self.grid) - 1)
        found: Bools = status[after] | status[np.maximum(after - 1, 0)]
        return found


def moving(skeleton: Table) -> Moving:
    """`Moving` of a `skeletons_3d` table."""
    points, joints = tables.grid(skeleton, "x", "y", "z")
    shape = points.shape[:2]
    return Moving(
        joints, skeleton["stamp_ns"].reshape(shape)[:, 0], points, skeleton["status"].reshape(shape), skeleton
    )
