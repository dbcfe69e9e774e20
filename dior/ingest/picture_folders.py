"""Folders of pictures, JPEG or PNG, one file per picture.

INPUTS   a folder; its files are in the order of the numbers in their names (2.jpg before 10.jpg)
OUTPUTS  `bag_reader.Message`s: `topic` is `TOPIC`, `receive_ns` the picture's number from 0, since a file has no time;
         `raw` has the fields of a sensor_msgs/CompressedImage (`messages.PICTURE`)
"""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dior.ingest import messages
from dior.ingest.bag_reader import Message
from dior.project.plain_text import bytes_of

TOPIC = "/pictures"
SUFFIXES = (".jpeg", ".jpg", ".png")
# chosen: more than any camera's JPEG or PNG has
MOST_BYTES = 1 << 28


@dataclass(frozen=True, eq=False)
class PictureFile:
    """The bytes `data` (N,) of a file, with the fields of a sensor_msgs/CompressedImage."""

    data: NDArray[np.uint8]
    format: str = ""
    header: messages.Header = messages.Header()


def files(folder: Path) -> list[Path]:
    """The pictures of a folder in their order."""
    return sorted((file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES), key=_natural)


def _natural(file: Path) -> list[tuple[int, str]]:
    """Sorts 2.jpg before 10.jpg."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]


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
            yield Message(TOPIC, messages.COMPRESSED, messages.PICTURE, number, PictureFile(data))
