"""The head's box in a picture: it holds the head, whichever way it is turned, and a small fix rarely moves it."""

import numpy as np
import pytest

from dior.clocks import clock
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables, covariance
from dior.release import head_blur, head_model, heads
from dior.simulate.scene import project as simulated
from dior.tables import tables
from tests.rig import camera, ring


def ball(middle, count=400):
    """Points (N, 3) on the ellipsoid around a head."""
    random = np.random.default_rng(0).normal(size=(count, 3))
    unit = random / np.linalg.norm(random, axis=1, keepdims=True)
    horizontal, vertical = head_model.RADII_M
    return middle + (0, 0, head_model.RAISED_M) + unit * (horizontal, horizontal, vertical)


def box_of(view, middle, sigma=(0.5, 0.3), own=0.0):
    return heads.boxes(view, np.array([middle], float), np.array([own]), np.array([sigma], float))


def test_box_of_a_head_straight_ahead():
    view = camera("c", (5.0, 0, 1.6 + head_model.RAISED_M), (0, 0, 1.6 + head_model.RAISED_M), distortion=(0.0,) * 8)
    box, status = box_of(view, (0, 0, 1.6), sigma=(2.0, 1.0))
    lens, (horizontal, vertical) = view.intrinsics, head_model.RADII_M
    width, height = horizontal * lens.fx / 5 + heads.SIGMAS * 2, vertical * lens.fy / 5 + heads.SIGMAS * 1
    assert status == ["ok"]
    assert np.allclose(box, [[lens.cx - width, lens.cy - height, lens.cx + width, lens.cy + height]], atol=0.02)


@pytest.mark.parametrize("view", [*ring(4), camera("far", (0, 60, 1.9), fx=760.0, role="long_range")])
@pytest.mark.parametrize("middle", [(0, 0, 1.6), (1.5, -1.0, 1.7), (-1.2, 1.4, 1.2)])
def test_ellipse_on_the_grid_holds_the_whole_head(view, middle):
    box, status = box_of(view, middle)
    edges = heads.on_grid(box)[0]
    uv = simulated(view, ball(np.array(middle)))[0]
    rows, columns = (np.round(uv[:, i]).astype(int) for i in (1, 0))
    held = head_blur.ellipse(edges, np.arange(0, 720), np.arange(0, 1280))[rows, columns]
    assert status == ["ok"]
    # the pixel of a point of the border may be outside by less than half of it
    assert held.mean() > 0.97


def test_what_is_not_in_the_picture_or_not_known():
    view = camera("c", (5.0, 0, 1.6), (0, 0, 1.6))
    middles = np.array([(0, 0, 1.6), (0, 9.0, 1.6), (9.0, 0, 1.6), (4.95, 0, 1.6), (np.nan,) * 3])
    _, status = heads.boxes(view, middles, np.zeros(5), np.ones((5, 2)))
    assert status.tolist() == ["ok", "out_of_frame", "out_of_frame", "unknown", "unknown"]


def test_unknown_uncertainty_takes_a_share_of_the_head():
    view = camera("c", (5.0, 0, 1.6), (0, 0, 1.6))
    sure, _ = box_of(view, (0, 0, 1.6), sigma=(0, 0))
    box, _ = box_of(view, (0, 0, 1.6), sigma=(np.nan, np.nan))
    grown = (box[0, 2:] - box[0, :2]) / (sure[0, 2:] - sure[0, :2])
    assert np.allclose(grown, 1 + heads.SIGMAS * heads.UNKNOWN_SIGMA)


@pytest.mark.parametrize(
    "box, edges",
    [
        ((100.0, 50.0, 140.0, 99.0), (96, 48, 144, 104)),  # grid 8
        ((100.0, 50.0, 118.0, 70.0), (100, 48, 120, 72)),  # grid 4
        ((100.0, 50.0, 109.0, 60.0), (100, 50, 110, 62)),  # grid 2
        ((100.0, 50.0, 104.0, 54.0), (100, 50, 105, 55)),  # whole pixels
        ((100.4, 50.0, 103.6, 54.0), (101, 50, 104, 55)),  # a tenth of a column is left out
        ((-3.0, -2.0, 0.9, 2.9), (-3, -2, 2, 4)),
    ],
)
def test_grid(box, edges):
    assert heads.on_grid(np.array([box]))[0].tolist() == list(edges)


