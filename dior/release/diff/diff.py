"""`dior diff`: what differs between two releases, by how much, and because of which input or setting.

INPUTS   two release folders
OUTPUT   text, or JSON: walks and cameras that were added, removed or changed; of a changed recording how far its labels
         moved (px), of its 3D points (mm), of cameras the way (mm), turn (degrees) and intrinsics, of clocks the offset
         (ms) and drift (ppm); the changed inputs that can be the reason (causes.py). Exit code 0 where the releases are
         the same, 1 where they differ, 2 where one cannot be read.
Walks are the same by name, whatever the pseudonym. Files with the same checksum are not looked into.
"""

import hashlib
import json
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import Bools, Floats, Table
from dior.errors import DiorError
from dior.progress import reporting
from dior.release import checksums
from dior.release.diff import causes, diff_text
from dior.release.diff.diff_text import Found
from dior.release.layout import IN_PICTURE, PARTS, of_other_version, rows_of
from dior.tables import tables

# rows of a table by their key
Rows: TypeAlias = dict[tuple[str, ...], dict[str, Any]]
# (sequence, camera); the camera is "" for what is about the whole walk
Place: TypeAlias = tuple[str, str]
# frame -> (stamp, digest of its picture or None, reason for none)
Digests: TypeAlias = dict[int, tuple[int, bytes | None, str]]
TABLE = {part.name: part.table for part in PARTS}
LENS = ("width", "height", "fx", "fy", "cx", "cy", "distortion_model", "distortion")
# what is read of every release
READ = ("sequences.parquet", "cameras.parquet", "clocks.parquet", causes.PROVENANCE)
# pictures in memory at once; chosen: it bounds the memory
PICTURES_AT_ONCE = 16


def run(first: Path, second: Path, *, as_json: bool = False) -> int:
    """Print how a release differs from another one; returns the exit code.

    `first`: folder of the older release; `second`: of the newer one; `as_json`: print JSON instead of text.
    """
    try:
        found = compared(first, second)
    except DiorError as error:
        print(f"dior diff: {error}", file=sys.stderr)
        return 2
    print(json.dumps(found, indent=1, ensure_ascii=False) if as_json else diff_text.of(found))
    return 0 if found["same"] else 1


def compared(first: Path, second: Path) -> Found:
    """Everything that differs, as a dict for JSON."""
    listed = [checksums.read(folder) for folder in (first, second)]
    found = {"first": first.resolve().name, "second": second.resolve().name, "same": listed[0] == listed[1]}
    if found["same"]:
        return found
    for folder, sums in zip((first, second), listed, strict=True):
        checksums.expect(folder, READ, sums)
        if wrong := of_other_version(folder / "sequences.parquet"):
            raise DiorError(f"{folder}: {wrong}")
    sheets = [_walks(folder) for folder in (first, second)]
    rigs = [_rows(folder / "cameras.parquet", "released_cameras", ("session", "camera")) for folder in (first, second)]
    cameras = _cameras(*rigs)
    recordings, skeletons = _tables(first, second, listed, sheets)
    why = causes.changes(causes.read(first), causes.read(second), {n: row["session"] for n, row in sheets[1].items()})
    rig = rigs[0] | rigs[1]
    for one in (*recordings, *skeletons):
        if one["change"] == "changed":
            where = _where(one, sheets[1][one["sequence"]], rig, cameras)
            one["because"] = [change.text for change in why if causes.can_touch(change, where)]
    names = [set(sheet) for sheet in sheets]
    return found | {
        "sequences": {"added": sorted(names[1] - names[0]), "removed": sorted(names[0] - names[1])},
        "cameras": cameras,
        "clocks": _clocks(first, second),
        "recordings": recordings,
        "skeletons": skeletons,
        "files": _files(*listed),
        "inputs": [change.text for change in why],
    }


def _rows(path: Path, name: str, keys: Sequence[str]) -> Rows:
    """Rows of a table as dicts by their key."""
    return {tuple(row[key] for key in keys): row for row in rows_of(tables.read(path, name))}


