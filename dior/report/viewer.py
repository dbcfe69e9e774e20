"""What the page "3D with time" of a sequence shows: the 3D, the cameras, and a picture of each of them every second.

INPUTS   `skeletons_3d`, `cameras`, `camera_covariance`, `labels_2d`, the frames table, the pictures it indexes, the
         cameras' clocks (`offsets`), the `timeline`, which begins at t0, `frame_metrics`, and where there are any
         `detections`
OUTPUTS  scene.js (scene_file.py);
         <out_pictures>/<camera>.<n>.webp: sheets of small pictures, <camera>.frame_<frame>.webp: whole pictures of
         the worst moments

The 3D is at its own instants, at most MOST_HZ of them a second; a picture is at its own time, with the label of that
time. Rays are those of the pictures: through what was detected, or where no detection is used through the label. They
are without the lens, so that the page needs no model of it.
"""

import io
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats, Ints, Table
from dior.body import names
from dior.clocks.axis import seconds
from dior.evaluate.grids import LabelGrid, label_grids, onto, value_grid
from dior.geometry.camera import Camera, undistort
from dior.geometry.camera_tables import read_camera_covariance, read_placed
from dior.report import scene_file, worst_pictures
from dior.report.clip import clocked, nearest
from dior.report.colours import LEFT, MIDDLE, RIGHT, colours_of
from dior.report.numbers import show
from dior.report.overlays import Picture, TileView, shown_in, view_of
from dior.tables import tables
from dior.tables.files import folder_written_whole, write_text

# chosen: what a screen shows; motion capture has up to 200
MOST_HZ = 60.0
# px, the longer side of a small picture
SIDE = 320
# small pictures in a row and in a column of a sheet; chosen: 16 s a file, and a phone unpacks it in no time
COLUMNS = 4
# of a camera; chosen: a second apart up to five minutes, further apart in longer walks
MOST_PICTURES = 300
# worst moments, each with a whole picture; chosen: as many as are looked at
MOST_MOMENTS = 5
# bytes of all pictures of a sequence of two minutes; chosen: with the numbers, at most 3 MB
PICTURES_BYTES, PER_S = 2_000_000, 120.0
# of WebP, which looks better than JPEG at half the bytes; the first that fits
QUALITIES = (70, 60, 50, 40, 30, 20, 10, 5, 1)
TILE_BYTES = 20_000  # chosen: more than a small picture takes at the best of them, so that nothing has to be tried
# of libwebp's 0-6; chosen: half the time of its usual 4, and 6 % more bytes; 4 where these are too many at any quality
EFFORT, MORE_EFFORT = 2, 4
SAFE = 0.95  # chosen: what the trials are trusted to, since a quality that does not fit is tried in vain
WHOLE_QUALITY = 50  # chosen: compression hides nothing of what a label is a few pixels off from
# a label in steps of an eighth of a pixel, a time in tenths of a millisecond, a ray's slope in parts of 16 000
PIXEL_STEPS, TIME_STEPS, RAY_STEPS = 8, 10_000, 16_000


@dataclass(frozen=True, eq=False)
class Shown:
    """The pictures of a camera that are shown: `rows` (P,) of its part of the frames table, `times` (P,) s, `frames`
    (P,), `views` of the small ones, `uv` (P, J, 2) px the labels of the 3D's joints and `slopes` (P, J, 2) of the rays.
    """

    rows: Ints
    times: Floats
    frames: Ints
    views: list[TileView]
    uv: Floats
    slopes: Floats


def run(
    *,
    sequence: str,
    frames: Path,
    clocks: list[Path],
    timeline: Path,
    skeleton: Path,
    cameras: list[Path],
    covariance: list[Path],
    data_root: Path,
    labels: list[Path],
    detections: Path | None,
    frame_metrics: Path,
    min_score: float,
    out: Path,
    out_pictures: Path,
) -> None:
    """Write scene.js and the pictures of one sequence; where no joint has a place in 3D, they are empty.

    `frame_metrics`: table `frame_metrics` of the sequence; `out_pictures`: folder of the pictures to write.
    `detections` may be None.

    Raises DiorError for a camera without labels, pose or offset.
    """
    import cv2

    # several threads would divide a picture in another way on another machine
    cv2.setNumThreads(1)
    grids, index = label_grids(labels), tables.read(frames, "frames")
    t0 = int(tables.read(timeline, "timeline", ["stamp_ns"])["stamp_ns"][0])
    body = body_of(skeleton, t0)
    if body is None:
        write_text(out, scene_file.text_of(None, {}))
        with folder_written_whole(out_pictures):
            return
    rig = {camera.name: camera for camera in read_placed(cameras, grids, f"sequence {sequence}")}
    times = clocked(index, clocks, t0, sorted(grids), sequence)[0]
    own = {camera: in_order(tables.of_camera(index, camera), times[camera]) for camera in grids}
    worst = moments(tables.read(frame_metrics, "frame_metrics"), body, own)
    found = None if detections is None else tables.read(detections, "detections")
    wanted = np.concatenate([every_second(body["time"]), [moment["time"] for moment in worst]])
    shown = {}
    for name, grid in grids.items():
        seen = None if found is None else tables.of_camera(found, name)
        shown[name] = _shown(rig[name], grid, body["joints"], *own[name], wanted, seen, min_score)
    whole = {(moment["camera"], moment["frame"]) for moment in worst if moment["camera"]}
    tiles, large = _pictures(own, shown, whole, Path(data_root))
    length = float(np.ptp(body["time"]))
    sheets = _encoded(tiles, PICTURES_BYTES * max(1.0, length / PER_S) - sum(map(len, large.values())))
    with folder_written_whole(out_pictures) as folder:
        for name, jpeg in {**sheets, **large}.items():
            (folder / name).write_bytes(jpeg)
    header, arrays = _scene(sequence, body, rig, read_camera_covariance(covariance, list(grids)), own, shown, found)
    write_text(out, scene_file.text_of(header | {"moments": worst, "whole": sorted(large)}, arrays))


