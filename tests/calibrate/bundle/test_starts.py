"""Starts: from the pixels alone, and the choice among what comes of them."""

import numpy as np
import pytest

from dior.calibrate.bundle import starts
from dior.calibrate.bundle.outcome import shift_and_turn
from dior.errors import DiorError
from dior.geometry.camera import pose, project
from dior.geometry.multiview import rotation_z
from tests.calibrate.test_adjust import body, misplaced, seen
from tests.rig import ring


@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_epipolar_start_does_not_need_the_aim(count):
    cameras, points = ring(5)[:count], body()
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    away = [c.at(pose(turn @ c.wRc, c.centre)) for c in cameras] if count > 2 else cameras
    found = starts.epipolar(away, seen(cameras, points, 0.5))
    for camera, true in zip(found, cameras, strict=True):
        distance, angle = shift_and_turn(true, camera)
        assert distance < 0.25 and angle < 4


def test_too_few_joints_give_no_epipolar_start():
    assert starts.epipolar(ring(3), seen(ring(3), body(20))) is None


PARTS = [f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "hip", "ankle")]
STANDING = np.array([(x, y, z) for y in (0.2, -0.2) for x, z in ((0.0, 1.45), (0.0, 0.95), (0.15, 0.08))])


def people(camera, count=40):
    """Joints (F, 6, 2) px of somebody who walks through a camera's pictures."""
    along = np.linspace(-1.5, 1.5, count)
    return project(camera, STANDING + np.stack([along, 0.3 * along, 0 * along], axis=-1)[:, None])[0]


@pytest.mark.parametrize("roll_deg", range(-150, 181, 30))
def test_the_people_tell_how_a_camera_is_rolled(roll_deg):
    (level,) = ring(1)
    turned = level.at(pose(level.wRc @ rotation_z(np.radians(roll_deg)), level.centre))
    found = np.degrees(starts.roll(level, people(turned), PARTS))
    assert abs((found - roll_deg + 180) % 360 - 180) < (8 if roll_deg else 1e-9)


def test_nobody_or_people_upside_up_and_down_tell_no_roll():
    (level,) = ring(1)
    uv = people(level)
    turned = np.where(np.arange(40)[:, None, None] % 2, (1279, 719) - uv, uv)
    assert starts.roll(level, turned, PARTS) == 0.0
    assert starts.roll(level, np.full((40, 6, 2), np.nan), PARTS) == 0.0
    assert starts.roll(level, (1279, 719) - uv[:5], PARTS) == 0.0
    assert starts.roll(level, (1279, 719) - uv, ["nose"] * 6) == 0.0


def outcome(*ends):
    """An attempt that ends at the cameras given for its turn; None fails."""
    left = iter(ends)

    def attempt(start):
        end = next(left)
        if end is None:
            raise DiorError("s: it cannot be")
        return end

    return attempt


def test_two_starts_that_agree_end_the_search():
    cameras, uv = ring(3), seen(ring(3), body(), 1.0)
    chosen, tried = starts.best(misplaced(cameras), uv, outcome(cameras, cameras), "s")
    assert len(tried) == 2 and starts.same_world(chosen.cameras, cameras)


def test_the_better_of_two_worlds_wins_and_a_failed_start_is_told():
    cameras, uv = ring(3), seen(ring(3), body(), 1.0)
    worse = misplaced(cameras, 0.3)
    chosen, tried = starts.best(cameras, uv, outcome(worse, cameras, None, None, None, None), "s")
    assert chosen.name == "epipolar" and [not one.cameras for one in tried] == [False] * 2 + [True] * 4


def test_equal_starts_in_different_worlds_are_refused():
    """All cameras moved together: the pixels fit as well."""
    cameras, uv = ring(3), seen(ring(3), body(), 1.0)
    other = [c.at(pose(c.wRc, c.centre + (0.5, 0, 0))) for c in cameras]
    with pytest.raises(DiorError, match=r"s: starts .* different worlds \(as placed 2\.\d+ px, epipolar 2\.\d+ px"):
        starts.best(cameras, uv, outcome(cameras, other, None, None, None, None), "s")


def test_where_all_fail_the_placed_ones_are_complained_about():
    cameras, uv = ring(3), seen(ring(3), body(), 1.0)
    with pytest.raises(DiorError, match="s: it cannot be"):
        starts.best(cameras, uv, outcome(*[None] * 6), "s")
