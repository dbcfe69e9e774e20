"""The marks clicked in a camera's pictures, config/sessions/<session>/<camera>.marks.csv: which sequences they are of.

What they say is read by the steps that locate a camera (dior/calibrate/marks/marks.py). Loads no numerics.
"""

from typing import TypeAlias

from dior.errors import DiorError, nearest
from dior.paths import AnyPath
from dior.project.plain_text import rows_of

MARK_COLUMNS = ("sequence", "frame", "joint", "u", "v")
# sequence -> the line of its first mark, and that of its first mark without x, y, z (None if all have them)
MarkedLines: TypeAlias = dict[str, tuple[int, int | None]]


def read_marks(path: AnyPath, shown: str) -> MarkedLines:
    """Sequences of a marks CSV, in order: name -> (its first line, the first line without x, y, z or None)."""
    (_, header), *rows = rows_of(path, shown) or [(1, [""])]
    for column in header:
        if column not in (*MARK_COLUMNS, *"xyz"):
            raise DiorError(f"{shown}: unknown column '{column}'{nearest(column, (*MARK_COLUMNS, *'xyz'))}")
    for column in MARK_COLUMNS:
        if column not in header:
            raise DiorError(f"{shown}: column '{column}' is missing; the file has {','.join(MARK_COLUMNS)}[,x,y,z]")
    lines: MarkedLines = {}
    for line, cells in rows:
        mark = dict(zip(header, cells, strict=False))
        first, without = lines.get(mark["sequence"], (line, None))
        given = all(mark.get(axis) for axis in "xyz")
        lines[mark["sequence"]] = (first, without if given or without else line)
    return lines