def test_small_fix_moves_few_boxes():
    """A shift by d moves an edge on a grid of g with probability d / g."""
    middles = np.random.default_rng(0).uniform((-1.5, -1.5, 1.5), (1.5, 1.5, 1.7), (500, 3))
    for view, most in ((ring(1)[0], 0.12), (camera("far", (0, 60, 1.9), fx=760.0), 0.45)):
        fixed = covariance.moved(view, np.array([0.1, 0.1, 0, 0, 0, 0]) / view.intrinsics.fx)
        before, after = (
            heads.on_grid(heads.boxes(v, middles, np.zeros(500), np.ones((500, 2)))[0]) for v in (view, fixed)
        )
        assert 0.01 < (before != after).any(axis=1).mean() < most


def test_boxes_of_an_earlier_release_stay_while_they_hold_the_head():
    least = np.array([(100.0, 50.0, 140.0, 99.0)] * 5)
    edges = np.array([(96.0, 48.0, 144.0, 104.0)] * 5)
    before = edges + [(4, 0, 4, 0), (8, 0, 8, 0), (-24, -32, 24, 32), (0, 0, 8, 0), (np.nan,) * 4]
    found = heads.kept(before, edges, least)
    # the second does not hold the head, the third is 3.1 times too large, in the fifth there was no head
    assert [("before" if (row == old).all() else "new") for row, old in zip(found, before, strict=True)] == (
        ["before", "new", "new", "before", "new"]
    )
    assert (found[[1, 2, 4]] == edges[[1, 2, 4]]).all()


def test_small_fix_writes_no_picture_anew_where_the_earlier_boxes_are_given(walk, tmp_path):
    view, _, given = walk
    heads.run(**given)
    first = given["out"].rename(tmp_path / "before.parquet")
    fixed = covariance.moved(view, np.array([0.3, -0.3, 0, 0, 0, 0]) / view.intrinsics.fx)
    camera_tables.write_cameras(given["cameras"][0], [fixed])
    heads.run(**given)
    assert given["out"].read_bytes() != first.read_bytes()
    heads.run(**given | {"before": first})
    assert given["out"].read_bytes() == first.read_bytes()


@pytest.fixture
def walk(tmp_path):
    """Tables of a walk past one camera, and the arguments of the step."""
    view = ring(1)[0]
    count, joints = 30, ("left_ear", "right_ear")
    stamps = np.arange(count, dtype=np.int64) * 33_333_333
    middle = np.stack([np.linspace(-0.5, 0.5, count), np.zeros(count), np.full(count, 1.6)], axis=1)
    points = np.stack([middle + (0, side * 0.075, 0) for side in (1, -1)], axis=1)
    each = {"instant": np.repeat(np.arange(count), 2), "stamp_ns": np.repeat(stamps, 2)}
    body = each | {axis: points[..., i].ravel() for i, axis in enumerate("xyz")}
    body |= {"joint": joints * count, "status": ["ok"] * 2 * count}
    body["x"][20:24] = np.nan  # one instant and a half of the next: two pictures without a head
    tables.write(tmp_path / "body.parquet", "skeletons_3d", body)
    frames = {"camera": ["cam01"] * count, "frame": np.arange(count), "stamp_ns": stamps}
    tables.write(tmp_path / "frames.parquet", "frames", frames)
    labels = {"joint": joints * count, "frame": np.repeat(np.arange(count), 2)}
    labels |= {"sigma_u": np.full(2 * count, 1.0), "sigma_v": np.full(2 * count, 1.0)}
    tables.write(tmp_path / "labels.parquet", "labels_2d", labels)
    camera_tables.write_cameras(tmp_path / "cameras.parquet", [view])
    clock.write(tmp_path / "clocks.parquet", tmp_path / "gains.parquet", "walk", {"cam01": clock.Clock(0.0)})
    paths = {"skeleton": "body", "frames": "frames", "labels": "labels"}
    given = {key: tmp_path / f"{name}.parquet" for key, name in paths.items()}
    given |= {"cameras": [tmp_path / "cameras.parquet"], "clocks": [tmp_path / "clocks.parquet"]}
    given |= {"before": None, "out": tmp_path / "heads.parquet", "findings": tmp_path / "findings.parquet"}
    return view, middle, {"sequence": "walk", "camera": "cam01", **given}


