"""The traffic lights of a sequence and its cameras, as the index and the sequence's page show them.

INPUTS   figures, roles and focal lengths by camera, findings, contact sheets
OUTPUTS  dicts for the templates: sequence, level, word, notes, cells
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.geometry import culprit
from dior.report import lights
from dior.report.lights import Finding

SEVERITY_ORDER = ("error", "warning", "info")


def sheets_of(overlays: Path, out: AnyPath) -> dict[str, str]:
    """camera -> link of the contact sheet, of those in a folder."""
    return {path.stem: _link(path, out, "overlays") for path in sorted(overlays.glob("*.jpg"))}


def clip_of(clip: Path | None, out: AnyPath) -> dict[str, str] | None:
    """Links of a clip, `video`, and of the picture shown before it runs, `poster`."""
    if clip is None:
        return None
    return {"video": _link(clip, out, "clip"), "poster": _link(clip.with_suffix(".poster.jpg"), out, "clip")}


def _link(path: Path, out: AnyPath, step: str) -> str:
    if not path.is_file():
        raise DiorError(f"{path}: there is no such file; run the step {step}")
    link = os.path.relpath(path, out)
    if link.startswith(".."):
        raise DiorError(f"{path}: lies outside the report's folder {out}, so that the report could not be moved")
    return Path(link).as_posix()


def card(
    sequence: str,
    within: Iterable[str],
    roles: Mapping[str, str],
    figures: Mapping[str, Mapping[str, float]],
    fx: Mapping[str, float],
    found: list[Finding],
    sheets: Mapping[str, str],
) -> dict[str, Any]:
    """The lights of a sequence and its cameras, for the templates.

    `within`: its session and subject; by camera `roles`, `figures` by metric, focal lengths `fx` px where known and
    `sheets`, links of contact sheets; `found`: findings, also such as are about others.
    """
    cells: list[dict[str, Any]] = []
    for camera, role in roles.items():
        values = dict(figures.get(camera, {}))
        about = lights.findings_of(found, sequence, within, camera)
        light = lights.beside_culprit(lights.judge(values, fx.get(camera), about, role), found, sequence, camera)
        cells.append(
            {
                "camera": camera,
                "role": role.replace("_", " "),
                "light": light,
                "figures": values,
                "sheet": sheets.get(camera),
            }
        )
    own = lights.findings_of(found, sequence, within)
    level = lights.worst([*(cell["light"].level for cell in cells), *(lights.SEVERITY_LEVEL[s] for s, _, _ in own)])
    return {
        "sequence": sequence,
        "level": level,
        "word": lights.WORDS[level],
        "notes": [text for severity, _, text in own if severity != "info"],
        "faults": [(lights.SEVERITY_LEVEL[s], code, text) for s, code, text in own if s != "info"],
        "cells": cells,
    }


def beyond(card: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any] | None:
    """What the `card` of a sequence says more than its `own`, by what is known of it alone; None where it is nothing.

    The light of the sequence, `notes` and the `cameras` whose light differs, with what to add to their reasons.
    """
    cameras = {}
    for cell, before in zip(card["cells"], own["cells"], strict=True):
        light, was = cell["light"], before["light"]
        reasons = [text for text in light.reasons if text not in was.reasons]
        if reasons or light.level != was.level:
            cameras[cell["camera"]] = {"level": light.level, "word": light.word, "reasons": reasons}
    notes = [text for text in card["notes"] if text not in own["notes"]]
    if not cameras and not notes:
        return None
    return {"level": card["level"], "word": card["word"], "notes": notes, "cameras": cameras}


def level_of(severity: str) -> tuple[str, str]:
    """The level of the light of a finding, and its word."""
    level = lights.SEVERITY_LEVEL[severity]
    return ("none", "note") if severity == "info" else (level, lights.WORDS[level])


def shown(findings: Iterable[Finding]) -> list[dict[str, str]]:
    """Findings (scope, severity, code, text) as dicts for the templates, the worst first, each once.

    Of equal ones that is first which says where the others come from.
    """
    ordered = sorted(set(findings), key=lambda f: (SEVERITY_ORDER.index(f[1]), f[2] not in culprit.CODES, f))
    return [
        {
            "where": scope.replace("/", " "),
            "severity": severity,
            **dict(zip(("level", "word"), level_of(severity), strict=True)),
            "code": code,
            "text": text,
        }
        for scope, severity, code, text in ordered
    ]
