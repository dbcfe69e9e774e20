"""Which of the people in the pictures is the subject of a recording: by where they are, their stature, and by hand.

INPUTS   placed cameras, the people of each view at every instant (`people_seen`), the subject's measured height, seeds
OUTPUTS  `Choice`: the subject's detection in every view, and the stretches that are somebody else's or cannot be told

Bodies are found a few times a second, followed through the room, and put together into people: somebody who comes back
is the same person if he can have walked there and his stature is the same. The subject is the one whom a person
pointed at; else who alone is there, or walks, or is there for most of the time, or is at times all that all cameras
see; else whose stature is the measured one. Where none of these tells, nobody is chosen: that two views of three agree
is no proof, since both may follow the same wrong person.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dior.arrays import Bools, Floats, Ints, Texts
from dior.body import people_seen
from dior.body.people_seen import Sighting
from dior.geometry.camera import Camera

PER_S = 6.0  # bodies are looked for so many times a second; chosen: a walker moves by 0.2 m meanwhile
MEMORY_S = 1.5  # a body that is not seen for longer is not followed; chosen, as of the tracks in one camera
KNOWN = 3  # a track that a path had so often is its own; chosen: half a second
HANDED_ON = 0.5  # chosen: see `_paths`
HISTORY_S = 2.0  # of whose detections a body was; chosen: longer than people hide each other in passing
# how far a body can be from where it was expected: at once, and more per second; chosen: a walker's change of pace
REACH_M, SPEED_M_S = 0.35, 1.5
ALONE_M = 0.8  # more for one view alone, whose foot is not always on the floor; chosen
WALKS_M_S = 4.0  # a person who comes back has not run faster in the meantime; chosen, a jog
LEAST_S = 0.5  # who is seen for less is nobody to choose; chosen: three sightings
# who is there for less than this share of another's time is passing by; chosen
PASSING = 0.5
# who stays within the one is not who was recorded walking, where another goes farther than the other, m; chosen: a sway
# and the errors of a place, and two steps in walks of a second
STANDS_M, GOES_M = 0.3, 0.5
# for so long without a break all cameras must see one person and nobody else. Chosen: a person who is hidden behind
# another in the one camera that follows him looked like that for 1.8 s in one of 20 walks
UNANIMOUS_S = 2.0
DOUBT = 0.25  # of the time that another view sees somebody else; chosen: more than detectors take a bystander
# how well a stature is known by the joints of a detector beside its scatter, m: between people, and of one who is seen
# by other views; against a tape measure, as people of one height differ by 1 % of it in neck, head and foot, and joints
# are off by as much; of one view alone. Chosen, by simulated captures (`python -m benchmarks.which_person`)
SAME_M, MEASURED_M, ALONE_SIGMA_M = 0.008, 0.02, 0.05
# of what errors make bones longer to second order, how much they do, and how well that is known; chosen, by
# simulated captures: triangulation itself makes them shorter
LONGER, LONGER_SHARE = 0.7, 0.4
# of the statures of one body, at least, m; chosen, as of level `ideal`: few sightings may agree by chance
SCATTER_M = 0.015
DIFFERENT = 3.0  # so many standard errors apart are two people; chosen
TOLD_M = 0.04  # people whose statures differ by so much, m, are told apart; chosen: shoes make half of it
# a height decides where it makes one person so many times as likely, and the others' stature is so far from his, m;
# chosen: less chooses the wrong one of two people whose proportions differ, more leaves people of `TOLD_M` open
# (`python -m benchmarks.which_person proportions,together`)
ODDS, APART_M = np.log(20.0), 0.025
OURS = 0.1  # a detection farther from the subject's body than so many body sizes is not his; chosen

OWN, STRANGER, UNDECIDED = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Seen:
    """The people of V views at T instants, at most K of each: pixels `uv` (V, K, T, J, 2), `score` (V, K, T, J), 0
    where a joint is missing, `track` (V, K, T), -1 for nobody; `names` of the joints, `fps` of the instants."""

    uv: Floats
    score: Floats
    track: Ints
    names: Sequence[str]
    fps: float


@dataclass(frozen=True)
class Seed:
    """Somebody pointed at the subject: in view `view` at instant `t`, the detection of slot `person`."""

    view: int
    t: int
    person: int


@dataclass(frozen=True, eq=False)
class Stretch:
    """Instants `first` to `last` at which the subject is not who is seen: `off_m` from him, NaN where he is nowhere,
    and `taller_m` than he, NaN where it is not known."""

    first: int
    last: int
    state: int
    off_m: float
    taller_m: float


@dataclass(frozen=True, eq=False)
class Choice:
    """`pick` (V, T): the subject's place among the K people of a view, -1 for none; `state` (T,): `OWN` where it
    counts, `STRANGER` where only others are seen, `UNDECIDED`; `stretches` of the last two; `people`: how many;
    `followed`: who was where."""

    pick: Ints
    state: Ints
    stretches: tuple[Stretch, ...]
    people: int
    followed: "Followed"


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
        """Sightings by several views; none where most are by one, so that the others are chance meetings."""
        return _together(self.sightings)


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


@dataclass(frozen=True, eq=False)
class Followed:
    """The `people` who were followed, at every `every`-th instant, and whose paths are whose: the `own` of the subject,
    those of `others`, and those of which it cannot be told (`unclear`). `least`: sightings of the shortest path."""

    people: Sequence[Person]
    own: Sequence[Path]
    others: Sequence[Path]
    unclear: Sequence[Path]
    every: int
    least: float


def choose(
    cameras: Sequence[Camera],
    seen: Seen,
    height_m: float = np.nan,
    height_sigma_m: float = 0.0,
    seeds: Sequence[Seed] = (),
    meets: float = people_seen.MEETS,
) -> Choice | None:
    """`Choice` among the people that are `seen`; None where there is nobody but one person, so that nothing is to do.

    `height_m` +- `height_sigma_m` of the subject, NaN where it was not measured. `meets` as of `people_seen.sightings`.
    """
    every = max(1, round(seen.fps / PER_S))
    at = np.arange(0, seen.uv.shape[2], every)
    known = (seen.score > 0) & np.isfinite(seen.uv).all(axis=-1)
    found = people_seen.sightings(cameras, seen.uv[:, :, at], known[:, :, at], seen.names, meets)
    track, fps = seen.track[:, :, at], seen.fps / every
    everybody = _paths(found, track, fps)
    least = LEAST_S * fps
    paths = [path for path in everybody if len(path.sightings) >= least]
    marked = _pointed_at(everybody, seen, seeds, every, track)
    paths += [path for path in marked if path not in paths]
    people = people_of(paths, fps)
    if len(people) < 2:
        return None
    whose = _subject(people, marked, found, height_m, height_sigma_m, fps)
    return _choice(cameras, seen, Followed(people, *whose, every, least))


def _together(bodies: list[Sighting]) -> list[Sighting]:
    several = [one for one in bodies if not one.alone]
    return several if len(several) > len(bodies) / 2 else []


def tracks_of(body: Sighting, track: Ints) -> set[tuple[int, int]]:
    """(view, track) of a body's detections; `track` (V, K, T)."""
    return {(v, int(track[v, who, body.t])) for v, who in enumerate(body.members.tolist()) if who >= 0}


