"""Which of the people in the pictures is the subject of a recording: by where they are, their stature, and by hand.

INPUTS   placed cameras, the people of each view at every instant (`people_seen`), the subject's stature, seeds
OUTPUTS  `Choice`: the subject's detection in every view, and the stretches that are somebody else's or cannot be told

Bodies are found a few times a second and followed (`people_followed`). The subject is the one whom a person pointed at;
else who alone is there, or walks, or is there for most of the time, or is at times all that all cameras see; else whose
stature is the subject's, by another walk or by a tape. Where none of these tells, nobody is chosen: that two views of
three agree is no proof, since both may follow the same wrong person.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats, Ints, Texts
from dior.body import people_seen
from dior.body.people_followed import (
    UNKNOWN,
    Path,
    Person,
    Size,
    at_once,
    mean_size,
    paths_of,
    people_of,
    same,
    size_of,
    together,
    tracks_of,
)
from dior.body.people_seen import Sighting
from dior.geometry.camera import Camera

PER_S = 6.0  # bodies are looked for so many times a second; chosen: a walker moves by 0.2 m meanwhile
LEAST_S = 0.5  # who is seen for less is nobody to choose; chosen: three sightings
TELLS_S = 2.0  # of a walk that tells how tall its subject is; chosen: two strides
# who is there for less than this share of another's time is passing by; chosen
PASSING = 0.5
# who stays within the one is not who was recorded walking, where another goes farther than the other, m; chosen: a sway
# and the errors of a place, and two steps in walks of a second
STANDS_M, GOES_M = 0.3, 0.5
# for so long, never contradicted, all cameras must see one person and nobody else, standing there by each of them
# alone. Chosen: long beside chance meetings of people beside each other, one of whom two cameras follow and the third
# the other (`python -m benchmarks.which_person two_cameras`)
UNANIMOUS_S = 1.0
DOUBT = 0.25  # of the time that another view sees somebody else; chosen: more than detectors take a bystander
# chosen: how well a tape tells the stature by the joints, m: people of one height differ by 1 % of it in neck, head and
# foot, and a detector's joints are not the anatomist's
MEASURED_M = 0.02
# a stature decides where it makes one person so many times as likely, and the others' is so far from his, m; chosen:
# less chooses the wrong one of two people whose proportions differ, more leaves people of `TOLD_M` open
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


def by_tape(height_m: float, sigma_m: float) -> Size:
    """The `Size` of somebody whose height was measured."""
    return Size(height_m, float(np.hypot(MEASURED_M, sigma_m)))


def choose(
    cameras: Sequence[Camera],
    seen: Seen,
    known: Size = UNKNOWN,
    seeds: Sequence[Seed] = (),
    meets: float = people_seen.MEETS,
) -> Choice | None:
    """`Choice` among the people that are `seen`; None where there is nobody but one person, so that nothing is to do.

    `known`: the subject's size, by the same cameras in another walk (`size_of_subject`), or `by_tape`. `meets` as of
    `people_seen.sightings`.
    """
    around = everybody_around(cameras, seen, seeds, meets)
    if len(around.people) < 2:
        return None
    whose = _subject(around, known)
    return _choice(cameras, seen, Followed(around.people, *whose, around.every, LEAST_S * around.fps))


def size_of_subject(cameras: Sequence[Camera], seen: Seen, seeds: Sequence[Seed] = ()) -> Size:
    """The `Size` of the subject of a walk in which nobody else can be meant, or somebody pointed; else `UNKNOWN`."""
    around = everybody_around(cameras, seen, seeds)
    own = around.people[0].paths if len(around.people) == 1 else _subject(around, UNKNOWN)[0] if around.people else []
    bodies = [one for path in own for one in path.together]
    return size_of(bodies) if len(bodies) >= TELLS_S * around.fps else UNKNOWN


@dataclass(frozen=True, eq=False)
class Around:
    """Everybody at every `every`-th instant, `fps` of these a second: the bodies `found` at each, the `track` (V, K, T)
    of the detections, the `people` made of them, and the paths that are `marked` by a seed."""

    found: Sequence[list[Sighting]]
    track: Ints
    people: Sequence[Person]
    marked: Sequence[Path]
    every: int
    fps: float


def everybody_around(
    cameras: Sequence[Camera], seen: Seen, seeds: Sequence[Seed] = (), meets: float = people_seen.MEETS
) -> Around:
    """`Around` of the people that are `seen`."""
    every = max(1, round(seen.fps / PER_S))
    at = np.arange(0, seen.uv.shape[2], every)
    shown = (seen.score > 0) & np.isfinite(seen.uv).all(axis=-1)
    found = people_seen.sightings(cameras, seen.uv[:, :, at], shown[:, :, at], seen.names, meets)
    track, fps = seen.track[:, :, at], seen.fps / every
    everybody = paths_of(found, track, fps)
    paths = [path for path in everybody if len(path.sightings) >= LEAST_S * fps]
    marked = _pointed_at(everybody, seen, seeds, every, track)
    paths += [path for path in marked if path not in paths]
    return Around(found, track, people_of(paths, fps), marked, every, fps)


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


def _subject(around: Around, known: Size) -> tuple[list[Path], list[Path], list[Path]]:
    """Paths of the subject, of others, and those of which it cannot be told."""
    people, marked = around.people, around.marked
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
    chosen = _decided(rivals, around, known)
    if chosen is None or _doubted(chosen, around):
        return [], [], [path for person in people for path in person.paths]
    own = list(chosen.paths)
    others: list[Path] = []
    unclear: list[Path] = []
    size = mean_size([size_of(chosen.sightings), known])
    for person in people:
        if person is not chosen:
            for path in person.paths:
                # who is there beside the subject is not the subject; nor is who is surely of another body or place
                told = None if person.sure or at_once(path, chosen.paths) else same(size, size_of(path.sightings))
                (others if told is None else own if told else unclear).append(path)
    return own, others, unclear


def _decided(rivals: list[Person], around: Around, known: Size) -> Person | None:
    """Which of several people is the subject; None where it cannot be told."""
    way = np.array([_way(person.sightings) for person in rivals])
    if (way > GOES_M).any():
        rivals = [person for person, far in zip(rivals, way, strict=True) if far > STANDS_M]
    if len(rivals) == 1:
        return rivals[0]
    agreed = [person for person in rivals if _unanimous(person, around)]
    if len(agreed) == 1:
        return agreed[0]
    if not np.isfinite(known.stature_m):
        return None
    sizes = [size_of(person.sightings) for person in rivals]
    stature = np.array([one.stature_m for one in sizes])
    variance = np.array([one.variance_to(known) for one in sizes])
    cost = np.where(np.isfinite(stature), (stature - known.stature_m) ** 2 / (2 * variance), 0.0)
    best = int(np.argmin(cost))
    with np.errstate(invalid="ignore"):
        clear = (cost - cost[best] >= ODDS) & (np.abs(stature - stature[best]) >= APART_M)
    return rivals[best] if np.delete(clear, best).all() else None


def _way(bodies: list[Sighting]) -> float:
    """How far apart (m) the places of a body are, but for the outermost tenths."""
    places = np.array([body.place[:2] for body in together(bodies) or bodies])
    low, high = np.quantile(places, (0.1, 0.9), axis=0)
    return float(np.linalg.norm(high - low))


def _doubted(person: Person, around: Around) -> bool:
    """Whether only some views speak for a person, while another sees somebody else, and never all of them."""
    against = 0
    for body in person.sightings:
        lacking = body.members < 0
        against += any(other.alone and (other.members[lacking] >= 0).any() for other in around.found[body.t])
    split = against > DOUBT * len(person.sightings) or not together(person.sightings)
    return split and not _unanimous(person, around)


def _unanimous(person: Person, around: Around) -> bool:
    """Whether all views see this person and nobody else for `UNANIMOUS_S`."""
    broken = np.cumsum([len(bodies) > 1 for bodies in around.found])
    runs = Counter(int(broken[one.t]) for one in person.sightings if len(around.found[one.t]) == 1 and one.meet.all())
    return max(runs.values(), default=0) >= UNANIMOUS_S * around.fps


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
    size = size_of(mine).stature_m
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
        taller = size_of(here).stature_m - size if mine else np.nan
        out.append(Stretch(first, last, int(state[first]), float(np.median(off)) if off else np.nan, taller))
    return out


def words(state: Ints) -> Texts:
    """The status of instants `state`, "" where it is the subject's own."""
    return np.array(["", "rejected", "suspect"])[state]
