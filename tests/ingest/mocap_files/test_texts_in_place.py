"""What would put a marker or a frame of a text file in another's place."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import mocap
from tests.ingest.c3d_files import PLACES, person
from tests.ingest.mocap_files.texts import motive, qtm, trc

LABELS = list(PLACES)
POINTS = person(LABELS, 24)
WRITERS = [trc, qtm, motive]
# line of the first frame, from 0
FIRST = {trc: 6, qtm: 11, motive: 7}
COUNT = {trc: "\t24\t24\t", qtm: "NO_OF_FRAMES\t24", motive: "Total Exported Frames,24"}


def file_of(folder, write, labels=LABELS, points=POINTS, **how):
    return write(folder / f"a.{write.__name__}", labels, points, **how)


def with_rows(path, write, keep):
    """The file with those of its rows only that the slice `keep` leaves, and with their number in its header."""
    lines = path.read_bytes().decode().splitlines(keepends=True)
    head, rows = lines[: FIRST[write]], lines[FIRST[write] :]
    assert len(rows) == len(POINTS)
    rows = rows[keep] if isinstance(keep, slice) else [rows[at] for at in keep]
    text = "".join(head).replace(COUNT[write], COUNT[write].replace("24", str(len(rows)), 1))
    path.write_bytes((text + "".join(rows)).encode())
    return path


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("at", [0, 7, len(LABELS)])
def test_a_marker_without_a_name_shifts_no_other(tmp_path, write, at):
    labels, points = LABELS[:at] + [""] + LABELS[at:], np.insert(POINTS, at, POINTS[:, 3] + 0.03, axis=1)
    got = mocap.read(file_of(tmp_path, write, labels, points))
    assert set(got.markers) == set(LABELS)
    np.testing.assert_allclose(got.points, POINTS[:, [LABELS.index(marker) for marker in got.markers]], atol=1e-5)


@pytest.mark.parametrize("write", WRITERS)
def test_rows_that_are_left_out(tmp_path, write):
    path = with_rows(file_of(tmp_path, write), write, [*range(4), *range(7, 24)])
    first = 0 if write is motive else 1
    with pytest.raises(DiorError, match=rf"line {FIRST[write] + 5}: frame {first + 7} follows frame {first + 3}; exp"):
        mocap.read(path)


@pytest.mark.parametrize("write", WRITERS)
def test_every_second_row_and_times_of_another_rate(tmp_path, write):
    with pytest.raises(DiorError, match=r"frame [23] follows frame [01]; export every frame"):
        mocap.read(with_rows(file_of(tmp_path, write), write, slice(None, None, 2)))
    path = file_of(tmp_path, write, rate=50.0)
    for old, new in (("\n50\t50\t", "\n100\t50\t"), ("FREQUENCY\t50", "FREQUENCY\t100"), ("e,50.0", "e,100.0")):
        path.write_bytes(path.read_bytes().replace(old.encode(), new.encode(), 2 if write is motive else 1))
    with pytest.raises(DiorError, match=r"its time is 0.04 s after .* 2 frames at its rate of 100 Hz take 0.02 s"):
        mocap.read(path)


def renumbered(path, write, step):
    """The file with its frames' numbers as every `step`-th frame of a capture has them, its times left alone."""
    lines = path.read_bytes().decode().splitlines(keepends=True)
    mark = "," if write is motive else "\t"
    for at in range(FIRST[write], len(lines)):
        number, rest = lines[at].split(mark, 1)
        first = 0 if write is motive else 1
        lines[at] = f"{first + step * (int(number) - first)}{mark}{rest}"
    path.write_bytes("".join(lines).encode())
    return path


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("step", [2, 5])
def test_every_second_frame_of_a_capture_at_the_rate_that_these_have(tmp_path, write, step):
    path = renumbered(file_of(tmp_path, write, rate=50.0, first=11), write, step)
    got = mocap.read(path)
    # the first of them is 0.2 s after the start, as it was
    assert (got.rate, got.first_frame) == (50.0, 11)
    np.testing.assert_allclose(got.points, POINTS[:, [LABELS.index(marker) for marker in got.markers]], atol=1e-5)
    if write is not motive:
        path.write_bytes(path.read_bytes().replace(f"\n{step * 10 + 1}\t".encode(), f"\n{step * 10 + 2}\t".encode(), 1))
        with pytest.raises(DiorError, match=r"line \d+: frame \d+ follows frame \d+; export every frame"):
            mocap.read(path)


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("digits", [2, 6])
def test_a_row_that_is_left_out_and_the_frames_counted_on(tmp_path, write, digits):
    """Only the times tell."""
    path = with_rows(file_of(tmp_path, write), write, [*range(9), *range(10, 24)])
    lines = path.read_bytes().decode().splitlines(keepends=True)
    mark = "," if write is motive else "\t"
    first = 0 if write is motive else 1
    for place, at in enumerate(range(FIRST[write], len(lines))):
        _, time, rest = lines[at].split(mark, 2)
        lines[at] = mark.join([str(first + place), f"{float(time):.{digits}f}", rest])
    path.write_bytes("".join(lines).encode())
    with pytest.raises(DiorError, match=rf"line {FIRST[write] + 10}: its time is 0.02 s after that of the row before"):
        mocap.read(path)


