"""Which pictures are shown, and the clip of a tiny simulated walk."""

import cv2
import numpy as np
import pytest

from dior.errors import DiorError
from dior.evaluate.grids import label_grids
from dior.report import clip, picture_choice
from dior.simulate import simulate, simulate_mocap
from dior.simulate.settings import CAMERAS
from dior.tables import tables
from tests.ingest.test_bags_labels import labels_from

TINY = {
    "subjects": 1, "sequences": 1, "environments": ["indoor"], "duration_s": 1.0, "width": 320, "height": 180,
    "fx": 160.0,
}  # fmt: skip
WALK = "indoor_01"


def test_frames_from_best_to_worst_with_their_words():
    frames = np.arange(10, 20)
    bad = np.array([5, 1, 4, np.nan, 9, 2, 8, 3, 7, 6], float)
    shown = picture_choice.by_rank(frames, bad, lambda value: f"{value:.0f} px", 3)
    assert shown == [(11, "best: 1 px"), (10, "median: 5 px"), (14, "worst: 9 px")]
    assert [frame for frame, _ in picture_choice.by_rank(frames, bad, str, 9)] == [11, 15, 17, 12, 10, 19, 18, 16, 14]
    assert picture_choice.by_rank(frames, bad, lambda value: "", 5)[1] == (17, "25% are better: ")
    assert picture_choice.by_rank(frames, np.full(10, np.nan), str, 3) == []
    assert picture_choice.by_rank(frames[:1], bad[:1], lambda value: "x", 3) == [(10, "x")]


def test_frames_are_spread_where_nothing_is_measured():
    assert picture_choice.spread(np.arange(90), 3) == [(15, ""), (45, ""), (75, "")]
    assert picture_choice.spread(np.arange(2), 3) == [(0, ""), (1, "")] and picture_choice.spread(np.arange(0), 3) == []


def test_the_middle_of_what_all_cameras_have_where_nothing_is_measured():
    times = {"a": np.arange(0, 10, 0.1), "b": np.arange(2, 12, 0.1)}
    moments = clip.shown_moments(times, 10.0, 4.0, None)
    assert len(moments) == 40 and (moments[0] + moments[-1] + 0.1) / 2 == pytest.approx((2 + 9.9) / 2)
    assert clip.shown_moments(times, 10.0, 99.0, None)[0] == pytest.approx(2.0)
    apart = {"a": np.array([0.0, 1.0]), "b": np.array([5.0, 6.0])}
    assert len(clip.shown_moments(apart, 10.0, 4.0, None)) == 1
    assert clip.nearest(np.array([0.0, 1.0, 2.0]), np.array([-1, 0.4, 0.6, 1.5, 9])).tolist() == [0, 0, 1, 1, 2]


@pytest.mark.parametrize(("worst", "first"), [(6.0, 6.0 - clip.BEFORE_S), (2.1, 2.0), (9.8, 5.9), (50.0, 5.9)])
def test_it_begins_at_the_worst_moment_within_what_all_cameras_have(worst, first):
    times = {"a": np.arange(0, 10, 0.1), "b": np.arange(2, 12, 0.1)}
    moments = clip.shown_moments(times, 10.0, 4.0, worst)
    assert moments[0] == pytest.approx(first) and len(moments) == 40


def test_the_worst_picture_is_that_of_the_first_measure_that_there_is():
    metrics = {
        "metric": np.array(["error_to_truth_2d", "reprojection_error", "reprojection_error"], object),
        "sequence": np.array(["w"] * 3, object), "camera": np.array(["a", "a", "b"], object),
        "frame": np.array([0, 1, 2]), "value": np.array([99.0, 3.0, 5.0]),
    }  # fmt: skip
    index = {"camera": np.array(["a", "a", "b", "b"], object), "frame": np.array([0, 1, 0, 2])}
    times = {"a": np.array([0.0, 1.0]), "b": np.array([7.0, 8.0])}
    assert clip.worst_time(metrics, index, times) == 8.0
    assert clip.worst_time({key: value[:0] for key, value in metrics.items()}, index, times) is None


