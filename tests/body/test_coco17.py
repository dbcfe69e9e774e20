"""COCO-17 from a detector's joints and from Plug-in-Gait markers."""

import numpy as np
import pytest

from benchmarks.joint_centres import WALK, plug_in_gait
from dior.body.coco17 import HEAD, MARKER_DIAMETER_M, SHOULDER_DROP_M, WIDTHS_M, coco17
from dior.body.names import COCO_17, MLKIT_33, PLUG_IN_GAIT_39
from dior.simulate import settings
from dior.simulate.motion import motion_of

HALF = {name: (width + MARKER_DIAMETER_M) / 2 for name, width in WIDTHS_M.items()}
DROP = SHOULDER_DROP_M + MARKER_DIAMETER_M / 2
# 0.17 of the shoulders' width of 0.4 m below the marker, towards the middle of the front of the pelvis
BELOW = (0, 0.2, 1.4 + DROP) - 0.068 * np.array([0, 0.2, 0.4 + DROP]) / np.hypot(0.2, 0.4 + DROP)
UP, LEFT = np.array([0, 0, 1.0]), np.array([0, 1.0, 0])


def t_pose():
    """Joint centres and markers of a body of known joints: arms held out, forearms forward, thumbs up."""
    joints = {
        "left_hip": (-0.0456, 0.0864, 0.928),
        "left_knee": (-0.0456, 0.0864, 0.5),
        "left_ankle": (-0.0456, 0.0864, 0.1),
        "left_shoulder": (0.0, 0.2, 1.4),
        "left_elbow": (0.0, 0.5, 1.4),
        "left_wrist": (0.25, 0.5, 1.4),
    }
    at = {name: np.array(point) for name, point in joints.items()}
    markers = {
        "LASI": (0.0, 0.12, 1.0), "LPSI": (-0.16, 0.05, 1.0),
        "LSHO": at["left_shoulder"] + DROP * UP, "LELB": at["left_elbow"] + HALF["elbow"] * UP,
        "LWRA": at["left_wrist"] + 0.03 * UP, "LWRB": at["left_wrist"] - 0.03 * UP,
        "LTHI": at["left_hip"] + (0, 0.1, -0.2), "LKNE": at["left_knee"] + HALF["knee"] * LEFT,
        "LTIB": at["left_knee"] + (0, 0.08, -0.2), "LANK": at["left_ankle"] + HALF["ankle"] * LEFT,
        "LFHD": (0.095, 0.07, 1.7), "LBHD": (-0.095, 0.07, 1.7),
    }  # fmt: skip
    markers |= {"R" + name[1:]: np.array(point) * (1, -1, 1) for name, point in markers.items()}
    radius = MARKER_DIAMETER_M / 2
    markers |= {"CLAV": (radius, 0, 1.4), "C7": (-0.1, 0, 1.4), "STRN": (radius, 0, 1.2), "T10": (-0.1, 0, 1.2)}
    at |= {name.replace("left", "right"): point * (1, -1, 1) for name, point in at.items()}
    for name, offset in HEAD.items():
        at[name] = np.array([0.095, 0, 1.7]) + offset
    for side, y in (("left", 0.07), ("right", -0.07)):
        at[f"{side}_ear"] = np.array([0.0, y, 1.65])
    return np.stack([at[name] for name in COCO_17]), markers


def turned(points, angle=0.7, shift=(1.0, -2.0, 0.1)):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + shift


def derived_from(markers, without=()):
    names = [name for name in markers if name not in without]
    return coco17(np.array([markers[name] for name in names], float), names)


def test_joint_centres_of_a_known_body_are_found_wherever_it_stands():
    expected, markers = t_pose()
    names = list(markers)
    still = np.array([markers[name] for name in names], float)
    points, derived, rules = coco17(np.stack([still, turned(still)]), names)
    np.testing.assert_allclose(points, [expected, turned(expected)], atol=1e-12)
    assert derived.all()
    assert dict(zip(COCO_17, rules, strict=True)) == {
        **dict.fromkeys(COCO_17[:5], "head"),
        **{name: "chord" for name in COCO_17 if name.endswith(("shoulder", "knee", "ankle"))},
        **{name: "hinge" for name in COCO_17 if name.endswith("elbow")},
        **{name: "marker" for name in COCO_17 if name.endswith("wrist")},
        **{name: "bell" for name in COCO_17 if name.endswith("hip")},
    }


def test_a_straight_arm_has_its_elbow_inwards_of_the_marker():
    expected, markers = t_pose()
    for side, y in (("L", 0.75), ("R", -0.75)):
        markers[f"{side}WRA"], markers[f"{side}WRB"] = (0.0, y, 1.43), (0.0, y, 1.37)
    points, _, _ = derived_from(markers)
    np.testing.assert_allclose(points[[7, 8]], expected[[7, 8]], atol=1e-7)