def _paths(found: Sequence[list[Sighting]], track: Ints, fps: float) -> list[Path]:
    """Bodies followed from instant to instant: those whose detections go on and that are where they can be.

    Where people hide each other, detections of two may meet in one body for a moment. So a body goes on with the path
    that had more of its detections' tracks several times in the last seconds; a track that another has had since counts
    half, since a camera that sees one person before the other does not notice that it was handed on.
    """
    paths: list[Path] = []
    holder: dict[tuple[int, int], Path] = {}
    past = round(HISTORY_S * fps)
    for bodies in found:
        if not bodies:
            continue
        open_ = [path for path in paths if bodies[0].t - path.last.t <= MEMORY_S * fps]
        ways = []
        for i, path in enumerate(open_):
            before = Counter(one for body in path.sightings[-past:] for one in tracks_of(body, track))
            for j, body in enumerate(bodies):
                shared = sum(
                    min(before[one], KNOWN) / KNOWN * (1.0 if holder[one] is path else HANDED_ON)
                    for one in tracks_of(body, track)
                    if one in before
                )
                off = _off(path, body, fps)
                if shared and off <= 1:
                    ways.append((off - shared, i, j))
        done: tuple[set[int], set[int]] = (set(), set())
        for _, i, j in sorted(ways):
            if i not in done[0] and j not in done[1]:
                done[0].add(i)
                done[1].add(j)
                open_[i].sightings.append(bodies[j])
        paths += [Path([body]) for j, body in enumerate(bodies) if j not in done[1]]
        holder |= {one: path for path in paths if path.last in bodies for one in tracks_of(path.last, track)}
    return paths


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


