"""What is drawn lies inside its axes, is covered by no legend, and can be read on a light and on a dark page."""

import re

import numpy as np
import pytest

from dior.body.names import HALPE_136, MLKIT_33, PLUG_IN_GAIT_39
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.report import certainty, colours, facts, joint_plot, plots, scene, walk_plots
from dior.tables.words import DROP_REASON

NONE = (np.nan, np.nan)
LENS = Intrinsics(1280, 720, 640.0, 640.0, 640.0, 360.0)


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were saved, still open."""
    figures = []

    def kept(figure, path):
        figure.draw_without_rendering()
        figures.append(figure)

    for module in (plots, walk_plots, joint_plot, scene, certainty):
        monkeypatch.setattr(module, "save_svg", kept)
    return figures


def curve(values):
    """Values as a distribution is drawn from."""
    return facts.pooled([facts.spread_of(values)])


def dots(axis):
    """Points (N, 2) of all markers in pixels, and their radius there."""
    found = [
        axis.transData.transform(np.column_stack(line.get_data()))
        for line in axis.lines
        if line.get_marker() not in (None, "None", "")
        and line.get_transform() == axis.transData
        and len(line.get_xdata())
    ]
    return np.concatenate([*found, np.empty((0, 2))])


def assert_whole(figure):
    """No dot beyond the frame of its axes, and no legend on any axes."""
    for axis in figure.axes:
        box, at = axis.get_window_extent(), dots(axis)
        assert (at >= [box.x0 - 0.5, box.y0 - 0.5]).all() and (at <= [box.x1 + 0.5, box.y1 + 0.5]).all()
    for legend in (*figure.legends, *(axis.get_legend() for axis in figure.axes if axis.get_legend())):
        box = legend.get_window_extent()
        for axis in figure.axes:
            frame = axis.get_window_extent()
            assert not (box.y0 < frame.y1 - 1 and frame.y0 + 1 < box.y1 and box.x0 < frame.x1 and frame.x0 < box.x1)


def test_shares_end_at_a_hundred_and_fit_what_is_drawn(drawn, tmp_path):
    for values in ((0.999, 1.0), (0.39, 0.392), (0.0, 0.001), (0.2, 0.9)):
        own = {"labels": {"a": (values[0], *NONE, 9), "b": (values[1], values[0], values[1], 9)}}
        plots.marks(tmp_path / "m.svg", ["a", "b"], own, "share, %", percent=True)
        low, high = drawn[-1].axes[0].get_xlim()
        assert 0 <= low <= 100 * values[0] and 100 * values[1] <= high <= 100 and high - low >= 4.99
        assert high - low < 1.2 * 100 * (values[1] - values[0]) + plots.FEWEST_PERCENT
        assert_whole(drawn[-1])


def test_dots_of_equal_values_are_not_cut_and_n_stands_beside_them(drawn, tmp_path):
    points = [(group, kind, 2.4, 500) for group in ("cam01", "cam02") for kind in "ABC"]
    plots.strip(tmp_path / "s.svg", points, "error, px", {"cam01": (2.3, 2.5)}, (2.4, 2.3, 2.5, 3000))
    axis = drawn[0].axes[0]
    assert axis.get_xlim()[0] == 0 and axis.get_xlim()[1] > 2.45
    right = axis.child_axes[0].get_yticklabels()
    assert [one.get_text() for one in right] == ["2.4 (n 1500)", "2.4 (n 1500)", "2.4 (n 3000)"]
    assert_whole(drawn[0])


def test_more_subjects_than_colours_have_no_legend_that_tells_them_apart(drawn, tmp_path):
    for number, legends in ((1, 0), (2, 1), (len(colours.COLOURS), 1), (len(colours.COLOURS) + 1, 0)):
        plots.strip(tmp_path / "s.svg", [("cam01", f"S{i:02d}", 1.0 + i, 9) for i in range(number)], "error, px")
        assert len(drawn[-1].legends) == legends
        assert_whole(drawn[-1])


def test_no_legend_lies_on_a_curve(drawn, tmp_path):
    rng = np.random.default_rng(5)
    plots.distribution(
        tmp_path / "d.svg", {name: curve(rng.gamma(2, 1, 300)) for name in ("near", "far", "else")}, "px"
    )
    plots.before_after(tmp_path / "b.svg", {"cam01": (7.0, 1.5, 90), "all": (6.0, 1.4, 180)}, "px")
    plots.cmc(tmp_path / "c.svg", {("gait", name): [0.2, 0.6, 1.0] for name in ("labels", "3D")})
    certainty.poses(tmp_path / "p.svg", {f"cam{i}": np.full(6, 0.1 * i + 0.1) for i in range(4)})
    assert len(drawn) == 4
    for figure in drawn:
        assert_whole(figure)
    assert drawn[0].axes[0].get_ylim() == drawn[2].axes[0].get_ylim() == (0, 100)


@pytest.mark.parametrize(("joints", "parts"), [
    (MLKIT_33, ["head", "trunk", "arms", "legs"]),
    (PLUG_IN_GAIT_39, ["head", "trunk", "arms", "legs"]),
    (HALPE_136, ["head", "trunk", "arms", "legs"]),
    (("LASI", "our_own"), ["trunk", "others"]),
])  # fmt: skip
def test_joints_are_in_the_order_of_the_body_left_and_right_in_one_row(joints, parts, drawn, tmp_path):
    rows = joint_plot.by_part(sorted(joints))
    assert list(rows) == parts
    assert sorted(j for part in rows.values() for by_side in part.values() for j in by_side.values()) == sorted(joints)
    for name, by_side in ((n, s) for part in rows.values() for n, s in part.items()):
        assert set(by_side) in ({"left", "right"}, {"middle"}) or joints[-1] == "our_own", name
    joint_plot.draw(tmp_path / "j.svg", {joint: (1.0, 0.9, 1.1, 7) for joint in joints}, "error, px")
    assert_whole(drawn[0])


def test_the_body_is_told_from_the_head_down():
    assert list(joint_plot.by_part(sorted(MLKIT_33))["legs"]) == ["knee", "ankle", "heel", "foot_index"]
    assert joint_plot.side_and_name("RBAK") == ("middle", "RBAK")
    assert joint_plot.side_and_name("LWRA") == ("left", "WRA")
    assert joint_plot.side_and_name("right_foot_index") == ("right", "foot_index")


def standing(name, place, role="close"):
    return Camera(name, LENS, pose(look_at(place, (0, 0, 1.0)), place), role, "tape")


@pytest.mark.parametrize("draw", [scene.space, scene.plan])
def test_a_camera_far_away_neither_shrinks_the_others_nor_covers_their_names(draw, drawn, tmp_path):
    near = [standing(f"cam0{i}", place) for i, place in enumerate([(4, 3, 1.5), (4.3, 3.1, 1.4), (-4, 2, 1.6)])]
    far = standing("cam04", (60.0, 1.0, 2.0), "long_range")
    walk = np.column_stack([np.linspace(-3, 3, 50), np.zeros(50), np.ones(50)])
    draw(tmp_path / "s.svg", [*near, far], {"walk_1": walk}, None)
    (figure,) = drawn
    axis = figure.axes[0]
    names = [text for text in axis.texts if text.get_text().startswith("cam")]
    assert [text.get_text() for text in names] == ["cam00", "cam01", "cam02", "cam04, 60 m away"]
    assert np.ptp(axis.get_xlim()) < 25
    boxes = [name.get_window_extent() for name in names]
    assert not any(box.count_overlaps(boxes[:i]) for i, box in enumerate(boxes))


@pytest.mark.parametrize("names", [["cam01"], [f"camera_in_the_corner_{i}" for i in range(9)]])
def test_what_happens_over_time_has_room_for_its_names_and_legends(names, drawn, tmp_path):
    """Their margins are fixed."""
    t = np.linspace(0, 120, 3600)
    walk_plots.timeline(tmp_path / "t.svg", {n: (t, 0 * t, t[:3]) for n in names}, {n: (t, t) for n in names}, "px")
    walk_plots.timeline(tmp_path / "l.svg", {n: (t, 0 * t, t[:3]) for n in names}, {}, "px")
    dropped = {name: {reason: [1.0, 2.0] for reason in DROP_REASON} for name in names}
    walk_plots.stamps(tmp_path / "s.svg", {name: (t, t) for name in names}, dropped)
    assert len(drawn) == 3
    for figure in drawn:
        whole = figure.bbox
        for axis in figure.axes:
            box = axis.get_tightbbox()
            assert box.x0 >= whole.x0 and box.x1 <= whole.x1 and box.y0 >= whole.y0 and box.y1 <= whole.y1
            for legend in figure.legends:
                assert not legend.get_window_extent().overlaps(box)
        first, *others = [axis.get_tightbbox() for axis in figure.axes]
        assert all(other.y1 <= first.y0 + 1 for other in others)


def test_ink_and_paper_are_exchanged_on_a_dark_page(tmp_path):
    plots.distribution(tmp_path / "d.svg", {"a": curve(np.arange(9.0))}, "px")
    text = (tmp_path / "d.svg").read_text()
    assert "@media (prefers-color-scheme: dark)" in text
    said, drawn_in = text.split("</style>", 2)[1:]
    for name, value in re.findall(r"(fill|stroke): (#[0-9a-f]{6})", drawn_in):
        night = colours.AT_NIGHT.get(next((c for c in colours.AT_NIGHT if c.lower() == value), ""), value)
        paper = (luminance(colours.AT_NIGHT[colours.WHITE]), 1.0)
        inks = luminance(night), luminance(value)
        if value != colours.GRID:
            assert all(contrast(ink, own) >= 2.9 for ink, own in zip(inks, paper, strict=True)), (name, value)
    plots.distribution(tmp_path / "again.svg", {"a": curve(np.arange(9.0))}, "px")
    assert (tmp_path / "again.svg").read_text() == text


def luminance(colour):
    """Relative luminance of WCAG 2."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return float(np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])


def contrast(a, b):
    return (max(a, b) + 0.05) / (min(a, b) + 0.05)


def test_no_line_is_drawn_where_nothing_is_known():
    t = np.concatenate([np.arange(10), np.arange(40, 50)]) / 30
    times, values = walk_plots._broken(t, np.ones(20))
    assert np.isnan(values[10]) and np.isfinite(np.delete(values, 10)).all() and len(times) == 21
    few = np.delete(np.arange(30), [7, 8]) / 30
    assert np.isfinite(walk_plots._broken(few, few)[1]).all()
    assert len(walk_plots._broken(t[:1], t[:1])[0]) == 1
