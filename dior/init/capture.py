"""All that recordings tell of a capture: walks with what belongs to them, sessions with their cameras.

INPUTS   `found.Found`
OUTPUTS  `Capture`: what the sheets and the YAML files are to say, every guess with its reason
"""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dior.init import belongings, cameras, names, sessions, walks
from dior.init.belongings import Cell
from dior.init.cameras import Filmed
from dior.init.found import Found, Mocap
from dior.init.sessions import Session, Taken
from dior.init.walks import Walk
from dior.project.todos import WORD


@dataclass(frozen=True, eq=False)
class Capture:
    """`first_frame`: number that the detector's files give the first picture, with the reason. `aside`: (path, reason)
    of what belongs to nothing."""

    sessions: tuple[Session, ...]
    first_frame: Cell
    aside: tuple[tuple[str, str], ...]


def of(root: Path, found: Found, devices: Sequence[str] = ()) -> Capture:
    """What the things that were found below `root` are to each other. `devices`: those that config.yaml knows."""
    aside = list(found.aside)
    given = sorted(
        {name for one in found.calibrations for camera in one.cameras for name in (camera.name, *camera.also)}
    )
    from_bags = _told(found, given)
    filmed: list[tuple[Walk, list[Filmed], str]] = []
    for walk in walks.walks_of(found.recordings, from_bags):
        mine, videos, left = cameras.filmed(walk, given)
        aside += left
        filmed += [(walk, mine, videos)] if mine else []
    known = sorted({*from_bags, *(one.name for _, mine, _ in filmed for one in mine if _is_word(one.name))})
    owned, of_walks, left = belongings.owned(root, found, filmed, known)
    aside += left
    taken = [
        Taken("", walk, tuple(mine), _subject(walk, its.markers), videos, its)
        for (walk, _, videos), mine, its in zip(filmed, of_walks, owned, strict=True)
    ]
    found_sessions, first = sessions.sessions_of(root, _named(taken), found.calibrations, list(devices))
    used = {path for session in found_sessions for lensed in session.lenses.values() for path in lensed.files}
    why = "is a calibration whose cameras are called as none of a walk, or another one is nearer to it"
    aside += [(one.path, why) for one in found.calibrations if one.path not in used]
    told = {said for its in owned for said in its.unread.values()}
    aside = [(path, reason) for path, reason in aside if f"{path}: {reason}" not in told]
    return Capture(tuple(found_sessions), first, tuple(sorted(aside)))


def _told(found: Found, given: Sequence[str]) -> list[str]:
    """Names of cameras by the topics of bags and by calibrations (`given`), which are no part of a walk's name."""
    alone = [Walk((one,), ("",), ()) for one in found.recordings if one.kind == "bag"]
    from_bags = {one.name for walk in alone for one in cameras.filmed(walk, ())[0]}
    return [name for name in sorted({*from_bags, *given}) if _is_word(name)]


def _is_word(name: str) -> bool:
    """Whether it is more than a number or a letter, which may be that of a walk."""
    return len(name) > 1 and any(letter.isalpha() for letter in name)


def _subject(walk: Walk, mocap: Mocap | None) -> Cell:
    """Who walks, by the names of files and the labels of the motion capture."""
    by_name = {names.person(one.path) for one in walk.recordings} - {""}
    by_label = {prefix for prefix in mocap.prefixes if names.is_valid(prefix)} if mocap else set()
    options = sorted({*by_name, *by_label})
    if len(options) == 1:
        why = "as the files are called" if by_name else f"as the labels in {mocap.path if mocap else ''} begin"
        return Cell(options[0], f"{options[0]} {why}")
    return Cell(belongings.either(options) if options else WORD, "")


def _named(taken: Sequence[Taken]) -> list[Taken]:
    """The walks with names, in their order."""
    people = {one.subject.text for one in taken if not one.subject.asked}
    short = [_name(one, people, 1) for one in taken]
    count = Counter(name.casefold() for name in short)
    named: list[Taken] = []
    for one, name in zip(taken, short, strict=True):
        name = name if count[name.casefold()] == 1 else _name(one, people, 2)
        if not name:
            place = "indoor" if one.indoor else "outdoor"
            used = {other.name for other in named}
            name = next(f"{place}_{i:02d}" for i in range(1, len(used) + 2) if f"{place}_{i:02d}" not in used)
        named.append(replace(one, name=names.unique(name, [other.name for other in named])))
    return named


def _name(one: Taken, people: Collection[str], parts: int) -> str:
    """The last parts of what a walk's files are called, without anybody's name and any date; empty if none is left."""
    key = names.without_people(one.walk.key)
    for person in people:
        key = "/".join(names.without(part, person) for part in key.split("/"))
    left = [part for part in key.split("/") if part]
    return names.valid("_".join(left[-parts:]))
