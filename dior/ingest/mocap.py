"""Markers of a C3D file on the clock of the pictures.

INPUTS   a C3D (Vicon Plug-in-Gait labels, four or more of them, any order, other points ignored), the sequence's
         `frames` table, and the log of `dior trigger` where there is one.
OUTPUTS  `skeletons_3d` table: the markers of `skeletons.PLUG_IN_GAIT_39` that the file has, in that order, world of the
         C3D (Z up), metres. An instant is a tick of the C3D, counted from 0 at the first frame stored; its stamp_ns is
         t0 + instant / rate. t0 is decided here for all steps: when the trigger log says that the first frame stored
         was taken, or the earliest picture stamp of the sequence where there is no log. A gap is null with
         `too_few_views`. Metadata: rate_hz, first_frame (number of the first frame stored, as the C3D counts, from 1),
         t0_from (trigger_log | pictures).
"""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats, Ints
from dior.body.names import PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.ingest.c3d_check import MIPS, check_parameters
from dior.tables import tables

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
# chosen: a file with fewer labels of the 39 is of another marker set, or of none
FEWEST = 4


@dataclass(frozen=True, eq=False)
class Mocap:
    """`points` (frames, markers, 3) m, NaN in gaps; `rate` Hz; `first_frame` as the C3D counts, from 1."""

    markers: tuple[str, ...]
    points: Floats
    rate: float
    first_frame: int


def run(
    *,
    sequence: str,
    subject: str,
    c3d: Path,
    frames: Path,
    trigger_log: Path | None,
    out: Path,
    capture: str = "",
) -> None:
    """Write the markers of `c3d`. `capture`: its name in the trigger log where it is not the C3D's, else "".

    See the module's docstring.
    """
    stamps = tables.read(frames, "frames", ["stamp_ns"])["stamp_ns"]
    if not len(stamps):
        raise DiorError(f"{sequence}: {frames} has no picture, so the mocap has no start")
    mocap = read(c3d)
    instants, joints = mocap.points.shape[:2]
    instant = np.arange(instants)
    t0 = start_by_log(trigger_log, capture, c3d, mocap, stamps) if trigger_log else int(stamps.min())
    stamp_ns = t0 + np.rint(instant * 1e9 / mocap.rate).astype(np.int64)
    xyz = mocap.points.reshape(-1, 3)
    rows = len(xyz)
    columns: dict[str, tables.Column] = {
        "subject": tables.Repeated([subject], np.zeros(rows)),
        "sequence": tables.Repeated([sequence], np.zeros(rows)),
        "joint": tables.Repeated(mocap.markers, np.tile(np.arange(joints), instants)),
        "instant": np.repeat(instant, joints),
        "stamp_ns": np.repeat(stamp_ns, joints),
        "x": xyz[:, 0],
        "y": xyz[:, 1],
        "z": xyz[:, 2],
        "status": tables.Repeated(["ok", "too_few_views"], np.isnan(xyz[:, 0])),
    }
    metadata = {
        "rate_hz": repr(mocap.rate),
        "first_frame": str(mocap.first_frame),
        "t0_from": "trigger_log" if trigger_log else "pictures",
    }
    tables.write(out, "skeletons_3d", columns, metadata)


def start_by_log(log: Path, capture: str, c3d: AnyPath, mocap: Mocap, stamps: Ints) -> int:
    """Time (ns) of the first frame stored by the trigger log, for pictures with `stamps` (F,).

    Nexus counts frames from 1 at the start of the capture; a C3D of a part of it begins later.
    """
    from dior.ingest import trigger_log

    found = trigger_log.choose(
        trigger_log.read(log), int(stamps.min()), int(stamps.max()), log, name=capture, c3d=Path(c3d).name
    )
    return found.start_ns + round((mocap.first_frame - 1) * 1e9 / mocap.rate)


