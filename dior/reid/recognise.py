"""The table of re-identification: every method, adaptation and protocol, with every camera as the probe in turn.

INPUTS   the project's sheets; COCO-17 labels and skeletons of its walks (inputs.py), their `frames` tables; outputs of
         detectors at long range where there are any (detected.py); the networks' weights
OUTPUTS  table.csv (COLUMNS), cmc.csv (the shares at rank 1, 2, ... of its rows), left_out.csv (what was not compared
         and why)
A row without environment and camera is the mean over the probe cameras. `hits` of `n` trials; with as many sequences of
every camera their share is the mean over gallery cameras, as in the paper. `baseline` has one 3D per walk, whichever
camera looks, so that only protocols without the probe's own recording say anything of it. `keypoints`: what the probes
are, `labels`, `3D`, or a detector's name: then the probes of that camera are what the detector found in its pictures,
and the gallery is labels of other cameras.
"""

import csv
import io
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats, Ints
from dior.clocks.axis import nominal_fps
from dior.errors import DiorError
from dior.geometry.covariance import point_covariance
from dior.project import project as projects
from dior.project.project import Project
from dior.reid import baseline, checkpoint, detected, embed, features, inputs, protocols, statistics
from dior.reid.columns import (
    COLUMNS,
    CURVES,
    DETECTOR,
    KEYS,
    LABELS,
    LEFT_OUT,
    NO_NETWORK,
    NO_OUTPUT,
    POINTS,
    TOO_SHORT,
)
from dior.reid.networks import no_file
from dior.reid.protocols import Item, ProbeView
from dior.tables import tables
from dior.tables.files import write_text

if TYPE_CHECKING:
    from torch import nn

# rows of config/sequences.tsv by walk
Sheet: TypeAlias = Mapping[str, Mapping[str, str]]
# a row of table.csv by column, and under "cmc" its shares at rank 1, 2, ...
Row: TypeAlias = dict[str, Any]
BASELINE = "baseline"
# what says nothing of a method that does not look at pictures
SEEN_TWICE = ("per_camera", "pooled")


def run(
    *,
    root: Path,
    labels: list[Path],
    skeletons: list[Path],
    frames: list[Path],
    networks: dict[str, Any],
    adaptations: list[str],
    length: int,
    chunks: int,
    out: Path,
    out_cmc: Path,
    out_left_out: Path,
) -> None:
    """Compare the walks of the project in the folder `root`.

    `labels`, `skeletons`: what `inputs.run` wrote, and `frames` tables, by walk in the same order; `networks`: name ->
    files of weights, relative to `root`; `adaptations`, `length`, `chunks`: as in config.yaml. Raises DiorError for
    weights that are no weights of that network, networks without PyTorch, and where there is nothing to compare.
    """
    loaded = load(networks, Path(root))
    project = projects.load(root)
    if len(project.processed_subjects) < 2:
        raise DiorError("re-identification needs walks of two people or more; there is one in config/sequences.tsv")
    names = [Path(path).name.removesuffix(".parquet") for path in labels]
    pictures = dict(zip(names, frames, strict=True))
    widths = {name: _widths(path) for name, path in pictures.items()}
    shown = gallery(project.rows, dict(zip(names, labels, strict=True)), widths, length, chunks)
    walks, without = gaits(dict(zip(names, skeletons, strict=True)))
    if not shown.items or not (walks or loaded):
        name, why = [*((f"{name}, {camera}", why) for name, camera, why in shown.left_out), *without][0]
        raise DiorError(f"re-identification: no walk can be compared; {name}: {why}")
    distant = far_views(project)
    tools, unread = of_tools(project, pictures, distant, length, chunks)
    rows, small = of_baseline(project.rows, walks, shown) if walks else ([], [])
    exchanges = statistics.exchanged(shown.items)
    for method, weights, network in loaded:
        for adaptation in adaptations:
            began = time.monotonic()
            rows += of_network(method, network, shown, adaptation, exchanges=exchanges, weights=weights, tools=tools)
            taken = f"{time.monotonic() - began:.1f} s for {len(shown.items)} sequences"
            print(f"{method} {weights}, {adaptation}: {taken}", file=sys.stderr, flush=True)
    given = {(project.rows[name]["environment"], row["camera"]) for name in names for row in project.detectors_of(name)}
    rows += of_silence(distant, tools, given, bool(loaded))
    left = [(LABELS, *one) for one in shown.left_out] + [(POINTS, name, "", why) for name, why in without] + unread
    left += [(tool, *one) for tool, own in tools.items() for one in own.left_out]
    lines = [(what, project.session_of(name), name, camera, why) for what, name, camera, why in left]
    few = f"fewer than {baseline.LEAST_SUBJECTS} people: sizes are not compared"
    write_text(out, as_csv(rows))
    write_text(out_cmc, curves_csv(rows))
    write_text(out_left_out, _csv(LEFT_OUT, lines + [(BASELINE, day, "", "", few) for day in small]))


