"""A short film of a sequence: all its cameras side by side at the same time, with the labels drawn on them.

INPUTS   frames table, the pictures it indexes, the cameras' clocks (`offsets` tables), the `timeline`, which begins
         at t0, `labels_2d` files, `frame_metrics`
OUTPUTS  a VP8 .webm that begins at the worst moment, or of the whole walk, and a JPEG of its first picture

At each moment every camera shows its nearest picture, by its clock, with its frame number. Every camera is enlarged
around the person: where all places of the clip fit, the picture stands still, and else it follows. VP8 because OpenCV's
wheel cannot write H.264 and browsers play it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.clocks import clock as on_axis
from dior.clocks.axis import camera_seconds, nominal_fps
from dior.errors import DiorError
from dior.evaluate.grids import LabelGrid, label_grids
from dior.report import worst_pictures
from dior.report.overlays import Picture, TileView, draw_skeleton, shown_in, view_of
from dior.tables import tables
from dior.tables.files import check_written, written_whole

# px; chosen: two side by side fit a phone held sideways
TILE = (480, 270)
# one of so many pictures is shown; chosen: half the size, and 15 a second still show how people walk
EVERY = 2
GROUND = 32  # grey where no tile is
# s before the worst moment at which a clip begins; chosen: one sees it coming
BEFORE_S = 0.5
# s over which the view that follows a person is smoothed; chosen: about a step, so that it does not nod
SMOOTH_S = 0.8
# a view that stands still is taken where it enlarges so much of what one that follows does; chosen
STILL = 0.8
# pictures of the film at once, so that a whole walk needs no more memory than a part of it; chosen
AT_ONCE = 60
# Matroska's element TrackUID with its length of 8 bytes; a tag in the header names the track by it
TRACK_UID, HEADER = b"\x73\xc5\x88", 4096


def run(
    *,
    sequence: str,
    frames: Path,
    clocks: list[Path],
    timeline: Path,
    data_root: Path,
    labels: list[Path],
    frame_metrics: Path,
    seconds: float,
    out: Path,
    poster: Path,
) -> None:
    """Write the clip of one sequence. `labels`: label files; `frame_metrics`: that table; `seconds`: how long, at most.

    Raises DiorError for a camera without labels or offset.
    """
    import cv2

    # several threads would divide the picture in another way on another machine
    cv2.setNumThreads(1)
    index, grids = tables.read(frames, "frames"), label_grids(labels)
    t0 = int(tables.read(timeline, "timeline", ["stamp_ns"])["stamp_ns"][0])
    times, fps = clocked(index, clocks, t0, sorted(grids), sequence)
    worst = worst_time(tables.read(frame_metrics, "frame_metrics"), index, times)
    moments = shown_moments(times, fps / EVERY, seconds, worst)
    cameras = [
        _camera(grid, tables.of_camera(index, camera), nearest(times[camera], moments), fps / EVERY)
        for camera, grid in sorted(grids.items())
    ]
    size, cells = mosaic(len(grids))
    first = _write(Path(out), _film(cameras, size, cells, len(moments), Path(data_root)), size, fps / EVERY, sequence)
    with written_whole(Path(poster)) as part:
        part.write_bytes(cv2.imencode(".jpg", first, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes())


@dataclass(frozen=True, eq=False)
class _Filmed:
    """A camera of the film: `rows`, the N moments' part of its frames table, `uv` (N, J, 2) px and a `view` each."""

    grid: LabelGrid
    rows: Table
    uv: Floats
    views: list[TileView]


def _camera(grid: LabelGrid, own: Table, shown: Ints, fps: float) -> _Filmed:
    row_of = {int(frame): i for i, frame in enumerate(grid.frames)}
    rows = tables.rows(own, shown)
    uv = grid.uv[[row_of[int(frame)] for frame in rows["frame"]]]
    return _Filmed(grid, rows, uv, views(int(own["width"][0]), int(own["height"][0]), uv, fps))


def _film(
    cameras: list[_Filmed], size: tuple[int, int], cells: list[tuple[int, int]], count: int, data_root: Path
) -> Iterator[Picture]:
    """The pictures of the film, `count` of `size` (width, height) px, one after the other."""
    from dior.ingest import bags

    for begin in range(0, count, AT_ONCE):
        part = slice(begin, min(begin + AT_ONCE, count))
        film = np.full((part.stop - begin, size[1], size[0], 3), GROUND, np.uint8)
        for camera, (left, top) in zip(cameras, cells, strict=True):
            numbers = camera.rows["frame"][part]
            # a picture that is shown twice is read once
            each, first = np.unique(numbers, return_index=True)
            wanted = tables.rows(camera.rows, begin + first)
            for row, picture in bags.read_to_show(wanted, data_root):
                for i in np.flatnonzero(numbers == each[row]):
                    tile = _tile(camera, begin + int(i), picture)
                    film[i, top : top + tile.shape[0], left : left + tile.shape[1]] = tile
        yield from film