def read(path: AnyPath) -> Mocap:
    """The Plug-in-Gait markers of a C3D file as `Mocap`.

    Raises DiorError for a missing or broken file, an unknown unit, a rate that is not positive, a marker given twice,
    and too few markers.
    """
    import ezc3d

    if not Path(path).is_file():
        raise DiorError(f"{path}: there is no such C3D; check `mocap` in sequences.tsv and `data_root`")
    try:
        check_parameters(path)
        c3d = ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError, IndexError) as error:
        raise DiorError(f"{path}: not a readable C3D ({str(error).splitlines()[0]})") from None
    parameters, header = c3d["parameters"]["POINT"], c3d["header"]["points"]
    points = c3d["data"]["points"]
    stored, declared = points.shape[2], _declared_frames(path)
    if not stored or stored < declared:
        raise DiorError(f"{path}: the C3D holds {stored} of its {declared} frames; it is cut off, so copy it again")
    scale = _metres(parameters, path)
    rate = _number(parameters, "RATE") or float(header["frame_rate"])
    if not rate > 0:
        raise DiorError(f"{path}: POINT:RATE is {rate}; a C3D needs its frame rate")
    found = _find_markers(_labels(parameters)[: points.shape[1]], path)
    index = [found[marker] for marker in PLUG_IN_GAIT_39 if marker in found]
    xyz = points[:3, index].transpose(2, 1, 0)
    # a point whose residual is negative is invalid, whatever its coordinates (user guide of c3d.org): ezc3d gives NaN
    gap = ~np.isfinite(xyz).all(axis=-1) | (xyz == 0).all(axis=-1)
    markers = tuple(marker for marker in PLUG_IN_GAIT_39 if marker in found)
    # ezc3d counts frames from 0 where the file counts from 1
    return Mocap(markers, np.where(gap[..., None], np.nan, xyz * scale), rate, int(header["first_frame"]) + 1)


def _declared_frames(path: AnyPath) -> int:
    """Number of frames that the header announces, 0 where it cannot say (its numbers end at 65535).

    ezc3d corrects its header to what it found, so a file that is cut off shows in the file's own bytes only.
    """
    with open(path, "rb") as stream:
        header = stream.read(512)
        stream.seek(512 * (header[0] - 1) + 3)
        processor = stream.read(1)
    first, last = struct.unpack_from(">2H" if processor == bytes([MIPS]) else "<2H", header, 6)
    return last - first + 1 if first <= last < 65535 else 0


def _number(parameters: dict[str, Any], key: str) -> float:
    values = np.ravel(parameters[key]["value"]) if key in parameters else np.array([])
    return float(values[0]) if len(values) else 0.0


def _metres(parameters: dict[str, Any], path: AnyPath) -> float:
    values = parameters["UNITS"]["value"] if "UNITS" in parameters else []
    unit = values[0].strip() if len(values) else ""
    if unit.lower() not in METRES:
        raise DiorError(f"{path}: POINT:UNITS is '{unit}', not one of {', '.join(METRES)}; export it again with one")
    return METRES[unit.lower()]


def _labels(parameters: dict[str, Any]) -> list[str]:
    """All labels in the order of the points; past 255 points they go on in LABELS2, LABELS3, ..."""
    labels: list[str] = []
    number = 1
    while (key := f"LABELS{number}" if number > 1 else "LABELS") in parameters:
        labels += [label.strip() for label in parameters[key]["value"]]
        number += 1
    return labels


def _find_markers(labels: list[str], path: AnyPath) -> dict[str, int]:
    """Index of each marker among the labels: dict marker -> index. A prefix up to a colon is the subject's name."""
    found: dict[str, int] = {}
    for i, label in enumerate(labels):
        marker = label.rpartition(":")[2].strip()
        if marker not in PLUG_IN_GAIT_39:
            continue
        if marker in found:
            raise DiorError(
                f"{path}: the labels '{labels[found[marker]]}' and '{label}' are both the marker {marker}; "
                "export one subject per C3D"
            )
        found[marker] = i
    if len(found) < FEWEST:
        there = ", ".join(labels[:20]) + (f" and {len(labels) - 20} more" if len(labels) > 20 else "") or "none"
        raise DiorError(
            f"{path}: {len(found)} of the {len(PLUG_IN_GAIT_39)} Plug-in-Gait markers are there, and fewer than "
            f"{FEWEST} are no such marker set; its labels are {there}. Were they labelled before the export?"
        )
    return found
