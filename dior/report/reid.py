"""Re-identification for people: what the table says, in which words, and its figures.

INPUTS   table.csv, cmc.csv, left_out.csv (dior/reid/recognise.py)
OUTPUTS  <out>/index.html and <out>/plots/*.svg; the same as a section of the report
"""

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath
from dior.reid.columns import ABOVE_CHANCE, AT_CHANCE, DETECTOR, LABELS, NO_OUTPUT, NO_TRIAL, POINTS
from dior.report import check_figures, pages, plots
from dior.tables import result_checksums
from dior.tables.files import folder_written_whole, write_text

# a row of one of the files by column, as text
Row: TypeAlias = dict[str, str]
PLOTS = "plots"
PROTOCOLS = {
    "per_camera": (
        "The paper's protocol",
        "One other camera after the other is the gallery, and the rate is the mean over them. Cameras of one place see "
        "a walk at the same time, so that finding the moment again, not the person, scores here, too.",
    ),
    "pooled": ("All other cameras at once", "The gallery is all other cameras together, with the same flaw."),
    "other_recording": (
        "Without the probe's own walk",
        "As the paper's, but the walk that the probe shows is not in the gallery: a person has to be found in another "
        "walk.",
    ),
    "other_place": (
        "Indoors in outdoors and the reverse",
        "The gallery is cameras of the other environment: other walks, another calibration, and 3D made another way.",
    ),
}
FAIR = "other_recording"
STATEMENT = (
    "Labels of a long-range camera come from the close cameras, as in the paper: they are the 3D that those have seen, "
    "projected into the far picture. So the column of a long-range camera tells how well people are recognised by what "
    "the close cameras saw, as it would look from there. It says nothing about recognising anybody in far pictures.",
    "Every camera in turn is the probe: each of its sequences looks for the nearest in the gallery, and rank 1 is the "
    "share that finds its own person. Chance is what a gallery in random order gives. The null exchanges the people of "
    "the walks within each session and takes the distances as they are: what it still reaches comes from sessions and "
    "from cameras that see one walk together. A rate that 5 % or more of the exchanges reach is at chance: it tells "
    "nothing, however far from zero it is. Intervals are a bootstrap over people.",
)
OWN = (
    "Here the probes of a long-range camera are what a detector found in its pictures, and the gallery is labels of "
    "the other cameras: this does tell something about far pictures. Only sequences count in which all 17 joints were "
    "found in 61 pictures in a row, gaps up to 0.4 s bridged; n says how many, so it is a selection of the best."
)


@dataclass(frozen=True)
class ReidTables:
    """Rows of the three files, as dicts of strings."""

    rows: list[Row]
    curves: list[Row]
    left_out: list[Row]

    @property
    def scores(self) -> list[Row]:
        """Rows of labels and of the 3D."""
        return [row for row in self.rows if row["keypoints"] in (LABELS, POINTS)]

    @property
    def views(self) -> list[tuple[str, str]]:
        """(environment, camera) of the probes, sorted."""
        return sorted({(row["environment"], row["camera"]) for row in self.scores if row["camera"]})


def run(*, title: str, table: Path, cmc: Path, left_out: Path, out: Path) -> None:
    """Write the page and its plots into the folder `out`."""
    tables, out = read(table, cmc, left_out), Path(out)
    shown = []
    with folder_written_whole(out / PLOTS) as folder:
        for one in figures(tables):
            one.draw(folder / f"{one.name}.svg", *one.args, **one.options)
            words = {"title": one.title, "caption": one.caption, "alt": one.alt}
            shown.append({"src": f"{PLOTS}/{one.name}.svg"} | words)
    page = (
        pages.environment()
        .get_template("reid.html.j2")
        .render(title=title, recognised=section(tables) | {"figures": shown})
    )
    write_text(out / "index.html", page)


def read(table: AnyPath, cmc: AnyPath, left_out: AnyPath) -> ReidTables:
    """`ReidTables` by the three files."""

    def rows(path: AnyPath) -> list[Row]:
        return list(csv.DictReader(io.StringIO(result_checksums.read_text(path), newline="")))

    return ReidTables(rows(table), rows(cmc), rows(left_out))


