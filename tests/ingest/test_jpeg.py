"""The segments of a JPEG file, by files whose bytes are known."""

import cv2
import numpy as np
import pytest

from dior.ingest import jpeg

EXIF = b"\xff\xe1\x00\x16" + b"\xff\xc0" * 10


def file_of(height, width, *flags):
    return cv2.imencode(".jpg", np.full((height, width, 3), 90, np.uint8), list(flags))[1].tobytes()


@pytest.mark.parametrize("progressive", [0, 1])
def test_size_behind_other_segments_and_fill_bytes(progressive):
    data = file_of(30, 500, cv2.IMWRITE_JPEG_PROGRESSIVE, progressive)
    assert jpeg.frame_size(data) == (30, 500)
    frame = data.index(b"\xff\xc2" if progressive else b"\xff\xc0")
    assert jpeg.frame_size(data[:2] + EXIF + data[2:frame] + b"\xff\xff" + data[frame:]) == (30, 500)
    assert jpeg.frame_size(memoryview(data)) == (30, 500)


def test_segments_are_the_whole_file_and_in_order():
    data = file_of(8, 8)
    found = list(jpeg.segments(data))
    assert jpeg.SOI + b"".join(part for _, part in found) + jpeg.EOI == data
    assert found[0][0] == 0xE0 and found[-1][0] == jpeg.SCAN and 0xC0 in [marker for marker, _ in found]


def test_a_table_is_no_frame_and_a_scan_ends_the_search():
    """0xC4 holds Huffman tables; a frame after the first scan is another picture's."""
    data = file_of(8, 16)
    frame = data.index(b"\xff\xc0")
    huffman = data.index(b"\xff\xc4")
    assert jpeg.frame_size(data[:2] + data[huffman : huffman + 2 + data[huffman + 3]] + data[2:]) == (8, 16)
    size = int.from_bytes(data[frame + 2 : frame + 4], "big") + 2
    with pytest.raises(ValueError, match="no frame header"):
        jpeg.frame_size(data[:frame] + data[frame + size : -2] + data[frame : frame + size] + jpeg.EOI)


@pytest.mark.parametrize(
    "data",
    [b"", b"GIF89a", b"\xff\xd8", b"\xff\xd8\xff\xe0", b"\xff\xd8\x00\x01\x02", b"\xff\xd8\xff\xc0\x00\x04\x08\x00"],
)
def test_what_is_no_jpeg_or_too_short(data):
    with pytest.raises(ValueError, match="JPEG"):
        jpeg.frame_size(data)
