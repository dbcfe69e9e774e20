"""Reading and writing the tables of `dior.tables.schemas`.

Tables are tidy, sorted and complete: every (frame, joint) has its row, missing values are null. A table is handled as
a dict of numpy arrays of equal length: strings as object arrays ("" is null), floats with NaN for null, integers with
-1 for null where the column may be null, pictures as an object array of encoded bytes (None is null). The files of
tables that are released tell the `datasets` library the types of their columns.
"""

import errno
import hashlib
import json
import mmap
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike, NDArray

from dior.arrays import AnyPath, Floats, Table
from dior.errors import DiorError, nearest
from dior.tables import buffers, result_checksums
from dior.tables.files import written_whole
from dior.tables.schemas import PICTURE, RELEASED, SCHEMAS, VERSION, VOCABULARY

# (scope, severity, code, text)
Finding: TypeAlias = tuple[str, str, str, str]
FINDING = ("scope", "severity", "code", "text")
# what `write` takes for a column (the module's docstring says how a null is written)
Column: TypeAlias = "Sequence[Any] | NDArray[Any] | Repeated"


def columns_of(name: str) -> list[str]:
    """Column names of a table."""
    return SCHEMAS[name].names


def to_arrow(name: str, columns: Mapping[str, Column], metadata: Mapping[str, str] | None = None) -> pa.Table:
    """A checked pyarrow table from a dict of arrays (see the module's docstring).

    Columns that are left out are null throughout. Raises DiorError for an unknown column or a word outside the
    table's vocabulary.
    """
    schema = SCHEMAS[name]
    for column in columns:
        if column not in schema.names:
            raise DiorError(f"table {name} has no column '{column}'{nearest(column, schema.names)}")
    length = len(next(iter(columns.values()))) if columns else 0
    arrays = [
        _to_array(name, field, columns[field.name]) if field.name in columns else pa.nulls(length, field.type)
        for field in schema
    ]
    return pa.Table.from_arrays(arrays, schema=schema.with_metadata({**own_metadata(name), **(metadata or {})}))


def own_metadata(name: str) -> dict[str, str]:
    """The key-value metadata that every file of a table has."""
    own = {"dior_table": name, "dior_table_version": VERSION}
    if name not in RELEASED:
        return own
    features = {field.name: _feature(field.type) for field in SCHEMAS[name]}
    return own | {"huggingface": json.dumps({"info": {"features": features}})}


def _feature(kind: pa.DataType) -> dict[str, Any]:
    """A column's type in the words of the `datasets` library (its `Features.to_dict`)."""
    if kind == PICTURE:
        return {"_type": "Image"}
    if pa.types.is_fixed_size_list(kind):
        return {"feature": _feature(kind.value_type), "length": kind.list_size, "_type": "List"}
    return {"dtype": word_of(kind), "_type": "Value"}


def word_of(kind: pa.DataType) -> str:
    """A column's type as one word: string, or as numpy calls its numbers.

    >>> word_of(pa.int32()), word_of(pa.dictionary(pa.int32(), pa.string()))
    ('int32', 'string')
    """
    text = pa.types.is_dictionary(kind) or pa.types.is_string(kind)
    return "string" if text else np.dtype(kind.to_pandas_dtype()).name


def _to_array(name: str, field: pa.Field, values: Column) -> pa.Array:
    """One column as pyarrow; words outside the column's vocabulary are refused."""
    kind = field.type
    if isinstance(values, Repeated):
        _check_words(name, field.name, values.words)
        return pa.DictionaryArray.from_arrays(
            buffers.fixed(values.index, pa.int32(), values.index < 0), buffers.texts(values.words)
        )
    if pa.types.is_string(kind):
        return buffers.texts(values)
    if kind == PICTURE:
        return buffers.pictures(values, kind)
    if pa.types.is_dictionary(kind):
        words, index = np.unique(np.asarray(values, dtype=object).astype(str), return_inverse=True)
        # np.unique sorts, so that the null word "" comes first where there is one
        has_null = int(len(words) > 0 and words[0] == "")
        index = index.ravel() - has_null
        _check_words(name, field.name, words[has_null:])
        return pa.DictionaryArray.from_arrays(
            buffers.fixed(index, pa.int32(), index < 0), buffers.texts(words[has_null:])
        )
    if pa.types.is_fixed_size_list(kind):
        rows = np.asarray(values, float).reshape(-1, kind.list_size)
        missing = ~np.isfinite(rows).all(axis=1)
        inner = buffers.fixed(np.where(missing[:, None], 0.0, rows).ravel(), kind.value_type, np.zeros(rows.size, bool))
        return pa.Array.from_buffers(
            kind, len(rows), [buffers.bits(~missing) if missing.any() else None], children=[inner]
        )
    values = np.asarray(values)
    if pa.types.is_boolean(kind):
        return pa.Array.from_buffers(kind, len(values), [None, buffers.bits(values.astype(bool))])
    return buffers.fixed(values, kind, np.isnan(values) if pa.types.is_floating(kind) else values < 0)


