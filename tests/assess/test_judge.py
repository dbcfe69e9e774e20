"""Datasets in memory that are right, or wrong on purpose by a known size."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import assess as made
from dior.assess import lens
from tests.cases import some


@pytest.fixture(scope="module")
def right():
    return made.recording("ideal", seed=3, frames=240)


def faults(found):
    """(what it is about, code) of all that is wrong."""
    own = [("", fault.code) for fault in found.faults]
    return own + [(row.camera, fault.code) for row in found.rows for fault in row.faults]


def test_a_right_dataset_passes(right):
    found = made.judged(right)
    assert not found.wrong and found.verdict.startswith("within the errors in 3 cameras")
    for row in found.rows:
        assert abs(row.timing.late_s) < 0.002 and row.timing.half_s < 0.005
        assert np.linalg.norm(row.beside.px) < 2 and abs(row.lens.focal - 1) < 0.01
    assert abs(found.world.scale - 1) < 0.005 and not found.world.mirrored


@pytest.mark.parametrize("level", some(["ideal", "real"], "ideal"))
@pytest.mark.parametrize("name", some([*made.WRONG], "offset", "scale", "lens"))
def test_what_is_wrong_on_purpose_is_named_with_its_size(level, name, right):
    if (level, name) == ("real", "lens"):
        pytest.skip("10 s of a real detector tell a lens or not: see the test below")
    recording = right if level == "ideal" else made.recording("real", seed=1, frames=300)
    case = made.WRONG[name]
    found = made.judged(case.make(recording))
    assert set(faults(found)) == {case.expected}, found.verdict
    assert made.size_of(found, name) == pytest.approx(case.size, abs=case.within * (1 if level == "ideal" else 3))


def test_other_rates_noise_and_missing_joints(right):
    random = np.random.default_rng(0)
    views = []
    for every, view in zip((1, 2, 3), right.views, strict=True):
        uv = view.uv[::every] + 4 * random.standard_normal(view.uv[::every].shape)
        uv[random.random(uv.shape[:2]) < 0.3] = np.nan
        # an arm that is never seen
        uv[:, [right.joints.index(f"left_{part}") for part in ("elbow", "wrist")]] = np.nan
        views.append(replace(view, elapsed=view.elapsed[::every], uv=uv, fps=view.fps / every))
    changed = replace(right, views=tuple(views))
    assert not made.judged(changed).wrong
    late = replace(changed, views=(views[0], made.late(views[1], 0.3), views[2]))
    found = made.judged(late)
    assert faults(found) == [("cam02", "offset")]
    time = found.rows[1].timing
    assert abs(time.late_s - 0.3) < max(3 * time.half_s, 0.005) and time.half_s < 0.02


def with_drift(recording):
    return replace(recording, views=(made.drifting(recording.views[0], 0.2), *recording.views[1:]))


def test_a_lens_is_not_sure_where_a_drift_cannot_be_told(right):
    assert "(or its clock drifts: the recording is too short to tell)" in made.judged(with_drift(right)).verdict


@pytest.mark.slow
def test_a_large_drift():
    found = made.judged(with_drift(made.recording("ideal", seed=3, frames=300)))
    assert faults(found) == [("cam01", "drift")]
    assert found.rows[0].timing.drift == pytest.approx(0.2, abs=0.01)


def test_2d_that_is_late_in_all_cameras_says_what_it_may_be(right):
    late = replace(right, views=tuple(made.late(view, -0.05 - 0.01 * i) for i, view in enumerate(right.views)))
    found = made.judged(late)
    assert set(faults(found)) == {("", "all_offset"), *((f"cam0{i}", "offset") for i in (1, 2, 3))}
    assert "all cameras is too late, by 0.0" in found.verdict and "a detector that smooths over time" in found.verdict
    # no detector smooths over so much, and none is early
    for late_s in (-0.4, 0.1):
        found = made.judged(replace(right, views=tuple(made.late(view, late_s) for view in right.views)))
        assert ("", "all_offset") in faults(found) and "smooths" not in found.verdict
        assert "the times of the 3D, or the stamps of all cameras" in found.verdict


def test_a_lens_of_a_short_recording_cannot_be_told(right):
    short = made.recording("real", seed=2, frames=60)
    found = made.judged(short)
    assert not found.wrong and "the lens: cannot tell (focal length known to ± 0." in found.verdict
    assert "k1 known to ± 0." in found.verdict
    # somebody who walks through the whole picture tells it
    assert lens.untold([made.judged(right).rows[1].lens]) == ""


@pytest.mark.slow
def test_a_wrong_lens_in_10_s_of_a_real_detector_is_named_or_said_not_to_be_told():
    for seed, named in ((0, True), (1, False)):
        found = made.judged(made.WRONG["lens"].make(made.recording("real", seed=seed, frames=300)))
        bend = found.rows[1].lens
        assert abs(bend.focal - made.FOCAL) < bend.half_focal
        assert set(faults(found)) == ({("cam02", "lens")} if named else set()), found.verdict
        assert named or "focal length known to ± " in lens.untold([bend])


def test_cameras_against_each_other_without_3d(right):
    alone = replace(right, motion=None)
    assert not made.judged(alone).wrong
    first, second, third = alone.views
    found = made.judged(replace(alone, views=(first, made.late(second, 0.3), third)))
    assert faults(found) == [("cam02", "offset")] and found.against == "cam01"
    assert found.rows[1].timing.late_s == pytest.approx(0.3, abs=0.01)
    exchanged = made.WRONG["exchanged"].make(alone)
    assert faults(made.judged(exchanged)) == [("", "exchanged")]


def test_what_cannot_be_told_says_why(right):
    still = replace(right.motion, xyz=np.broadcast_to(right.motion.xyz[:1], right.motion.xyz.shape))
    views = []
    for view in right.views:
        uv = np.broadcast_to(view.uv[:1], view.uv.shape) + np.random.default_rng(1).standard_normal(view.uv.shape)
        views.append(replace(view, uv=uv))
    found = made.judged(replace(right, motion=still, views=tuple(views)))
    assert not found.wrong and not found.told and found.verdict.startswith("cannot tell (cam01: ")
    assert "hardly move" in found.verdict or "fits about as well" in found.verdict or "end of" in found.verdict
    one = replace(right, motion=None, views=right.views[:1])
    assert "nothing to compare it with" in made.judged(one).verdict


@pytest.mark.slow
def test_2d_of_another_walk_does_not_pass(right):
    other = made.recording("ideal", seed=8, frames=240, walk="circling")
    views = tuple(replace(view, uv=theirs.uv) for view, theirs in zip(right.views, other.views, strict=True))
    found = made.judged(replace(right, views=(right.views[0], right.views[1], views[2])))
    assert [bool(row.faults or row.why) for row in found.rows] == [False, False, True], found.verdict