def every_second(times: Floats) -> Floats:
    """Moments (M,) s from the first of `times` (N,) to the last, a second apart; MOST_PICTURES of them at the most."""
    length = times[-1] - times[0]
    return times[0] + np.arange(0.0, length + 1e-9, max(1.0, length / (MOST_PICTURES - 1)))


def moments(metrics: Table, body: Mapping[str, Any], own: Mapping[str, tuple[Table, Floats]]) -> list[dict[str, Any]]:
    """The worst moments: of the 3D, and of each camera its worst picture by the first of the report's measures it has.

    `metrics`: a table `frame_metrics`; `body`: `body_of`'s; `own`: camera -> its frames table and times. Dicts of
    camera ("" for the 3D), frame (of the camera, or an instant), time (s) and text.
    """
    found = []
    residual = body["residual"]
    if np.isfinite(residual).any():
        i = int(np.nanargmax(residual))
        text = f"3D furthest from the detections: {show(float(residual[i]), 'px')}"
        found.append({"camera": "", "frame": int(body["instants"][i]), "time": body["time"][i], "text": text})
    told: set[str] = set()
    for metric, sign, unit, words in worst_pictures.SECTIONS.values():
        worst = []
        for (_, camera), (value, frame) in worst_pictures.by_recording(metrics, metric, sign).items():
            if camera in told or camera not in own:
                continue
            told.add(camera)
            table, times = own[camera]
            if unit == "share" and value == 1:
                continue
            at = float(times[int(np.argmax(table["frame"] == frame))])
            worst.append((-sign * value, camera, frame, at, f"{words}: {show(value, unit)}"))
        found += [{"camera": c, "frame": f, "time": t, "text": text} for _, c, f, t, text in sorted(worst)]
    first, last = body["time"][0], body["time"][-1]
    inside = [moment for moment in found if first <= moment["time"] <= last][:MOST_MOMENTS]
    return [moment | {"time": round(float(moment["time"]), 4)} for moment in inside]


def body_of(skeleton: Path, t0: int) -> dict[str, Any] | None:
    """The 3D at up to MOST_HZ: joints, instants (N,), time (N,) s, points (N, J, 3) m, sigmas and rhos (N, J, 3), and
    residual (N,) px of all joints; None where no point is known."""
    columns = ("x", "y", "z", "sigma_x", "sigma_y", "sigma_z", "rho_xy", "rho_xz", "rho_yz", "residual_px")
    table = tables.read(skeleton, "skeletons_3d", ["joint", "instant", "stamp_ns", *columns])
    values, instants, joints = value_grid(table, "instant", *columns)
    if not np.isfinite(values[..., :3]).any():
        return None
    time = seconds(table["stamp_ns"].reshape(values.shape[:2])[:, 0], t0)
    rate = (len(time) - 1) / max(float(np.ptp(time)), 1e-9)
    every = max(1, int(np.ceil(rate / MOST_HZ - 1e-6)))
    values, instants, time = values[::every], instants[::every], time[::every]
    known = np.isfinite(values[..., 9])
    total = np.where(known, values[..., 9], 0.0).sum(axis=1)
    residual = np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan)
    return {
        "joints": joints, "instants": instants, "time": time, "points": values[..., :3], "sigmas": values[..., 3:6],
        "rhos": values[..., 6:9], "residual": residual,
    }  # fmt: skip


def in_order(table: Table, times: Floats) -> tuple[Table, Floats]:
    """A camera's part of the frames table and its times, by time: a picture may be recorded after a later one."""
    order = np.argsort(times, kind="stable")
    return tables.rows(table, order), times[order]


