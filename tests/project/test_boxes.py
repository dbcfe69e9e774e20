"""Boxes of several drawers, and in which fit each box is left out."""

import re

import numpy as np
import pytest

from dior.errors import DiorError, DiorErrors
from dior.project import boxes

HEADER = "frame,u_min,v_min,u_max,v_max,drawer\n"
FRAMES = np.arange(100)


def written(folder, text):
    path = folder / "walk.cam04.csv"
    path.write_text(text)
    return path


def test_the_drawer_of_the_first_box_is_the_one_whose_boxes_are_used(tmp_path):
    # a row of to_mark that nobody has drawn yet names nobody
    path = written(tmp_path, HEADER + "1,,,,,zoe\n9,1,2,3,4,max\n7,5,6,7,8,zoe\n7,1,1,2,2,max\n")
    by_drawer = boxes.read_drawers(path, FRAMES)
    assert list(by_drawer) == ["max", "zoe"]
    frames, edges = boxes.read(path, FRAMES)
    assert frames.tolist() == [7, 9] and edges.tolist() == [[1, 1, 2, 2], [1, 2, 3, 4]]
    assert by_drawer["zoe"][0].tolist() == [7] and by_drawer["zoe"][1].tolist() == [[5, 6, 7, 8]]


def test_a_file_without_drawers_has_one(tmp_path):
    path = written(tmp_path, "frame,u_min,v_min,u_max,v_max\n3,1,2,3,4\n")
    assert list(boxes.read_drawers(path, FRAMES)) == [""]
    assert boxes.read(written(tmp_path, HEADER), FRAMES)[1].shape == (0, 4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER + "3,1,2,3,4,max\n3,1,2,3,4,max\n", "line 3: frame 3 has a second box"),
        (HEADER + "3,1,2,3,4,max\n3,1,2,3,4,max\n", "a second box of drawer 'max'"),
        (HEADER + "3,1,2,3,4,\n3,1,2,3,4,\n", "or name in the column 'drawer' who drew which"),
        (HEADER + "3,1,2,3,4,Max\n4,1,2,3,4,max\n", "line 3: the drawers 'Max' and 'max' differ by capitals alone"),
        (HEADER + "3,1,2,1,4,max\n", "line 2: the box has no area (u 1.0 to 1.0, v 2.0 to 4.0)"),
        (HEADER + "3,1,2,3,2,max\n", "line 2: the box has no area (u 1.0 to 3.0, v 2.0 to 2.0)"),
        (HEADER + "3,1,2,3,4\n", "line 2: has 5 values, not the 6"),
        (HEADER.replace("drawer", "drawr"), "not 'drawr' (did you mean 'drawer'?)"),
    ],
)
def test_slips_are_said_with_their_line(tmp_path, text, words):
    with pytest.raises(DiorError) as caught:
        boxes.read_drawers(written(tmp_path, text), FRAMES)
    assert words in str(caught.value)


def test_all_slips_of_a_file_are_said_together(tmp_path):
    path = written(tmp_path, HEADER + "400,1,2,3,4,max\n3,3,2,1,4,max\n4,1,2,3,4,max\nfive,1,2,3,4,max\n")
    with pytest.raises(DiorErrors) as caught:
        boxes.read_drawers(path, FRAMES)
    assert [re.search(r"line \d", str(error))[0] for error in caught.value.found] == ["line 2", "line 3", "line 5"]


def test_a_box_may_stick_out_of_the_picture_and_not_lie_beside_it(tmp_path):
    path = written(tmp_path, HEADER + "3,-9,2,9,4,max\n4,-9,2,7,4,max\n5,60,40,67,55,max\n")
    assert len(boxes.read(path, FRAMES)[0]) == 3
    with pytest.raises(DiorErrors) as caught:
        boxes.read(path, FRAMES, (64, 48))
    first, second = map(str, caught.value.found)
    assert "line 3: the middle of the box, (-1, 3), is outside of the 64x48 picture" in first and "line 4" in second


def test_each_fit_leaves_out_as_many_boxes_spread_over_the_walk():
    folds = boxes.folds(np.arange(0, 500, 10))
    assert np.bincount(folds).tolist() == [10] * boxes.FOLDS
    assert all(np.ptp(np.flatnonzero(folds == k)) > 20 for k in range(boxes.FOLDS))
    assert boxes.folds(np.array([4, 7, 9])).tolist() != [0, 0, 0] and not len(boxes.folds(np.zeros(0, int)))


def test_without_an_edge_there_is_no_line():
    assert np.isnan(boxes.line_of(np.array([])) + boxes.line_of(np.array([np.nan])))
    assert boxes.line_of(np.array([1.0, np.nan, 5.0, 2.0])) == 2


@pytest.mark.parametrize("sd", [0.5, 1.0, 2.0])
def test_edges_at_what_hides_a_part_are_told_from_the_bodys_own_however_they_are_drawn(sd):
    edges = 300 + sd * np.random.default_rng(3).standard_normal(60)
    own = np.array([314.0, 315.0, 313.0])
    line = boxes.line_of(np.r_[edges, own])
    assert boxes.at_line(np.r_[edges, own, np.nan], line).tolist() == [True] * 60 + [False] * 4
    # one or two that are off were drawn amiss: of the body's own there would be more
    assert boxes.at_line(np.r_[edges, own[:2]], boxes.line_of(edges)).all()
    assert not boxes.at_line(np.array([np.nan]), np.nan).any()


def test_rows_without_edges_are_told_by_who_wrote_them(tmp_path):
    path = written(tmp_path, HEADER + "# at the large screen\n9,,,,,zoe\n1,,,,,\n7,5,6,7,8,zoe\n4,,,,,zoe\nx,,,,,\n")
    assert boxes.without_edges(path) == {"zoe": [4, 9], "": [1]}
    path = written(tmp_path, "frame,u_min,v_min,u_max,v_max\n3,,,,\n2,1,2,3,4\n")
    assert boxes.without_edges(path) == {"": [3]}
    assert boxes.without_edges(written(tmp_path, HEADER)) == {}
