"""Detections of Google's ML Kit (BlazePose) as JSON lines, one per picture.

INPUTS   {"frame", "stamp_ns", "landmarks": [{"type", "x", "y", "z", "inFrameLikelihood"}]}; pixels; `landmarks: []` is
         nobody, a missing line is a picture that the detector never saw. ML Kit finds one person at most.
OUTPUTS  `People` with the joints `skeletons.MLKIT_33`.
"""

import numpy as np

from dior.errors import DiorError
from dior.ingest.people import People
from dior.skeletons import MLKIT_33

BLOCK_BYTES = 1 << 24


def read(path):
    """All detections of the file. Raises DiorError for lines that are no such JSON and for a frame given twice."""
    import pyarrow as pa
    from pyarrow import json

    number = pa.float64()
    landmark = pa.struct([("type", pa.int32()), ("x", number), ("y", number), ("inFrameLikelihood", number)])
    schema = pa.schema([("frame", pa.int64()), ("stamp_ns", pa.int64()), ("landmarks", pa.list_(landmark))])
    try:
        table = json.read_json(
            path,
            read_options=json.ReadOptions(block_size=BLOCK_BYTES),
            parse_options=json.ParseOptions(explicit_schema=schema, unexpected_field_behavior="ignore"),
        ).combine_chunks()
    except pa.ArrowException as error:
        raise DiorError(f"{path}: a line is not ML Kit's JSON ({error}); was the detector interrupted?") from None
    frame, lists = table["frame"].combine_chunks(), table["landmarks"].combine_chunks()
    for key, column in (("frame", frame), ("landmarks", lists)):
        if column.null_count:
            line = int(np.argmax(column.is_null().to_numpy(zero_copy_only=False))) + 1
            raise DiorError(f"{path}: line {line} has no '{key}'")
    frame = frame.to_numpy()
    order = np.argsort(frame, kind="stable")
    twice = np.flatnonzero(np.diff(frame[order]) == 0)
    if len(twice):
        raise DiorError(f"{path}: frame {frame[order][twice[0]]} is there twice")
    stamp_ns = table["stamp_ns"].combine_chunks().fill_null(-1).to_numpy()

    sizes = lists.value_lengths().to_numpy()
    points, line = lists.flatten(), np.repeat(np.arange(len(frame)), sizes)
    kind = points.field("type").fill_null(-1).to_numpy()
    wrong = (kind < 0) | (kind >= len(MLKIT_33))
    if wrong.any():
        raise DiorError(f"{path}: line {line[wrong][0] + 1} has a landmark whose type is not 0 to {len(MLKIT_33) - 1}")
    values = np.full((len(frame), len(MLKIT_33), 3), np.nan)
    values[line, kind] = np.stack(
        [points.field(key).fill_null(np.nan).to_numpy() for key in ("x", "y", "inFrameLikelihood")], axis=-1
    )
    seen = order[np.isfinite(values[order, :, :2]).all(axis=-1).any(axis=-1)]
    uv, score = values[seen, :, :2], np.nan_to_num(values[seen, :, 2])
    missing = ~np.isfinite(uv).all(axis=-1)
    uv[missing], score[missing] = np.nan, 0.0
    return People(MLKIT_33, frame[seen], np.zeros(len(seen), int), uv, score, frame[order], stamp_ns[order])
