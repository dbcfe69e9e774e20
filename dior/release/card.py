"""The dataset card of a release: what the tables hold, how they were made, how good they are and what they lack.

INPUTS   facts of the config, released sheet rows, what is counted in them, figures. OUTPUT: Markdown with
         the front matter that the Hugging Face Hub reads.
"""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow as pa

from dior import tables
from dior.evaluate import statistics
from dior.schemas import METRICS, PICTURE, SCHEMAS, VOCABULARY

COUNTED = ("camera_recordings", "frames", "keypoints_2d", "missing_2d")
TEMPLATE = Path(__file__).with_name("card.md.j2")
FILES = {
    "labels_2d": ("labels_2d/<subject>/<sequence>.<camera>.parquet", "one row per frame and joint of a camera"),
    "skeletons_3d": ("skeletons_3d/<subject>/<sequence>.parquet", "one row per instant and joint"),
    "released_frames": ("frames/<subject>/<sequence>.parquet", "one row per picture, all cameras"),
    "cameras": ("cameras.parquet", "one row per session and camera"),
    "sequences": ("sequences.parquet", "one row per walk"),
    "subjects": ("subjects.parquet", "one row per person"),
    "released_gallery": ("gallery.parquet", "one row per picture of a person from all around"),
}
SIZES = (
    (10**3, "n<1K"),
    (10**4, "1K<n<10K"),
    (10**5, "10K<n<100K"),
    (10**6, "100K<n<1M"),
    (10**7, "1M<n<10M"),
    (10**8, "10M<n<100M"),
    (10**9, "100M<n<1B"),
    (10**10, "1B<n<10B"),
    (10**11, "10B<n<100B"),
    (10**12, "100B<n<1T"),
)


def text(facts, sequences, counted, figures, gallery, example):
    """The card. `facts`: version, title, license, authors. `sequences`: released sheet rows. `counted`: rows of
    `statistics.rows_of` for them. `figures`: rows of metrics.csv. `gallery`: whether there is a gallery.parquet.
    `example`: the name of a labels file of the first sequence.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters["quoted"] = lambda word: json.dumps(str(word), ensure_ascii=False)
    environment.filters["cell"] = lambda word: str(word).replace("|", "\\|")
    rows = statistics.of(counted, "keypoints_2d") + statistics.of(counted, "missing_2d")
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        **facts,
        simulated=any(row.get("truth") for row in sequences),
        size=next((name for limit, name in SIZES if rows < limit), "n>1T"),
        environments=dict(sorted(Counter(row["environment"] for row in sequences).items())),
        long_range=statistics.of(counted, "frames", role="long_range") > 0,
        n_sequences=len(sequences),
        n_subjects=len({row["subject"] for row in sequences}),
        n_frames=statistics.of(counted, "frames"),
        n_labels=statistics.of(counted, "keypoints_2d"),
        counts=_by_camera(counted),
        properties=statistics.properties(counted),
        gallery=gallery,
        described=[(*FILES[name], _columns(name)) for name in FILES if gallery or name != "released_gallery"],
        metric_columns=tables.columns_of("metrics"),
        figures=[figure for figure in map(_figure, figures) if figure],
        metrics={name: meaning for name, meaning in METRICS.items() if _has(figures, name)},
        example=f"labels_2d/{sequences[0]['subject']}/{example}",
    )


def _has(figures, name):
    return any(figure["metric"] == name for figure in figures)


def _columns(name):
    """(name, type, unit, meaning) of a table's columns; the words that a column may hold are part of its meaning."""
    return [
        (field.name, _type(field.type), field.metadata[b"unit"].decode(), _meaning(name, field))
        for field in SCHEMAS[name]
    ]


def _meaning(name, field):
    words = ", ".join(VOCABULARY.get((name, field.name), ()))
    return "; ".join(part for part in (field.metadata[b"description"].decode(), words) if part)


def _type(kind):
    if pa.types.is_dictionary(kind):
        return "string"
    if kind == PICTURE:
        return "struct of bytes, path"
    if pa.types.is_fixed_size_list(kind):
        return f"{kind.list_size} x {_type(kind.value_type)}"
    return str(np.dtype(kind.to_pandas_dtype()))


def _by_camera(counted):
    """(environment, camera, role, what -> n) rows, in that order."""
    places = {(row["environment"], row["camera"], row["role"]) for row in counted if row["what"] == "frames"}
    return [
        (environment, camera, role, {what: statistics.of(counted, what, environment, role, camera) for what in COUNTED})
        for environment, camera, role in sorted(places)
        if camera
    ]


def _figure(row):
    """A pooled figure as cells of the card's table; nothing for one of a subject, sequence or joint."""
    if row["subject"] or row["sequence"] or row["joint"]:
        return None
    where = row["camera"] or row["role"] or "all"
    value = "" if np.isnan(row["value"]) else f"{row['value']:.3g}"
    return row["metric"], row["tool"], where.replace("_", "-"), value, row["unit"], row["n"]
