"""What the names of files and folders tell: which camera or computer, which walk, which person, which day.

INPUTS   paths below the folder of the recordings, with / between their parts
OUTPUTS  words, keys by which files of one walk are known, names that a project may have
"""

import re
import unicodedata
from calendar import timegm
from collections.abc import Collection, Iterable, Sequence
from pathlib import PurePosixPath

_END = r"(?![A-Za-z0-9])"
_BEGIN = r"(?<![A-Za-z0-9])"
# cameras and the computers that record them, as labs call them
DEVICE = re.compile(
    rf"{_BEGIN}(?:cam(?:era)?|kam(?:era)?|gopro|gp|iphone|phone|realsense|rs|d4[0-9]{{2}}|webcam|sensor|device|view|c|pc|"
    rf"computer|host|recorder|rec|laptop|nuc|jetson|rig)[ _-]?[0-9]{{1,12}}{_END}",
    re.IGNORECASE,
)
# the same by where they stand, of a whole part of a path: `turn_left.bag` is a walk
_SIDE = (
    "left|right|front|back|rear|side|top|middle|center|centre|near|far|north|south|east|west|links|rechts|vorne|hinten|"
    "oben|mitte|nord|sued|süd|ost|west"
)
SIDE = re.compile(rf"^(?:{_SIDE})$", re.IGNORECASE)
# a person's number, as labs call people
PERSON = re.compile(
    rf"{_BEGIN}(?:sub(?:j(?:ect)?)?|s|p|vp|person|participant|proband|patient|id)[ _-]?[0-9]{{1,6}}{_END}",
    re.IGNORECASE,
)
# what says what a folder or file is, and not of which walk
KINDS = frozenset(
    "bag bags rosbag rosbags rosbag2 ros2 video videos film films movie movies pictures images frames rgb color colour "
    "raw data recording recordings mocap c3d vicon qualisys optitrack motive markers trc detections detection poses "
    "pose keypoints keypoint json mlkit mediapipe openpose alphapose yolo mmpose rtmpose deeplabcut dlc caliscope coco "
    "stamps timestamps results output trigger log calibration".split()
)
# where pictures of a board lie, and those of people from all around
BOARD = re.compile(r"board|calib|chess|charuco|checker|intrinsic|extrinsic", re.IGNORECASE)
GALLERY = re.compile(rf"{_BEGIN}gallery{_END}", re.IGNORECASE)
# what a lab records of a person who stands, before or after the walks
STATIC = re.compile(rf"{_BEGIN}(?:static|cal|rom|[tna][ _-]?pose|statisch)[ _-]?[0-9]{{0,3}}{_END}", re.IGNORECASE)
# of a camera that stands far away
FAR = re.compile(r"long|far|tele|distan[ct]|weit|fern", re.IGNORECASE)
_DATE = re.compile(
    r"(?<![0-9])(20[0-9]{2})[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12][0-9]|3[01])"
    r"[-_.T ]{0,3}([01][0-9]|2[0-3])[-_.:h]?([0-5][0-9])[-_.:m]?([0-5][0-9])(?![0-9])"
)
_DAY = re.compile(r"(?<![0-9])20[0-9]{2}[-_.]?(?:0[1-9]|1[0-2])[-_.]?(?:0[1-9]|[12][0-9]|3[01])(?![0-9])")
_VALID = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,99}")
MOST_LETTERS = 100
SPELLED = {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "æ": "ae", "ø": "o", "å": "a"}


def is_valid(name: str) -> bool:
    """Whether a sequence, session, person or camera may be called so."""
    return bool(_VALID.fullmatch(name))


def valid(text: str) -> str:
    """`text` as a name of letters, digits, _ and -, as near as may be; empty where nothing is left.

    >>> valid("Gang 3, Küche")
    'Gang_3_Kueche'
    """
    text = "".join(SPELLED.get(letter, letter) for letter in unicodedata.normalize("NFC", text))
    text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text).strip("_-")[:MOST_LETTERS]


def unique(name: str, taken: Iterable[str]) -> str:
    """`name`, with a number behind it where there is one like it but for capitals."""
    used = {one.casefold() for one in taken}
    return next(one for one in (name, *(f"{name}_{i}" for i in range(2, len(used) + 3))) if one.casefold() not in used)


def date_ns(path: str) -> int | None:
    """The last date and time in a name (2024-05-01-10-30-00, 20240501_103000, ...), ns, as if it were UTC."""
    found = _DATE.findall(path)
    return timegm((*map(int, found[-1]), 0, 0, 0)) * 10**9 if found else None


def stem(path: str) -> str:
    """A path without the ending of its file."""
    return str(PurePosixPath(path).with_suffix("")) if PurePosixPath(path).suffix else path


def walk_key(path: str, cameras: Collection[str] = ()) -> str:
    """What is left of a path without the names of cameras and computers (`cameras`, `DEVICE`, `SIDE`) and of kinds.

    Files of one walk have the same key.
    >>> walk_key("cam01/day 1/walk_02.mp4"), walk_key("day 1/mlkit/walk_02_cam01.jsonl")
    ('day 1/walk_02', 'day 1/walk_02')
    """
    names = "|".join(re.escape(name) for name in sorted(cameras, key=len, reverse=True))
    named = re.compile(rf"{_BEGIN}(?:{names}){_END}", re.IGNORECASE) if names else None
    parts = []
    for part in stem(path).split("/"):
        part = SIDE.sub("", DEVICE.sub("", named.sub("", part) if named else part))
        # words and what is between them, in turn
        words = re.split(r"([ _.-]+)", part.strip(" _.-"))
        kept = [i for i in range(0, len(words), 2) if words[i].lower() not in KINDS]
        if words[0] and kept:
            parts.append(re.sub(r"([ _.-])[ _.-]+", r"\1", "".join(words[kept[0] : kept[-1] + 1])))
    return "/".join(parts)


