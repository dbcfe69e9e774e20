"""Intrinsics from pictures of a chessboard or ChArUco board.

INPUTS   the camera YAML's `intrinsics: {chessboard: ...}` or `{charuco: ...}`: a folder of pictures or a bag
OUTPUTS  `Intrinsics` (plumb_bob, px) and findings: rms, pictures used, coverage, tilt

Board points are metres in the board's plane, pixels are recorded ones. What the pictures cannot tell is not estimated:
- The centre is free only where the boards cover half of the picture in 10 views or more, with normals 30 degrees apart;
  otherwise it is the middle of the picture. Of few views of a board that is never quite flat, an estimated centre is
  wrong by far more than its standard error and takes the focal length with it: the pictures of the shared data
  (6 views, 32 % covered) put it 26 px beside the maker's with a standard error of 3 px and fx 0.6 % too small; with the
  middle, fx is 0.1 % off.
- Where the centre is free and every view has the whole board, the board's own shape is estimated, too (Strobl and
  Hirzinger 2011, OpenCV's calibrateCameraRO). In simulation (fx 640, 10 views) a bow of 0.5 mm over 32 cm makes fx
  wrong by 0.9 % without and 0.2 % with it.
- k3 is free only where in addition the boards cover 60 % in 20 views. It acts in the corners alone: there it lowers the
  simulated error from 7 to 1 px, and raises it from 7 to 13 px where the board counts as flat.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Floats
from dior.errors import DiorError, nearest
from dior.geometry.camera import Intrinsics
from dior.ingest import bags as rosbag
from dior.ingest.containers import is_video
from dior.progress import reporting

SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff")
MOST_PICTURES = 120  # chosen: OpenCV's time grows with the cube, and a still board repeats itself
# three views determine a lens (Zhang 2000), ten to twenty are what guides to calibration ask for
FEWEST_VIEWS, FEW_VIEWS, MANY_VIEWS = 3, 10, 20
FEWEST_CORNERS = 6  # OpenCV's own limit for a pose in calibrateCamera
SAME_VIEW = 0.01  # chosen, of the picture's diagonal: a board that moved by less says nothing new
FLAT_GRID = 0.03  # chosen, of the board's size: a lens bends a grid by less
OUTLIER, OUTLIER_PX = 3.0, 0.3  # chosen: a view this many times as bad as the others, and by more than drawn corners
# chosen, `coverage` of the pictures: with less the distortion, k3 above all, is extrapolated
CENTRE_COVERAGE, K3_COVERAGE = 0.5, 0.6
# chosen: below the first a focal length and a distance look alike; the second is asked for in the findings
LEAST_TILT_DEG, GOOD_TILT_DEG = 10.0, 30.0
GOOD_RMS, MOST_RMS = 0.5 / 1280, 2.0 / 1280  # chosen, px per px of width: warned of, refused
HELD_SIGMA = 0.003  # chosen: as of intrinsics by the maker
MOST_FX_SD = 0.01  # chosen: 1 % of the focal length is 5 cm at 5 m


# grey, (height, width)
Picture: TypeAlias = NDArray[np.uint8]
# board points (N, 3) m and pixels (N, 2) of a picture
Detect: TypeAlias = Callable[[Picture], tuple[Floats, Floats]]
# names of pictures and why they were left out
Dropped: TypeAlias = tuple[tuple[str, str], ...]


@dataclass(frozen=True, eq=False)
class BoardViews:
    """Boards found in pictures of one size (width, height) px.

    `names` (V,), `points` V arrays (N, 3) m and `pixels` V arrays (N, 2) px. `looked_at` counts the pictures, those
    without a board included.
    """

    names: tuple[str, ...]
    points: tuple[Floats, ...]
    pixels: tuple[Floats, ...]
    size: tuple[int, int]
    looked_at: int

    def only(self, keep: Sequence[int]) -> "BoardViews":
        """The views at the indices `keep`."""
        names = tuple(self.names[i] for i in keep)
        points, pixels = (tuple(values[i] for i in keep) for values in (self.points, self.pixels))
        return BoardViews(names, points, pixels, self.size, self.looked_at)

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False)
class Calibration:
    """A lens and what it rests on.

    `view_px` (V,) rms per view of `views`, `coverage` share of the picture inside some board, `tilt_deg` the largest
    angle between two boards, `fx_sd` px, `bend_m` how far the board is from flat (NaN: assumed to be flat), `dropped`
    pairs of a picture's name and why, `fixed` what was not estimated.
    """

    lens: Intrinsics
    views: BoardViews
    view_px: Floats
    rms_px: float
    coverage: float
    tilt_deg: float
    fx_sd: float
    bend_m: float
    dropped: Dropped
    fixed: tuple[str, ...]


def from_board(
    kind: str, settings: dict[str, Any], data_root: AnyPath, where: str
) -> tuple[Intrinsics, list[tuple[str, str, str]]]:
    """Intrinsics and findings [(severity, code, text)] from the section `kind` of a camera's YAML.

    Raises DiorError, beginning with `where`, for pictures that cannot be read and boards that do not determine a lens.
    """
    path = Path(data_root) / settings["path"]
    views = find(pictures(path, settings.get("topic", ""), where), detector(kind, settings, where), f"{where}: {path}")
    done = calibrate(views, f"{where}: {path}")
    # a centre that was held in the middle is the maker's, no better
    sigma = done.fx_sd / done.lens.fx
    return replace(done.lens, sigma=max(sigma, HELD_SIGMA) if "centre" in done.fixed else sigma), findings(done)


def pictures(path: Path, topic: str, where: str) -> Iterator[tuple[str, Picture]]:
    """Yield (name, grey picture uint8 (height, width)) of a folder, by name, of a video or a bag's `topic`, by stamp.

    Of a bag or video at most 120 pictures are looked at, evenly spread.
    """
    if not topic and is_video(path):
        topic = "video0"
    if topic:
        yield from _of_bag(path, topic)
        return
    if path.is_file():
        raise DiorError(f"{where}: {path} is a file; for a bag give its image `topic` too, for pictures their folder")
    if not path.is_dir():
        raise DiorError(f"{where}: there is no folder {path}; the path of the board's pictures is below data_root")
    import cv2

    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    if not files:
        raise DiorError(f"{where}: {path} holds no picture ({', '.join(SUFFIXES)})")
    for file in files:
        picture: Any = cv2.imdecode(np.fromfile(file, np.uint8), flags) if file.stat().st_size else None
        if picture is None:
            raise DiorError(f"{where}: {file} is no readable picture; remove it or copy it again")
        yield file.name, picture


def _of_bag(path: Path, topic: str) -> Iterator[tuple[str, Picture]]:
    import cv2

    rosbag.bags_with([path], topic, "the board's pictures")
    rows = rosbag.index(path, [topic])
    rows["bag"] = np.full(len(rows["stamp_ns"]), path.name, object)
    order = np.argsort(rows["stamp_ns"], kind="stable")
    chosen = order[np.unique(np.linspace(0, len(order) - 1, min(len(order), MOST_PICTURES)).round().astype(int))]
    rows = {key: values[chosen] for key, values in rows.items()}
    for row, picture in reporting(rosbag.read_pictures(rows, path.parent), len(chosen), "pictures", path.name):
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)
        yield f"{path.name} {rows['stamp_ns'][row]}", grey


def detector(kind: str, settings: dict[str, Any], where: str) -> Detect:
    """A function from a grey picture to board points (N, 3) m and pixels (N, 2), empty where there is no board."""
    rows, columns, square = settings["rows"], settings["columns"], settings["square_m"]
    if kind == "chessboard":
        return lambda grey: _chessboard(grey, rows, columns, square)
    import cv2

    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    name = f"DICT_{settings['dictionary'].upper().removeprefix('DICT_')}"
    if name not in names:
        raise DiorError(
            f"{where}: `charuco.dictionary` '{settings['dictionary']}' is not one of OpenCV's{nearest(name, names)}"
        )
    if not settings["marker_m"] < square:
        raise DiorError(f"{where}: `charuco.marker_m` must be smaller than `square_m`, {square} m")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    boards = []
    for legacy in (False, True):
        # boards printed with OpenCV before 4.6 have the other colour in the corner where the rows are even
        board = cv2.aruco.CharucoBoard((columns + 1, rows + 1), square, settings["marker_m"], dictionary)
        board.setLegacyPattern(legacy)
        boards.append((cv2.aruco.CharucoDetector(board), np.asarray(board.getChessboardCorners(), float)))
    return lambda grey: max((_charuco(grey, *board) for board in boards), key=lambda found: len(found[0]))


def _chessboard(grey: Picture, rows: int, columns: int, square: float) -> tuple[Floats, Floats]:
    import cv2

    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(grey, (columns, rows), flags=flags)
    if not found:
        return np.empty((0, 3)), np.empty((0, 2))
    grid = corners.reshape(rows, columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1)]
    # a window that reaches the next corner would be drawn to it
    half = int(np.clip(min(steps) / 2 - 1, 2, 11))
    end = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    refined: Any = cv2.cornerSubPix(grey, corners, (half, half), (-1, -1), end)
    across, down = np.meshgrid(np.arange(columns), np.arange(rows))
    points = np.zeros((rows * columns, 3))
    points[:, 0], points[:, 1] = across.ravel() * square, down.ravel() * square
    return points, refined.reshape(-1, 2).astype(float)


def _charuco(grey: Picture, detector: Any, corners: Floats) -> tuple[Floats, Floats]:
    pixels, ids = detector.detectBoard(grey)[:2]
    if ids is None or len(ids) < FEWEST_CORNERS:
        return np.empty((0, 3)), np.empty((0, 2))
    return corners[np.ravel(ids)], np.asarray(pixels, float).reshape(-1, 2)


def find(named_pictures: Iterable[tuple[str, Picture]], detect: Detect, where: str) -> BoardViews:
    """`BoardViews` of the boards in (name, grey picture) pairs. Raises DiorError for pictures of different sizes."""
    names: list[str] = []
    points: list[Floats] = []
    pixels: list[Floats] = []
    size, first, count = (0, 0), "", 0
    for name, grey in named_pictures:
        height, width = grey.shape
        if not count:
            size, first = (width, height), name
        count += 1
        if (width, height) != size:
            raise DiorError(
                f"{where}: {name} is {width}x{height} where {first} is {size[0]}x{size[1]}; "
                "use pictures of the recorded resolution only"
            )
        xyz, uv = detect(grey)
        if len(xyz) and np.linalg.matrix_rank(xyz[:, :2] - xyz[0, :2]) == 2:
            names.append(name)
            points.append(xyz)
            pixels.append(uv)
    return BoardViews(tuple(names), tuple(points), tuple(pixels), size, count)


def calibrate(views: BoardViews, where: str) -> Calibration:
    """`Calibration` from `BoardViews`, by OpenCV (Zhang 2000), after views that are wrong or repeated were dropped.

    Raises DiorError, beginning with `where`, for fewer than 3 views, boards that are all parallel, an rms above 2 px
    (of 1280) and a focal length known to no better than 1 %.
    """
    _check_count(views, where, ())
    views, dropped = _distinct(views)
    views, crooked = _planar(views)
    dropped += crooked
    while True:
        _check_count(views, where, dropped)
        solved = _solve(views)
        tilt, covered = _tilt_deg(solved.rotations), coverage(views)
        centre_free = covered >= CENTRE_COVERAGE and len(views) >= FEW_VIEWS and tilt >= GOOD_TILT_DEG
        if centre_free:
            solved = _solve(views, centre_free)
        worst = int(np.argmax(solved.view_px))
        rest = np.median(np.delete(solved.view_px, worst))
        if solved.view_px[worst] <= max(OUTLIER * rest, OUTLIER_PX * views.size[0] / 1280):
            break
        why = f"its corners fit to {solved.view_px[worst]:.2f} px where the others fit to {rest:.2f} px"
        dropped += ((views.names[worst], why),)
        views = views.only([i for i in range(len(views)) if i != worst])
    shape_free = centre_free and _whole(views)
    k3_free = shape_free and covered >= K3_COVERAGE and len(views) >= MANY_VIEWS
    if shape_free:
        solved = _solve(views, centre_free, k3_free, shape_free)
    fixed = (() if centre_free else ("centre",)) + (() if k3_free else ("k3",))
    done = Calibration(
        solved.lens, views, solved.view_px, solved.rms_px, covered, tilt, solved.fx_sd, solved.bend_m, dropped, fixed
    )
    _check_end(done, where)
    return done


def coverage(views: BoardViews) -> float:
    """Share of the picture's area that lies inside the outline of at least one board."""
    import cv2

    mask = np.zeros((200, 200), np.uint8)
    for pixels in views.pixels:
        outline = cv2.convexHull((pixels / views.size * mask.shape).astype(np.int32))
        cv2.fillConvexPoly(mask, outline, 1)
    return float(mask.mean())


