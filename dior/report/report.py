"""The report: a page for all and one for each sequence, of relative links, readable from disk and on a phone.

INPUTS   the project's sheets, results/evaluate/metrics.csv, `frame_metrics`, `findings`, `cameras`, `skeletons_3d`,
         `stamp_audit`, `dropped_frames`, `frames`, `offsets`, `clock_costs`, contact sheets (overlays)
         statistics.csv, and what is there of re-identification (reid.py), the jobs' timings and effort.tsv (cost.py)
OUTPUTS  <out>/index.html, written last; <out>/sequences/<sequence>.html, and <sequence>.3d.html with <out>/viewer/*
         (scene_pages.py); <out>/assets/plots/*.svg; <out>/cost.html, <out>/verdict.txt, which a run ends with, and
         results/timing.csv
"""

import shutil
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath
from dior.evaluate import metrics as metrics_csv
from dior.evaluate import statistics as statistics_csv
from dior.geometry import camera_tables
from dior.geometry.camera import REFERENCE_FX, Camera
from dior.project.bumps import session_folder
from dior.project.project import Project
from dior.report import (
    cards,
    cost,
    dataset,
    headline,
    key_figures,
    last_run,
    lights,
    numbers,
    overview,
    pages,
    sequence_pages,
    troubles,
    worst_pictures,
)
from dior.report import clocks as sequence_clocks
from dior.report import findings as findings_of_all
from dior.report import scene_pages as spaces
from dior.report import stamps as sequence_stamps
from dior.report.figures import Figures
from dior.report.verdict import sentence
from dior.tables import tables
from dior.tables.files import write_text
from dior.tables.schemas import METRICS

PLOTS = "plots"
# name of a metric for people, in the order of the page
TITLES = {
    "label_sigma": "Standard error of a label, by itself",
    "label_sigma_m": "The same at the person",
    "person_height": "Height of the person in the picture",
    "coverage": "Joints with a label",
    "in_picture_share": "Labels in the picture",
    "mark_error": "Clicked marks, residual of the fit",
    "check_error": "Hand checks against labels",
    "check_error_median": "Hand checks against labels, median",
    "check_error_p95": "Hand checks against labels, 95th percentile",
    "reprojection_error": "Labels against detections",
    "adjust_error_before": "Reprojection error before the adjustment",
    "adjust_error_after": "Reprojection error after the adjustment",
    "in_box_share": "Labels in the hand boxes",
    "in_box_expected": "Perfect labels in boxes drawn like these",
    "held_back_share": "Labels in the hand boxes that nothing is fitted to",
    "held_back_expected": "Perfect labels in these boxes",
    "held_back_offset_u": "Label box right of these boxes, of its height",
    "held_back_offset_v": "Label box below these boxes, of its height",
    "left_out_share": "Labels by fits without the box in the hand boxes",
    "left_out_expected": "Perfect labels in these boxes",
    "left_out_offset_u": "Label box by these fits right of the box, of its height",
    "left_out_offset_v": "Label box by these fits below the box, of its height",
    "other_drawer_share": "Labels in the boxes of other drawers",
    "other_drawer_expected": "Perfect labels in the boxes of other drawers",
    "other_drawer_offset_u": "Label box right of other drawers' boxes, of its height",
    "other_drawer_offset_v": "Label box below other drawers' boxes, of its height",
    "box_iou": "Overlap (IoU) of label box and hand box",
    "box_offset_u": "Label box right of the hand box",
    "box_offset_v": "Label box below the hand box",
    "box_width_difference": "Label box wider than the hand box",
    "box_height_difference": "Label box higher than the hand box",
    "detected_share": "Pictures in which a detector finds anybody",
    "success_share": "Pictures in which it finds the subject",
    "error_to_truth_2d": "2D labels against the truth",
    "error_to_truth_3d": "3D against the truth, as is",
    "error_to_truth_3d_aligned": "3D against the truth, rigidly aligned",
    "swapped_share": "Left and right exchanged in the detections",
}
# what is not released where a figure is red, by `lights.Limit.wrong`
WRONG = {
    "": "",
    "camera": "its labels",
    "drawn": "its labels; those of all, and the 3D, where half of its cameras are red so",
}


@dataclass(frozen=True)
class Evaluated:
    """What was counted and measured of the labels.

    `metrics`: metrics.csv; `frame_metrics`: tables `frame_metrics`; `quantiles`: tables `label_quantiles`;
    `statistics`: statistics.csv; `recognition`: table.csv, cmc.csv and left_out.csv of re-identification, or nothing.
    """

    metrics: Path
    frame_metrics: list[Path]
    quantiles: list[Path]
    statistics: Path
    recognition: list[Path]


