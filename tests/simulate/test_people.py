"""Who walks, and on which day: settings `people` and `sessions`."""

import numpy as np
import pytest

from dior.body.names import MLKIT_33, PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.simulate import scene
from dior.simulate.body import Body, body_of, markers
from dior.simulate.motion import motion_of
from dior.simulate.settings import from_dict, sequences
from tests.cases import slow

TIMES = np.arange(0, 4, 0.01)


def first_walk(people, subject):
    settings = from_dict({"subjects": 6, "people": people})
    return settings, next(walk for walk in sequences(settings) if walk.subject == subject)


def length(points, names, a, b):
    return np.linalg.norm(points[:, names.index(a)] - points[:, names.index(b)], axis=-1)


def test_the_same_person_may_go_by_many_names():
    settings = from_dict({"subjects": 6, "people": "same"})
    assert len({body_of(settings, f"S{i:02d}") for i in range(1, 7)}) == 1
    other = from_dict({"subjects": 6})
    assert len({body_of(other, f"S{i:02d}") for i in range(1, 7)}) == 6
    # a height does not depend on what else people differ in
    apart = from_dict({"subjects": 6, "people": "different"})
    assert body_of(apart, "S01").height == body_of(other, "S01").height
    assert body_of(other, "S01") == Body(body_of(other, "S01").height)


@pytest.mark.parametrize("subject", ["S01", *(slow(f"S{i:02d}") for i in range(2, 7))])
def test_different_people_walk_as_people_do(subject):
    settings, walk = first_walk("different", subject)
    body, motion = body_of(settings, subject), motion_of(settings, walk)
    landmarks, skin = motion.at(TIMES)
    thigh = length(landmarks, MLKIT_33, "left_hip", "left_knee")
    assert np.ptp(thigh) < 1e-6 and thigh[0] == pytest.approx(body.thigh)
    lowest = min(
        landmarks[:, MLKIT_33.index(f"{side}_{part}"), 2].min()
        for side in ("left", "right")
        for part in ("heel", "foot_index")
    )
    assert -0.02 < lowest < 0.03
    # markers sit on this body: at the end of its own thigh
    knee = skin[:, PLUG_IN_GAIT_39.index("LKNE")] - landmarks[:, MLKIT_33.index("left_knee")]
    assert np.linalg.norm(knee, axis=-1).max() < 0.08
    acceleration = np.gradient(np.gradient(landmarks, 0.01, axis=0), 0.01, axis=0)
    assert np.linalg.norm(acceleration, axis=-1).max() < 300


def test_people_differ_about_as_much_as_people_do():
    settings = from_dict({"people": "different"})
    bodies = [body_of(settings, f"S{i:03d}") for i in range(300)]
    for part, sd in (("upper_arm_share", 0.03), ("half_hips_share", 0.04), ("long_legs", 0.025)):
        values = np.log([getattr(body, part) for body in bodies])
        assert np.std(values) == pytest.approx(sd, rel=0.15), part
    # a long leg is not a tall person
    sizes = np.array([(body.thigh + body.shank + body.trunk) / body.height for body in bodies])
    assert np.ptp(sizes) < 0.01


def test_days_have_cameras_of_their_own_and_everybody_comes_once():
    settings = from_dict({"subjects": 5, "sessions": 2})
    walks = sequences(settings)
    assert list(dict.fromkeys(walk.session for walk in walks)) == ["lab", "lab_2", "field", "field_2"]
    for environment in ("indoor", "outdoor"):
        days = {}
        for walk in walks:
            if walk.environment == environment:
                days.setdefault(walk.subject, set()).add(walk.session)
        assert all(len(found) == 1 for found in days.values())
    first, second = (scene.cameras_of(settings, session) for session in ("field", "field_2"))
    assert not np.allclose(first["cam01"].camera.wTc, second["cam01"].camera.wTc)
    assert second["cam04"].camera.role == "long_range"
    assert first["cam01"].tape == scene.cameras_of(from_dict({}), "field")["cam01"].tape


def test_unknown_people_are_refused():
    with pytest.raises(DiorError, match="simulate.people: 'sames' is unknown .did you mean 'same'"):
        from_dict({"people": "sames"})


def test_average_proportions_change_no_marker():
    axes = np.broadcast_to(np.eye(3), (1, 3, 3))
    names = ("head", "chest", "pelvis") + tuple(
        f"{side}_{part}"
        for side in ("left", "right")
        for part in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
    )
    segments = {name: (np.zeros((1, 3)), axes) for name in names}
    usual = markers(Body(1.75), segments)
    longer = markers(Body(1.75, thigh_share=0.245 * 1.1), segments)
    moved = np.abs(longer - usual).max(axis=(0, 2)) > 0
    assert {name for name, off in zip(PLUG_IN_GAIT_39, moved, strict=True) if off} == {"LTHI", "LKNE", "RTHI", "RKNE"}
