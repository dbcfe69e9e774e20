"""The joints that the adjustment of a session uses: the detections at the instants of its window.

INPUTS   detections, frames and offsets of the window's sequences, hand marks of the close cameras
OUTPUTS  recorded pixels of every joint at every instant, which joint, instant and sequence they are; marked points
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats, Ints, Table
from dior.calibrate.bundle import facts
from dior.calibrate.bundle.uncertainty import Tracks
from dior.calibrate.clock import from_cameras
from dior.calibrate.marks import marks as hand_marks
from dior.clocks import lag
from dior.clocks.axis import camera_seconds, rates, start_ns
from dior.errors import DiorError
from dior.geometry.camera import Camera
from dior.tables import tables

MOST_OTHERS = 0.5  # of the pictures; chosen: half of a walk tells poses and clocks nearly as well as all of it


@dataclass(frozen=True, eq=False)
class InWindow:
    """`uv` (V, N, 2) recorded px of N joints: `joint` (N,) index into `names`, `instant` (N,) of the window.

    `seconds` (T,): the instants' times.
    """

    uv: Floats
    joint: Ints
    instant: Ints
    names: tuple[str, ...]
    seconds: Floats

    @property
    def count(self) -> int:
        """How many instants take part."""
        return len(np.unique(self.instant))


@dataclass(frozen=True)
class Recorded:
    """What every camera has of a sequence: `seen` of each of the V cameras; instants are 1/`fps` s apart."""

    seen: tuple[from_cameras.TimedDetections, ...]
    names: tuple[str, ...]
    fps: float


def recorded(
    cameras: Sequence[Camera],
    detections: Table,
    frames: Table,
    min_score: float,
    max_gap: float,
    where: str,
    most_s: float = lag.WINDOW_S,
) -> Recorded:
    """`Recorded` of one sequence: the pixels with a score above `min_score`; `max_gap` in nominal frame periods,
    `most_s` how far the clocks may be off."""
    t0 = start_ns(frames)
    own, fps = rates(frames, [camera.name for camera in cameras])
    seen = []
    for camera in cameras:
        times = camera_seconds(frames, camera.name, t0, (0.0, 0.0))
        uv, joints = confident(detections, camera.name, len(times), min_score, where)
        seen.append(from_cameras.TimedDetections(times, uv, max_gap / own[camera.name], most_s))
    return Recorded(tuple(seen), tuple(joints), fps)


def alone(found: Recorded, cameras: Sequence[Camera], everybody: Table) -> tuple[Recorded, int]:
    """The same without what is detected in pictures of more than one person, and how many of these there are: who is
    the subject was guessed camera by camera, and where two people walk two cameras may have two subjects.

    `everybody`: table `detected_people` of the sequence.
    """
    seen, left_out = [], 0
    for camera, own in zip(cameras, found.seen, strict=True):
        mine = tables.of_camera(everybody, camera.name)
        frame, _ = np.unique(np.stack([mine["frame"], mine["person"]]), axis=1)
        several = np.bincount(frame, minlength=len(own.uv)) > 1
        left_out += int(several.sum())
        seen.append(replace(own, uv=np.where(several[:, None, None], np.nan, own.uv)))
    return replace(found, seen=tuple(seen)), left_out


def are_few(left_out: int, found: Sequence[Recorded]) -> bool:
    """Whether enough is left without so many pictures of the sequences."""
    return left_out <= MOST_OTHERS * sum(len(own.uv) for one in found for own in one.seen)


def confident(detections: Table, camera: str, count: int, min_score: float, where: str) -> tuple[Floats, list[str]]:
    """Pixels (F, J, 2) of a camera's detections, NaN where the score is at most `min_score`, and the joint names.

    Raises DiorError where they are not of its `count` pictures.
    """
    values, joints = tables.grid(tables.of_camera(detections, camera), "u", "v", "score")
    if len(values) != count:
        raise DiorError(
            f"{where}, {camera}: detections of {len(values)} frames but {count} pictures; run the step detections again"
        )
    with np.errstate(invalid="ignore"):
        return np.where(values[..., 2:] > min_score, values[..., :2], np.nan), joints


def observations(
    cameras: Sequence[Camera],
    detections: Table,
    frames: Table,
    clock: Mapping[str, Sequence[Any]],
    window: dict[str, int],
    min_score: float,
    min_views: int,
    max_gap: float,
    where: str,
) -> InWindow:
    """`InWindow` of one sequence: the joints at the instants of `window`.

    `detections` and `frames` are tables, `clock` from `by_hand.read`, `max_gap` in nominal frame periods. A joint at
    an instant is kept where its score is above `min_score` in at least `min_views` cameras.
    """
    found = recorded(cameras, detections, frames, min_score, max_gap, where)
    return at_instants(found, [clock[camera.name][:2] for camera in cameras], window, min_views)


def at_instants(
    found: Recorded, clocks: Sequence[Sequence[float]] | Floats, window: dict[str, int], min_views: int
) -> InWindow:
    """`InWindow` of a `Recorded` sequence by clocks (V, 2), offset s and drift ppm."""
    queries = (window["first"] + window["step"] * np.arange(window["count"])) / found.fps
    uv = np.stack([own.at(queries, clock, 0.0).reshape(-1, 2) for own, clock in zip(found.seen, clocks, strict=True)])
    kept = np.isfinite(uv).all(axis=-1).sum(axis=0) >= min_views
    index = np.flatnonzero(kept)
    each = len(found.names)
    return InWindow(uv[:, kept], index % each, index // each, found.names, queries)


def together(parts: Sequence[InWindow], counts: Sequence[int]) -> tuple[Floats, Tracks]:
    """The `InWindow` of several sequences as uv (V, N, 2) and `Tracks`; `counts`: instants of each one's window."""
    names = tuple(dict.fromkeys(name for part in parts for name in part.names))
    number = {name: i for i, name in enumerate(names)}
    joint = [np.array([number[name] for name in part.names], int)[part.joint] for part in parts]
    first = np.cumsum([0, *counts[:-1]])
    moment = [part.instant + start for part, start in zip(parts, first, strict=True)]
    sequence = [np.full(len(part.joint), i) for i, part in enumerate(parts)]
    steps = [step for part in parts for step in np.diff(part.seconds)]
    step_s = float(np.median(steps)) if steps else Tracks.step_s
    tracks = Tracks(np.concatenate(joint), np.concatenate(moment), np.concatenate(sequence), names, step_s)
    return np.concatenate([part.uv for part in parts], axis=1), tracks


