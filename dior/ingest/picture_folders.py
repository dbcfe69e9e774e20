"""Folders of pictures, JPEG or PNG, one file per picture.

INPUTS   a folder; its files are in the order of the numbers in their names (2.jpg before 10.jpg)
OUTPUTS  `bag_reader.Message`s: `topic` is `TOPIC`, `receive_ns` the picture's number from 0, since a file has no time;
         `raw` has the fields of a sensor_msgs/CompressedImage (`messages.PICTURE`)
"""

import re
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Ints
from dior.errors import DiorError
from dior.formats import VideoFormat
from dior.ingest import messages
from dior.ingest.bag_reader import Message
from dior.project.plain_text import bytes_of

TOPIC = "/pictures"
SUFFIXES = (".jpeg", ".jpg", ".png")
# chosen: more than any camera's JPEG or PNG has
MOST_BYTES = 1 << 28
DESCRIPTIONS = (
    VideoFormat(
        key="pictures",
        format="folder of `jpg`, `jpeg`, `png`",
        read="in the order of the numbers in the names; numbers left out between are lost pictures "
        "(`not_sent`); EXIF's orientation is ignored, as in bags",
        tried="written here",
    ),
)


@dataclass(frozen=True, eq=False)
class PictureFile:
    """The bytes `data` (N,) of the file `path`, with the fields of a sensor_msgs/CompressedImage."""

    data: NDArray[np.uint8]
    path: Path
    format: str = ""
    header: messages.Header = messages.Header()


def files(folder: Path) -> list[Path]:
    """The pictures of a folder in their order, hidden files left out."""
    found = (file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES and not file.name.startswith("."))
    return sorted(found, key=_natural)


def numbers(folder: Path) -> Ints:
    """Which picture of a recording each of `files` (F,) is by the number in its name, the first being 0.

    Names that step by a constant have no gaps. Names without numbers, or with several that change or steps of no
    common measure (dates, times), tell of none. Raises DiorError for a file that does not fit among the others, for a
    number that is there twice, and where more are missing than there are.
    """
    names = files(folder)
    kinds = [tuple(re.split(r"\d+", file.stem.lower())) for file in names]
    in_place = np.arange(len(names))
    if all(len(kind) == 1 for kind in kinds):
        return in_place
    usual = Counter(kind for kind in kinds if len(kind) > 1).most_common(1)[0][0]
    like = next(file.name for file, kind in zip(names, kinds, strict=True) if kind == usual)
    for file, kind in zip(names, kinds, strict=True):
        if kind != usual:
            raise DiorError(f"{file}: its name has no number like that of {like}, so its place is not known; remove it")
    digits = [tuple(int(part) for part in re.findall(r"\d+", file.stem)) for file in names]
    for i in range(1, len(names)):
        if digits[i] == digits[i - 1]:
            raise DiorError(f"{names[i]}: has the number of {names[i - 1].name}; remove one of the two")
    changing = [column for column in zip(*digits, strict=True) if len({*column}) > 1]
    if len(changing) != 1:
        return in_place
    steps = [after - before for before, after in pairwise(changing[0])]
    if any(step % min(steps) for step in steps):
        return in_place
    found = [(number - changing[0][0]) // min(steps) for number in changing[0]]
    if found[-1] + 1 > 2 * len(names):
        widest = int(np.argmax(steps))
        raise DiorError(
            f"{folder}: more numbers are missing than there are pictures, the most between {names[widest].name} and "
            f"{names[widest + 1].name}; is it several recordings? If nothing is missing, number the names from 0"
        )
    return np.array(found, np.int64)


def _natural(file: Path) -> list[tuple[int, str]]:
    """Sorts 2.jpg before 10.jpg, and 2.JPG between 1.jpg and 3.jpg."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", file.name.lower())]


def topics(folder: Path) -> list[tuple[str, str, int]]:
    """(full name, message type, number of pictures) of what is in a folder."""
    return [(TOPIC, messages.COMPRESSED, len(files(folder)))]


def recorded(folder: Path, wanted: Collection[str], received: Collection[int] | None) -> Iterator[Message]:
    """The pictures of a folder, only those of the numbers `received` if given. Raises ValueError."""
    if TOPIC not in wanted:
        return
    for number, file in enumerate(files(folder)):
        if received is None or number in received:
            data = np.frombuffer(bytes_of(file, file, MOST_BYTES), np.uint8)
            if not len(data):
                raise DiorError(f"{file}: is empty; remove that picture or copy it again")
            yield Message(TOPIC, messages.COMPRESSED, messages.PICTURE, number, PictureFile(data, file))
