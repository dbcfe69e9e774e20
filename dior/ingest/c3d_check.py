"""What a C3D file says of itself, and whether that is true: asked before ezc3d reads the numbers, which crashes, hangs
or makes numbers up where it is not.

INPUTS   a path.  OUTPUTS  a `Layout`; a ValueError says what is wrong, and the likely fix where there is one.
Source: the C3D file format, user guide of c3d.org. A header of one block; "The parameter section": a header of 4 bytes
(the third is the number of blocks, the fourth the processor), then groups and parameters, each with the distance to the
next; "3D point data": four numbers a point, then the analog samples of the frame, frame after frame.
"""

import math
import os
import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dior.arrays import AnyPath

# of the user guide: blocks of 512 bytes, counted in one byte; processors; types of a parameter and how long they are
BLOCK, MOST_BLOCKS = 512, 255
INTEL, DEC, MIPS = 84, 85, 86
TEXT, SHORT, FLOAT = -1, 2, 4
BYTES_OF = {TEXT: 1, 1: 1, SHORT: 2, FLOAT: 4}
MOST_DIMENSIONS = 7
# the largest number of a frame that the header can hold
MOST_FRAMES = 65535


class Parameter(NamedTuple):
    """A parameter as the file has it: `kind` of BYTES_OF, `dimensions` as written, `content` of its bytes."""

    kind: int
    dimensions: tuple[int, ...]
    content: bytes


class Frame(NamedTuple):
    """What one frame holds: points, analog samples, and whether the numbers are floats, else 2-byte integers."""

    points: int
    analogs: int
    floats: bool

    @property
    def size(self) -> int:
        """Bytes."""
        return (4 * self.points + self.analogs) * (4 if self.floats else 2)

    def __str__(self) -> str:
        return f"{self.points} points and {self.analogs} analog samples of {4 if self.floats else 2} bytes"


@dataclass(frozen=True)
class Layout:
    """`labels` of the points, in their order; `units`: as written, "" if they are not; `rate` Hz, 0 if it is not
    written; `first`: number of the first frame stored, from 1, 0 where the header's first and last are not those of
    the frames stored; `frames`: how many are stored; `up`: the axis that POINT:Y_SCREEN has upwards, "" if none."""

    labels: tuple[str, ...]
    units: str
    rate: float
    first: int
    frames: int
    up: str = ""


def layout(path: AnyPath) -> Layout:
    """What the file holds. Raises ValueError where that is damaged or does not fit the file's size."""
    size = os.path.getsize(path)
    with open(path, "rb") as stream:
        head = stream.read(BLOCK)
        if len(head) < BLOCK or head[1] != 0x50:
            raise ValueError("it does not begin like a C3D")
        stream.seek(BLOCK * (head[0] - 1) if head[0] else len(head))
        begin = stream.read(4)
        # some writers leave the number of blocks at 0
        data = begin + stream.read(BLOCK * (begin[2] or MOST_BLOCKS) - 4) if len(begin) == 4 else b""
    if len(data) < BLOCK or data[3] not in (INTEL, DEC, MIPS):
        raise ValueError("its parameters are not where its header says")
    if data[3] == MIPS:
        raise ValueError(
            "it is in the byte order of MIPS (SGI) computers, which ezc3d does not read; export it for a PC"
        )
    parameters = _Parameters(_records(data), data[3])
    return _fitted(_Header(head, data[3]), parameters, size)


class _Header:
    """The header's numbers, whose words are counted from 1 as in the user guide."""

    def __init__(self, head: bytes, processor: int) -> None:
        words = np.frombuffer(head, "<u2")
        self.first, self.last, self.start = int(words[3]), int(words[4]), int(words[8])
        (scale,), (self.rate,) = (_floats(head[at : at + 4], processor) for at in (12, 20))
        self.frame = Frame(int(words[1]), int(words[2]), scale < 0)
        self.samples = int(words[9])


