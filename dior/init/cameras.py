"""Which cameras recorded a walk, what they are called, and where each is: its topic and bags, or its video.

INPUTS   `walks.Walk`s
OUTPUTS  `Filmed` by camera for each walk
A camera is called as its topic, its bag or its video says; where detections are called otherwise and the numbers in the
names tell which is whose, as these, since `{camera}` in a path stands for the name.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from dior.ingest.bags import OF_LIBREALSENSE, camera_info_topic
from dior.ingest.glance import Stream
from dior.ingest.messages import CAMERA_INFO
from dior.init import names
from dior.init.found import Recording
from dior.init.walks import Walk, overlap
from dior.project.todos import WORD

# parts of topics that cameras have in common
COMMON = re.compile(
    r"(?:camera|color|colour|rgb|image|image_\w+|compressed|data|raw|stereo|device_\d+|sensor_\d+|color_\d+|sensors?|ros|"
    r"usb_cam|video)",
    re.IGNORECASE,
)
DEPTH, INFRARED = (
    re.compile(r"depth|disparity|points", re.IGNORECASE),
    re.compile(r"(?:^|/)(?:infra|ir\b)", re.IGNORECASE),
)
TRANSPORTS = ("/compressed", "/compressedDepth", "/theora", "/ffmpeg")


@dataclass(frozen=True)
class Filmed:
    """A camera in a walk: `stream` of `paths` (bags, or one video or folder of pictures). `bag`: what the names of its
    bags hold, where others have its topic in theirs, TODO if they hold nothing of the kind; `info`: the topic of its
    CameraInfo, empty if there is none; `reasons`: why it is this one."""

    name: str
    kind: str
    stream: Stream
    paths: tuple[str, ...]
    bag: str = ""
    info: str = ""
    reasons: tuple[str, ...] = ()

    @property
    def topic(self) -> str:
        """Its topic in bags, empty of a video."""
        return self.stream.topic if self.kind == "bag" else ""


def filmed(walk: Walk, known: Collection[str]) -> tuple[list[Filmed], str, list[tuple[str, str]]]:
    """The cameras of a walk by name, `videos` of the sheet (a path with {camera}, or TODO), and (path, reason) of what
    is left out. `known`: names that cameras have elsewhere."""
    in_bags = _in_bags([one for one in walk.recordings if one.kind == "bag"])
    others = [one for one in walk.recordings if one.kind != "bag"]
    if not others:
        return in_bags, "", []
    given = names.pattern([one.path for one in others], known)
    if given is None:
        why = (
            "the cameras of a walk are told by one path with {camera} in it, a name of letters, digits, _ and -; "
            f"rename the files of this walk, such as {PurePosixPath(others[0].path).parent / 'cam01'}"
            f"{PurePosixPath(others[0].path).suffix}"
        )
        # of two walks by their names they are not to be renamed
        return in_bags, "", [(one.path, next(iter(walk.doubts), why)) for one in others]
    whole, called = given
    # pictures that were made a video to be looked at
    twice = {one.name.casefold(): one.paths[0] for one in in_bags}
    left = [
        (one.path, f"{called[one.path]} is in {bag}, and that is used; call it otherwise if it is another camera")
        for one in others
        if (bag := twice.get(called[one.path].casefold()))
    ]
    of_videos = [
        Filmed(called[one.path], one.kind, one.streams[0], (one.path,)) for one in others
        if called[one.path].casefold() not in twice
    ]  # fmt: skip
    return sorted((*in_bags, *of_videos), key=lambda one: one.name), whole if of_videos else "", left


def _in_bags(recordings: Sequence[Recording]) -> list[Filmed]:
    found: list[Filmed] = []
    chosen = {one.path: _chosen(one) for one in recordings}
    topics = sorted({topic for picked in chosen.values() for topic in picked})
    called = _called(topics)
    of_topics = {topic: _apart([one for one in recordings if topic in chosen[one.path]], topic) for topic in topics}
    words = Counter(word for apart, several in of_topics.values() if several for _, word in apart)
    for topic, (apart, several) in of_topics.items():
        for bags, word in apart:
            stream, others = chosen[bags[0].path][topic]
            info = _info(topic, bags[0].topics)
            reasons = [f"in {', '.join(PurePosixPath(one.path).name for one in bags)}"]
            reasons += [f"chosen before {', '.join(others)}"] if others else []
            name = called[topic]
            if len(apart) > 1:
                # a computer's word is the name of its only camera
                name = f"{name}_{word or len(found) + 1}" if words[word] > 1 or not word else word
            name = name if re.search(r"[A-Za-z]", name) else f"cam{name}"
            # session.yaml is the file of none
            name = names.unique(name, [*(one.name for one in found), "session"])
            told = word and all(word in PurePosixPath(one.path).name for one in bags)
            bag = "" if not several else word if told else WORD
            paths = tuple(one.path for one in bags)
            found.append(Filmed(name, "bag", stream, paths, bag, info, tuple(reasons)))
    return sorted(found, key=lambda one: one.name)


def _chosen(recording: Recording) -> dict[str, tuple[Stream, list[str]]]:
    """By topic the streams of a bag that are cameras, each with the topics that it was chosen before."""
    colour = [one for one in recording.streams if not DEPTH.search(one.topic)]
    first = {one.topic.split("/")[1] for one in colour if not INFRARED.search(one.topic)}
    colour = [one for one in colour if not INFRARED.search(one.topic) or one.topic.split("/")[1] not in first]
    by_camera: dict[str, list[Stream]] = {}
    for stream in colour:
        by_camera.setdefault(_namespace(stream.topic), []).append(stream)
    found = {}
    for same in by_camera.values():
        same.sort(key=lambda one: (-one.count, "rect" in one.topic, not one.topic.endswith("/compressed"), one.topic))
        found[same[0].topic] = same[0], [one.topic for one in same[1:]]
    return found


def _namespace(topic: str) -> str:
    """What topics of one camera's pictures have in common."""
    if topic.endswith(OF_LIBREALSENSE):
        return topic.removesuffix(OF_LIBREALSENSE)
    for transport in TRANSPORTS:
        topic = topic.removesuffix(transport)
    return topic.rpartition("/")[0] or topic


