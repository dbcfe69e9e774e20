import numpy as np
import pytest

from dior.report import overlays


@pytest.mark.parametrize("tall, zoomed", [(600, False), (600, True), (300, True), (22, True)])
def test_a_point_of_the_picture_is_drawn_where_it_is(tall, zoomed):
    """A bright disc in the picture lies in the tile where the view says, at every scale."""
    import cv2

    middle = np.array([800.0, 380.0])
    picture = np.zeros((720, 1280, 3), np.uint8)
    radius = max(tall // 20, 2)
    cv2.circle(picture, (800, 380), radius, (255, 255, 255), -1)
    body = middle + np.array([[0, -tall / 2], [0, tall / 2], [20, 0]])
    view = overlays.view_of(1280, 720, overlays.TILE, 0.5, body, zoomed)
    tile = overlays.shown_in(view, picture)
    assert tile.shape == (view.size[1], view.size[0], 3)
    v, u = np.nonzero(tile[..., 0] > 127)
    assert np.array([u.mean(), v.mean()]) == pytest.approx(view.of(middle), abs=0.6)
    assert np.sqrt(len(u) / np.pi) == pytest.approx(radius * view.scale, rel=0.35)


def test_a_small_person_is_enlarged_eight_times_and_a_large_one_fits():
    def scale(tall):
        body = np.array([[640.0, 300.0], [640.0, 300.0 + tall]])
        return overlays.view_of(1280, 720, overlays.TILE, 0.5, body, True).scale

    assert scale(22) == 8.0 and 0.5 < scale(400) < 0.7 and scale(719) == 0.5
