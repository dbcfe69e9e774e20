"""The clock of an indoor camera against the motion capture where nothing is detected: by silhouettes in its pictures.

INPUTS   a located camera, the sequence's markers (`skeletons_3d`), the camera's pictures
OUTPUTS  `dior.clocks.clock.Clock`, and the cost (px) of each lag (s)

A still camera shows what differs from the empty scene (`silhouettes`). The box of that is compared with the markers and
what lies around them: crown, toes, flesh (`silhouettes.outline`). Pictures are spread over the recording, since errors
of neighbours are alike, and shrunk until the person is some 80 pixels tall: an outline is known to a fraction of one.
Recorded pixels; times in s after the first stored frame of the motion capture.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.calibrate.outline import long_range_clock, seen_edges, silhouettes, tracks
from dior.clocks import lag
from dior.clocks.axis import seconds
from dior.clocks.clock import Clock
from dior.geometry import camera as cam
from dior.geometry.camera import Camera

# chosen: errors of neighbouring pictures are alike, so that more of them, or larger ones, cost time and tell little
PICTURES, TALL_PX = 200, 80
BORDER_PX = 2.0  # chosen: of a shrunk picture: an edge so near its border is the picture's and not the person's
BIAS_M = 0.02  # chosen: sd of a marker, or what is derived from it, against the outline while the same side is seen
TRAILS_M = 0.002  # chosen: sd of an outline ahead of or behind the body where it moves: clothes swing, skin slips
MARGIN_PX, MARGIN_SPLIT_PX = 3.0, 3.0  # chosen: sd of what lies outside of the flesh, at fx 760; of v against u
EMPTY_FROM = 60  # chosen: pictures whose median is the empty scene; bounds the memory


def from_pictures(
    camera: Camera,
    mocap_table: Table,
    frames_rows: Table,
    data_root: Path,
    where: str,
    most_s: float = lag.WINDOW_S,
) -> tuple[Clock, Floats, Floats]:
    """`Clock`, the lags (s) and their costs (px).

    `mocap_table`, `frames_rows`: dicts of arrays, tables `skeletons_3d` of the sequence and `frames` of the camera;
    `most_s`: how far off the clock may be.
    Where the pictures cannot tell, the clock is `assumed_zero`. Raises DiorError (naming `where`) for pictures of
    another size than the intrinsics.
    """
    from dior.ingest.bags import read_pictures
    from dior.tables.tables import rows

    cam.check_picture_size(camera.intrinsics, frames_rows["width"][0], frames_rows["height"][0], where)
    track, t0_ns, flesh_m = body(mocap_table)
    shown = chosen(len(frames_rows["stamp_ns"]))
    factor = shrinking(camera, track)
    small: list[Any] = [None] * len(shown)
    for row, picture in read_pictures(rows(frames_rows, shown), data_root):
        small[row] = shrunk(picture, factor)
    edges = edges_of(small, factor, *stance(camera, track))
    found = from_edges(camera, track, flesh_m, seconds(frames_rows["stamp_ns"][shown], t0_ns), edges, most_s)
    return found.clock, long_range_clock.lags_of(found.costs_px), found.costs_px


def body(mocap_table: Table) -> tuple[tracks.BodyTrack, int, Floats]:
    """The `BodyTrack` of markers and what is derived from them, t0 (ns), how far outside the outline lies (J,) m."""
    track, t0_ns, joints = tracks.read(mocap_table)
    whole, flesh_m = silhouettes.outline(filled(track), joints)
    return tracks.BodyTrack(track.seconds, whole), t0_ns, flesh_m


def filled(track: tracks.BodyTrack) -> Floats:
    """Points (T, J, 3) with gaps bridged linearly against the middle of the body, so that an extreme does not jump."""
    points = track.points.copy()
    known = np.all(np.isfinite(points), axis=-1)
    always = known.mean(axis=0) > 0
    middle = np.nanmedian(np.where(known[..., None], points, np.nan), axis=1)
    seen = np.all(np.isfinite(middle), axis=-1)
    for j in np.flatnonzero(always & ~known.all(axis=0)):
        good, gone = known[:, j] & seen, ~known[:, j] & seen
        for axis in range(3):
            own = points[good, j, axis] - middle[good, axis]
            points[gone, j, axis] = np.interp(track.seconds[gone], track.seconds[good], own) + middle[gone, axis]
    return points


def chosen(count: int) -> Ints:
    """Rows of the pictures that are looked at, spread over the recording."""
    return np.unique(np.linspace(0, count - 1, min(PICTURES, count)).round().astype(int))


def stance(camera: Camera, track: tracks.BodyTrack) -> tuple[float, int]:
    """How tall (px) the person is in the recorded picture, in the median, and along which of its axes."""
    tall, standing = silhouettes.stance(cam.project(camera, track.points[:: max(1, len(track.points) // 200)])[0])
    return (tall if np.isfinite(tall) else float(TALL_PX)), standing


def shrinking(camera: Camera, track: tracks.BodyTrack) -> int:
    """By which whole number pictures are shrunk."""
    return max(1, round(stance(camera, track)[0] / TALL_PX))


def shrunk(picture: silhouettes.Picture, factor: int) -> silhouettes.Picture:
    """Means over squares of `factor` pixels; a rest at the right and below is left out."""
    import cv2

    high, wide = (n // factor for n in picture.shape[:2])
    whole = picture[: high * factor, : wide * factor]
    return whole if factor == 1 else np.asarray(cv2.resize(whole, (wide, high), interpolation=cv2.INTER_AREA), np.uint8)


def edges_of(small: Sequence[silhouettes.Picture], factor: int, tall: float, standing: int = 1) -> Floats:
    """Edges (F, 4) in recorded px of the person in shrunk pictures; NaN where the picture's border cuts him."""
    step = max(1, len(small) // EMPTY_FROM)
    empty = silhouettes.empty_scene(small[::step])
    edges = silhouettes.edges(small, tall / factor, empty, standing)
    high, wide = small[0].shape[:2]
    with np.errstate(invalid="ignore"):
        cut = (edges < BORDER_PX - 0.5) | (edges > np.array([wide, high, wide, high]) - 0.5 - BORDER_PX)
    return np.where(cut, np.nan, (edges + 0.5) * factor - 0.5)


def from_edges(
    camera: Camera,
    track: tracks.BodyTrack,
    flesh_m: Floats,
    moments: Floats,
    edges: Floats,
    most_s: float = lag.WINDOW_S,
) -> long_range_clock.ClockFromEdges:
    """`long_range_clock.ClockFromEdges` from edges (F, 4) px of pictures taken at `moments` (F,) s by the stamps."""
    points = track.at(moments)
    nothing = np.full((*points.shape[:2], 2), np.nan)
    seen = seen_edges.EdgeObservations(
        points, edges, nothing, moments, np.zeros(len(moments), int), BIAS_M, flesh_m, (track,), most_s=most_s
    )
    scale = camera.intrinsics.fx / 760
    margin = MARGIN_PX * scale, MARGIN_SPLIT_PX * scale
    return long_range_clock.estimate(camera, seen, "pictures", margin, trails_m=TRAILS_M)
