"""People followed through the room: bodies put together into paths, and paths into people.

INPUTS   `people_seen.Sighting`s of each instant, and the track of each detection in its camera
OUTPUTS  `Path`s of one body each, `Person`s of one path or several, the `Size` of a body
Somebody who comes back is the same person if he can have walked there and his stature is the same. World metres.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dior.arrays import Floats, Ints
from dior.body.people_seen import Sighting

MEMORY_S = 1.5  # a body that is not seen for longer is not followed; chosen, as of the tracks in one camera
KNOWN = 3  # a track that a path had so often is its own; chosen: half a second
HANDED_ON = 0.5  # chosen: see `paths_of`
HISTORY_S = 2.0  # of whose detections a body was; chosen: longer than people hide each other in passing
# a sighting that is so much taller or smaller than the `LAST` before, at least `FEWEST`, is not of the same body;
# chosen: far beyond the scatter of one body's, and a second
LAST, FEWEST, CHIMERA_M, CHIMERA_SCATTERS = 30, 6, 0.13, 5.0
# how far a body can be from where it was expected: at once, and more per second; chosen: a walker's change of pace
REACH_M, SPEED_M_S = 0.35, 1.5
ALONE_M = 0.8  # more for one view alone, whose foot is not always on the floor; chosen
WALKS_M_S = 4.0  # a person who comes back has not run faster in the meantime; chosen, a jog
# how well the stature of one body is known by the joints of a detector, beside its scatter, from one place and
# direction to others; of one view alone, m. Chosen, by simulated captures (`python -m benchmarks.which_person sizes`)
SAME_M, ALONE_SIGMA_M = 0.004, 0.05
# of what errors make bones longer to second order, how much they do, and how well that is known; chosen, by
# simulated captures: triangulation itself makes them shorter
LONGER, LONGER_SHARE = 0.7, 0.4
# of the statures of one body, at least, m; chosen, as of level `ideal`: few sightings may agree by chance
SCATTER_M = 0.015
# bound in scatters, and how good that is beside the mean where errors are normal (Huber, Robust Statistics, 1981)
HUBER, HUBER_EFFICIENCY = 1.345, 0.95
DIFFERENT = 3.0  # so many standard errors apart are two people; chosen
TOLD_M = 0.04  # people whose statures differ by so much, m, are told apart; chosen: shoes make half of it
# chosen: so much likelier one person must be than two whose statures differ by `TOLD_M`. Who comes where another has
# left is ten times as likely he as anybody else, so that it is less than what a choice between two who are there takes
SAME_ODDS = np.log(2.0)


@dataclass(eq=False)
class Path:
    """A body followed through the room, its first sighting first."""

    sightings: list[Sighting] = field(default_factory=list)

    @property
    def first(self) -> Sighting:
        return self.sightings[0]

    @property
    def last(self) -> Sighting:
        return self.sightings[-1]

    @property
    def together(self) -> list[Sighting]:
        """Sightings by several views (`together`)."""
        return together(self.sightings)


@dataclass(eq=False)
class Person:
    """Paths of one person; `sure`: by the body, not for want of a contradiction; `perhaps`: other sightings that may be
    his."""

    paths: list[Path]
    sure: bool = True
    perhaps: int = 0

    @property
    def sightings(self) -> list[Sighting]:
        return [one for path in self.paths for one in path.sightings]


def together(bodies: Sequence[Sighting]) -> list[Sighting]:
    """Sightings by several views; none where most are by one, so that the others are chance meetings."""
    several = [one for one in bodies if not one.alone]
    return several if len(several) > len(bodies) / 2 else []


def tracks_of(body: Sighting, track: Ints) -> set[tuple[int, int]]:
    """(view, track) of a body's detections; `track` (V, K, T)."""
    return {(v, int(track[v, who, body.t])) for v, who in enumerate(body.members.tolist()) if who >= 0}


