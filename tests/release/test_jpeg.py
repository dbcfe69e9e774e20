"""JPEG files without what is not the picture."""

import cv2
import numpy as np
import pytest

from dior.ingest.jpeg import MARKER, SCAN, segments
from dior.release import jpeg


@pytest.fixture(scope="module")
def picture():
    small = np.random.default_rng(0).integers(30, 220, (4, 5, 3), np.uint8)
    return cv2.resize(small, (64, 48), interpolation=cv2.INTER_LINEAR)


def file_of(picture, *flags):
    return cv2.imencode(".jpg", picture, list(flags))[1].tobytes()


def segment(marker, content):
    return bytes([0xFF, marker]) + (len(content) + 2).to_bytes(2) + content


def dirty(data, *extra):
    return data[:2] + b"".join(extra) + data[2:]


EXIF = segment(0xE1, b"Exif\0\0" + b"Canon EOS of Alice, 52.1 N 5.2 E" * 20)
COMMENT, OTHER = segment(0xFE, b"taken by Alice"), segment(0xF3, b"Alice")


@pytest.mark.parametrize("progressive", [0, 1])
def test_nothing_but_the_picture_is_left(picture, progressive):
    data = file_of(picture, cv2.IMWRITE_JPEG_PROGRESSIVE, progressive)
    found, plain = jpeg.bare(dirty(data, EXIF, COMMENT, OTHER, b"\xff\xff"[:1] + segment(0xE0, b"JFIF")) + b"Alice" * 9)
    assert plain and b"Alice" not in found and b"Exif" not in found and b"JFIF" not in found
    assert {marker for marker, _ in segments(found)} <= jpeg.KEPT
    same = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert (cv2.imdecode(np.frombuffer(found, np.uint8), cv2.IMREAD_COLOR) == same).all()
    assert jpeg.bare(found)[0] == found


def test_comment_between_two_scans_goes(picture):
    data = file_of(picture, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    second = [found.start() for found in MARKER.finditer(data) if data[found.start() + 1] == SCAN][1]
    found, _ = jpeg.bare(data[:second] + COMMENT + data[second:])
    assert found == jpeg.bare(data)[0]


def test_restart_markers_do_not_end_a_scan(picture):
    data = file_of(picture, cv2.IMWRITE_JPEG_RST_INTERVAL, 2)
    assert b"\xff\xd3" in data
    assert jpeg.bare(dirty(data, EXIF))[0] == jpeg.bare(data)[0]


def test_fill_bytes_before_a_marker_are_no_data_of_a_scan(picture):
    data = file_of(picture, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    ends = [found.start() for found in MARKER.finditer(data, data.index(b"\xff\xda") + 12)]
    filled = data
    for end in reversed(ends):
        filled = filled[:end] + b"\xff\xff" + filled[end:]
    scans = [
        [bytes(part).lstrip(b"\xff") for marker, part in segments(one) if marker == SCAN] for one in (data, filled)
    ]
    assert len(ends) > 3 and len(scans[0]) > 2 and scans[0] == scans[1]


def test_colours_of_an_adobe_segment_are_told(picture):
    assert not jpeg.bare(dirty(file_of(picture), segment(0xEE, b"Adobe\0d\0\0\0\0\0")))[1]


def test_every_cut_is_found(picture):
    data = file_of(picture)
    for end in [*range(0, len(data), 9), len(data) - 2, len(data) - 1]:
        with pytest.raises(ValueError):
            jpeg.bare(data[:end])


@pytest.mark.parametrize("data", [b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xd9", b"\xff\xd8hello, this is no JPEG"])
def test_what_is_no_picture(data):
    with pytest.raises(ValueError):
        jpeg.bare(data)


@pytest.mark.parametrize("quality", [10, 50, 80, 85, 95, 100])
@pytest.mark.parametrize("sampling", [0x221111, 0x211111, 0x111111])
def test_settings_of_the_recorder_come_back(picture, quality, sampling):
    how = (cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling)
    assert jpeg.settings(file_of(picture, *how)) == (quality, sampling)


def test_tables_of_nobody(picture):
    data = bytearray(file_of(picture, cv2.IMWRITE_JPEG_QUALITY, 40))
    data[data.index(b"\xff\xdb") + 7] += 1
    assert jpeg.settings(bytes(data))[0] == jpeg.QUALITY


def test_encoding_again_hardly_changes_a_picture(picture):
    data = file_of(picture, cv2.IMWRITE_JPEG_QUALITY, 80)
    once = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    again = jpeg.encoded(once, *jpeg.settings(data))
    twice = cv2.imdecode(np.frombuffer(again, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(twice.astype(int) - once).mean() < 0.5
    assert {marker for marker, _ in segments(again)} <= jpeg.KEPT
