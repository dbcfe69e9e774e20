"""JPEG files as bytes: dropping what is not the picture, and encoding a changed picture as the recorder did.

INPUTS   the bytes of a JPEG file, as ITU-T T.81 lays them out
OUTPUTS  the same picture in fewer bytes; encoder settings
What does not need the pixels is done without decoding: a picture that is passed on unchanged keeps its pixels bit by
bit.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from dior.ingest.jpeg import EOI, FRAMES, SCAN, SOI, segments

# Segments that make the picture: frames, Huffman and arithmetic tables, quantisation tables, restart interval, scans.
# All others (APPn with EXIF, thumbnails, places and serial numbers; COM; what is reserved) are dropped.
QUANTISATION, RESTART = 0xDB, 0xDD
KEPT = {*range(0xC0, 0xD0), SCAN, QUANTISATION, RESTART} - {0xC8}
ADOBE = 0xEE
# for pictures that were no JPEG, and those whose tables are nobody's
QUALITY, SAMPLING = 95, 0x221111
SAMPLINGS = (0x411111, 0x221111, 0x211111, 0x121111, 0x111111)


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
