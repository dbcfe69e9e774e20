"""A wrong world says which mistake made it, by a walker with analytic answers and by cameras that see him."""

import numpy as np
import pytest

from benchmarks import scene
from benchmarks import wrong_worlds as benchmark
from benchmarks.wrong_worlds import KINDS
from dior.body import plausible, world_of_walk, wrong_world
from dior.body.wrong_world import Person
from dior.geometry.camera import inverse_pose, pose, project
from tests.calibrate.bundle.test_facts import walker
from tests.rig import ring

HEIGHT = 1.75
TOES = ("left_foot_index", "right_foot_index")
SECONDS = np.arange(60) / 30


def person(height=HEIGHT):
    """Joints (60, 12, 3) of one who walks along x, toes ahead, and their names."""
    points, tracks = walker(60, height)
    points = points.reshape(60, -1, 3)
    heels = [tracks.names.index(f"{side}_heel") for side in ("left", "right")]
    return np.concatenate([points, points[:, heels] + (0.2, 0, 0)], axis=1), tracks.names + TOES


def codes(points, names, **more):
    return [fault.code for fault in wrong_world.of_person(points, names, SECONDS, **more)]


def test_a_walker_in_a_right_world_is_not_warned_of():
    points, names = person()
    assert codes(points, names, person=Person("p1", HEIGHT)) == []
    assert wrong_world.handedness(points, names) == pytest.approx(1.0)
    np.testing.assert_allclose(wrong_world.upward(points, names), (0, 0, 1), atol=1e-9)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1.42, "too large by 1.42"),
        (1 / 1.5, "too small by 1.50"),
        (1000, "in millimetres, not metres"),
        (100, "in centimetres, not metres"),
        (39.37, "in inches"),
        (3.281, "in feet"),
        (0.001, "too small by 1000 (metres taken for millimetres?)"),
    ],
)
def test_a_size_is_named_by_the_height_that_it_does_not_tell(factor, words):
    points, names = person()
    fault = wrong_world.size_fault(factor * points, names, Person("p1", HEIGHT, 0.01), plausible.LIMITS)
    assert fault.code == "world_scale" and words in fault.text
    assert "1.75" not in fault.text and f"{factor * HEIGHT:.2f}" not in fault.text, "it goes into a log"


def test_without_a_height_only_what_no_person_has_is_named():
    points, names = person()
    assert codes(1.42 * points, names) == ["world_scale"]
    assert codes(1.2 * points, names) == [] == codes(points / 1.5, names)


@pytest.mark.parametrize(
    ("axes", "code", "words"),
    [
        ([[1, 0, 0], [0, 0, 1], [0, -1, 0]], "world_axes", "Y is up, not Z"),
        ([[0, 0, -1], [0, 1, 0], [1, 0, 0]], "world_axes", "-X is up, not Z"),
        ([[1, 0, 0], [0, -1, 0], [0, 0, -1]], "world_axes", "-Z is up, not Z"),
        ([[1, 0, 0], [0, -1, 0], [0, 0, 1]], "world_left_handed", "left-handed"),
    ],
)
def test_axes_are_named_alone(axes, code, words):
    points, names = person()
    found = wrong_world.of_person(points @ np.array(axes, float).T, names, SECONDS)
    assert [fault.code for fault in found] == [code] and words in found[0].text


def test_a_floor_elsewhere_a_tilt_a_rate_and_a_bone_are_named():
    points, names = person()
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))
    tilted = points @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    assert codes(points - (0, 0, 0.6), names) == ["world_floor"]
    assert "world_vertical" in codes(tilted, names)
    fast = wrong_world.of_person(points, names, SECONDS / 10)
    assert [fault.code for fault in fast] == ["world_speed"] and "m/s" in fast[0].text
    longer = points.copy()
    knees = [names.index(f"{side}_knee") for side in ("left", "right")]
    longer[:, knees] += (0, 0, -0.2)
    assert codes(longer, names) == ["world_bones"]


def rig():
    return ring(3, distortion=())


def seen(cameras, points):
    return np.stack([project(camera, points)[0] for camera in cameras])


@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if kind not in ("clean", "1.42 too large") and "1.5" not in kind]
)
def test_poses_of_no_use_are_named(kind):
    change, words = KINDS[kind]
    points, names = person()
    found, _ = wrong_world.of_poses(change(rig()), seen(rig(), points), names, Person("p1", HEIGHT))
    assert found and words in found[0].text
    beside = {"mm, camera 0": ["world_of_camera"]}.get(kind, [])
    assert [fault.code for fault in found[1:]] == beside


