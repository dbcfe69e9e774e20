"""Every table of the project: its columns, their units, descriptions and vocabularies, in a module for each stage.

A stage's `TABLES`: columns by table, each (name, type, unit, description); the last two may be left out. A type is
`text` (a word out of few), `string`, `picture`, what numpy calls a number, `float64[8]` for eight of them, or the words
that the column may have. Nothing else knows them. A stage imports nothing but `dior.tables.words`:
`dior.tables.code_hash` reads it each time Snakemake parses the workflow.
"""

from typing import Any

import pyarrow as pa

from dior.tables.schemas import calibrate, evaluate, findings, gait, ingest, label, reconstruct, release, simulate
from dior.tables.schemas.evaluate import METRICS as METRICS
from dior.tables.schemas.release import RELEASED as RELEASED

VERSION = "1"
# what the `datasets` library reads as an Image column
PICTURE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_TEXT = pa.dictionary(pa.int32(), pa.string())
_TYPES = {"text": _TEXT, "string": pa.string(), "picture": PICTURE, "bool": pa.bool_()}

_STAGES: tuple[Any, ...] = (ingest, calibrate, reconstruct, gait, label, evaluate, release, simulate, findings)
TABLES = {name: columns for stage in _STAGES for name, columns in stage.TABLES.items()}


def _type(kind: str | tuple[str, ...]) -> pa.DataType:
    if isinstance(kind, tuple):
        return _TEXT
    number, _, length = kind.rstrip("]").partition("[")
    single = _TYPES.get(number) or pa.type_for_alias(number)
    return pa.list_(single, int(length)) if length else single


def _field(name: str, kind: str | tuple[str, ...], unit: str = "", text: str = "") -> pa.Field:
    return pa.field(name, _type(kind), metadata={"unit": unit, "description": text})


SCHEMAS = {name: pa.schema([_field(*column) for column in columns]) for name, columns in TABLES.items()}
VOCABULARY = {
    (table, column[0]): column[1]
    for table, columns in TABLES.items()
    for column in columns
    if isinstance(column[1], tuple)
}
