"""Which recordings are of one walk, and which walk a file is of.

INPUTS   `found.Recording`s, paths
OUTPUTS  `Walk`s with the reasons; of a path the walks that it may be of
Recordings that were made at the same time are of one walk, whatever they are called. Names tell where no times do.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from dior.init import names
from dior.init.found import Recording

# chosen: of the shorter of two recordings, at least so much was recorded while the other was, if they are of one walk
TOGETHER = 0.5
# chosen: a recorder that splits its bags loses less between two of them, and nobody starts it again so soon
SPLIT_NS = 500_000_000
# chosen: nobody is back at the start of a walk sooner
BREAK_NS = 3_000_000_000
# chosen: dates in names are in whole seconds, of recorders that are started one after the other
NAMED_NS = 5_000_000_000


@dataclass(frozen=True, eq=False)
class Walk:
    """Recordings of one walk, sorted; `keys`: what each says it is called; `reasons`: why they belong together;
    `doubts`: what a person should look at."""

    recordings: tuple[Recording, ...]
    keys: tuple[str, ...]
    reasons: tuple[str, ...]
    doubts: tuple[str, ...] = ()

    @property
    def first_ns(self) -> int | None:
        """When it began, None if nothing tells or only names do."""
        return min((one.first_ns for one in self.recordings if one.first_ns and one.by != "name"), default=None)

    @property
    def last_ns(self) -> int | None:
        return max((one.last_ns for one in self.recordings if one.last_ns and one.by != "name"), default=None)

    @property
    def key(self) -> str:
        """What its recordings are all called, or else most of them, dates left out."""
        keys = [names.without_dates(one) for one in self.keys]
        return names.common(keys) or Counter(sorted(keys)).most_common(1)[0][0]

    @property
    def folder(self) -> str:
        """The innermost folder in which all of its recordings lie."""
        parents = [PurePosixPath(one.path).parent.parts for one in self.recordings]
        common = [part[0] for part in zip(*parents, strict=False) if len({*part}) == 1]
        return "/".join(common)


def walks_of(recordings: Sequence[Recording], cameras: Collection[str]) -> list[Walk]:
    """The walks, in the order of their times and keys. `cameras`: names that are those of cameras, not of walks."""
    keys = {one.path: names.walk_key(one.path, cameras) for one in recordings}
    groups: list[list[Recording]] = []
    for dated in (("stamps", "creation"), ("name",)):
        groups += _at_once([one for one in recordings if one.by in dated])
    timed = [group for group in groups if group[0].by != "name"]
    rest = [group for group in groups if group[0].by == "name"] + [[one] for one in recordings if not one.by]
    joined: list[list[Recording]] = []
    for group in rest:
        mine = {keys[one.path] for one in group}
        same = [other for other in timed if mine & {keys[one.path] for one in other}]
        alike = [other for other in joined if mine & {keys[one.path] for one in other}]
        target = same[0] if len(same) == 1 else alike[0] if alike else None
        if target is None:
            joined.append(list(group))
        else:
            target += group
    joined = _in_one_folder(joined)
    found = [sorted(group, key=lambda one: one.path) for group in (*timed, *joined)]
    found.sort(key=lambda group: (_first_ns(group), _natural(keys[group[0].path]), group[0].path))
    return [
        Walk(tuple(group), tuple(keys[one.path] for one in group), _reasons(group, keys), _doubts(group, found, keys))
        for group in found
    ]  # fmt: skip


def _first_ns(group: Sequence[Recording]) -> int:
    return min((one.first_ns for one in group if one.first_ns), default=0)


def _natural(text: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", text.lower())]


def _at_once(recordings: Sequence[Recording]) -> list[list[Recording]]:
    """Groups of recordings that were made at the same time, or go on where another one of the same topics ended."""
    groups: list[list[Recording]] = []
    for one in sorted(recordings, key=lambda one: (one.first_ns or 0, one.path)):
        mine = [group for group in groups if any(_belong(one, other) for other in group)]
        merged = [one, *(other for group in mine for other in group)]
        groups = [group for group in groups if not any(group is other for other in mine)] + [merged]
    return groups


def _belong(one: Recording, other: Recording) -> bool:
    if overlap(one, other) > 0:
        shortest = min((each.last_ns or 0) - (each.first_ns or 0) for each in (one, other))
        return overlap(one, other) >= TOGETHER * max(shortest, 1)
    if one.by == other.by == "name":
        return abs((one.first_ns or 0) - (other.first_ns or 0)) <= NAMED_NS
    same = one.topics.keys() == other.topics.keys() and one.kind == "bag"
    beside = PurePosixPath(one.path).parent == PurePosixPath(other.path).parent
    return same and beside and -overlap(one, other) <= SPLIT_NS


def overlap(one: Recording, other: Recording) -> int:
    """How long (ns) two recordings ran at once; negative is what lies between them."""
    return min(one.last_ns or 0, other.last_ns or 0) - max(one.first_ns or 0, other.first_ns or 0)


def _in_one_folder(groups: list[list[Recording]]) -> list[list[Recording]]:
    """Recordings of which neither a time nor a name tells, each alone, are of one walk where they lie in one folder."""
    by_folder: dict[str, list[list[Recording]]] = {}
    for group in groups:
        folder = str(PurePosixPath(group[0].path).parent)
        alone = len(group) == 1 and not group[0].by and folder != "." and not names.DEVICE.search(group[0].path)
        by_folder.setdefault(folder if alone else group[0].path, []).append(group)
    return [[one for group in mine for one in group] for mine in by_folder.values()]


def _reasons(group: Sequence[Recording], keys: dict[str, str]) -> tuple[str, ...]:
    """Why some recordings are one walk."""
    if len(group) == 1:
        return ()
    shown = [PurePosixPath(one.path).name for one in group]
    which = listed(shown if len({*shown}) == len(shown) else [one.path for one in group])
    dated = [one for one in group if one.by in ("stamps", "creation")]
    if len(dated) == len(group):
        together = min(one.last_ns or 0 for one in group) - max(one.first_ns or 0 for one in group)
        how = f"at the same time for {together / 1e9:.1f} s" if together > 0 else "one after the other without a break"
        if together <= 0 and len({frozenset(_filming(one)) for one in group}) > 1:
            how = "each while another one of them was"
        return (f"{which} were recorded {how}",)
    if all(one.by == "name" for one in group):
        return (f"the names of {which} have the same date and time, to {NAMED_NS // 10**9} s",)
    alike = len({keys[one.path] for one in group}) == 1
    why = "have the same name but for the camera's" if alike else "lie in one folder"
    return (f"{which} {why}, and not all tell when they were recorded",)


def _doubts(group: Sequence[Recording], groups: Iterable[Sequence[Recording]], keys: dict[str, str]) -> tuple[str, ...]:
    """What a person should look at: walks before this one that are called alike and hold other cameras, which may be
    the same one by a wrong clock; recordings that are called as another walk's; breaks."""
    doubts = []
    topics = {name for one in group for name in _filming(one)}
    first_ns = _first_ns(group)
    for other in groups:
        alike = {keys[one.path] for one in other} & {keys[one.path] for one in group} - {""}
        before = 0 < _first_ns(other) < first_ns
        if alike and before and not topics & {name for one in other for name in _filming(one)}:
            later = (first_ns - _first_ns(other)) / 1e9
            mine, theirs = (listed([one.path for one in each]) for each in (group, other))
            doubts.append(
                f"{mine} began {later:.0f} s after {theirs}, which is called the same and holds other cameras: two "
                "walks by time; if a clock was wrong, put it into that one's row"
            )
    return (*doubts, *_called_as_others(group, groups, keys), *_breaks(group), *_twice(group))


