"""All that recordings tell of a capture: walks with what belongs to them, sessions with their cameras.

INPUTS   `found.Found`
OUTPUTS  `Capture`: what the sheets and the YAML files are to say, every guess with its reason
"""

import json
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np

from dior.calibrate.lens import realsense
from dior.calibrate.readers.given import GivenCamera, Lens, Pose
from dior.errors import DiorError
from dior.ingest import containers, messages
from dior.init import belongings, cameras, names, roles, walks
from dior.init.belongings import Cell
from dior.init.cameras import Filmed
from dior.init.found import Calibration, Found, Mocap
from dior.init.roles import Role, Seen
from dior.init.walks import Walk
from dior.project.todos import WORD

# chosen: a lab's day ends in the evening; nobody lunches so long
DAY_NS = 5 * 3600 * 10**9
# chosen: so many walks show which camera is far away
LOOKED_AT = 2
# chosen: the lenses of one device differ by 1 or 2 %, those of two kinds by more
SAME_FOCAL = 0.05
# chosen: two files that differ by less say the same of a lens and a pose
DIGITS = 6


@dataclass(frozen=True)
class Lensed:
    """Where a camera's lens and pose come from: options (file, name in it), the CameraInfo's words, the device."""

    lens_files: tuple[tuple[str, str], ...] = ()
    pose_files: tuple[tuple[str, str], ...] = ()
    pose: Pose | None = None
    device: str = ""
    info: str = ""


@dataclass(frozen=True, eq=False)
class Taken:
    """A walk as a row of the sheet: `name`, its cameras and cells. `seen`: by camera what was detected."""

    name: str
    walk: Walk
    cameras: tuple[Filmed, ...]
    indoor: bool
    subject: Cell
    videos: str
    stamps: Cell
    mocap: Cell
    trigger: Cell
    detections: Cell
    files: Mapping[str, tuple[str, str]]

    @property
    def paths(self) -> tuple[str, ...]:
        return tuple(one.path for one in self.walk.recordings)

    @property
    def bags(self) -> str:
        return ";".join(one.path for one in self.walk.recordings if one.kind == "bag")

    @property
    def pictures(self) -> int:
        """The fewest that one of its cameras took."""
        return min((one.stream.count for one in self.cameras), default=0)


@dataclass(frozen=True, eq=False)
class Session:
    """Walks that share their cameras' poses, why they do, and the cameras."""

    name: str
    taken: tuple[Taken, ...]
    reason: str
    cameras: tuple[Filmed, ...]
    roles: Mapping[str, Role]
    lenses: Mapping[str, Lensed]

    @property
    def indoor(self) -> bool:
        return self.taken[0].indoor


@dataclass(frozen=True, eq=False)
class Capture:
    """`first_frame`: number that the detector's files give the first picture, with the reason. `aside`: (path, reason)
    of what belongs to nothing."""

    sessions: tuple[Session, ...]
    first_frame: Cell
    aside: tuple[tuple[str, str], ...]


