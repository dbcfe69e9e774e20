"""Whether the parameters of a C3D file are whole, asked before ezc3d reads them: on damaged ones it crashes or hangs.

INPUTS   a path.  OUTPUTS  nothing; a ValueError says what is damaged.
Source: the C3D file format, user guide of c3d.org, "The parameter section": a header of 4 bytes (the third is the
number of blocks, the fourth the processor), then groups and parameters, each with the distance to the next.
"""

import math
import struct

from dior.arrays import AnyPath

# of the user guide: blocks of 512 bytes, counted in one byte; 83 + 3 is a MIPS processor; types and dimensions
BLOCK, MOST_BLOCKS = 512, 255
MIPS = 86
TEXT = -1
BYTES_OF = {TEXT: 1, 1: 1, 2: 2, 4: 4}
MOST_DIMENSIONS = 7


def check_parameters(path: AnyPath) -> None:
    """Raise ValueError where a group or parameter does not end within its record and the parameters' blocks."""
    with open(path, "rb") as stream:
        head = stream.read(BLOCK)
        if len(head) < BLOCK or head[1] != 0x50:
            raise ValueError("it does not begin like a C3D")
        stream.seek(BLOCK * (head[0] - 1) if head[0] else len(head))
        begin = stream.read(4)
        # some writers leave the number of blocks at 0
        data = begin + stream.read(BLOCK * (begin[2] or MOST_BLOCKS) - 4) if len(begin) == 4 else b""
    if len(data) < BLOCK:
        raise ValueError("its parameters are not where its header says")
    order, at = ">" if begin[3] == MIPS else "<", 4
    while at < len(data) and data[at]:
        at = _next(data, at, order)
    if at > len(data):
        raise ValueError("its parameters end beyond their blocks")


def _next(data: bytes, at: int, order: str) -> int:
    """Where the record after the one at byte `at` begins; the end of `data` after the last."""
    where = f"at byte {at} of its parameters"
    try:
        size, group = struct.unpack_from("bb", data, at)
        name = data[at + 2 : at + 2 + abs(size)].decode("latin-1")
        ahead = at + 2 + abs(size)
        (distance,) = struct.unpack_from(f"{order}h", data, ahead)
        end = ahead + 2
        if group > 0:
            kind, dimensions = struct.unpack_from("bB", data, end)
            if kind not in BYTES_OF or dimensions > MOST_DIMENSIONS:
                raise ValueError(f"the parameter {name} {where} is of type {kind} with {dimensions} dimensions")
            end += 2 + dimensions
            values = math.prod(data[end - dimensions : end])
            # ezc3d reads empty lists and tables; it crashes on what is empty in more ways and on a text of no length
            if (not values and dimensions > 2) or (kind == TEXT and not dimensions):
                raise ValueError(f"the parameter {name} {where} has a size that cannot be")
            end += BYTES_OF[kind] * values
        end += 1 + data[end]
    except (struct.error, IndexError):
        raise ValueError(f"the record {where} is damaged") from None
    if not group:
        raise ValueError(f"the record {name!r} {where} is of no group")
    if distance and ahead + distance < end or end > len(data):
        raise ValueError(f"the record {name!r} {where} is longer than it says")
    return ahead + distance if distance else len(data)
