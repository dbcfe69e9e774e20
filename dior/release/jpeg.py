"""JPEG files as bytes: dropping what is not the picture, and encoding a changed picture as the recorder did.

INPUTS   the bytes of a JPEG file, as ITU-T T.81 lays them out
OUTPUTS  the same picture in fewer bytes; what its header says of its blocks; encoder settings
What does not need the pixels is done without decoding: a picture that is passed on unchanged keeps its pixels bit by
bit.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dior.ingest.jpeg import EOI, FRAMES, SCAN, SOI, before_data, segments

# Segments that make the picture: frames, Huffman and arithmetic tables, quantisation tables, restart interval, scans.
# All others (APPn with EXIF, thumbnails, places and serial numbers; COM; what is reserved) are dropped.
QUANTISATION, RESTART = 0xDB, 0xDD
KEPT = {*range(0xC0, 0xD0), SCAN, QUANTISATION, RESTART} - {0xC8}
ADOBE = 0xEE
# for pictures that were no JPEG, and those whose tables are nobody's
QUALITY, SAMPLING = 95, 0x221111
SAMPLINGS = (0x411111, 0x221111, 0x211111, 0x121111, 0x111111)
# frames whose coefficients are those of blocks of 8 x 8 samples: sequential and progressive, of either coding
OF_BLOCKS = (0xC0, 0xC1, 0xC2, 0xC9, 0xCA)
# libjpeg takes components of these names for colours that are no YCbCr
RGB = b"RGB"


@dataclass(frozen=True)
class Component:
    """How many samples `across` and `down` it has where another may have more, and its quantisation `table` (64,), in
    the order of the file."""

    across: int
    down: int
    table: tuple[int, ...]


@dataclass(frozen=True)
class Frame:
    """The frame header of a JPEG file: `height` and `width` px, its `components`."""

    height: int
    width: int
    components: tuple[Component, ...]

    def step(self, component: Component) -> tuple[int, int]:
        """How many pixels (down, across) a sample of a component stands for."""
        down, across = (max(getattr(one, key) for one in self.components) for key in ("down", "across"))
        return down // component.down, across // component.across


def bare(data: bytes) -> tuple[bytes, bool]:
    """The JPEG file without anything but its picture, and whether its colours are still told: an Adobe segment may say
    that they are no YCbCr. Raises ValueError."""
    parts, plain, shown = [], True, False
    for marker, segment in segments(data):
        if marker in KEPT:
            parts.append(segment)
        plain &= marker != ADOBE
        shown |= marker == SCAN
    if not shown:
        raise ValueError("it is a JPEG without a picture")
    return b"".join([SOI, *parts, EOI]), plain


def frame_of(data: bytes) -> Frame | None:
    """What a JPEG file says before its first scan's data. Raises ValueError.

    None where it is not of blocks of 8-bit samples, not grey or YCbCr, where a sample does not stand for a whole number
    of pixels, and where a component comes in a later scan, for which there may be another table.
    """
    head = scan = b""
    tables: dict[int, tuple[int, ...]] = {}
    for marker, segment in before_data(data):
        # fill bytes may come before the marker
        content = bytes(segment).lstrip(b"\xff")[3:]
        if marker == ADOBE or marker in FRAMES and marker not in OF_BLOCKS:
            return None
        if marker in FRAMES:
            head = content
        elif marker == QUANTISATION:
            tables |= _tables(content)
        elif marker == SCAN:
            scan = content
    parts = [head[at : at + 3] for at in range(6, len(head), 3)]
    if len(parts) not in (1, 3) or len(head) != 6 + 3 * head[5] or head[0] != 8 or scan[:1] != head[5:6]:
        return None
    if b"".join(part[:1] for part in parts) == RGB or any(part[2] not in tables for part in parts):
        return None
    components = tuple(Component(part[1] >> 4, part[1] & 15, tables[part[2]]) for part in parts)
    for sides in ([one.across for one in components], [one.down for one in components]):
        if not all(sides) or any(max(sides) % side for side in sides):
            return None
    return Frame(int.from_bytes(head[1:3], "big"), int.from_bytes(head[3:5], "big"), components)


def _tables(content: bytes) -> dict[int, tuple[int, ...]]:
    """Quantisation tables (64,) by number in such a segment's content (T.81, B.2.4.1). Raises ValueError."""
    found = {}
    while content:
        wide = 1 + (content[0] >> 4)
        if len(content) < 1 + 64 * wide:
            raise ValueError("its JPEG data are damaged")
        found[content[0] & 15] = tuple(np.frombuffer(content, f">u{wide}", 64, 1).tolist())
        content = content[1 + 64 * wide :]
    return found


def settings(data: bytes) -> tuple[int, int]:
    """(quality, sampling) for OpenCV's encoder that bring back the tables of a JPEG file.

    Coefficients that are quantised by the same tables again hardly change. The highest quality that is worth it where
    the tables are not the usual ones of libjpeg.
    """
    tables, sampling = [], SAMPLING
    for marker, segment in segments(data):
        if marker == QUANTISATION:
            tables.append(segment[4:])
        elif marker in FRAMES and len(segment) >= 19 and segment[9] == 3:
            said = int.from_bytes(bytes(segment[11 + 3 * i] for i in range(3)))
            sampling = said if said in SAMPLINGS else SAMPLING
    return _qualities().get(b"".join(tables), QUALITY), sampling


@cache
def _qualities() -> dict[bytes, int]:
    """Quantisation tables, as they are in the file -> quality of OpenCV's encoder."""
    import cv2

    found = {}
    for quality in range(100, 0, -1):
        small = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        tables = [segment[4:] for marker, segment in segments(small.tobytes()) if marker == QUANTISATION]
        found[b"".join(tables)] = quality
    return found


def encoded(picture: NDArray[np.uint8], quality: int = QUALITY, sampling: int = SAMPLING) -> bytes:
    """JPEG bytes of a BGR picture (height, width, 3) uint8, without any segment but those of the picture."""
    import cv2

    how = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling]
    done, data = cv2.imencode(".jpg", picture, how)
    if not done:
        raise ValueError("it cannot be written as JPEG")
    return bare(data.tobytes())[0]