def of(root: Path, found: Found, devices: Sequence[str] = ()) -> Capture:
    """What the things that were found below `root` are to each other. `devices`: those that config.yaml knows."""
    from_bags = sorted({one.name for recording in found.recordings if recording.kind == "bag"
                        for one in cameras.filmed(Walk((recording,), ("",), ()), ())[0]})  # fmt: skip
    given = sorted(
        {name for one in found.calibrations for camera in one.cameras for name in (camera.name, *camera.also)}
    )
    # numbers and letters alone may be those of walks
    told = [name for name in (*from_bags, *given) if len(name) > 1 and any(letter.isalpha() for letter in name)]
    aside = list(found.aside)
    grouped: list[Walk] = []
    of_walks: list[list[Filmed]] = []
    videos: list[str] = []
    for walk in walks.walks_of(found.recordings, told):
        mine, whole, left = cameras.filmed(walk, given)
        aside += left
        if mine:
            grouped.append(walk)
            of_walks.append(mine)
            videos.append(whole)
    known = sorted({*told, *(one.name for mine in of_walks for one in mine if any(map(str.isalpha, one.name)))})
    sets, why, left = belongings.detections_of(found, grouped, of_walks, known)
    aside += left
    of_walks = _called_as_detections(of_walks, sets, videos)
    mocap, triggers, markers, left = belongings.mocap_of(found, grouped, known)
    aside += left
    stamps, left = belongings.stamps_of(found, grouped, of_walks, known)
    aside += left
    subjects = [_subject(walk, markers.get(i)) for i, walk in enumerate(grouped)]
    taken: list[Taken] = []
    for i, (walk, mine) in enumerate(zip(grouped, of_walks, strict=True)):
        called = {one.name for one in mine}
        cell = belongings.chosen(sets.get(i, ()), lambda of, called=called: {*of.values()} <= {*called, ""})  # type: ignore[misc]
        # which camera is far away any of them tells
        fitting = [(of, tool) for whole, of, tool in sets.get(i, ()) if cell.text == whole or f" {whole}" in cell.text]
        files, tool = fitting[0] if fitting else ({}, "")
        if cell.text == WORD and i in sets:
            there = ", ".join(sorted({name for _, of, _ in sets[i] for name in of.values()}))
            cell = Cell(
                WORD, f"there are detections of {there}, and the cameras are {', '.join(sorted(called))}; rename them"
            )
        elif i in why and files and not cell.asked:
            cell = Cell(cell.text, f"{cell.reason}: {why[i]}")
        indoor = i in mocap
        if indoor and cell.text == WORD:
            cell = Cell("", "none were found, and indoors none are needed")
        of_cameras = {camera: (path, tool) for path, name in files.items() for camera in ([name] if name else called)}
        taken.append(
            Taken("", walk, tuple(mine), indoor, subjects[i], videos[i], stamps.get(i, Cell()), mocap.get(i, Cell()),
                  triggers.get(i, Cell()), cell, of_cameras)
        )  # fmt: skip
    sessions, first = _sessions(root, _named(taken), found.calibrations, list(devices))
    used = {path for session in sessions for lensed in session.lenses.values()
            for path, _ in (*lensed.lens_files, *lensed.pose_files)}  # fmt: skip
    aside += [(one.path, "is a calibration whose cameras are called as none of a walk") for one in found.calibrations
              if one.path not in used]  # fmt: skip
    return Capture(tuple(sessions), first, tuple(sorted(aside)))


def _called_as_detections(
    of_walks: Sequence[list[Filmed]],
    sets: Mapping[int, Sequence[tuple[str, dict[str, str], str]]],
    videos: Sequence[str],
) -> list[list[Filmed]]:
    """The cameras of bags, called as their detections where these have other names for them."""
    changed: dict[str, str] = {}
    for i, mine in enumerate(of_walks):
        for _, called, _ in sets.get(i, ()):
            wanted = {*called.values()} - {""}
            if not videos[i] and wanted:
                changed |= cameras.renamed([one.name for one in mine], sorted(wanted)) or {}
    return [mine if videos[i] else cameras.called_anew(mine, changed) for i, mine in enumerate(of_walks)]


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
    key = names.without_people(names.without_date(one.walk.key))
    for person in people:
        key = "/".join(names.without(part, person) for part in key.split("/"))
    left = [part for part in key.split("/") if part]
    return names.valid("_".join(left[-parts:]))