@dataclass(frozen=True, eq=False)
class _Solved:
    lens: Intrinsics
    rms_px: float
    view_px: Floats
    rotations: Floats
    fx_sd: float
    bend_m: float


def _solve(views: BoardViews, centre_free: bool = False, k3_free: bool = False, shape_free: bool = False) -> _Solved:
    import cv2

    flags = (0 if centre_free else cv2.CALIB_FIX_PRINCIPAL_POINT) | (0 if k3_free else cv2.CALIB_FIX_K3)
    points = [xyz.astype(np.float32) for xyz in views.points]
    pixels = [uv.astype(np.float32).reshape(-1, 1, 2) for uv in views.pixels]
    bend, threads = np.nan, cv2.getNumThreads()
    # several threads add in another order each time, and the last digits with them
    cv2.setNumThreads(1)
    if shape_free:
        # two corners and the height of a third are fixed, the last of the first row among them
        last = int((points[0][:, 1] == 0).sum()) - 1
        # OpenCV's types forbid the None that its documentation asks for
        rms, K, D, turns, _, shape, sd, _, _, view_px = cv2.calibrateCameraROExtended(  # type: ignore[call-overload]
            points, pixels, views.size, last, None, None, flags=flags
        )
        bend = _bend_m(np.asarray(shape, float).reshape(-1, 3))
    else:
        rms, K, D, turns, _, sd, _, view_px = cv2.calibrateCameraExtended(  # type: ignore[call-overload]
            points, pixels, views.size, None, None, flags=flags
        )
    cv2.setNumThreads(threads)
    fx, fy, cx, cy = (float(value) for value in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    lens = Intrinsics(*views.size, fx, fy, cx, cy, "plumb_bob", tuple(D.ravel()[:5].tolist()))
    rotations = np.stack([cv2.Rodrigues(turn)[0] for turn in turns])
    return _Solved(lens, float(rms), np.ravel(view_px), rotations, float(np.ravel(sd)[0]), bend)


def _whole(views: BoardViews) -> bool:
    """Whether every view shows all corners of one board, in one order."""
    first = views.points[0]
    whole = len(first) == len(np.unique(first[:, 0])) * len(np.unique(first[:, 1]))
    return whole and all(xyz.shape == first.shape and (xyz == first).all() for xyz in views.points)


def _bend_m(shape: Floats) -> float:
    """Largest distance (m) of the points (N, 3) from the plane through them."""
    away = shape - shape.mean(axis=0)
    return float(np.abs(away @ np.linalg.svd(away)[2][2]).max())


def _tilt_deg(rotations: Floats) -> float:
    """Largest angle between the normals of two boards: parallel boards say nothing of the focal length."""
    normals = rotations[:, :, 2]
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1)).max()))


