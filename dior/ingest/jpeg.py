"""The segments of a JPEG file, and its picture's size, without decoding it.

INPUTS   the bytes of a JPEG file, as ITU-T T.81 lays them out (Annex B)
OUTPUTS  its segments in order; height and width, px
ValueError means damage.
"""

import re
from collections.abc import Iterator

SOI, EOI = b"\xff\xd8", b"\xff\xd9"
SCAN = 0xDA
# SOF0 to SOF15; 0xC4, 0xC8 and 0xCC among them are tables and a reserved one (T.81, table B.1)
FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
# the next marker in entropy-coded data: neither a stuffed zero nor a restart
MARKER = re.compile(rb"\xff+[^\x00\xff\xd0-\xd7]")


def segments(data: bytes | memoryview) -> Iterator[tuple[int, bytes | memoryview]]:
    """Yield (marker, its bytes) of a JPEG file, a scan with the data that follow it; up to the end of the picture.

    Raises ValueError where the bytes are no JPEG file or end too early: once those before have been given.
    """
    if data[:2] != SOI:
        raise ValueError("it is no JPEG")
    at = 2
    while True:
        start = at
        while data[at + 1 : at + 2] == b"\xff":
            at += 1
        if data[at : at + 1] != b"\xff" or at + 4 > len(data) and data[at : at + 2] != EOI:
            raise ValueError("its JPEG data are cut off or damaged")
        marker = data[at + 1]
        if marker == EOI[1]:
            return
        size = int.from_bytes(data[at + 2 : at + 4], "big")
        end = at + 2 + size
        if size < 2 or end > len(data):
            raise ValueError("its JPEG data are cut off or damaged")
        if marker == SCAN:
            found = MARKER.search(data, end)
            if found is None:
                raise ValueError("its JPEG data are cut off")
            end = found.start()
        yield marker, data[start:end]
        at = end


def check_whole(data: bytes | memoryview) -> None:
    """Raise ValueError where the bytes end before the picture does."""
    at = len(SOI)
    for marker, segment in segments(data):
        at += len(segment)
        if marker in FRAMES:
            break
    # a thumbnail's comes before the frame header; a walk through the scans takes as long as decoding them
    if bytes(data[at:]).rfind(EOI) < 0:
        raise ValueError("its JPEG data are cut off")


def frame_size(data: bytes | memoryview) -> tuple[int, int]:
    """(height, width) px as the frame header says. Raises ValueError where there is none."""
    for marker, segment in segments(data):
        if marker in FRAMES:
            # fill bytes may come before the marker
            header = bytes(segment).lstrip(b"\xff")[3:]
            if len(header) < 5:
                break
            return int.from_bytes(header[1:3], "big"), int.from_bytes(header[3:5], "big")
        if marker == SCAN:
            break
    raise ValueError("its JPEG data have no frame header")