def _sessions(
    root: Path, taken: Sequence[Taken], calibrations: Sequence[Calibration], devices: list[str]
) -> tuple[list[Session], Cell]:
    groups: dict[tuple[bool, str, tuple[tuple[str, str], ...], int, str], list[Taken]] = {}
    day: int = 0
    last: int | None = None
    for one in taken:
        if one.walk.first_ns is not None:
            day += last is not None and one.walk.first_ns - last > DAY_NS
            last = one.walk.last_ns
        lenses = {camera.name: _calibrated(one, camera, calibrations) for camera in one.cameras}
        key = (one.indoor, _place(one), tuple((camera.name, camera.topic) for camera in one.cameras),
               day if one.walk.first_ns is not None else -1, _same(lenses))  # fmt: skip
        groups.setdefault(key, []).append(one)
    sessions: list[Session] = []
    first = Cell()
    for key, mine in groups.items():
        name = _session_name(str(key[1]), mine, [other.name for other in sessions])
        filmed = _over_all(mine)
        seen = _seen(root, mine)
        lensed = {
            camera.name: _lensed(root, _calibrated(mine[0], camera, calibrations), camera, devices) for camera in filmed
        }
        why = [f"{len(mine)} walks" if len(mine) > 1 else "1 walk", "indoors" if mine[0].indoor else "outdoors"]
        why += [f"in {key[1]}"] if key[1] else []
        why += ["with the same cameras on one day, so with the same poses"] if len(mine) > 1 else []
        found = roles.roles_of(filmed, seen, not mine[0].indoor)
        sessions.append(Session(name, tuple(mine), ", ".join(why), tuple(filmed), found, lensed))
        first = first if first.text else _first_frame(seen, filmed)
    return sessions, first


def _place(one: Taken) -> str:
    """The folders around a walk that are nobody's name."""
    key = names.without_people(one.walk.key)
    return "/".join(key.split("/")[:-1])


def _session_name(place: str, mine: Sequence[Taken], taken: Sequence[str]) -> str:
    people = {one.subject.text for one in mine if not one.subject.asked}
    for person in people:
        place = names.without(place, person)
    name = names.valid(place.replace("/", "_")) or ("indoor" if mine[0].indoor else "outdoor")
    return names.unique(name, taken)


def _over_all(taken: Sequence[Taken]) -> list[Filmed]:
    """The cameras of a session, as in its first walk, `bag` being what holds for all."""
    found = []
    for i, camera in enumerate(taken[0].cameras):
        words = {one.cameras[i].bag for one in taken}
        found.append(replace(camera, bag=words.pop() if len(words) == 1 else WORD))
    return found


def _seen(root: Path, taken: Sequence[Taken]) -> dict[str, list[Seen]]:
    """By camera what was detected in the first walks that have detections."""
    found: dict[str, list[Seen]] = {}
    for one in [one for one in taken if one.files][:LOOKED_AT]:
        for camera in one.cameras:
            path, tool = one.files.get(camera.name, ("", ""))
            if path and (what := roles.seen(root / path, tool, camera)):
                found.setdefault(camera.name, []).append(what)
    return found


def _first_frame(seen: Mapping[str, Sequence[Seen]], filmed: Sequence[Filmed]) -> Cell:
    counts = {camera.name: camera.stream.count for camera in filmed if camera.kind != "video"}
    from_one = [name for name, of in seen.items() if of[0].first == 1 and of[0].last == counts.get(name)]
    if from_one:
        return Cell("1", f"the detections of {from_one[0]} have pictures 1 to {counts[from_one[0]]}")
    return Cell()


def _scope(path: str) -> tuple[str, ...]:
    """The folder that a calibration file is about: where it lies, but for a folder of calibrations."""
    parts = PurePosixPath(path).parent.parts
    return tuple(part for part in parts if not (names.BOARD.search(part) or part.lower() in ("reference", "cameras")))


