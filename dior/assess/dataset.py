"""Somebody else's dataset as `Recording`s: calibration, 2D and 3D found by what is in the files.

INPUTS   a folder with files of any tool that dior reads (`dior formats`), or a release of dior
OUTPUTS  `Recording`s, each with notes on what was taken for what
A recording is the 2D of one tool whose paths differ in the camera's name only. Its 3D is the one whose name says so, or
the only one. What no file says is assumed as a user of the dataset would, and said: the first picture is of the first
frame of the 3D, poses are world to camera, in metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.assess import explain
from dior.assess.recording import Motion, Recording, View
from dior.body.spellings import joint_of
from dior.calibrate.readers import files as calibrations
from dior.calibrate.readers.given import GivenCamera, intrinsics, placed
from dior.clocks.axis import nominal_fps, seconds
from dior.errors import DiorError, many
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.ingest import marker_names, mocap, mocap_files, people
from dior.ingest.detections import in_pixels
from dior.ingest.people import People
from dior.ingest.readers import READERS
from dior.init import names
from dior.init.found import Detected, Found, look
from dior.init.found import Recording as Video
from dior.tables import tables

# a score below which a detector guesses, as `detector.min_score` of config.yaml has it
MIN_SCORE = 0.3
# chosen: cameras in a room are not so far apart in m
FAR_APART = 50.0
# chosen: frames by which 2D and 3D of one rate may differ in number
SAME_COUNT = 2
# the axes of a TRC by Pose2Sim are (Y, Z, X) of its calibration's world
POSE2SIM = ((0, 0, 1), (1, 0, 0), (0, 1, 0))
# files beside markers that hold the joints of a skeleton
MOTION_SUFFIXES = (".trc", ".c3d", ".tsv", ".csv", ".parquet")


@dataclass(frozen=True, eq=False)
class Placed:
    """The cameras of the calibrations by name, other names of theirs, and notes."""

    cameras: dict[str, Camera]
    also: dict[str, tuple[str, ...]]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Moving:
    """3D of the file `path` as it may be meant: (what is said of its axes, the motion), the likeliest first."""

    path: str
    rate: float
    ways: tuple[tuple[str, Motion], ...]


def read(folder: Path, calibration: Path | None = None, fps: float = 0.0) -> list[Recording]:
    """The recordings of a dataset. Raises DiorError where there is no calibration or no 2D, with what was found."""
    if not folder.is_dir():
        raise DiorError(f"{folder}: there is no such folder; name the folder of the dataset")
    if (folder / "cameras.parquet").is_file() and (folder / "sequences.parquet").is_file():
        return of_release(folder)
    found = look(folder, folder)
    rig = _rig(folder, found, calibration)
    if not found.detections:
        raise DiorError(
            f"{folder}: there is no 2D that is read (`dior formats detections` lists what is); for videos run a pose "
            "detector on each of them first, `dior formats detections` says which"
        )
    moving = _motions(folder, found)
    groups: dict[str, list[Detected]] = {}
    for one in found.detections:
        key = names.without_cameras(one.path, [name for also in rig.also.values() for name in also]).strip("/ _.-")
        groups.setdefault(key, []).append(one)
    recordings = []
    for key, files in sorted(groups.items()):
        recordings += _recording(folder, key, files, rig, moving, found.recordings, fps)
    if not recordings:
        known = ", ".join(sorted(rig.cameras))
        raise DiorError(
            f"{folder}: no file of 2D has the name of a camera of the calibration in its path ({known}), such as "
            f"{found.detections[0].path}; name files or folders by their cameras"
        )
    return recordings


def _rig(folder: Path, found: Found, calibration: Path | None) -> Placed:
    """The cameras that have lens and pose."""
    given = (
        [(str(calibration), tuple(calibrations.cameras(calibration)))]
        if calibration is not None
        else [(one.path, one.cameras) for one in found.calibrations]
    )
    if not given:
        raise DiorError(
            f"{folder}: there is no calibration that is read (`dior formats calibrations` lists what is); name one by "
            "--calibration"
        )
    cameras: dict[str, Camera] = {}
    also: dict[str, tuple[str, ...]] = {}
    notes, wrong = [], []
    given = sorted(given, key=lambda one: (-sum(not isinstance(c.pose, DiorError) for c in one[1]), one[0]))
    for path, each in given:
        try:
            own, assumed = _cameras(each, path)
        except DiorError as error:
            wrong.append(error)
            continue
        new = {name: camera for name, camera in own.items() if name not in cameras}
        if not new:
            notes.append(f"{path} is left aside, it has the same cameras; --calibration {path} takes it")
            continue
        cameras |= new
        also |= {c.name: (c.name, *c.also) for c in each if c.name in new}
        notes.append(f"calibration {path}: {', '.join(new)}{assumed}")
    if not cameras:
        raise wrong[0] if wrong else DiorError(f"{folder}: no calibration has lens and pose of a camera")
    return Placed(cameras, also, tuple(notes))


def _cameras(given: Sequence[GivenCamera], path: str) -> tuple[dict[str, Camera], str]:
    """The cameras of a file with lens and pose, and what was assumed. Raises DiorError where none has both."""
    out, errors = {}, []
    poses = [one.pose.T for one in given if not isinstance(one.pose, DiorError)]
    far = len(poses) > 1 and np.ptp([T[:3, 3] for T in poses], axis=0).max() > FAR_APART
    assumed: set[str] = set()
    for one in given:
        try:
            lens = intrinsics(one, "", f"{path} [{one.name}]")
            if isinstance(one.pose, DiorError):
                raise one.pose
            convention = "" if one.pose.convention else "cTw"
            units = "" if one.pose.units else ("mm" if far else "m")
            assumed |= {word for word in (convention and "poses world to camera", units and f"in {units}") if word}
            out[one.name] = Camera(one.name, lens, placed(one, path, convention, units, "from_walk"))
        except DiorError as error:
            errors.append(error)
    if not out:
        raise errors[0] if errors else DiorError(f"{path}: no camera")
    return out, f" (taken for {' '.join(sorted(assumed, reverse=True))})" if assumed else ""


def camera_of(path: str, rig: Placed) -> str | None:
    """The camera of the calibration that a path names, the last word of the path first."""
    words = [word for part in path.split("/") for word in (*names.DEVICE.findall(part), part, names.stem(part))]
    by_plain = {names.plain(name): camera for camera, also in rig.also.items() for name in also}
    for word in reversed(words):
        if camera := by_plain.get(names.plain(word)):
            return camera
    standing = [
        (path.lower().rindex(name.lower()), camera)
        for camera, also in rig.also.items()
        for name in also
        if names.holds(path, name)
    ]
    return max(standing)[1] if standing else None


def _recording(
    folder: Path,
    key: str,
    files: Sequence[Detected],
    rig: Placed,
    moving: Sequence[Moving],
    videos: Sequence[Video],
    fps: float,
) -> list[Recording]:
    """The recording of the files of 2D that are alike, none where no camera of the calibration is among them."""
    notes = list(rig.notes)
    found: dict[str, tuple[People, str]] = {}
    for one in files:
        reader = READERS[one.tool]
        of: list[str | None] = [*sorted(rig.cameras)] if reader.all_cameras else [camera_of(one.path, rig)]
        for name in of:
            if name is None:
                notes.append(f"{one.path} is left aside: no camera of the calibration is in its path")
                continue
            if name in found:
                notes.append(f"{one.path} is left aside: {found[name][1]} is of {name} as well")
                continue
            lens = rig.cameras[name].intrinsics
            read = reader.read(folder / one.path, name)
            if len(read.frame):
                found[name] = in_pixels(read, reader, (lens.width, lens.height), one.path, key), one.path
    if not found:
        return []
    motion = _motion_of(key, [path for _, path in found.values()], moving, rig)
    if motion is None and moving:
        notes.append(f"none of the {many(len(moving), 'file')} with 3D has its name: the cameras are compared")
    rates = {name: _rate(name, one, motion, videos, rig, fps, key) for name, (one, _) in found.items()}
    first = _first_frame([one for one, _ in found.values()])
    views, joints = _views(found, rates, rig, first)
    tools = ", ".join(sorted({READERS[one.tool].tool for one in files}))
    notes.append(f"2D by {tools}: {', '.join(path for _, path in found.values())}")
    name = "/".join(part for part in (one.strip(" _.-") for one in names.stem(key).split("/")) if part)
    out = Recording(name or "recording", joints, views, None)
    if motion is None:
        return [replace(out, notes=tuple(notes))]
    ways = [(said, replace(out, motion=way)) for said, way in motion.ways]
    said, best = min(ways, key=lambda one: float(np.nan_to_num(explain.misses(one[1]), nan=1e9).mean())) if len(
        ways
    ) > 1 else ways[0]  # fmt: skip
    notes.append(f"3D {motion.path}, {motion.rate:g} Hz{said}")
    return [replace(best, notes=tuple(notes))]


def _motion_of(key: str, paths: Sequence[str], moving: Sequence[Moving], rig: Placed) -> Moving | None:
    """The 3D of a recording, by its name or because it is the only one."""
    cameras = [name for also in rig.also.values() for name in also]
    own = {names.walk_key(path, cameras) for path in paths}
    stems = {one.path: names.walk_key(one.path, cameras) for one in moving}
    same = [one for one in moving if stems[one.path] in own]
    same = same or [
        one
        for one in moving
        if any(names.holds(walk, names.stem(Path(one.path).name)) or names.holds(stems[one.path], walk) for walk in own)
    ]
    return same[0] if len(same) == 1 else moving[0] if len(moving) == 1 else None


def _rate(
    name: str, found: People, motion: Moving | None, videos: Sequence[Video], rig: Placed, fps: float, key: str
) -> float:
    """Pictures a second of a camera's 2D, 0 where they have stamps of their own."""
    if (found.stamp_ns >= 0).all() and len(found.stamp_ns) > 1:
        return 0.0
    if fps:
        return fps
    own = [stream.fps for one in videos if camera_of(one.path, rig) == name for stream in one.streams if stream.fps]
    if own:
        return own[0]
    if motion is not None:
        count = int(found.ran.max()) - int(found.ran.min()) + 1
        if abs(count - len(motion.ways[0][1].t)) <= SAME_COUNT:
            return motion.rate
    raise DiorError(
        f"{key or 'the 2D'}: nothing says how many pictures a second {name} took: neither stamps in its 2D nor a "
        "video of its name, nor 3D with as many frames; say it by --fps"
    )


