"""The figures of a release: those of the released walks, pooled over them, as rows of metrics.csv."""

from dior import tables
from dior.evaluate.metrics import merged


def released(paths, released, everyone):
    """Rows of metrics.csv: those of the released sequences, pooled over them.

    A row of no sequence (the adjustment's) is about all subjects of a session, so it stays only where `everyone` is
    released.
    """
    columns, rows = tables.columns_of("metrics"), []
    for path in paths:
        table = tables.read(path, "metrics")
        for cells in zip(*(table[c].tolist() for c in columns), strict=True):
            figure = dict(zip(columns, cells, strict=True))
            if figure["sequence"] in released:
                rows.append({**figure, "subject": released[figure["sequence"]]["subject"]})
            elif everyone and not figure["sequence"] and not figure["subject"]:
                rows.append(figure)
    return merged(rows)