def _size(bodies: list[Sighting]) -> tuple[float, float, float]:
    """Stature (m) of some sightings of one body, its standard error, infinite where it is not known, and the part of it
    that errors made longer, which was taken off.

    By several views where they are. The median's error is 1.25 of the mean's, and sightings within a third of a second
    share a detector's: so many are worth half.
    """
    together = [one for one in _together(bodies) if np.isfinite(one.stature)]
    if together:
        tall, longer = np.median([[one.stature, one.longer] for one in together], axis=0)
        scatter = 1.4826 * np.median([abs(one.stature - tall) for one in together])
        error = max(scatter, SCATTER_M) * np.sqrt(np.pi / len(together))
        return float(tall - LONGER * longer), float(error), float(LONGER * longer)
    alone = [one.stature for one in bodies if one.alone and np.isfinite(one.stature)]
    return (float(np.median(alone)), ALONE_SIGMA_M, 0.0) if alone else (np.nan, np.inf, 0.0)


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
        gap = (later.first.t - earlier.last.t) / fps
        if gap <= 0:
            return None
        reach = REACH_M + ALONE_M * (later.first.alone + earlier.last.alone)
        if np.linalg.norm((later.first.place - earlier.last.place)[:2]) > reach + WALKS_M_S * max(gap - 1 / fps, 0):
            return None
    (one, sd_one, long_one), (two, sd_two, long_two) = _size(person.sightings), _size(path.sightings)
    # the same cameras make both longer
    sd = np.sqrt(sd_one**2 + sd_two**2 + SAME_M**2 + (LONGER_SHARE * (long_one - long_two)) ** 2)
    if abs(one - two) > DIFFERENT * sd:
        return None
    return bool(DIFFERENT * sd <= 1.5 * TOLD_M)


def _pointed_at(paths: Sequence[Path], seen: Seen, seeds: Sequence[Seed], every: int, track: Ints) -> list[Path]:
    """The path of each seed: that with the detection's track, nearest in time."""
    out = []
    for seed in seeds:
        wanted = (seed.view, int(seen.track[seed.view, seed.person, seed.t]))
        near = [
            (abs(body.t * every - seed.t), i)
            for i, path in enumerate(paths)
            for body in path.sightings
            if wanted in tracks_of(body, track)
        ]
        if near:
            out.append(paths[min(near)[1]])
    return out