def _filming(one: Recording) -> set[str]:
    """What tells the cameras of a recording from those of others that are called the same: topics, or a video's name
    for its camera."""
    if one.kind == "bag":
        return {*one.topics}
    return {found[0].casefold() for found in names.DEVICE.finditer(one.path)} or {names.stem(one.path)}


def _called_as_others(
    group: Sequence[Recording], groups: Iterable[Sequence[Recording]], keys: dict[str, str]
) -> list[str]:
    """What is said of a walk by time of which one recording is called as another walk's: a clock may have been wrong by
    as much as lies between walks."""
    others = [one for other in groups if other is not group for one in other]
    for one in group:
        kin = [other for other in others if keys[other.path] == keys[one.path] and not _filming(one) & _filming(other)]
        beside = [other for other in group if not _alike(keys[other.path], keys[one.path])]
        if keys[one.path] and kin and beside:
            return [
                f"{one.path} is called as {kin[0].path}, and was recorded while {beside[0].path} was: time wins; if a "
                "clock was wrong, put it into that one's row"
            ]
    return []


def _alike(key: str, other: str) -> bool:
    return not key or not other or key == other or names.holds(key, other) or names.holds(other, key)


def _breaks(group: Sequence[Recording]) -> list[str]:
    """What is said of a walk in which a camera's recordings have a break between them, while another one went on."""
    in_time = sorted((one for one in group if one.first_ns and one.by != "name"), key=lambda one: one.first_ns or 0)
    for i, one in enumerate(in_time):
        after = next((other for other in in_time[i + 1 :] if _filming(other) == _filming(one)), None)
        if after and -overlap(one, after) > BREAK_NS:
            return [
                f"between {one.path} and {after.path} there is a break of {-overlap(one, after) / 1e9:.1f} s, in which "
                "another camera went on; if they are several walks, cut its recording, and make a row of each"
            ]
    return []


