"""Contact sheets: a few pictures of every camera of a sequence with the labels drawn on them.

INPUTS   frames table, the pictures it indexes, `labels_2d` files, and where there are any: `detections`, `swaps` and
         hand boxes
OUTPUT   <out>/<camera>.jpg: the best, the median and the worst frame (picture_choice.py) side by side. Long-range
         pictures are enlarged around the subject.
Drawing happens in tile pixels: a picture is scaled first, so that lines stay thin and sharp.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dior.arrays import Bools, Floats, Ints, Table
from dior.body import names
from dior.errors import DiorError, nearest
from dior.evaluate import labels_in_boxes
from dior.evaluate.grids import LabelGrid, distance, label_grids, onto, value_grid
from dior.geometry.camera import occluded_edge
from dior.geometry.camera_tables import read_cameras
from dior.project import boxes as hand_boxes
from dior.report import picture_choice
from dior.report.colours import BOX, DETECTION, LEFT, MIDDLE, OUTLIER, RIGHT
from dior.tables import tables
from dior.tables.files import folder_written_whole

# BGR (H, W, 3) uint8; OpenCV's own types are wider
Picture: TypeAlias = NDArray[Any]
# px; chosen: three side by side fit a wide screen
TILE = (640, 360)
# chosen: a person 22 px tall becomes 176, and single pixels can still be told apart
ZOOM = 8.0
CAPTION_HEIGHT = 26  # px, one line of text
# chosen: thin lines keep their colour, and a page of sheets still loads on a phone
JPEG_QUALITY = 85
# a label further than this from the detection is drawn red, as a share of the person's height in the picture; chosen:
# more than the width of a limb
OUTLIER_OF_HEIGHT = 0.1


@dataclass(frozen=True)
class TileView:
    """Part of a picture shown in a tile: `tile = (picture - origin + 0.5) * scale - 0.5`, px."""

    origin: tuple[float, float]
    scale: float
    size: tuple[int, int]

    def of(self, uv: ArrayLike) -> Floats:
        """Pixels (..., 2) of the picture in the tile."""
        return (np.asarray(uv, float) - self.origin + 0.5) * self.scale - 0.5


def run(
    *,
    sequence: str,
    frames: Path,
    data_root: Path,
    labels: list[Path],
    detections: Path | None,
    swaps: Path | None,
    min_score: float,
    boxes: dict[str, Path],
    cameras: list[Path],
    roles: dict[str, str],
    per_camera: int,
    out: Path,
) -> None:
    """Write `<out>/<camera>.jpg` for every camera with labels.

    `labels`: label files, `boxes`: camera -> CSV, `cameras`: the poses of all; `roles`: camera -> close | long_range;
    `per_camera`: how many pictures are drawn. `detections` and `swaps` may be None.
    """
    import cv2

    from dior.ingest import bags

    grids = label_grids(labels)
    index = tables.read(frames, "frames")
    found = None if detections is None else tables.read(detections, "detections")
    exchanged = None if swaps is None else tables.read(swaps, "swaps", ["camera", "frame", "swapped", "part"])
    rig = read_cameras(cameras)
    chosen = {}
    for camera, grid in grids.items():
        boxed = (
            hand_boxes.read(boxes[camera], grid.frames) if camera in boxes else (np.array([], int), np.empty((0, 4)))
        )
        inside = None
        if len(boxed[0]):
            inside = labels_in_boxes.share(grid, labels_in_boxes.of_frames(grid, *boxed), occluded_edge(rig[camera]))
        seen = None if found is None else tables.of_camera(found, camera)
        how = picture_choice.measured(grid, roles[camera], seen, _exchanged(exchanged, camera), inside, min_score)
        ranked = picture_choice.by_rank(grid.frames, *how, per_camera) if how else []
        chosen[camera] = (ranked or picture_choice.spread(grid.frames, per_camera), boxed)
    wanted = np.zeros(len(index["frame"]), bool)
    for camera, (numbers, _) in chosen.items():
        wanted |= (index["camera"] == camera) & np.isin(index["frame"], [number for number, _ in numbers])
    picked = tables.rows(index, wanted)
    pictures = {
        (picked["camera"][row], int(picked["frame"][row])): picture
        for row, picture in bags.read_to_show(picked, Path(data_root))
    }
    sheets = {}
    for camera, (numbers, boxed) in chosen.items():
        tiles = []
        for number, words in numbers:
            picture = pictures.get((camera, number))
            if picture is None:
                raise DiorError(
                    f"sequence {sequence}, camera {camera}: the frame index has no picture {number}"
                    f"{nearest(camera, np.unique(index['camera'].astype(str)))}; run the frames step again"
                )
            shown = None if found is None else _detected(tables.of_camera(found, camera), number, min_score)
            tile = _tile(picture, grids[camera], number, shown, _box(boxed, number), roles[camera])
            tiles.append(captioned(tile, f"{sequence} {camera} frame {number}{', ' if words else ''}{words}"))
        done, jpeg = cv2.imencode(".jpg", side_by_side(tiles), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not done:
            raise DiorError(f"sequence {sequence}, camera {camera}: the contact sheet could not be written as JPEG")
        sheets[camera] = jpeg.tobytes()
    with folder_written_whole(out) as folder:
        for camera, sheet in sheets.items():
            (folder / f"{camera}.jpg").write_bytes(sheet)


def view_of(width: int, height: int, tile: tuple[int, int], whole: float, uv: Floats, zoomed: bool) -> TileView:
    """The `TileView` of a picture in a tile (width, height): all of it at the scale `whole`, or enlarged around the
    points `uv` (..., 2).

    Enlarged ZOOM times, less where the person would not fit, and never smaller than the whole picture.
    """
    known = uv[np.isfinite(uv).all(axis=-1)]
    if not zoomed or not len(known):
        return TileView((0.0, 0.0), whole, (round(width * whole), round(height * whole)))
    first, last = known.min(axis=0), known.max(axis=0)
    span = np.maximum(last - first, 1.0)
    scale = max(whole, min(ZOOM, *(0.7 * np.array(tile) / span)))
    part = np.minimum(np.array(tile) / scale, (width, height))
    origin = np.clip(np.round((first + last) / 2 - part / 2), 0, np.array([width, height]) - part)
    wide, high = (int(round(side)) for side in part * scale)
    return TileView(tuple(origin.tolist()), float(scale), (wide, high))


def _exchanged(swaps: Table | None, camera: str) -> Table | None:
    """The rows of `swaps` of a camera."""
    return None if swaps is None else tables.of_camera(swaps, camera)


def _detected(table: Table, number: int, min_score: float) -> tuple[Floats, list[str]] | None:
    rows = tables.rows(table, table["frame"] == number)
    if not len(rows["frame"]):
        return None
    values, _, joints = value_grid(rows, "frame", "u", "v", "score")
    with np.errstate(invalid="ignore"):
        sure = values[0, :, 2] >= min_score
    return np.where(sure[:, None], values[0, :, :2], np.nan), joints


def _box(boxed: tuple[Ints, Floats], number: int) -> Floats | None:
    frames, edges = boxed
    return edges[frames == number][0] if (frames == number).any() else None


def _tile(
    picture: Picture, grid: LabelGrid, number: int, seen: tuple[Floats, list[str]] | None, box: Floats | None, role: str
) -> Picture:
    import cv2

    height, width = picture.shape[:2]
    uv = grid.uv[np.flatnonzero(grid.frames == number)[0]]
    same_area = float(np.sqrt(TILE[0] * TILE[1] / (width * height)))
    view = view_of(width, height, TILE, same_area, uv, role == "long_range")
    canvas = shown_in(view, picture)
    off = np.full(len(grid.joints), np.nan)
    if seen is not None:
        seen_uv, joints = seen
        off = distance(uv, onto(np.array([0]), grid.joints, seen_uv[None], np.array([0]), joints)[0])
        _crosses(canvas, view.of(seen_uv))
    if box is not None:
        corners = view.of(np.array([[box[0] - 0.5, box[1] - 0.5], [box[2] + 0.5, box[3] + 0.5]]))
        cv2.rectangle(canvas, _point(corners[0]), _point(corners[1]), BOX, 1, cv2.LINE_AA)
    draw_skeleton(canvas, view.of(uv), grid.joints, off > OUTLIER_OF_HEIGHT * _height(uv))
    return canvas


def shown_in(view: TileView, picture: Picture) -> Picture:
    """The part of a picture that a `TileView` shows, at its scale."""
    import cv2

    if view.scale > 1:
        to_tile = np.array([[view.scale, 0, 0], [0, view.scale, 0]])
        to_tile[:, 2] = view.of((0.0, 0.0))
        return cv2.warpAffine(picture, to_tile, view.size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    # warpAffine skips pixels when it shrinks
    left, top = (int(edge) for edge in view.origin)
    wide, high = (round(side / view.scale) for side in view.size)
    part, whole = picture[top : top + high, left : left + wide], int(1 / view.scale)
    if whole > 1:
        # areas of whole pixels are several times as fast as others
        part = cv2.resize(part, (wide // whole, high // whole), interpolation=cv2.INTER_AREA)
    return cv2.resize(part, view.size, interpolation=cv2.INTER_LINEAR)


def _height(uv: Floats) -> float:
    known = uv[np.isfinite(uv).all(axis=1)]
    return max(float(np.ptp(known[:, 1])), 1.0) if len(known) else np.inf


def _point(xy: Floats) -> tuple[int, int]:
    return int(round(float(xy[0]))), int(round(float(xy[1])))


def _colour(joint: str) -> tuple[int, int, int]:
    if names.mirrored(joint) == joint:
        return MIDDLE
    return LEFT if joint[0] in "lL" else RIGHT


def draw_skeleton(canvas: Picture, uv: Floats, joints: Sequence[str], outlier: Bools) -> None:
    """Draw labels uv (J, 2) px of a BGR canvas, NaN for none; those that are `outlier` (J,) in red."""
    import cv2

    known = np.all(np.isfinite(uv), axis=1)
    for a, b in names.bones_of(joints):
        if known[a] and known[b]:
            sides = {_colour(joints[a]), _colour(joints[b])}
            colour = sides.pop() if len(sides) == 1 else MIDDLE
            cv2.line(canvas, _point(uv[a]), _point(uv[b]), colour, 1, cv2.LINE_AA)
    for i in np.flatnonzero(known).tolist():
        colour = OUTLIER if outlier[i] else _colour(joints[i])
        cv2.circle(canvas, _point(uv[i]), 3, (20, 20, 20), -1, cv2.LINE_AA)
        cv2.circle(canvas, _point(uv[i]), 2, colour, -1, cv2.LINE_AA)


def _crosses(canvas: Picture, uv: Floats) -> None:
    import cv2

    for point in uv[np.isfinite(uv).all(axis=1)]:
        x, y = _point(point)
        cv2.line(canvas, (x - 2, y - 2), (x + 2, y + 2), DETECTION, 1)
        cv2.line(canvas, (x - 2, y + 2), (x + 2, y - 2), DETECTION, 1)


def captioned(canvas: Picture, text: str) -> Picture:
    import cv2

    band = np.full((CAPTION_HEIGHT, canvas.shape[1], 3), 32, np.uint8)
    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 1)
    size = 0.45 * min(1.0, (canvas.shape[1] - 12) / max(width, 1))
    cv2.putText(band, text, (6, 17), cv2.FONT_HERSHEY_SIMPLEX, size, (240, 240, 240), 1, cv2.LINE_AA)
    return np.vstack([canvas, band])


def side_by_side(tiles: list[Picture]) -> Picture:
    height = max(tile.shape[0] for tile in tiles)
    padded = []
    for i, tile in enumerate(tiles):
        below = np.full((height - tile.shape[0], tile.shape[1], 3), 32, np.uint8)
        gap = np.full((height, 4 if i else 0, 3), 255, np.uint8)
        padded += [gap, np.vstack([tile, below])]
    return np.hstack(padded)