def load(networks: Mapping[str, list[str]], root: Path) -> list[tuple[str, str, "nn.Module"]]:
    """(network's name, what its weights are called, the network) of the files in `networks`, name -> paths."""
    found = []
    for name, files in networks.items():
        for file in files:
            if not (root / file).is_file():
                raise DiorError(no_file(f"reid.networks.{name}", file))
            plain = Path(file).name
            called = file if [Path(other).name for other in files].count(plain) > 1 else plain
            found.append((name, called, checkpoint.load(name, root / file)))
    return found


def _widths(frames: AnyPath) -> dict[str, int]:
    """Width (px) of the pictures by camera."""
    table = tables.read(frames, "frames", ["camera", "width"])
    return dict(zip(table["camera"].tolist(), table["width"].tolist(), strict=True))


def far_views(project: Project) -> list[ProbeView]:
    """(environment, camera) of the long-range cameras, sorted."""
    return sorted(
        {
            (project.rows[name]["environment"], camera)
            for name in project.sequences
            for camera, how in project.cameras(project.session_of(name)).items()
            if how["role"] == "long_range"
        }
    )


@dataclass(frozen=True, eq=False)
class Gallery:
    """What is compared: `items`, and of each the sequence (F, 17, 2) px as recorded, and its picture's width;
    `left_out`: (sequence, camera, why)."""

    items: tuple[Item, ...]
    sequences: tuple[Floats, ...]
    widths: tuple[int, ...]
    left_out: tuple[tuple[str, str, str], ...]

    def given(self, adaptation: str) -> list[Floats]:
        """The sequences as a network is given them."""
        return [inputs.adapted(uv, w, adaptation) for uv, w in zip(self.sequences, self.widths, strict=True)]


def gallery(
    sheet: Sheet,
    paths: Mapping[str, AnyPath],
    widths: Mapping[str, Mapping[str, int]],
    length: int = inputs.LENGTH,
    chunks: int = 1,
) -> Gallery:
    """`Gallery` of walks: `sheet`: rows by name (subject, session, environment); `paths`: labels by name; `widths`:
    name -> camera -> px."""
    tracks = ((name, *one) for name, path in paths.items() for one in inputs.camera_walks(path, widths[name]).items())
    return cut(sheet, tracks, length, chunks)


def cut(sheet: Sheet, tracks: Iterable[tuple[str, str, inputs.CameraWalk]], length: int, chunks: int) -> Gallery:
    """`Gallery` of (walk, camera, `inputs.CameraWalk`) triples."""
    items, sequences, sizes, left_out = [], [], [], []
    for name, camera, track in tracks:
        found, why = inputs.cut(track, length, chunks)
        if why:
            left_out.append((name, camera, why))
        row = sheet[name]
        item = Item(row["subject"], name, row["session"], row["environment"], camera)
        items += [item] * len(found)
        sequences += found
        sizes += [track.width] * len(found)
    return Gallery(tuple(items), tuple(sequences), tuple(sizes), tuple(left_out))


def of_tools(
    project: Project, frames: Mapping[str, AnyPath], distant: list[ProbeView], length: int, chunks: int
) -> tuple[dict[str, Gallery], list[tuple[str, str, str, str]]]:
    """`Gallery` by tool of what detectors found at long range, and (tool, walk, camera, why) of what cannot be used."""
    found: dict[str, list[tuple[str, str, inputs.CameraWalk]]] = {}
    left_out = []
    for name, path in frames.items():
        views = [camera for environment, camera in distant if environment == project.rows[name]["environment"]]
        rows = [row for row in project.detectors_of(name) if row["camera"] in views]
        rows = [row | {"path": str(project.root / row["path"])} for row in rows]
        own, lacking = detected.camera_walks(rows, path, name) if rows else ([], [])
        for tool, camera, track in own:
            found.setdefault(tool, []).append((name, camera, track))
        left_out += [(tool, name, camera, why) for tool, camera, why in lacking]
    return {tool: _upright(cut(project.rows, found[tool], length, chunks)) for tool in sorted(found)}, left_out


def _upright(own: Gallery) -> Gallery:
    """A `Gallery` without the sequences in which what was found cannot be a person who walks."""
    stands = [inputs.height_px(uv) > 0 for uv in own.sequences]
    why = "the nose that it found is not above the ankles"
    fallen = [(item.recording, item.camera, why) for item, up in zip(own.items, stands, strict=True) if not up]
    return Gallery(
        tuple(compress(own.items, stands)),
        tuple(compress(own.sequences, stands)),
        tuple(compress(own.widths, stands)),
        (*own.left_out, *fallen),
    )


def gaits(paths: Mapping[str, AnyPath]) -> tuple[dict[str, features.Gait], tuple[tuple[str, str], ...]]:
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


