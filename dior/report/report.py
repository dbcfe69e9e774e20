"""The index of the report: what came out of all sequences, of relative links, readable from disk and on a phone.

INPUTS   the project's sheets, results/evaluate/metrics.csv, what the step page left of each sequence (facts.py),
         `label_quantiles`, findings that are about several sequences, `cameras`, `camera_covariance`, `camera_turns`,
         statistics.csv, and what is there of re-identification (reid.py), the jobs' timings and effort.tsv (cost.py)
OUTPUTS  <out>/index.html, written last; <out>/compared.js, what it says more of each sequence than its page;
         <out>/viewer/*, what the pages in 3D share; <out>/assets/plots/*.svg; <out>/cost.html, <out>/verdict.txt, which
         a run ends with, and results/timing.csv
"""

import json
import shutil
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
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
    facts,
    headline,
    key_figures,
    last_run,
    lights,
    numbers,
    overview,
    pages,
    troubles,
    viewer_files,
    worst_pictures,
)
from dior.report import findings as findings_of_all
from dior.report.facts import Facts, Recording
from dior.report.figures import Figures
from dior.report.verdict import sentence
from dior.tables import tables
from dior.tables.files import folder_written_whole, write_text
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

    `metrics`: metrics.csv; `quantiles`: tables `label_quantiles`; `statistics`: statistics.csv; `recognition`:
    table.csv, cmc.csv and left_out.csv of re-identification, or nothing.
    """

    metrics: Path
    quantiles: list[Path]
    statistics: Path
    recognition: list[Path]


@dataclass(frozen=True)
class Scene:
    """Where the cameras were.

    `cameras`: tables `cameras`; `covariances`: tables `camera_covariance`; `turns`: tables `camera_turns`.
    """

    cameras: list[Path]
    covariances: list[Path]
    turns: list[Path]


def run(
    *,
    root: Path,
    title: str,
    evaluated: Evaluated,
    told: list[Path],
    findings: list[Path],
    scene: Scene,
    effort: Path | None,
    out: Path,
    out_timing: Path,
) -> None:
    """Write the index of the project in `root` into the folder `out`, where the pages of its sequences are.

    `told`: what the step page left of each sequence, facts.json; `findings`: tables `findings` that are about more than
    one sequence; `effort`: effort.tsv or None. What it cost goes to `<out>/cost.html` and `out_timing`.
    """
    from dior.project import project as projects

    project, out = projects.load(root), Path(out)
    rows = metrics_csv.read(evaluated.metrics)
    each = [facts.read(path) for path in told]
    recorded = {(one.sequence, camera): own for one in each for camera, own in one.recordings.items()}
    environments = {name: project.sequence(name)["environment"] for name in project.sequences}
    compared = [finding for path in findings for finding in tables.read_findings(path)]
    compared += lights.standing_out(rows, environments)
    compared += [(scope, "info", "no_consent", text) for scope, text in project.left_out]
    stations = session_cameras(scene.cameras)
    both = [_cards(project, one, compared, stations) for one in each]
    shown = [card for card, _ in both]
    on_pages = dict.fromkeys(finding for one in each for finding in one.findings)
    found = [*dict.fromkeys([*on_pages, *compared]), *unanswered(project)]
    table = overview.rows(project, shown, recorded, stations)
    table = overview.with_changes(table, last_run.compared(out, overview.figures(table)))
    with folder_written_whole(out / "assets" / PLOTS) as folder:
        made = Figures(folder, project, rows, each)
        sections = [*made.paper(), *made.truth(), *made.clocks()]
        scenes = [*made.scenes(stations), *made.certainty(scene.covariances, scene.turns)]
        recognised = made.recognition(evaluated.recognition) if evaluated.recognition else None
    _remove_others(out, project.sequences)
    counted = statistics_csv.read(evaluated.statistics)
    environment = pages.environment()
    cost.write(environment, project, statistics_csv.of(counted, "frames"), effort, out_timing, out / "cost.html")
    viewer_files.write(out)
    write_text(out / "compared.js", _script(both, overview.typed(table)))
    page = environment.get_template("index.html.j2").render(
        title=title,
        dataset=dataset.section(counted),
        tiles=_tiles(project, recorded),
        tally=Counter(cell["light"].level for card in shown for cell in card["cells"]),
        headline=headline.lines(_told(environments, shown, overview.aside(table)), headline.read(evaluated.quantiles)),
        table=overview.folded(table),
        columns=overview.COLUMNS,
        where=troubles.where,
        excluded=sorted(project.excluded.items()),
        groups=findings_of_all.grouped(findings_of_all.untold(found, table, on_pages), project.sequences),
        figures=_named(key_figures.table_of(rows, environments)),
        sections=sections,
        worst=worst_pictures.of_sections({key: own.worst for key, own in recorded.items()}),
        in_3d={one.sequence for one in each if one.in_3d},
        scenes=scenes,
        recognised=recognised,
        limits=[_limit(limit) for limit in lights.LIMITS],
        words=lights.WORDS,
        meanings=[(TITLES[name], name, text) for name, text in METRICS.items()],
        fx_of_limits=f"{REFERENCE_FX:.0f}",
    )
    write_text(out / "verdict.txt", sentence(table))
    write_text(out / "index.html", page)


def _cards(
    project: Project, one: Facts, compared: list[lights.Finding], stations: Mapping[str, Mapping[str, Camera]]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The card of a sequence as the index has it, and as its page has it, where nothing is `compared`."""
    session = project.session_of(one.sequence)
    within = session, project.subject_of(one.sequence)
    roles = {name: setting["role"] for name, setting in project.cameras(session).items()}
    figures = {name: own.figures for name, own in one.recordings.items()}
    fx = {name: camera.intrinsics.fx for name, camera in stations.get(session, {}).items()}
    card, own = (
        cards.card(one.sequence, within, roles, figures, fx, found, {})
        for found in (one.findings + compared, one.findings)
    )
    return card, own


