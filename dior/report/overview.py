"""The table on top of the report: a row for each camera of a session, with its recordings, what is wrong and what to
type; and the same in a sentence for the terminal.

INPUTS   the project, the cards of its sequences (`cards.card`), facts of its recordings, cameras
OUTPUT   `CameraRow`s for templates/overview.html.j2; nothing is drawn or written here
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.errors import many
from dior.project.project import Project
from dior.report import beside_boxes, lights, troubles
from dior.report.facts import Clock, Recording
from dior.report.last_run import Figures
from dior.report.numbers import show
from dior.report.troubles import Trouble


@dataclass(frozen=True)
class Cell:
    """What a cell shows, what explains it on hover, what its column is sorted by, and whether it is struck out."""

    text: str
    title: str = ""
    by: float | str = ""
    struck: bool = False


@dataclass(frozen=True)
class RecordingRow:
    """A recording of a camera: link to its part of the sequence's page."""

    sequence: str
    link: str
    level: str
    word: str
    cells: tuple[Cell, ...]
    why: str


@dataclass(frozen=True)
class CameraRow:
    """A camera of a session; `camera` is "" for what is about whole walks."""

    session: str
    camera: str
    role: str
    level: str
    word: str
    cells: tuple[Cell, ...]
    troubles: tuple[Trouble, ...]
    recordings: tuple[RecordingRow, ...]
    change: str = ""

    @property
    def name(self) -> str:
        return f"{self.session}/{self.camera}"

    @property
    def told(self) -> tuple[Trouble, ...]:
        """The troubles that are told at once: the first, and all that are to fix."""
        return tuple(one for i, one in enumerate(self.troubles) if not i or one.level == "bad")

    @property
    def more(self) -> tuple[Trouble, ...]:
        """The others, which are folded."""
        return tuple(one for one in self.troubles if one not in self.told)


COLUMNS = (
    ("\u03c3 of a label", "standard error of one axis of a label, as the labels tell it: in px, and at the person"),
    ("labelled", "joints with a label"),
    ("off detections", "mean distance of the labels from this camera's own detections"),
    ("off hand boxes", "how far the labels lie right of and below where hand boxes have them, with a 95 % interval"),
    ("clock", "how well the camera's clock is known: half a 95 % interval, the widest of its recordings"),
)
NOTHING = Cell("\u2013")
# of more cameras than these the good ones are folded; chosen: as many rows as a screen has
UNFOLDED = 12


def rows(
    project: Project,
    cards: Iterable[Mapping[str, Any]],
    recorded: Mapping[tuple[str, str], Recording],
    stations: Mapping[str, Mapping[str, Any]],
) -> list[CameraRow]:
    """A `CameraRow` for each camera of each session, and one for what is about whole walks, the worst first and
    then in the sheet's order."""
    by_session: dict[str, list[Mapping[str, Any]]] = {}
    for card in cards:
        by_session.setdefault(project.session_of(card["sequence"]), []).append(card)
    found = []
    for session, own in by_session.items():
        walks = _whole_walks(session, own)
        of_session = [walks] if walks else []
        for camera in project.cameras(session):
            seen = [(card, cell) for card in own for cell in card["cells"] if cell["camera"] == camera]
            if seen:
                of_session.append(_camera(project, session, camera, seen, recorded, stations))
        by_row = troubles.across({row.camera: row.troubles for row in of_session}, project.window(session))
        found += [_judged(row, by_row[row.camera]) for row in of_session]
    return sorted(found, key=_order)


def _order(row: CameraRow) -> tuple[int, bool]:
    """The worst first, and causes before what follows from them."""
    follows = all(one.code == lights.BESIDE_CULPRIT for one in row.troubles)
    return (0 if row.level == "none" else -lights.LEVELS.index(row.level)), follows


def _judged(row: CameraRow, own: tuple[Trouble, ...]) -> CameraRow:
    """The row with the troubles that are its own in the end; its light is the worst of these and of its recordings."""
    level = lights.worst((row.level, *(one.level for one in own)))
    aside = {sequence for one in own if _draws_aside(one) for sequence in one.sequences}
    each = tuple(
        replace(one, cells=_struck(one.cells)) if one.level == "bad" or one.sequence in aside else one
        for one in row.recordings
    )
    wrong = level == "bad" or bool(each) and all(one.cells[0].struck for one in each)
    cells = _struck(row.cells) if wrong else row.cells
    return replace(row, troubles=own, level=level, word=lights.WORDS[level], cells=cells, recordings=each)


