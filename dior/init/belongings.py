"""What belongs to a walk besides its pictures: motion capture, trigger log, detections, stamps of its videos.

INPUTS   `walks.Walk`s with their cameras, files of `found`
OUTPUTS  `Cell`s of the sheet by walk, with the reasons; what belongs to none
Where two are as likely a cell is TODO and names both.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TypeAlias

from dior.ingest.readers import READERS
from dior.ingest.trigger_log import Capture
from dior.init import cameras, copies, names
from dior.init.cameras import Filmed
from dior.init.found import Detected, Found, Mocap
from dior.init.walks import Walk, listed, walks_named
from dior.project.todos import WORD

# chosen: motion capture is saved within so long after a walk, and an hour's difference is a time zone's or a copy's
SAVED_WITHIN_NS = 600 * 10**9
# a path with {camera}, the camera's name by path, the tool
Detections: TypeAlias = tuple[str, dict[str, str], str]


@dataclass(frozen=True)
class Cell:
    """What a sheet is to say, empty for nothing, and the reason."""

    text: str = ""
    reason: str = ""

    @property
    def asked(self) -> bool:
        return self.text.startswith(WORD)


@dataclass(frozen=True, eq=False)
class Owned:
    """What is of one walk. `files`: path and tool of the detections of each camera; `unread`: why those of a camera
    cannot be read; `markers`: its motion capture; `doubts`: what a person should look at."""

    mocap: Cell = Cell()
    trigger: Cell = Cell()
    detections: Cell = Cell()
    stamps: Cell = Cell()
    files: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    markers: Mocap | None = None
    unread: Mapping[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()


def owned(
    root: Path, found: Found, filmed: Sequence[tuple[Walk, list[Filmed], str]], known: Collection[str]
) -> tuple[list[Owned], list[list[Filmed]], list[tuple[str, str]]]:
    """What is of each walk; its cameras, called as its detections; (path, reason) of what is of none.

    `filmed`: walks with their cameras and `videos` of the sheet; `known`: names that are those of cameras.
    """
    walks = [walk for walk, _, _ in filmed]
    sets, why, aside = detections_of(root, found, walks, [mine for _, mine, _ in filmed], known)
    of_walks = _called_as_detections(filmed, sets)
    mocap, triggers, markers, astray, left = mocap_of(root, found, walks, known)
    aside += [*astray, *left]
    moving = [path for path, _ in astray if not names.STATIC.search(PurePosixPath(path).stem)]
    lost, left = lost_of(found, walks, known)
    aside += left
    stamps, left = stamps_of(found, walks, of_walks, known)
    aside += left
    every = []
    for i, mine in enumerate(of_walks):
        called = {one.name for one in mine}
        cell, doubts = chosen(sets.get(i, ()), called, why.get(i, ""))
        if i in mocap and i not in sets:
            cell = Cell("", "none were found, and indoors none are needed")
        # which camera is far away any of them tells
        fitting = [(of, tool) for whole, of, tool in sets.get(i, ()) if cell.text == whole or f" {whole}" in cell.text]
        files, tool = fitting[0] if fitting else ({}, "")
        of_cameras = {camera: (path, tool) for path, name in files.items() for camera in ([name] if name else called)}
        unread = {
            name: f"{path}: {reason}"
            for whole, _, _ in sets.get(i, ()) if cell.text == whole
            for name in called - of_cameras.keys()
            for path, reason in found.aside if path == whole.replace("{camera}", name)
        }  # fmt: skip
        broken = markers[i].broken if i in markers else ""
        doubts += [f"{markers[i].path} could not be read: {broken}"] if broken else []
        if moving and i not in mocap:
            doubts.append(f"of no walk by name or time is {listed(moving)}; if this was indoors, its row needs its own")
        every.append(
            Owned(
                mocap.get(i, Cell()), triggers.get(i, Cell()), cell, stamps.get(i, Cell()), of_cameras, markers.get(i),
                unread, (*lost.get(i, ()), *doubts, *unread.values()),
            )
        )  # fmt: skip
    return every, of_walks, aside


def lost_of(
    found: Found, walks: Sequence[Walk], known: Collection[str]
) -> tuple[dict[int, list[str]], list[tuple[str, str]]]:
    """By walk what is to be said of its recordings that cannot be read; (path, reason) of those of no walk."""
    lost: dict[int, list[str]] = {}
    aside = []
    for path, reason in found.broken:
        named, _ = walks_named(path, walks, known)
        if len(named) == 1:
            at = next(i for i, walk in enumerate(walks) if walk is named[0])
            lost.setdefault(at, []).append(f"{path} could not be read ({reason}); its cameras are left out")
        else:
            aside.append((path, reason))
    return lost, aside


def _called_as_detections(
    filmed: Sequence[tuple[Walk, list[Filmed], str]], sets: Mapping[int, Sequence[Detections]]
) -> list[list[Filmed]]:
    """The cameras of bags, called as their detections where these have other names for them."""
    changed: dict[str, str] = {}
    for i, (_, mine, videos) in enumerate(filmed):
        for _, called, _ in sets.get(i, ()):
            wanted = {*called.values()} - {""}
            if not videos and wanted:
                changed |= cameras.renamed([one.name for one in mine], sorted(wanted)) or {}
    return [mine if videos else cameras.called_anew(mine, changed) for _, mine, videos in filmed]


def either(options: Sequence[str]) -> str:
    """A cell that asks which of several it is."""
    return f"{WORD}: {' or '.join(options)}"


def mocap_of(
    root: Path, found: Found, walks: Sequence[Walk], known: Collection[str]
) -> tuple[dict[int, Cell], dict[int, Cell], dict[int, Mocap], list[tuple[str, str]], list[tuple[str, str]]]:
    """By walk its motion capture and its trigger log; the files; what belongs to none, and what is there again."""
    options: dict[int, list[tuple[Mocap, str, bool]]] = {}
    astray: list[tuple[str, str]] = []
    aside: list[tuple[str, str]] = []
    logged = {i: _logged(found, walk) for i, walk in enumerate(walks)}
    for one in found.mocap:
        stem = PurePosixPath(one.path).stem.casefold()
        by_log = [i for i, captures in logged.items() if any(name.casefold() == stem for _, name in captures)]
        if len(by_log) == 1:
            log, name = next(pair for pair in logged[by_log[0]] if pair[1].casefold() == stem)
            reason = f"{log} says that {name} was captured while the pictures were taken"
            options.setdefault(by_log[0], []).append((one, reason, True))
            continue
        named, why = walks_named(one.path, walks, known)
        if len(named) != 1 and (saved := _saved_after(one, walks)) is not None:
            named, why = [saved], "was saved within ten minutes after it, before any other walk began"
        for walk in named if len(named) <= 1 else []:
            at = next(i for i, other in enumerate(walks) if other is walk)
            options.setdefault(at, []).append((one, f"{one.path} {why}", False))
        unread = f"could not be read ({one.broken}); " if one.broken else ""
        if not named:
            astray.append((one.path, f"{unread}{why}"))
        elif len(named) > 1:
            astray.append((one.path, f"{unread}may be of {len(named)} walks; name it in the row of the right one"))
    cells: dict[int, Cell] = {}
    files: dict[int, Mocap] = {}
    for i, mine in options.items():
        sure = [one for one in mine if one[2]] or [
            one for one in mine if names.walk_key(one[0].path, known) in walks[i].keys] or mine  # fmt: skip
        aside += [(one[0].path, f"is of the walk of {sure[0][0].path} by its name, and that is nearer") for one in mine
                  if one not in sure]  # fmt: skip
        first, *others = copies.in_order(root, [one.path for one, _, _ in sure])
        again = [path for path in others if copies.same_files(root / first, root / path)]
        aside += [(path, f"is a copy of {first}, which is used") for path in again]
        sure = [one for one in sure if one[0].path not in again]
        if len(sure) == 1:
            files[i], reason, _ = sure[0]
            cells[i] = Cell(files[i].path, f"{reason} ({_about(files[i])})")
            stem = PurePosixPath(files[i].path).stem
            if names.STATIC.search(stem) and not any(names.STATIC.search(key) for key in walks[i].keys):
                why = f"{reason}; by its name of somebody who stands: name that of the walk, or write it as it is"
                cells[i] = Cell(either([files[i].path]), why)
            if files[i].broken:
                cells[i] = Cell(either([files[i].path]), f"{reason}; copy it again, or empty this for a walk outdoors")
        else:
            paths = [one.path for one, _, _ in sure]
            unread = "".join(f"; {one.path} could not be read ({one.broken})" for one, _, _ in sure if one.broken)
            cells[i] = Cell(either(paths), f"{len(paths)} files with motion capture may be of it{unread}")
    triggers = {i: _trigger(found, logged[i], files.get(i)) for i in cells if logged[i]}
    return cells, triggers, files, astray, aside


def _about(mocap: Mocap) -> str:
    length = f", {mocap.seconds:.1f} s" if mocap.seconds else ""
    return f"{mocap.tool}{length}" + (f"; {mocap.note}" if mocap.note else "")


def _logged(found: Found, walk: Walk) -> list[tuple[str, str]]:
    """(log, name) of the captures that ran while a walk's pictures were taken."""
    if walk.first_ns is None or walk.last_ns is None:
        return []
    first, last = walk.first_ns, walk.last_ns
    return [
        (path, capture.name)
        for path, captures in found.trigger_logs
        for capture in captures
        if _ran_ns(capture, captures, first, last) > 0
    ]


