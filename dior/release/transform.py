"""JPEG files whose DCT coefficients are changed without decoding the picture, by libjpeg-turbo's `tj3Transform`.

INPUTS   the bytes of a JPEG file; what changes the coefficients of its components
OUTPUTS  the file with those coefficients, without any segment but those of its picture
The library is the one in the wheel `turbojpeg`. Signatures, the structures and the numbers of parameters and options
are those of turbojpeg.h of libjpeg-turbo 3.0. A coefficient that nobody changes is the same afterwards; progressive and
arithmetic coding become Huffman coding, restart markers go.
"""

import ctypes
import importlib.util
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

# Of each component the quantised coefficients (R, C, 64), rows and columns of blocks, each block in rows from the
# lowest frequency on; to be changed in place.
Change = Callable[[list[NDArray[np.int16]]], None]
INIT_TRANSFORM, STOP_ON_WARNING, COPY_NONE = 2, 0, 1 << 6
# samples along a block's side
BLOCK = 8
JFIF = b"\xff\xe0"
CARRY_ON, FAILED = 0, -1


class _Region(ctypes.Structure):
    """`tjregion`, px."""

    _fields_ = [(key, ctypes.c_int) for key in "xywh"]


# coefficients of a row of blocks, where it is in its component, the component's size, its number, the transform's
_FILTER = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, _Region, _Region, ctypes.c_int, ctypes.c_int, ctypes.c_void_p)


class _Transform(ctypes.Structure):
    """`tjtransform`."""

    _fields_ = [
        ("region", _Region),
        ("operation", ctypes.c_int),
        ("options", ctypes.c_int),
        ("data", ctypes.c_void_p),
        ("filter", _FILTER),
    ]


@cache
def library() -> ctypes.CDLL | None:
    """The library, None where the wheel is not installed."""
    found = importlib.util.find_spec("turbojpeg")
    if found is None or found.origin is None:
        return None
    # the wheel's module is linked to the library, whose symbols are found through it, whatever its file is called
    lib = ctypes.CDLL(found.origin)
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    lib.tj3Init.argtypes, lib.tj3Init.restype = [ctypes.c_int], pointer
    lib.tj3Set.argtypes = [pointer, ctypes.c_int, ctypes.c_int]
    lib.tj3Transform.argtypes = [
        pointer, ctypes.c_char_p, size, ctypes.c_int, ctypes.POINTER(pointer), ctypes.POINTER(size),
        ctypes.POINTER(_Transform),
    ]  # fmt: skip
    lib.tj3Free.argtypes, lib.tj3Free.restype = [pointer], None
    lib.tj3Destroy.argtypes, lib.tj3Destroy.restype = [pointer], None
    return lib


def changed(data: bytes, count: int, change: Change) -> bytes | None:
    """The JPEG file, of so many components, once `change` has been applied to these; None where the library is not
    there, where it finds anything wrong with the file, and where nothing was applied."""
    lib = library()
    if lib is None:
        return None
    components: list[NDArray[np.int16]] = []
    failed: list[BaseException] = []
    rows: list[int] = []

    def on_row(at: int, row: _Region, plane: _Region, number: int, _transform: int, _pointer: int) -> int:
        rows.append(at)
        below = row.y + BLOCK
        if below < plane.h:
            return CARRY_ON
        # nothing that is raised in here would get out
        try:
            if below == plane.h and number == len(components):
                components.append(_blocks(rows, row.w // BLOCK))
                if len(components) == count:
                    change(components)
            # there may be rows below the last one, which are not written
            rows.clear()
        except BaseException as error:
            failed.append(error)
            return FAILED
        return CARRY_ON

    how = _Transform(options=COPY_NONE, filter=_FILTER(on_row))
    out, size = ctypes.c_void_p(), ctypes.c_size_t()
    handle = lib.tj3Init(INIT_TRANSFORM)
    try:
        # else what is damaged is made up
        wrong = lib.tj3Set(handle, STOP_ON_WARNING, 1)
        wrong = wrong or lib.tj3Transform(handle, data, len(data), 1, out, size, how)
        if failed:
            raise failed[0]
        if wrong or len(components) != count:
            return None
        return _bare(out.value or 0, size.value)
    finally:
        lib.tj3Free(out)
        lib.tj3Destroy(handle)


def _bare(at: int, size: int) -> bytes:
    """The JPEG file at an address, without the segment that libjpeg puts first where the colours are those of JFIF."""
    first, skipped = ctypes.string_at(at, 6), 2
    if first[2:4] == JFIF:
        skipped += 2 + int.from_bytes(first[4:], "big")
    return first[:2] + ctypes.string_at(at + skipped, size - skipped)


def _blocks(rows: list[int], count: int) -> NDArray[np.int16]:
    """The coefficients (R, count, 64) of rows of blocks at these addresses: libjpeg keeps all of a component in memory,
    one row behind the other, until it has written them. Raises ValueError where it does not."""
    size = count * BLOCK * BLOCK * np.int16().itemsize
    step = rows[1] - rows[0] if len(rows) > 1 else size
    if step < size or rows != list(range(rows[0], rows[0] + step * len(rows), step)):
        raise ValueError("the rows of its coefficients are not behind each other")
    memory = memoryview((ctypes.c_char * (step * (len(rows) - 1) + size)).from_address(rows[0]))
    shape = (len(rows), count, BLOCK * BLOCK)
    return np.ndarray(shape, np.int16, memory, strides=(step, size // count, np.int16().itemsize))