@dataclass(frozen=True)
class Scene:
    """Where the cameras and the people were.

    `cameras`: tables `cameras`; `covariances`: tables `camera_covariance`; `turns`: tables `camera_turns`; `skeletons`:
    tables `skeletons_3d`.
    """

    cameras: list[Path]
    covariances: list[Path]
    turns: list[Path]
    skeletons: list[Path]


@dataclass(frozen=True)
class Times:
    """When the pictures were taken: their stamps and the cameras' clocks.

    `audits`: tables `stamp_audit`; `dropped`: tables `dropped_frames`; `frames`: tables `frames`; `clocks`: tables
    `offsets`; `clock_costs`: tables `clock_costs`, where two have a camera's the first counts.
    """

    audits: list[Path]
    dropped: list[Path]
    frames: list[Path]
    clocks: list[Path]
    clock_costs: list[Path]


@dataclass(frozen=True)
class Media:
    """Pictures and films that the pages show.

    `overlays`: the contact sheets `<out>/assets/<sequence>/<camera>.jpg`; `clips`:
    `<out>/assets/<sequence>/clip.webm`, each with its poster beside it; `scenes`: `<out>/assets/<sequence>/scene.js`,
    each with the folder pictures beside it.
    """

    overlays: list[Path]
    clips: list[Path]
    scenes: list[Path]


def run(
    *,
    root: Path,
    title: str,
    evaluated: Evaluated,
    findings: list[Path],
    scene: Scene,
    times: Times,
    media: Media,
    effort: Path | None,
    out: Path,
    out_timing: Path,
) -> None:
    """Write the report of the project in `root` into the folder `out`.

    `findings`: tables `findings`; `effort`: effort.tsv or None. What it cost goes to `<out>/cost.html` and
    `out_timing`.
    """
    from dior.project import project as projects

    project, out = projects.load(root), Path(out)
    rows = metrics_csv.read(evaluated.metrics)
    recorded = read_frame_metrics(evaluated.frame_metrics)
    found = [finding for path in findings for finding in tables.read_findings(path)]
    audited = sequence_stamps.read(times.audits, times.dropped, times.frames)
    cameras = {s: project.cameras_of(s) for s in project.sequences}
    found = lights.by_mocap(found)
    found += lights.noticed(
        cameras,
        {name: set(one.lags) for name, one in audited.items()},
        rows,
        {name: project.sequence(name)["environment"] for name in project.sequences},
    )
    found += [(scope, "info", "no_consent", text) for scope, text in project.left_out] + unanswered(project)
    clocked = sequence_clocks.read(times.clocks, times.clock_costs, found, cameras)
    stations = session_cameras(scene.cameras)
    sheets = cards.sheets_of(media.overlays, out)
    by_camera = cards.rows_by_camera(rows)
    shown = [cards.card(project, s, by_camera, recorded, found, stations, sheets) for s in project.sequences]
    table = overview.rows(project, shown, recorded, stations, clocked)
    table = overview.with_changes(table, last_run.compared(out, overview.figures(table)))
    folder = out / "assets" / PLOTS
    made = Figures(folder, project, rows, recorded)
    sections = [*made.paper(), *made.truth(), *made.clocks(clocked)]
    scenes = [*made.scenes(stations, scene.skeletons), *made.certainty(scene.covariances, scene.turns)]
    walks = spaces.headers(media.scenes)
    timelines, stamps = made.timelines(), made.stamps(audited)
    tried = made.clock_costs(clocked)
    recognised = made.recognition(evaluated.recognition) if evaluated.recognition else None
    _remove_stale(folder, made.names)
    _remove_others(out / "assets", project.sequences)
    counted = statistics_csv.read(evaluated.statistics)
    environment = pages.environment()
    cost.write(environment, project, statistics_csv.of(counted, "frames"), effort, out_timing, out / "cost.html")
    sequence_pages.write(
        environment, out, title, shown, found, {s: _names(project, s) for s in project.sequences}, timelines, stamps,
        {sequence: one.rows for sequence, one in audited.items()}, clocked, tried,
        cards.clips_of(media.clips, out), walks,
    )  # fmt: skip
    spaces.write(environment, out, title, walks)
    page = environment.get_template("index.html.j2").render(
        title=title,
        dataset=dataset.section(counted),
        tiles=_tiles(project, recorded),
        tally=Counter(cell["light"].level for card in shown for cell in card["cells"]),
        headline=headline.lines(_told(project, shown), headline.read(evaluated.quantiles)),
        table=table,
        columns=overview.COLUMNS,
        where=troubles.where,
        excluded=sorted(project.excluded.items()),
        groups=findings_of_all.grouped(findings_of_all.untold(found, table), project.sequences),
        figures=_named(key_figures.table_of(rows, made.environment)),
        sections=sections,
        worst=worst_pictures.of_sections(evaluated.frame_metrics),
        scenes=scenes,
        recognised=recognised,
        limits=[_limit(limit) for limit in lights.LIMITS],
        words=lights.WORDS,
        meanings=[(TITLES[name], name, text) for name, text in METRICS.items()],
        fx_of_limits=f"{REFERENCE_FX:.0f}",
    )
    write_text(out / "verdict.txt", sentence(table))
    write_text(out / "index.html", page)