def _calibrated(
    one: Taken, camera: Filmed, calibrations: Sequence[Calibration]
) -> list[tuple[Calibration, GivenCamera]]:
    """The calibrations nearest to a walk in which a camera is, by its name, or by the number in it."""
    inside = PurePosixPath(one.walk.folder).parts
    options: list[tuple[int, Calibration, GivenCamera]] = []
    for given in calibrations:
        scope = _scope(given.path)
        if inside[: len(scope)] != scope:
            continue
        known = {name: each for each in given.cameras for name in (each.name, *each.also)}
        mine = {other.name: _in_file(other.name, known) for other in one.cameras}
        if all(found is None for found in mine.values()) and len(known) == len(mine):
            by_number = {names.numbers(name)[-1:]: name for name in known}
            mine = {name: by_number.get(names.numbers(name)[-1:]) for name in mine} if () not in by_number else mine
        name = mine[camera.name]
        if name is not None:
            options.append((len(scope), given, known[name]))
    deepest = max((depth for depth, _, _ in options), default=0)
    return [(given, each) for depth, given, each in options if depth == deepest]


def _in_file(name: str, known: Collection[str]) -> str | None:
    if name in known:
        return name
    return next((other for other in known if names.plain(other) == names.plain(name)), None)


def _same(lenses: Mapping[str, list[tuple[Calibration, GivenCamera]]]) -> str:
    """What the calibrations of a walk say, so that walks of which they say the same are of one session."""
    return json.dumps({name: [_said(camera) for _, camera in options] for name, options in sorted(lenses.items())})


def _said(camera: GivenCamera) -> list[list[float]]:
    lens = [*camera.lens.K.ravel(), *camera.lens.distortion] if isinstance(camera.lens, Lens) else []
    pose = [*camera.pose.T.ravel()] if isinstance(camera.pose, Pose) else []
    return [[round(float(value), DIGITS) for value in values] for values in (lens, pose)]


def _lensed(
    root: Path, options: Sequence[tuple[Calibration, GivenCamera]], camera: Filmed, devices: list[str]
) -> Lensed:
    lens = tuple((given.path, each.name) for given, each in _distinct(options, "lens"))
    pose = tuple((given.path, each.name) for given, each in _distinct(options, "pose"))
    said = [each.pose for _, each in options if isinstance(each.pose, Pose)]
    device, info = _device(root, camera, devices) if camera.info else ("", "")
    return Lensed(lens, pose, said[0] if said else None, device, info)


def _is_near(digits: str, focal: float) -> bool:
    return digits.isdecimal() and abs(int(digits) - focal) <= SAME_FOCAL * focal


def _distinct(options: Sequence[tuple[Calibration, GivenCamera]], part: str) -> list[tuple[Calibration, GivenCamera]]:
    """Those that have a lens, or a pose, but for those that say the same as one before."""
    found: dict[str, tuple[Calibration, GivenCamera]] = {}
    for given, each in options:
        if not isinstance(getattr(each, part), DiorError):
            found.setdefault(json.dumps(_said(each)[part == "pose"]), (given, each))
    return list(found.values())


def _device(root: Path, camera: Filmed, devices: list[str]) -> tuple[str, str]:
    """The device that a camera is, where a person has to say its lens model, else empty; what its bag says.

    `devices`: those that are known, to which a new one is added.
    """
    for path in camera.paths:
        try:
            message = next(iter(containers.messages(root / path, {camera.info})), None)
            said = messages.camera_info(message.raw, message.wire) if message else None
        except (DiorError, *containers.BROKEN):
            continue
        if said is None:
            continue
        text = f"{said['model']}, {'no ' if not any(said['D']) else ''}distortion, fx {said['K'][0]:.1f}"
        own, _ = realsense.said_by_librealsense(said["model"], said["D"])
        if not (realsense.is_colour(camera.topic) and np.any(said["D"]) and not own):
            return "", text
        begin, focal = f"realsense_{said['width']}x{said['height']}_f", said["K"][0]
        alike = [one for one in devices if one.startswith(begin) and _is_near(one.removeprefix(begin), focal)]
        if not alike:
            alike = [f"{begin}{focal:.0f}"]
            devices += alike
        return alike[0], text
    return "", ""
