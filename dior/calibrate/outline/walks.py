"""The walks that a long-range camera is aligned to, and what is drawn or seen around the known walker in its pictures.

INPUTS   skeletons and frames of sequences, their clocks given by hand, boxes, marks or pictures
OUTPUTS  `FilmedWalk`s; pictures and edges of each; `seen_edges.EdgeObservations` of all together
World in metres, recorded pixels.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.body.names import bones_of
from dior.calibrate.marks import marks as hand_marks
from dior.calibrate.outline import seen_edges, silhouettes, tracks
from dior.clocks import by_hand as hand_offsets
from dior.clocks import lag
from dior.clocks.axis import ClockValues, seconds
from dior.errors import DiorError, nearest
from dior.geometry import camera as cam
from dior.geometry import covariance
from dior.geometry.camera import Camera
from dior.geometry.covariance import point_covariance
from dior.ingest.video_starts import search_s
from dior.project import boxes as hand_boxes
from dior.tables import tables

# chosen: constant errors of the joints of a body, by the detector and the close cameras, are partly alike
ALIKE = 1.2
SILHOUETTE_MARGIN_PX = 0.5  # chosen: sd of what a silhouette has beyond the flesh
PICTURES = 150  # chosen: of a sequence, for silhouettes; neighbouring ones tell the same
AROUND_PX = 60.0  # chosen: 4.5 degrees about where the start has the person, at fx 760


@dataclass(frozen=True, eq=False)
class FilmedWalk:
    """One sequence and the pictures of the camera: their `rows` and `seconds` (F,) by the clock as far as it is known,
    the `track` of the `joints`, whether the clock is `held` at what a person gave.

    `sd_m`: standard error of a joint in an axis, given the close cameras; NaN where it is not known. `most_s`: how far
    off the clock may be.
    """

    name: str
    rows: Table
    seconds: Floats
    track: tracks.BodyTrack
    joints: list[str]
    held: bool
    sd_m: float
    most_s: float = lag.WINDOW_S

    @property
    def size(self) -> hand_boxes.Size:
        """Width and height px of the pictures."""
        return int(self.rows["width"][0]), int(self.rows["height"][0])

    @property
    def points(self) -> Floats:
        """(F, J, 3) m at the pictures."""
        return self.track.at(self.seconds)


def read_walk(name: str, camera: str, skeleton: Path, frames: Path, offsets: Path | None) -> FilmedWalk:
    """`FilmedWalk` of one sequence; `offsets`: the file of clocks given by hand, or None.

    Raises DiorError where the camera has no picture.
    """
    rows = tables.of_camera(tables.read(frames, "frames"), camera)
    if not len(rows["frame"]):
        raise DiorError(f"{name}, camera {camera}: {frames} lists no picture of it; take it off align.sequences")
    offset_s, drift_ppm, source = given_clock(camera, frames, offsets)
    table = tables.read(skeleton, "skeletons_3d")
    track, t0_ns, joints = tracks.read(table)
    noise = point_covariance(table, track.points.shape[:2])
    variance = np.trace(noise, axis1=-2, axis2=-1)[np.isfinite(noise).all(axis=(-2, -1))] / 3
    sd_m = float(np.sqrt(np.median(variance))) if len(variance) else np.nan
    when = seconds(rows["stamp_ns"], t0_ns, offset_s, drift_ppm)
    return FilmedWalk(name, rows, when, track, joints, source == "manual", sd_m, search_s(frames))


def edged(walk: FilmedWalk, around: str) -> tuple[tracks.BodyTrack, Floats | float, float]:
    """What edges are the extremes of: its track, `flesh_m` and `outline_m` as in `seen_edges.EdgeObservations`.

    `around`: body, whose outline a person draws and a silhouette shows; or joints, as a machine may.
    """
    if around == "joints":
        return walk.track, 0.0, 0.0
    points, flesh_m = silhouettes.outline(walk.track.points, walk.joints)
    return tracks.BodyTrack(walk.track.seconds, points), flesh_m, seen_edges.OUTLINE_M


def limbs(walks: Sequence[FilmedWalk], around: str) -> Ints:
    """Pairs (B, 2) of points of `edged` that a limb joins, which an occluder may cut; none of edges around joints."""
    return bones_of(walks[0].joints if around == "body" else []).astype(int)


def given_clock(camera: str, frames: Path, offsets: Path | None) -> ClockValues:
    """Offset s, drift ppm and source of a camera's clock by the file of those given by hand, which may be None."""
    known = tables.ordered_unique(tables.read(frames, "frames", ["camera"])["camera"])
    return hand_offsets.read(offsets, known)[camera]


