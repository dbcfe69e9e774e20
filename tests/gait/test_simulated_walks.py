"""Walkers whose contacts with the floor are known."""

from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.gait import events, parameters, tracks
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.simulate.patterns import RUN, WALK, of_person

FPS, SECONDS = 30.0, 7.0


def walk(speed=1.1, pattern=WALK, half_length=20.0, belt=False):
    """`Tracks` of a walker straight ahead, his contacts, and the velocity of the belt below him."""
    walker = Walker(Body(1.75), pattern, speed=speed, half_length=half_length, start=2.0, until=SECONDS + 1)
    seconds = np.arange(0, SECONDS, 1 / FPS)
    points = walker.at(seconds)[0]
    moves = np.array([-speed, 0.0]) if belt else np.zeros(2)
    points[..., :2] += np.outer(seconds, moves)[:, None]
    return tracks.of_joints(seconds, points, MLKIT_33), walker.contacts, moves


def errors(found, true, strike):
    inside = (true.seconds > 0.3) & (true.seconds < SECONDS - 0.3) & (true.strike == strike)
    out = []
    for when, foot in zip(true.seconds[inside], true.foot[inside], strict=True):
        own = found.seconds[(found.strike == strike) & (found.side == foot)]
        out.append(own[np.abs(own - when).argmin()] - when)
    return np.array(out)


@pytest.mark.parametrize("speed", [0.4, 1.0, 1.6])
@pytest.mark.parametrize("belt", [False, True])
def test_events_are_where_the_feet_touch_the_floor(speed, belt):
    t, true, moves = walk(speed, belt=belt)
    found = events.find(t)
    for strike in (True, False):
        off = errors(found, true, strike)
        assert len(off) > 4 and np.abs(off).max() < 0.020
        count = ((found.strike == strike) & (found.reason == "")).sum()
        assert abs(count - len(off)) <= 2
    # a foot that rolls hides a hundredth of the belt's velocity
    np.testing.assert_allclose(found.belt, moves, atol=0.02 * speed)
    assert not found.running


def test_a_belt_may_be_given():
    t, _, moves = walk(1.0, belt=True)
    np.testing.assert_array_equal(events.find(t, moves).belt, moves)
    length = {p.name: p for p in parameters.of_walk(t, events.find(t, moves))[1] if p.side == "both"}["stride_length"]
    straight = {p.name: p for p in parameters.of_walk(walk(1.0)[0], events.find(walk(1.0)[0]))[1] if p.side == "both"}
    assert length.value == pytest.approx(straight["stride_length"].value, abs=0.002)


def test_a_limp_is_seen():
    t, true, _ = walk(pattern=replace(WALK, second=0.56))
    found = events.find(t)
    assert np.abs(errors(found, true, True)).max() < 0.020
    pooled = {(p.name, p.side): p for p in parameters.of_walk(t, found)[1]}
    stride = pooled["stride_time", "both"].value
    assert pooled["step_time", "right"].value == pytest.approx(0.56 * stride, abs=0.01)
    assert pooled["step_time", "left"].value == pytest.approx(0.44 * stride, abs=0.01)
    assert pooled["step_time_asymmetry", "both"].value == pytest.approx(-0.24, abs=0.02)


def test_running_is_found_and_has_no_double_support():
    t, true, _ = walk(2.3, RUN)
    found = events.find(t)
    assert found.running and np.abs(errors(found, true, True)).max() < 0.020
    pooled = {(p.name, p.side): p for p in parameters.of_walk(t, found)[1]}
    none = pooled["double_support_share", "both"]
    assert np.isnan(none.value) and none.reason == "running" and none.count == 0


def test_a_runners_toes_are_off_however_the_ankle_stretches():
    for seed in range(4):
        t, true, _ = walk(2.3, of_person(RUN, np.random.default_rng(seed)))
        found = events.find(t)
        assert found.running and abs(np.median(errors(found, true, False))) < 0.010