def section(tables: ReidTables) -> dict[str, Any]:
    """What the template says: statement, a table per protocol, the detectors' own output, what was not compared."""
    return {
        "statement": [*STATEMENT, in_words(tables)],
        "parts": [part for protocol in PROTOCOLS if (part := _part(tables, protocol))["lines"]],
        "own": own_words(tables),
        "detected": [
            _detected(row, tables) for row in tables.rows if row["keypoints"] not in (LABELS, POINTS, DETECTOR)
        ],
        "left_out": [
            {"what": row["what"], "where": " ".join(filter(None, _place(row))), "why": row["why"]}
            for row in tables.left_out
        ],
    }


def _place(row: Row) -> tuple[str, str]:
    return (row["sequence"] or f"session {row['session']}", row["camera"])


def in_words(tables: ReidTables) -> str:
    """How many of the means over probe cameras are at chance, and of which methods nothing is."""
    means = [row for row in tables.scores if not row["camera"] and row["verdict"] != NO_TRIAL]
    if not means:
        return "Nothing could be compared."
    chance = [row for row in means if row["verdict"] == AT_CHANCE]
    if not chance:
        return f"All {len(means)} means over the probe cameras are above chance."
    fair = [row for row in means if row["protocol"] == FAIR]
    good = [f"{method_of(row, tables)} ({input_of(row)})" for row in fair if row["verdict"] == ABOVE_CHANCE]
    who = ", ".join(good) if good else "no method"
    return (
        f"{len(chance)} of {len(means)} means over the probe cameras are at chance. Above chance without the probe's "
        f"own walk in the gallery: {who}."
    )


def own_words(tables: ReidTables) -> list[str]:
    """What is said above the scores of the detectors' own output, or in their place."""
    silent = [row for row in tables.rows if row["keypoints"] == DETECTOR]
    found = [f"{row['environment']} {row['camera']}: {row['verdict']}." for row in silent]
    if any(row["verdict"] == NO_OUTPUT for row in silent):
        found.append("To see its score here, name what a detector found in config/detectors.tsv (docs/figures.md).")
    if any(row["keypoints"] not in (LABELS, POINTS, DETECTOR) for row in tables.rows):
        found.insert(0, OWN)
    return found or ["There is no long-range camera."]


def method_of(row: Row, tables: ReidTables) -> str:
    """The method's name, with that of its weights where a network has several."""
    weights = {other["weights"] for other in tables.rows if other["method"] == row["method"]}
    return f"{row['method']} {row['weights']}" if len(weights) > 1 else row["method"]


def input_of(row: Row) -> str:
    return row["adaptation"] or row["keypoints"]


def _part(tables: ReidTables, protocol: str) -> dict[str, Any]:
    """The table of one protocol: a line for each method and input, a column for each probe camera."""
    title, about = PROTOCOLS[protocol]
    own = [row for row in tables.scores if row["protocol"] == protocol]
    keys = list(dict.fromkeys((row["method"], row["weights"], row["adaptation"]) for row in own))
    lines = []
    for key in keys:
        mine = [row for row in own if (row["method"], row["weights"], row["adaptation"]) == key]
        cells = {(row["environment"], row["camera"]): row for row in mine}
        line = _line(cells[("", "")], tables)
        line["cells"] = [
            _cell(cells[view]) if view in cells else {"value": "", "chance": False} for view in tables.views
        ]
        lines.append(line)
    return {"title": title, "about": about, "views": [" ".join(view) for view in tables.views], "lines": lines}


def _cell(row: Row) -> dict[str, Any]:
    return {"value": percent(row["rank1"]), "chance": row["verdict"] == AT_CHANCE}