def _distinct(views: BoardViews) -> tuple[BoardViews, Dropped]:
    """Without the views that repeat an earlier one: a board that was not moved would count many times."""
    near = SAME_VIEW * np.hypot(*views.size)
    kept: list[int] = []
    dropped: Dropped = ()
    for i, (xyz, uv) in enumerate(zip(views.points, views.pixels, strict=True)):
        same = [j for j in kept if _moved_px(xyz, uv, views.points[j], views.pixels[j]) < near]
        if same:
            dropped += ((views.names[i], f"the board is where it was in {views.names[same[0]]}"),)
        else:
            kept.append(i)
    return views.only(kept), dropped


def _moved_px(xyz: Floats, uv: Floats, other_xyz: Floats, other_uv: Floats) -> float:
    """Mean distance of the corners that two views share; infinite for fewer than half of them."""
    place = {tuple(point): pixel for point, pixel in zip(other_xyz.round(6).tolist(), other_uv, strict=True)}
    keys = [tuple(point) for point in xyz.round(6).tolist()]
    moved = [np.linalg.norm(pixel - place[key]) for pixel, key in zip(uv, keys, strict=True) if key in place]
    return float(np.mean(moved)) if len(moved) >= len(xyz) / 2 else np.inf


def _planar(views: BoardViews) -> tuple[BoardViews, Dropped]:
    """Without the views whose corners are no picture of a plane grid, that is, a wrong detection.

    A homography leaves only the lens' distortion, whatever the focal length is.
    """
    import cv2

    kept: list[int] = []
    dropped: Dropped = ()
    for i, (xyz, uv) in enumerate(zip(views.points, views.pixels, strict=True)):
        H, _ = cv2.findHomography(xyz[:, :2], uv)
        size = np.linalg.norm(uv.max(axis=0) - uv.min(axis=0))
        off = np.inf
        if H is not None:
            mapped = np.c_[xyz[:, :2], np.ones(len(xyz))] @ H.T
            off = np.sqrt(np.mean(np.sum((mapped[:, :2] / mapped[:, 2:] - uv) ** 2, axis=1)))
        if off < FLAT_GRID * size:
            kept.append(i)
        else:
            dropped += ((views.names[i], "its corners do not form a flat grid, so they were mistaken"),)
    return views.only(kept), dropped


