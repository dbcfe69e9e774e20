"""What the cameras recorded, at a glance, against what the sheets and the cameras' files say of it.

INPUTS   a `Project` (paths as seen from the working directory); its bags, videos and folders of pictures
OUTPUTS  by walk and camera what was recorded (`Recorded`); faults and warnings in `Notes`
Recordings that are not there are told elsewhere (dior/project/missing.py) and left out here. What is damaged in the
middle of a recording is only seen when it is read. Of videos it is not judged when they began: that takes their sound.
"""

import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from math import ceil, nan
from pathlib import Path
from typing import TypeAlias, TypeVar

from dior.check.notes import Notes
from dior.clocks import by_hand
from dior.errors import DiorError, nearest
from dior.ingest import frames, picture_folders
from dior.ingest.bag_reader import full_name
from dior.ingest.glance import Stream, glance, is_packed
from dior.ingest.messages import PICTURES
from dior.ingest.video_frames import Span
from dior.project.contents import Project
from dior.project.missing import SEQUENCES, can_be_read, line_of
from dior.project.plain_text import unreadable
from dior.project.run import cores

# chosen: fewer are looked at sooner than a second process has begun
FEW = 40
# chosen: by its length and rate, a video that does not count its pictures has so many times as many at most
ABOUT = 1.05
# chosen: a step that looks for a clock looks less far
APART_S = 20.0
# what is in a recording, or why that cannot be told; None of one that is compressed as a whole
InIt: TypeAlias = tuple[Stream, ...] | DiorError | None
# by path
Seen: TypeAlias = Mapping[str, InIt]
Asked = TypeVar("Asked")
Told = TypeVar("Told")


@dataclass(frozen=True)
class Recorded:
    """The pictures of a camera in a walk: how many, at most, as two bags may have the same ones and few videos count
    theirs; stamps (ns) of the first and last, None where the files do not tell; how long it lasts, NaN where they do
    not tell that either; the pictures' size (px), 0 where they do not tell it; `paths` of the files that have them."""

    count: int
    first_ns: int | None
    last_ns: int | None
    lasts_s: float
    height: int
    width: int
    paths: tuple[str, ...]


# by walk and camera
AllRecorded: TypeAlias = Mapping[str, Mapping[str, Recorded]]


def look_at(paths: Iterable[str]) -> Seen:
    """What is in each of the recordings that are there."""
    known = [path for path in dict.fromkeys(paths) if can_be_read(".", path)]
    return dict(zip(known, side_by_side(_seen, known), strict=True))


def side_by_side(function: Callable[[Asked], Told], asked: Sequence[Asked]) -> list[Told]:
    """`function` of each, on all processors where there are many."""
    if len(asked) < FEW or cores() == 1:
        return list(map(function, asked))
    # PyAV's and OpenCV's threads are not begun yet
    with ProcessPoolExecutor(cores(), multiprocessing.get_context("fork")) as pool:
        return list(pool.map(function, asked, chunksize=8))


def _seen(path: str) -> InIt:
    try:
        return None if is_packed(path) else glance(path)
    except DiorError as error:
        return error
    except OSError as error:
        return unreadable(error.filename or path, error.filename or path, error)


def of_walk(project: Project, walk: str, line: int, seen: Seen, notes: Notes) -> dict[str, Recorded]:
    """What each camera recorded of a walk, those left out of which that cannot be told; `line` of it in the sheet."""
    for path in dict.fromkeys([*project.bags(walk), *project.videos(walk).values()]):
        found = seen.get(path)
        if isinstance(found, DiorError):
            notes.fault(SEQUENCES, line, f"'{walk}': {found}", walk)
        elif found is None and path in seen:
            text = f"'{walk}': {path} is compressed as a whole: it was not looked into, and each step will unpack it"
            notes.warn(SEQUENCES, line, f"{text}; `rosbags-convert --src {path} --dst <new bag>`", walk)
    recorded = {
        camera: one
        for camera in project.cameras_of(walk)
        if (one := _of_camera(project, walk, camera, seen, notes)) is not None
    }
    _check_overlap(project, walk, line, recorded, notes)
    return recorded


