"""Metric facts of a session: what is known in metres beside the pixels, each ONE measurement with its own sigma.

INPUTS   numbers and names from session.yaml, the points that the fact speaks of
OUTPUTS  functions of (cameras, points, noise) to a `reduced.Row`: residuals and derivatives, divided by the sigma

A length between joints is the mean over the frames, so that 400 frames weigh as much as one. World in metres, Z up,
floor at Z = 0. A camera's error as in `dior.geometry.covariance`.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints
from dior.body import proportions
from dior.body.proportions import STATURE_SEGMENTS, STATURE_SHARE
from dior.calibrate.bundle.bundle import Prior
from dior.calibrate.bundle.reduced import Row, RowOf
from dior.calibrate.bundle.uncertainty import Tracks
from dior.errors import DiorError, nearest
from dior.geometry import covariance
from dior.geometry.camera import Camera, project
from dior.geometry.rotation import rotvec

# People differ by 1-2 % of their height in what is left (neck, head, foot), and a detector's hips and shoulders are
# not the anatomist's: together 2.5 % of the sum.
STATURE_SHARE_SIGMA = 0.02
FEWEST_MOMENTS = 10  # chosen: instants that a mean length needs; a third of the noise of one is left then
# chosen: of the instants of a walk at which a joint of the foot counts as standing; a foot stands in 60 % of a stride
# (Winter), so that a quarter leaves room for slopes of the noise
STANCE_SHARE = 0.25
# how high the joints of a standing foot are above the floor, m
SOLE_M = dict.fromkeys(("left_heel", "right_heel", "left_foot_index", "right_foot_index"), proportions.SOLE_M)


# what an adjusted world makes of a fact: of (cameras, points, noise) to its value
Measure: TypeAlias = Callable[[Sequence[Camera], Floats, Floats], float]
# indices (T, ka) and (T, kb) of the points whose means are the ends, and the weight
Segment: TypeAlias = tuple[Ints, Ints, float]


@dataclass(frozen=True)
class Fact:
    """A named fact; `row` is its function, `known` and `sigma` (in `unit`) what was measured.

    `measured`: a function of (cameras, points, noise) to what the adjusted world makes of it, None where it is no one
    number.
    """

    name: str
    row: RowOf
    known: float = np.nan
    sigma: float = np.nan
    measured: Measure | None = None
    unit: str = "m"

    def __call__(self, cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        return self.row(cameras, points, noise)


def placed(view: int, prior: Prior) -> Fact:
    """A camera's measured position and its rotation, from a `bundle.Prior`."""

    def row(cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        D = np.zeros((6, 6 * len(cameras)))
        D[:3, 6 * view : 6 * view + 3] = np.eye(3) / prior.sigma_rad
        D[3:, 6 * view + 3 : 6 * view + 6] = np.eye(3) / prior.sigma_m
        turn = rotvec(prior.wRc.T @ cameras[view].wRc)
        shift = cameras[view].centre - prior.position
        return Row.of_cameras(np.concatenate([turn / prior.sigma_rad, shift / prior.sigma_m]), D)

    return Fact(f"position of camera {view}", row)


def between_cameras(one: int, other: int, length_m: float, sigma_m: float, name: str = "") -> Fact:
    """The tape between two cameras."""

    def row(cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        gap = cameras[one].centre - cameras[other].centre
        length = np.linalg.norm(gap)
        D = np.zeros((1, 6 * len(cameras)))
        D[0, 6 * one + 3 : 6 * one + 6] = gap / length / sigma_m
        D[0, 6 * other + 3 : 6 * other + 6] = -gap / length / sigma_m
        return Row.of_cameras([(length - length_m) / sigma_m], D)

    def measured(cameras: Sequence[Camera], points: Floats, noise: Floats) -> float:
        return float(np.linalg.norm(cameras[one].centre - cameras[other].centre))

    return Fact(name or f"distance of cameras {one} and {other}", row, length_m, sigma_m, measured)


def to_point(view: int, points_of: ArrayLike, length_m: float, sigma_m: float, name: str = "") -> Fact:
    """The tape from a camera to a named point, the mean over its pictures; `points_of` (k,) points."""
    index = np.asarray(points_of, int)

    def row(cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        gap = points[index] - cameras[view].centre
        length = np.linalg.norm(gap, axis=1)
        toward = gap / length[:, None] / len(index) / sigma_m
        D = np.zeros((1, 6 * len(cameras)))
        D[0, 6 * view + 3 : 6 * view + 6] = -toward.sum(axis=0)
        residual = [(length.mean() - length_m) / sigma_m]
        return Row(np.array(residual), D, index, toward[None], np.zeros((1, 3 * len(cameras))))

    def measured(cameras: Sequence[Camera], points: Floats, noise: Floats) -> float:
        return float(np.linalg.norm(points[index] - cameras[view].centre, axis=1).mean())

    return Fact(name, row, length_m, sigma_m, measured)


def length(segments: Sequence[Segment], length_m: float, sigma_m: float, name: str = "") -> Fact:
    """A length that is the weighted sum of segments, each the mean over its frames.

    `segments`: (a (T, ka), b (T, kb), weight) with the indices of the points whose means are its ends. The noise of
    the points makes a distance too long by its variance across the segment over twice the length; that is subtracted.
    """
    index = np.concatenate([part.ravel() for a, b, _ in segments for part in (a, b)]).astype(int)

    def measure(points: Floats, noise: Floats) -> tuple[float, Floats]:
        found, by_points = 0.0, []
        for a, b, weight in segments:
            gap = points[b].mean(axis=1) - points[a].mean(axis=1)
            size = np.linalg.norm(gap, axis=1)
            along = gap / size[:, None]
            C = noise[b].mean(axis=1) / b.shape[1] + noise[a].mean(axis=1) / a.shape[1]
            across = np.trace(C, axis1=1, axis2=2) - np.einsum("ta,tab,tb->t", along, C, along)
            found += weight * np.mean(size - np.minimum(across / (2 * size), 0.2 * size))
            along = weight * along / len(a)
            by_points += [np.repeat(-along / a.shape[1], a.shape[1], axis=0)]
            by_points += [np.repeat(along / b.shape[1], b.shape[1], axis=0)]
        return found, np.concatenate(by_points)

    def row(cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        found, D = measure(points, noise)
        residual = np.array([(found - length_m) / sigma_m])
        none = np.zeros((1, 6 * len(cameras)))
        return Row(residual, none, index, D[None] / sigma_m, np.zeros((1, 3 * len(cameras))))

    return Fact(name, row, length_m, sigma_m, lambda cameras, points, noise: float(measure(points, noise)[0]))


def stature(segments: Sequence[Segment], height_m: float, height_sigma_m: float, name: str = "") -> Fact:
    """A subject's height, by `STATURE_SEGMENTS`."""
    sigma = np.hypot(STATURE_SHARE * height_sigma_m, STATURE_SHARE_SIGMA * height_m)
    return length(segments, STATURE_SHARE * height_m, sigma, name)


def tag(view: int, corners: ArrayLike, world: ArrayLike, sigma_px: float, name: str = "") -> Fact:
    """The corners (4, 2) recorded px of a tag whose corners are at `world` (4, 3) m, seen by one camera."""
    corners, world = np.asarray(corners, float), np.asarray(world, float)

    def row(cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        camera = cameras[view]
        residual = (project(camera, world)[0] - corners) / sigma_px
        _, by_camera = covariance.projection(camera, world)
        D = np.zeros((residual.size, 6 * len(cameras)))
        D[:, 6 * view : 6 * view + 6] = by_camera.reshape(-1, 6) / sigma_px
        lens = np.zeros((residual.size, 3 * len(cameras)))
        i = camera.intrinsics
        by_lens = np.zeros((*residual.shape, 3))
        by_lens[..., 0] = (project(camera, world)[0] - (i.cx, i.cy)) / sigma_px
        by_lens[..., 0, 1], by_lens[..., 1, 2] = i.fx / sigma_px, i.fy / sigma_px
        lens[:, 3 * view : 3 * view + 3] = by_lens.reshape(-1, 3)
        return Row.of_cameras(residual.ravel(), D, lens)

    def off(cameras: Sequence[Camera], points: Floats, noise: Floats) -> float:
        return float(np.sqrt(np.mean((project(cameras[view], world)[0] - corners) ** 2)))

    return Fact(name or f"corners of the tag in camera {view}, off by", row, 0.0, sigma_px, off, "px")


def floor(index: ArrayLike, above_m: ArrayLike, sigma_m: float, sigma_rad: float, name: str = "floor") -> Fact:
    """Feet on the floor: the plane through points `index` (k,), each `above_m` (k,) above it, is Z = 0.

    Three measurements: its height in the middle of the points with `sigma_m`, its slope along the two main directions
    in which they are spread with `sigma_rad`, where they are spread at all (by the height's sigma beyond it).
    """
    index, above = np.asarray(index, int), np.broadcast_to(above_m, np.shape(index)).astype(float)

    def row(cameras: Sequence[Camera], points: Floats, noise: Floats) -> Row:
        at = points[index]
        flat = at[:, :2] - at[:, :2].mean(axis=0)
        _, spread, axes = np.linalg.svd(flat, full_matrices=False)
        height = at[:, 2] - above
        weights = [np.full(len(index), 1 / len(index) / sigma_m)]
        for axis, size in zip(axes, spread / np.sqrt(len(index)), strict=True):
            along = flat @ axis
            sigma = np.hypot(sigma_rad, sigma_m / max(size, 1e-6))
            weights.append(along / max(along @ along, 1e-12) / sigma)
        W = np.array(weights)
        by_points = np.zeros((3, len(index), 3))
        by_points[..., 2] = W
        return Row(W @ height, np.zeros((3, 6 * len(cameras))), index, by_points, np.zeros((3, 3 * len(cameras))))

    def measured(cameras: Sequence[Camera], points: Floats, noise: Floats) -> float:
        return float((points[index, 2] - above).mean())

    return Fact(name, row, 0.0, sigma_m, measured)


@dataclass(frozen=True, eq=False)
class Marked:
    """Points that a person marked in several cameras: `uv` (V, M, 2) recorded px, names (M,) and pictures (M,).

    Each picture gives points of its own: the bar may have been moved in between.
    """

    uv: Floats
    names: tuple[str, ...]
    moments: tuple[int | str, ...]
    sigma_px: float = 1.0


@dataclass(frozen=True, eq=False)
class About:
    """What facts are made from: names of the cameras, `uncertainty.Tracks` of the first points, which of these are
    known (N,), all points (N + M, 3) m, the last ones `marked`."""

    cameras: list[str]
    tracks: Tracks | None
    known: Bools
    points: Floats
    marked: Marked | None
    where: str

    def wrong(self, key: str, text: str) -> DiorError:
        """The error of a fact that session.yaml states under `key`."""
        return DiorError(f"{self.where}, session.yaml, {key}: {text}")

    def view(self, name: str, key: str) -> int:
        if name not in self.cameras:
            raise self.wrong(
                key, f"'{name}' is no close camera of {', '.join(self.cameras)}{nearest(name, self.cameras)}"
            )
        return self.cameras.index(name)

    def of_mark(self, name: str, key: str) -> dict[int | str, int]:
        """Indices of the marked point `name`, by sequence."""
        names, moments = ((), ()) if self.marked is None else (self.marked.names, self.marked.moments)
        if name not in names:
            text = "is no close camera and " if key == "distances" else "is "
            close = nearest(name, [*names, *self.cameras] if key == "distances" else names)
            raise self.wrong(
                key,
                f"'{name}' {text}marked in fewer than two close cameras in the same sequence; mark it as joint "
                f"'{name}' in their <camera>.marks.csv{close}",
            )
        at = [i for i, other in enumerate(names) if other == name]
        return {moments[i]: len(self.known) + i for i in at}

    def of_joints(
        self, groups: Sequence[Sequence[str]], key: str, sequences: Collection[int] | None = None
    ) -> list[Ints]:
        """Indices [(T, k)] of groups of joints at the moments at which all of them are known."""
        if self.tracks is None:
            raise self.wrong(key, "a fact about joints needs their names")
        wanted = [name for group in groups for name in group]
        for name in wanted:
            if name not in self.tracks.names:
                raise self.wrong(key, f"the detector has no joint '{name}'{nearest(name, self.tracks.names)}")
        use = self.known if sequences is None else self.known & np.isin(self.tracks.sequence, list(sequences))
        index = np.full((int(self.tracks.moment.max()) + 1, len(self.tracks.names)), -1)
        index[self.tracks.moment[use], self.tracks.joint[use]] = np.flatnonzero(use)
        columns = index[:, [list(self.tracks.names).index(name) for name in wanted]]
        rows = columns[(columns >= 0).all(axis=1)]
        if len(rows) < FEWEST_MOMENTS:
            whose = "" if sequences is None else " of the subject's walks"
            raise self.wrong(
                key,
                f"{', '.join(wanted)} are seen together by two cameras at {len(rows)} instants{whose}, at least "
                f"{FEWEST_MOMENTS} are needed; choose other joints, or name more instants in `adjust`",
            )
        return np.split(rows, np.cumsum([len(group) for group in groups])[:-1], axis=1)


@dataclass(frozen=True)
class KeypointDistance:
    """The distance of two joints of a subject; `sequences` are his, by number (None: all)."""

    joints: tuple[str, str]
    length_m: float
    sigma_m: float
    sequences: tuple[int, ...] | None = None

    def made(self, about: About) -> list[Fact]:
        a, b = about.of_joints([(self.joints[0],), (self.joints[1],)], "keypoint_distance", self.sequences)
        return [length([(a, b, 1.0)], self.length_m, self.sigma_m, f"distance {self.joints[0]} to {self.joints[1]}")]


@dataclass(frozen=True)
class Stature:
    """The height of a subject."""

    height_m: float
    sigma_m: float
    sequences: tuple[int, ...] | None = None

    def made(self, about: About) -> list[Fact]:
        segments: list[Segment] = []
        for one, other, weight in STATURE_SEGMENTS:
            a, b = about.of_joints([one, other], "stature", self.sequences)
            segments.append((a, b, weight))
        name = f"thigh, shank and trunk of the stature of {self.height_m:g} m"
        return [stature(segments, self.height_m, self.sigma_m, name)]


@dataclass(frozen=True)
class Distance:
    """The tape between two cameras, or a camera and a marked point."""

    between: tuple[str, str]
    length_m: float
    sigma_m: float

    def made(self, about: About) -> list[Fact]:
        name = f"distance {self.between[0]} to {self.between[1]}"
        first = about.view(self.between[0], "distances")
        if self.between[1] in about.cameras:
            second = about.view(self.between[1], "distances")
            return [between_cameras(first, second, self.length_m, self.sigma_m, name)]
        seen = list(about.of_mark(self.between[1], "distances").values())
        return [to_point(first, seen, self.length_m, self.sigma_m, name)]


@dataclass(frozen=True)
class ScaleBar:
    """A bar whose two ends are marked; each pair of names in `ends` is a place where it lay."""

    ends: tuple[tuple[str, str], ...]
    length_m: float
    sigma_m: float

    def made(self, about: About) -> list[Fact]:
        pairs = []
        for names in self.ends:
            one, other = (about.of_mark(name, "scale_bar") for name in names)
            pairs += [(one[moment], other[moment]) for moment in one if moment in other]
            if not set(one) & set(other):
                raise about.wrong(
                    "scale_bar", f"{' and '.join(names)} are marked in no sequence together; mark both ends in one"
                )
        a, b = np.array(pairs).T[..., None]
        name = f"scale bar {self.ends[0][0]} to {self.ends[0][1]}"
        return [length([(a, b, 1.0)], self.length_m, self.sigma_m, name)]


@dataclass(frozen=True, eq=False)
class Tag:
    """A tag whose corners are at `world` (4, 3) m; `corners` (4, 2) recorded px by the camera that sees it, each with
    `sigma_px`."""

    world: Floats
    corners: dict[str, Floats]
    sigma_px: float

    def made(self, about: About) -> list[Fact]:
        return [
            tag(about.view(name, "tag"), seen, self.world, self.sigma_px, f"corners of the tag in {name}, off by")
            for name, seen in self.corners.items()
        ]


@dataclass(frozen=True)
class Floor:
    """The feet stand on Z = 0: joints by their height above the sole, m; sigmas of the height (m) and slope (rad)."""

    sigma_m: float = 0.02
    sigma_rad: float = 0.02

    def made(self, about: About) -> list[Fact]:
        index, above = [], []
        for name, height in SOLE_M.items():
            if about.tracks is None or name not in about.tracks.names:
                continue
            at = np.flatnonzero(about.known & (about.tracks.joint == list(about.tracks.names).index(name)))
            if len(at) >= FEWEST_MOMENTS:
                index.append(lowest(about.points[at], at))
                above.append(np.full(len(index[-1]), height))
        if not index:
            raise about.wrong(
                "floor", f"none of {', '.join(SOLE_M)} is seen by two cameras, so it says nothing; leave it out"
            )
        return [floor(np.concatenate(index), np.concatenate(above), self.sigma_m, self.sigma_rad)]


Known: TypeAlias = KeypointDistance | Stature | Distance | ScaleBar | Tag | Floor


def lowest(points: Floats, index: Ints) -> Ints:
    """Those of `index` (k,) whose points (k, 3) are on the floor: the lowest quarter beside a plane fitted to them."""
    kept = np.ones(len(points), bool)
    for _ in range(3):
        A = np.c_[np.ones(kept.sum()), points[kept, :2] - points[:, :2].mean(axis=0)]
        plane = np.linalg.lstsq(A, points[kept, 2], rcond=None)[0]
        above = points[:, 2] - np.c_[np.ones(len(points)), points[:, :2] - points[:, :2].mean(axis=0)] @ plane
        kept = above <= np.quantile(above, STANCE_SHARE)
    return index[kept]
