"""Everybody whom several placed cameras see, and which detections are surely whose.

INPUTS   placed cameras, the people of each view at every instant, and who was followed (`which_person`)
OUTPUTS  `Somebody` for each of them, in the order of their first appearance
Two people who are close together in a picture are told apart by nothing there: such a detection is nobody's. Where that
leaves fewer than two views, or where the rays of two people's detections meet as well when they are exchanged in a
view, it is not known who is whose, and the instant is left open. Where after that the cameras' own tracks do not say
who went on as whom, whoever goes on is somebody new, unless the body tells: one number is never two people.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Ints
from dior.body import people_seen
from dior.body.people_followed import Path, Person, at_once, people_of, tracks_of
from dior.body.people_seen import Sighting
from dior.body.which_person import OURS, Choice, Seen, away_from, nearest_of
from dior.geometry.camera import Camera

# chosen, in body sizes: a detection that is not nearer than that to one than to another may be either's
TOLD_APART = people_seen.MEETS
# chosen: whom nobody else is so near, m for each instant at which bodies are looked for, is taken for nobody else; a
# runner moves half as far meanwhile
STEP_M = 1.0


@dataclass(frozen=True, eq=False)
class Somebody:
    """A person: `pick` (V, T), the place among the K people of a view where that is surely theirs, else -1; `unsure`
    (T,): they are there, and it is not known which detections are theirs; `is_subject`: yes, no or unknown; `first`:
    the instant of their first appearance."""

    pick: Ints
    unsure: Bools
    is_subject: str
    first: int


def everyone(cameras: Sequence[Camera], seen: Seen, choice: Choice) -> list[Somebody]:
    """`Somebody` for each who was tracked through two views or more."""
    every = choice.followed.every
    groups = _groups(seen, choice)
    off, there = away_from(cameras, seen, [own for _, own in groups], every)
    out = []
    for i, (word, own) in enumerate(groups):
        rest = np.delete(off, i, axis=0).min(axis=0, initial=np.inf)
        near = off[i] <= OURS
        pick = nearest_of(near & (off[i] + TOLD_APART <= rest), off[i])
        pick[:, _doubtful(own, every, pick.shape[1])] = -1
        unsure = there[i] & (near.any(axis=1).sum(axis=0) >= 2) & ((pick >= 0).sum(axis=0) < 2)
        first = min(path.first.t for path in own) * every
        out.append(Somebody(pick, unsure, word, first))
    return sorted(out, key=lambda one: (one.first, one.is_subject != "yes"))


def _doubtful(paths: Sequence[Path], every: int, count: int) -> Bools:
    """Instants (T,) between the sightings beside one that is not sure."""
    out = np.zeros(count, bool)
    for body in (body for path in paths for body in path.sightings if not body.sure):
        out[max((body.t - 1) * every + 1, 0) : (body.t + 1) * every] = True
    return out


def _groups(seen: Seen, choice: Choice) -> list[tuple[str, list[Path]]]:
    """Whether it is the subject, and the paths, of each person whom several views see."""
    followed = choice.followed
    tracks = seen.track[:, :, :: followed.every]
    paths = [path for person in followed.people for path in person.paths]
    at = [{body.t: body for body in path.sightings} for path in paths]
    own = list(followed.own)
    subject = [Person(list(own))] if own else []
    pieces: list[Path] = []
    doubted: list[Path] = []
    for i, path in enumerate(paths):
        if any(path is mine for mine in own):
            continue
        parts = _parts(path, [others for j, others in enumerate(at) if j != i], tracks)
        parts = [part for part in parts if len(part.sightings) >= followed.least] if len(parts) > 1 else parts
        pieces += parts
        unclear = any(path is other for other in followed.unclear)
        doubted += [part for part in parts if unclear or len(parts) > 1 and not at_once(part, own)]
    people = people_of(pieces, seen.fps / followed.every, subject)
    found = [("yes", own)] if own else []
    for number, person in enumerate(people):
        rest = [path for path in person.paths if not any(path is mine for mine in own)]
        unknown = number < len(subject) or any(path is other for path in rest for other in doubted)
        found.append(("unknown" if unknown else "no", rest))
    return [(word, paths) for word, paths in found if word == "yes" or any(path.together for path in paths)]


def _parts(path: Path, others: Sequence[dict[int, Sighting]], track: Ints) -> list[Path]:
    """A path cut where it is not sure that the same person goes on; `others`: the sightings of each other path by
    instant."""
    parts = [Path([])]
    last: Sighting | None = None
    for body in path.sightings:
        if body.sure and not body.alone:
            if last is not None and not _goes_on(last, body, others, track):
                parts.append(Path([]))
            last = body
        parts[-1].sightings.append(body)
    return parts


def _goes_on(before: Sighting, after: Sighting, others: Sequence[dict[int, Sighting]], track: Ints) -> bool:
    """Whether two sightings are of one person: nobody else is near, or more views go on with their track than have
    exchanged it with another."""
    reach = STEP_M * (after.t - before.t)
    at = [body for other in others for body in (other.get(before.t), other.get(after.t)) if body is not None]
    if all(np.linalg.norm((body.place - after.place)[:2]) > reach for body in at):
        return True
    same = handed_on = 0
    for view in np.flatnonzero((before.members >= 0) & (after.members >= 0)).tolist():
        old, new = (int(track[view, body.members[view], body.t]) for body in (before, after))
        same += old == new
        if old != new:
            handed_on += _is_in(others, after.t, view, old, track) or _is_in(others, before.t, view, new, track)
    return same > handed_on


def _is_in(others: Sequence[dict[int, Sighting]], t: int, view: int, number: int, track: Ints) -> bool:
    """Whether another body has the track of that number in a view at an instant."""
    return any((view, number) in tracks_of(other[t], track) for other in others if t in other)
