"""Proportions and gait of simulated walkers, against what they were made with."""

from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import COCO_17, MLKIT_33
from dior.reid.features import FEATURES, measure
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.simulate.patterns import WALK
from tests.cases import slow

FPS, SECONDS = 30.0, 10.0
JOINTS = [MLKIT_33.index(name) for name in COCO_17]


def walk(fps=FPS, seconds=SECONDS, body=None, pattern=WALK, noise=0.0, **how):
    points = Walker(body or Body(1.75), pattern, until=seconds + 1, **how).at(np.arange(seconds * fps) / fps)[0][
        :, JOINTS
    ]
    return points + noise * np.random.default_rng(1).standard_normal(points.shape)


def gait(points, fps=FPS):
    found, why = measure(points, np.full((*points.shape[:2], 3, 3), np.nan), fps)
    assert why == ""
    assert found.values.shape == found.sigma.shape == (len(FEATURES),)
    assert np.isfinite(found.sigma).all() and (found.sigma > -1e-12).all()
    return dict(zip(FEATURES, found.values, strict=True))


def test_lengths_and_their_shares():
    body = Body(1.75, thigh_share=0.26, upper_arm_share=0.17)
    found = gait(walk(body=body))
    for name, length in (("thigh", body.thigh), ("shank", body.shank), ("upper_arm", body.upper_arm)):
        assert found["size"] + found[f"{name}_share"] == pytest.approx(np.log(length), abs=1e-4), name
    assert found["size"] + found["hips_share"] == pytest.approx(np.log(2 * body.half_hips), abs=1e-4)


def test_cadence_and_stride():
    for speed in (0.9, 1.2):
        found = gait(walk(speed=speed))
        leg = 1.75 * 0.491
        strides = WALK.strides(speed, 1.75)
        # the walker slows down towards the turns
        assert np.exp(found["cadence"]) / np.sqrt(leg / 9.81) == pytest.approx(0.95 * strides, rel=0.05)
        assert np.exp(found["stride"]) * leg == pytest.approx(0.93 * speed / strides, rel=0.06)


def test_a_scale_changes_the_size_only():
    one, two = gait(walk()), gait(1.03 * walk())
    assert two["size"] - one["size"] == pytest.approx(np.log(1.03))
    changed = [name for name in FEATURES if abs(two[name] - one[name]) > 1e-6]
    # what has a time in it knows a length by gravity
    assert set(changed) == {"size", "cadence"}


@pytest.mark.slow
def test_where_and_when_a_walk_is_does_not_matter():
    one = gait(walk())
    turned = gait(walk(direction=1.0) + np.array([3.0, -2.0, 0.5]))
    later = gait(walk(start=2.0))
    faster = gait(walk(fps=100.0), 100.0)
    for other, most in ((turned, 0.02), (later, 0.05), (faster, 0.05)):
        assert max(abs(other[name] - one[name]) for name in FEATURES) < most


@pytest.mark.parametrize(
    ("change", "feature", "least"),
    [
        ({"arm": (-8.0, 26.0, 30.0, 10.0)}, "shoulder_cos1", 0.12),
        slow({"arm": (-8.0, 16.0, 45.0, 10.0)}, "elbow_0", 0.2),
        slow({"lean": 8.0}, "lean_0", 0.06),
        slow({"hips_turn": 12.0}, "hips_turn_cos1", 0.06),
        slow({"feet_apart": 0.05}, "step_width_0", 0.05),
        slow({"quickness": 1.08}, "cadence", 0.05),
    ],
)
def test_a_gait_shows_where_it_differs(change, feature, least):
    one, two = gait(walk()), gait(walk(pattern=replace(WALK, **change)))
    assert abs(two[feature] - one[feature]) > least


def test_gaps_and_noise_are_borne():
    clean = gait(walk())
    points = walk(noise=0.01)
    random = np.random.default_rng(2)
    for joint in range(17):
        first = random.integers(20, 270)
        points[first : first + 12, joint] = np.nan
    found = gait(points)
    assert max(abs(found[name] - clean[name]) for name in FEATURES if not name.endswith("_share")) < 0.05


def test_a_walk_that_says_nothing_is_left_out():
    none = np.full((300, 17, 3, 3), np.nan)
    still = np.repeat(walk()[:1], 300, axis=0)
    assert (
        measure(still, none, FPS) == (None, measure(still, none, FPS)[1]) and "straight" in measure(still, none, FPS)[1]
    )
    armless = walk()
    armless[:, COCO_17.index("left_wrist")] = armless[:, COCO_17.index("right_wrist")] = np.nan
    assert measure(armless, none, FPS) == (None, "the 3D has no forearm")
    assert measure(walk()[:40], none[:40], FPS)[0] is None
    assert measure(np.full((300, 17, 3), np.nan), none, FPS)[0] is None