def test_a_view_holds_the_person_of_all_pictures():
    body = np.array([[100.0, 50.0], [110.0, 75.0]])
    uv = np.stack([body + (x, 0) for x in range(40)])
    first, *others = clip.views(1280, 720, uv, 15.0)
    assert first.scale == pytest.approx(0.7 * 480 / 49) and all(one == first for one in others)
    inside = first.of(uv.reshape(-1, 2))
    assert (inside >= 0).all() and (inside <= np.array(first.size)).all() and first.size == clip.TILE
    nobody = clip.views(1088, 1920, np.full((3, 2, 2), np.nan), 15.0)
    assert [view.size for view in nobody] == [(153, 270)] * 3


def test_a_view_follows_who_walks_through_the_whole_picture():
    body = np.array([[0.0, 200.0], [60.0, 380.0]])
    uv = np.stack([body + (x, 0) for x in np.linspace(100, 1100, 60)])
    uv[20:23] = np.nan
    each = clip.views(1280, 720, uv, 15.0)
    assert len({view.scale for view in each}) == 1 and each[0].scale > 2 * 480 / 1280
    steps = np.diff([view.origin[0] for view in each])
    assert (steps >= 0).all() and steps.max() < 40
    for view, labels in zip(each, uv, strict=True):
        inside = view.of(labels)
        assert (np.isnan(inside) | ((inside > -1) & (inside < np.array(clip.TILE) + 1))).all()


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A walk of a second with its labels: what `clip.run` takes."""
    from dior.simulate import config, settings

    folder = tmp_path_factory.mktemp("clip")
    config.write(settings.from_dict(TINY), folder / "config")
    config.write_offsets(settings.from_dict(TINY), folder / "config")
    for step in (simulate, simulate_mocap):
        step.run(settings=TINY, sequence=WALK, out=folder)
    bags = [folder / WALK / f"{computer}.bag" for computer in ("pc1", "pc2")]
    (folder / "made").mkdir()
    labels_from(folder, bags, folder, folder / "made")
    tables.write(folder / "made/frame_metrics.parquet", "frame_metrics", {})
    return {
        "sequence": WALK, "frames": folder / f"made/{WALK}.parquet", "clocks": [folder / "made/clocks.parquet"],
        "timeline": folder / "made/timeline.parquet", "data_root": folder,
        "labels": [folder / f"made/{camera}.labels.parquet" for camera in CAMERAS],
        "frame_metrics": folder / "made/frame_metrics.parquet", "seconds": 0.5,
    }  # fmt: skip


def test_the_clip_plays_and_is_the_same_bytes_again(walk, tmp_path):
    for name in ("a", "b"):
        clip.run(**walk, out=tmp_path / f"{name}.webm", poster=tmp_path / f"{name}.jpg")
    for suffix in ("webm", "jpg"):
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
    film, shown = cv2.VideoCapture(str(tmp_path / "a.webm")), []
    while (picture := film.read())[0]:
        shown.append(picture[1])
    assert len(shown) == 7 and shown[0].shape == (540, 960, 3)
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(15, abs=0.1)
    poster = cv2.imread(str(tmp_path / "a.jpg"))
    assert np.abs(poster.astype(float) - shown[0]).mean() < 6
    # every camera has its quarter, with the room in it
    for top, left in ((0, 0), (0, 480), (270, 0), (270, 480)):
        assert poster[top : top + 270, left : left + 480].mean() > 100
    first = label_grids(walk["labels"])["cam01"]
    assert np.isfinite(first.uv).all(axis=(1, 2)).any()


def test_a_camera_without_an_offset_is_named(walk, tmp_path):
    short = tables.of_camera(tables.read(walk["clocks"][0], "offsets"), "cam01")
    tables.write(tmp_path / "offsets.parquet", "offsets", short)
    given = walk | {"clocks": [tmp_path / "offsets.parquet"]}
    with pytest.raises(DiorError, match="sequence indoor_01, camera cam02: no pictures or no offset"):
        clip.run(**given, out=tmp_path / "a.webm", poster=tmp_path / "a.jpg")
    assert not list(tmp_path.glob("*.webm"))
