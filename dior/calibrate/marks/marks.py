"""Hand-marked 3D-2D pairs of one camera.

INPUTS   config/sessions/<session>/<camera>.marks.csv: `sequence,frame,joint,u,v` and optionally `x,y,z`
         frames, mocap and offsets of the sequences in it
OUTPUTS  marks with their world points: recorded pixels, metres in the world frame

Without xyz, `joint` is a C3D marker, taken at the picture's own stamp plus the camera's offset and interpolated
linearly between two ticks of the mocap, never across a gap.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Bools, Floats, Ints, Texts
from dior.calibrate.marks.pnp import Mark
from dior.clocks.axis import sample, seconds
from dior.errors import DiorError, Faults, nearest
from dior.geometry.camera import Camera, Intrinsics, in_frame, project
from dior.project.boxes import FAR_PX
from dior.project.pixels import in_picture
from dior.project.plain_text import rows_of
from dior.tables import tables
from dior.tables.tables import Finding

COLUMNS = ("sequence", "frame", "joint", "u", "v")
WORLD = ("x", "y", "z")
FAR_M = 1e5  # chosen: no point that is marked is 100 km away
MOST_DIGITS = 9  # of a frame's number
MANY_LOST = 0.2  # chosen: of the marks, for a warning and no mere information


# by sequence, of one camera: frame numbers and stamps in ns
Stamps: TypeAlias = Mapping[str, tuple[Ints, Ints]]
# a line of the CSV: sequence, frame, joint, line, uv, xyz
Line: TypeAlias = tuple[str, int, str, int, tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class Marks:
    """N marks: `sequence`, `joint` (N,) text, `frame`, `line` (N,) int, `uv` (N, 2) px, `xyz` (N, 3) m or NaN."""

    sequence: Texts
    frame: Ints
    joint: Texts
    line: Ints
    uv: Floats
    xyz: Floats

    def __len__(self) -> int:
        return len(self.frame)

    def only(self, keep: Bools | Ints) -> "Marks":
        """The marks where the mask `keep` (N,) is true."""
        return Marks(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))


def read(path: AnyPath) -> Marks:
    """Marks of a CSV file; `xyz` is NaN where the file has none.

    Raises DiorError that names the file and the line: no such file, wrong columns; for all lines together a value that
    is no number, a part of xyz only, the same joint marked twice on a frame.
    """
    path = Path(path)
    if not path.is_file():
        raise DiorError(f"{path}: there is no such file; mark at least 4 points or choose another `locate`")
    (_, header), *lines = rows_of(path, path) or [(1, [""])]
    _check_header(path, header)
    rows: list[Line] = []
    first: dict[tuple[str, int, str], int] = {}
    faults = Faults()
    for number, cells in lines:
        with faults.kept():
            row = _row(f"{path} line {number}", number, header, cells)
            key = row[0], row[1], row[2]
            if key in first:
                raise DiorError(
                    f"{path} line {number}: {key[2]} on frame {key[1]} of {key[0]} is marked already on line "
                    f"{first[key]}"
                )
            first[key] = number
            rows.append(row)
    faults.tell()
    sequence, frame, joint, line, uv, xyz = zip(*rows, strict=True) if rows else ((),) * 6
    return Marks(
        np.array(sequence, object),
        np.array(frame, np.int64),
        np.array(joint, object),
        np.array(line, np.int64),
        np.array(uv, float).reshape(-1, 2),
        np.array(xyz, float).reshape(-1, 3),
    )


def _check_header(path: AnyPath, header: Sequence[str]) -> None:
    for name in header:
        if name not in COLUMNS + WORLD:
            raise DiorError(f"{path}: unknown column '{name}'{nearest(name, COLUMNS + WORLD)}")
        if header.count(name) > 1:
            raise DiorError(f"{path}: column '{name}' is there twice")
    missing = [name for name in COLUMNS if name not in header]
    missing += [name for name in WORLD if name not in header and set(WORLD) & set(header)]
    if missing:
        raise DiorError(f"{path}: column '{missing[0]}' is missing; the header is sequence,frame,joint,u,v[,x,y,z]")


def _row(where: str, line: int, header: Sequence[str], words: Sequence[str]) -> Line:
    if len(words) != len(header):
        raise DiorError(f"{where}: has {len(words)} cells where the header has {len(header)}")
    cells = dict(zip(header, words, strict=True))
    if not cells["sequence"] or not cells["joint"]:
        raise DiorError(f"{where}: sequence or joint is empty")
    if not cells["frame"].isdecimal() or len(cells["frame"]) > MOST_DIGITS:
        raise DiorError(f"{where}: frame is '{cells['frame']:.40}', not a whole number from 0")
    given = [name for name in WORLD if cells.get(name)]
    if given and len(given) < 3:
        raise DiorError(f"{where}: give all of x,y,z or none (only {','.join(given)} is there)")
    uv = tuple(_number(where, name, cells[name], FAR_PX) for name in ("u", "v"))
    xyz = tuple(_number(where, name, cells[name], FAR_M) for name in WORLD) if given else (np.nan,) * 3
    return cells["sequence"], int(cells["frame"]), cells["joint"], line, uv, xyz


def _number(where: str, name: str, text: str, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise DiorError(f"{where}: {name} is '{text:.40}', not a number")
    if abs(value) > most:
        raise DiorError(f"{where}: {name} is {value:.6g}, which no mark is; is a decimal point lost?")
    return value


@dataclass(frozen=True, eq=False)
class Motion:
    """Markers of one sequence: `t` (I,) s after the first stored frame, `t0_ns`, `xyz` (I, J, 3) m, `joints`."""

    t: Floats
    t0_ns: int
    xyz: Floats
    joints: list[str]


def read_motion(path: AnyPath) -> tuple[str, Motion]:
    """Markers of a mocap table (`skeletons_3d`): the sequence's name and a `Motion`."""
    table = tables.read(path, "skeletons_3d", ["sequence", "joint", "instant", "stamp_ns", *WORLD])
    xyz, joints = tables.grid(table, *WORLD)
    if not joints:
        raise DiorError(f"{path}: the mocap table is empty")
    stamps = table["stamp_ns"][:: len(joints)]
    return table["sequence"][0], Motion((stamps - stamps[0]) / 1e9, int(stamps[0]), xyz, joints)