def paths_of(found: Sequence[list[Sighting]], track: Ints, fps: float) -> list[Path]:
    """Bodies followed from instant to instant: those whose detections go on and that are where they can be.

    Where people hide each other, detections of two may meet in one body for a moment. So a body goes on with the path
    that had more of its detections' tracks several times in the last seconds; a track that another has had since counts
    half, since a camera that sees one person before the other does not notice that it was handed on. Where most views
    have another track than a moment ago, somebody else came into the others' line of sight; and a body that is not as
    tall as a path that had its tracks is not taken over by one that had fewer.
    """
    paths: list[Path] = []
    holder: dict[tuple[int, int], Path] = {}
    past = round(HISTORY_S * fps)
    for bodies in found:
        if not bodies:
            continue
        open_ = [path for path in paths if bodies[0].t - path.last.t <= MEMORY_S * fps]
        ways, refused = [], np.zeros(len(bodies))
        for i, path in enumerate(open_):
            before = Counter(one for body in path.sightings[-past:] for one in tracks_of(body, track))
            for j, body in enumerate(bodies):
                known = {one: min(before[one], KNOWN) / KNOWN for one in tracks_of(body, track) if one in before}
                off = _off(path, body, fps)
                if known and off <= 1 and not _exchanged(path.last, body, track):
                    had = sum(known.values())
                    if _as_tall(path, body):
                        shared = sum(part * (1.0 if holder[one] is path else HANDED_ON) for one, part in known.items())
                        ways.append((off - shared, i, j, had))
                    else:
                        refused[j] = max(refused[j], had)
        done: tuple[set[int], set[int]] = (set(), set())
        for _, i, j, had in sorted(ways):
            if i not in done[0] and j not in done[1] and had >= refused[j]:
                done[0].add(i)
                done[1].add(j)
                open_[i].sightings.append(bodies[j])
        paths += [Path([body]) for j, body in enumerate(bodies) if j not in done[1]]
        holder |= {one: path for path in paths if path.last in bodies for one in tracks_of(path.last, track)}
    return paths


def _exchanged(last: Sighting, body: Sighting, track: Ints) -> bool:
    """Whether most of the views that have both of two sightings have another track in the second."""
    one, other = dict(tracks_of(last, track)), dict(tracks_of(body, track))
    both = one.keys() & other.keys()
    return 2 * sum(one[view] != other[view] for view in both) > len(both)


def _as_tall(path: Path, body: Sighting) -> bool:
    """Whether a body is as tall as those before it on a path, as far as one sighting tells.

    Rays of two people that meet by chance meet too near or too far, and in somebody of another size.
    """
    before = [one.stature for one in path.sightings[-LAST:] if not one.alone and np.isfinite(one.stature)]
    if len(before) < FEWEST or body.alone or not np.isfinite(body.stature):
        return True
    tall = float(np.median(before))
    scatter = 1.4826 * float(np.median(np.abs(np.array(before) - tall)))
    return bool(abs(body.stature - tall) <= max(CHIMERA_M, CHIMERA_SCATTERS * scatter))


def _off(path: Path, body: Sighting, fps: float) -> float:
    """Horizontal distance of a body from where a path leads, over how far it can be."""
    last, seconds = path.last, (body.t - path.last.t) / fps
    expected = last.place
    before = next((one for one in path.sightings[-4:-1] if not one.alone), None)
    if before is not None and not last.alone and last.t > before.t:
        step = (last.place - before.place) / (last.t - before.t)
        expected = last.place + step * min(body.t - last.t, 2)
    reach = REACH_M + SPEED_M_S * seconds + ALONE_M * (last.alone + body.alone)
    return float(np.linalg.norm((body.place - expected)[:2]) / reach)


@dataclass(frozen=True)
class Size:
    """Stature of a body as its joints tell it, m, with its standard error `sigma_m`, infinite where it is not known;
    `longer_m` of it are what errors made longer, which was taken off."""

    stature_m: float
    sigma_m: float
    longer_m: float = 0.0

    def variance_to(self, other: "Size") -> float:
        """Variance (m^2) of the difference of two sizes of one body, seen by the same cameras."""
        # the same cameras make both longer
        alike = SAME_M**2 + (LONGER_SHARE * (self.longer_m - other.longer_m)) ** 2
        return self.sigma_m**2 + other.sigma_m**2 + alike


UNKNOWN = Size(np.nan, np.inf)


def mean_size(sizes: Sequence[Size]) -> Size:
    """The mean of several sizes of one body by their precision; unknown ones do not count."""
    known = [one for one in sizes if np.isfinite(one.sigma_m)]
    if not known:
        return UNKNOWN
    weight = np.array([one.sigma_m for one in known]) ** -2
    stature, longer = (weight / weight.sum()) @ np.array([(one.stature_m, one.longer_m) for one in known])
    return Size(float(stature), float(weight.sum() ** -0.5), float(longer))