class _Parameters:
    """Parameters by `GROUP:NAME`."""

    def __init__(self, found: dict[str, Parameter], processor: int) -> None:
        self.found, self.processor = found, processor

    def __contains__(self, name: str) -> bool:
        return name in self.found

    def numbers(self, name: str) -> list[float]:
        """The numbers of a parameter, none where it is missing or a text. Integers are those without a sign."""
        if name not in self.found:
            return []
        kind, _, content = self.found[name]
        if kind == FLOAT:
            return _floats(content, self.processor)
        if kind == SHORT:
            return [float(v) for v in np.frombuffer(content, "<u2")]
        return [float(v) for v in content] if kind == 1 else []

    def number(self, name: str) -> float:
        """The first number, 0 where there is none."""
        return (self.numbers(name) or [0.0])[0]

    def whole(self, name: str) -> int:
        """The same as a whole number, 0 where it is none."""
        value = self.number(name)
        return int(value) if math.isfinite(value) else 0

    def long(self, name: str) -> int:
        """A number in two 2-byte halves, the lower first; 0 where there is none."""
        halves = self.numbers(name)
        return int(halves[0]) + 65536 * int(halves[1]) if len(halves) == 2 else 0

    def texts(self, name: str) -> list[str]:
        """The texts of a parameter, none where it is missing or no text."""
        if name not in self.found or self.found[name].kind != TEXT:
            return []
        _, dimensions, content = self.found[name]
        width = dimensions[0] if dimensions else 1
        count = math.prod(dimensions[1:])
        return [_text(content[width * i : width * (i + 1)]) for i in range(count)]


def _text(content: bytes) -> str:
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.strip("\0 \t\r\n")


def _floats(content: bytes, processor: int) -> list[float]:
    """Floats of 4 bytes; a VAX's (DEC) have their halves exchanged and are four times as large as IEEE's."""
    if processor == DEC:
        halves = np.frombuffer(content, "<u2").reshape(-1, 2)[:, ::-1]
        return [float(v) / 4 for v in np.ascontiguousarray(halves).view("<f4")[:, 0]]
    return [float(v) for v in np.frombuffer(content, "<f4")]


