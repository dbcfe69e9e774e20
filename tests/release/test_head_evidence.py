"""Where a bust is seen: whatever somebody wears, at the same place; and what follows for the cover of each picture."""

import cv2
import numpy as np
import pytest

from dior.geometry import camera as cam
from dior.geometry.multiview import rotation_z
from dior.release import head_evidence as evidence
from tests.rig import camera

JOINTS = [f"{side}_{name}" for name in ("ear", "shoulder", "elbow", "hip") for side in ("left", "right")]
# left, up m from the middle between the ears
PLACES = np.array([(0.075, 0), (0.19, -0.20), (0.25, -0.50), (0.12, -0.75)]).repeat(2, axis=0)
PLACES[1::2, 0] *= -1
# half breadth and height of the head, how far clothes lie outside of the joints, how high a cap reaches above the ears
DRESSED = {
    "bare": (0.08, 0.12, 0.03, 0.0), "cap": (0.08, 0.12, 0.03, 0.18),
    "coat": (0.10, 0.12, 0.10, 0.0), "cap and coat": (0.095, 0.125, 0.10, 0.18),
}  # fmt: skip
# s; a picture each
TIMES = np.arange(40) / 10


def subject(view, middle, side):
    """A body that stands with its breadth seen whole, or from the `side`, its ears about `middle` (3,) m."""
    points = np.array(middle) + np.stack([0 * PLACES[:, 0], PLACES[:, 0] * (0.2 if side else 1), PLACES[:, 1]], axis=1)
    head = cam.project(view, np.array([middle]) + (0, 0, 0.01))[0]
    scale = view.intrinsics.fx / np.linalg.norm(np.array(middle) - view.centre)
    edges = np.concatenate([head - scale * np.array([0.18, 0.23]), head + scale * np.array([0.18, 0.23])], axis=1)
    return evidence.subject_of(view, edges, np.array([middle]), points[None], JOINTS, 1)


def drawn(there, wears):
    """What stands out of the scene where that body is, in these clothes."""
    wide, high, clothes, cap = DRESSED[wears]
    mask, scale = np.zeros((720, 1280), np.uint8), there.scale[0]
    ears = there.head[0] + (0, 0.01 * scale)
    at = np.round(ears).astype(int).tolist()
    cv2.ellipse(mask, at, (int(wide * scale), int(high * scale)), 0, 0, 360, 1, -1)
    cv2.line(mask, at, np.round(ears + (0, 0.2 * scale)).astype(int).tolist(), 1, int(0.11 * scale))
    for a, b in np.round(there.limbs[0]).astype(int).tolist():
        cv2.line(mask, a, b, 1, int(2 * clothes * scale))
    cv2.fillConvexPoly(mask, cv2.convexHull(np.round(there.trunk[0]).astype(np.int32)), 1)
    if cap:
        cv2.rectangle(mask, np.round(ears - np.array([0.09, cap]) * scale).astype(int).tolist(), at, 1, -1)
    return mask


@pytest.mark.parametrize("quarters", range(4))
def test_a_bust_in_a_turned_picture_is_that_of_the_upright_one(quarters):
    level = camera("c", (7.0, 0, 1.6), (0, 0, 1.6), distortion=(0.0,) * 8)
    turned = level.at(cam.pose(level.wRc @ rotation_z(-quarters * np.pi / 2), level.centre))
    assert evidence.quarter_turns(turned) == quarters
    there = subject(level, (0.0, 0.3, 1.6), False)
    mask = drawn(there, "cap")
    as_seen = np.rot90(mask, -quarters)
    seen = evidence.turned(there, -quarters, mask.shape)
    upright = evidence.turned(seen, quarters, as_seen.shape)
    np.testing.assert_allclose(upright.head, there.head)
    np.testing.assert_allclose(upright.limbs, there.limbs)
    np.testing.assert_allclose(upright.edges, there.edges)
    # a pixel of the mask at the nose stays at the nose
    u, v = np.round(seen.head[0]).astype(int)
    assert as_seen[v, u] and as_seen.sum() == mask.sum()
    says, off = evidence.bust(np.ascontiguousarray(np.rot90(as_seen, quarters)), upright, 0)
    assert says == "seen" and (np.abs(off) <= 0.02).all()


