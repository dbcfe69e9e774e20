"""Tracks of everybody, put side by side for the choice of the subject."""

import numpy as np

from dior.reconstruct import everybody

JOINTS = 2


def table(*tracks):
    """Rows of `detected_people` of one camera: (number, first frame, last frame) each, u being the number."""
    rows = [
        (frame, number) for number, first, last in tracks for frame in range(first, last + 1) for _ in range(JOINTS)
    ]
    frame, track = np.array(rows).T
    return {"frame": frame, "track": track, "u": track * 1.0, "v": frame * 1.0, "score": np.ones(len(frame))}


def test_those_who_are_there_at_one_time_lie_side_by_side_and_the_longest_first():
    values, track = everybody._slots(table((7, 0, 3), (8, 2, 9), (9, 5, 6)), 10, JOINTS)
    assert track.tolist() == [[-1, -1] + [8] * 8, [7] * 4 + [-1, 9, 9] + [-1] * 3]
    np.testing.assert_array_equal(values[1, 5], [[9.0, 5.0, 1.0]] * JOINTS)
    assert np.isnan(values[0, :2]).all() and np.isfinite(values[0, 2:]).all()


def test_of_more_than_most_the_shortest_is_left_out():
    crowd = [(number, 0, 9 - number) for number in range(everybody.MOST + 1)]
    _, track = everybody._slots(table(*crowd), 10, JOINTS)
    assert len(track) == everybody.MOST and everybody.MOST not in track