def test_joints_of_a_detector_are_taken_by_name():
    xyz = np.random.default_rng(0).normal(size=(4, 33, 3))
    points, derived, rules = coco17(xyz, MLKIT_33)
    # the documented indices of BlazePose (spec of re-identification, 9.1)
    index = [0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28]
    np.testing.assert_array_equal(points, xyz[:, index])
    assert not derived.any()
    assert set(rules) == {"named"}


@pytest.mark.parametrize(
    ("without", "joint", "rule", "expected"),
    [
        ({"LTHI"}, "left_knee", "shift", (-0.0456, 0.0864, 0.5)),
        ({"LTIB"}, "left_ankle", "shift", (-0.0456, 0.0864, 0.1)),
        ({"RPSI"}, "left_hip", "marker", (-0.08, 0.085, 1.0)),
        ({"LBHD"}, "nose", "marker", (0.095, 0.0, 1.7)),
        ({"T10"}, "left_shoulder", "drop", BELOW),
        ({"LSHO"}, "left_elbow", "marker", (0.0, 0.5, 1.4 + HALF["elbow"])),
        ({"LWRB"}, "left_elbow", "marker", (0.0, 0.5, 1.4 + HALF["elbow"])),
    ],
)  # fmt: skip
def test_without_a_marker_the_next_rule_holds(without, joint, rule, expected):
    points, _, rules = derived_from(t_pose()[1], without)
    at = COCO_17.index(joint)
    assert rules[at] == rule
    np.testing.assert_allclose(points[at], expected, atol=1e-9)


def test_a_joint_without_its_marker_is_missing_and_says_which():
    points, derived, rules = derived_from(t_pose()[1], {"LWRB", "RKNE"})
    unknown = {name: rules[i] for i, name in enumerate(COCO_17) if np.isnan(points[i]).any()}
    assert unknown == {"left_wrist": "no_LWRB", "right_knee": "no_RKNE"}
    assert rules[COCO_17.index("right_ankle")] == "marker"
    assert not derived[COCO_17.index("left_wrist")]


def test_a_gap_of_a_marker_is_a_gap_of_its_joints_only():
    _, markers = t_pose()
    names = list(markers)
    xyz = np.repeat(np.array([[markers[name] for name in names]], float), 3, axis=0)
    xyz[1, names.index("LKNE")] = np.nan
    points, _, rules = coco17(xyz, names)
    missing = np.isnan(points).any(axis=-1)
    assert not missing[[0, 2]].any()
    assert {COCO_17[i] for i in np.flatnonzero(missing[1])} == {"left_knee", "left_ankle"}
    assert rules[COCO_17.index("left_knee")] == "chord"


def test_a_marker_that_is_never_seen_counts_as_absent():
    _, markers = t_pose()
    points, _, rules = derived_from(markers | {"LTHI": np.full(3, np.nan)})
    assert rules[COCO_17.index("left_knee")] == "shift"
    assert np.isfinite(points).all()


def test_nothing_known_gives_nothing():
    points, derived, rules = coco17(np.zeros((5, 1, 3)), ["T10"])
    assert np.isnan(points).all()
    assert points.shape == (5, 17, 3)
    assert not derived.any()
    assert all(rule.startswith("no_") for rule in rules)


def test_distance_to_the_joint_centres_of_a_simulated_walk():
    """The simulator's skin is nobody's in particular: its hips lie 98 mm behind the front of the pelvis, Bell's 45."""
    walk = settings.from_dict({"environments": ["indoor"], "duration_s": 3.0})
    motion = motion_of(walk, settings.sequences(walk)[0])
    landmarks, markers = motion.at(np.arange(0, 3, 0.05))
    errors = 1000 * np.linalg.norm(coco17(markers, motion.names)[0] - coco17(landmarks, MLKIT_33)[0], axis=-1)
    mean = dict(zip(COCO_17, errors.mean(axis=0), strict=True))
    within = {
        "nose": 12,
        "eye": 9,
        "ear": 21,
        "shoulder": 20,
        "elbow": 5,
        "wrist": 12,
        "hip": 55,
        "knee": 25,
        "ankle": 14,
    }
    for part, most in within.items():
        assert max(error for name, error in mean.items() if name.endswith(part)) < most
    assert errors.mean() < 19
    assert motion.names == PLUG_IN_GAIT_39


def test_distance_to_plug_in_gaits_joint_centres_of_a_real_walk(shared):
    """That subject's widths were measured (knees 92 mm, ankles 53 mm); ours are an adult's."""
    path = shared / "mocap" / WALK.name
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    markers, names, true = plug_in_gait(path)
    points, _, rules = coco17(markers, names)
    for joint, centre in true.items():
        at = COCO_17.index(joint)
        off = 1000 * np.linalg.norm(points[:, at] - centre, axis=-1)
        assert np.isfinite(off).mean() > 0.9
        assert rules[at] == ("bell" if joint.endswith("hip") else "chord")
        assert np.nanpercentile(off, 95) < (30 if joint.endswith("hip") else 15), joint