def _first_frame(found: Sequence[People]) -> int:
    """The number of the first picture: 0, or 1 where every camera's files begin with it."""
    return 1 if all(int(one.ran.min()) == 1 for one in found) else 0


def _views(
    found: dict[str, tuple[People, str]], rates: dict[str, float], rig: Placed, first: int
) -> tuple[tuple[View, ...], tuple[str, ...]]:
    """The views on one time axis, with the joints that all of them have."""
    joints = [list(one.joints) for one, _ in found.values()]
    common = tuple(name for name in joints[0] if all(name in other for other in joints))
    stamps = {name: _stamps(one, rates[name], first) for name, (one, _) in found.items()}
    start = min(int(own[0]) for own in stamps.values()) if all(not rate for rate in rates.values()) else 0
    views = []
    for name, (one, _) in sorted(found.items()):
        own = stamps[name]
        uv = _subject(one, own, first)[:, [one.joints.index(joint) for joint in common]]
        views.append(View(rig.cameras[name], seconds(own, start), uv, rates[name] or nominal_fps(own)))
    return tuple(views), common


def _stamps(found: People, rate: float, first: int) -> Ints:
    """Time (F,) ns of each picture up to the last that was looked at."""
    if rate:
        return np.round(np.arange(int(found.ran.max()) + 1 - first) * 1e9 / rate).astype(np.int64)
    if found.by_stamp:
        return found.stamp_ns
    frames = np.arange(int(found.ran.max()) + 1 - first)
    return np.round(np.interp(frames, found.ran - first, found.stamp_ns - found.stamp_ns[0])).astype(np.int64) + int(
        found.stamp_ns[0]
    )