def _tile(camera: _Filmed, i: int, picture: Picture) -> Picture:
    """The picture of a moment with the labels, the camera, by how much it is enlarged, and the frame number."""
    import cv2

    view = camera.views[i]
    tile = shown_in(view, picture)
    draw_skeleton(tile, view.of(camera.uv[i]), camera.grid.joints, np.zeros(len(camera.grid.joints), bool))
    larger = f" {view.scale:.1f}x" if view.scale > 1 else ""
    text = f"{camera.grid.camera}{larger}  frame {int(camera.rows['frame'][i])}"
    (wide, high), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 1)
    cv2.rectangle(tile, (0, 0), (wide + 11, high + below + 8), (0, 0, 0), cv2.FILLED)
    cv2.putText(tile, text, (6, high + 6), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
    return tile


def worst_time(metrics: Table, index: Table, times: Mapping[str, Floats]) -> float | None:
    """When (s) the picture was taken that is worst by the first measure of the report that there is; None of none."""
    for metric, sign, *_ in worst_pictures.SECTIONS.values():
        found = [
            (sign * value, camera, frame)
            for (_, camera), (value, frame) in worst_pictures.by_recording(metrics, metric, sign).items()
            if camera in times
        ]
        if found:
            _, camera, frame = max(found)
            at = np.flatnonzero(tables.of_camera(index, camera)["frame"] == frame)
            return float(times[camera][at[0]]) if len(at) else None
    return None


def clocked(
    index: Table, clocks: list[Path], t0: int, cameras: list[str], sequence: str
) -> tuple[dict[str, Floats], float]:
    """camera -> times (F,) s of its pictures after `t0` (ns) on the sequence's clock, and the pictures per second."""
    clock = {name: (one.offset_s, one.drift_ppm) for name, one in on_axis.read(clocks).items()}
    for camera in cameras:
        if camera not in clock or not (index["camera"] == camera).any():
            raise DiorError(f"sequence {sequence}, camera {camera}: no pictures or no offset; run frames and timeline")
    fps = min(nominal_fps(tables.of_camera(index, camera)["stamp_ns"]) for camera in cameras)
    return {camera: camera_seconds(index, camera, t0, clock[camera]) for camera in cameras}, fps


def shown_moments(times: Mapping[str, Floats], fps: float, seconds: float, worst: float | None) -> Floats:
    """Moments (N,) s, at least one, at `fps`: `seconds` of what all cameras have recorded, from shortly before the
    `worst` moment on, or from its middle where none is known.
    """
    begin, end = max(t[0] for t in times.values()), min(t[-1] for t in times.values())
    length = min(seconds, max(end - begin, 0.0))
    first = (begin + end - length) / 2 if worst is None else worst - BEFORE_S
    return max(min(first, end - length), min(begin, end)) + np.arange(max(int(length * fps), 1)) / fps


def nearest(times: Floats, moments: Floats) -> Ints:
    """Index (N,) of the picture nearest to each moment; `times` (F,) ascending."""
    after = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    return np.where(moments - times[after - 1] <= times[after] - moments, after - 1, after)


def mosaic(count: int) -> tuple[tuple[int, int], list[tuple[int, int]]]:
    """Size (width, height) px of `count` tiles in rows of two (one tile: alone), and where each begins (left, top)."""
    columns = min(count, 2)
    cells = [((i % columns) * TILE[0], (i // columns) * TILE[1]) for i in range(count)]
    return (columns * TILE[0], -(-count // columns) * TILE[1]), cells


def views(width: int, height: int, uv: Floats, fps: float) -> list[TileView]:
    """A `TileView` for each of the labels uv (N, J, 2) px of a camera: the same for all where the places of all fit, or
    one that follows the person, as much enlarged in all pictures."""
    whole = min(TILE[0] / width, TILE[1] / height)
    still = view_of(width, height, TILE, whole, uv, True)
    # nobody is in a picture without labels
    known = np.array(np.isfinite(uv).all(axis=-1))
    some = np.array(known.any(axis=1))
    if not some.any():
        return [still] * len(uv)
    low = np.where(known[..., None], uv, np.inf).min(axis=1)[some]
    high = np.where(known[..., None], uv, -np.inf).max(axis=1)[some]
    largest = (high - low).max(axis=0) / 2
    at, middle = np.arange(len(uv)), (low + high) / 2
    centre = np.stack([np.interp(at, np.flatnonzero(some), middle[:, i]) for i in range(2)], axis=-1)
    centre = _smooth(centre, max(int(SMOOTH_S * fps), 1))
    box = np.stack([centre - largest, centre + largest], axis=1)
    each = [view_of(width, height, TILE, whole, one, True) for one in box]
    return [still] * len(uv) if still.scale >= STILL * each[0].scale else each


def _smooth(values: Floats, count: int) -> Floats:
    """Means of `count` neighbours of values (N, 2), the ends repeated."""
    half = count // 2
    padded = np.concatenate([np.repeat(values[:1], half, axis=0), values, np.repeat(values[-1:], half, axis=0)])
    sums = np.cumsum(np.concatenate([np.zeros((1, 2)), padded]), axis=0)
    return (sums[2 * half + 1 :] - sums[: -(2 * half + 1)]) / (2 * half + 1)


def _write(path: Path, film: Iterator[Picture], size: tuple[int, int], fps: float, sequence: str) -> Picture:
    """Write the film; its first picture is returned."""
    import cv2

    first = None
    with written_whole(path) as part:
        writer = cv2.VideoWriter(str(part), cv2.VideoWriter.fourcc(*"VP80"), fps, size)
        if not writer.isOpened():
            raise DiorError(f"sequence {sequence}: this OpenCV cannot write VP8; set report.clip_seconds to 0")
        for picture in film:
            first = picture.copy() if first is None else first
            writer.write(picture)
        writer.release()
        check_written(part)
        part.write_bytes(numbered(part.read_bytes()))
    assert first is not None
    return first


def numbered(webm: bytes) -> bytes:
    """The bytes of a WebM file with 1 for the random number that its writer gave the track, where it stands."""
    at = webm.find(TRACK_UID, 0, HEADER)
    if at < 0:
        return webm
    number = webm[at + len(TRACK_UID) :][:8]
    return webm[:HEADER].replace(number, (1).to_bytes(8, "big")) + webm[HEADER:]