def _check_count(views: BoardViews, where: str, dropped: Dropped) -> None:
    if len(views) >= FEWEST_VIEWS:
        return
    left = f", {len(dropped)} of them left out ({dropped[0][0]}: {dropped[0][1]})" if dropped else ""
    raise DiorError(
        f"{where}: a board was found in {len(views) + len(dropped)} of {views.looked_at} pictures{left}, at least "
        f"{FEWEST_VIEWS} different views are needed; do `rows` and `columns` count the inner corners, and is the whole "
        "board in the pictures?"
    )


def _check_end(done: Calibration, where: str) -> None:
    width = done.lens.width
    if done.tilt_deg < LEAST_TILT_DEG:
        raise DiorError(
            f"{where}: the boards are within {done.tilt_deg:.0f} degrees of parallel, which says nothing of the focal "
            f"length; tilt the board by {GOOD_TILT_DEG:.0f} degrees to all sides"
        )
    if done.rms_px > MOST_RMS * width:
        raise DiorError(
            f"{where}: the boards fit to an rms of {done.rms_px:.2f} px, above {MOST_RMS * width:.1f} px; is the board "
            "flat, the shutter short, and `rows` and `columns` right?"
        )
    if not done.fx_sd < MOST_FX_SD * done.lens.fx:
        raise DiorError(
            f"{where}: the focal length {done.lens.fx:.0f} px is known to {done.fx_sd:.0f} px only; take more "
            f"pictures, nearer and tilted by {GOOD_TILT_DEG:.0f} degrees"
        )


