"""What `dior assess` found as text, JSON and CSV. INPUT: `judge.Judged`s."""

import csv
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from dior.assess import lens
from dior.assess.judge import Judged, Row

KEYS = (
    "recording", "camera", "fps", "against", "offset_s", "offset_low", "offset_high", "offset_pictures", "drift_ppm",
    "drift_low", "drift_high", "drift_ms_per_min", "step_s", "u_px", "u_low", "u_high", "v_px", "v_low", "v_high",
    "focal", "focal_low", "focal_high", "k1", "k1_low", "k1_high", "lens_untold",
    "verdict",
)  # fmt: skip
HEAD = ("camera", "offset ms", "pictures", "drift ppm", "u, v px", "focal", "k1", "")


def as_dict(found: Judged) -> dict[str, Any]:
    """A recording for JSON; null is not known."""
    world = found.world
    return {
        "recording": found.name,
        "verdict": found.verdict,
        "wrong": found.wrong,
        "against": found.against,
        "notes": list(found.notes),
        "faults": [fault._asdict() for fault in found.faults],
        "world": None
        if world is None
        else {
            "scale": world.scale,
            "scale_low": world.scale - world.half_scale,
            "scale_high": world.scale + world.half_scale,
            "turn_deg": world.turn_deg,
            "shift_m": world.shift.tolist(),
            "mirrored": world.mirrored,
        },
        "cameras": [
            {key: value for key, value in cells(found, row).items() if key not in ("recording", "against")}
            | {"faults": [fault._asdict() for fault in row.faults], "why": row.why}
            for row in found.rows
        ],
    }


def cells(found: Judged, row: Row) -> dict[str, Any]:
    """A camera of a recording by `KEYS`, None for what is not known."""
    time, beside, bend = row.timing, row.beside, row.lens
    out: dict[str, Any] = dict.fromkeys(KEYS)
    out |= {"recording": found.name, "camera": row.camera, "fps": row.fps, "verdict": verdict(row)}
    out["against"] = found.against
    if time is not None:
        out |= _interval("offset", "offset_s", time.late_s, time.half_s)
        out |= _interval("drift", "drift_ppm", 1e6 * time.drift, 1e6 * time.half_drift)
        out |= {"offset_pictures": time.late_s * row.fps, "step_s": time.steps_s}
        out["drift_ms_per_min"] = 60e3 * time.drift if np.isfinite(time.half_drift) else None
    if beside is not None:
        for name, value, half in zip("uv", beside.px.tolist(), beside.half_px.tolist(), strict=True):
            out |= _interval(name, f"{name}_px", value, half)
    if bend is not None:
        out |= _interval("focal", "focal", bend.focal, bend.half_focal)
        out |= _interval("k1", "k1", bend.k1, bend.half_k1)
        out["lens_untold"] = lens.untold([bend])
    return {key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in out.items()}


def _interval(stem: str, name: str, value: float, half: float) -> dict[str, float | None]:
    if not np.isfinite(half):
        return {name: None, f"{stem}_low": None, f"{stem}_high": None}
    return {name: value, f"{stem}_low": value - half, f"{stem}_high": value + half}


def verdict(row: Row) -> str:
    """Of a camera, in a few words."""
    if row.faults:
        return ", ".join(fault.code.replace("_", " ") for fault in row.faults)
    if row.why:
        return "cannot tell"
    return "ok, lens: cannot tell" if row.lens is not None and lens.untold([row.lens]) else "ok"


def as_csv(every: Sequence[Judged]) -> str:
    """A row for each camera of each recording."""
    out = io.StringIO()
    writer = csv.DictWriter(out, KEYS, lineterminator="\n")
    writer.writeheader()
    for found in every:
        writer.writerows(cells(found, row) for row in found.rows)
    return out.getvalue()


def as_text(every: Sequence[Judged]) -> str:
    """A table and a verdict for each recording."""
    return "\n\n".join(_of_recording(found) for found in every)


def _of_recording(found: Judged) -> str:
    rows = [HEAD, *(_shown(row) for row in found.rows)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    notes = [f"  {note}" for note in found.notes]
    title = f"{found.name} (times against {found.against})"
    return "\n".join([title, *notes, *(f"  {line}" for line in lines), f"  {found.verdict}"])


def _shown(row: Row) -> tuple[str, ...]:
    time, beside, bend = row.timing, row.beside, row.lens
    shown = [row.camera, "", "", "", "", "", "", verdict(row)]
    if time is not None and not time.why:
        shown[1] = _with(1e3 * time.late_s, 1e3 * time.half_s, 1)
        shown[2] = f"{time.late_s * row.fps:+.2f}"
        shown[3] = _with(1e6 * time.drift, 1e6 * time.half_drift, 0)
    if beside is not None:
        shown[4] = ", ".join(_with(a, b, 1) for a, b in zip(beside.px.tolist(), beside.half_px.tolist(), strict=True))
    if bend is not None:
        shown[5], shown[6] = _with(bend.focal - 1, bend.half_focal, 3, 1.0), _with(bend.k1, bend.half_k1, 3)
    return tuple(shown)


def _with(value: float, half: float, digits: int, base: float | None = None) -> str:
    """A value with half of its interval; "" where that is not known. `base`: what it is told from, without a sign."""
    if not np.isfinite(half):
        return ""
    number = f"{value:+.{digits}f}" if base is None else f"{base + value:.{digits}f}"
    return f"{number} ± {half:.{digits}f}"
