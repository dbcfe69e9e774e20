"""Which frames are offered: analytic walks."""

import numpy as np

from dior.calibrate.marks.marks import Motion
from dior.studio import frames_to_mark


def walk(speed=1.2, step_hz=1.0, direction=(1.0, 0.0)):
    """Two ankles that swing by turns about a middle that walks on; 100 Hz, 4 s."""
    t = np.arange(401) / 100
    way = np.array(direction) / np.linalg.norm(direction)
    swing = 0.3 * np.sin(2 * np.pi * step_hz * t + 0.5)
    xyz = np.zeros((len(t), 3, 3))
    for joint, sign in enumerate((1, -1, 0)):
        xyz[:, joint, :2] = (speed * t + sign * swing)[:, None] * way
    xyz[:, 2, 2] = 1.0
    return Motion(t, 0, xyz, ["LANK", "RANK", "C7"])


def test_feet_pass_where_their_places_along_the_way_are_the_same():
    # sin(2 pi t + 0.5) is 0
    wanted = (np.pi * np.arange(1, 9) - 0.5) / (2 * np.pi)
    for direction in [(1, 0), (-1, 0), (0.3, -2)]:
        np.testing.assert_allclose(frames_to_mark.feet_pass(walk(direction=direction)), wanted, atol=0.002)


def test_who_stands_passes_nothing_and_without_feet_nothing_is_known():
    assert not len(frames_to_mark.feet_pass(walk(speed=0.0)))
    still = walk()
    assert not len(frames_to_mark.feet_pass(Motion(still.t, 0, still.xyz, ["A", "B", "C"])))


def test_a_marker_that_is_missing_does_not_move_the_middle_to_nowhere():
    xyz = np.array([[[0.0, 0, 0], [2, 0, 0], [np.nan] * 3], [[np.nan] * 3] * 3])
    np.testing.assert_array_equal(frames_to_mark.middle(xyz), [[1, 0, 0], [np.nan] * 3])


def test_the_frames_nearest_to_times_within_the_recording():
    times = np.arange(10) / 10 + 5.0
    assert frames_to_mark.nearest_frames(times, np.array([4.9, 5.04, 5.06, 5.41, 7.0])).tolist() == [0, 1, 4]
    assert not len(frames_to_mark.nearest_frames(times, np.array([1.0])))


def test_the_furthest_place():
    places = np.array([[0.0, 0, 0], [3, 0, 0], [5, 0, 0]])
    assert frames_to_mark.furthest(places, np.array([[0.0, 0, 0], [6, 0, 0]])) == (1, 3.0)


def test_what_moves_and_where():
    before = np.full((100, 200), 100, np.uint8)
    after = before.copy()
    after[30:70, 50:80] = 200
    pixels, box = frames_to_mark.movement(before, after)
    assert abs(pixels - 1200) < 200
    np.testing.assert_allclose(box, (50, 30, 79, 69), atol=2)
    assert frames_to_mark.movement(before, before) == (0, None)
    after[30:70, 0:80] = 200
    assert frames_to_mark.movement(before, after)[0] == 0


def test_the_liveliest_frame_or_one_in_the_middle():
    assert frames_to_mark.liveliest([(3, 10, None), (5, 30, None), (7, 20, None)]) == 1
    assert frames_to_mark.liveliest([(3, 0, None), (5, 0, None), (7, 0, None)]) == 1
