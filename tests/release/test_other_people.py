"""Others are covered with their heads, between the pictures in which they are seen, and on their way."""

import numpy as np

from dior.release import other_people

TIMES = np.arange(40) / 10  # s; a picture each


def test_what_is_as_tall_as_a_body_is_covered_with_the_head_that_it_must_have():
    """A head of the colours of the scene does not stand out; what is small is no body; no box leaves the picture."""
    boxes = np.array([[10, 100, 20, 200], [10, 100, 20, 130], [10, 5, 20, 200]])
    found = other_people.with_head(boxes, 100.0)
    np.testing.assert_allclose(found, [[10, 45, 20, 200], [10, 100, 20, 130], [10, 0, 20, 200]], atol=1)


def test_who_is_seen_is_covered_there_a_little_before_and_after():
    """What overlaps becomes one box, what does not stays two; the clock is in seconds, not in pictures."""
    nothing, one, next_to_it = np.zeros((0, 4), int), np.array([[10, 20, 14, 30]]), np.array([[13, 20, 17, 31]])
    others = [nothing] * 40
    others[10], others[12], others[13] = one, next_to_it, np.array([[60, 70, 64, 75]])
    found = other_people.held(others, TIMES, (100, 100))
    assert [boxes.tolist() for boxes in found[7:9]] == [[], one.tolist()]
    assert found[9].tolist() == one.tolist() and found[11].tolist() == [[10, 20, 17, 31], [60, 70, 64, 75]]
    assert found[15].tolist() == [[60, 70, 64, 75]] and not len(found[16])
    assert [len(boxes) for boxes in other_people.held(others, TIMES / 20, (100, 100))] == [2] * 40


def test_a_body_that_is_gone_for_a_while_is_covered_on_its_way():
    """Ten pictures a second; it walks to the right by 10 px each, 1 m/s, and is as tall as 1 m."""
    nothing = np.zeros((0, 4), int)

    def walking(gone, others=()):
        boxes = [np.array([[10 * i, 20, 10 * i + 30, 120]]) for i in range(40)]
        for i in gone:
            boxes[i] = nothing
        for i, box in others:
            boxes[i] = np.array([box])
        return other_people.followed(boxes, TIMES, 100.0)

    found = walking(range(12, 24))
    for i, boxes in enumerate(found):
        np.testing.assert_allclose(boxes, [[10 * i, 20, 10 * i + 30, 120]], atol=1)
    # nobody comes back in time, or where they can have walked to, or it was nothing as tall as a body
    for found in (
        walking(range(12, 28)),
        walking(range(12, 40), [(14, (600, 20, 630, 120))]),
        walking(range(12, 40), [(14, (140, 20, 170, 60))]),
    ):
        assert not len(found[12]) and not len(found[13])
