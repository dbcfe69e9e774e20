"""Intrinsics from boards: the real chessboard pictures, and boards seen by a known lens."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dior.calibrate import intrinsics
from dior.calibrate.lens import board
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, in_frame, project
from dior.tables import tables
from tests.ingest.test_bags import T0, TOPIC, compressed, encoded, write_bag
from tests.rig import D455

CHESSBOARD = {"path": "chessboard", "rows": 7, "columns": 4, "square_m": 0.06}
CHARUCO = {"path": "pictures", "rows": 6, "columns": 8, "square_m": 0.04, "marker_m": 0.03, "dictionary": "5X5_100"}
LENS = Intrinsics(1280, 720, 633.0, 633.6, 645.2, 352.1, "plumb_bob", D455)


def grid(rows=6, columns=8, square=0.04):
    across, down = np.meshgrid(np.arange(columns), np.arange(rows))
    return np.stack([across, down, 0 * down], axis=-1).reshape(-1, 3) * square


def seen(count, seed=0, bow_m=0.0, noise_px=0.1, tilt=0.6, near=(0.3, 0.6)):
    """Views of a board that is bowed by `bow_m` (and taken for flat), held before LENS."""
    rng, xyz = np.random.default_rng(seed), grid()
    away = (xyz - xyz.mean(axis=0))[:, :2] / 0.16
    bowed = xyz - xyz.mean(axis=0) + np.c_[0 * away, bow_m * (away**2).sum(axis=1)]
    pixels = []
    while len(pixels) < count:
        turn = Rotation.from_rotvec([*rng.uniform(-tilt, tilt, 2), rng.uniform(-0.3, 0.3)]).as_matrix()
        z = rng.uniform(*near)
        uv, _ = project(Camera("", LENS, np.eye(4)), bowed @ turn.T + np.array([*rng.uniform(-1, 1, 2), 1]) * z)
        if in_frame(LENS, uv).all():
            pixels.append(uv + noise_px * rng.normal(size=uv.shape))
    names = tuple(f"{i:02d}.png" for i in range(count))
    return board.BoardViews(names, (xyz,) * count, tuple(pixels), (1280, 720), count)


def test_real_chessboard(shared):
    lens, findings = board.from_board("chessboard", CHESSBOARD, shared, "beam, cam01")
    assert lens.fx == pytest.approx(1681.245, rel=0.002)
    text = dict((code, text) for _, code, text in findings)
    assert text["board_calibration"].startswith("6 of 7 pictures used, rms 0.2")
    assert "too little to find the lens' centre" in text["board_coverage"]
    assert (lens.width, lens.height, lens.cx, lens.cy) == (1088, 1920, 543.5, 959.5) and lens.distortion[4] == 0
    assert board.from_board("chessboard", CHESSBOARD | {"rows": 4, "columns": 7}, shared, "")[0].fx == pytest.approx(
        lens.fx, rel=1e-5
    )


def test_the_step_writes_intrinsics_and_findings(shared, tmp_path):
    frames = {"camera": ["cam01"], "frame": [0], "stamp_ns": [T0], "receive_ns": [T0], "bag": ["pc1.bag"]}
    frames |= {"topic": [TOPIC], "nth": [0], "height": [1920], "width": [1088]}
    tables.write(tmp_path / "frames.parquet", "frames", frames)
    given = {
        "session": "beam", "camera": "cam01", "role": "close", "topic": TOPIC, "source": "board", "name": "",
        "board": {"chessboard": CHESSBOARD}, "distortion_model": "", "frames": tmp_path / "frames.parquet",
        "sequence": "beam", "data_root": shared,
    }  # fmt: skip
    for run in ("a", "b"):
        intrinsics.run(**given, out=tmp_path / f"{run}.parquet", findings=tmp_path / f"{run}.findings.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    assert camera_tables.read_cameras(tmp_path / "a.parquet")["cam01"].intrinsics.model == "plumb_bob"
    found = tables.read(tmp_path / "a.findings.parquet", "findings")
    assert set(found["scope"]) == {"beam/cam01"} and "board_coverage" in found["code"]


@pytest.mark.slow
def test_many_views_of_a_bent_board_give_the_lens():
    done = board.calibrate(seen(24, bow_m=0.001), "")
    assert done.fixed == () and done.coverage > 0.6 and 30 < done.tilt_deg < 100
    assert done.lens.fx == pytest.approx(LENS.fx, rel=0.002)
    assert np.hypot(done.lens.cx - LENS.cx, done.lens.cy - LENS.cy) < 3
    assert done.bend_m == pytest.approx(0.001, rel=0.5)
    assert done.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.15)
    flat = board._solve(done.views, centre_free=True).lens
    assert abs(flat.fx / LENS.fx - 1) > 3 * abs(done.lens.fx / LENS.fx - 1)


@pytest.mark.parametrize(("count", "near"), [(6, (0.3, 0.6)), (15, (1.2, 1.5))])
def test_few_or_far_views_hold_the_centre_and_k3(count, near):
    done = board.calibrate(seen(count, near=near), "")
    assert done.fixed == ("centre", "k3") and (done.lens.cx, done.lens.cy) == (639.5, 359.5)
    assert done.lens.distortion[4] == 0 and np.isnan(done.bend_m)
    assert any(code == "board_coverage" for _, code, _ in board.findings(done))


@pytest.mark.slow
def test_a_wrong_a_blurred_and_a_repeated_picture_are_left_out():
    views, rng = seen(14), np.random.default_rng(5)
    pixels = list(views.pixels)
    pixels[3] = pixels[3].reshape(6, 8, 2)[:, ::-1].transpose(1, 0, 2).reshape(-1, 2)
    pixels[7] = pixels[7] + 3.0 * rng.normal(size=pixels[7].shape)
    pixels[9] = pixels[8] + 1.0
    broken = board.BoardViews(views.names, views.points, tuple(pixels), views.size, 14)
    done = board.calibrate(broken, "")
    why = dict(done.dropped)
    assert set(why) == {"03.png", "07.png", "09.png"}
    assert "flat grid" in why["03.png"] and "fit to" in why["07.png"] and "where it was in 08.png" in why["09.png"]
    assert done.lens.fx == pytest.approx(LENS.fx, rel=0.004)


def test_views_that_determine_no_lens_are_refused():
    with pytest.raises(DiorError, match=r"cam01: a board was found in 2 of 2 pictures, at least 3"):
        board.calibrate(seen(2), "cam01")
    with pytest.raises(DiorError, match="within . degrees of parallel"):
        board.calibrate(seen(8, tilt=0.0), "cam01")
    with pytest.raises(DiorError, match="fit to an rms of .* px, above 2.0 px"):
        board.calibrate(seen(8, noise_px=4.0), "cam01")


def drawn(corners_board, size, turn, move):
    """A picture of a ChArUco board by a lens without distortion, from a drawing of 20 px per cm."""
    image = corners_board.generateImage((size[0] * 80, size[1] * 80), marginSize=0)
    to_board = np.diag([0.04 / 80, 0.04 / 80, 1.0]) @ np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    K = np.array([[633.0, 0, 639.5], [0, 633.0, 359.5], [0, 0, 1]])
    rt = np.c_[Rotation.from_rotvec(turn).as_matrix()[:, :2], move]
    H = K @ rt @ np.array([[1, 0, -0.18], [0, 1, -0.14], [0, 0, 1]]) @ to_board
    return cv2.warpPerspective(image, H, (1280, 720), flags=cv2.INTER_AREA, borderValue=200)


@pytest.mark.parametrize("legacy", [False, True])
def test_a_drawn_charuco_board_in_a_folder_and_in_a_bag(tmp_path, legacy):
    """The pattern of OpenCV before 4.6 differs where the rows of squares are even."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    size = (9, 8) if legacy else (9, 7)
    corners_board = cv2.aruco.CharucoBoard(size, 0.04, 0.03, dictionary)
    corners_board.setLegacyPattern(legacy)
    rng, folder = np.random.default_rng(0), tmp_path / "pictures"
    folder.mkdir()
    pictures = []
    for i in range(6):
        move = np.array([*rng.uniform(-0.12, 0.12, 2), rng.uniform(0.4, 0.6)])
        pictures.append(drawn(corners_board, size, [*rng.uniform(-0.6, 0.6, 2), 0.1], move))
        cv2.imwrite(str(folder / f"{i}.png"), pictures[-1])
    settings = CHARUCO | {"rows": size[1] - 1}
    lens, findings = board.from_board("charuco", settings, tmp_path, "cam01")
    assert lens.fx == pytest.approx(633, rel=0.005) and "6 of 6 pictures used" in findings[0][2]
    if not legacy:
        messages = [(TOPIC, T0 + i, compressed(T0 + i, encoded(p))) for i, p in enumerate(pictures)]
        write_bag(tmp_path / "board.bag", messages)
        again, _ = board.from_board("charuco", settings | {"path": "board.bag", "topic": TOPIC}, tmp_path, "cam01")
        assert again.fx == pytest.approx(lens.fx, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "change", "text"),
    [
        ("chessboard", {"path": "nowhere"}, "cam01: there is no folder"),
        ("chessboard", {"path": "empty"}, "holds no picture"),
        ("chessboard", {"path": "a.txt"}, "is a file; for a bag give its image `topic`"),
        ("chessboard", {"path": "broken"}, "1.png is no readable picture"),
        ("chessboard", {"path": "sizes"}, "2.png is 30x20 where 1.png is 40x20"),
        ("chessboard", {"path": "grey"}, "found in 0 of 2 pictures, at least 3"),
        (
            "charuco",
            {"path": "grey", "dictionary": "5X5_10"},
            "'5X5_10' is not one of OpenCV's .did you mean",
        ),
        ("charuco", {"path": "grey", "marker_m": 0.05}, "must be smaller than `square_m`"),
    ],
)
def test_pictures_that_cannot_be_used(tmp_path, kind, change, text):
    for folder in ("empty", "broken", "sizes", "grey"):
        (tmp_path / folder).mkdir()
    (tmp_path / "a.txt").write_text("x")
    (tmp_path / "broken/1.png").write_bytes(b"\x89PNG\r\n")
    for folder, sizes in (("sizes", [(20, 40), (20, 30)]), ("grey", [(200, 300), (200, 300)])):
        for i, shape in enumerate(sizes):
            cv2.imwrite(str(tmp_path / folder / f"{i + 1}.png"), np.full(shape, 90, np.uint8))
    settings = (CHARUCO if kind == "charuco" else CHESSBOARD) | change
    with pytest.raises(DiorError, match=text):
        board.from_board(kind, settings, tmp_path, "cam01")


def test_a_view_that_fits_much_worse_than_the_others_is_left_out():
    views = seen(8)
    pixels = list(views.pixels)
    pixels[3] = pixels[3] + 1.0 * np.random.default_rng(5).normal(size=pixels[3].shape)
    done = board.calibrate(board.BoardViews(views.names, views.points, tuple(pixels), views.size, 8), "")
    assert [name for name, why in done.dropped if "fit to" in why] == ["03.png"] and len(done.views) == 7


@pytest.mark.parametrize(("width", "rms_px", "refused"), [(640, 0.95, False), (640, 1.05, True), (1920, 2.9, False)])
def test_the_limit_of_the_fit_grows_with_the_picture(width, rms_px, refused):
    lens = Intrinsics(width, 480, 600.0, 600.0, 319.5, 239.5)
    done = board.Calibration(lens, seen(1), np.zeros(1), rms_px, 0.7, 40.0, 1.0, np.nan, (), ())
    if not refused:
        return board._check_end(done, "cam01")
    with pytest.raises(DiorError, match="fit to an rms of 1.05 px, above 1.0 px"):
        board._check_end(done, "cam01")