def _twice(group: Sequence[Recording]) -> list[str]:
    """What is said of bags of which some topics, but not all, are in another one."""
    return [
        f"{one.path} has the pictures of {topic} that {path} has, and those are used"
        for one in group
        for topic, path in one.again
    ]


def listed(words: Sequence[str]) -> str:
    """Words in one phrase, of many the first."""
    # chosen: what a line holds
    if len(words) > 4:
        return f"{', '.join(words[:2])} and {len(words) - 2} more"
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _end_alike(key: str, other: str) -> bool:
    """Whether one of two keys ends as the other is called, a word and something else at least, however written."""
    first, second = names.words(key), names.words(other)
    count = min(len(first), len(second))
    ends = first[-count:] if count > 1 else ()
    return ends == second[-count:] and any(isinstance(word, str) for word in ends)


def walks_named(path: str, walks: Sequence[Walk], cameras: Collection[str]) -> tuple[list[Walk], str]:
    """The walks that a file may be of by its name and place, and why; no walk and why not."""
    key = names.walk_key(path, cameras)
    if same := [walk for walk in walks if key and key in walk.keys]:
        return same, "has its name"
    held = [max((len(one) for one in walk.keys if names.holds(key, one)), default=0) for walk in walks]
    if max(held, default=0):
        return [
            walk for walk, length in zip(walks, held, strict=True) if length == max(held)
        ], "has its name in its own"
    if part := [walk for walk in walks if any(names.holds(one, key) for one in walk.keys)]:
        return part, "has a part of its name"
    if spelled := [walk for walk in walks if any(_end_alike(key, one) for one in walk.keys)]:
        return spelled, "has its name, spelled otherwise"
    at = names.date_ns(path)
    if at is not None:
        dates = {id(walk): [names.date_ns(one.path) for one in walk.recordings] for walk in walks}
        near = [walk for walk in walks if any(one and abs(one - at) <= NAMED_NS for one in dates[id(walk)])]
        if near:
            return near, "has its date"
    inside = [walk for walk in walks if walk.folder and f"{path}/".startswith(f"{walk.folder}/")]
    deepest = [walk for walk in inside if len(walk.folder) == max(len(one.folder) for one in inside)]
    if deepest:
        return deepest, "lies in its folder"
    if len(walks) == 1 and not (key and walks[0].folder):
        return list(walks), "is that of the only walk"
    return [], "has the name of no walk, and lies in no walk's folder"