def _ran_ns(capture: Capture, captures: Sequence[Capture], first_ns: int, last_ns: int) -> int:
    later = [one.start_ns for one in captures if one.start_ns > capture.start_ns]
    end = capture.stop_ns if capture.stop_ns is not None else min(later, default=last_ns)
    return min(end, last_ns) - max(capture.start_ns, first_ns)


def _trigger(found: Found, logged: Sequence[tuple[str, str]], mocap: Mocap | None) -> Cell:
    stem = PurePosixPath(mocap.path).stem.casefold() if mocap else ""
    called = [(log, name) for log, name in logged if name.casefold() == stem] or list(logged)
    if len(called) > 1:
        return Cell(either([f"{log}#{name}" for log, name in called]), "several captures ran meanwhile")
    log, name = called[0]
    behind = "" if name.casefold() == stem else f"#{name}"
    return Cell(f"{log}{behind}", f"its capture {name} ran while the pictures were taken")


def _saved_after(mocap: Mocap, walks: Sequence[Walk]) -> Walk | None:
    before = [walk for walk in walks if walk.last_ns is not None and walk.last_ns <= mocap.saved_ns]
    last = max(before, key=lambda walk: walk.last_ns or 0, default=None)
    return last if last and mocap.saved_ns - (last.last_ns or 0) <= SAVED_WITHIN_NS else None