def _draws_aside(trouble: Trouble) -> bool:
    """Whether it draws labels aside, which their sigmas do not know."""
    return troubles.EXPLAINS.get(trouble.code, frozenset()) >= troubles.ASIDE


def _struck(cells: tuple[Cell, ...]) -> tuple[Cell, ...]:
    """The cells of a row whose labels are wrong: what they say of themselves does not hold."""
    sigma, *others = cells
    if sigma.by == "":
        return cells
    return replace(sigma, struck=True, title="does not hold: the labels are not right, and do not know it"), *others


def folded(found: Sequence[CameraRow]) -> list[tuple[str, list[CameraRow]]]:
    """The rows in parts, ("", rows) as they are and, of many cameras, (words, rows) the good ones of a session."""
    if len(found) <= UNFOLDED:
        return [("", list(found))]
    parts = [("", [row for row in found if row.level != "good"])]
    for session in sorted({row.session for row in found}):
        good = [row for row in found if row.session == session and row.level == "good"]
        if good:
            parts.append((f"{session}: {many(len(good), 'camera')} {'is' if len(good) == 1 else 'are'} good", good))
    return parts


def aside(table: Iterable[CameraRow]) -> set[tuple[str, str]]:
    """The recordings (sequence, camera) of which something draws the labels aside."""
    return {
        (sequence, row.camera)
        for row in table
        for trouble in row.troubles
        if _draws_aside(trouble)
        for sequence in trouble.sequences
    }


def typed(found: Sequence[CameraRow]) -> dict[str, list[dict[str, Any]]]:
    """By sequence what the table says to type for it: the fields of a `Fix`, its `camera`, "" for the walk, and the
    sequence `of` which it is where what is wrong follows from another one, else ""."""
    known = {one.sequence for row in found for one in row.recordings}
    lines: dict[str, list[dict[str, Any]]] = {}
    for camera, trouble in ((row.camera, one) for row in found for one in row.told if one.fix and one.fix.what):
        after = {word.rstrip(",") for where, _ in trouble.follows for word in where.split()} & known
        fixes = [asdict(fix) for fix in (trouble.fix, *trouble.also) if fix]
        for sequence in (*trouble.sequences, *sorted(after - set(trouble.sequences))):
            of = "" if sequence in trouble.sequences else trouble.sequences[0]
            lines.setdefault(sequence, []).extend({"camera": camera, "of": of} | fix for fix in fixes)
    return lines


def figures(found: Iterable[CameraRow]) -> Figures:
    """What is kept of a run, to be compared with the next (`last_run`)."""
    names = ("sigma_px", "coverage", "residual_px", "beside_px")
    return {
        row.name: {"level": row.level} | {
            name: float(cell.by) for name, cell in zip(names, row.cells, strict=False) if cell.by != ""
        }
        for row in found
        if row.camera
    }  # fmt: skip


def with_changes(found: Iterable[CameraRow], changes: Mapping[str, str]) -> list[CameraRow]:
    """The rows with what became of them since the last run."""
    return [replace(row, change=changes.get(row.name, "")) for row in found]


def _camera(
    project: Project,
    session: str,
    camera: str,
    seen: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]],
    recorded: Mapping[tuple[str, str], Recording],
    stations: Mapping[str, Mapping[str, Any]],
) -> CameraRow:
    settings = project.cameras(session)[camera]
    each, recordings, offsets, lags = [], [], [], []
    for card, cell in seen:
        sequence, light = card["sequence"], cell["light"]
        offset, lag = recorded[sequence, camera].offset, recorded[sequence, camera].clock
        offsets.append(offset)
        lags.append(lag)
        recordings.append(troubles.Recording(sequence, camera, light.faults, offset))
        cells = _cells([cell["figures"]], [offset], [lag])
        link = f"sequences/{sequence}.html#{camera}"
        each.append(RecordingRow(sequence, link, light.level, light.word, cells, next(iter(light.reasons), "")))
    aligned = {
        _file(project, session, name): listed
        for name, says in project.cameras(session).items()
        if (listed := says.get("align", {}).get("sequences"))
    }
    setting = troubles.Setting(
        _file(project, session, camera), settings, stations.get(session, {}).get(camera), aligned
    )
    level = lights.worst(row.level for row in each)
    return CameraRow(
        session,
        camera,
        settings["role"].replace("_", " "),
        level,
        lights.WORDS[level],
        _cells([cell["figures"] for _, cell in seen], offsets, lags),
        tuple(troubles.of_camera(recordings, setting)),
        tuple(each),
    )


