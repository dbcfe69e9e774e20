"""The text of `dior diff`: tables that a person reads. INPUT: the dict of diff.py. OUTPUT: text."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

# part of what diff.py found, as it is in the JSON
Found: TypeAlias = dict[str, Any]
LENGTHS = {"moved_px": "px", "moved_mm": "mm"}


def of(found: Found) -> str:
    """All that differs; reasons are numbers of the list at the end."""
    if found["same"]:
        return f"{found['first']} and {found['second']} are the same"
    lines = [f"{found['first']} -> {found['second']}"]
    for how, names in found["sequences"].items():
        lines += [f"sequences {how}: {', '.join(names)}"] if names else []
    lines += _section("cameras", found["cameras"], ("session", "camera"), _camera, ())
    lines += _section("clocks", found["clocks"], ("sequence", "camera"), _clock, ())
    lines += _section("labels and pictures", found["recordings"], ("sequence", "camera"), _recording, found["inputs"])
    lines += _section("3D and marks", found["skeletons"], ("sequence",), _recording, found["inputs"])
    for how, names in found["files"].items():
        lines += ["", f"files {how}: {', '.join(names)}"] if names else []
    lines += ["", "inputs and settings that changed"] if found["inputs"] else ["", "no input or setting changed"]
    lines += [f"  [{i}] {text}" for i, text in enumerate(found["inputs"], start=1)]
    return "\n".join(lines)


def _section(
    title: str, rows: list[Found], keys: Sequence[str], described: Callable[[Found], list[str]], inputs: Sequence[str]
) -> list[str]:
    if not rows:
        return []
    widths = [max(len(row[key]) for row in rows) for key in keys]
    lines = ["", title]
    for row in rows:
        name = "  ".join(f"{row[key]:<{width}}" for key, width in zip(keys, widths, strict=True))
        lines.append(
            f"  {name}  {'; '.join(described(row)) if row['change'] == 'changed' else row['change']}{_why(row, inputs)}"
        )
    return lines


def _why(row: Found, inputs: Sequence[str]) -> str:
    if "because" not in row:
        return ""
    return "  because of " + (
        " ".join(f"[{inputs.index(text) + 1}]" for text in row["because"]) or "nothing that is known"
    )


def _camera(row: Found) -> list[str]:
    parts = []
    if "moved_mm" in row:
        parts.append(f"moved {_number(row['moved_mm'])} mm, turned {_number(row['turned_deg'])} deg")
    parts += [f"{key} {before} -> {after}" for key, (before, after) in _pairs(row)]
    return [*parts, *(["covariance changed"] if "covariance" in row else [])]


def _clock(row: Found) -> list[str]:
    parts = [f"offset by {_number(row['offset_ms'])} ms, drift by {_number(row['drift_ppm'])} ppm"]
    return parts + [f"{key} {before or 'none'} -> {after or 'none'}" for key, (before, after) in _pairs(row)]


def _pairs(row: Found) -> list[tuple[str, list[Any]]]:
    return [(key, change) for key, change in row.items() if isinstance(change, list)]


def _recording(row: Found) -> list[str]:
    parts = [f"subject {' -> '.join(row['subject'])}"] if "subject" in row else []
    for kind, change in row.items():
        if isinstance(change, dict):
            parts.append(_pictures(change) if kind == "frames" else _moved(kind, change))
        elif kind not in ("sequence", "camera", "change", "subject", "because"):
            parts.append(f"{kind} {change}")
    return parts


def _moved(kind: str, change: Found) -> str:
    what = next(key for key in LENGTHS if key in change)
    values = [f"{name} {_number(value)}" for name, value in change[what].items()]
    parts = [f"{kind} moved {', '.join(values)} {LENGTHS[what]}"]
    if change["status_changed_share"]:
        parts.append(f"status of {100 * change['status_changed_share']:.3g} % changed")
    parts += [f"{change[key]} {key.replace('_', ' ')}" for key in ("rows_added", "rows_removed") if change[key]]
    before, after = change["suspect"]
    if before != after:
        parts.append(f"suspect {before} -> {after}")
    if change["stamps_moved_ms"]:
        parts.append(f"stamps moved by up to {_number(change['stamps_moved_ms'])} ms")
    if change.get("sigma_ratio") not in (None, 1.0):
        parts.append(f"sigma times {_number(change['sigma_ratio'])}")
    return ", ".join(parts)


def _pictures(change: Found) -> str:
    counts = {key: n for key, n in change.items() if n and key not in ("pictures", "no_image")}
    words = [f"{n} {key.replace('_', ' ')}" for key, n in counts.items()]
    words += [f"without a picture for {reason} {a} -> {b}" for reason, (a, b) in change["no_image"].items()]
    return "frames: " + (", ".join(words) or "written anew") + f" (of {change['pictures']} pictures in both)"


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.4g}"
