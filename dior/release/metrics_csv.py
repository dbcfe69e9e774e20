"""The figures of a release: those of the released walks, pooled over them, as rows of metrics.csv."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from dior.evaluate.metrics import merged
from dior.release.layout import rows_of
from dior.release.people_tables import Walks
from dior.tables import tables

# what is measured without a label of the walk
OF_NO_LABEL = ("mark_error", "detected_share", "swapped_share")


def released(
    paths: Iterable[Path], walks: Walks, without_place: Mapping[str, Collection[str]] | None = None
) -> list[dict[str, Any]]:
    """Rows of metrics.csv: those of the released walks, pooled over them.

    A row of no sequence is the adjustment's of a session, which uses the walks of people who agreed only.
    `without_place`: by sequence the cameras whose labels are suspect, "" for the 3D and the labels of all (suspect.py):
    of those nothing is measured, and none is covered.
    """
    rows = []
    for path in paths:
        for figure in rows_of(tables.read(path, "metrics")):
            if figure["sequence"] in walks:
                rows += _there(figure, (without_place or {}).get(figure["sequence"], ()))
            elif not figure["sequence"] and not figure["subject"]:
                rows.append(figure)
    return merged(rows)


def _there(figure: dict[str, Any], without_place: Collection[str]) -> list[dict[str, Any]]:
    """[the figure of a walk], [] where there is nothing any more that it could be of."""
    if not {"", figure["camera"]} & set(without_place) or figure["metric"] in OF_NO_LABEL:
        return [figure]
    return [figure | {"value": 0.0}] if figure["metric"] == "coverage" else []