def _file(project: Project, session: str, camera: str) -> str:
    """A camera's file, below the project."""
    path = os.path.join(project.root, project.camera_file(session, camera))
    return Path(os.path.relpath(path, project.root)).as_posix()


def _whole_walks(session: str, cards: Sequence[Mapping[str, Any]]) -> CameraRow | None:
    """What is wrong with whole walks of a session and is not said of one of its cameras already."""
    told = {text for card in cards for cell in card["cells"] for text in cell["light"].reasons}
    recordings = [
        troubles.Recording(card["sequence"], "", tuple(fault for fault in card["faults"] if fault[2] not in told))
        for card in cards
    ]
    found = troubles.of_camera(recordings, troubles.Setting(""))
    if not found:
        return None
    level = lights.worst(one.level for one in found)
    cells = (NOTHING,) * len(COLUMNS)
    return CameraRow(session, "", "whole walks", level, lights.WORDS[level], cells, tuple(found), ())


def _cells(
    figures: Sequence[Mapping[str, float]],
    offsets: Sequence[beside_boxes.Offset | None],
    lags: Sequence[Clock | None],
) -> tuple[Cell, ...]:
    """Those of COLUMNS of one or several recordings: means over these, and the widest interval of a clock."""
    sigma, metres = _mean(figures, "label_sigma"), _mean(figures, "label_sigma_m")
    coverage, residual = _mean(figures, "coverage"), _mean(figures, "reprojection_error")
    at_person = f", {show(metres, 'm')}" if np.isfinite(metres) else ""
    known = [one for one in lags if one]
    return (
        Cell(show(sigma, "px") + at_person, "", sigma) if np.isfinite(sigma) else Cell("unknown", "", ""),
        Cell(show(coverage, "share"), "", -coverage) if np.isfinite(coverage) else NOTHING,
        Cell(show(residual, "px"), "", residual) if np.isfinite(residual) else NOTHING,
        _offset(beside_boxes.together([one for one in offsets if one])),
        _clock(known),
    )


def _mean(figures: Sequence[Mapping[str, float]], metric: str) -> float:
    values = [one[metric] for one in figures if metric in one]
    return float(np.mean(values)) if values else np.nan


def _offset(offset: beside_boxes.Offset | None) -> Cell:
    if offset is None:
        return NOTHING
    each = zip(offset.uv, offset.sigma, strict=True)
    right, below = (f"{off:+.1f} \u00b1 {1.96 * sigma:.1f}" for off, sigma in each)
    title = f"right and below, px; by {offset.n} boxes"
    return Cell(f"{right}, {below} px", title, float(np.hypot(*offset.uv)))


def _clock(lags: Sequence[Clock]) -> Cell:
    """The widest interval of the clocks; those that nobody knows or that a hand gave are said so."""
    if not lags:
        return NOTHING
    unknown = sum(source == "assumed_zero" for *_, source in lags)
    if unknown:
        text = "unknown" if unknown == len(lags) else f"unknown in {unknown} of {len(lags)}"
        return Cell(text, "taken as it is", np.inf)
    # what is typed without its error is not known exactly: nothing has checked it
    told = [(high - low) / 2 for _, low, high, source in lags if source != "manual" or high > low]
    typed = sum(source == "manual" for *_, source in lags)
    half = max(told, default=np.nan)
    if all(source == "reference" for *_, source in lags):
        return Cell("reference", "the other clocks are told by this one", 0.0)
    words = [f"\u00b1 {half:.0f} ms"] if np.isfinite(half) else []
    words += ["by hand" if typed == len(lags) else f"{typed} by hand"] if typed else []
    late = ", ".join(f"{one:+.1f}" for one, *_ in lags[:6])
    return Cell(", ".join(words) or "given", f"late by {late} ms", half)
