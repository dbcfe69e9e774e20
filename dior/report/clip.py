"""A short film of a sequence: all its cameras side by side at the same time, with the labels drawn on them.

INPUTS   frames table, the pictures it indexes, the cameras' clocks (`offsets` tables), the `timeline`, which begins
         at t0, `labels_2d` files
OUTPUTS  a VP8 .webm of the middle of the walk and a JPEG of its middle picture

At each moment every camera shows its nearest picture, by its clock. A long-range camera is enlarged around all places
of the person in the clip, so that the picture stands still. VP8 because OpenCV's wheel cannot write H.264 and browsers
play it.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.clocks import clock as on_axis
from dior.clocks.axis import camera_seconds, nominal_fps
from dior.errors import DiorError
from dior.evaluate.grids import label_grids
from dior.report.overlays import Picture, TileView, draw_skeleton, shown_in, view_of
from dior.tables import tables
from dior.tables.files import check_written, written_whole

# px; chosen: two side by side fit a phone held sideways
TILE = (480, 270)
# one of so many pictures is shown; chosen: half the size, and 15 a second still show how people walk
EVERY = 2
GROUND = 32  # grey where no tile is
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
    roles: dict[str, str],
    seconds: float,
    out: Path,
    poster: Path,
) -> None:
    """Write the clip of one sequence. `labels`: label files, `roles`: camera -> close | long_range.

    Raises DiorError for a camera without labels or offset, and a picture that cannot be read.
    """
    import cv2

    from dior.ingest import bags

    # several threads would divide the picture in another way on another machine
    cv2.setNumThreads(1)
    index, grids = tables.read(frames, "frames"), label_grids(labels)
    t0 = int(tables.read(timeline, "timeline", ["stamp_ns"])["stamp_ns"][0])
    times, fps = clocked(index, clocks, t0, sorted(grids), sequence)
    moments = middle(times, fps / EVERY, seconds)
    size, cells = mosaic(len(grids))
    film = np.full((len(moments), size[1], size[0], 3), GROUND, np.uint8)
    shown = {camera: nearest(times[camera], moments) for camera in grids}
    for (camera, grid), (left, top) in zip(sorted(grids.items()), cells, strict=True):
        own = tables.of_camera(index, camera)
        wanted = tables.rows(own, np.unique(shown[camera]))
        row_of = {int(frame): i for i, frame in enumerate(grid.frames)}
        uv = grid.uv[[row_of[int(frame)] for frame in wanted["frame"]]]
        view = still(int(own["width"][0]), int(own["height"][0]), uv, roles[camera] == "long_range")
        tiles = {}
        for row, picture in bags.read_pictures(wanted, Path(data_root)):
            tile = shown_in(view, picture)
            draw_skeleton(tile, view.of(uv[row]), grid.joints, np.zeros(len(grid.joints), bool))
            name = f"{camera}{f' {view.scale:.1f}x' if view.scale > 1 else ''}"
            cv2.putText(tile, name, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
            tiles[int(wanted["frame"][row])] = tile
        for i, frame in enumerate(own["frame"][shown[camera]].tolist()):
            tile = tiles[frame]
            film[i, top : top + tile.shape[0], left : left + tile.shape[1]] = tile
    _write(Path(out), film, fps / EVERY, sequence)
    with written_whole(Path(poster)) as part:
        part.write_bytes(cv2.imencode(".jpg", film[len(film) // 2], [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes())


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


def middle(times: Mapping[str, Floats], fps: float, seconds: float) -> Floats:
    """Moments (N,) s, at least one, at `fps` in the middle of what all cameras have recorded."""
    begin, end = max(t[0] for t in times.values()), min(t[-1] for t in times.values())
    length = min(seconds, max(end - begin, 0.0))
    return (begin + end - length) / 2 + np.arange(max(int(length * fps), 1)) / fps


def nearest(times: Floats, moments: Floats) -> Ints:
    """Index (N,) of the picture nearest to each moment; `times` (F,) ascending."""
    after = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    return np.where(moments - times[after - 1] <= times[after] - moments, after - 1, after)


def mosaic(count: int) -> tuple[tuple[int, int], list[tuple[int, int]]]:
    """Size (width, height) px of `count` tiles in rows of two (one tile: alone), and where each begins (left, top)."""
    columns = min(count, 2)
    cells = [((i % columns) * TILE[0], (i // columns) * TILE[1]) for i in range(count)]
    return (columns * TILE[0], -(-count // columns) * TILE[1]), cells


def still(width: int, height: int, uv: Floats, zoomed: bool) -> TileView:
    """The `TileView` of all pictures of a camera: all of it within a tile, or enlarged around labels uv (N, J, 2)."""
    return view_of(width, height, TILE, min(TILE[0] / width, TILE[1] / height), uv, zoomed)


def _write(path: Path, film: Picture, fps: float, sequence: str) -> None:
    import cv2

    with written_whole(path) as part:
        writer = cv2.VideoWriter(str(part), cv2.VideoWriter.fourcc(*"VP80"), fps, film.shape[2:0:-1])
        if not writer.isOpened():
            raise DiorError(f"sequence {sequence}: this OpenCV cannot write VP8; set report.clip_seconds to 0")
        for picture in film:
            writer.write(picture)
        writer.release()
        check_written(part)
        part.write_bytes(numbered(part.read_bytes()))


def numbered(webm: bytes) -> bytes:
    """The bytes of a WebM file with 1 for the random number that its writer gave the track, where it stands."""
    at = webm.find(TRACK_UID, 0, HEADER)
    if at < 0:
        return webm
    number = webm[at + len(TRACK_UID) :][:8]
    return webm[:HEADER].replace(number, (1).to_bytes(8, "big")) + webm[HEADER:]