def _walks(folder: Path) -> dict[str, dict[str, Any]]:
    return {name: row for (name,), row in _rows(folder / "sequences.parquet", "sequences", ("sequence",)).items()}


def _where(one: Found, walk: dict[str, Any], rig: Rows, cameras: list[Found]) -> causes.ChangedRecording:
    session = walk["session"]
    posed = {camera["camera"] for camera in cameras if camera["session"] == session and camera.get("moved_mm")}
    posed |= {camera["camera"] for camera in cameras if camera["session"] == session and camera.get("turned_deg")}
    close = {camera for (where, camera), row in rig.items() if where == session and row["role"] == "close"}
    differ = TABLE.keys() & one.keys()
    if any(isinstance(one[kind], dict) and len(set(one[kind].get("suspect", ()))) > 1 for kind in differ):
        differ |= {causes.LIGHTS}
    sets = map(frozenset, (differ, close, posed))
    return causes.ChangedRecording(session, one["sequence"], one.get("camera", ""), walk["environment"], *sets)


def _cameras(first: Rows, second: Rows) -> list[Found]:
    """How each camera of each session changed, those that did."""
    found = []
    for key in sorted(first.keys() | second.keys()):
        where = dict(zip(("session", "camera"), key, strict=True))
        if key not in first or key not in second:
            found.append({**where, "change": "added" if key in second else "removed"})
            continue
        change = _camera(first[key], second[key])
        if change:
            found.append({**where, "change": "changed", **change})
    return found


def _camera(one: dict[str, Any], other: dict[str, Any]) -> Found:
    before, after = (row["wTc"].reshape(4, 4) for row in (one, other))
    change = {} if np.array_equal(before, after, equal_nan=True) else pose_change(before, after)
    for key in (*LENS, "role", "locate"):
        before, after = (np.asarray(row[key]).tolist() for row in (one, other))
        if not np.array_equal(one[key], other[key], equal_nan=key not in ("distortion_model", "role", "locate")):
            change[key] = [_plain(before), _plain(after)]
    if not np.array_equal(one["covariance"], other["covariance"], equal_nan=True):
        change["covariance"] = "changed"
    return change


def _clocks(first: Path, second: Path) -> list[Found]:
    """By how much the clock of each camera in each walk changed, those that did and that both releases have."""
    keys = ("sequence", "camera")
    one, other = (_rows(folder / "clocks.parquet", "released_clocks", keys) for folder in (first, second))
    found = []
    for key in sorted(one.keys() & other.keys()):
        a, b = one[key], other[key]
        change: Found = {
            "offset_ms": _rounded(1000 * (b["offset_s"] - a["offset_s"])),
            "drift_ppm": _rounded(b["drift_ppm"] - a["drift_ppm"]),
        }
        change |= {name: [a[name], b[name]] for name in ("source", "method") if a[name] != b[name]}
        if any(value != 0 for value in change.values()):
            found.append({**dict(zip(keys, key, strict=True)), "change": "changed", **change})
    return found


def _plain(value: Any) -> Any:
    """NaN is null in JSON."""
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if value != value else value


def pose_change(first: Floats, second: Floats) -> Found:
    """`moved_mm` and `turned_deg` between two poses (4, 4), m."""
    turn = first[:3, :3].T @ second[:3, :3]
    # half the angle by both of its sides: near 0 the arc cosine alone loses half the digits
    sine = np.linalg.norm(turn - turn.T) / np.sqrt(8)
    angle = np.arctan2(sine, (np.trace(turn) - 1) / 2)
    return {
        "moved_mm": _rounded(1000 * np.linalg.norm(second[:3, 3] - first[:3, 3])),
        "turned_deg": _rounded(np.rad2deg(angle)),
    }


def _rounded(value: float | np.floating[Any]) -> float | None:
    """Four digits, as nobody measures more; null for NaN."""
    return None if np.isnan(value) else float(f"{value:.4g}")