def without_cameras(path: str, cameras: Collection[str]) -> str:
    """A path without the names of cameras, by which the files of one tool about one walk are alike."""
    names = "|".join(re.escape(name) for name in sorted(cameras, key=len, reverse=True))
    path = re.sub(rf"{_BEGIN}(?:{names}){_END}", "", path) if names else path
    return "/".join(SIDE.sub("", stem(DEVICE.sub("", part))) for part in path.split("/"))


def without_people(key: str) -> str:
    """A key without people's numbers, which neither a walk nor a session may have in its name."""
    parts = [re.sub(r"([ _.-])[ _.-]+", r"\1", PERSON.sub("", part)).strip(" _.-") for part in key.split("/")]
    return "/".join(part for part in parts if part)


def without_dates(key: str) -> str:
    """A key without the dates and times in it, which a release may have to keep to itself."""
    parts = [
        re.sub(r"([ _.-])[ _.-]+", r"\1", _DAY.sub("", _DATE.sub("", part))).strip(" _.-") for part in key.split("/")
    ]
    return "/".join(part for part in parts if part)


def common(keys: Sequence[str]) -> str:
    """The words that stand in all of some keys, part by part; empty where these have not as many parts."""
    parts = [key.split("/") for key in keys]
    if len({len(one) for one in parts}) != 1:
        return ""
    found = []
    for same in zip(*parts, strict=True):
        words = re.split(r"([ _.-]+)", same[0])
        others = [re.split(r"[ _.-]+", one) for one in same[1:]]
        kept = [i for i in range(0, len(words), 2) if all(words[i] in one for one in others)]
        found.append("".join(words[kept[0] : kept[-1] + 1]) if kept else "")
    return "/".join(part for part in found if part)


def without(text: str, name: str) -> str:
    """A text without a name that stands in it as a word."""
    left = re.sub(rf"{_BEGIN}{re.escape(name)}{_END}", "", text, flags=re.IGNORECASE)
    return re.sub(r"([ _.-])[ _.-]+", r"\1", left).strip(" _.-")


def person(path: str) -> str:
    """The person's number in a path, as it is spelled there; empty for none and for several."""
    found = {valid(one) for part in stem(path).split("/") for one in PERSON.findall(part)}
    return found.pop() if len(found) == 1 else ""


def holds(key: str, other: str) -> bool:
    """Whether a path's key holds another one, as a whole word: `walk_1` is in `walk_1/run`, and not in `walk_10`."""
    return bool(other and re.search(rf"{_BEGIN}{re.escape(other)}{_END}", key, re.IGNORECASE))


def numbers(text: str) -> tuple[int, ...]:
    """The numbers in a text."""
    return tuple(int(digits) for digits in re.findall(r"[0-9]{1,18}", text))


def plain(name: str) -> str:
    """A name without capitals, separators and zeros before a number: `Cam_01` and `cam1` are alike."""
    return re.sub(r"(?<![0-9])0+(?=[0-9])", "", re.sub(r"[^a-z0-9]", "", name.lower()))


def words(key: str) -> tuple[str | int, ...]:
    """The words and numbers of a key, however they are written: `Walk 01` and `walk_1` are alike."""
    found = re.findall(r"[^\W\d_]+|\d+", key.casefold())
    return tuple(int(word) if word.isdecimal() else word for word in found)


def pattern(paths: Collection[str], known: Collection[str] = ()) -> tuple[str, dict[str, str]] | None:
    """The one path with {camera} in it that some paths are, and the camera's name of each; None where there is none.

    The names are those of `known` where they stand in every path, else what `DEVICE` finds, else what differs.
    """
    paths = sorted(paths)
    for names_of in (lambda path: _standing(path, known), _devices, lambda path: _differing(path, paths)):
        common: dict[str, dict[str, str]] = {}
        for path in paths:
            for name in names_of(path):
                for whole in _patterns(path, name):
                    common.setdefault(whole, {})[path] = name
        fitting = {
            whole: of for whole, of in common.items()
            if len(of) == len(paths) == len({name.casefold() for name in of.values()})
        }  # fmt: skip
        if fitting:
            # the name nearest to the file
            return max(fitting.items(), key=lambda one: (one[0].rindex("{camera}"), one[0]))
    return None


def _patterns(path: str, name: str) -> list[str]:
    """The path with {camera} wherever `name` stands, and where it stands once only there."""
    if not is_valid(name) or "{" in path or "}" in path:
        return []
    word = re.compile(rf"{_BEGIN}{re.escape(name)}{_END}")
    every = word.sub("{camera}", path)
    ones = [path[: at.start()] + "{camera}" + path[at.end() :] for at in word.finditer(path)]
    return list(dict.fromkeys([every, *ones]))


def _standing(path: str, known: Collection[str]) -> list[str]:
    return [name for name in known if re.search(rf"{_BEGIN}{re.escape(name)}{_END}", path)]


def _devices(path: str) -> list[str]:
    return [found[0] for found in DEVICE.finditer(path)]


def _differing(path: str, paths: list[str]) -> list[str]:
    """What differs between the paths, made longer to whole words."""
    if len(paths) == 1:
        return [PurePosixPath(stem(path)).name]
    first, last = paths[0], paths[-1]
    before = next((i for i, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), min(len(first), len(last)))
    ends = [one[::-1] for one in paths]
    low, high = min(ends), max(ends)
    after = next((i for i, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), min(len(low), len(high)))
    begin, end = before, max(len(path) - after, before)
    while begin > 0 and path[begin - 1].isalnum():
        begin -= 1
    while end < len(path) and path[end].isalnum():
        end += 1
    return [path[begin:end]]