@pytest.mark.parametrize("rate", [60.0, 59.94, 100.0, 119.88, 120.0, 200.0, 250.0])
@pytest.mark.parametrize("digits", [2, 3, 5])
def test_times_of_any_digits_are_no_rows_that_are_left_out(tmp_path, rate, digits):
    path = file_of(tmp_path, trc, rate=rate, points=person(LABELS, 400))
    lines = path.read_text().splitlines(keepends=True)
    for at in range(FIRST[trc], len(lines)):
        number, time, rest = lines[at].split("\t", 2)
        lines[at] = f"{number}\t{float(time):.{digits}f}\t{rest}"
    path.write_text("".join(lines))
    assert len(mocap.read(path).points) == 400


@pytest.mark.parametrize("write", WRITERS)
def test_a_rate_and_times_that_are_rounded(tmp_path, write):
    path = file_of(tmp_path, write, rate=59.94)
    text = path.read_text()
    assert "59.94" in text
    path.write_text(text.replace("59.940000", "60").replace("59.94", "60"))
    assert mocap.read(path).rate == 60.0


@pytest.mark.parametrize("write", [trc, qtm])
def test_decimal_commas(tmp_path, write):
    path = file_of(tmp_path, write)
    path.write_text(path.read_text().replace(".", ","))
    with pytest.raises(DiorError, match=r"line \d+ holds 0,0+; decimals must have a point, not a comma"):
        mocap.read(path)


def test_more_names_than_the_header_counts(tmp_path):
    path = file_of(tmp_path, trc)
    path.write_text(path.read_text().replace("\t24\t24\t", "\t24\t20\t"))
    with pytest.raises(DiorError, match="its NumMarkers is 20, and it names 24 markers"):
        mocap.read(path)
    path.write_text(
        path.read_text()
        .replace("\t24\t20\t", "\t24\t24\t")
        .replace("\tLTOE\t\t", "\t\t\t")
        .replace("\n3\t", "\n3\t0\t")
    )
    with pytest.raises(DiorError, match="line 9 has 75 columns, not 74"):
        mocap.read(path)


def test_keys_of_qualisys_in_small_letters(tmp_path):
    path = file_of(tmp_path, qtm)
    head, rest = path.read_text().split("MARKER_NAMES")
    path.write_text(head.lower() + "marker_names" + rest)
    assert mocap.read(path).rate == 100.0
    path.write_text((head + "MARKER_NAMES" + rest).replace("Frame\tTime", "FRAME\tTIME"))
    assert mocap.read(path).rate == 100.0


@pytest.mark.parametrize("write", WRITERS)
def test_utf_16_is_said_and_is_no_c3d(tmp_path, write):
    path = file_of(tmp_path, write)
    path.write_bytes(path.read_bytes().decode().encode("utf-16"))
    with pytest.raises(DiorError, match="is UTF-16"):
        mocap.read(path)
