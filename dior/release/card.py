"""The dataset card of a release: what the tables hold, how they were made, how good they are and what they lack.

INPUTS   the `release:` section of the config, released walks, what is counted in them, figures. OUTPUT: Markdown with
         the front matter that the Hugging Face Hub reads.
"""

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa

from dior.body.names import bones_of
from dior.errors import many
from dior.evaluate import statistics
from dior.evaluate.metrics import QUANTILES
from dior.project import licenses
from dior.release import card_picture, citation, escape, transform
from dior.release.layout import Part
from dior.release.people_tables import Walks
from dior.release.suspect import RedLight
from dior.report.headline import Line
from dior.report.numbers import show
from dior.tables import tables
from dior.tables.schemas import METRICS, PICTURE, SCHEMAS, VOCABULARY
from dior.tables.words import SPLITS

Rows: TypeAlias = list[dict[str, Any]]
# metric, tool, session, camera or role
Place: TypeAlias = tuple[str, str, str, str]
COUNTED = ("camera_recordings", "frames", "keypoints_2d", "missing_2d")
TEMPLATE = Path(__file__).with_name("card.md.j2")
# "mean long-range label sigma per subject": of both axes of a label the root mean square
SIGMA_QUERY = (
    "SELECT subject, avg(sqrt((sigma_u * sigma_u + sigma_v * sigma_v) / 2)) AS sigma_px FROM 'labels_2d/*/*.parquet' "
    "JOIN 'sequences.parquet' USING (subject, sequence) JOIN 'cameras.parquet' USING (session, camera) "
    "WHERE role = 'long_range' AND status IN ('ok', 'occluded') GROUP BY subject ORDER BY subject"
)
# the Hugging Face Hub's `size_categories`
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


@dataclass(frozen=True)
class Picture:
    """`shown`: what the card's picture shows, "" where there is none; `agreed`: whether anybody agreed to pictures."""

    shown: str
    agreed: bool


def text(
    release: dict[str, Any],
    walks: Walks,
    counted: Rows,
    figures: Rows,
    parts: list[Part],
    example: str,
    checked: list[tuple[str, str, str]],
    lights: list[RedLight],
    headline: list[Line],
    joints: dict[str, list[str]],
    picture: Picture,
) -> str:
    """The card. `release`: the section of the config; `walks`: the released ones (people_tables.py); `counted`: rows
    of `statistics.rows_of` for them; `figures`: rows of metrics.csv; `parts`: of layout.py, those that there are;
    `example`: the name of a labels file; `checked`: (session, camera, reason) of `heads_checked`; `lights`:
    what is red of the labels; `headline`: how good they are; `joints`: of the labels by environment; `picture`: what
    card.jpg shows.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters["quoted"] = lambda word: json.dumps(str(word), ensure_ascii=False)
    environment.filters["shown"] = escape.markdown
    environment.filters["cell"] = lambda word: str(word).replace("|", "\\|")
    rows, names = list(walks.values()), [part.name for part in parts]
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        **release,
        known_license=release["license"] in licenses.KNOWN,
        license_url=licenses.url(release["license"]),
        bibtex=citation.bibtex(release),
        summary=summary(walks, counted),
        simulated=simulated(rows),
        size=_size(counted),
        environments=_environments(rows),
        long_range=_long_range(counted),
        parts=parts,
        names=names,
        counts=_by_camera(counted),
        properties=statistics.properties(counted),
        described=[(part, _columns(part.table)) for part in parts],
        metric_columns=tables.columns_of("metrics"),
        headline=headline,
        skeletons=[(name, each, _edges(each)) for name, each in joints.items()],
        figures=[
            (*place, show(value, unit), n)
            for place, (value, unit, n) in pooled_figures(
                figures, {name: row["session"] for name, row in walks.items()}
            ).items()
        ],
        metrics={name: meaning for name, meaning in METRICS.items() if _has(figures, name)},
        example=example,
        checked=checked,
        lights=lights,
        sigma_query=SIGMA_QUERY,
        picture=picture,
        picture_file=card_picture.FILE,
        lossless=transform.library() is not None,
        splits=SPLITS,
    )


def summary(walks: Walks, counted: Rows) -> str:
    """What the release is, in one paragraph of plain text."""
    rows = list(walks.values())
    people = len({row["subject"] for row in rows})
    places = ", ".join(f"{n} {name}" for name, n in _environments(rows).items())
    labels, frames = statistics.of(counted, "keypoints_2d"), statistics.of(counted, "frames")
    text = (
        f"2D and 3D skeleton labels of {many(len(rows), 'walk')} of {many(people, 'subject')} ({places}): "
        f"{many(labels, 'label')} inside the picture on {many(frames, 'frame')}."
    )
    far = " Some cameras are so far away that no detector works on their pictures." if _long_range(counted) else ""
    return text + far


def simulated(rows: Iterable[dict[str, Any]]) -> bool:
    """Whether walks of a release are made up."""
    return any(row.get("truth") for row in rows)


def _environments(rows: Rows) -> dict[str, int]:
    return dict(sorted(Counter(row["environment"] for row in rows).items()))


def _long_range(counted: Rows) -> bool:
    return statistics.of(counted, "frames", role="long_range") > 0


def _size(counted: Rows) -> str:
    rows = statistics.of(counted, "keypoints_2d") + statistics.of(counted, "missing_2d")
    return next((name for limit, name in SIZES if rows < limit), "n>1T")


def _has(figures: Rows, name: str) -> bool:
    return any(figure["metric"] == name for figure in figures)


def _columns(name: str) -> list[tuple[str, str, str, str]]:
    """(name, type, unit, meaning) of a table's columns; the words that a column may hold are part of its meaning."""
    return [
        (field.name, _type(field.type), field.metadata[b"unit"].decode(), _meaning(name, field))
        for field in SCHEMAS[name]
    ]