def _subject(
    people: list[Person],
    marked: Sequence[Path],
    found: Sequence[list[Sighting]],
    height_m: float,
    height_sigma_m: float,
    fps: float,
) -> tuple[list[Path], list[Path], list[Path]]:
    """Paths of the subject, of others, and those of which it cannot be told."""
    if marked:
        pinned = [person for person in people if any(path in person.paths for path in marked)]
        own = [path for person in pinned for path in person.paths if path in marked or not at_once(path, marked)]
        rest = [path for person in people for path in person.paths if path not in own]
        return (
            own,
            [path for path in rest if at_once(path, own)],
            [path for path in rest if not at_once(path, own)],
        )
    sure = [person for person in people if person.sure]
    most = max(len(person.sightings) + person.perhaps for person in sure)
    rivals = [person for person in sure if len(person.sightings) + person.perhaps >= PASSING * most]
    chosen = _decided(rivals, found, height_m, height_sigma_m, fps)
    if chosen is None or _doubted(chosen, found, fps):
        return [], [], [path for person in people for path in person.paths]
    own = list(chosen.paths)
    others: list[Path] = []
    unclear: list[Path] = []
    for person in people:
        if person is not chosen:
            for path in person.paths:
                # who is there beside the subject is not the subject; nor is who is surely of another body or place
                (others if person.sure or at_once(path, own) else unclear).append(path)
    return own, others, unclear


def at_once(path: Path, others: Sequence[Path]) -> bool:
    """Whether a path is there at the time of others."""
    return any(path.first.t <= other.last.t and other.first.t <= path.last.t for other in others)


def _decided(
    rivals: list[Person], found: Sequence[list[Sighting]], height_m: float, height_sigma_m: float, fps: float
) -> Person | None:
    """Which of several people is the subject; None where it cannot be told."""
    way = np.array([_way(person.sightings) for person in rivals])
    if (way > GOES_M).any():
        rivals = [person for person, far in zip(rivals, way, strict=True) if far > STANDS_M]
    if len(rivals) == 1:
        return rivals[0]
    agreed = [person for person in rivals if _unanimous(person, found) >= UNANIMOUS_S * fps]
    if len(agreed) == 1:
        return agreed[0]
    if not np.isfinite(height_m):
        return None
    sizes = np.array([_size(person.sightings) for person in rivals])
    variance = sizes[:, 1] ** 2 + (LONGER_SHARE * sizes[:, 2]) ** 2 + MEASURED_M**2 + height_sigma_m**2
    cost = np.where(np.isfinite(sizes[:, 0]), (sizes[:, 0] - height_m) ** 2 / (2 * variance), 0.0)
    best = int(np.argmin(cost))
    with np.errstate(invalid="ignore"):
        clear = (cost - cost[best] >= ODDS) & (np.abs(sizes[:, 0] - sizes[best, 0]) >= APART_M)
    return rivals[best] if np.delete(clear, best).all() else None


def _way(bodies: list[Sighting]) -> float:
    """How far apart (m) the places of a body are, but for the outermost tenths."""
    places = np.array([body.place[:2] for body in _together(bodies) or bodies])
    low, high = np.quantile(places, (0.1, 0.9), axis=0)
    return float(np.linalg.norm(high - low))


def _doubted(person: Person, found: Sequence[list[Sighting]], fps: float) -> bool:
    """Whether only some views speak for a person, while another sees somebody else, and never all for `UNANIMOUS_S`."""
    against = 0
    for body in person.sightings:
        lacking = body.members < 0
        against += any(other.alone and (other.members[lacking] >= 0).any() for other in found[body.t])
    sightings = len(person.sightings)
    split = against > DOUBT * sightings or not _together(person.sightings)
    return split and _unanimous(person, found) < UNANIMOUS_S * fps


def _unanimous(person: Person, found: Sequence[list[Sighting]]) -> int:
    """At how many instants, one after the other, all views see this person and nobody else."""
    agreed = np.zeros(len(found) + 2, int)
    for body in person.sightings:
        agreed[body.t + 1] = len(found[body.t]) == 1 and bool(body.meet.all())
    ends = np.flatnonzero(np.diff(agreed))
    return int((ends[1::2] - ends[::2]).max(initial=0))


def _choice(cameras: Sequence[Camera], seen: Seen, followed: Followed) -> Choice:
    """`Choice` at all instants, from paths at every `every`-th of them."""
    groups = (followed.own, followed.others, followed.unclear)
    off, spans = away_from(cameras, seen, groups, followed.every)
    near = (off[0] <= OURS) & (off[0] <= off[1:].min(axis=0))
    pick = nearest_of(near, off[0])
    subject = (pick >= 0).sum(axis=0) >= 2
    state = np.full(off.shape[-1], OWN)
    state[spans[1] & ~subject] = STRANGER
    state[spans[2] & ~subject] = UNDECIDED
    if not followed.own:
        state[:] = UNDECIDED
    stretches = _stretches(state, followed.own, [*followed.others, *followed.unclear], followed.every)
    return Choice(pick, state, tuple(stretches), len(followed.people), followed)