def _subject(found: People, stamps: Ints, first: int) -> Floats:
    """The 2D (F, J, 2) of the one person who is followed through a camera's pictures."""
    if first and not found.by_stamp:
        found = replace(found, frame=found.frame - first, ran=found.ran - first)
    row = people.follow(found, stamps).row
    uv = np.full((len(stamps), len(found.joints), 2), np.nan)
    there = np.flatnonzero(row >= 0)
    sure = (found.score[row[there]] >= MIN_SCORE)[..., None]
    uv[there] = np.where(sure, found.uv[row[there]], np.nan)
    return uv


def _motions(folder: Path, found: Found) -> list[Moving]:
    """Every file with 3D of markers or joints."""
    paths = [one.path for one in found.mocap if not one.broken]
    paths += [path for path, _ in found.aside if path.lower().endswith(MOTION_SUFFIXES)]
    out = []
    for path in sorted(set(paths)):
        try:
            out.append(_skeletons(folder, path) if path.endswith(".parquet") else _captured(folder, path))
        except DiorError:
            # another table, or a file of something else
            continue
    return out


def _skeletons(folder: Path, path: str) -> Moving:
    """A table `skeletons_3d` of dior."""
    t, xyz, joints = skeleton(tables.read(folder / path, "skeletons_3d"))
    return Moving(path, 1 / float(np.median(np.diff(t))), (("", Motion(t, xyz, joints)),))


