"""A click beside a bright round blob goes to its middle, and stays where there is none."""

import numpy as np
import pytest

from dior.studio.blobs import REACH_PX, snapped


def drawn(blobs, size=(60, 80), level=110, slope=0.0, noise=3.0, seed=0):
    """A grey picture (height, width) with discs (u, v, diameter, grey level), each pixel the mean of 8 x 8 samples."""
    fine = (np.indices((8 * size[0], 8 * size[1])) + 0.5) / 8 - 0.5
    picture = np.full(fine[0].shape, float(level)) + slope * fine[1]
    for u, v, wide, grey in blobs:
        picture[np.hypot(fine[1] - u, fine[0] - v) <= wide / 2] = grey
    picture = picture.reshape(size[0], 8, size[1], 8).mean(axis=(1, 3))
    return np.clip(picture + np.random.default_rng(seed).normal(0, noise, size), 0, 255).round().astype(np.uint8)


@pytest.mark.parametrize("wide", [2.0, 3.0, 5.0, 8.0])
@pytest.mark.parametrize(("u", "v"), [(40.0, 30.0), (40.3, 29.6), (39.5, 30.5)])
def test_the_middle_is_found_to_a_fraction_of_a_pixel(wide, u, v):
    for du, dv in [(0, 0), (3, 2), (-4, 2), (1, -4)]:
        found = snapped(drawn([(u, v, wide, 250)]), u + du, v + dv)
        np.testing.assert_allclose(found, (u, v), atol=0.3)


def test_a_slope_does_not_draw_it():
    np.testing.assert_allclose(snapped(drawn([(40.3, 29.6, 4, 250)], slope=1.0), 42, 30), (40.3, 29.6), atol=0.25)


def test_of_two_that_nearly_touch_the_nearer_one_counts():
    picture = drawn([(37.0, 30.0, 3, 250), (41.2, 30.0, 3, 250)])
    np.testing.assert_allclose(snapped(picture, 36.5, 31.0), (37.0, 30.0), atol=0.5)
    np.testing.assert_allclose(snapped(picture, 42.0, 29.0), (41.2, 30.0), atol=0.5)


def test_where_there_is_none_nothing_is_found():
    assert snapped(drawn([]), 40, 30) is None
    assert snapped(drawn([(40, 30, 4, 250)]), 40 + REACH_PX + 1, 30) is None
    # a lamp, and a dark one
    assert snapped(drawn([(40, 30, 30, 250)]), 40, 30) is None
    assert snapped(drawn([(40, 30, 4, 30)]), 40, 30) is None


def test_a_bright_line_is_no_marker():
    picture = drawn([])
    picture[29:31] = 240
    assert snapped(picture, 40, 30) is None


@pytest.mark.parametrize(("u", "v"), [(0.5, 0.5), (78.5, 58.5)])
def test_at_the_edge_of_the_picture(u, v):
    found = snapped(drawn([(u, v, 3, 250)]), u, v)
    assert found is None or np.linalg.norm(found - (u, v)) < 0.7


def test_a_faint_blob_beside_something_bright_is_no_marker():
    picture = drawn([(40, 30, 3, 150)])
    np.testing.assert_allclose(snapped(picture, 40, 30), (40, 30), atol=0.3)
    picture[:, 43:45] = 250
    assert snapped(picture, 40, 30) is None
