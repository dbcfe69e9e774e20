"""CSV that OptiTrack Motive exports of a take.

INPUTS   a line of keys and values (Format Version, ..., Export Frame Rate, Total Exported Frames, Length Units,
         Coordinate Space), rows of what each column is (Type, Name, ID, Parent, then Position or Rotation), a row
         Frame, Time (Seconds), X, Y, Z, ..., then a row per frame, counted from 0; an empty cell is missing. Columns of
         other types than Marker (solved ones of bones and rigid bodies, rotations) are not read.
OUTPUTS  a `Capture`, Y up as the program has it unless it was told otherwise.
Source: docs.optitrack.com, Data Export: CSV, and headers of versions 1.22 to 1.25 in public readers' tests; no file of
the program was at hand.
"""

from collections.abc import Iterator

from dior.arrays import AnyPath
from dior.formats import MocapFormat
from dior.ingest.mocap_files.capture import POINT, Capture, captured, number, numbers, rows
from dior.project.plain_text import Line

AXES = ["X", "Y", "Z"]
MARKER = "Marker"
FRAME = "Frame"
DESCRIPTIONS = (
    MocapFormat(
        key="motive",
        tool="CSV of OptiTrack Motive, versions 1.22 to 1.25, columns of the type Marker, global coordinates",
        first_frame="column Frame, which counts from 0",
        unit="`Length Units`",
        up="Y",
        checked="every frame is there and has the time of its rate, to 1 % and 0.01 s; names and numbers are as many "
        "as the header says; local coordinates, no markers and decimal commas are refused",
        sample="written here, from docs.optitrack.com and public readers' tests",
    ),
)


def read(path: AnyPath) -> Capture:
    """The content of a CSV. Raises ValueError where it is no such export of markers, DiorError where it is no text."""
    lines = iter(rows(path, ","))
    _, keys = next(lines, (0, [""]))
    header = dict(zip(keys[::2], keys[1::2], strict=False))
    space = header.get("Coordinate Space") or "Global"
    if space != "Global":
        raise ValueError(f"its Coordinate Space is '{space:.40}'; export it in the global one")
    labels, places, timed, columns = _markers(lines)
    table: list[list[float]] = []
    before: list[tuple[int, float, float]] = []
    for line, cells in lines:
        if any(cells[columns:]):
            raise ValueError(f"line {line} has {len(cells)} columns and its header {columns}; {POINT}")
        # the time of day has no number
        read = [cells[0], *(cells[1:2] if timed else [""]), *(cell for at in places for cell in cells[at : at + 3])]
        values = numbers(line, read, 2 + 3 * len(labels))
        before.append((line, values[0], values[1]))
        table.append(values[2:])
    rate = header.get("Export Frame Rate") or header.get("Capture Frame Rate") or "0"
    said = header.get("Total Exported Frames") or header.get("Total Frames in Take") or "0"
    first = max(before[0][1] + 1, 1.0) if before else 1.0
    hertz, count = number(rate, "frame rate"), number(said, "frames")
    return captured(labels, header.get("Length Units", ""), "y", hertz, first, count, table, before)


def _markers(lines: Iterator[Line]) -> tuple[list[str], list[int], bool, int]:
    """Names of the markers, the columns of their x, whether the second column is the time, and how many columns there
    are, from the rows before the numbers. Raises ValueError."""
    about, axes = [], [""]
    for _, axes in lines:
        if axes[0] == FRAME:
            break
        about.append(axes)
    if len(about) < 2 or axes[0] != FRAME:
        raise ValueError("it has no rows Type, Name and Frame before its numbers; export it with the header")
    kinds = [row + [""] * (len(axes) - len(row)) for row in about]
    kind, name = (
        next((row for row in kinds if word in row[:2]), kinds[at]) for at, word in enumerate(("Type", "Name"))
    )
    what = next((row for row in kinds if "Position" in row), [""] * len(axes))
    places = [
        at
        for at in range(len(axes) - 2)
        if axes[at : at + 3] == AXES
        and kind[at] == MARKER
        and what[at] == "Position"
        and len(set(name[at : at + 3])) == 1
    ]
    if not places:
        there = sorted({word for word in kind if word and word != "Type"})
        raise ValueError(f"no column is a Marker's position (there are {', '.join(there)[:80]}); export the markers")
    return [name[at].strip('"') for at in places], places, axes[1].startswith("Time ("), len(axes)