def _shown(
    camera: Camera,
    grid: LabelGrid,
    joints: list[str],
    own: Table,
    times: Floats,
    wanted: Floats,
    seen: Table | None,
    min_score: float,
) -> Shown:
    """The pictures nearest to the moments `wanted` (M,) s, each once."""
    rows = np.unique(nearest(times, wanted))
    frames = own["frame"][rows].astype(np.int64)
    uv = onto(frames, joints, grid.uv, grid.frames, grid.joints)
    lens = camera.intrinsics
    width, height, scale = lens.width, lens.height, min(1.0, SIDE / max(lens.width, lens.height))
    tile = (round(width * scale), round(height * scale))
    views = [view_of(width, height, tile, scale, one, camera.role == "long_range") for one in uv]
    through = uv if not uses_detections(camera, seen) else _detected(seen, frames, joints, min_score)
    return Shown(rows, times[rows], frames, views, uv, undistort(lens, through))


def uses_detections(camera: Camera, seen: Table | None) -> bool:
    """Whether the rays of a camera are those of its detections `seen`."""
    return seen is not None and camera.role == "close" and bool(len(seen["frame"]))


def _detected(seen: Table | None, frames: Ints, joints: list[str], min_score: float) -> Floats:
    """Detections (P, J, 2) px at `frames` (P,), NaN where one is missing or less sure than `min_score`."""
    rows = tables.rows(seen, np.isin(seen["frame"], frames)) if seen is not None else {"frame": np.empty(0)}
    if not len(rows["frame"]):
        return np.full((len(frames), len(joints), 2), np.nan)
    values, there, found = value_grid(rows, "frame", "u", "v", "score")
    with np.errstate(invalid="ignore"):
        sure = values[..., 2:] >= min_score
    return onto(frames, joints, np.where(sure, values[..., :2], np.nan), there, found)


def _pictures(
    own: Mapping[str, tuple[Table, Floats]],
    shown: Mapping[str, Shown],
    whole: set[tuple[str, int]],
    data_root: Path,
) -> tuple[dict[str, list[Picture]], dict[str, bytes]]:
    """camera -> its small pictures, all of one size; and file name -> WebP of the pictures that are shown whole."""
    from dior.ingest import bags

    tiles, large = {}, {}
    for camera, pictures in shown.items():
        wanted = tables.rows(own[camera][0], pictures.rows)
        # all views of a camera fit the picture as a whole
        width = max(view.size[0] for view in pictures.views)
        height = max(view.size[1] for view in pictures.views)
        found: dict[int, Picture] = {}
        for row, picture in bags.read_to_show(wanted, data_root):
            tile = shown_in(pictures.views[row], picture)
            cell = np.zeros((height, width, 3), np.uint8)
            cell[: tile.shape[0], : tile.shape[1]] = tile
            found[row] = cell
            frame = int(pictures.frames[row])
            if (camera, frame) in whole:
                large[f"{camera}.frame_{frame}.webp"] = _webp(picture, WHOLE_QUALITY)
        tiles[camera] = [found[row] for row in range(len(pictures.rows))]
    return tiles, large


