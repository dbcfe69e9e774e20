"""What lies below the folder of the recordings: each file or folder is known by its content, never by its name.

INPUTS   a folder
OUTPUTS  `Found`: recordings, motion capture, detections, stamps of videos, calibrations, trigger logs, and what is none
         of them, with the reason
Of a recording its index is read (`glance`), of everything else the beginning, but for motion capture and calibrations.
"""

import os
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

from dior.body.spellings import joint_of
from dior.calibrate.readers import files as calibrations
from dior.calibrate.readers.given import GivenCamera
from dior.errors import DiorError
from dior.ingest import containers, marker_names, mocap_files, picture_folders, trigger_log, video_stamps, videos
from dior.ingest.bag_reader import ZSTD_MAGIC
from dior.ingest.glance import Stream, glance
from dior.ingest.messages import PICTURES
from dior.ingest.readers import READERS
from dior.ingest.readers.recognise import SUFFIXES, recognise
from dior.init import names
from dior.progress import reporting
from dior.project.plain_text import unmarked

# chosen: fewer pictures are no walk, and more files of a tool that writes one per picture are no cameras
FEWEST_PICTURES, MANY_FILES = 30, 20
# a stamp before it counts from when a camera or computer was switched on
SINCE_ITS_START_NS = video_stamps.NO_DATE_NS
CALIBRATIONS = (".toml", ".yaml", ".yml", ".xml", ".json", ".xcp", ".txt", ".pickle")
BAG_ENDINGS = (".bag", ".db3", ".mcap")
# of what `videos` reads
VIDEO_ENDINGS = (".mp4", ".mov", ".avi", ".mkv", ".m4v")
C3D_ENDING = ".c3d"
# what separates paths, wildcards, quotes, line ends, what is no UTF-8, and blanks that a sheet strips
UNWRITABLE = re.compile(r'[;{}"\x00-\x1f\x7f\ud800-\udfff]|^\s|\s$')
# beside a database of ROS 2
JOURNALS = ("-wal", "-shm")
NONE_OF_THEM = "is no recording, motion capture, detections or calibration that is read"
# what operating systems leave
LITTER = ("thumbs.db", "desktop.ini")
HEAD_BYTES = 1 << 12
USUAL_FPS = 30.0


@dataclass(frozen=True)
class Recording:
    """A bag, video or folder of pictures (`kind`: bag, video, pictures) at `path`, and its `streams` of pictures.

    `first_ns`, `last_ns`: when the pictures were taken, None if nothing tells; `by`: stamps, creation or name, what
    that is by; a name's is in no known time zone. `topics`: all that are in it, with their message types; `again`:
    (topic, path) of those whose pictures are in another one, too.
    """

    path: str
    kind: str
    streams: tuple[Stream, ...]
    first_ns: int | None
    last_ns: int | None
    by: str
    topics: dict[str, str] = field(default_factory=dict)
    again: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Mocap:
    """A file with motion capture: `tool`, length in s (None without a rate), what its labels begin with; `saved_ns`:
    when it was written; `note`: what a person should know of its markers; `broken`: why it cannot be read."""

    path: str
    tool: str
    seconds: float | None
    prefixes: tuple[str, ...]
    saved_ns: int
    note: str = ""
    broken: str = ""