def _told(project: Project, shown: Iterable[dict[str, Any]]) -> dict[tuple[str, str], headline.Told]:
    """What the headline is made of, by sequence and camera."""
    return {
        (card["sequence"], cell["camera"]): headline.Told(
            (project.sequence(card["sequence"])["environment"], cell["role"].replace(" ", "_")),
            cell["light"].level,
            cell["figures"],
        )
        for card in shown
        for cell in card["cells"]
    }


def _names(project: Project, sequence: str) -> set[str]:
    """The words that the scope of a finding about a sequence may be made of."""
    session = project.session_of(sequence)
    return {sequence, session, project.subject_of(sequence), *project.cameras(session)}


def read_frame_metrics(paths: Iterable[AnyPath]) -> cards.FrameMetrics:
    """(sequence, camera) -> metric -> (stamp_ns (N,), value (N,), n (N,)) of `frame_metrics` files."""
    import pandas as pd

    found: cards.FrameMetrics = {}
    for path in paths:
        table = pd.DataFrame(tables.read(path, "frame_metrics"))
        for key, own in table.groupby(["sequence", "camera", "metric"], sort=False):
            sequence, camera, metric = map(str, key)
            values = own["stamp_ns"].to_numpy(), own["value"].to_numpy(), own["n"].to_numpy()
            found.setdefault((sequence, camera), {})[metric] = values
    return found


def session_cameras(paths: Iterable[AnyPath]) -> dict[str, dict[str, Camera]]:
    """session -> camera -> `Camera` of `cameras` files; a file later in the list replaces an earlier one's camera."""
    found: dict[str, dict[str, Camera]] = {}
    for path in paths:
        for session in tables.ordered_unique(tables.read(path, "cameras", ["session"])["session"]):
            found.setdefault(session, {}).update(camera_tables.read_cameras(path))
    return found


def _tiles(project: Project, recorded: cards.FrameMetrics) -> list[tuple[str, str]]:
    pictures = labels = 0
    for by_metric in recorded.values():
        if "coverage" in by_metric:
            _, value, n = by_metric["coverage"]
            pictures, labels = pictures + len(n), labels + int(np.rint(value * n).sum())
    return [
        (numbers.count(len(project.sequences)), "sequences"),
        (numbers.count(len(project.processed_subjects)), "subjects"),
        (numbers.count(len({session_folder(session) for session in project.sessions})), "sessions"),
        (numbers.count(len(recorded)), "camera recordings"),
        (numbers.count(pictures), "pictures"),
        (numbers.count(labels), "2D labels"),
    ]


def _named(lines: list[dict[str, str]]) -> list[dict[str, str]]:
    order = list(TITLES)
    lines = sorted(lines, key=lambda line: (order.index(line["metric"]), line["where"]))
    return [line | {"title": TITLES[line["metric"]]} for line in lines]


def _limit(limit: lights.Limit) -> dict[str, str]:
    word = "above" if limit.sign > 0 else "below"
    return {
        "title": TITLES.get(limit.metric, limit.metric.replace("_", " ").capitalize()),
        "look": f"{word} {numbers.show(limit.look, limit.unit)}",
        "bad": f"{word} {numbers.show(limit.bad, limit.unit)}" if np.isfinite(limit.bad) else "never",
        "wrong": WRONG[limit.wrong],
        "why": limit.why,
    }


def unanswered(project: Project) -> list[lights.Finding]:
    """A finding on the people of the release of whom the sheet does not say whether their pictures may be in it."""
    if not project.unanswered:
        return []
    text = (
        f"of {project.unanswered} of the {len(project.released_subjects)} people in the release, config/subjects.tsv "
        "does not say in consent_pictures whether their pictures may be published; until then only their labels are"
    )
    return [("release", "warning", "pictures_unanswered", text)]


def _remove_others(assets: Path, sequences: Iterable[str]) -> None:
    """Remove the pictures of sequences that the project no longer has."""
    for folder in assets.iterdir() if assets.is_dir() else ():
        if folder.is_dir() and folder.name not in (*sequences, PLOTS):
            shutil.rmtree(folder)


def _remove_stale(folder: Path, names: set[str]) -> None:
    for path in folder.glob("*.svg") if folder.is_dir() else ():
        if path.name not in names:
            path.unlink()
