"""What a file with motion capture holds, and the rows of numbers of those that are text.

INPUTS   rows of text. OUTPUTS: a `Capture`, its coordinates as the file has them.
"""

import math
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


def numbers(line: int, cells: Sequence[str], least: int) -> list[float]:
    """The numbers of a row, NaN where there is nothing. Raises ValueError for other words and fewer than `least`."""
    if len(cells) < least:
        raise ValueError(f"line {line} has {len(cells)} columns, not {least}; was the export interrupted?")
    try:
        return [math.nan if cell.lower() in NOTHING else float(cell) for cell in cells]
    except ValueError as error:
        raise ValueError(f"line {line} holds something that is no number: {error!s:.60}") from None


def number(word: str, what: str) -> float:
    """A number of a header. Raises ValueError that says `what` it should be."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"its {what} is '{word:.40}', which is no number")
    return value


def captured(
    labels: Sequence[str], units: str, up: str, rate: float, first: float, said: float, table: list[list[float]]
) -> Capture:
    """A `Capture` of `table`, rows of x, y, z of every label; `said`: frames that the header promises.

    Raises ValueError where there are fewer, or none.
    """
    if len(table) < said or not table:
        raise ValueError(f"it holds {len(table)} of its {said:.0f} frames; it is cut off, copy it again")
    whole = np.array(table).reshape(len(table), len(labels), 3)
    return Capture(tuple(labels), units, up, rate, int(first), len(table), lambda index: whole[:, list(index)])