def of_network(
    name: str,
    network: "nn.Module",
    shown: Gallery,
    adaptation: str,
    confidence: float = embed.CONFIDENCE,
    exchanges: Ints | None = None,
    weights: str = "",
    tools: Mapping[str, Gallery] | None = None,
) -> list[Row]:
    """Rows of one network with one adaptation; `tools`: `Gallery` by detector, whose sequences are probes, too."""
    made = embed.embeddings(name, network, shown.given(adaptation), confidence)
    keys = {"method": name, "weights": weights, "adaptation": adaptation}
    rows = rows_of(keys, embed.distances(name, made), shown.items, protocols.PROTOCOLS, exchanges)
    for tool, own in (tools or {}).items():
        views = sorted({item.view for item in own.items})
        kept = [i for i, item in enumerate(shown.items) if item.view not in views]
        both = np.concatenate([made[kept], embed.embeddings(name, network, own.given(adaptation), confidence)])
        items = [*(shown.items[i] for i in kept), *own.items]
        far = embed.distances(name, both)
        rows += rows_of(keys | {"keypoints": tool}, far, items, protocols.PROTOCOLS, views=views)
    return rows


def of_silence(
    distant: list[ProbeView], tools: Mapping[str, Gallery], given: set[ProbeView], compared: bool
) -> list[Row]:
    """A row for each long-range camera (environment, name) of which no detector's output is compared, with the reason.

    `tools`: `Gallery` by detector; `given`: the cameras of which there is output; `compared`: whether by a network.
    """
    there, rows = {item.view for own in tools.values() for item in own.items}, []
    for view in distant:
        if view in there and compared:
            continue
        verdict = NO_NETWORK if view in there else TOO_SHORT if view in given else NO_OUTPUT
        keys = dict(zip(KEYS, ("", "", "", DETECTOR, "", *view), strict=True))
        rows.append(dict.fromkeys(COLUMNS, np.nan) | keys | {"hits": "", "n": 0, "verdict": verdict, "cmc": ()})
    return rows


def of_baseline(sheet: Sheet, walks: Mapping[str, features.Gait], shown: Gallery) -> tuple[list[Row], list[str]]:
    """Rows of the baseline, and the sessions that were too small to be centred; `walks`: `Gait` by name."""
    names = sorted(walks)
    subjects, sessions = ([sheet[name][key] for name in names] for key in ("subject", "session"))
    far, small = baseline.distances([walks[name] for name in names], subjects, sessions)
    at = [names.index(item.recording) if item.recording in walks else -1 for item in shown.items]
    items = [item for item, i in zip(shown.items, at, strict=True) if i >= 0]
    index = [i for i in at if i >= 0]
    kept = [name for name in protocols.PROTOCOLS if name not in SEEN_TWICE]
    keys = {"method": BASELINE, "keypoints": POINTS}
    return rows_of(keys, far[np.ix_(index, index)], items, kept), small


def rows_of(
    keys: dict[str, str],
    far: Floats,
    items: Sequence[Item],
    kinds: Iterable[str],
    exchanges: Ints | None = None,
    views: Sequence[ProbeView] | None = None,
) -> list[Row]:
    """Rows of the table for distances (N, N) between items, with `keys` (method, ...) in each; of all probe cameras and
    of their mean, or of the probe cameras `views` only."""
    if not len(items):
        return []
    exchanges = statistics.exchanged(items) if exchanges is None else exchanges
    keys = dict.fromkeys(KEYS, "") | {"keypoints": LABELS} | keys
    rows = []
    for protocol in kinds:
        found = protocols.trials(far, items, protocol)
        for view in (("", ""), *found.views) if views is None else views:
            score = statistics.score(found if view == ("", "") else found.of(view), items, exchanges)
            rows.append(
                keys
                | {"protocol": protocol, "environment": view[0], "camera": view[1]}
                | {"rank1": score.rank1, "low": score.low, "high": score.high, "hits": score.hits, "n": score.n}
                | {"chance": score.chance, "null95": score.null, "p": score.p, "rank5": score.cmc[4]}
                | {"mean_ap": score.mean_ap, "mean_inp": score.mean_inp, "tar": score.tar}
                | _ends("rank5", score.rank5_range)
                | _ends("mean_ap", score.mean_ap_range)
                | _ends("mean_inp", score.mean_inp_range)
                | _ends("tar", score.tar_range)
                | {"verdict": score.verdict, "cmc": score.cmc}
            )
    return rows


def _ends(column: str, interval: tuple[float, float]) -> Row:
    return dict(zip((f"{column}_low", f"{column}_high"), interval, strict=True))


def as_csv(rows: list[Row]) -> str:
    """The table as CSV text; six significant digits."""
    return _csv(COLUMNS, [[_cell(row[column]) for column in COLUMNS] for row in rows])


def curves_csv(rows: list[Row]) -> str:
    """The cumulative match characteristics of the table's rows as CSV text."""
    lines = [
        [*(row[key] for key in KEYS), rank, _cell(share)]
        for row in rows
        if row["n"]
        for rank, share in enumerate(row["cmc"], start=1)
    ]
    return _csv(CURVES, lines)


def _csv(columns: Sequence[str], lines: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([columns, *lines])
    return text.getvalue()


def _cell(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return "" if np.isnan(value) else repr(float(f"{value:.6g}"))
