"""Which walks share their cameras' poses, and what is known of these cameras: roles, lenses, poses.

INPUTS   `Taken` walks, calibrations
OUTPUTS  `Session`s
"""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np

from dior.calibrate.lens import realsense
from dior.calibrate.readers.given import GivenCamera, Lens, Pose
from dior.errors import DiorError
from dior.ingest import containers, messages
from dior.init import names, roles
from dior.init.belongings import Cell, Owned
from dior.init.cameras import Filmed
from dior.init.found import Calibration, reason_of
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

    @property
    def files(self) -> tuple[str, ...]:
        """The calibration files that it is in."""
        return tuple(path for path, _ in (*self.lens_files, *self.pose_files))


@dataclass(frozen=True, eq=False)
class Taken:
    """A walk as a row of the sheet: `name`, its cameras, `videos` (a path with {camera}), and what is its;
    `environment`: as a sheet that is there says."""

    name: str
    walk: Walk
    cameras: tuple[Filmed, ...]
    subject: Cell
    videos: str
    owned: Owned
    environment: str = ""

    @property
    def indoor(self) -> bool:
        return self.environment == "indoor" if self.environment else bool(self.owned.mocap.text)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a person should look at."""
        return (*self.walk.doubts, *self.owned.doubts)

    @property
    def paths(self) -> tuple[str, ...]:
        """What the sheet calls its recordings: bags, and one path for all videos."""
        bags = [one.path for one in self.walk.recordings if one.kind == "bag"]
        return (*bags, self.videos) if self.videos else tuple(bags)

    @property
    def files(self) -> tuple[str, ...]:
        """Its bags, and the videos of its cameras."""
        bags = [one.path for one in self.walk.recordings if one.kind == "bag"]
        return (*bags, *(path for one in self.cameras if one.kind != "bag" for path in one.paths))

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


def sessions_of(
    root: Path, taken: Sequence[Taken], calibrations: Sequence[Calibration], devices: list[str]
) -> tuple[list[Session], Cell]:
    """The sessions, and the number that the detector gives the first picture, with the reason, where it is not 0.

    `devices`: those that are known, to which new ones are added.
    """
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
        seen, unread = _seen(root, mine)
        lensed = {
            camera.name: _lensed(root, _calibrated(mine[0], camera, calibrations), camera, devices) for camera in filmed
        }
        why = [f"{len(mine)} walks" if len(mine) > 1 else "1 walk", "indoors" if mine[0].indoor else "outdoors"]
        why += [f"in {key[1]}"] if key[1] else []
        why += ["with the same cameras on one day, so with the same poses"] if len(mine) > 1 else []
        found = roles.roles_of(filmed, seen, not mine[0].indoor, unread)
        sessions.append(Session(name, tuple(mine), ", ".join(why), tuple(filmed), found, lensed))
        first = first if first.text else _first_frame(seen, filmed)
    return sessions, first


def _place(one: Taken) -> str:
    """The folders around a walk that are nobody's name."""
    # its last part is the walk, and not what one of its cameras is called
    key = names.without_people(names.common(one.walk.keys) or one.walk.keys[0])
    return "/".join(key.split("/")[:-1])


def _session_name(place: str, mine: Sequence[Taken], taken: Sequence[str]) -> str:
    place = names.without_dates(place)
    for person in sorted({one.subject.text for one in mine if not one.subject.asked}):
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


def _seen(root: Path, taken: Sequence[Taken]) -> tuple[dict[str, list[Seen]], dict[str, str]]:
    """By camera what was detected in the first walks that have detections, and why they cannot be read."""
    found: dict[str, list[Seen]] = {}
    unread: dict[str, str] = {}
    for one in [one for one in taken if one.owned.files][:LOOKED_AT]:
        unread |= one.owned.unread
        for camera in one.cameras:
            path, tool = one.owned.files.get(camera.name, ("", ""))
            try:
                what = roles.seen(root / path, tool, camera) if path else None
            except (DiorError, ValueError, OSError) as error:
                unread[camera.name] = f"{path}: {reason_of(error, root / path, path)}"
                continue
            if what:
                found.setdefault(camera.name, []).append(what)
    return found, unread


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