def _check_words(name: str, column: str, words: Iterable[str]) -> None:
    vocabulary = VOCABULARY.get((name, column))
    for word in words:
        if vocabulary and word not in vocabulary:
            raise DiorError(f"table {name}: '{word}' is no {column}{nearest(word, vocabulary)}")


class Repeated:
    """A text column given as indices into few words, so that millions of rows need no strings. -1 is null."""

    def __init__(self, words: Iterable[str], index: ArrayLike) -> None:
        self.words, self.index = tuple(words), np.asarray(index, np.int32)

    def __len__(self) -> int:
        return len(self.index)


def write(path: AnyPath, name: str, columns: Mapping[str, Column], metadata: Mapping[str, str] | None = None) -> None:
    """Write a table as Parquet (zstd), whole or not at all. Same columns, same bytes."""
    write_arrow(path, to_arrow(name, columns, metadata))


def write_arrow(path: AnyPath, table: pa.Table) -> None:
    """Write a pyarrow table that has a table's columns and metadata already, whole or not at all."""
    with written_whole(path, table.nbytes) as part:
        pq.write_table(table, part, compression="zstd", use_dictionary=_dictionary_columns(table))


def _dictionary_columns(table: pa.Table) -> list[str] | bool:
    return [f.name for f in table.schema if pa.types.is_dictionary(f.type) or pa.types.is_string(f.type)] or False


def read_arrow(path: AnyPath, name: str, columns: Sequence[str] | None = None) -> pa.Table:
    """The table as pyarrow. Raises DiorError for a missing, broken or other file, and for a result that is damaged."""
    with _opened(path, name, columns) as file:
        return file.read(columns=columns, use_threads=False)


@contextmanager
def _opened(path: AnyPath, name: str, columns: Sequence[str] | None) -> Iterator[pq.ParquetFile]:
    """Yield the Parquet file of a table that is what its job wrote, its kind and `columns` checked."""
    with _parquet(path) as file:
        _check_columns(path, file.schema_arrow, name, columns)
        yield file


@contextmanager
def _parquet(path: AnyPath) -> Iterator[pq.ParquetFile]:
    """Yield a Parquet file that is what its job wrote."""
    path = Path(path)
    if not path.is_file():
        raise DiorError(f"{path}: there is no such file")
    try:
        with open(path, "rb") as stream:
            result_checksums.check(path, hashlib.file_digest(stream, "sha256").hexdigest())
            # what was hashed is read, also where another file takes its place meanwhile; pq.read_table would import
            # pyarrow.dataset and, through it, pandas: 0.4 s in every job
            with pq.ParquetFile(pa.BufferReader(_mapped(stream))) as file:
                yield file
    except MemoryError:
        raise
    except (pa.ArrowException, OSError) as error:
        said = " ".join(str(error).split())
        raise DiorError(f"{path}: not a readable Parquet file ({said}); delete it and run again") from None


def _mapped(stream: BinaryIO) -> mmap.mmap | bytes:
    """The content of a file. From it pyarrow reads without a thread; those that it starts to read a file now and then
    abort a busy process that ends meanwhile."""
    if not os.fstat(stream.fileno()).st_size:
        return b""
    try:
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        if error.errno == errno.ENOMEM:
            raise MemoryError from error
        raise


def _check_columns(path: AnyPath, found: pa.Schema, name: str, columns: Sequence[str] | None) -> None:
    """Raise DiorError for another table than `name`, and where what is to be read is not as the table has it."""
    kind = (found.metadata or {}).get(b"dior_table", b"").decode(errors="replace")
    if kind != name:
        raise DiorError(f"{path}: holds the table '{kind or 'unknown'}', not '{name}'")
    schema = SCHEMAS[name]
    if columns is None and found.names != schema.names:
        odd = next((c for c in found.names if c not in schema.names), "")
        raise DiorError(
            f"{path}: {f'has a column {odd!r}' if odd else 'lacks columns'} that the table {name} of this dior "
            f"{'does not have' if odd else 'has'}, or has them in another order; delete it and run again"
        )
    for column in schema.names if columns is None else columns:
        at = found.get_field_index(column)
        if at < 0:
            raise DiorError(f"{path}: has no column '{column}'{nearest(column, found.names)}; delete it and run again")
        if found.field(at).type != schema.field(column).type:
            raise DiorError(
                f"{path}: its column '{column}' holds {found.field(at).type}, not {schema.field(column).type}; "
                "delete it and run again"
            )