def _tables(
    first: Path, second: Path, listed: list[dict[str, str]], sheets: list[dict[str, dict[str, Any]]]
) -> tuple[list[Found], list[Found]]:
    """What differs in recordings (sequence, camera) and in the 3D of sequences, sorted."""
    places = [_places(digests) for digests in listed]
    keys = sorted(
        key
        for key in places[0].keys() | places[1].keys()
        if {kind: listed[0][path] for kind, path in places[0].get(key, {}).items()}
        != {kind: listed[1][path] for kind, path in places[1].get(key, {}).items()}
    )
    with ThreadPoolExecutor(checksums.THREADS) as pool:
        looked = pool.map(
            lambda key: _recording(key, (first, second), [place.get(key, {}) for place in places], listed, sheets), keys
        )
        found = list(reporting(looked, len(keys), "recordings", "diff"))
    return [one for one in found if one.get("camera")], [one for one in found if not one.get("camera")]


def _places(digests: dict[str, str]) -> dict[Place, dict[str, str]]:
    """Place -> kind -> path."""
    found: dict[Place, dict[str, str]] = {}
    for name in digests:
        kind, *rest = name.split("/")
        if len(rest) == 2 and kind in TABLE:
            sequence, _, camera = rest[1].removesuffix(".parquet").partition(".")
            found.setdefault((sequence, camera), {})[kind] = name
    return found


def _recording(
    key: Place,
    folders: tuple[Path, Path],
    paths: list[dict[str, str]],
    listed: list[dict[str, str]],
    sheets: list[dict[str, dict[str, Any]]],
) -> Found:
    """What differs in the tables of one camera of a walk, or of the walk itself."""
    sequence, camera = key
    found: Found = {"sequence": sequence} | ({"camera": camera} if camera else {})
    if not all(paths):
        return found | {"change": "added" if paths[1] else "removed"}
    found["change"] = "changed"
    subjects = [sheet[sequence]["subject"] for sheet in sheets if sequence in sheet]
    if len(set(subjects)) > 1:
        found["subject"] = subjects
    for kind in sorted(paths[0].keys() | paths[1].keys()):
        if kind not in paths[0] or kind not in paths[1]:
            found[kind] = "added" if kind in paths[1] else "removed"
        elif listed[0][paths[0][kind]] != listed[1][paths[1][kind]]:
            if kind not in LOOK:
                found[kind] = "changed"
                continue
            for folder, path, digests in zip(folders, paths, listed, strict=True):
                checksums.expect(folder, [path[kind]], digests)
            found[kind] = LOOK[kind](*(folder / path[kind] for folder, path in zip(folders, paths, strict=True)))
    return found


def _in_both(paths: tuple[Path, Path], name: str, key: str, columns: list[str]) -> tuple[Table, Table, Found]:
    """The rows that a table of two releases has in both, by `key` (frame or instant) and joint, in the same order, and
    how many there are and only one has."""
    first, second = (tables.read(path, name, ["joint", key, "stamp_ns", "status", *columns]) for path in paths)
    joints = sorted({*first["joint"], *second["joint"]})
    index = {joint: i for i, joint in enumerate(joints)}
    numbers = [
        table[key].astype(np.int64) * len(joints) + np.array([index[j] for j in table["joint"].tolist()], np.int64)
        for table in (first, second)
    ]
    common, one, other = np.intersect1d(numbers[0], numbers[1], assume_unique=True, return_indices=True)
    rows = {
        "rows": len(common),
        "rows_added": len(numbers[1]) - len(common),
        "rows_removed": len(numbers[0]) - len(common),
    }
    return tables.rows(first, one), tables.rows(second, other), rows


def labels(first: Path, second: Path) -> Found:
    """How the labels of one camera differ: `moved_px` of those in the picture in either, over rows that both have."""
    a, b, rows = _in_both((first, second), "labels_2d", "frame", ["u", "v", "sigma_u", "sigma_v"])
    distance = np.hypot(b["u"].astype(float) - a["u"], b["v"].astype(float) - a["v"])
    seen = np.isin(a["status"], IN_PICTURE) | np.isin(b["status"], IN_PICTURE)
    sigma = [np.hypot(table["sigma_u"].astype(float), table["sigma_v"]) for table in (a, b)]
    return rows | {"moved_px": _spread(distance[seen]), **_changes(a, b, distance[seen]), **_ratio(sigma)}


