"""What stands out of a scene: who moves, not the light, also who walks over the same pixels all the time."""

import numpy as np
import pytest

from dior.ingest import moving
from dior.release import faces

HEIGHT, WIDTH = 96, 128


def backdrop():
    return np.random.default_rng(0).integers(40, 160, (HEIGHT, WIDTH, 3), np.uint8)


def with_square(picture, row, column, size=8):
    found = picture.copy()
    found[row : row + size, column : column + size] = (220, 30, 220)
    return found


def test_who_crosses_stands_out_whole_and_nothing_else_does():
    pictures = [with_square(backdrop(), 20, 2 * i) for i in range(21)]
    scene = moving.scene_of(pictures)
    assert (scene.empty == backdrop()).all()
    mask = moving.standing_out(pictures[10], scene)
    assert mask[20:28, 20:28].all() and mask.sum() == 64
    assert moving.groups(mask, 3, 12).tolist() == [[20, 20, 28, 28]]


@pytest.mark.parametrize("gain, offset", [(0.8, 0), (1.2, 0), (1.0, 20)])
def test_another_light_does_not_stand_out(gain, offset):
    scene = moving.scene_of([backdrop()] * 5)
    other = np.clip(with_square(backdrop(), 10, 10) * gain + offset, 0, 255).astype(np.uint8)
    mask = moving.standing_out(other, scene)
    assert mask[10:18, 10:18].all() and mask.sum() < 80


def test_the_scene_is_where_the_subject_is_not():
    """In 14 of 21 pictures somebody stands on the same pixels; where that is the 3D tells."""
    there = np.zeros((HEIGHT, WIDTH), np.uint8)
    there[18:30, 18:30] = 1
    pictures = [with_square(backdrop(), 20, 20) if i < 14 else backdrop() for i in range(21)]
    assert not (moving.scene_of(pictures).empty == backdrop()).all()
    without = [there if i < 14 else np.zeros_like(there) for i in range(21)]
    assert (moving.scene_of(pictures, without).empty == backdrop()).all()


def test_groups_are_joined_where_near_and_left_out_where_small_and_away():
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[5:9, 5:9], mask[5:9, 12:16], mask[30:32, 30:32] = 1, 1, 1
    assert moving.groups(mask, 7, 12).tolist() == [[5, 5, 16, 9]]
    assert moving.groups(mask, 1, 12).tolist() == [[5, 5, 9, 9], [12, 5, 16, 9]]
    near = np.zeros_like(mask)
    near[31, 31] = 1
    assert moving.groups(mask, 1, 12, near).tolist() == [[5, 5, 9, 9], [12, 5, 16, 9], [30, 30, 32, 32]]
    assert moving.groups(np.zeros_like(mask), 1, 12).shape == (0, 4)


def test_smaller_pictures_hold_the_mean_of_their_pixels():
    picture = backdrop()
    assert np.abs(moving.reduced(picture, 4)[3, 5] - picture[12:16, 20:24].mean(axis=(0, 1))).max() <= 0.5
    assert moving.reduced(picture[:93, :125], 4).shape == (24, 32, 3)


def test_a_face_beside_the_cover_is_somebody_elses():
    """Two people in picture 3: the subject under the cover, and one beside it; covered a little before and after."""
    uv = np.array([[[100.0, 100.0]] * 3, [[300.0, 90.0]] * 3])
    found = faces.Faces(np.array([3, 3]), ["nose"] * 3, uv, uv.mean(axis=1), np.array([200.0, 200.0]))
    edges = np.tile((80.0, 70.0, 120.0, 130.0), (9, 1))
    boxes = faces.strangers(found, edges, np.arange(9) * 0.1)
    assert [len(each) for each in boxes] == [0, 1, 1, 1, 1, 1, 0, 0, 0]
    assert boxes[3].tolist() == [[280, 64, 321, 117]]
    assert np.allclose(faces.off(found, np.full((9, 3, 2), (98.0, 101.0)), ["nose"] * 3)[3], (2.0, -1.0))