def times(
    marks: Marks, path: AnyPath, camera: str, intrinsics: Intrinsics, motions: Mapping[str, Motion], stamps: Stamps
) -> Floats:
    """Seconds (N,) from the start of the mocap to the picture by the camera's clock as it is; NaN for marks with xyz.

    `motions`: sequence -> Motion; `stamps`: sequence -> (frame numbers, stamps in ns) of this camera. Raises DiorError
    for a sequence, frame or marker that is not there and a mark outside the picture.
    """
    t = np.full(len(marks), np.nan)
    for i in range(len(marks)):
        where = f"{path} line {marks.line[i]}"
        sequence, joint = marks.sequence[i], marks.joint[i]
        stamp = _stamp(where, stamps, sequence, marks.frame[i], camera)
        check_inside(where, marks.uv[i], intrinsics.width, intrinsics.height)
        if np.isfinite(marks.xyz[i]).all():
            continue
        if sequence not in motions:
            raise DiorError(f"{where}: sequence '{sequence}' has no mocap, so the mark needs x,y,z")
        motion = motions[sequence]
        if joint not in motion.joints:
            raise DiorError(f"{where}: '{joint}' is not a marker of {sequence}{nearest(joint, motion.joints)}")
        t[i] = seconds(stamp, motion.t0_ns)
    return t


def check_inside(where: str, uv: Floats, width: int, height: int) -> None:
    """Refuse a mark at a pixel `uv` (2,) that its picture does not have."""
    if not in_picture(uv, width, height):
        raise DiorError(f"{where}: ({uv[0]:g}, {uv[1]:g}) is outside of the {width}x{height} picture")


