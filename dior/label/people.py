"""3D and labels of everybody who is tracked through the close cameras, where config.yaml asks for all people.

INPUTS   what triangulate and reproject read, and the subject's skeleton
OUTPUTS  `people_3d`: everybody's 3D at every instant; `people_2d`: their labels in every picture of every camera, close
         and long-range; `findings`: who was followed, and where it is not known who is whose
The subject's rows are those of the skeleton and of reproject; the others are triangulated, smoothed and projected by
the same code, from the detections that are surely theirs (`whose_detections`). Where these are too few because two
people are too close together, rows are null and `suspect`. A person is a number in the order of first appearance in the
sequence.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Table
from dior.body.whose_detections import Somebody, everyone
from dior.clocks.axis import moving
from dior.label import reproject
from dior.reconstruct import everybody, refine, triangulate
from dior.reconstruct.triangulate import Given, Limits, Told
from dior.tables import tables

WHOSE = ("sequence", "person", "is_subject")
BODY = [name for name in tables.columns_of("people_3d") if name not in WHOSE]
KNOWN = ("ok", "gap_filled")
# where nobody but the subject is seen by two cameras
ALONE = Somebody(np.zeros((0, 0), int), np.zeros(0, bool), "yes", 0)
# chosen: somebody who is left open for more of the time that they are there is worth a word; no warning, since lights
# are of the subject's labels
MUCH = 0.1


@dataclass(frozen=True)
class SequenceCameras:
    """The cameras of the sequence.

    `labelled`: all cameras that get labels; `makers`: those of them that 3D is made from; `cameras`: their `cameras`
    tables; `covariance`: their `camera_covariance` tables; `clocks`, `clock_gains`: their tables of both names.
    """

    labelled: list[str]
    makers: list[str]
    cameras: list[Path]
    covariance: list[Path]
    clocks: list[Path]
    clock_gains: list[Path]


@dataclass(frozen=True)
class Recorded:
    """What the cameras recorded.

    `detections`, `timeline`, `frames`: tables of these names.
    """

    detections: Path
    timeline: Path
    frames: Path


def run(
    *,
    sequence: str,
    subject: str,
    rig: SequenceCameras,
    recorded: Recorded,
    told: Told,
    skeleton: Path,
    method: str,
    limits: Limits,
    smoothing: str,
    max_gap_s: float,
    out: Path,
    out_labels: Path,
    findings: Path,
) -> None:
    """Label everybody in one outdoor sequence.

    `skeleton`: the subject's, as it is labelled; `smoothing`: refine.method; `out_labels`: table `people_2d` to write.
    """
    given = triangulate.gathered(
        sequence, subject, rig.cameras, rig.makers, recorded.detections, recorded.timeline, method, limits.min_score,
        told,
    )  # fmt: skip
    own = tables.read(skeleton, "skeletons_3d", BODY)
    found = everyone(given.rig, given.seen, given.choice) if given.choice else []
    found = found or [ALONE]
    longest_gap = max_gap_s if smoothing == "smooth" else None
    bodies = [own if one.is_subject == "yes" else body_of(given, one, method, limits, longest_gap) for one in found]
    words = [one.is_subject for one in found]
    tables.write(out, "people_3d", _joined(sequence, words, bodies))
    known = tables.read(out, "people_3d")
    views = reproject.seen_by(
        sequence, rig.labelled, rig.cameras, rig.makers, rig.covariance, recorded.frames, rig.clocks, rig.clock_gains
    )
    each = [_labels(views, of_person(known, number)) for number in range(len(found))]
    tables.write(out_labels, "people_2d", _joined(sequence, words, each))
    tables.write_findings(findings, _findings(sequence, given, found, known))


def called(number: int) -> str:
    """What the person is called who appeared as the `number`-th, from 0."""
    return f"person_{number + 1}"


def of_person(table: Table, number: int) -> Table:
    """The rows of one person of `people_3d` or `people_2d`."""
    return tables.rows(table, table["person"] == called(number))


def body_of(given: Given, who: Somebody, method: str, limits: Limits, max_gap_s: float | None) -> Table:
    """The 3D of somebody else than the subject as columns BODY; `max_gap_s`: None where nothing is smoothed."""
    seen = given.seen
    uv, score = everybody.of_picked(seen, who.pick)
    skeleton, _ = triangulate.solved(given.rig, uv, score, seen.names, seen.fps, method, limits)
    skeleton = skeleton.known_only(np.where(who.unsure[:, None], "suspect", skeleton.status))
    if max_gap_s is not None:
        skeleton = refine.over_time(skeleton, seen.names, seen.fps, max_gap_s)
    return _spelled(skeleton.columns(seen.names, given.stamps))


def _labels(views: Sequence[reproject.View], body: Table) -> Table:
    """Columns of `people_2d` of one `body` in all cameras."""
    walker, parts = moving(body), []
    for view in views:
        columns = _spelled(reproject.columns(view, walker, "triangulated"))
        parts.append({"camera": np.full(len(columns["frame"]), view.camera.name, object)} | columns)
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _spelled(columns: dict[str, tables.Column]) -> Table:
    """Columns as arrays, with words where there were indices of them; "" is null."""
    return {
        key: np.array([*values.words, ""], object)[values.index]
        if isinstance(values, tables.Repeated)
        else np.asarray(values)
        for key, values in columns.items()
    }


def _joined(sequence: str, is_subject: list[str], parts: list[Table]) -> dict[str, tables.Column]:
    """Columns of `people_3d` or `people_2d` from those of each person."""
    who = np.repeat(np.arange(len(parts)), [len(part["stamp_ns"]) for part in parts])
    return {
        "sequence": tables.Repeated([sequence], np.zeros(len(who), int)),
        "person": tables.Repeated([called(number) for number in range(len(parts))], who),
        "is_subject": tables.Repeated(is_subject, who),
        **{key: np.concatenate([part[key] for part in parts]) for key in parts[0]},
    }


def _findings(sequence: str, given: Given, found: Sequence[Somebody], known: Table) -> list[tuple[str, str, str, str]]:
    """Who was followed, and of whom it is not known who is whose."""
    others = [(number, one) for number, one in enumerate(found) if one.is_subject != "yes"]
    if not others:
        several = given.others is not None and len(given.others["frame"]) > 0
        why = "" if several else "; the detector gives one body in each picture"
        text = f"nobody else was tracked through two close cameras{why}"
        return [(sequence, "info", "nobody_else", text)]
    shown, out = [], []
    for number, one in others:
        status = of_person(known, number)["status"].reshape(len(given.stamps), -1)
        ok = np.asarray(np.isin(status, KNOWN).any(axis=1))
        part = f"{called(number)} ({'the subject or not' if one.is_subject == 'unknown' else 'not the subject'})"
        shown.append(f"{part} at {int(ok.sum())} of {len(ok)} instants")
        if one.unsure.sum() > MUCH * (ok | one.unsure).sum():
            text = (
                f"{called(number)}: at {int(one.unsure.sum())} instants it is not known which detections are theirs, "
                "as somebody else is too near in the pictures; nothing is labelled there (suspect)"
            )
            out.append((sequence, "info", "people_too_near", text))
    return [(sequence, "info", "people_labelled", "others are labelled: " + ", ".join(shown)), *out]