@pytest.mark.parametrize("roll_deg", range(0, 360, 30))
def test_the_nearest_upright_picture_has_up_above(roll_deg):
    level = camera("c", (7.0, 0, 1.6), (0, 0, 1.6), distortion=(0.0,) * 8)
    turned = level.at(cam.pose(level.wRc @ rotation_z(np.radians(roll_deg)), level.centre))
    foot, head = cam.project(turned, np.array([(0.0, 0, 1.0), (0.0, 0, 1.6)]))[0]
    foot, head = evidence.turned_points(np.array([foot, head]), evidence.quarter_turns(turned), (720, 1280))
    up = head - foot
    assert -up[1] >= 0.99 * abs(up[0])


@pytest.mark.parametrize("off", [(0.0, 0.0), (0.08, 0.0), (-0.05, 0.10), (0.0, -0.12)])
@pytest.mark.parametrize("wears", DRESSED)
@pytest.mark.parametrize("side", [False, True])
def test_a_bust_is_seen_where_it_is_whatever_somebody_wears(side, wears, off):
    view = camera("c", (7.0, 0, 1.6), (0, 0, 1.6), distortion=(0.0,) * 8)
    there = subject(view, (0.0, 0.3, 1.6), side)
    mask = np.roll(drawn(there, wears), np.round(np.array(off) * there.scale[0]).astype(int), axis=(1, 0))
    says, found = evidence.bust(mask, there, 0)
    assert says == "seen"
    assert (np.abs(found - off) <= 0.02).all(), found - off


def told(off_m, scale, says="seen", told=False, times=TIMES):
    cover = np.tile((-0.17, -0.22, 0.17, 0.22), (len(times), 1))
    words = np.full(len(times), says, object)
    given = np.full(len(times), told)
    return evidence.sure(words, off_m, cover, np.broadcast_to(scale, len(times)), times, given)


def test_an_angle_that_all_pictures_share_is_judged_where_the_head_is_far():
    """Of 40 pictures 10 are twice as far away: there, the same angle is twice as many metres."""
    scale = np.where(np.arange(40) < 10, 50.0, 100.0)
    off = np.tile((0.05, 0.0), (40, 1)) * (100.0 / scale)[:, None]
    # what these far pictures themselves show is wrong
    off[:10] = (0.02, 0.0)
    assert (told(off, scale) == np.where(scale == 50.0, "beside", "ok")).all()
    assert (told(off * 0.5, scale) == "ok").all()


def test_of_the_height_more_pictures_tell_than_of_the_side():
    """A bust seen too low for half a second is none; one seen to the side, a clock or a step aside, may be one."""
    off = np.zeros((40, 2))
    off[10:15, 1] = 0.15
    assert (told(off, 100.0) == "ok").all()
    assert (told(off[:, ::-1], 100.0)[11:14] == "beside").all()


def test_what_a_detector_or_a_person_says_counts_near_the_cover_and_is_covered_too():
    view = camera("c", (7.0, 0, 1.6), (0, 0, 1.6), distortion=(0.0,) * 8)
    there = subject(view, (0.0, 0.0, 1.6), False)
    cover = evidence.covers_m(there)
    for off, counts, boxes in (((0.0, 0.0), True, 0), ((0.1, 0.02), True, 1), ((0.3, 0.0), False, 0)):
        known, found = evidence.told_where(there, cover, np.array([off]))
        assert known.tolist() == [counts] and len(found[0]) == boxes
        if boxes:
            head = there.head[0] + (0, 0.01 * there.scale[0]) + np.array(off) * there.scale[0] + 0.5
            reach = np.array(evidence.LARGE_HEAD_M) * there.scale[0]
            (box,) = found[0]
            assert (box[:2] <= head - reach).all() and (box[2:] >= head + reach).all()
            assert (box[2:] - box[:2] <= 2 * reach + 2 * evidence.TOLD_SPARE_M * there.scale[0] + 2).all()
    assert not evidence.told_where(there, cover, np.full((1, 2), np.nan))[0].any()