def _line(row: Row, tables: ReidTables) -> dict[str, Any]:
    return {
        "method": method_of(row, tables),
        "input": input_of(row),
        "rank1": percent(row["rank1"]),
        "interval": f"{percent(row['low'])} to {percent(row['high'])}" if row["low"] else "",
        "n": f"{row['hits']} of {row['n']}",
        "chance": percent(row["chance"]),
        "null": percent(row["null95"]),
        "rank5": percent(row["rank5"]),
        "map": percent(row["mean_ap"]),
        "minp": percent(row["mean_inp"]),
        "tar": percent(row["tar"]),
        "verdict": row["verdict"],
    }


def _detected(row: Row, tables: ReidTables) -> dict[str, Any]:
    words = {"camera": f"{row['environment']} {row['camera']}", "keypoints": row["keypoints"]}
    return _line(row, tables) | words | {"input": row["adaptation"], "protocol": PROTOCOLS[row["protocol"]][0]}


def percent(text: str) -> str:
    """A share of the table as per cent; "" where it is not known."""
    return f"{100 * float(text):.1f} %" if text else ""


def figures(tables: ReidTables) -> list[check_figures.Drawing]:
    """`check_figures.Drawing`s: rank 1 by probe camera, for each input of the networks, and the curves of all ranks."""
    adaptations = list(dict.fromkeys(row["adaptation"] for row in tables.scores if row["adaptation"])) or [""]
    found = []
    for protocol in ("per_camera", FAIR):
        for adaptation in adaptations:
            found += _rank1(tables, protocol, adaptation)
    return found + _curves(tables)


def _rank1(tables: ReidTables, protocol: str, adaptation: str) -> list[check_figures.Drawing]:
    rows = [row for row in tables.scores if row["protocol"] == protocol and row["adaptation"] in ("", adaptation)]
    rows = [row for row in rows if int(row["n"])]
    series: dict[str, dict[str, plots.Value]] = {}
    for row in sorted(rows, key=_networks_first):
        at = f"{row['environment']} {row['camera']}" if row["camera"] else check_figures.ALL
        value, low, high = (float(row[key]) if row[key] else np.nan for key in ("rank1", "low", "high"))
        series.setdefault(method_of(row, tables), {})[at] = (value, low, high, int(row["n"]))
    if not series:
        return []
    groups = [*(" ".join(view) for view in tables.views), check_figures.ALL]
    chance = next(row["chance"] for row in rows if not row["camera"])
    # one method has no legend
    words = ", ".join(filter(None, (adaptation, *(series if len(series) == 1 else ()))))
    title = f"{PROTOCOLS[protocol][0]}: {words}" if words else PROTOCOLS[protocol][0]
    caption = (
        "The share of the probe camera's sequences whose nearest in the gallery is of the same person. Lines are 95 % "
        f"intervals over people, the dashed one is chance ({percent(chance)})."
    )
    if adaptation and any(row["keypoints"] == POINTS for row in rows):
        caption += " The baseline is the same in every figure."
    name = "_".join(filter(None, ("reid", protocol, adaptation)))
    options = {"percent": True, "limit": (float(chance), "")}
    alt = f"Rank 1 of {len(series)} methods with {len(groups) - 1} cameras as the probe"
    return [check_figures.Drawing(name, plots.marks, (groups, series, "rank 1, %"), title, caption, alt, options)]


def _networks_first(row: Row) -> bool:
    """The order in which methods are drawn: a network has its colour with and without the baseline."""
    return row["keypoints"] == POINTS


def _curves(tables: ReidTables) -> list[check_figures.Drawing]:
    own = [row for row in tables.curves if row["protocol"] == FAIR and not row["camera"]]
    series: dict[tuple[str, str], list[float]] = {}
    for row in sorted(own, key=_networks_first):
        name = (method_of(row, tables), row["adaptation"])
        series.setdefault(name, []).append(float(row["share"]))
    if not series:
        return []
    caption = "How often the person is among the nearest 1, 2, ... sequences; the mean over all probe cameras."
    alt = f"Cumulative match curves of {len(series)} methods and inputs"
    title = f"{PROTOCOLS[FAIR][0]}: all ranks"
    return [check_figures.Drawing("reid_cmc", plots.cmc, (series,), title, caption, alt, {})]