@dataclass(frozen=True)
class Detected:
    """Detections by a tool (key of `READERS`), with the first stamp in them, None if they have none."""

    path: str
    tool: str
    stamp_ns: int | None


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibration file and its cameras."""

    path: str
    cameras: tuple[GivenCamera, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """All that lies below a folder, in the order of the paths, which are relative to it. `aside`: (path, reason), and
    `broken` those of recordings that cannot be read."""

    recordings: list[Recording] = field(default_factory=list)
    mocap: list[Mocap] = field(default_factory=list)
    detections: list[Detected] = field(default_factory=list)
    stamps: list[str] = field(default_factory=list)
    calibrations: list[Calibration] = field(default_factory=list)
    trigger_logs: list[tuple[str, tuple[trigger_log.Capture, ...]]] = field(default_factory=list)
    aside: list[tuple[str, str]] = field(default_factory=list)
    broken: list[tuple[str, str]] = field(default_factory=list)


def look(root: Path, below: Path) -> Found:
    """Everything in the folder `below`, which is `root` or in it; paths are relative to `root`."""
    found = Found()
    every = list(_units(below))
    for path in reporting(every, lambda: len(every), "files", str(below)):
        shown = path.relative_to(root).as_posix() if path != root else root.name
        if UNWRITABLE.search(shown):
            found.aside.append((repr(shown), "has a sign in its name that no sheet can hold; rename it"))
            continue
        try:
            _sort(path, shown, found)
        except (DiorError, OSError, ValueError) as error:
            _put_broken(path, shown, reason_of(error, path, shown), found)
    return found


def _missing_right(path: Path, shown: str) -> str:
    """What gives the right to read a file, or the outermost folder that bars the way to it."""
    steps = [*reversed(PurePosixPath(shown).parents[:-1]), PurePosixPath(shown)]
    above = path.parents[len(steps) - 1]
    barred = next((one for one in steps if not os.access(above / one, os.R_OK | os.X_OK)), steps[-1])
    return f"u+r{'x' if os.path.isdir(above / barred) else ''} {shlex.quote(str(barred))}"


def _put_broken(path: Path, shown: str, reason: str, found: Found) -> None:
    """Put what cannot be read where it would belong, by its name if its bytes do not say."""
    name = path.name.lower()
    if any(end in name for end in BAG_ENDINGS) or name.endswith(VIDEO_ENDINGS):
        found.broken.append((shown, reason))
    elif name.endswith(C3D_ENDING):
        found.mocap.append(_broken_mocap(path, shown, "C3D", reason))
    else:
        found.aside.append((shown, reason))


def _broken_mocap(path: Path, shown: str, tool: str, reason: str) -> Mocap:
    try:
        saved_ns = path.stat().st_mtime_ns
    except OSError:
        saved_ns = 0
    return Mocap(shown, tool, None, (), saved_ns, broken=reason)


def reason_of(error: Exception, path: Path, shown: str) -> str:
    """What an error says of the file `path`, without its name in it, which is `shown` otherwise."""
    if isinstance(error, FileNotFoundError) and path.is_symlink():
        return "is a link to a file or folder that is not there"
    if isinstance(error, PermissionError):
        return f"{error.strerror}; try `chmod {_missing_right(path, shown)}`"
    text = error.strerror or "" if isinstance(error, OSError) else str(error)
    return text.replace(str(path), shown).removeprefix(f"{shown}: ")


def _units(folder: Path, around: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Files, links to nothing, and folders that are one thing: a bag of ROS 2, pictures, a detector's files of a
    recording. `around`: the folders around this one, where they are in truth, which no link leads back to."""
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError:
        # who opens it next says why it cannot be
        yield folder
        return
    shown = [entry for entry in entries if not entry.name.startswith(".") and entry.name.lower() not in LITTER]
    files = [entry.name for entry in shown if not _is_folder(entry) and _is_file(entry)]
    if containers.METADATA in files and any(any(end in name for end in BAG_ENDINGS) for name in files):
        yield folder
        return
    rest = set(files)
    pictures = {name for name in files if name.lower().endswith(picture_folders.SUFFIXES)}
    written = {name for name in files if name.lower().endswith(SUFFIXES)}
    if pictures or _is_of_pictures(folder, written):
        yield folder
        rest -= pictures or written
    yield from (folder / name for name in files if name in rest and not name.endswith(JOURNALS))
    # of a project that lies there all but its recordings is its own
    own = ("config", "results", "logs") if os.path.isfile(folder / "config/config.yaml") else ()
    around = (*around, Path(os.path.realpath(folder)))
    for entry in shown:
        back = entry.is_symlink() and any(one.is_relative_to(os.path.realpath(entry.path)) for one in around)
        if _is_folder(entry) and entry.name not in own and not back:
            yield from _units(Path(entry.path), around)


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


