"""TRC, the text format of Motion Analysis that OpenSim reads.

INPUTS   five lines: PathFileType; names and values (DataRate, NumFrames, NumMarkers, Units, ...); Frame#, Time and the
         markers, each above three columns; X1, Y1, Z1, ...; then a row per frame, tabs between. An empty cell is
         missing.
OUTPUTS  a `Capture`, Y up as OpenSim has it; in a file with Z up the body says so.
Source: OpenSim's documentation, Marker (.trc) Files.
"""

from dior.arrays import AnyPath
from dior.ingest.mocap_files.capture import Capture, captured, number, numbers, rows


def read(path: AnyPath) -> Capture:
    """The content of a TRC. Raises ValueError where it is no such file, DiorError where it is no text."""
    lines = iter(rows(path, "\t"))
    head = [next(lines, (0, [""]))[1] for _ in range(5)]
    header = dict(zip(head[1], head[2], strict=False))
    if head[3][0] != "Frame#" or "NumFrames" not in header:
        raise ValueError("its first lines are not PathFileType, DataRate, their values and Frame#; export it again")
    labels = [word for word in head[3][2:] if word]
    table: list[list[float]] = []
    first = 1.0
    for line, cells in lines:
        values = numbers(line, cells, 2 + 3 * len(labels))
        if not table:
            first = max(values[0], 1.0)
        table.append(values[2 : 2 + 3 * len(labels)])
    said, rate = (number(header.get(key, ""), key) for key in ("NumFrames", "DataRate"))
    return captured(labels, header.get("Units", ""), "y", rate, first, said, table)