def findings(done: Calibration) -> list[tuple[str, str, str]]:
    """What a person should see of a calibration: (severity, code, text) tuples."""
    lens, views = done.lens, done.views
    kept = {"centre": "the centre is held in the middle of the picture", "k3": "k3 at 0"}
    text = (
        f"{len(views)} of {views.looked_at} pictures used, rms {done.rms_px:.3f} px, fx {lens.fx:.1f} (sd "
        f"{done.fx_sd:.1f}) px, fy {lens.fy:.1f} px, {done.coverage:.0%} of the picture covered, boards tilted by up "
        f"to {done.tilt_deg:.0f} degrees"
    )
    bent = [] if np.isnan(done.bend_m) else [f"the board is up to {1000 * done.bend_m:.1f} mm from flat"]
    found = [("info", "board_calibration", "; ".join([text, *bent, *(kept[key] for key in done.fixed)]))]
    if "centre" in done.fixed:
        asked = f"{CENTRE_COVERAGE:.0%} coverage, {FEW_VIEWS} views and {GOOD_TILT_DEG:.0f} degrees of tilt"
        text = f"{len(views)} views, {done.coverage:.0%} coverage, {done.tilt_deg:.0f} degrees of tilt: too little to "
        found.append(("warning", "board_coverage", f"{text}find the lens' centre; take more pictures ({asked})"))
    if done.rms_px > GOOD_RMS * lens.width:
        text = f"rms {done.rms_px:.2f} px is above {GOOD_RMS * lens.width:.2f} px; is the board flat and held still?"
        found.append(("warning", "board_rms", text))
    if abs(lens.fx / lens.fy - 1) > 0.02:
        text = f"fx {lens.fx:.1f} and fy {lens.fy:.1f} px differ by more than 2 %; are the squares square?"
        found.append(("warning", "board_aspect", text))
    return found + [("info", "board_dropped", f"{name} is left out: {why}") for name, why in done.dropped]
