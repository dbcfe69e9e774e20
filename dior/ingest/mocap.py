"""Markers of a C3D, TSV, CSV or TRC file on the clock of the pictures.

INPUTS   a file of `mocap_files` (Vicon Plug-in-Gait labels, four or more of them, any order, other points ignored),
         what session.yaml says of it under `mocap`, a lab's own names of the markers (config/markers.tsv) if there are
         any, the sequence's `frames` table, and the log of `dior trigger` where there is one.
OUTPUTS  `skeletons_3d` table: the markers of `names.PLUG_IN_GAIT_39` that the file has, in that order, then those that
         the sheet makes joints of their own, in its order; world of the file turned Z up, metres. An instant is a tick
         of the file, counted from 0 at the first frame stored; its stamp_ns is t0 + instant / rate. t0 is decided here
         for all steps: when the trigger log says that the first frame stored was taken, or the earliest picture stamp
         of the sequence where there is no log. A gap is null with `too_few_views`. Metadata: rate_hz, first_frame
         (number of the first frame stored, as the C3D counts, from 1; 0 where it contradicts itself), t0_from
         (trigger_log | pictures).
         `findings`: what was taken for what, where the file does not say it by itself.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Floats, Ints
from dior.body import marker_checks
from dior.body.names import PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.ingest import marker_names, mocap_files
from dior.ingest.mocap_files.capture import Capture
from dior.project import prefixes
from dior.tables import tables

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
# as some writers spell them out
SPELLED = {
    f"{prefix}met{ending}{plural}": f"{prefix[:1]}m" if prefix else "m"
    for prefix in ("milli", "centi", "")
    for ending in ("er", "re")
    for plural in ("", "s")
}
# the turn that makes an axis of the C3D the world's Z
UP = {
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
}
# Hz; chosen: beyond any motion capture
RATES = (1.0, 10_000.0)
# chosen: in a smaller share of the frames a marker has the wrong label, which is corrected by hand
FEW = 0.1


@dataclass(frozen=True, eq=False)
class Mocap:
    """`points` (frames, markers, 3) m, NaN in gaps; `rate` Hz; `first_frame` as the C3D counts, from 1, 0 where it
    contradicts itself; `said`: (severity, code, text) of findings."""

    markers: tuple[str, ...]
    points: Floats
    rate: float
    first_frame: int
    said: tuple[tuple[str, str, str], ...] = ()


def run(
    *,
    sequence: str,
    subject: str,
    c3d: Path,
    frames: Path,
    trigger_log: Path | None,
    out: Path,
    capture: str = "",
    units: str = "",
    up: str = "",
    people: Path | None = None,
    session_file: Path | None = None,
    names: Path | None = None,
    findings: Path | None = None,
) -> None:
    """Write the markers of `c3d`. `capture`: its name in the trigger log where it is not the file's, else "";
    `units`: mm, cm or m, where the file does not say it or says it wrongly; `up`: its vertical axis, x, y or z, where
    the file does not say it or says it wrongly; `people`, `session_file`: subjects.tsv and session.yaml, which tell
    what the subject's labels begin with where the file holds several subjects; `names`: markers.tsv, if there is one.

    See the module's docstring.
    """
    if up and up not in UP:
        raise DiorError(f"{sequence}: the axis '{up}' is none of {', '.join(UP)}")
    stamps = tables.read(frames, "frames", ["stamp_ns"])["stamp_ns"]
    if not len(stamps):
        raise DiorError(f"{sequence}: {frames} has no picture, so the mocap has no start")
    name, prefix = prefixes.name_and_prefix(subject, people, session_file) if people and session_file else ("", "")
    named = marker_names.sheet(names, mocap_files.recognise(c3d)) if names and c3d.is_file() else {}
    mocap = read(c3d, name, units, up, prefix, named)
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
    if findings:
        tables.write_findings(findings, [(sequence, *finding) for finding in mocap.said])


def start_by_log(log: Path, capture: str, c3d: AnyPath, mocap: Mocap, stamps: Ints) -> int:
    """Time (ns) of the first frame stored by the trigger log, for pictures with `stamps` (F,).

    Nexus counts frames from 1 at the start of the capture; a C3D of a part of it begins later.
    """
    from dior.ingest import trigger_log

    if not mocap.first_frame:
        raise DiorError(
            f"{c3d}: its header's first and last frame are not those of the {len(mocap.points)} frames stored, so the "
            "trigger log cannot tell when they were taken; export it again"
        )
    found = trigger_log.choose(
        trigger_log.read(log), int(stamps.min()), int(stamps.max()), log, name=capture, c3d=Path(c3d).name
    )
    return found.start_ns + round((mocap.first_frame - 1) * 1e9 / mocap.rate)


def read(
    path: AnyPath,
    subject: str = "",
    units: str = "",
    up: str = "",
    prefix: str = "",
    named: Mapping[str, str] = marker_names.NOTHING,
) -> Mocap:
    """The Plug-in-Gait markers of a file, and a lab's own, as `Mocap`. `subject` as in the sheet; `named`: as of
    `marker_names.sheet`; the others as for `run`.

    Raises DiorError for a missing or broken file, one that is not what it says of itself, an unknown unit, a rate that
    is not positive, a marker given twice, too few markers, and markers that are on no upright body.
    """
    kind, about, found = labelled(path, subject, prefix, named)
    markers = tuple(marker for marker in dict.fromkeys((*PLUG_IN_GAIT_39, *named.values())) if marker in found.place)
    try:
        xyz = about.points([found.place[marker] for marker in markers])
    except (OSError, ValueError) as error:
        raise DiorError(f"{path}: not a readable {mocap_files.READERS[kind].tool} ({error})") from None
    scale = METRES[units or unit_of(about, path, kind)]
    # a point whose residual is negative is invalid, whatever its coordinates (user guide of c3d.org): ezc3d gives NaN
    gap = ~np.isfinite(xyz).all(axis=-1) | (xyz == 0).all(axis=-1)
    if gap.all():
        raise DiorError(f"{path}: no frame has any of its markers; were they reconstructed before the export?")
    points = np.where(gap[..., None], np.nan, xyz * scale)
    chosen = up or _vertical(about, points, markers)
    said = list(found.said)
    if chosen != "z" and not up:
        text = f"its {chosen} axis is the vertical one, as its format or itself says: the markers are turned Z up"
        said.append(("info", "mocap_turned", text))
    mocap = Mocap(markers, points @ np.array(UP[chosen], float).T, about.rate, about.first, tuple(said))
    _check_body(mocap, path, scale, chosen)
    return mocap


def labelled(
    path: AnyPath, subject: str = "", prefix: str = "", named: Mapping[str, str] = marker_names.NOTHING
) -> tuple[str, Capture, marker_names.Found]:
    """(its key in mocap_files.READERS, what it says, its markers) of a file, whose coordinates are not read of a C3D.

    Arguments and errors as of `read`.
    """
    kind, about = mocap_files.read(path)
    if not RATES[0] <= about.rate <= RATES[1]:
        raise DiorError(
            f"{path}: {mocap_files.READERS[kind].rate} is {about.rate:g}; it needs its frame rate, so export it again"
        )
    return kind, about, marker_names.find(about.labels, path, subject, prefix, named)


def _vertical(about: Capture, points: Floats, markers: tuple[str, ...]) -> str:
    """The vertical axis of markers (T, M, 3) as the file says, or Z where it does not or where the body does not stand
    along that axis."""
    if not about.up:
        return "z"
    along = marker_checks.axis_up(points, markers)
    lean = math.degrees(math.acos(min(max(float(along["xyz".index(about.up)]), -1.0), 1.0)))
    return "z" if lean > marker_checks.UPRIGHT_DEG else about.up


def unit_of(about: Capture, path: AnyPath, kind: str) -> str:
    """The unit that a file says it has. Raises DiorError where it says none that is known."""
    unit = SPELLED.get(about.units.lower(), about.units.lower())
    if unit not in METRES:
        says = f"is '{about.units}', not one of {', '.join(METRES)}" if about.units else "is empty"
        what = mocap_files.READERS[kind].units
        raise DiorError(f"{path}: {what} {says}; set `mocap: {{units: mm}}`, or what it is, in session.yaml")
    return unit


def _check_body(mocap: Mocap, path: AnyPath, scale: float, up: str) -> None:
    """Refuse markers that no upright body of human size can have."""
    power = marker_checks.power_of_ten(mocap.points, mocap.markers)
    unit, right = (
        next((unit for unit, metres in METRES.items() if math.isclose(metres, size)), "")
        for size in (scale, scale / 10.0 ** (power or 0))
    )
    if power and right:
        raise DiorError(
            f"{path}: the body is {10.0**power:g} times as large as a person, so its unit is not {unit}; set "
            f"`mocap: {{units: {right}}}` in session.yaml"
        )
    odd = marker_checks.stretched(mocap.points, mocap.markers)
    odd = odd or marker_checks.flying(mocap.points, mocap.markers, mocap.rate)
    if odd:
        others = f" and {odd.frames - 1} others" if odd.frames > 1 else ""
        fix = "correct its label there, or delete it, a gap is no harm"
        if odd.frames > FEW * len(mocap.points):
            fix = "the file is damaged, or the markers are labelled wrongly; export it again"
        raise DiorError(f"{path}: {odd.text} in frame {max(mocap.first_frame, 1) + odd.frame}{others}; {fix}")
    if power:
        raise DiorError(f"{path}: the body is {10.0**power:g} times as large as a person; export it again")
    _check_vertical(marker_checks.axis_up(mocap.points, mocap.markers), path, up)


def _check_vertical(along: Floats, path: AnyPath, up: str) -> None:
    """Refuse a body that stands along another axis; `along` as of `axis_up`, turned by `up` already."""
    own = np.degrees(np.arccos(np.array(UP[up], float).T @ along))
    lean = own["xyz".index(up)]
    if not lean > marker_checks.UPRIGHT_DEG:
        return
    axis = "xyz"[int(own.argmin())]
    if own.min() < marker_checks.ALONG_DEG:
        fix = f"but along {axis}; set `mocap: {{up: {axis}}}` in session.yaml"
    else:
        fix = f"it leans by {lean:.0f} degrees from it; export it with Z up"
    raise DiorError(f"{path}: the body does not stand along the {up} axis, {fix}")