def test_poses_of_use_pass_whatever_their_size_and_heading():
    points, names = person()
    turn = pose([[0, -1, 0], [1, 0, 0], [0, 0, 1]], (3, -2, 0.1))
    for factor in (1.0, 1.5):
        cameras = [c.at(turn @ pose(c.wRc, factor * c.centre)) for c in rig()]
        found, got = wrong_world.of_poses(cameras, seen(rig(), points), names, Person("p1", HEIGHT))
        assert found == []
        np.testing.assert_allclose(got, factor * points @ turn[:3, :3].T + turn[:3, 3], atol=1e-6)


def test_metres_that_were_declared_as_another_unit_are_not_to_be_corrected_in_the_calibration():
    points, names = person()
    for metres in (0.01, 0.001):
        cameras = [c.at(pose(c.wRc, metres * c.centre)) for c in rig()]
        found, _ = wrong_world.of_poses(cameras, seen(rig(), points), names, Person("p1", HEIGHT), metres=metres)
        assert found[0].text.endswith("so set reference.units: m in the YAML of every camera of it")


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_exchanged_cameras_are_named_and_on_an_even_ring_what_looks_the_same(jitter):
    points, names = person()
    true = [c.at(pose(c.wRc, c.centre + jitter * np.array([i - 1, 0.5 * i, 0]))) for i, c in enumerate(rig())]
    cameras = [true[0].at(true[1].wTc), true[1].at(true[0].wTc), true[2]]
    found, _ = wrong_world.of_poses(cameras, seen(true, points), names)
    assert [fault.code for fault in found][:1] and "cam01 and cam02 exchanged" in found[0].text
    assert ("left-handed" in found[0].text) == (jitter == 0)


def test_poses_that_no_reading_explains_are_left_alone():
    points, names = person()
    cameras = rig()
    cameras[0] = cameras[0].at(pose(cameras[0].wRc, cameras[0].centre + (0, 0, 1.0)))
    reading, _ = wrong_world.other_reading(cameras, seen(rig(), points), names)
    assert wrong_world.meeting(cameras, seen(rig(), points))[0] > wrong_world.MEETING_PX and reading is None


@pytest.mark.parametrize("convention", ["cTw", "wTc"])
def test_the_fix_of_inverted_poses_is_the_other_convention(convention):
    points, names = person()
    inverse = [c.at(inverse_pose(c.wTc)) for c in rig()]
    found, _ = wrong_world.of_poses(inverse, seen(rig(), points), names, convention=convention)
    other = {"cTw": "wTc", "wTc": "cTw"}[convention]
    assert f"set reference.convention: {other}" in found[0].text


def test_the_world_of_the_walk_has_its_floor_and_vertical():
    from scipy.spatial.transform import Rotation

    points, names = person()
    for turn in ((0, 0, 0), (1.5, 0.2, -0.3), (0.1, 3.0, 0.4)):
        moved = points @ Rotation.from_rotvec(turn).as_matrix().T + (4, -3, 2)
        bTw = world_of_walk.rebased(moved, names)
        back = moved @ bTw[:3, :3].T + bTw[:3, 3]
        np.testing.assert_allclose(bTw[:3, :3] @ bTw[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(bTw[:3, :3]) > 0
        np.testing.assert_allclose(back[..., 2], points[..., 2], atol=1e-6)
        # he walks along x on the whole, and the middle of his way is the origin
        hips = plausible.middle(back, names, "hip")
        assert hips[-1, 0] - hips[0, 0] > 1.5 and abs(hips[:, :2].min(axis=0) + hips[:, :2].max(axis=0)).max() < 1e-6


def test_what_is_missing_says_nothing():
    assert codes(np.full((60, 2, 3), np.nan), ("nose", "left_hip"), person=Person("p1", HEIGHT)) == []
    found, _ = wrong_world.of_poses(rig(), np.full((3, 5, 2, 2), np.nan), ("nose", "left_hip"))
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("level", ["ideal", "real"])
@pytest.mark.parametrize("rig_name", benchmark.RIGS)
def test_every_mistake_is_named_by_cameras_that_see_a_walk_with_errors(rig_name, level, seed):
    """`python -m benchmarks.wrong_worlds 20 poses` has 20 seeds."""
    walk = scene.make(level, seed, benchmark.FRAMES, benchmark.rig(rig_name, seed))
    for change, words in KINDS.values():
        found = benchmark.said(change(walk.given), walk, True)
        assert benchmark.count(found, words, {}) == 1, (words, [fault.text for fault in found])