def from_boxes(walk: FilmedWalk, path: Path) -> tuple[Ints, Floats]:
    """Pictures (F,) with a box that is not kept back, by their row, and its edges (F, 4) px."""
    numbers, edges = hand_boxes.read(path, walk.rows["frame"], walk.size)
    fitted = ~hand_boxes.kept_back(numbers)
    return np.searchsorted(walk.rows["frame"], numbers[fitted]), edges[fitted]


def from_marks(walk: FilmedWalk, marks: hand_marks.Marks, path: Path) -> tuple[Ints, Floats]:
    """Pictures (F,) with clicked joints, by their row, and the clicks (F, J, 2) px with NaN."""
    mine = marks.only(marks.sequence == walk.name)
    rows = []
    for i in range(len(mine)):
        where = f"{path} line {mine.line[i]}"
        if mine.joint[i] not in walk.joints:
            raise DiorError(
                f"{where}: '{mine.joint[i]}' is no joint of {walk.name}{nearest(mine.joint[i], walk.joints)}"
            )
        found = np.flatnonzero(walk.rows["frame"] == mine.frame[i])
        if not len(found):
            raise DiorError(f"{where}: {walk.name} has no frame {mine.frame[i]} of this camera")
        hand_marks.check_inside(where, mine.uv[i], *walk.size)
        rows.append(found[0])
    shown, at = np.unique(np.array(rows, int), return_inverse=True)
    clicks = np.full((len(shown), len(walk.joints), 2), np.nan)
    clicks[at, [walk.joints.index(joint) for joint in mine.joint]] = mine.uv
    return shown, clicks


def from_pictures(walks: Sequence[FilmedWalk], start: Camera, data_root: Path) -> list[tuple[Ints, Floats]]:
    """By walk, pictures (F,) spread over it, by their row, and the edges (F, 4) px of the silhouette in each."""
    from dior.ingest.bags import read_pictures

    rows = [
        np.unique(np.linspace(0, len(w.seconds) - 1, min(PICTURES, len(w.seconds))).round().astype(int)) for w in walks
    ]
    seen = [cam.project(start, walk.points[chosen])[0] for walk, chosen in zip(walks, rows, strict=True)]
    lens = start.intrinsics
    flat = np.concatenate([uv.reshape(-1, 2) for uv in seen])
    if not np.isfinite(flat).any():
        raise DiorError(f"{start.name}: the start sees nobody; is tape.target_m where the person is?")
    u0, v0, u1, v1 = silhouettes.window(flat, (lens.width, lens.height), AROUND_PX * max(lens.fx / 760, 1.0))
    pieces = []
    for walk, chosen in zip(walks, rows, strict=True):
        mine: list[Any] = [None] * len(chosen)
        for row, picture in read_pictures(tables.rows(walk.rows, chosen), data_root):
            mine[row] = picture[v0:v1, u0:u1]
        pieces.append(mine)
    few = [picture for mine in pieces for picture in mine[:: max(1, len(walks))]]
    empty = silhouettes.empty_scene(few)
    stances = [silhouettes.stance(uv) for uv in seen]
    tall, standing = float(np.nanmedian([px for px, _ in stances])), round(np.mean([axis for _, axis in stances]))
    corner = np.array([u0, v0, u0, v0])
    return [
        (chosen, silhouettes.edges(mine, tall, empty, standing) + corner)
        for chosen, mine in zip(rows, pieces, strict=True)
    ]