def _is_file(entry: os.DirEntry[str]) -> bool:
    """Whether it is a file, or a link to nothing or to what may not be looked at: who opens it says why."""
    try:
        return entry.is_file() or entry.is_symlink() and not os.path.exists(entry.path)
    except OSError:
        return True


def _is_of_pictures(folder: Path, written: set[str]) -> bool:
    """Whether the files of a folder are a detector's, one for each picture of a recording."""
    first = min(written, default="")
    if not first or not names.numbers(first):
        return False
    try:
        tool = recognise(folder / first)
        tool = recognise(folder) if tool == "empty" else tool
    except (DiorError, OSError):
        return False
    shape = READERS[tool].shape if tool in READERS else "file"
    return shape == "folder" or shape == "either" and len(written) >= MANY_FILES


def _sort(path: Path, shown: str, found: Found) -> None:
    """Put a file or folder where it belongs. Raises DiorError, OSError or ValueError for what cannot be read."""
    if path.is_dir():
        _sort_folder(path, shown, found)
        return
    with open(path, "rb") as stream:
        head = stream.read(HEAD_BYTES)
    if not head:
        raise DiorError("is empty")
    if _is_recording(path, head):
        _add_recording(path, shown, "video" if videos.is_video(head) else "bag", found)
    elif _is_mocap(path, head):
        _add_mocap(path, shown, found)
    else:
        _sort_text(path, shown, head, found)


def _sort_folder(path: Path, shown: str, found: Found) -> None:
    if (path / containers.METADATA).is_file():
        _add_recording(path, shown, "bag", found)
        return
    pictures = picture_folders.files(path)
    if not pictures:
        found.detections.append(_detected(path, shown, str(recognise(path))))
    elif len(pictures) < FEWEST_PICTURES:
        found.aside.append((shown, f"{len(pictures)} pictures are no walk; {_OF_A_BOARD}"))
    else:
        _add_recording(path, shown, "pictures", found)


_OF_A_BOARD = (
    "of a board? Then `intrinsics: {chessboard: ...}` or `{charuco: ...}` in a camera's YAML names it; of people from "
    "all around, a row of gallery.tsv"
)


def _is_recording(path: Path, head: bytes) -> bool:
    packed = head.startswith(ZSTD_MAGIC) and any(end in path.name.lower() for end in BAG_ENDINGS)
    return packed or videos.is_video(head) or head.startswith((*containers.FORMATS, b"#ROSBAG"))


def _is_mocap(path: Path, head: bytes) -> bool:
    # a C3D whose beginning is damaged is one, too
    return mocap_files.recognise(path) != mocap_files.C3D or path.suffix.lower() == C3D_ENDING


def _add_recording(path: Path, shown: str, kind: str, found: Found) -> None:
    if names.BOARD.search(shown):
        found.aside.append((shown, f"is no walk by its name; {_OF_A_BOARD}"))
        return
    if names.GALLERY.search(shown):
        found.aside.append((shown, "is no walk by its name; pictures from all around have a row in gallery.tsv"))
        return
    try:
        there = glance(path)
    except DiorError as error:
        found.broken.append((shown, reason_of(error, path, shown)))
        return
    streams = tuple(one for one in there if one.kind in PICTURES and not one.topic.endswith(videos.STORED))
    enough = tuple(one for one in streams if one.count >= FEWEST_PICTURES and not one.why_not)
    if not enough:
        found.aside.append((shown, _why_no_walk(there, streams)))
        return
    topics = {one.topic: one.kind for one in there if one.count}
    found.recordings.append(_timed(Recording(shown, kind, enough, None, None, "", topics)))


