"""TSV that Qualisys Track Manager exports of a 3D measurement.

INPUTS   lines of a word in capitals and its values (NO_OF_FRAMES, FREQUENCY, DATA_INCLUDED, ..., MARKER_NAMES; EVENT
         and TRAJECTORY_TYPES where there are any; FILE_VERSION first in newer ones), a row of column names or none,
         then a row per frame: x, y, z of every marker in mm, before them the frame and the time or neither. (0, 0, 0)
         and what is empty are missing.
OUTPUTS  a `Capture` in mm, Z up.
Source: public readers of such files (FieldTrip's qualisys_tsv.m, the package qualisys of PyPI 0.2.0); no file of the
program was at hand.
"""

import re

from dior.arrays import AnyPath
from dior.ingest.mocap_files.capture import Capture, captured, number, numbers, rows

_KEY = re.compile(r"[A-Z][A-Z0-9_]*")
BEFORE = ("frame", "time")


def read(path: AnyPath) -> Capture:
    """The content of a TSV. Raises ValueError where it is no such export of markers, DiorError where it is no text."""
    header: dict[str, list[str]] = {}
    table: list[list[float]] = []
    labels: list[str] = []
    lead, first = -1, 1.0
    for line, cells in rows(path, "\t"):
        if not table and _KEY.fullmatch(cells[0]):
            header[cells[0]] = [cell for cell in cells[1:] if cell]
            continue
        labels = labels or _labels(header)
        if not table and lead < 0 and not _is_number(cells[0]):
            lead = sum(cell.lower() in BEFORE for cell in cells[:2])
            continue
        # a tab at the end of a row makes an empty cell more
        if lead < 0:
            lead = max(len(cells) - bool(not cells[-1]) - 3 * len(labels), 0)
        if lead not in (0, 2):
            raise ValueError(
                f"line {line} has {len(cells)} columns for {len(labels)} markers, with or without frame, time"
            )
        values = numbers(line, cells, lead + 3 * len(labels))
        if not table and lead:
            first = max(values[0], 1.0)
        table.append(values[lead : lead + 3 * len(labels)])
    labels = labels or _labels(header)
    said, rate = (number((header.get(key) or ["0"])[0], key) for key in ("NO_OF_FRAMES", "FREQUENCY"))
    return captured(labels, "mm", "z", rate, first, said, table)


def _labels(header: dict[str, list[str]]) -> list[str]:
    if included := [word for word in header.get("DATA_INCLUDED", []) if word.upper() != "3D"]:
        raise ValueError(f"its DATA_INCLUDED is '{included[0]:.40}', not 3D; export the 3D data of the markers")
    if not header.get("MARKER_NAMES"):
        raise ValueError("it has no MARKER_NAMES; export the 3D data of labelled trajectories, with the header")
    return header["MARKER_NAMES"]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return not word
    return True