def marked(
    files: Mapping[str, AnyPath],
    cameras: Sequence[str],
    wanted: Collection[str],
    sequences: Collection[str],
    sigma_px: float,
) -> facts.Marked | None:
    """`facts.Marked` of the points `wanted` in the marks CSVs of the cameras; None where none is wanted.

    `files`: camera -> path; only what is marked in pictures of `sequences` counts. A point lies still during a
    sequence: the clicks of a camera in it are averaged, and each sequence gives a point of its own.
    """
    if not wanted:
        return None
    found: dict[tuple[str, str], dict[int, list[Floats]]] = {}
    for view, camera in enumerate(cameras):
        if camera not in files or not Path(files[camera]).is_file():
            continue
        rows = hand_marks.read(files[camera])
        for name, sequence, uv in zip(rows.joint, rows.sequence, rows.uv, strict=True):
            if name in wanted and sequence in sequences:
                found.setdefault((name, sequence), {}).setdefault(view, []).append(uv)
    points = sorted(key for key, views in found.items() if len(views) >= 2)
    uv = np.full((len(cameras), len(points), 2), np.nan)
    for i, key in enumerate(points):
        for view, clicks in found[key].items():
            uv[view, i] = np.mean(clicks, axis=0)
    return facts.Marked(uv, tuple(name for name, _ in points), tuple(sequence for _, sequence in points), sigma_px)


def metric_facts(known: dict[str, Any], sequences: Sequence[str]) -> list[facts.Known]:
    """`facts` objects of the dict that session.yaml gives (see `dior.project.project`); `sequences` of the window, in
    order."""

    def numbers(names: Sequence[str] | None) -> tuple[int, ...] | None:
        return None if names is None else tuple(sequences.index(name) for name in names if name in sequences)

    made: list[facts.Known] = []
    for x in known.get("distances", []):
        made.append(facts.Distance(tuple(x["between"]), x["length_m"], x["sigma_m"]))
    for x in known.get("scale_bar", []):
        made.append(facts.ScaleBar(tuple(map(tuple, x["ends"])), x["length_m"], x["sigma_m"]))
    for x in known.get("keypoint_distance", []):
        of = numbers(x.get("sequences"))
        made.append(facts.KeypointDistance(tuple(x["joints"]), x["length_m"], x["sigma_m"], of))
    for x in known.get("stature", []):
        made.append(facts.Stature(x["height_m"], x["sigma_m"], numbers(x["sequences"])))
    if "floor" in known:
        x = known["floor"]
        made.append(facts.Floor(x["sigma_m"], np.radians(x["sigma_deg"])))
    return made


def tag_corners(cameras: Sequence[Camera], paths: Sequence[AnyPath], where: str) -> list[facts.Known]:
    """`facts.Tag` of every camera that was placed by the tag, from the `marks` tables that place wrote beside them.

    Raises DiorError for a camera whose corners are not there.
    """
    from dior.calibrate.marks import apriltag

    by_camera = {Path(path).name.partition(".")[0]: path for path in paths}
    made: list[facts.Known] = []
    for camera in cameras:
        if camera.locate != "apriltag":
            continue
        marks = tables.read(by_camera[camera.name], "marks") if camera.name in by_camera else {"inlier": np.zeros(0)}
        if not marks["inlier"].any():
            raise DiorError(
                f"{where}, {camera.name}: it was placed by the tag, but the corners that it saw are not there; run the "
                "step place again"
            )
        seen = apriltag.corners_of(marks)
        made.append(facts.Tag(seen.world, {camera.name: seen.uv}, seen.sigma_px))
    return made


def names_of_marks(known: dict[str, Any]) -> set[str]:
    """Names of the points that the facts want to be marked."""
    ends = {name for x in known.get("scale_bar", []) for pair in x["ends"] for name in pair}
    return ends | {x["between"][1] for x in known.get("distances", [])}