def _fitted(header: _Header, parameters: _Parameters, size: int) -> Layout:
    """The layout that ezc3d reads, where the file's size (bytes) bears it out."""
    frame = _as_ezc3d(header, parameters)
    if not frame.points:
        raise ValueError("POINT:USED is 0, so it holds no markers; export it with them")
    first, counts = _counts(header, parameters)
    there, elsewhere = (size - BLOCK * (at - 1) for at in (header.start, parameters.whole("POINT:DATA_START")))
    frames = _that_fit(counts, frame, there) or (counts or [max(there, 0) // frame.size])[0]
    fits = bool(_that_fit([frames], frame, there))
    if not fits and elsewhere != there and _that_fit(counts, frame, elsewhere):
        raise ValueError(
            f"its data begin at block {header.start} by its header, and by POINT:DATA_START where they fit the file's "
            "size; export it again"
        )
    if header.start < 2 or there <= 0:
        raise ValueError(
            f"its data would begin at block {header.start} of {size // BLOCK}; it is cut off, copy it again"
        )
    if not fits and frame != header.frame:
        right = "its header" if _that_fit(counts, header.frame, there) else "neither"
        way = ", without analog data" if frame.analogs != header.frame.analogs else ""
        raise ValueError(
            f"a frame is {header.frame} by its header, and {frame} by POINT:USED, POINT:SCALE, ANALOG:USED and "
            f"ANALOG:RATE / POINT:RATE; with {frames} frames {right} fits the file's size, so export it again{way}"
        )
    if frames * frame.size > there:
        raise ValueError(f"it holds {there // frame.size} of its {frames} frames; it is cut off, so copy it again")
    units = (parameters.texts("POINT:UNITS") or [""])[0]
    rate = parameters.number("POINT:RATE") or header.rate
    if header.last < MOST_FRAMES and header.last - header.first + 1 != frames or first == MOST_FRAMES:
        first = 0
    screen = (parameters.texts("POINT:Y_SCREEN") or [""])[0].upper()
    up = screen[-1].lower() if screen in ("X", "Y", "Z", "+X", "+Y", "+Z") else ""
    return Layout(tuple(_labels(parameters)[: frame.points]), units, rate, first, frames, up)


def _that_fit(counts: list[int], frame: Frame, there: int) -> int:
    """The first of some numbers of frames that fills the data but for what the last block leaves empty, else 0."""
    return next((count for count in counts if 0 <= there - count * frame.size < BLOCK), 0)


def _as_ezc3d(header: _Header, parameters: _Parameters) -> Frame:
    """What ezc3d takes for a frame: the parameters go before the header."""
    rate = parameters.number("POINT:RATE")
    ratio = parameters.number("ANALOG:RATE") / rate if rate >= 1 else math.nan
    # it cuts, so that 999.9 / 100 samples a frame are 9
    samples = int(ratio) if math.isfinite(ratio) else header.samples
    floats = parameters.number("POINT:SCALE") < 0 if "POINT:SCALE" in parameters else header.frame.floats
    return Frame(parameters.whole("POINT:USED"), parameters.whole("ANALOG:USED") * samples, floats)


def _counts(header: _Header, parameters: _Parameters) -> tuple[int, list[int]]:
    """Number of the first frame stored, from 1, and how many there are by each that says it.

    The header's numbers end at 65535; Vicon writes the whole ones to TRIAL.
    """
    # some writers count from 0
    first, last = (header.first, header.last) if header.first else (1, header.last + 1)
    counts = [last - first + 1] if first <= last < MOST_FRAMES else []
    start, end = parameters.long("TRIAL:ACTUAL_START_FIELD"), parameters.long("TRIAL:ACTUAL_END_FIELD")
    if 0 < start <= end and (start % (MOST_FRAMES + 1) == first or first == MOST_FRAMES):
        first, counts = start, [end - start + 1, *counts]
    longer = [parameters.whole(name) for name in ("POINT:FRAMES", "POINT:LONG_FRAMES")]
    return first, counts + [count for count in longer if 0 < count != MOST_FRAMES]


def _labels(parameters: _Parameters) -> list[str]:
    """All labels in the order of the points; past 255 points they go on in LABELS2, LABELS3, ..."""
    labels: list[str] = []
    number = 1
    while (key := f"POINT:LABELS{number}" if number > 1 else "POINT:LABELS") in parameters:
        labels += parameters.texts(key)
        number += 1
    return labels


def _records(data: bytes) -> dict[str, Parameter]:
    """The parameters of the section `data`. Raises ValueError where one does not end within its record and `data`."""
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Parameter]] = []
    at = 4
    while at < len(data) and data[at]:
        at, number, name, parameter = _record(data, at)
        if parameter is None:
            groups[-number] = name
        else:
            found.append((number, name, parameter))
    if at > len(data):
        raise ValueError("its parameters end beyond their blocks")
    return {f"{groups.get(number, '')}:{name}": parameter for number, name, parameter in found}


def _record(data: bytes, at: int) -> tuple[int, int, str, Parameter | None]:
    """The record at byte `at`: where the next one begins (the end of `data` after the last), the number of its group
    (negative for a group itself), its name, and what a parameter holds."""
    where = f"at byte {at} of its parameters"
    parameter = None
    try:
        size, group = struct.unpack_from("bb", data, at)
        name = data[at + 2 : at + 2 + abs(size)].decode("latin-1").strip().upper()
        ahead = at + 2 + abs(size)
        (distance,) = struct.unpack_from("<h", data, ahead)
        end = ahead + 2
        if group > 0:
            kind, count = struct.unpack_from("bB", data, end)
            if kind not in BYTES_OF or count > MOST_DIMENSIONS:
                raise ValueError(f"the parameter {name} {where} is of type {kind} with {count} dimensions")
            dimensions = tuple(data[end + 2 : end + 2 + count])
            begin = end + 2 + count
            end = begin + BYTES_OF[kind] * math.prod(dimensions)
            parameter = Parameter(kind, dimensions, data[begin:end])
        end += 1 + data[end]
    except (struct.error, IndexError):
        raise ValueError(f"the record {where} is damaged") from None
    if not group:
        raise ValueError(f"the record {name!r} {where} is of no group")
    if distance and ahead + distance < end or end > len(data):
        raise ValueError(f"the record {name!r} {where} is longer than it says")
    return (ahead + distance if distance else len(data)), group, name, parameter
