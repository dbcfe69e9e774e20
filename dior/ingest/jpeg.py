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
# The next marker in entropy-coded data: neither a stuffed zero nor a restart. Not the fill bytes before it: a pattern
# that begins with one certain byte is found 20 times as fast.
MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")


def segments(data: bytes | memoryview) -> Iterator[tuple[int, bytes | memoryview]]:
    """Yield (marker, its bytes) of a JPEG file, a scan with the data that follow it; up to the end of the picture.

    Raises ValueError where the bytes are no JPEG file or end too early: once those before have been given.
    """
    at = _start(data)
    while (found := _segment(data, at)) is not None:
        marker, end = found
        if marker == SCAN:
            after = MARKER.search(data, end)
            if after is None:
                raise ValueError("its JPEG data are cut off")
            end = after.start()
            # fill bytes are the next segment's
            while data[end - 1 : end] == b"\xff":
                end -= 1
        yield marker, data[at:end]
        at = end


def before_data(data: bytes | memoryview) -> list[tuple[int, bytes | memoryview]]:
    """The first of `segments`, up to the header of the first scan; what is behind it is not looked at. Raises
    ValueError."""
    at, found = _start(data), []
    while (segment := _segment(data, at)) is not None:
        marker, end = segment
        found.append((marker, data[at:end]))
        if marker == SCAN:
            break
        at = end
    return found


def _start(data: bytes | memoryview) -> int:
    if data[:2] != SOI:
        raise ValueError("it is no JPEG")
    return len(SOI)


def _segment(data: bytes | memoryview, at: int) -> tuple[int, int] | None:
    """(marker, end) of the segment at a byte, of a scan its header's; None at the end of the picture."""
    while data[at + 1 : at + 2] == b"\xff":
        at += 1
    if data[at : at + 1] != b"\xff" or at + 4 > len(data) and data[at : at + 2] != EOI:
        raise ValueError("its JPEG data are cut off or damaged")
    marker = data[at + 1]
    if marker == EOI[1]:
        return None
    size = int.from_bytes(data[at + 2 : at + 4], "big")
    if size < 2 or at + 2 + size > len(data):
        raise ValueError("its JPEG data are cut off or damaged")
    return marker, at + 2 + size


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