def _meaning(name: str, field: pa.Field) -> str:
    words = ", ".join(VOCABULARY.get((name, field.name), ()))
    return "; ".join(part for part in (field.metadata[b"description"].decode(), words) if part)


def _type(kind: pa.DataType) -> str:
    if kind == PICTURE:
        return "struct of bytes, path"
    if pa.types.is_fixed_size_list(kind):
        return f"{kind.list_size} x {_type(kind.value_type)}"
    return tables.word_of(kind)


def _by_camera(counted: Rows) -> list[tuple[str, str, str, dict[str, int]]]:
    """(environment, camera, role, what -> n) rows, in that order."""
    places = {(row["environment"], row["camera"], row["role"]) for row in counted if row["what"] == "frames"}
    return [
        (environment, camera, role, {what: statistics.of(counted, what, environment, role, camera) for what in COUNTED})
        for environment, camera, role in sorted(places)
        if camera
    ]


def _edges(joints: list[str]) -> list[tuple[str, str]]:
    """The bones between joints, by their names."""
    return [(joints[a], joints[b]) for a, b in bones_of(joints)]


def pooled_figures(rows: Rows, sessions: Mapping[str, str]) -> dict[Place, tuple[float, str, int]]:
    """Place -> (value, unit, n): pooled over everything, by role, and by session and camera, since the cameras of two
    sessions may have one name. `rows`: of metrics.csv; `sessions`: sequence -> its session.
    """
    found: dict[Place, tuple[float, str, int]] = {}
    for row in rows:
        pooled = not (row["subject"] or row["sequence"] or row["joint"] or row["camera"])
        of_camera = row["sequence"] in sessions and row["camera"] and not row["joint"]
        # the mean of quantiles is no quantile
        if not (pooled or (of_camera and row["metric"] not in QUANTILES)):
            continue
        session = sessions[row["sequence"]] if of_camera else ""
        where = row["camera"] if of_camera else (row["role"] or "all").replace("_", "-")
        key = row["metric"], row["tool"], session, where
        mean, unit, n = found.get(key, (0.0, row["unit"], 0))
        total = n + row["n"]
        found[key] = (mean * n + row["value"] * row["n"]) / total if total else np.nan, unit, total
    return dict(sorted(found.items()))