def gather(
    walks: Sequence[FilmedWalk],
    start: Camera,
    source: str,
    files: Mapping[str, Path],
    data_root: Path,
    marks: Path | None,
    around: str = "body",
) -> seen_edges.EdgeObservations:
    """`seen_edges.EdgeObservations` of all sequences. `files`: boxes by sequence, drawn `around` the body or joints;
    `marks`: a path."""
    if source == "boxes":
        missing = [walk.name for walk in walks if walk.name not in files]
        if missing:
            raise DiorError(f"{missing[0]}: align.sequences names it, but there is no config/boxes file of it")
        found = [from_boxes(walk, files[walk.name]) for walk in walks]
    elif source == "silhouettes":
        found = from_pictures(walks, start, data_root)
    else:
        if marks is None:
            raise DiorError(f"{start.name}: align.from says marks, but there is no file of marks")
        clicked = hand_marks.read(marks)
        found = [from_marks(walk, clicked, marks) for walk in walks]
    around = {"silhouettes": "body", "marks": "joints"}.get(source, around)
    flesh_m: Floats | float = 0.0
    outline_m = 0.0
    parts, used = [], []
    for k, (walk, (shown, values)) in enumerate(zip(walks, found, strict=True)):
        count = len(shown)
        track, own_flesh_m, outline_m = edged(walk, around)
        # a walk without any 3D does not tell how large a body is
        flesh_m = own_flesh_m if np.any(own_flesh_m) else flesh_m
        used.append(track)
        points = track.at(walk.seconds[shown])
        clicks = values if source == "marks" else np.full((*points.shape[:2], 2), np.nan)
        edges = np.full((count, 4), np.nan) if source == "marks" else values
        parts.append((points, edges, clicks, walk.seconds[shown], np.full(count, k)))
    points, edges, clicks, seconds, number = (np.concatenate(column) for column in zip(*parts, strict=True))
    return seen_edges.EdgeObservations(
        points, edges, clicks, seconds, number, constant_error(walks), flesh_m, tuple(used), outline_m,
        limbs(walks, around), max(walk.most_s for walk in walks),
    )  # fmt: skip


def margins(settings: Mapping[str, Any], source: str = "") -> tuple[float, float, float]:
    """Prior of the margin of all edges, of v against u, and of what an edge is drawn further out than these (sd, px).

    `settings` of a camera's YAML; `source`: boxes or silhouettes, where it is not what `align.from` says.
    """
    how = settings.get("align", {})
    known = seen_edges.Freedom
    source = source or how["from"]
    if source != "boxes":
        margin_px = SILHOUETTE_MARGIN_PX if source == "silhouettes" else known.margin_px
        return margin_px, known.margin_split_px, 0.0
    habit_px = float(how.get("habit_px", seen_edges.HABIT_PX))
    # the parts of a habit that above and below, left and right share make the two margins differ as much
    return known.margin_px, float(np.hypot(known.margin_split_px, habit_px)), habit_px


def constant_error(walks: Sequence[FilmedWalk]) -> float:
    """Standard error (m) of a joint's place that is constant while a camera sees the same side of the body."""
    known = [walk.sd_m for walk in walks if np.isfinite(walk.sd_m)]
    return ALIKE * float(np.mean(known)) if known else seen_edges.JOINT_BIAS_M


def by_close(close: Sequence[Camera], points: Floats) -> Floats:
    """Derivative (F, J, 3, 6V) of triangulated points by the close cameras' errors; all that see them count alike."""
    inside = np.stack([cam.in_frame(c.intrinsics, cam.project(c, points)[0]) for c in close])
    return covariance.triangulated(close, points, inside[..., None, None] * np.eye(2))[1]