def _of_camera(project: Project, walk: str, camera: str, seen: Seen, notes: Notes) -> Recorded | None:
    session, filmed = project.session_of(walk), camera in project.filmed(walk)
    settings, shown = project.cameras(session)[camera], project.camera_file(session, camera)
    topic = full_name(project.topics(walk)[camera])
    if filmed:
        paths, key = [project.videos(walk)[camera]], "video"
        if os.path.isdir(paths[0]):
            topic = picture_folders.TOPIC
            if "fps" not in settings["video"] and camera not in project.sidecars(walk):
                text = f"{paths[0]} is a folder of pictures, which have no time; give `video: {{fps: ...}}`, or stamps"
                notes.fault(shown, line_of(project.root, shown, key), text, walk)
    else:
        word = settings.get("bag", "")
        paths, key = [path for path in project.bags(walk) if word in Path(path).name], "topic"
        if not paths:
            names = ", ".join(Path(path).name for path in project.bags(walk))
            line = line_of(project.root, shown, "bag")
            notes.fault(shown, line, f"'bag' is '{word}', which is in the name of no bag; they are {names}", walk)
            return None
    line = line_of(project.root, shown, key)
    there: dict[str, tuple[Stream, ...]] = {}
    for path in paths:
        if isinstance(streams := seen.get(path), tuple):
            there[path] = streams
    mine = {path: stream for path, streams in there.items() for stream in streams if stream.topic == topic}
    holding = {path: stream for path, stream in mine.items() if stream.count}
    if not holding:
        # a bag that cannot be read may have it
        if len(there) == len(paths):
            notes.fault(shown, line, _not_there(topic, bool(mine), there), walk)
        return None
    found = list(holding.values())
    for text in dict.fromkeys(filter(None, map(_useless, found))):
        notes.fault(shown, line, f"{topic}: {text}", walk)
    if any(map(_useless, found)):
        return None
    if sum(stream.count for stream in found) < 2:
        notes.fault(shown, line, f"{topic}: one picture is no recording; exclude the walk, or drop the camera", walk)
        return None
    sizes = dict.fromkeys(f"{stream.width}x{stream.height}" for stream in found if stream.width)
    if len(sizes) > 1:
        text = f"{topic} has pictures of {' and '.join(sizes)} px; a camera must keep one resolution in a recording"
        notes.fault(shown, line, text, walk)
    return _joined(holding, ABOUT if filmed and topic != picture_folders.TOPIC else 1.0)


def _not_there(topic: str, declared: bool, there: Mapping[str, tuple[Stream, ...]]) -> str:
    if declared:
        return f"{topic} is declared in the bags and has no message; was the camera running?"
    pictures = {one.topic for streams in there.values() for one in streams if one.count and not one.why_not}
    if not pictures:
        return f"{topic} is not there, and no other pictures are that are read"
    listed = ", ".join(sorted(pictures))
    return f"{topic} is not there{nearest(topic, sorted(pictures))}; of pictures there are {listed}"


def _useless(stream: Stream) -> str:
    """Why no step can use the pictures of a topic, "" where they can."""
    if stream.why_not:
        return stream.why_not
    if stream.kind in PICTURES and stream.first_ns == stream.last_ns == 0:
        return "the header stamps are zero: the driver did not stamp its pictures (docs/bags.md)"
    return ""


def _joined(holding: Mapping[str, Stream], about: float) -> Recorded:
    """`about`: how many times as many pictures there may be."""
    found = list(holding.values())
    stamps = [ns for one in found for ns in (one.first_ns, one.last_ns) if ns]
    first_ns, last_ns = (min(stamps), max(stamps)) if stamps else (None, None)
    lasts_s = max((one.count - 1) / one.fps if one.fps else nan for one in found)
    if first_ns is not None and last_ns is not None:
        lasts_s = (last_ns - first_ns) / 1e9
    count, height, width = sum(one.count for one in found), found[0].height or 0, found[0].width or 0
    return Recorded(ceil(about * count), first_ns, last_ns, lasts_s, height, width, tuple(holding))


def _check_overlap(project: Project, walk: str, line: int, recorded: Mapping[str, Recorded], notes: Notes) -> None:
    """The step frames refuses recordings that do not overlap in time; asked of the cameras that are in bags."""
    filmed = project.filmed(walk)
    spans = [
        (one.first_ns, one.last_ns, camera, ", ".join(Path(path).name for path in one.paths))
        for camera, one in sorted(recorded.items())
        if camera not in filmed and one.first_ns is not None and one.last_ns is not None
    ]
    with notes.kept(SEQUENCES, line, walk):
        frames.check_overlap(walk, spans, project.clocked_by_hand(walk))
    for path in project.offsets(walk):
        # what is wrong with the file itself is told with the other files
        with suppress(DiorError):
            given = by_hand.by_hand(project.root / path, project.cameras_of(walk))
            with notes.kept(path, None, walk):
                check_given(path, spans, {camera: one.offset_s for camera, one in given.items()})


def check_given(path: str, spans: Iterable[Span], offset_s: Mapping[str, float]) -> None:
    """Refuse an offset by hand that puts a camera's pictures far outside of those of all other cameras.

    `offset_s`: of the cameras that a person gave one in the file `path`; `spans` as of `frames.check_overlap`.
    """
    moved = {
        camera: (first / 1e9 + offset_s.get(camera, 0.0), last / 1e9 + offset_s.get(camera, 0.0))
        for first, last, camera, _ in spans
    }
    for camera in sorted(offset_s.keys() & moved.keys()):
        # those without one by hand are at their stamps, which is where the walk is
        others = [span for name, span in moved.items() if name not in offset_s]
        if not others:
            return
        first, last = moved[camera]
        early, late = min(one for one, _ in others) - last, first - max(one for _, one in others)
        if max(early, late) > APART_S:
            way = f"end {early:.0f} s before the other cameras' begin" if early > late else (
                f"begin {late:.0f} s after the other cameras' end"
            )  # fmt: skip
            raise DiorError(f"{path}: with offset_s {offset_s[camera]:g} the pictures of '{camera}' {way}; correct it")