def _called(topics: Sequence[str]) -> dict[str, str]:
    """Names of cameras by topic: what is left of it without the common parts, or what tells it from others."""
    parts = {topic: [part for part in _namespace(topic).split("/") if part] for topic in topics}
    short = {
        topic: names.valid("_".join(part for part in mine if not COMMON.fullmatch(part)))
        for topic, mine in parts.items()
    }
    whole = {topic: names.valid("_".join(mine)) or "cam" for topic, mine in parts.items()}
    count = Counter(name.casefold() for name in short.values())
    called: dict[str, str] = {}
    for topic in topics:
        name = short[topic] if short[topic] and count[short[topic].casefold()] == 1 else whole[topic]
        called[topic] = names.unique(name, called.values())
    return called


def _apart(recordings: Sequence[Recording], topic: str) -> tuple[list[tuple[list[Recording], str]], bool]:
    """Groups of bags that hold a topic, one for each camera, with the word by which their names are known; whether they
    have to be known by it.

    Bags that ran at once with the same topic are of different cameras, those that follow each other of one. What is in
    another one again is left out.
    """
    first = [one for one in recordings if topic not in dict(one.again)] or list(recordings)
    if not any(overlap(a, b) > 0 for i, a in enumerate(recordings) for b in recordings[i + 1 :]):
        # nothing tells of bags without times: two computers do not record the same camera
        if len(recordings) == 1 or all(one.first_ns for one in recordings):
            return [(first, "")], False
    given = names.pattern([one.path for one in recordings])
    words = given[1] if given else {}
    groups: dict[str, list[Recording]] = {}
    for one in first:
        groups.setdefault(words.get(one.path, one.path), []).append(one)
    return [(mine, word if word in words.values() else "") for word, mine in groups.items()], True


def _info(topic: str, there: Mapping[str, str]) -> str:
    """The topic of the CameraInfo of a picture's topic among those of its bag; empty if none is its own."""
    lenses = [name for name, kind in there.items() if kind == CAMERA_INFO]
    if camera_info_topic(topic) in lenses:
        return camera_info_topic(topic)
    near = [name for name in lenses if name.startswith(f"{_namespace(topic)}/")]
    return near[0] if len(near) == 1 else ""


def renamed(cameras: Collection[str], wanted: Collection[str]) -> dict[str, str] | None:
    """What cameras are called so that `wanted` are among their names: spelled otherwise, or with the same numbers.

    Of some of `wanted` there may be no camera, or of some cameras none of `wanted`, but not both. None where that does
    not tell, or where nothing has to be renamed.
    """
    if set(wanted) <= set(cameras) or set(cameras) <= set(wanted):
        return None
    for alike in (names.plain, lambda name: str(names.numbers(name)[-1:])):
        mine = {alike(name): name for name in cameras}
        if len(mine) == len(cameras) and len({alike(name) for name in wanted}) == len(wanted):
            theirs = {*map(alike, wanted)}
            if (theirs <= {*mine} or {*mine} <= theirs) and "()" not in theirs | {*mine}:
                changed = {mine[alike(name)]: name for name in wanted if alike(name) in mine}
                after = [changed.get(name, name) for name in cameras]
                return changed if len({name.casefold() for name in after}) == len(after) else None
    return None


def called_anew(cameras: Sequence[Filmed], changed: Mapping[str, str]) -> list[Filmed]:
    """The same with other names; as they are where two would be called alike."""
    anew = [replace(one, name=changed.get(one.name, one.name)) for one in cameras]
    if len({one.name.casefold() for one in anew}) < len(anew):
        return list(cameras)
    return sorted(anew, key=lambda one: one.name)