def _script(both: Iterable[tuple[dict[str, Any], dict[str, Any]]], typed: Mapping[str, list[dict[str, Any]]]) -> str:
    """What the pages of sequences load: what the index says more than they do, and what is to be typed."""
    told = {}
    for card, own in both:
        more, fixes = cards.beyond(card, own) or {}, typed.get(card["sequence"])
        if more or fixes:
            told[card["sequence"]] = more | ({"fixes": fixes} if fixes else {})
    return f"window.compared = {json.dumps(told, sort_keys=True, indent=1)};\n"


def _told(
    environments: Mapping[str, str], shown: Iterable[dict[str, Any]], aside: Collection[tuple[str, str]]
) -> dict[tuple[str, str], headline.Told]:
    """What the headline is made of, by sequence and camera; of those whose labels lie `aside`, too."""
    return {
        (card["sequence"], cell["camera"]): headline.Told(
            (environments[card["sequence"]], cell["role"].replace(" ", "_")),
            cell["light"].level,
            cell["figures"],
            (card["sequence"], cell["camera"]) in aside,
        )  # fmt: skip
        for card in shown
        for cell in card["cells"]
    }


def session_cameras(paths: Iterable[AnyPath]) -> dict[str, dict[str, Camera]]:
    """session -> camera -> `Camera` of `cameras` files; a file later in the list replaces an earlier one's camera."""
    found: dict[str, dict[str, Camera]] = {}
    for path in paths:
        for session in tables.ordered_unique(tables.read(path, "cameras", ["session"])["session"]):
            found.setdefault(session, {}).update(camera_tables.read_cameras(path))
    return found


def _tiles(project: Project, recorded: Mapping[tuple[str, str], Recording]) -> list[tuple[str, str]]:
    labelled = [one for one in recorded.values() if one.pictures]
    tiles = [
        (len(project.sequences), "sequence"),
        (len(project.processed_subjects), "subject"),
        (len({session_folder(session) for session in project.sessions}), "session"),
        (len(labelled), "camera recording"),
        (sum(one.pictures for one in labelled), "picture"),
        (sum(one.labels for one in labelled), "2D label"),
    ]
    return [(numbers.count(count), name if count == 1 else f"{name}s") for count, name in tiles]


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


def _remove_others(out: Path, sequences: Iterable[str]) -> None:
    """Remove the pages and pictures of sequences that the project no longer has."""
    kept = {*sequences, PLOTS}
    for folder in (out / "assets").iterdir() if (out / "assets").is_dir() else ():
        if folder.is_dir() and folder.name not in kept:
            shutil.rmtree(folder)
    for page in (out / "sequences").glob("*.html"):
        if page.name.partition(".")[0] not in kept:
            page.unlink()
