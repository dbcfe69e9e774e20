"""A covered head cannot be uncovered: pictures that differ in it become the same."""

import numpy as np
import pytest

from dior.release import head_blur

BOX = (20, 12, 60, 68)  # cells of 10 x 14 px


@pytest.fixture
def picture():
    return np.random.default_rng(0).integers(0, 256, (90, 100, 3), np.uint8)


def covered(picture, box=BOX, how="blurred"):
    out = picture.copy()
    head_blur.cover(out, np.array(box, float), how)
    return out


def mask(box=BOX, shape=(90, 100)):
    return head_blur.ellipse(box, np.arange(shape[0]), np.arange(shape[1]))


@pytest.mark.parametrize("how", ["blurred", "filled", "pixelated"])
def test_only_the_ellipse_changes(picture, how):
    out = covered(picture, how=how)
    assert (out[~mask()] == picture[~mask()]).all()
    assert (out[mask()] != picture[mask()]).any(axis=1).mean() > 0.95


def test_ellipse_touches_the_edges_of_the_box():
    inside = np.argwhere(mask())
    assert inside.min(axis=0).tolist() == [12, 20] and inside.max(axis=0).tolist() == [67, 59]
    assert mask().sum() == pytest.approx(np.pi / 4 * 40 * 56, rel=0.01)


@pytest.mark.parametrize("how", ["blurred", "pixelated"])
def test_pictures_with_the_same_cells_become_the_same(picture, how):
    """Whatever is in a cell, only its mean colour is left: 16 colours of the head's 2240 pixels."""
    other = picture.copy()
    random = np.random.default_rng(1)
    for row in range(12, 68, 14):
        for column in range(20, 60, 10):
            cell = other[row : row + 14, column : column + 10].reshape(-1, 3)
            other[row : row + 14, column : column + 10] = random.permutation(cell).reshape(14, 10, 3)
    assert (other[mask()] != picture[mask()]).any()
    assert (covered(picture, how=how)[mask()] == covered(other, how=how)[mask()]).all()


def test_pixelated_has_at_most_16_colours(picture):
    assert len(np.unique(covered(picture, how="pixelated")[mask()], axis=0)) <= 16


def test_filled_leaves_nothing(picture):
    assert (covered(picture, how="filled")[mask()] == head_blur.GREY).all()


def test_head_of_five_pixels_is_one_colour(picture):
    box = (30, 30, 35, 36)
    assert len(np.unique(covered(picture, box)[mask(box)], axis=0)) == 1


@pytest.mark.parametrize("box", [(-20, -10, 20, 30), (80, 70, 120, 110), (-10, -10, 110, 100)])
def test_head_partly_outside(picture, box):
    out = covered(picture, box, "filled")
    assert (out[mask(box)] == head_blur.GREY).all() and (out[~mask(box)] == picture[~mask(box)]).all()


def test_head_outside_changes_nothing(picture):
    assert (covered(picture, (-40, 10, -8, 50)) == picture).all()