def skeleton(first: Path, second: Path) -> Found:
    """How the 3D of a walk differs: `moved_mm` of the points that both have."""
    a, b, rows = _in_both((first, second), "skeletons_3d", "instant", ["x", "y", "z"])
    distance = 1000 * np.linalg.norm([b[axis].astype(float) - a[axis] for axis in "xyz"], axis=0)
    return rows | {"moved_mm": _spread(distance), **_changes(a, b, distance)}


def _spread(distance: Floats) -> dict[str, float | None]:
    """Median, 95th percentile and largest of the distances (N,) that are known."""
    known = distance[np.isfinite(distance)]
    if not len(known):
        return dict.fromkeys(("median", "p95", "max"))
    return dict(zip(("median", "p95", "max"), map(_rounded, np.percentile(known, (50, 95, 100))), strict=True))


def _changes(a: Table, b: Table, distance: Floats) -> Found:
    """What else differs between the same rows of two tables; `distance` (N,): how far those that count moved."""
    ticks = np.abs(b["stamp_ns"] - a["stamp_ns"]).max(initial=0)
    return {
        "moved_share": _share(distance[np.isfinite(distance)] > 0),
        "status_changed_share": _share(a["status"] != b["status"]),
        "suspect": [int((table["status"] == "suspect").sum()) for table in (a, b)],
        "stamps_moved_ms": _rounded(ticks / 1e6),
    }


def _share(flags: Bools) -> float | None:
    return _rounded(flags.mean()) if len(flags) else None


def _ratio(sigma: list[Floats]) -> Found:
    """By how much labels became more (below 1) or less sure, where both say so."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = sigma[1] / sigma[0]
    ratio = ratio[np.isfinite(ratio)]
    return {"sigma_ratio": _rounded(np.median(ratio)) if len(ratio) else None}


def pictures(first: Path, second: Path) -> Found:
    """How many frames and pictures of one camera differ."""
    one, other = (_digests(path) for path in (first, second))
    common = one.keys() & other.keys()
    return {
        "frames_added": len(other.keys() - one.keys()),
        "frames_removed": len(one.keys() - other.keys()),
        "stamps_changed": sum(one[frame][0] != other[frame][0] for frame in common),
        "pictures": sum(one[frame][1] is not None and other[frame][1] is not None for frame in common),
        "pictures_changed": sum(None not in (one[f][1], other[f][1]) and one[f][1] != other[f][1] for f in common),
        "pictures_added": sum(one[frame][1] is None and other[frame][1] is not None for frame in common),
        "pictures_removed": sum(one[frame][1] is not None and other[frame][1] is None for frame in common),
        "no_image": _reasons(one, other),
    }


def _reasons(one: Digests, other: Digests) -> dict[str, list[int]]:
    """How many pictures there are not for each reason, before and after, where that differs."""
    counts = [Counter(reason for *_, reason in digests.values() if reason) for digests in (one, other)]
    return {r: [n[r] for n in counts] for r in sorted(counts[0] | counts[1]) if counts[0][r] != counts[1][r]}


def _digests(path: Path) -> Digests:
    """Frame -> (stamp, digest of its picture or None, reason for none), a few pictures in memory at a time."""
    found = {}
    columns = ["frame", "stamp_ns", "image", "no_image"]
    for table in tables.read_in_parts(path, "released_frames", columns, PICTURES_AT_ONCE):
        for frame, stamp, data, why in zip(*(table[column].tolist() for column in columns), strict=True):
            found[frame] = (stamp, data and hashlib.blake2b(data, digest_size=16).digest(), why)
    return found


LOOK = {"labels_2d": labels, "skeletons_3d": skeleton, "frames": pictures}


def _files(first: dict[str, str], second: dict[str, str]) -> dict[str, list[str]]:
    """Files about the whole release that differ, but for the lists of checksums."""
    names = sorted(name for name in first.keys() | second.keys() if "/" not in name)
    return {
        "added": [name for name in names if name not in first],
        "removed": [name for name in names if name not in second],
        "changed": [name for name in names if name in first and name in second and first[name] != second[name]],
    }
