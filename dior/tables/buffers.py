"""Columns between numpy and pyarrow, through their buffers: pyarrow's own conversions import pandas, 0.4 s a job.

Floats: NaN is null. Integers: negative is null. Text: "" is null. Pictures: None is null.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from dior.arrays import Bools


def fixed(values: NDArray[Any], kind: pa.DataType, missing: Bools) -> pa.Array:
    """Numbers of a fixed width, null where `missing`; the value under a null is 0, so that bytes repeat."""
    data = np.where(missing, 0, values).astype(kind.to_pandas_dtype())
    validity = bits(~missing) if missing.any() else None
    return pa.Array.from_buffers(kind, len(data), [validity, pa.py_buffer(data)])


def bits(flags: Bools) -> pa.Buffer:
    return pa.py_buffer(np.packbits(flags, bitorder="little"))


def texts(words: Iterable[str]) -> pa.Array:
    return _blobs([str(word).encode() for word in words], pa.string(), None)


def pictures(encoded: Sequence[Any] | NDArray[Any], kind: pa.DataType) -> pa.Array:
    """Encoded pictures as structs of bytes and a null path; None is a null struct."""
    missing = np.array([picture is None for picture in encoded], bool)
    there = bits(~missing) if missing.any() else None
    data = _blobs([picture or b"" for picture in encoded], pa.binary(), there)
    return pa.Array.from_buffers(kind, len(data), [there], children=[data, pa.nulls(len(data), pa.string())])


def _blobs(parts: Sequence[bytes], kind: pa.DataType, validity: pa.Buffer | None) -> pa.Array:
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int32)
    return pa.Array.from_buffers(kind, len(parts), [validity, pa.py_buffer(offsets), pa.py_buffer(b"".join(parts))])


def to_numpy(array: pa.Array) -> NDArray[Any]:
    """One column as numpy."""
    kind = array.type
    if pa.types.is_dictionary(kind):
        words = np.array([*array.dictionary.to_pylist(), ""], dtype=object)
        return words[numbers(array.indices, len(words) - 1)]
    if pa.types.is_string(kind):
        return np.array([word or "" for word in array.to_pylist()], dtype=object)
    if pa.types.is_fixed_size_list(kind):
        empty = [np.nan] * kind.list_size
        return np.array([row or empty for row in array.to_pylist()], float).reshape(-1, kind.list_size)
    if pa.types.is_struct(kind):
        return np.array([*array.field("bytes").to_pylist(), None], dtype=object)[:-1]
    if pa.types.is_boolean(kind):
        return np.array([value or False for value in array.to_pylist()], bool)
    return numbers(array, np.nan if pa.types.is_floating(kind) else -1)


def numbers(array: pa.Array, null: float) -> NDArray[Any]:
    """A copy of a numeric column with `null` where it is null."""
    validity, data = array.buffers()
    if not len(array):
        return np.empty(0, array.type.to_pandas_dtype())
    values = np.frombuffer(data, array.type.to_pandas_dtype(), len(array) + array.offset)[array.offset :].copy()
    if array.null_count:
        bits = np.unpackbits(np.frombuffer(validity, np.uint8), bitorder="little")
        values[bits[array.offset : array.offset + len(array)] == 0] = null
    return values
