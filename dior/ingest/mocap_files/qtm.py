"""TSV that Qualisys Track Manager exports of a 3D measurement.

INPUTS   lines of a word, in capitals as a rule, and its values (NO_OF_FRAMES, FREQUENCY, DATA_INCLUDED, ...,
         MARKER_NAMES, which may be empty; EVENT and TRAJECTORY_TYPES where there are any; FILE_VERSION first in newer
         ones), a row of column names or none, then a row per frame: x, y, z of every marker in mm, before them the
         frame and the time or neither, or one of them if the row of column names says which. (0, 0, 0) and what is
         empty are missing.
OUTPUTS  a `Capture` in mm, Z up.
Source: public readers of such files (FieldTrip's qualisys_tsv.m, the package qualisys of PyPI 0.2.0); no file of the
program was at hand.
"""

import math
import re

from dior.arrays import AnyPath
from dior.formats import MocapFormat
from dior.ingest.mocap_files.capture import NOTHING, Capture, captured, named, number, numbers, rows, without_last

_KEY = re.compile(r"[A-Z][A-Z0-9_]*")
TIME = "time"
BEFORE = ("frame", TIME)
DESCRIPTIONS = (
    MocapFormat(
        key="qtm",
        tool="TSV of Qualisys Track Manager, 3D data, with the header; `FILE_VERSION`, `EVENT`, "
        "`TRAJECTORY_TYPES`, frame and time may be there or not",
        first_frame="column Frame, else 1",
        unit="mm",
        up="Z",
        checked="every frame is there and has the time of its rate, to 1 % and 0.01 s; names and numbers are as many "
        "as the header says; 6D data and decimal commas are refused",
        sample="written here, from public readers of such files",
    ),
)


def read(path: AnyPath) -> Capture:
    """The content of a TSV. Raises ValueError where it is no such export of markers, DiorError where it is no text."""
    header: dict[str, list[str]] = {}
    table: list[list[float]] = []
    labels: list[str] = []
    before: list[tuple[int, float, float]] = []
    lead, named_first = -1, ""
    for line, cells in rows(path, "\t"):
        if not table and lead < 0 and _is_key(cells[0]):
            header[cells[0].upper()] = without_last(cells[1:])
            continue
        labels = labels or _labels(header)
        if not table and lead < 0 and not _is_number(cells[0]):
            lead, named_first = sum(cell.lower() in BEFORE for cell in cells[:2]), cells[0].lower()
            continue
        # a tab at the end of a row makes an empty cell more
        if lead < 0:
            lead = max(len(cells) - bool(not cells[-1]) - 3 * len(labels), 0)
        if lead > 2 or (lead == 1 and named_first not in BEFORE):
            raise ValueError(
                f"line {line} has {len(cells)} columns for {len(labels)} markers, with or without frame, time"
            )
        values = numbers(line, cells, lead + 3 * len(labels))
        if lead:
            frame = len(table) + 1.0 if named_first == TIME and lead == 1 else values[0]
            before.append((line, frame, values[lead - 1] if lead == 2 or named_first == TIME else math.nan))
        table.append(values[lead:])
    labels = labels or _labels(header)
    said, rate = (number((header.get(key) or ["0"])[0], key) for key in ("NO_OF_FRAMES", "FREQUENCY"))
    first = max(before[0][1], 1.0) if before else 1.0
    return captured(labels, "mm", "z", rate, first, said, table, before)


def _labels(header: dict[str, list[str]]) -> list[str]:
    if included := [word for word in header.get("DATA_INCLUDED", []) if word.upper() != "3D"]:
        raise ValueError(f"its DATA_INCLUDED is '{included[0]:.40}', not 3D; export the 3D data of the markers")
    if not header.get("MARKER_NAMES"):
        raise ValueError("it has no MARKER_NAMES; export the 3D data of labelled trajectories, with the header")
    counted = header.get("NO_OF_MARKERS")
    return named(header["MARKER_NAMES"], counted[0] if counted else None, "NO_OF_MARKERS")


def _is_key(word: str) -> bool:
    return bool(_KEY.fullmatch(word.upper())) and word.lower() not in (*BEFORE, *NOTHING) and not _is_number(word)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return not word
    return True