def nearest_of(near: Bools, off: Floats) -> Ints:
    """Of the people of each view (V, K, T) who are `near`, the place of the nearest, -1 for nobody: (V, T)."""
    return np.where(near.any(axis=1), np.where(near, off, np.inf).argmin(axis=1), -1)


def away_from(
    cameras: Sequence[Camera], seen: Seen, groups: Sequence[Sequence[Path]], every: int
) -> tuple[Floats, Bools]:
    """How far (G, V, K, T), in body sizes, everybody's detections lie from the nearest body of each of some groups of
    paths, and at which instants (G, T) one of these is there. Infinite where there is none.
    """
    views, each, count = seen.track.shape
    joints = people_seen.joints_of(seen.names)
    known = (seen.score > 0) & np.isfinite(seen.uv).all(axis=-1)
    uv, say = seen.uv[:, :, :, joints.columns], known[:, :, :, joints.columns]
    middle, both = people_seen.middles(uv, say, joints)
    size = people_seen.sizes(uv, say)
    off = np.full((len(groups), views, each, count), np.inf)
    spans = np.zeros((len(groups), count), bool)
    for kind, paths in enumerate(groups):
        for path in paths:
            if not path.together:
                continue
            rows, body = _between(path, every, count)
            spans[kind, rows] = True
            for v, camera in enumerate(cameras):
                for k in range(each):
                    there = rows[np.isfinite(size[v, k, rows])]
                    at = there - rows[0]
                    now = people_seen.away(camera, body[at], middle[v, k, there], both[v, k, there], size[v, k, there])
                    off[kind, v, k, there] = np.minimum(off[kind, v, k, there], now)
    return off, spans


def _between(path: Path, every: int, count: int) -> tuple[Ints, Floats]:
    """Instants (n,) of a path, and the middles of the body's joints (n, M, 3) at them, on lines; NaN if not known."""
    ends = path.together[0].t, path.together[-1].t
    first, last = max((ends[0] - 1) * every + 1, 0), min((ends[1] + 1) * every, count)
    rows = np.arange(first, last)
    when = np.array([body.t * every for body in path.together])
    at = np.stack([body.middles for body in path.together])
    out = np.full((len(rows), *at.shape[1:]), np.nan)
    for joint in range(at.shape[1]):
        there = np.isfinite(at[:, joint, 0])
        if there.any():
            for axis in range(3):
                out[:, joint, axis] = np.interp(rows, when[there], at[there, joint, axis])
    return rows, out


def _stretches(state: Ints, own: Sequence[Path], others: Sequence[Path], every: int) -> list[Stretch]:
    """The stretches of one state, and where their people are."""
    edges = np.flatnonzero(np.diff(state)) + 1
    mine = sorted((body for path in own for body in path.sightings), key=lambda body: body.t)
    size = _size(mine)[0]
    out = []
    for rows in np.split(np.arange(len(state)), edges):
        if not len(rows) or state[rows[0]] == OWN:
            continue
        first, last = int(rows[0]), int(rows[-1])
        here = [body for path in others for body in path.together if first <= body.t * every <= last]
        off = [
            float(np.linalg.norm((body.place - min(mine, key=lambda one: abs(one.t - body.t)).place)[:2]))
            for body in here
            if mine
        ]
        taller = _size(here)[0] - size if mine else np.nan
        out.append(Stretch(first, last, int(state[first]), float(np.median(off)) if off else np.nan, taller))
    return out


def words(state: Ints) -> Texts:
    """The status of instants `state`, "" where it is the subject's own."""
    return np.array(["", "rejected", "suspect"])[state]