def detections_of(
    root: Path, found: Found, walks: Sequence[Walk], of_walks: Sequence[Sequence[Filmed]], known: Collection[str]
) -> tuple[dict[int, list[Detections]], dict[int, str], list[tuple[str, str]]]:
    """By walk the sets of detections that are its: (path with {camera}, camera's name by path, tool), and why they are
    its; what belongs to none. `known`: all names of cameras."""
    mine: dict[int, dict[tuple[str, str], list[str]]] = {}
    why: dict[int, str] = {}
    aside: list[tuple[str, str]] = []
    for one in found.detections:
        at, reason = _walk_of(one, walks, known)
        if at is None:
            aside.append((one.path, reason))
            continue
        why.setdefault(at, reason)
        kin = one.tool, names.without_cameras(one.path, known)
        mine.setdefault(at, {}).setdefault(kin, []).append(one.path)
    sets: dict[int, list[Detections]] = {}
    for at, kins in mine.items():
        called = [one.name for one in of_walks[at]]
        for (tool, _), paths in kins.items():
            if READERS[tool].all_cameras and len(paths) == 1:
                sets.setdefault(at, []).append((paths[0], dict.fromkeys(paths, ""), tool))
                continue
            given = names.pattern(paths, called)
            if given is None:
                aside += [(path, "one path with {camera} in it must tell whose each is; rename them") for path in paths]
            else:
                sets.setdefault(at, []).append((*given, tool))
    for at, of_walk in sets.items():
        sets[at], left = _once(root, of_walk)
        aside += left
    return sets, why, aside


def _once(root: Path, sets: Sequence[Detections]) -> tuple[list[Detections], list[tuple[str, str]]]:
    """Sets of detections without those that are copies of others, and (path, reason) of these."""
    kept: list[Detections] = []
    aside: list[tuple[str, str]] = []
    order = copies.in_order(root, [whole for whole, _, _ in sets])
    for whole, of, tool in sorted(sets, key=lambda one: order.index(one[0])):
        files = {name: path for path, name in of.items()}
        same = next((other for other in kept if other[2] == tool and _agree(root, files, other[1])), None)
        if same is None:
            kept.append((whole, of, tool))
        else:
            aside += [(path, f"is a copy of that of {same[0]}, which is used") for path in of]
    return [one for one in sets if one in kept], aside