def _why_no_walk(there: Sequence[Stream], streams: Sequence[Stream]) -> str:
    """Why a recording is no walk; `streams`: those of its topics that should be pictures."""
    for one in streams:
        if one.why_not and one.count >= FEWEST_PICTURES:
            return f"its pictures cannot be read: of {one.topic}, {one.why_not}"
    many = max((one.count for one in streams), default=0)
    if many:
        return f"{many} picture{'s are' if many > 1 else ' is'} no walk"
    return f"holds no pictures; there is {', '.join(f'{one.topic} ({one.kind})' for one in there) or 'nothing'}"


def _timed(recording: Recording) -> Recording:
    """The same with when it was recorded, where anything tells."""
    firsts = [one.first_ns for one in recording.streams if one.first_ns]
    lasts = [one.last_ns for one in recording.streams if one.last_ns]
    if firsts and lasts and min(firsts) >= SINCE_ITS_START_NS:
        by = "stamps" if recording.kind == "bag" else "creation"
        return replace(recording, first_ns=min(firsts), last_ns=max(lasts), by=by)
    if (at := names.date_ns(recording.path)) is not None:
        main = max(recording.streams, key=lambda one: one.count)
        return replace(
            recording, first_ns=at, last_ns=at + round(1e9 * main.count / (main.fps or USUAL_FPS)), by="name"
        )
    return recording


def _add_mocap(path: Path, shown: str, found: Found) -> None:
    """Add a file with motion capture, but not what another tool made of pictures."""
    try:
        kind, capture = mocap_files.read(path)
    except DiorError as error:
        tool = mocap_files.READERS[mocap_files.recognise(path)].tool
        found.mocap.append(_broken_mocap(path, shown, tool, reason_of(error, path, shown)))
        return
    begins = [label.partition(":")[0] for label in capture.labels if ":" in label]
    note = ""
    try:
        # of several subjects one is enough
        mine = [label for label in capture.labels if label.partition(":")[0] == begins[0]] if begins else capture.labels
        marker_names.find(mine, path)
    except DiorError:
        joints = [label for label in capture.labels if joint_of(label.rpartition(":")[2])]
        if len(joints) >= marker_names.FEWEST:
            found.aside.append((shown, "holds the joints of a skeleton, and no markers on a body"))
            return
        note = "its labels are none of Plug-in-Gait's: config/markers.tsv says which is which"
    seconds = capture.frames / capture.rate if capture.rate else None
    tool = mocap_files.READERS[kind].tool
    found.mocap.append(Mocap(shown, tool, seconds, tuple(sorted(set(begins))), path.stat().st_mtime_ns, note))


def _sort_text(path: Path, shown: str, head: bytes, found: Found) -> None:
    suffix = path.suffix.lower()
    tool = recognise(path) if suffix in SUFFIXES else None
    if tool in READERS:
        found.detections.append(_detected(path, shown, str(tool)))
    elif b'"event"' in head.split(b"\n", 1)[0]:
        found.trigger_logs.append((shown, tuple(trigger_log.read(path))))
    elif suffix == ".csv" and video_stamps.is_sidecar(unmarked(head, path)):
        found.stamps.append(shown)
    elif suffix in CALIBRATIONS:
        try:
            found.calibrations.append(Calibration(shown, tuple(calibrations.cameras(path))))
        except DiorError as error:
            found.aside.append((shown, reason_of(error, path, shown)))
    else:
        found.aside.append((shown, NONE_OF_THEM))


def _detected(path: Path, shown: str, tool: str) -> Detected:
    return Detected(shown, tool, _first_stamp(path))


def _first_stamp(path: Path) -> int | None:
    if path.is_dir():
        return None
    with open(path, "rb") as stream:
        said = re.search(rb'"stamp_ns"\s*:\s*([0-9]{1,19})', stream.read(HEAD_BYTES))
    return int(said[1]) if said and int(said[1]) >= SINCE_ITS_START_NS else None