def test_step_writes_a_box_for_every_picture_also_where_the_3d_is_missing(walk):
    view, middle, given = walk
    heads.run(**given)
    table = tables.read(given["out"], "heads")
    edges = np.stack([table[key] for key in heads.EDGES], axis=1)
    uv = cam.project(view, middle)[0] + 0.5
    assert (table["status"] == "ok").all() and table["frame"].tolist() == list(range(30))
    assert ((edges[:, :2] < uv) & (uv < edges[:, 2:])).all()
    assert not len(tables.read(given["findings"], "findings")["text"])


def test_step_says_where_the_head_is_not_known(walk):
    _, _, given = walk
    body = tables.read(given["skeleton"], "skeletons_3d")
    body["x"][:40] = np.nan
    tables.write(given["skeleton"], "skeletons_3d", body)
    heads.run(**given)
    table = tables.read(given["out"], "heads")
    assert (table["status"][:15] == "unknown").all() and (table["status"][17:] == "ok").all()
    assert np.isnan(table["u_min"][:15]).all()
    (text,) = tables.read(given["findings"], "findings")["text"]
    assert "of 30 pictures are not released" in text


@pytest.mark.parametrize(
    "what, words", [("labels", "run reproject again"), ("clocks", "has no clock"), ("before", "so delete it")]
)
def test_step_refuses_what_does_not_fit(walk, what, words):
    _, _, given = walk
    if what == "labels":
        labels = tables.read(given["labels"], "labels_2d")
        tables.write(given["labels"], "labels_2d", tables.rows(labels, labels["frame"] > 0))
    elif what == "before":
        given["before"] = given["out"].with_name("before.parquet")
        tables.write(given["before"], "heads", {"frame": [0, 1], "status": ["ok", "ok"]})
    else:
        clock.write(given["clocks"][0], given["out"], "walk", {"cam02": clock.Clock(0.0)})
    with pytest.raises(DiorError, match=words):
        heads.run(**given)


def test_what_is_not_known_of_the_heads_own_place_is_covered_too():
    """3 cm in space at 5 m, beside nothing of the labels: 1.5 of that on each side."""
    view = camera("c", (5.0, 0, 1.6 + head_model.RAISED_M), (0, 0, 1.6 + head_model.RAISED_M), distortion=(0.0,) * 8)
    sure, unsure = (box_of(view, (0, 0, 1.6), sigma=(0, 0), own=own)[0][0] for own in (0.0, 0.03))
    grown = 1.5 * 0.03 * view.intrinsics.fx / 5
    assert (unsure - sure) * [-1, -1, 1, 1] == pytest.approx([grown] * 4, rel=0.02)


def test_hardly_anything_of_a_head_is_left_outside_where_labels_are_as_sure_as_they_say():
    """At 60 m, a head 2.5 px wide and labels that are off by 0.3 px; boxes as they come before the grid."""
    view = camera("far", (0, 60, 1.9), fx=760.0, role="long_range")
    box = box_of(view, (0, 0, 1.6), sigma=(0.3, 0.3))[0][0]
    random = np.random.default_rng(0)
    unit = random.uniform(-1, 1, (1000, 2))
    unit = unit[(unit**2).sum(axis=1) < 1]
    # a mean head, round about the vertical: 0.20 m long and 0.23 m high
    head = cam.project(view, np.array([0, 0, 1.6 + head_model.RAISED_M]))[0] + unit * 760 / 60 * (0.10, 0.115)
    moved = head + 0.3 * random.standard_normal((1500, 1, 2))
    across = (2 * moved - box[:2] - box[2:]) / (box[2:] - box[:2])
    assert ((across**2).sum(axis=-1) > 1).mean() < 0.001