def _agree(root: Path, files: Mapping[str, str], other: Mapping[str, str]) -> bool:
    """Whether the files of the cameras, by name, are there in another set (names by path) with the same content."""
    theirs = {name: path for path, name in other.items()}
    return all(name in theirs and copies.same_files(root / path, root / theirs[name]) for name, path in files.items())


def _walk_of(one: Detected, walks: Sequence[Walk], known: Collection[str]) -> tuple[int | None, str]:
    if one.stamp_ns is not None:
        during = [
            i for i, walk in enumerate(walks)
            if walk.first_ns is not None and walk.last_ns is not None
            and walk.first_ns <= one.stamp_ns <= walk.last_ns
        ]  # fmt: skip
        if len(during) == 1:
            return during[0], "their stamps are of its time"
    named, reason = walks_named(one.path, walks, known)
    if len(named) != 1:
        return None, reason if not named else f"may be of {len(named)} walks by its name"
    return next(i for i, walk in enumerate(walks) if walk is named[0]), f"each {reason}"


def stamps_of(
    found: Found, walks: Sequence[Walk], of_walks: Sequence[Sequence[Filmed]], known: Collection[str]
) -> tuple[dict[int, Cell], list[tuple[str, str]]]:
    """By walk the CSV files with the stamps of its videos; what belongs to none."""
    mine: dict[int, list[str]] = {}
    aside: list[tuple[str, str]] = []
    for path in found.stamps:
        named, reason = walks_named(path, walks, known)
        at = next((i for i, walk in enumerate(walks) if len(named) == 1 and walk is named[0]), None)
        if at is None or all(one.kind == "bag" for one in of_walks[at]):
            aside.append((path, reason if at is None else "holds stamps, and its walk has no videos"))
        else:
            mine.setdefault(at, []).append(path)
    cells = {}
    for at, paths in mine.items():
        called = [one.name for one in of_walks[at] if one.kind != "bag"]
        given = names.pattern(paths, called)
        if given and {*given[1].values()} >= {*called}:
            cells[at] = Cell(given[0], "stamps beside the videos")
        elif len(paths) == 1:
            cells[at] = Cell(paths[0], "stamps beside the videos")
        else:
            aside += [(path, "holds stamps, and is not called as a camera of its walk") for path in paths]
    return cells, aside


def chosen(sets: Sequence[Detections], called: Collection[str], why: str) -> tuple[Cell, list[str]]:
    """The cell of a walk's detections, `why` they are its; what a person should look at."""
    good = [one for one in sets if _fit(one, called)]
    if len(good) > 1:
        cell = Cell(
            either([whole for whole, _, _ in good]), "all of them may be meant; other tools' go into detectors.tsv"
        )
    elif good:
        cell = Cell(good[0][0], f"output of {READERS[good[0][2]].tool}: {why}")
    elif sets:
        there = ", ".join(sorted({name for _, of, _ in sets for name in of.values()}))
        return Cell(WORD, f"they are of {there}, and the cameras are {', '.join(sorted(called))}; rename them, or look "
                    "for the recordings of the others"), []  # fmt: skip
    else:
        return Cell(WORD, "none were found: a path with {camera} in it, or the word detect"), []
    lost = sorted({name for one in good for name in _others(one, called)})
    said = f"no recording of {', '.join(lost)} was found; detections of {'it' if len(lost) == 1 else 'them'} are there"
    return cell, [said] if lost else []


def _fit(one: Detections, called: Collection[str]) -> bool:
    """Whether detections are called as the cameras: those that are not have no recording, and are no camera that is
    called otherwise."""
    others = _others(one, called)
    if not others:
        return True
    without = {*called} - {*one[1].values()}
    alike = {names.numbers(name)[-1:] for name in others} & {names.numbers(name)[-1:] for name in without}
    return len(without) < len({*called}) and not alike


def _others(one: Detections, called: Collection[str]) -> set[str]:
    """Those of whom there are detections, and who are none of the cameras."""
    return {*one[1].values()} - {*called, ""}
