"""scene.js and the pictures beside it: what the page that shows a walk in 3D over time is told."""

import cv2
import numpy as np
import pytest

from dior.errors import DiorError
from dior.evaluate.grids import label_grids
from dior.geometry.camera import project
from dior.ingest import bags
from dior.report import scene_file, viewer
from dior.tables import tables
from tests.report import walks

MOST_BYTES = 3e6  # of a walk of 3600 instants


@pytest.fixture(autouse=True)
def made_up(monkeypatch):
    monkeypatch.setattr(bags, "read_to_show", walks.pictures)


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    return walks.write(tmp_path_factory.mktemp("walk"))


@pytest.fixture(scope="module")
def made(given, tmp_path_factory):
    """scene.js of the walk; its pictures are beside it."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bags, "read_to_show", walks.pictures)
        viewer.run(**given, out=folder / "scene.js", out_pictures=folder / "pictures")
    return folder / "scene.js"


def size(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_numbers_come_back_as_they_were():
    rng = np.random.default_rng(1)
    arrays = {
        "small": rng.integers(-128, 128, (50, 3)).astype(np.int8),
        "bytes": rng.integers(0, 256, (7,)).astype(np.uint8),
        "jumps": np.array([[32767, -32768], [-32768, 32767], [0, 1]], np.int16),
        "large": rng.integers(-(2**31), 2**31, (20, 2, 2)).astype(np.int32),
        "real": rng.normal(0, 1, (9, 3)).astype(np.float32),
        "none": np.empty((0, 5), np.int16),
    }
    parts, text = scene_file.packed(arrays)
    found = scene_file.unpacked(parts, text)
    assert list(found) == list(arrays)
    for name, values in arrays.items():
        assert found[name].dtype == values.dtype and np.array_equal(found[name], values)


def test_points_are_good_to_half_a_millimetre_and_missing_ones_stay_missing():
    points = np.random.default_rng(2).uniform(-20, 20, (40, 5, 3)) + (400, 0, 0)
    points[3, 2, 1] = np.nan
    steps, origin, step = scene_file.in_steps(points)
    back = np.where(steps == scene_file.NONE, np.nan, origin + steps * step)
    assert step == 0.001 and np.isnan(back[3, 2]).all() and np.isnan(back).sum() == 3
    assert np.nanmax(np.abs(back - points)) <= 0.0005 + 1e-9
    wide, origin, step = scene_file.in_steps(np.array([[0.0, 0, 0], [300, 0, 0]]))
    assert np.abs(origin + wide * step - [[0, 0, 0], [300, 0, 0]]).max() <= step / 2 and 0.004 < step < 0.006
    assert (scene_file.in_steps(np.full((2, 3), np.nan))[0] == scene_file.NONE).all()


def test_errors_are_good_to_a_fortieth():
    sigmas = np.geomspace(0.0002, 40, 500)
    told = scene_file.LEAST_M * scene_file.RATIO ** (scene_file.in_ratios(sigmas).astype(float) - 1)
    assert np.abs(told / sigmas - 1).max() < 0.025
    assert scene_file.in_ratios(np.array([np.nan, 0.0, 1e-9, 1e9])).tolist() == [0, 0, 1, 255]
    assert scene_file.in_parts(np.array([np.nan, -1.0, 0.51])).tolist() == [0, -32, 16]


def test_the_scene_tells_what_the_tables_hold(given, made):
    header, arrays = scene_file.header_of(made), scene_file.arrays_of(made)
    assert header["sequence"] == walks.SEQUENCE and len(header["joints"]) == 33
    assert [c["name"] for c in header["cameras"]] == ["cam01", "cam02", "cam03", "cam04"]
    assert [c["rays"] for c in header["cameras"]] == ["detections"] * 3 + ["labels"]
    assert header["sides"][:2] == ["m", "l"] and header["cameras"][0]["sigma"][0] == [0.02, 0, 0]
    assert arrays["instants"].tolist() == list(range(90)) and arrays["time"][30] == 10_000
    wrist = header["joints"].index("left_wrist")
    missing = arrays["joints"][:, wrist, 0] == scene_file.NONE
    assert np.flatnonzero(missing).tolist() == list(range(20, 30))
    grids = label_grids(given["labels"])
    for i, camera in enumerate(walks.cameras(4)):
        own = {key: arrays[f"{camera.name} {key}"] for key in ("time", "frames", "pictures", "labels", "rays", "views")}
        assert own["time"][0] == 20 * i and own["frames"].tolist() == list(range(90))
        shown = own["frames"][own["pictures"]]
        # a picture a second, and those of the worst moments
        assert {0, 30, 60} <= {*shown.tolist(), *(shown + 1).tolist()} and len(shown) < 10
        uv = grids[camera.name].uv[shown]
        known = np.isfinite(uv).all(axis=-1)
        assert np.array_equal(own["labels"][..., 0] != scene_file.NONE, known)
        assert np.abs(own["labels"] / viewer.PIXEL_STEPS - uv)[known].max() <= 0.5 / viewer.PIXEL_STEPS + 1e-6
        slopes = own["rays"] / viewer.RAY_STEPS
        ahead = np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1) @ camera.wRc.T + camera.centre
        seen = project(camera, ahead)[0]
        # a label's ray goes through it; a detection is where the detector saw it
        off = np.linalg.norm(seen - uv, axis=-1)[known & (own["rays"][..., 0] != scene_file.NONE)]
        assert off.max() < 0.1 if camera.role == "long_range" else 1 < off.mean() < 4


def test_the_worst_moments_are_first_of_the_3d_then_of_each_camera(made):
    moments = scene_file.header_of(made)["moments"]
    told = [(m["camera"], m["frame"]) for m in moments]
    assert told == [("", 45), ("cam03", 16), ("cam02", 13), ("cam01", 10), ("cam04", 19)]
    assert moments[0]["text"] == "3D furthest from the detections: 8.00 px"
    assert moments[1]["text"] == "Furthest from the detections: 11.0 px"
    assert moments[4]["text"] == "Fewest labels in the hand box: 50.0 %"
    assert sorted(path.name for path in (made.parent / "pictures").glob("*frame*")) == [
        "cam01.frame_10.webp", "cam02.frame_13.webp", "cam03.frame_16.webp", "cam04.frame_19.webp",
    ]  # fmt: skip


def test_a_small_picture_is_where_its_number_says(made):
    header, arrays = scene_file.header_of(made), scene_file.arrays_of(made)
    camera = header["cameras"][1]
    width, height = camera["tile"]
    assert (width, height) == (320, 180)
    frames = arrays["cam02 frames"][arrays["cam02 pictures"]]
    for i, frame in enumerate(frames.tolist()):
        sheet = cv2.imread(str(made.parent / f"pictures/cam02.{i // 16}.webp"))
        cell = sheet[(i % 16) // 4 * height :, i % 4 * width :]
        assert abs(cell[2:12, 2:12].mean() - frame) < 4
    whole = cv2.imread(str(made.parent / "pictures/cam02.frame_13.webp"))
    assert whole.shape == (720, 1280, 3) and abs(whole[5:50, 5:50].mean() - 13) < 3


def test_two_runs_give_the_same_bytes(given, made, tmp_path_factory):
    again = tmp_path_factory.mktemp("again")
    viewer.run(**given, out=again / "scene.js", out_pictures=again / "pictures")
    files = [path.relative_to(again) for path in sorted(again.rglob("*")) if path.is_file()]
    assert len(files) > 8 and all((again / f).read_bytes() == (made.parent / f).read_bytes() for f in files)


def test_motion_capture_is_thinned_and_bodies_without_a_residual_have_no_worst_3d(given, tmp_path):
    table = tables.read(given["skeleton"], "skeletons_3d")
    # as if 90 ticks were 0.9 s
    table["stamp_ns"] = table["stamp_ns"].min() + table["instant"].astype(np.int64) * 10_000_000
    table["residual_px"] = np.full(len(table["x"]), np.nan)
    tables.write(tmp_path / "mocap.parquet", "skeletons_3d", table)
    one = given | {"skeleton": tmp_path / "mocap.parquet", "detections": None}
    viewer.run(**one, out=tmp_path / "scene.js", out_pictures=tmp_path / "pictures")
    header, arrays = scene_file.header_of(tmp_path / "scene.js"), scene_file.arrays_of(tmp_path / "scene.js")
    assert arrays["instants"].tolist() == list(range(0, 90, 2))
    assert "" not in [m["camera"] for m in header["moments"]] and {c["rays"] for c in header["cameras"]} == {"labels"}


def test_without_3d_there_is_an_empty_scene(given, tmp_path):
    table = tables.read(given["skeleton"], "skeletons_3d")
    for axis in "xyz":
        table[axis] = np.full(len(table["x"]), np.nan)
    tables.write(tmp_path / "none.parquet", "skeletons_3d", table)
    none = given | {"skeleton": tmp_path / "none.parquet"}
    viewer.run(**none, out=tmp_path / "scene.js", out_pictures=tmp_path / "pictures")
    assert scene_file.header_of(tmp_path / "scene.js") is None and not list((tmp_path / "pictures").iterdir())
    with pytest.raises(DiorError, match="other.js: is no scene"):
        (tmp_path / "other.js").write_text("1\n")
        scene_file.header_of(tmp_path / "other.js")


def test_pictures_further_apart_in_a_long_walk():
    assert viewer.every_second(np.arange(0, 10.01, 0.1)).tolist() == list(range(11))
    long = viewer.every_second(np.arange(0, 3000, 0.1))
    assert len(long) == viewer.MOST_PICTURES and long[-1] == pytest.approx(2999.9)


@pytest.mark.slow
def test_a_walk_of_two_minutes_with_eight_cameras_takes_three_megabytes_at_the_most(tmp_path):
    given = walks.write(tmp_path / "tables", count=8, frames=3600)
    viewer.run(**given, out=tmp_path / "out/scene.js", out_pictures=tmp_path / "out/pictures")
    assert 1e6 < size(tmp_path / "out") < MOST_BYTES