def size_of(bodies: Sequence[Sighting]) -> Size:
    """The `Size` of some sightings of one body, by several views where they are.

    Sightings within a third of a second share a detector's error: so many are worth half.
    """
    several = [(one.stature, one.longer) for one in together(bodies) if np.isfinite(one.stature)]
    if several:
        tall, longer = np.array(several).T
        middle, scatter = _huber(tall)
        error = scatter * np.sqrt(2 / HUBER_EFFICIENCY / len(tall))
        shortened = LONGER * float(np.median(longer))
        return Size(middle - shortened, error, shortened)
    alone = [one.stature for one in bodies if one.alone and np.isfinite(one.stature)]
    return Size(float(np.median(alone)), ALONE_SIGMA_M) if alone else UNKNOWN


def _huber(values: Floats) -> tuple[float, float]:
    """Huber's mean of values (n,), and their scatter."""
    middle = float(np.median(values))
    scatter = max(1.4826 * float(np.median(abs(values - middle))), SCATTER_M)
    for _ in range(10):
        weight = np.minimum(1.0, HUBER * scatter / np.maximum(abs(values - middle), 1e-12))
        middle = float((weight * values).sum() / weight.sum())
    return middle, scatter


def people_of(paths: Sequence[Path], fps: float, known: Sequence[Person] = ()) -> list[Person]:
    """Paths put together into people, the longest first. A path that fits nobody, or two, is somebody of its own.

    `known`: people whom paths may fit as well.
    """
    people = list(known)
    for path in sorted(paths, key=lambda one: (-len(one.together), -len(one.sightings), one.first.t)):
        fits = [(person, sure) for person in people if (sure := _fits(person, path, fps)) is not None]
        if len(fits) == 1 and fits[0][1]:
            fits[0][0].paths.append(path)
        else:
            people.append(Person([path], sure=not fits))
            for person, _ in fits[:1] if len(fits) == 1 else ():
                person.perhaps += len(path.sightings)
    return people


def _fits(person: Person, path: Path, fps: float) -> bool | None:
    """Whether a path can be a person's: None for no, else whether the stature says so, too, or only does not object."""
    for other in person.paths:
        earlier, later = (other, path) if other.first.t < path.first.t else (path, other)
        last = _last_before(earlier, later)
        if last is None:
            return None
        reach = REACH_M + ALONE_M * (later.first.alone + last.alone)
        gap = (later.first.t - last.t - 1) / fps
        if np.linalg.norm((later.first.place - last.place)[:2]) > reach + WALKS_M_S * gap:
            return None
    return same(size_of(person.sightings), size_of(path.sightings))


def _last_before(earlier: Path, later: Path) -> Sighting | None:
    """The last sighting of a path before a later one begins, None where both are there at once.

    A path may go on for less than `KNOWN` sightings beside the one that took over, as where a detection of somebody
    else was taken for the body; not where several views see both at one instant, who are two people.
    """
    rest = [one for one in earlier.sightings if one.t >= later.first.t]
    taken = {one.t for one in later.sightings if not one.alone}
    if len(rest) >= KNOWN or len(rest) == len(earlier.sightings) or earlier.last.t >= later.last.t:
        return None
    return None if any(one.t in taken for one in rest if not one.alone) else earlier.sightings[-len(rest) - 1]


def same(one: Size, other: Size) -> bool | None:
    """Whether two sizes are of one body: None for no, else whether they say so, too, or only do not object."""
    apart, variance = abs(one.stature_m - other.stature_m), one.variance_to(other)
    if apart > DIFFERENT * np.sqrt(variance):
        return None
    # how much likelier one body is than two whose statures differ by TOLD_M
    return bool(TOLD_M * (TOLD_M - 2 * apart) >= 2 * variance * SAME_ODDS)


def at_once(path: Path, others: Sequence[Path]) -> bool:
    """Whether a path is there at the time of others."""
    ordered = (sorted((path, other), key=lambda one: one.first.t) for other in others)
    return any(_last_before(earlier, later) is None for earlier, later in ordered)
