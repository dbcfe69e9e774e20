"""The figures of a release: those of the released walks, pooled over them, as rows of metrics.csv."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dior.evaluate.metrics import merged
from dior.release.layout import rows_of
from dior.release.people_tables import Walks
from dior.tables import tables


def released(paths: Iterable[Path], walks: Walks) -> list[dict[str, Any]]:
    """Rows of metrics.csv: those of the released walks, pooled over them.

    A row of no sequence is the adjustment's of a session, which uses the walks of people who agreed only.
    """
    rows = []
    for path in paths:
        for figure in rows_of(tables.read(path, "metrics")):
            if figure["sequence"] in walks or not figure["sequence"] and not figure["subject"]:
                rows.append(figure)
    return merged(rows)
