"""TRC, the text format of Motion Analysis that OpenSim reads.

INPUTS   five lines: PathFileType; names and values (DataRate, NumFrames, NumMarkers, Units, ...); Frame#, Time and the
         markers, each above three columns; X1, Y1, Z1, ...; then a row per frame, tabs between. An empty cell is
         missing. A marker may have no name.
OUTPUTS  a `Capture`, Y up as OpenSim has it; in a file with Z up the body says so.
Source: OpenSim's documentation, Marker (.trc) Files.
"""

from dior.arrays import AnyPath
from dior.formats import MocapFormat
from dior.ingest.mocap_files.capture import Capture, captured, named, number, numbers, rows, without_last

DESCRIPTIONS = (
    MocapFormat(
        key="trc",
        tool="TRC (OpenSim, Cortex)",
        first_frame="column Frame#",
        unit="`Units`",
        up="Y",
        checked="every frame is there and has the time of its rate, to 1 % and 0.01 s; names and numbers are as many "
        "as the header says; a decimal comma is refused",
        sample="real: `real_outdoor/reference/skeleton.trc`, of joints; of markers written here",
    ),
)


def read(path: AnyPath) -> Capture:
    """The content of a TRC. Raises ValueError where it is no such file, DiorError where it is no text."""
    lines = iter(rows(path, "\t"))
    head = [next(lines, (0, [""]))[1] for _ in range(5)]
    header = dict(zip(head[1], head[2], strict=False))
    if head[3][0] != "Frame#" or "NumFrames" not in header:
        raise ValueError("its first lines are not PathFileType, DataRate, their values and Frame#; export it again")
    labels = named(_names(head[3][2:]), header.get("NumMarkers"), "NumMarkers")
    table: list[list[float]] = []
    before: list[tuple[int, float, float]] = []
    for line, cells in lines:
        values = numbers(line, cells, 2 + 3 * len(labels))
        before.append((line, values[0], values[1]))
        table.append(values[2:])
    said, rate = (number(header.get(key, ""), key) for key in ("NumFrames", "DataRate"))
    first = max(before[0][1], 1.0) if before else 1.0
    return captured(labels, header.get("Units", ""), "y", rate, first, said, table, before)


def _names(cells: list[str]) -> list[str]:
    """The markers' names, "" where there is none, from above the coordinates: one in three cells, or in each."""
    cells = without_last(cells)
    return cells if any(cells[1::3]) or any(cells[2::3]) else cells[::3]