def read_in_parts(path: AnyPath, name: str, columns: Sequence[str] | None, rows: int) -> Iterator[Table]:
    """As `read`, of `rows` rows at a time: for tables with pictures, which need not fit into the memory."""
    with _opened(path, name, columns) as file:
        for batch in file.iter_batches(batch_size=rows, columns=columns, use_threads=False):
            yield {c: buffers.to_numpy(a) for c, a in zip(batch.schema.names, batch.columns, strict=True)}


def read(path: AnyPath, name: str, columns: Sequence[str] | None = None) -> Table:
    """The table as a dict of arrays (see the module's docstring)."""
    return {c: buffers.to_numpy(a) for c, a in zip(*_columns(read_arrow(path, name, columns)), strict=True)}


def read_coded(path: AnyPath, name: str, columns: Sequence[str] | None) -> dict[str, Any]:
    """As `read`, with the text columns as `Repeated`: long tables of few words are ten times as fast to work with."""
    names, arrays = _columns(read_arrow(path, name, columns))
    return {
        column: Repeated(array.dictionary.to_pylist(), buffers.numbers(array.indices, -1))
        if pa.types.is_dictionary(array.type)
        else buffers.to_numpy(array)
        for column, array in zip(names, arrays, strict=True)
    }


def _columns(table: pa.Table) -> tuple[list[str], list[pa.Array]]:
    # of no chunks pyarrow makes an array from a list, for which it imports pandas: 0.6 s
    parts = (c.combine_chunks() if c.num_chunks else pa.nulls(0, c.type) for c in table.columns)
    return table.column_names, list(parts)


def kind_of(table: pa.Table) -> str:
    """What a pyarrow table that was read by `read_arrow` is called."""
    return table.schema.metadata[b"dior_table"].decode()


def empty(name: str) -> Table:
    """A table without rows as a dict of arrays."""
    return {c: buffers.to_numpy(a) for c, a in zip(*_columns(to_arrow(name, {})), strict=True)}


def metadata(path: AnyPath) -> dict[str, str]:
    """The key-value metadata of a table file. Raises DiorError for one that is not what its job wrote."""
    with _parquet(path) as file:
        return {k.decode(): v.decode() for k, v in (file.schema_arrow.metadata or {}).items()}


def rows(table: Table, keep: NDArray[Any]) -> Table:
    """The rows of a dict of arrays where the mask `keep` is true."""
    return {name: values[keep] for name, values in table.items()}


def of_camera(table: Table, camera: str) -> Table:
    """The rows of one camera."""
    return rows(table, table["camera"] == camera)


def ordered_unique(values: NDArray[Any]) -> list[Any]:
    """Distinct values in the order of their first appearance."""
    return list(dict.fromkeys(values.tolist()))


def grid(table: Table, *columns: str) -> tuple[Floats, list[str]]:
    """Complete rows sorted by (frame or instant, joint) as arrays (frames, joints, len(columns)), with the joints.

    Raises DiorError where rows are missing.
    """
    joints = ordered_unique(table["joint"])
    if not joints:
        return np.empty((0, 0, len(columns))), []
    count, rest = divmod(len(table["joint"]), len(joints))
    if rest or (table["joint"].reshape(count, -1) != np.array(joints, dtype=object)).any():
        raise DiorError("table is not complete: every frame must have a row for every joint, in the same order")
    return np.stack([table[c].reshape(count, len(joints)) for c in columns], axis=-1), joints


def findings_columns(findings: Sequence[Finding]) -> dict[str, list[str]]:
    """Columns of the `findings` table from (scope, severity, code, text) tuples, as given."""
    return {key: [f[i] for f in findings] for i, key in enumerate(FINDING)}


def write_findings(path: AnyPath, findings: Sequence[Finding]) -> None:
    """Write what a step wants a person to see: (scope, severity, code, text) tuples; the file may be empty."""
    write(path, "findings", findings_columns(findings))


def read_findings(path: AnyPath) -> list[Finding]:
    """The rows of a table `findings`."""
    table = read(path, "findings")
    return list(zip(*(table[key].tolist() for key in FINDING), strict=True))
