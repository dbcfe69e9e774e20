"""The table of re-identification: every method, adaptation and protocol, with every camera as the probe in turn.

INPUTS   the sheet's rows of the walks; their COCO-17 labels and skeletons (dior/reid/inputs.py); the networks' weights
OUTPUTS  rows of the table (COLUMNS) and why sequences are not used
A row without environment and camera is the mean over the probe cameras. `hits` of `n` trials; with as many sequences of
every camera their share is the mean over gallery cameras, as in the paper. `baseline` has one 3D per walk, whichever
camera looks, so that only protocols without the probe's own recording say anything of it.
"""

import csv
import io
from dataclasses import dataclass

import numpy as np

from dior import tables
from dior.covariance import point_covariance
from dior.reid import baseline, embed, features, inputs, protocols, statistics
from dior.reid.protocols import Item
from dior.sampling import nominal_fps

COLUMNS = (
    *("method", "adaptation", "protocol", "environment", "camera", "rank1", "low", "high", "hits", "n", "chance"),
    *("null95", "p", "rank5", "mean_ap", "verdict"),
)
BASELINE = "baseline"
# what says nothing of a method that does not look at pictures
SEEN_TWICE = ("per_camera", "pooled")


@dataclass(frozen=True)
class Gallery:
    """What is compared: `items`, and of each the sequence (F, 17, 2) px as recorded, and its picture's width;
    `left_out`: (sequence, camera, why)."""

    items: tuple
    sequences: tuple
    widths: tuple
    left_out: tuple


def gallery(sheet, paths, widths, length=inputs.LENGTH, chunks=1):
    """`Gallery` of walks: `sheet`: rows by name (subject, session, environment); `paths`: labels by name; `widths`:
    name -> camera -> px."""
    items, sequences, sizes, left_out = [], [], [], []
    for name, path in paths.items():
        row = sheet[name]
        for camera, track in inputs.tracks(path, widths[name]).items():
            found, why = inputs.cut(track, length, chunks)
            if why:
                left_out.append((name, camera, why))
            item = Item(row["subject"], name, row["session"], row["environment"], camera)
            items += [item] * len(found)
            sequences += found
            sizes += [track.width] * len(found)
    return Gallery(tuple(items), tuple(sequences), tuple(sizes), tuple(left_out))


def gaits(paths):
    """`features.Gait` by name of walks, from their COCO-17 skeletons by name; (name, why) of those without."""
    found, left_out = {}, []
    for name, path in paths.items():
        table = tables.read(path, "skeletons_3d")
        points, _ = tables.grid(table, "x", "y", "z")
        covariance = point_covariance(table, points.shape[:2])
        stamps = table["stamp_ns"].reshape(points.shape[:2])[:, 0]
        gait, why = features.measure(points, covariance, nominal_fps(stamps)) if len(stamps) > 1 else (None, "no 3D")
        if gait is None:
            left_out.append((name, why))
        else:
            found[name] = gait
    return found, tuple(left_out)


def of_network(name, network, shown, adaptation, confidence=embed.CONFIDENCE, exchanges=None):
    """Rows of one network with one adaptation."""
    given = [inputs.adapted(uv, w, adaptation) for uv, w in zip(shown.sequences, shown.widths, strict=True)]
    far = embed.distances(name, embed.embeddings(name, network, given, confidence))
    return rows_of(name, adaptation, far, shown.items, protocols.PROTOCOLS, exchanges)


def of_baseline(sheet, walks, shown):
    """Rows of the baseline, and the sessions that were too small to be centred; `walks`: `Gait` by name."""
    names = sorted(walks)
    subjects, sessions = ([sheet[name][key] for name in names] for key in ("subject", "session"))
    far, small = baseline.distances([walks[name] for name in names], subjects, sessions)
    at = [names.index(item.recording) if item.recording in walks else -1 for item in shown.items]
    items = [item for item, i in zip(shown.items, at, strict=True) if i >= 0]
    index = [i for i in at if i >= 0]
    kept = [name for name in protocols.PROTOCOLS if name not in SEEN_TWICE]
    return rows_of(BASELINE, "", far[np.ix_(index, index)], items, kept), small


def rows_of(method, adaptation, far, items, kinds, exchanges=None):
    """Rows of the table for distances (N, N) between items."""
    if not len(items):
        return []
    exchanges = statistics.exchanged(items) if exchanges is None else exchanges
    rows = []
    for protocol in kinds:
        found = protocols.trials(far, items, protocol)
        for view in (("", ""), *found.views):
            score = statistics.score(found if view == ("", "") else found.of(view), items, exchanges)
            rows.append(
                dict(zip(COLUMNS[:5], (method, adaptation, protocol, *view), strict=True))
                | {"rank1": score.rank1, "low": score.low, "high": score.high, "hits": score.hits, "n": score.n}
                | {"chance": score.chance, "null95": score.null, "p": score.p, "rank5": score.cmc[4]}
                | {"mean_ap": score.mean_ap, "verdict": score.verdict}
            )
    return rows


def as_csv(rows):
    """The table as CSV text; six significant digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(row[column]) for column in COLUMNS] for row in rows)
    return text.getvalue()


def _cell(value):
    if not isinstance(value, float):
        return value
    return "" if np.isnan(value) else repr(float(f"{value:.6g}"))
