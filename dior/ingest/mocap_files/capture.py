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
EVERY = "export every frame"
POINT = "decimals must have a point, not a comma, so export it again with the settings of a language that has one"
# of a time, s, and a share of it; chosen: times are written to 0.01 s or finer, and 60 Hz may be 59.94
ROUNDED_S, ROUGHLY = 0.01, 0.01
# of periods: half-way between one and two; of a digit, chosen: a rate is rounded as well
MISSED, MISCOUNTED = 1.5, 0.02
# of a time after the point, at the most
MOST_DIGITS = 9


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
    step = _step(before, rate)
    if len(table) < said or not table:
        raise ValueError(f"it holds {len(table)} of its {said:.0f} frames; it is cut off, copy it again")
    whole = np.array(table).reshape(len(table), len(labels), 3)
    # the number that the first frame has at this rate, if it has one
    number = (first - 1) / step + 1
    first = number if number.is_integer() else 0
    return Capture(tuple(labels), units, up, rate, int(first), len(table), lambda index: whole[:, list(index)])


def _step(before: Sequence[tuple[int, float, float]], rate: float) -> float:
    """By how much the frames' numbers step from row to row: 1, or more where a part of the frames was exported, at the
    rate that this part has. Raises ValueError for rows that are left out and for times of another rate."""
    if len(before) < 2:
        return 1.0
    lines, frames, times = np.array(before).T
    # without a rate or a time nothing is off
    since, timed = times - times[0], rate > 0 and bool(np.isfinite(times).all())
    due = np.arange(len(before)) / rate if rate > 0 else np.full(len(before), np.inf)
    off = np.abs(since - due) > ROUNDED_S + ROUGHLY * due
    step = float(frames[1] - frames[0])
    step = step if step >= 1 and timed and not off.any() else 1.0
    if (wrong := np.diff(frames) != step).any():
        at = int(wrong.argmax()) + 1
        raise ValueError(
            f"line {lines[at]:.0f}: frame {frames[at]:g} follows frame {frames[at - 1]:g}; {EVERY}, gaps as well"
        )
    if off.any():
        at = int(off.argmax())
        raise ValueError(
            f"line {lines[at]:.0f}: its time is {since[at]:g} s after the first row's, and {at} frames at its rate of "
            f"{rate:g} Hz take {due[at]:g} s; {EVERY}, with the rate that they have"
        )
    if timed and (late := np.diff(times) > _longest_step(times, 1 / rate)).any():
        at = int(late.argmax()) + 1
        raise ValueError(
            f"line {lines[at]:.0f}: its time is {times[at] - times[at - 1]:g} s after that of the row before, which is "
            f"more than a frame at {rate:g} Hz; {EVERY}, gaps as well"
        )
    return step


def _longest_step(times: Floats, period: float) -> float:
    """The longest time (s) between rows of `times` (F,) of which none is left out, by the digits that they have."""
    digits = next((n for n in range(MOST_DIGITS) if np.allclose(times, times.round(n), rtol=0, atol=1e-9)), MOST_DIGITS)
    digit = 10.0**-digits
    # of times that are rounded a step is the next whole digit at most
    return max(MISSED * period, math.ceil(period / digit - MISCOUNTED) * digit) + 1e-9
