"""What a file with motion capture holds, and the rows of numbers of those that are text.

INPUTS   rows of text. OUTPUTS: a `Capture`, its coordinates as the file has them.
"""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.project.plain_text import Line, each_row

# chosen: ten minutes at 200 Hz of 100 markers
MOST_BYTES = 1 << 28
# chosen: a thousand markers
MOST_CELLS = 3100
# as tools write that a marker was not seen
NOTHING = ("", "nan", "null")
_COMMA = re.compile(r"[-+]?\d+,\d+")
POINT = "decimals must have a point, not a comma, so export it again with the settings of a language that has one"
# of a time, s, and a share of it; chosen: times are written to 0.01 s or finer, and 60 Hz may be 59.94
ROUNDED_S, ROUGHLY = 0.01, 0.01


@dataclass(frozen=True, eq=False)
class Capture:
    """`labels` of the points in their order; `units` as written, "" if they are not; `up`: the axis that the file says
    is vertical, "" if it does not; `rate` Hz, 0 if it is not written; `first`: number of the first frame stored,
    counted from 1, 0 where the file contradicts itself; `frames`: how many are stored; `points(index)`: coordinates
    (frames, points, 3) of some of the points, NaN where missing, as written. `points` raises ValueError."""

    labels: tuple[str, ...]
    units: str
    up: str
    rate: float
    first: int
    frames: int
    points: Callable[[Sequence[int]], Floats]


def rows(path: AnyPath, delimiter: str) -> Iterable[Line]:
    """The rows of a text file that are not empty. Raises DiorError as `each_row`."""
    return each_row(path, path, delimiter, MOST_BYTES, MOST_CELLS)


def numbers(line: int, cells: Sequence[str], count: int) -> list[float]:
    """The `count` numbers of a row, NaN where there is nothing. Raises ValueError for other words, fewer and more."""
    if len(cells) < count:
        raise ValueError(f"line {line} has {len(cells)} columns, not {count}; was the export interrupted?")
    try:
        values = [math.nan if cell.lower() in NOTHING else float(cell) for cell in cells]
    except ValueError as error:
        if comma := next((cell for cell in cells if _COMMA.fullmatch(cell)), ""):
            raise ValueError(f"line {line} holds {comma:.40}; {POINT}") from None
        raise ValueError(f"line {line} holds something that is no number: {error!s:.60}") from None
    if any(cells[count:]):
        raise ValueError(f"line {line} has {len(cells)} columns, not {count} as its markers need; export it again")
    return values[:count]


def number(word: str, what: str) -> float:
    """A number of a header. Raises ValueError that says `what` it should be."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        why = f"; {POINT}" if _COMMA.fullmatch(word) else ""
        raise ValueError(f"its {what} is '{word:.40}', which is no number{why}")
    return value


def without_last(cells: Sequence[str]) -> list[str]:
    """The cells up to the last that is not empty; those before it keep their places."""
    return list(cells[: max((at for at, cell in enumerate(cells, 1) if cell), default=0)])


def named(labels: list[str], counted: str | None, what: str) -> list[str]:
    """`labels`, and "" for each of the last markers that has none, where the header's `what` has `counted` of them.

    Raises ValueError where there are more names than that.
    """
    if counted is None:
        return labels
    count = number(counted, what)
    if count < len(labels) or count > MOST_CELLS:
        raise ValueError(f"its {what} is {counted:.40}, and it names {len(labels)} markers; export it again")
    return labels + [""] * (int(count) - len(labels))


def captured(
    labels: Sequence[str],
    units: str,
    up: str,
    rate: float,
    first: float,
    said: float,
    table: list[list[float]],
    before: Sequence[tuple[int, float, float]],
) -> Capture:
    """A `Capture` of `table`, rows of x, y, z of every label; `said`: frames that the header promises; `before`: line,
    frame and time (s, NaN where there is none) of every row, or nothing.

    Raises ValueError where there are fewer, or none, where frames are left out, and for times of another rate.
    """
    _check_steps(before, rate)
    if len(table) < said or not table:
        raise ValueError(f"it holds {len(table)} of its {said:.0f} frames; it is cut off, copy it again")
    whole = np.array(table).reshape(len(table), len(labels), 3)
    return Capture(tuple(labels), units, up, rate, int(first), len(table), lambda index: whole[:, list(index)])


def _check_steps(before: Sequence[tuple[int, float, float]], rate: float) -> None:
    """Refuse rows that are not frame after frame at `rate` Hz."""
    begun = before[0][2] if before else math.nan
    for at in range(1, len(before)):
        line, frame, time = before[at]
        last = before[at - 1][1]
        if frame != last + 1:
            raise ValueError(f"line {line}: frame {frame:g} follows frame {last:g}; export every frame, gaps as well")
        if rate > 0 and abs(time - begun - at / rate) > ROUNDED_S + ROUGHLY * at / rate:
            raise ValueError(
                f"line {line}: its time is {time - begun:g} s after the first row's, and {at} frames at its rate of "
                f"{rate:g} Hz take {at / rate:g} s; export every frame, with the rate that they have"
            )
