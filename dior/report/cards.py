"""The traffic lights of a sequence and its cameras, as the index and the sequence's page show them.

INPUTS   the project, figures by camera, `frame_metrics` by recording, findings, cameras, contact sheets
OUTPUTS  dicts for the templates: sequence, about, level, word, notes, cells
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from dior.arrays import AnyPath, Floats, Ints
from dior.errors import DiorError
from dior.geometry import culprit
from dior.geometry.camera import Camera
from dior.project.project import Project
from dior.report import lights
from dior.report.key_figures import Row
from dior.report.lights import Finding

# (sequence, camera) -> metric -> (stamp_ns (N,), value (N,), n (N,)) of `frame_metrics` tables
FrameMetrics: TypeAlias = dict[tuple[str, str], dict[str, tuple[Ints, Floats, Ints]]]
SEVERITY_ORDER = ("error", "warning", "info")


def rows_by_camera(rows: Iterable[Row]) -> dict[tuple[str, str], dict[str, float]]:
    """metric -> value by (sequence, camera), of the rows over all joints."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        if row["sequence"] and row["camera"] and not row["joint"]:
            found.setdefault((row["sequence"], row["camera"]), {})[row["metric"]] = row["value"]
    return found


def sheets_of(overlays: Iterable[AnyPath], out: AnyPath) -> dict[str, dict[str, str]]:
    """sequence -> camera -> link of the contact sheet."""
    links: dict[str, dict[str, str]] = {}
    for path in map(Path, overlays):
        links.setdefault(path.parent.name, {})[path.stem] = _link(path, out, "overlays")
    return links


def clips_of(clips: Iterable[AnyPath], out: AnyPath) -> dict[str, dict[str, str]]:
    """sequence -> dict video, poster: links of its clip and of the picture shown before it runs."""
    return {
        path.parent.name: {
            "video": _link(path, out, "clip"),
            "poster": _link(path.with_suffix(".poster.jpg"), out, "clip"),
        }
        for path in map(Path, clips)
    }


def _link(path: Path, out: AnyPath, step: str) -> str:
    if not path.is_file():
        raise DiorError(f"{path}: there is no such file; run the step {step}")
    link = os.path.relpath(path, out)
    if link.startswith(".."):
        raise DiorError(f"{path}: lies outside the report's folder {out}, so that the report could not be moved")
    return Path(link).as_posix()


def card(
    project: Project,
    sequence: str,
    figures: Mapping[tuple[str, str], dict[str, float]],
    recorded: FrameMetrics,
    found: list[Finding],
    stations: Mapping[str, Mapping[str, Camera]],
    sheets: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    session, subject = project.session_of(sequence), project.subject_of(sequence)
    row = project.sequence(sequence)
    cells = []
    for camera, settings in project.cameras(session).items():
        values = dict(figures.get((sequence, camera), {}))
        if "coverage" in recorded.get((sequence, camera), {}):
            values["lost_pictures"] = lights.lost_share(recorded[sequence, camera]["coverage"][0])
        known = stations.get(session, {}).get(camera)
        light = lights.judge(
            values,
            known.intrinsics.fx if known else None,
            lights.findings_of(found, sequence, session, subject, camera),
            settings["role"],
        )
        light = lights.beside_culprit(light, found, sequence, camera)
        cells.append(
            {
                "camera": camera,
                "role": settings["role"].replace("_", " "),
                "light": light,
                "figures": values,
                "sheet": sheets.get(sequence, {}).get(camera),
            }
        )
    own = lights.findings_of(found, sequence, session, subject)
    level = lights.worst([*(cell["light"].level for cell in cells), *(lights.SEVERITY_LEVEL[s] for s, _, _ in own)])
    return {
        "sequence": sequence,
        "about": ", ".join(w for w in (subject, row["environment"], session, row["outfit"], row["walk"]) if w),
        "level": level,
        "word": lights.WORDS[level],
        "notes": [text for severity, _, text in own if severity != "info"],
        "faults": [(lights.SEVERITY_LEVEL[s], code, text) for s, code, text in own if s != "info"],
        "cells": cells,
    }


def shown(findings: Iterable[Finding]) -> list[dict[str, str]]:
    """Findings (scope, severity, code, text) as dicts for the templates, the worst first, each once.

    Of equal ones that is first which says where the others come from.
    """
    ordered = sorted(set(findings), key=lambda f: (SEVERITY_ORDER.index(f[1]), f[2] not in culprit.CODES, f))
    return [
        {
            "where": scope.replace("/", " "),
            "severity": severity,
            "level": lights.SEVERITY_LEVEL[severity] if severity != "info" else "none",
            "word": lights.WORDS[lights.SEVERITY_LEVEL[severity]] if severity != "info" else "note",
            "code": code,
            "text": text,
        }
        for scope, severity, code, text in ordered
    ]