def in_world(
    marks: Marks,
    path: AnyPath,
    camera: str,
    intrinsics: Intrinsics,
    motions: Mapping[str, Motion],
    stamps: Stamps,
    clocks: Mapping[str, Sequence[Any]],
    scope: str,
) -> tuple[Marks, list[Finding]]:
    """Marks with their world points, and findings for those that were dropped.

    `clocks`: sequence -> (offset_s, drift_ppm, ...) of this camera; the rest as of `times`, which raises. A mark whose
    marker is missing at its time is dropped.
    """
    t, xyz = times(marks, path, camera, intrinsics, motions, stamps), marks.xyz.copy()
    for i in np.flatnonzero(np.isfinite(t)):
        motion = motions[marks.sequence[i]]
        offset_s, drift_ppm = clocks[marks.sequence[i]][:2]
        at = np.array([t[i] * (1 + 1e-6 * drift_ppm) + offset_s])
        xyz[i] = sample(motion.t, motion.xyz[:, motion.joints.index(marks.joint[i])], at, longest_step(motion))[0]
    known = np.asarray(np.isfinite(xyz).all(axis=1))
    findings = _without_marker(marks, known, path, scope)
    return replace(marks, xyz=xyz).only(known), findings


def unmarked(
    marks: Marks, camera: Camera, motions: Mapping[str, Motion], stamps: Stamps, clocks: Mapping[str, Sequence[Any]]
) -> list[Mark]:
    """`pnp.Mark` of every marker that is in the picture and not marked, on the frames that have marks.

    Whether the body hides it is not known. Arguments as of `in_world`.
    """
    found = []
    for sequence, frame in dict.fromkeys(zip(marks.sequence, marks.frame.tolist(), strict=True)):
        if sequence not in motions:
            continue
        motion = motions[sequence]
        at = seconds(_stamp("marks", stamps, sequence, frame, camera.name), motion.t0_ns, *clocks[sequence][:2])
        xyz = sample(motion.t, motion.xyz, np.array([at]), longest_step(motion))[0]
        uv, depth = project(camera, xyz)
        there = marks.joint[(marks.sequence == sequence) & (marks.frame == frame)]
        for j, joint in enumerate(motion.joints):
            if np.isfinite(uv[j]).all() and depth[j] > 0 and in_frame(camera.intrinsics, uv[j]) and joint not in there:
                found.append(Mark(sequence, frame, joint, xyz[j]))
    return found


def _without_marker(marks: Marks, known: Bools, path: AnyPath, scope: str) -> list[Finding]:
    """One finding for the marks that are not `known` (N,), since their marker being missing in the mocap."""
    lost = np.flatnonzero(~known)
    if not len(lost):
        return []
    each = (f"line {marks.line[i]} {marks.joint[i]}, frame {marks.frame[i]} of {marks.sequence[i]}" for i in lost)
    severity = "warning" if len(lost) > MANY_LOST * len(known) else "info"
    text = f"{len(lost)} of {len(known)} marks are not used, their markers are missing in the mocap there"
    return [(scope, severity, "mark_without_marker", f"{path}: {text} ({'; '.join(each)})")]


def _stamp(where: str, stamps: Stamps, sequence: str, frame: int, camera: str) -> int:
    if sequence not in stamps:
        raise DiorError(f"{where}: '{sequence}' is not a sequence of this session{nearest(sequence, stamps)}")
    frames, ns = stamps[sequence]
    found = np.flatnonzero(frames == frame)
    if not len(found):
        last = f"its last is {frames.max()}" if len(frames) else "it has none"
        raise DiorError(f"{where}: {camera} has no frame {frame} in {sequence} ({last})")
    return ns[found[0]]


def longest_step(motion: Motion) -> float:
    """1.5 ticks: neighbouring ticks are joined, a gap in the ticks is not."""
    return 1.5 * np.median(np.diff(motion.t)) if len(motion.t) > 1 else 0.0