def skeleton(table: Table) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Times (I,) s after the first instant, points (I, J, 3) and joints of a table `skeletons_3d`."""
    xyz, joints = tables.grid(table, "x", "y", "z")
    stamps = table["stamp_ns"].reshape(len(xyz), -1)[:, 0]
    return seconds(stamps, stamps[0]), xyz.astype(float), tuple(joints)


def _captured(folder: Path, path: str) -> Moving:
    """Markers or joints of a file of motion capture, turned Z up as it says of itself. Raises DiorError without any."""
    kind, capture = mocap_files.read(folder / path)
    if not capture.rate > 0:
        raise DiorError(f"{path}: it has no rate")
    try:
        place = dict(marker_names.find(capture.labels, path).place)
    except DiorError:
        words = [(joint_of(label.rpartition(":")[2]), i) for i, label in enumerate(capture.labels)]
        place = {name: i for name, i in words if name}
    if len(place) < marker_names.FEWEST:
        raise DiorError(f"{path}: neither markers nor joints that are known by name")
    xyz = np.asarray(capture.points(list(place.values())), float)
    xyz = np.where((~np.isfinite(xyz).all(axis=-1) | (xyz == 0).all(axis=-1))[..., None], np.nan, xyz)
    try:
        xyz = xyz * mocap.METRES[mocap.unit_of(capture, path, kind)]
        said = ""
    except DiorError:
        said = ", its unit is not said and taken for m"
    t = np.arange(capture.frames) / capture.rate
    ways = [("" if capture.up in ("", "z") else f", {capture.up} up", mocap.UP[capture.up or "z"])]
    if kind == "trc":
        ways += [(", axes (Y, Z, X) as Pose2Sim writes them", POSE2SIM), (", Z up", mocap.UP["z"])]
    return Moving(
        path,
        capture.rate,
        tuple((said + way, Motion(t, xyz @ np.array(axes, float).T, tuple(place))) for way, axes in ways),
    )


def of_release(folder: Path) -> list[Recording]:
    """The walks of a release of dior: its 3D and clocks against the detections in it."""
    sheet = tables.read(folder / "sequences.parquet", "sequences")
    rig = camera_tables.read_released_cameras(folder / "cameras.parquet")
    clocks = tables.read(folder / "clocks.parquet", "released_clocks")
    told = {
        (sequence, camera): (float(offset), float(drift))
        for sequence, camera, offset, drift in zip(
            *(clocks[key] for key in ("sequence", "camera", "offset_s", "drift_ppm")), strict=True
        )
    }
    out = []
    for sequence, session, subject in zip(*(sheet[key] for key in ("sequence", "session", "subject")), strict=True):
        path = folder / f"skeletons_3d/{subject}/{sequence}.parquet"
        if not path.is_file():
            continue
        table = tables.read(path, "skeletons_3d")
        t, xyz, joints = skeleton(table)
        start = int(table["stamp_ns"].min())
        seen = {}
        for file in sorted((folder / f"detections/{subject}").glob(f"{sequence}.*.parquet")):
            camera = file.name.removesuffix(".parquet").rpartition(".")[2]
            # of a camera that moved within a session there is no one pose
            if (session, camera) in rig and rig[session, camera].wTc is not None:
                seen[camera] = _released(
                    tables.read(file, "released_detections"), start, told.get((sequence, camera), (0.0, 0.0))
                )
        if not seen:
            continue
        common = [name for name in next(iter(seen.values()))[2] if all(name in own[2] for own in seen.values())]
        views = tuple(
            View(rig[session, camera], times, uv[:, [own.index(name) for name in common]], fps)
            for camera, (times, uv, own, fps) in seen.items()
        )
        out.append(Recording(sequence, tuple(common), views, Motion(t, xyz, joints), ("a release of dior",)))
    if not out:
        raise DiorError(
            f"{folder}: no walk of the release has both 3D and detections, so that its labels are compared with nothing"
        )
    return out


def _released(table: Table, start_ns: int, clock: tuple[float, float]) -> tuple[Floats, Floats, list[str], float]:
    """Times (F,) s, pixels (F, J, 2), joints and pictures a second of a camera's detections in a release."""
    values, joints = tables.grid(table, "u", "v", "score")
    stamps = table["stamp_ns"].reshape(len(values), -1)[:, 0]
    with np.errstate(invalid="ignore"):
        uv = np.where((values[..., 2] >= MIN_SCORE)[..., None], values[..., :2], np.nan).astype(float)
    return seconds(stamps, start_ns, *clock), uv, joints, nominal_fps(stamps)
