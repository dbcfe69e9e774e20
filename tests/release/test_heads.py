"""The head's box in a picture: it holds the head, whichever way it is turned, and a small fix rarely moves it. Where it
does not hold the head that the pictures show, they are not released."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from dior.clocks import clock
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables, covariance
from dior.ingest import moving
from dior.release import head_blur, head_model, heads, look
from dior.simulate.scene import project as simulated
from dior.tables import tables
from tests.cases import some
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


# left, up m from the middle between the ears, of a body that stands upright
BODY = {
    "left_ear": (0.075, 0.0), "right_ear": (-0.075, 0.0),
    "left_shoulder": (0.19, -0.20), "right_shoulder": (-0.19, -0.20),
    "left_elbow": (0.25, -0.50), "right_elbow": (-0.25, -0.50), "left_hip": (0.12, -0.75), "right_hip": (-0.12, -0.75),
}  # fmt: skip
COUNT = 30


def in_view():
    """The camera of the walk."""
    return ring(1)[0]


@cache
def _painted(middle, shown):
    """A grey picture (720, 1280, 3) with the body where it is `shown`, its ears about `middle` (3,) m."""
    view = in_view()
    picture = (100 + 20 * np.add.outer(np.arange(720) // 40 % 2, np.arange(1280) // 40 % 2)).astype(np.uint8)
    picture = np.repeat(picture[..., None], 3, axis=2)
    for (left, up), radius in shapes_of_body() if shown else []:
        (u, v), depth = simulated(view, np.array(middle) + (0.0, left, up))
        if depth > 0 and np.isfinite([u, v]).all():
            size = int(round(view.intrinsics.fx * radius / depth))
            cv2.circle(picture, (int(round(u)), int(round(v))), size, (200, 40, 40), -1)
    return picture


def shapes_of_body():
    flesh = [(left, up) for left, up in BODY.values() if up < 0]
    trunk = [(left, up) for up in np.linspace(-0.75, -0.2, 12) for left in np.linspace(-0.16, 0.16, 7)]
    neck = [(0.0, up) for up in (-0.08, -0.12, -0.16, -0.2)]
    head = [(0.0, 0.03), (0.0, -0.03)]
    return [(p, 0.06) for p in flesh + trunk] + [(p, 0.05) for p in neck] + [(p, 0.085) for p in head]


def filmed(view, middle, shown=lambda i: True, others=()):
    """What reads the pictures of a walk: the body where `shown`, and discs `others` (point (3,) m, radius, which)."""

    def read(wanted, factor):
        for i in wanted.tolist():
            picture = _painted(tuple(middle[i]), bool(shown(i))).copy()
            for at, radius, when in others:
                (u, v), depth = simulated(view, np.array(at, float))
                if i in when:
                    size = int(round(view.intrinsics.fx * radius / depth))
                    cv2.circle(picture, (int(u), int(v)), size, (30, 30, 30), -1)
            yield i, moving.reduced(picture, factor)

    return lambda rows, data_root: read


@pytest.fixture
def walk(tmp_path, monkeypatch):
    """Tables of a walk past one camera, and the arguments of the step; its pictures are drawn."""
    view = in_view()
    count, joints = COUNT, tuple(BODY)
    stamps = np.arange(count, dtype=np.int64) * 33_333_333
    middle = np.stack([np.zeros(count), np.linspace(-1.4, 1.4, count), np.full(count, 1.6)], axis=1)
    points = np.stack([middle + (0, *place) for place in BODY.values()], axis=1)
    n, each_of = count * len(joints), len(joints)
    each = {"instant": np.repeat(np.arange(count), each_of), "stamp_ns": np.repeat(stamps, each_of)}
    body = each | {axis: points[..., i].ravel() for i, axis in enumerate("xyz")}
    body |= {"joint": joints * count, "status": ["ok"] * n}
    # one instant, and the next without an ear: two pictures without a head
    body["x"][10 * each_of : 11 * each_of], body["x"][11 * each_of] = np.nan, np.nan
    tables.write(tmp_path / "body.parquet", "skeletons_3d", body)
    frames = {"camera": ["cam01"] * count, "frame": np.arange(count), "stamp_ns": stamps}
    frames |= {"height": [720] * count, "width": [1280] * count}
    tables.write(tmp_path / "frames.parquet", "frames", frames)
    labels = {"joint": joints * count, "frame": np.repeat(np.arange(count), each_of)}
    labels |= {"sigma_u": np.full(n, 1.0), "sigma_v": np.full(n, 1.0)}
    tables.write(tmp_path / "labels.parquet", "labels_2d", labels)
    camera_tables.write_cameras(tmp_path / "cameras.parquet", [view])
    clock.write(tmp_path / "clocks.parquet", tmp_path / "gains.parquet", "walk", {"cam01": clock.Clock(0.0)})
    tables.write(tmp_path / "metrics.parquet", "metrics", figures(coverage=1.0))
    tables.write_findings(tmp_path / "noticed.parquet", [])
    monkeypatch.setattr(look, "reader", filmed(view, middle))
    paths = {"skeleton": "body", "frames": "frames", "labels": "labels"}
    given = {key: tmp_path / f"{name}.parquet" for key, name in paths.items()}
    given |= {"cameras": [tmp_path / "cameras.parquet"], "clocks": [tmp_path / "clocks.parquet"]}
    given |= {"filmed": heads.Filmed(tmp_path, None, "auto", 0.3, None)}
    given |= {"judged": judged(tmp_path)}
    given |= {"before": None, "out": tmp_path / "heads.parquet", "findings": tmp_path / "findings.parquet"}
    return view, middle, {"sequence": "walk", "camera": "cam01", "out_covers": tmp_path / "covers.parquet", **given}


def figures(**values):
    count = len(values)
    return {"metric": list(values), "camera": ["cam01"] * count, "sequence": ["walk"] * count,
            "role": ["close"] * count, "value": list(values.values()), "n": [9] * count}  # fmt: skip


def judged(folder, checked=""):
    return heads.Judged("close", [], "robust", "lab", folder / "metrics.parquet", [folder / "noticed.parquet"], checked)


def status_of(given):
    return tables.read(given["out"], "heads")["status"]


def said(given):
    return tables.read(given["findings"], "findings")["text"].tolist()


def test_step_writes_a_box_for_every_picture_also_where_the_3d_is_missing(walk):
    view, middle, given = walk
    heads.run(**given)
    table = tables.read(given["out"], "heads")
    edges = np.stack([table[key] for key in heads.EDGES], axis=1)
    uv = cam.project(view, middle)[0] + 0.5
    assert (table["status"] == "ok").all() and table["frame"].tolist() == list(range(COUNT))
    assert ((edges[:, :2] < uv) & (uv < edges[:, 2:])).all()
    assert not said(given) and not len(tables.read(given["out_covers"], "other_covers")["frame"])


def test_step_says_where_the_head_is_not_known(walk):
    _, _, given = walk
    body = tables.read(given["skeleton"], "skeletons_3d")
    body["x"][: 20 * len(BODY)] = np.nan
    tables.write(given["skeleton"], "skeletons_3d", body)
    heads.run(**given)
    table = tables.read(given["out"], "heads")
    assert (table["status"][:15] == "unknown").all() and (table["status"][17:] == "ok").all()
    assert np.isnan(table["u_min"][:15]).all()
    (text,) = said(given)
    assert "of 30 pictures are not released" in text


def test_where_no_picture_shows_the_scene_without_the_subject_that_is_what_is_said(walk, monkeypatch):
    view, middle, given = walk
    still = np.tile(middle[:1], (COUNT, 1))
    body = tables.read(given["skeleton"], "skeletons_3d")
    for key in "xyz":
        body[key] = np.repeat(body[key].reshape(-1, len(BODY))[:1], len(body[key]) // len(BODY), axis=0).ravel()
    tables.write(given["skeleton"], "skeletons_3d", body)
    monkeypatch.setattr(look, "reader", filmed(view, still))
    heads.run(**given)
    assert set(status_of(given)) == {"unseen"}
    assert "so that none shows the scene without them" in said(given)[0] and "pose or clock" not in said(given)[0]


@pytest.mark.parametrize("turn", [(0, 1.5, 0), (0, -1.5, 0), (-1.5, 0, 0), (0, 20, 0)])
def test_no_picture_is_released_where_the_pose_puts_the_cover_beside_the_head(walk, turn):
    """Labels with a small sigma and a green light: only the pictures tell."""
    view, _, given = walk
    wrong = covariance.moved(view, np.array([*np.deg2rad(turn), 0, 0, 0]))
    camera_tables.write_cameras(given["cameras"][0], [wrong])
    heads.run(**given)
    assert set(status_of(given)) <= {"beside", "unseen"}
    assert "30 of 30 pictures are not released" in said(given)[0] and "heads_checked" in said(given)[0]


@pytest.mark.parametrize(
    "turn",
    some(
        [(0, 0, 0), (0, 0.5, 0), (-0.5, 0, 0), (0.5, 0, 0), (1.5, 0, 0), (4, 0, 0)], (0, 0, 0), (0, 0.5, 0), (1.5, 0, 0)
    ),
)
def test_of_a_released_picture_all_of_the_head_is_covered(walk, turn):
    """Where the cover is too low, what moves above it is covered; where that goes too far nothing is released."""
    view, middle, given = walk
    camera_tables.write_cameras(given["cameras"][0], [covariance.moved(view, np.array([*np.deg2rad(turn), 0, 0, 0]))])
    heads.run(**given)
    table = tables.read(given["out"], "heads")
    edges = np.stack([table[key] for key in heads.EDGES], axis=1)
    around = 2 * np.pi * np.arange(16) / 16
    for i in np.flatnonzero(table["status"] == "ok"):
        uv = simulated(view, middle[i] + np.stack([0 * around, 0.08 * np.cos(around), 0.11 * np.sin(around)], axis=1))[
            0
        ]
        at = np.round(uv).astype(int)
        under = head_blur.ellipse(edges[i], np.arange(720), np.arange(1280))[at[:, 1], at[:, 0]]
        for box in covered(given, i):
            under |= ((at >= box[:2]) & (at < box[2:])).all(axis=1)
        assert under.all(), i
    if turn == (0, 0, 0):
        assert (table["status"] == "ok").all()


def test_nobody_under_the_cover_is_not_released(walk, monkeypatch):
    view, middle, given = walk
    monkeypatch.setattr(look, "reader", filmed(view, middle, shown=lambda i: i >= 20))
    heads.run(**given)
    assert (status_of(given)[:10] == "unseen").all()
    monkeypatch.setattr(look, "reader", filmed(view, middle, shown=lambda i: i >= 10))
    heads.run(**given)
    assert (status_of(given)[:5] == "unseen").all() and (status_of(given)[15:] == "ok").all()


def test_who_stands_still_is_not_seen(walk, monkeypatch):
    view, middle, given = walk
    monkeypatch.setattr(look, "reader", filmed(view, middle[[15] * COUNT]))
    heads.run(**given)
    assert set(status_of(given)) == {"unseen"}


@pytest.mark.parametrize("sigma", [np.nan, 40.0])
def test_labels_of_which_nobody_knows_how_good_they_are_release_no_picture(walk, sigma):
    _, _, given = walk
    labels = tables.read(given["labels"], "labels_2d")
    tables.write(given["labels"], "labels_2d", labels | {"sigma_u": np.full(len(labels["frame"]), sigma)})
    heads.run(**given)
    assert set(status_of(given)) == {"uncertain"}


def test_a_red_light_releases_no_picture(walk, tmp_path):
    _, _, given = walk
    tables.write(tmp_path / "metrics.parquet", "metrics", figures(coverage=1.0, in_box_share=0.06))
    heads.run(**given)
    assert set(status_of(given)) == {"red"} and "6.0 % of the labels are in the hand boxes" in said(given)[0]
    tables.write(tmp_path / "metrics.parquet", "metrics", figures(coverage=1.0, in_box_share=0.9))
    tables.write_findings(tmp_path / "noticed.parquet", [("lab/cam01", "error", "camera_bumped", "it moved")])
    heads.run(**given)
    assert set(status_of(given)) == {"red"} and "it moved" in said(given)[0]
    tables.write_findings(tmp_path / "noticed.parquet", [("lab/cam02", "error", "camera_bumped", "it moved")])
    heads.run(**given)
    assert set(status_of(given)) == {"ok"}, "another camera's"


def test_no_picture_is_released_where_the_3d_is_in_doubt(walk, tmp_path):
    """Also of a camera whose own light is not red: the cover is where the 3D is."""
    view, _, given = walk
    tables.write_findings(tmp_path / "noticed.parquet", [("walk", "error", "world_scale", "it is too large")])
    heads.run(**given)
    assert set(status_of(given)) == {"red"} and "too large" in said(given)[0]
    tables.write_findings(tmp_path / "noticed.parquet", [])
    both = [view, camera("cam02", (0, 5.0, 1.6), (0, 0, 1.6))]
    camera_tables.write_cameras(given["cameras"][0], both)
    columns = figures(coverage=1.0, reprojection_error=60.0)
    tables.write(tmp_path / "metrics.parquet", "metrics", columns | {"camera": ["cam01", "cam02"]})
    heads.run(**given)
    assert set(status_of(given)) == {"ok"}, "the motion capture's, which no camera makes"
    heads.run(**given | {"judged": replace(given["judged"], makers=["cam01", "cam02"])})
    assert set(status_of(given)) == {"red"} and "beside what is seen in cam02" in said(given)[0]


def test_who_has_looked_lifts_all_of_it_but_an_unknown_head(walk, tmp_path):
    view, _, given = walk
    tables.write(tmp_path / "metrics.parquet", "metrics", figures(coverage=1.0, in_box_share=0.06))
    wrong = covariance.moved(view, np.array([0, np.deg2rad(1.5), 0, 0, 0, 0]))
    camera_tables.write_cameras(given["cameras"][0], [wrong])
    heads.run(**given | {"judged": judged(tmp_path, "looked at all of them (A. B.)")})
    assert set(status_of(given)) == {"ok"}
    (text,) = said(given)
    assert "looked at all of them (A. B.)" in text and "in the hand boxes" in text


def covered(given, frame):
    table = tables.read(given["out_covers"], "other_covers")
    mine = tables.rows(table, table["frame"] == frame)
    return np.stack([mine[key] for key in heads.EDGES], axis=1)


def test_what_else_moves_at_the_height_of_a_head_is_covered(walk, monkeypatch):
    view, middle, given = walk
    head, foot = (0.5, 1.6, 1.7), (0.5, 1.6, -1.0)
    others = [(head, 0.1, range(4, 6)), (foot, 0.1, range(4, 6))]
    monkeypatch.setattr(look, "reader", filmed(view, middle, others=others))
    heads.run(**given)
    (u, v), _ = simulated(view, np.array(head))
    radius = view.intrinsics.fx * 0.1 / np.linalg.norm(view.centre - head)
    for frame in range(COUNT):
        boxes = covered(given, frame)
        # a quarter of a second before and after is 7 pictures
        if frame not in range(0, 13):
            assert not len(boxes)
            continue
        (box,) = boxes
        assert box[0] <= u - radius and box[1] <= v - radius and box[2] >= u + radius and box[3] >= v + radius
        assert (box[2:] - box[:2] < 2 * radius + 24).all()
    assert set(status_of(given)) == {"ok"}


def test_where_somebody_stood_for_a_while_is_covered_all_the_time(walk, monkeypatch):
    """Which of the two pictures is the empty one nobody knows."""
    view, middle, given = walk
    monkeypatch.setattr(look, "reader", filmed(view, middle, others=[((0.5, 1.6, 1.7), 0.1, range(18))]))
    heads.run(**given)
    (u, v), _ = simulated(view, np.array((0.5, 1.6, 1.7)))
    for frame in range(COUNT):
        boxes = covered(given, frame)
        assert ((boxes[:, 0] < u) & (u < boxes[:, 2]) & (boxes[:, 1] < v) & (v < boxes[:, 3])).any(), frame


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


ASIDE_M = (-0.6, 0.9, -0.1)


def with_somebody_else(given, sigma=1.0, known=lambda i: True, aside=ASIDE_M):
    """The arguments with tables of everybody: beside the subject one who goes along, `known` (instant) or not."""
    folder = given["out"].parent
    own, labels = tables.read(given["skeleton"], "skeletons_3d"), tables.read(given["labels"], "labels_2d")
    other = own | {axis: own[axis] + by for axis, by in zip("xyz", aside, strict=True)}
    gone = ~np.array([known(i) for i in own["instant"].tolist()])
    for axis in "xyz":
        other[axis][gone] = np.nan
    other["status"] = np.where(gone, "suspect", "ok").astype(object)
    who = {"person": ["person_1", "person_2"], "is_subject": ["yes", "no"]}
    n = len(own["instant"])
    who = {key: np.repeat(np.array(words, object), n) for key, words in who.items()}
    kept = ("joint", "instant", "stamp_ns", "x", "y", "z", "status")
    body = {key: np.concatenate([own[key], other[key]]) for key in kept}
    tables.write(folder / "people.parquet", "people_3d", who | body)
    flat = {key: np.tile(labels[key], 2) for key in ("joint", "frame")} | {"camera": ["cam01"] * 2 * n}
    flat |= {key: np.repeat([1.0, sigma], n) for key in ("sigma_u", "sigma_v")}
    tables.write(folder / "people_labels.parquet", "people_2d", who | flat)
    both = folder / "people.parquet", folder / "people_labels.parquet"
    return given | {"filmed": replace(given["filmed"], people=both[0], people_labels=both[1])}


def test_the_head_of_somebody_else_is_covered_by_their_3d_though_nothing_shows_there(walk):
    """Of the size of the subject's; where their 3D ends the cover goes on for a moment, as the subject's does."""
    view, middle, given = walk
    heads.run(**with_somebody_else(given, known=lambda i: i < 10))
    uv = cam.project(view, middle + ASIDE_M)[0] + 0.5
    table = tables.read(given["out"], "heads")
    assert (table["status"] == "ok").all()
    for i in range(COUNT):
        boxes = covered(given, i)
        if i < 10:
            (box,) = boxes
            assert (box[:2] < uv[i]).all() and (uv[i] < box[2:]).all()
            own = [table[key][i] for key in heads.EDGES]
            assert box[2] - box[0] == pytest.approx(own[2] - own[0], rel=0.4)
        elif i > 12:
            assert len(boxes) == (0 if (i - 9) / 30 > head_model.MAX_BEYOND_S else 1)


@pytest.mark.parametrize("sigma", [pytest.param(np.nan, marks=pytest.mark.slow), 40.0])
def test_no_picture_is_released_that_has_somebody_elses_head_of_which_nobody_knows_where_it_is(walk, tmp_path, sigma):
    _, _, given = walk
    heads.run(**with_somebody_else(given, sigma, known=lambda i: i < 5))
    there = np.array([len(covered(given, i)) > 0 for i in range(COUNT)])
    assert there[:5].all() and not there[15:].any()
    assert (status_of(given)[there] == "uncertain").all() and (status_of(given)[15:] == "ok").all()
    checked = {"judged": judged(tmp_path, "looked at all of them (A. B.)")}
    heads.run(**with_somebody_else(given, sigma, known=lambda i: i < 5) | checked)
    assert set(status_of(given)) == {"ok"}


def test_who_stands_beside_the_camera_withholds_and_covers_nothing():
    """There a pixel's sigma is larger than the picture, and the box that it makes would hold all of it."""
    view = camera("c", (5.0, 0, 1.6), (0, 0, 1.6), distortion=(0.0,) * 8)
    # ahead; half a head beyond the picture's border, which is 45 degrees aside; 3 m aside and 0.4 m ahead; behind
    middle = np.array([(0, 0, 1.6), (3.0, 2.15, 1.6), (4.6, 3.0, 1.6), (6.0, 0, 1.6)])
    for sigma in (1.0, 1e5, np.nan):
        known = np.zeros(4), np.full((4, 2), sigma), np.zeros((4, 0, 3))
        other = heads.Known({}, view, np.arange(4.0), middle, *known, [])
        assert heads.in_picture(other).tolist() == [True, True, False, False]
        assert len(heads.heads_of(other)[2]) == 0
        assert (other.boxes()[1][2] == "ok") == (sigma == 1e5)