def _encoded(tiles: Mapping[str, list[Picture]], most: float) -> dict[str, bytes]:
    """file name -> WebP of the sheets of each camera's small pictures, of the best quality that takes `most` bytes."""
    sheets = {camera: _sheets(own) for camera, own in tiles.items()}
    count = sum(map(len, tiles.values()))

    def fits(i: int) -> bool:
        # a few of each camera tell nearly what all of them take
        each = -(-COLUMNS * COLUMNS // len(tiles))
        some = [_webp(own[k * len(own) // each], QUALITIES[i]) for own in tiles.values() for k in range(each)]
        return sum(map(len, some)) * count <= SAFE * most * len(some)

    surely = count * TILE_BYTES <= most
    first = 0 if surely else bisect_left(range(len(QUALITIES) - 1), True, key=fits)
    for quality, effort in [*((quality, EFFORT) for quality in QUALITIES[first:]), (QUALITIES[-1], MORE_EFFORT)]:
        found = {
            f"{name}.{i}.webp": _webp(s, quality, effort) for name, own in sheets.items() for i, s in enumerate(own)
        }
        if sum(map(len, found.values())) <= most:
            break
    return found


def _sheets(tiles: list[Picture]) -> list[Picture]:
    """Pictures of one size in sheets of COLUMNS x COLUMNS, row by row; the last may have fewer rows."""
    each, sheets = COLUMNS * COLUMNS, []
    for first in range(0, len(tiles), each):
        part = tiles[first : first + each]
        part += [np.zeros_like(part[0])] * (-len(part) % COLUMNS)
        sheets.append(np.vstack([np.hstack(part[i : i + COLUMNS]) for i in range(0, len(part), COLUMNS)]))
    return sheets


def _webp(picture: Picture, quality: int, effort: int = EFFORT) -> bytes:
    from PIL import Image

    done = io.BytesIO()
    Image.fromarray(picture[..., ::-1]).save(done, "WEBP", quality=quality, method=effort)
    return done.getvalue()


def _scene(
    sequence: str,
    body: Mapping[str, Any],
    rig: Mapping[str, Camera],
    covariance: Floats,
    own: Mapping[str, tuple[Table, Floats]],
    shown: Mapping[str, Shown],
    found: Table | None,
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What the page is told in words and in arrays."""
    joints = body["joints"]
    steps, origin, step = scene_file.in_steps(body["points"])
    arrays: dict[str, NDArray[Any]] = {
        "instants": body["instants"].astype(np.int32),
        "time": _tenths(body["time"]),
        "joints": steps,
        "sigmas": scene_file.in_ratios(body["sigmas"]),
        "rhos": scene_file.in_parts(body["rhos"]),
    }
    colours, told = colours_of(rig), []
    for i, (name, camera) in enumerate(rig.items()):
        pictures, (table, times) = shown[name], own[name]
        arrays[f"{name} time"] = _tenths(times)
        arrays[f"{name} frames"] = table["frame"].astype(np.int32)
        arrays[f"{name} pictures"] = pictures.rows.astype(np.int32)
        arrays[f"{name} views"] = np.array([(*v.origin, v.scale) for v in pictures.views], np.float32)
        arrays[f"{name} labels"] = _whole(pictures.uv * PIXEL_STEPS)
        arrays[f"{name} rays"] = _whole(pictures.slopes * RAY_STEPS)
        seen = None if found is None else tables.of_camera(found, name)
        told.append(
            _camera(camera, covariance[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6])
            | {
                "colour": colours[name],
                "tile": [max(v.size[0] for v in pictures.views), max(v.size[1] for v in pictures.views)],
                "rays": "detections" if uses_detections(camera, seen) else "labels",
            }
        )
    sides = [names.side_of(joint)[0] for joint in joints]
    header = {
        "sequence": sequence, "joints": joints, "sides": sides, "bones": names.bones_of(joints).tolist(),
        "origin": origin, "step": step, "least": scene_file.LEAST_M, "ratio": scene_file.RATIO,
        "parts_of_rho": scene_file.PARTS, "columns": COLUMNS,
        "pixel_steps": PIXEL_STEPS, "time_steps": TIME_STEPS, "ray_steps": RAY_STEPS, "cameras": told,
        "colours": {side: _hex(colour) for side, colour in (("l", LEFT), ("r", RIGHT), ("m", MIDDLE))},
    }  # fmt: skip
    return header, arrays


def _camera(camera: Camera, covariance: Floats) -> dict[str, Any]:
    """A camera for the page: where it is and looks, what it sees without the lens, and the Cholesky factor (m) of the
    covariance of its centre, which makes the ellipsoid of a sphere; null where it is not known."""
    lens = camera.intrinsics
    corners = np.array([(-0.5, -0.5), (lens.width, -0.5), (lens.width, lens.height), (-0.5, lens.height)])
    straight = (corners - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
    seen = undistort(lens, corners)
    factor = None
    if np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0:
        factor = _rounded(np.linalg.cholesky(covariance), 6)
    return {
        "name": camera.name, "role": camera.role, "size": [lens.width, lens.height],
        "centre": _rounded(camera.centre, 4), "wRc": _rounded(camera.wRc, 6), "sigma": factor,
        "corners": _rounded(np.where(np.isfinite(seen), seen, straight), 5),
        "fov": round(float(np.degrees(2 * np.arctan(lens.height / 2 / lens.fy))), 3),
    }  # fmt: skip


def _hex(bgr: tuple[int, int, int]) -> str:
    """A colour of OpenCV's as pages have it."""
    return "#" + bytes(reversed(bgr)).hex()


def _rounded(values: NDArray[Any], digits: int) -> list[Any]:
    return (np.round(values, digits) + 0.0).tolist()


def _tenths(times: Floats) -> NDArray[np.int32]:
    """Times, s, in whole TIME_STEPS; those of a clock that is days off end where int32 does."""
    limits = np.iinfo(np.int32)
    return np.rint(np.clip(times * TIME_STEPS, limits.min, limits.max)).astype(np.int32)


def _whole(values: Floats) -> NDArray[np.int16]:
    """Values as int16, NONE where one is missing or too large."""
    known = np.isfinite(values).all(axis=-1, keepdims=True) & (np.abs(np.nan_to_num(values)) < 32767).all(
        axis=-1, keepdims=True
    )
    return np.where(known, np.rint(np.nan_to_num(values)), scene_file.NONE).astype(np.int16)
