"""What became better or worse since the figures last changed.

INPUT    the figures of the cameras of this run; <out>/history.json, which a run before left
OUTPUT   words by camera; <out>/history.json

The file has the figures of this run and those before them. It is written anew only where figures differ, so that the
same results make the same page again. It is no output of the workflow: without it nothing is compared.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

from dior.report.lights import LEVELS
from dior.tables.files import write_text

NAME = "history.json"
# session/camera -> name of a figure -> its value, or the level of the light
Figures: TypeAlias = dict[str, dict[str, float | str]]
# chosen: by which share of it, and by how much (px), a figure changes before it is worth a word
WORTH_TELLING, WORTH_PX = 0.1, 0.1
# the figures that are told, the first that changed, and what the table calls them
TOLD = {"beside_px": "off hand boxes", "residual_px": "off detections", "sigma_px": "\u03c3 of a label"}


def compared(folder: Path, now: Figures) -> dict[str, str]:
    """session/camera -> "better", "worse", "new" or "", and the history written for the next run."""
    path = folder / NAME
    history = _read(path)
    before: Figures = history.get("before" if history.get("now") == now else "now") or {}
    if history.get("now") != now:
        write_text(path, json.dumps({"now": now, "before": before}, indent=1, sort_keys=True) + "\n")
    if not before:
        return dict.fromkeys(now, "")
    return {name: _word(before.get(name), figures) for name, figures in now.items()}


def figures(folder: Path) -> Figures:
    """What the last report in a folder says of each session/camera; nothing where there is none."""
    return _read(folder / NAME).get("now") or {}


def _read(path: Path) -> dict[str, Figures]:
    """What the file holds; nothing where there is none or it is not whole."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _word(before: Mapping[str, float | str] | None, now: Mapping[str, float | str]) -> str:
    if before is None:
        return "new"
    was, is_now = str(before.get("level", "none")), str(now.get("level", "none"))
    if was != is_now and {was, is_now} <= set(LEVELS):
        return f"{'better' if LEVELS.index(is_now) < LEVELS.index(was) else 'worse'}{_figure(before, now, ', ')}"
    return _figure(before, now)


def _figure(before: Mapping[str, float | str], now: Mapping[str, float | str], joined: str = "") -> str:
    """The first figure that changed, in words; "" for none. `joined`: how it goes on behind a word that judges."""
    for key, name in TOLD.items():
        old, new = before.get(key), now.get(key)
        if not (isinstance(old, float) and isinstance(new, float)):
            continue
        if abs(new - old) > max(WORTH_TELLING * old, WORTH_PX):
            judged = joined or f"{'better' if new < old else 'worse'}: "
            return f"{judged}{name} {old:.2f} to {new:.2f} px"
    return ""