def test_parameters_are_the_walkers():
    t, true, _ = walk(1.2)
    pooled = {(p.name, p.side): p for p in parameters.of_walk(t, events.find(t))[1]}
    heel = true.heel[true.strike & (true.foot == 0)]
    stride = np.linalg.norm(np.diff(heel, axis=0), axis=1).mean()
    both = {name: pooled[name, "both"] for name in ("stride_length", "step_length", "cadence", "walk_ratio")}
    assert both["stride_length"].value == pytest.approx(stride, abs=0.002)
    assert both["step_length"].value == pytest.approx(stride / 2, abs=0.002)
    assert both["cadence"].value == pytest.approx(120 * 1.2 / stride, rel=0.01)
    assert both["walk_ratio"].value == pytest.approx(both["step_length"].value / both["cadence"].value)
    assert pooled["step_width", "both"].value == pytest.approx(2 * 0.026 * 1.75, abs=0.02)
    assert pooled["swing_share", "left"].value == pytest.approx(1 - pooled["stance_share", "left"].value)


def test_skin_is_where_it_was_a_stride_before():
    t, _, _ = walk(1.2)
    sigmas = [r.sigma for r in parameters.of_walk(t, events.find(t))[0] if r.name == "stride_length"]
    assert np.sqrt(2) * parameters.PRINT_SD_M < np.median(sigmas) < 1.6 * parameters.PRINT_SD_M
    # the prints of two feet differ by the skin of both
    sigmas = [r.sigma for r in parameters.of_walk(t, events.find(t))[0] if r.name == "step_length"]
    assert np.median(sigmas) > np.sqrt(2) * tracks.SKIN_SIGMA_M


def test_turns_are_left_out():
    t, _, _ = walk(1.1, half_length=1.5)
    found = events.find(t)
    turned = found.reason == "turn"
    assert 0.1 < turned.mean() < 0.9
    rows, _ = parameters.of_walk(t, found)
    used = {round(v, 6) for r in rows for v in (r.start, r.end)}
    assert not used & set(np.round(found.seconds[turned], 6).tolist())


def test_a_gap_leaves_events_out_and_makes_none():
    t, _, _ = walk()
    heel, toe = t.heel.copy(), t.toe.copy()
    heel[60:80], toe[60:80] = np.nan, np.nan
    whole, less = events.find(t), events.find(replace(t, heel=heel, toe=toe))
    gone = (whole.seconds > t.seconds[60]) & (whole.seconds < t.seconds[79])
    inside = (less.seconds > t.seconds[60]) & (less.seconds < t.seconds[79])
    assert gone.any() and not (less.reason[inside] == "").any()
    fine = less.seconds[less.reason == ""]
    assert np.abs(fine[:, None] - whole.seconds).min(axis=1).max() < 0.010


@pytest.mark.parametrize("frames", [0, 1, 20])
def test_too_little_has_no_events_and_says_so(frames):
    t, _, _ = walk()
    rows = {key: getattr(t, key)[:frames] for key in t.__dataclass_fields__ if key != "noise_time_s"}
    short = replace(t, **rows)
    found = events.find(short)
    assert not len(found.seconds)
    rows, pooled = parameters.of_walk(short, found)
    assert not rows and {p.reason for p in pooled} == {"no_events"}


def test_who_stands_makes_no_step():
    t, _, _ = walk()
    still = replace(t, **{key: np.repeat(getattr(t, key)[:1], len(t.seconds), 0) for key in ("pelvis", "heel", "toe")})
    assert not (events.find(still).reason == "").any()


def test_joints_that_lack_are_told():
    seconds = np.arange(10) / FPS
    assert tracks.of_joints(seconds, np.zeros((10, 2, 3)), ("left_hip", "right_hip")) is None


def test_noise_makes_events_as_uncertain_as_they_are():
    t, true, _ = walk(1.0)
    random = np.random.default_rng(1)
    sd, errors_z = 0.004, []
    C = np.broadcast_to(sd**2 * np.eye(3), t.heel_covariance.shape)
    clean = events.find(t)
    for _ in range(6):
        noisy = replace(
            t,
            heel=t.heel + sd * random.standard_normal(t.heel.shape),
            toe=t.toe + sd * random.standard_normal(t.toe.shape),
            heel_covariance=C,
            toe_covariance=C,
        )
        found = events.find(noisy)
        for strike in (True, False):
            for side in (0, 1):
                a, b = (
                    np.flatnonzero((e.strike == strike) & (e.side == side) & (e.reason == "")) for e in (clean, found)
                )
                for i in b:
                    k = a[np.abs(clean.seconds[a] - found.seconds[i]).argmin()]
                    errors_z.append((found.seconds[i] - clean.seconds[k]) / found.sigma_s[i])
    assert 0.6 < np.sqrt(np.mean(np.square(errors_z))) < 1.3
