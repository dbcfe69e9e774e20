import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dior.clocks import axis
from dior.errors import DiorError

T0 = 1_700_000_000_000_000_000


def test_clock_formula_with_its_signs():
    stamps = T0 + np.array([0, 1_000_000_000, 120_000_000_000])
    assert axis.seconds(stamps, T0, 0.25, 50.0) == pytest.approx([0.25, 1.25005, 120.256], abs=1e-12)


def test_nanoseconds_survive():
    assert axis.seconds(np.array([T0 + 1]), T0)[0] == 1e-9


@pytest.mark.parametrize("rate", [29.97, 30, 60, 100, 27.5])
def test_nominal_rate_from_rounded_and_jittered_stamps(rate):
    rng = np.random.default_rng(1)
    stamps = T0 + np.round(np.arange(300) / rate * 1e9 + rng.normal(0, 1e4, 300)).astype(np.int64)
    assert axis.nominal_fps(stamps) == pytest.approx(rate, rel=2e-3 if rate == 27.5 else 1e-9)


def test_one_picture_has_no_rate():
    frames = {"camera": np.array(["cam01", "cam01", "cam02"], object), "stamp_ns": T0 + np.array([0, 10**8, 0])}
    with pytest.raises(DiorError, match="camera cam02: 1 pictures"):
        axis.rates(frames, ["cam01", "cam02"])


def test_interpolation_never_crosses_a_drop_and_snaps_to_frames():
    times = np.array([0.0, 0.1, 0.2, 0.4, 0.5])
    values = times[:, None] * 10
    at = np.array([-0.01, 0.0, 0.05, 0.2000000001, 0.3, 0.4, 0.5, 0.51])
    found = axis.sample(times, values, at, 0.15)[:, 0]
    assert found == pytest.approx([np.nan, 0, 0.5, 2, np.nan, 4, 5, np.nan], nan_ok=True)


def test_a_missing_end_is_missing_but_not_for_an_exact_hit():
    times = np.array([0.0, 0.1, 0.2])
    values = np.array([1.0, np.nan, 3.0])
    assert axis.sample(times, values, [0.0, 0.05, 0.1, 0.15, 0.2], 0.15) == pytest.approx(
        [1, np.nan, np.nan, np.nan, 3], nan_ok=True
    )


@given(st.lists(st.floats(0, 1, allow_subnormal=False), min_size=1, max_size=20), st.integers(2, 30))
def test_a_straight_line_is_reproduced_anywhere_inside(queries, count):
    times = np.linspace(0, 1, count)
    found = axis.sample(times, 3 - 2 * times, np.array(queries), 2.0)
    assert found == pytest.approx(3 - 2 * np.array(queries), abs=1e-5)


def test_instants_end_at_the_last_picture():
    assert len(axis.instants(60, 99 / 60)) == 100
    assert axis.instants(30, 1.0)[-1] == pytest.approx(1.0)


def test_the_first_camera_by_name_sets_the_grid_and_each_has_its_own_rate():
    frames = {
        "camera": np.repeat(["cam02", "cam01"], 10).astype(object),
        "stamp_ns": T0 + np.concatenate([np.arange(10) * 16_666_667, np.arange(10) * 33_333_333]),
    }
    assert axis.rates(frames, ["cam02", "cam01"]) == ({"cam01": 30.0, "cam02": 60.0}, 30.0)


@pytest.mark.parametrize(("offset_s", "drift_ppm"), [(0.0, 200.0), (0.0, -200.0), (0.25, 50.0)])
def test_a_cameras_pictures_drift_with_its_clock(offset_s, drift_ppm):
    stamps = T0 + np.arange(61) * 1_000_000_000
    frames = {"camera": np.repeat(["cam01", "cam02"], 61).astype(object), "stamp_ns": np.tile(stamps, 2)}
    found = axis.camera_seconds(frames, "cam02", T0, (offset_s, drift_ppm, "manual"))
    # a minute at 200 ppm is 12 ms, a third of a picture at 30 Hz
    assert found[-1] - 60.0 == pytest.approx(offset_s + 60e-6 * drift_ppm, abs=1e-9)
    assert found[0] == pytest.approx(offset_s, abs=1e-12) and found.shape == (61,)


def test_a_camera_without_pictures_has_no_times():
    frames = {"camera": np.array(["cam01"], object), "stamp_ns": np.array([T0])}
    with pytest.raises(DiorError, match="camera cam02: no pictures"):
        axis.camera_seconds(frames, "cam02", T0, (0.0, 0.0, "assumed_zero"))


@pytest.mark.parametrize("standard", axis.RATES.tolist())
def test_a_rate_counts_as_standard_within_a_part_in_2500(standard):
    def of(rate):
        return axis.nominal_fps(T0 + np.round(np.arange(3) * 1e9 / rate).astype(np.int64))

    assert of(standard * (1 + 3e-4)) == of(standard * (1 - 3e-4)) == standard
    # 29.97 and 30 Hz, 59.94 and 60, are a part in 1000 apart: no farther off does a rate count as one of them
    for off in (5e-4, -5e-4):
        assert of(standard * (1 + off)) != standard
        assert of(standard * (1 + off)) == pytest.approx(standard * (1 + off), rel=1e-4)


@pytest.mark.parametrize("rates", [(15, 60), (60, 15), (120, 30), (29.97, 30)])
def test_instants_have_the_first_cameras_rate_and_gaps_each_cameras_own(rates):
    stamps = [T0 + np.round(np.arange(40) * 1e9 / rate).astype(np.int64) for rate in rates]
    frames = {"camera": np.repeat(["cam01", "cam02"], 40).astype(object), "stamp_ns": np.concatenate(stamps)}
    for order in (["cam01", "cam02"], ["cam02", "cam01"]):
        own, fps = axis.rates(frames, order)
        assert own == dict(zip(["cam01", "cam02"], map(float, rates), strict=True)) and fps == rates[0]


def walked(hz, count):
    """`skeletons_3d` of one joint at 1.2 m/s along X that gains 0.6 m/s every second along Y."""
    stamps = T0 + np.round(np.arange(count) * 1e9 / hz).astype(np.int64)
    t = (stamps - T0) / 1e9
    table = {
        "joint": np.array(["nose"] * count, object),
        "stamp_ns": stamps,
        "x": 1.2 * t,
        "y": 0.3 * t**2,
        "z": 0 * t + 1,
    }
    known = {f"sigma_{axis}": np.full(count, 0.01) for axis in "xyz"}
    known |= {f"rho_{pair}": np.zeros(count) for pair in ("xy", "xz", "yz")}
    return table | known | {"status": np.array(["ok"] * count, object)}


@pytest.mark.parametrize("hz", [15.0, 60.0, 120.0])
def test_a_walker_at_the_pictures_is_as_far_on_as_their_clock_says(hz):
    skeleton = walked(hz, int(20 * hz))
    stamps = T0 + np.array([2, 10, 18]) * 1_000_000_000
    walker = axis.moving(skeleton)
    points, velocity, bridged = walker.at_pictures(stamps, 0.1, 300.0)
    moments = np.array([2, 10, 18]) * 1.0003 + 0.1
    np.testing.assert_allclose(velocity[:, 0, 0], 1.2, atol=1e-6)
    np.testing.assert_allclose(velocity[:, 0, 1], 0.6 * moments, atol=1e-5)
    np.testing.assert_allclose(points[:, 0, 0], 1.2 * moments, atol=1e-7)
    assert walker.joints == ["nose"] and not bridged.any()
    noise = walker.noise_at_pictures(stamps, 0.1, 300.0)
    np.testing.assert_allclose(noise, np.broadcast_to(1e-4 * np.eye(3), (3, 1, 3, 3)), atol=1e-12)
    # a clock that is earlier than the first instant has nothing to show
    assert np.isnan(walker.at_pictures(T0 + np.array([0]), -0.01, 0.0)[0]).all()


def test_between_instants_a_foot_that_lands_keeps_its_curve():
    skeleton = walked(30.0, 60)
    t = (skeleton["stamp_ns"] - T0) / 1e9
    # 1 cm up and down 5 times a second: 10 m/s^2 at its ends
    skeleton["z"] = 0.01 * np.cos(2 * np.pi * 5 * t)
    skeleton["x"][40] = np.nan
    stamps = T0 + np.round((np.arange(9, 50) + 0.5) * 1e9 / 30).astype(np.int64)
    points, *_ = axis.moving(skeleton).at_pictures(stamps, 0.0, 0.0)
    at = (stamps - T0) / 1e9
    beside = np.isnan(points[:, 0, 0])
    assert np.flatnonzero(beside).tolist() == [30, 31]
    off = np.abs(points[:, 0, 2] - 0.01 * np.cos(2 * np.pi * 5 * at))
    line = 0.01 * (1 - np.cos(2 * np.pi * 5 / 60))
    assert off[~beside].max() < 0.3 * line
    np.testing.assert_allclose(points[~beside, 0, 0], 1.2 * at[~beside], atol=1e-9)
    # whole instants are what they are
    again, *_ = axis.moving(skeleton).at_pictures(skeleton["stamp_ns"][10:30], 0.0, 0.0)
    np.testing.assert_allclose(again[:, 0, 2], skeleton["z"][10:30], atol=1e-12)


def test_t0_is_the_first_instant_of_the_mocap_or_else_the_first_picture():
    frames = {"stamp_ns": T0 + np.array([7, 5, 9])}
    assert axis.start_ns(frames) == T0 + 5
    assert axis.start_ns(frames, {"stamp_ns": T0 + np.array([30, 20])}) == T0 + 20


def test_a_picture_beside_a_bridged_instant_says_so_and_between_lost_ones_there_is_nothing():
    skeleton = walked(100.0, 50)
    skeleton["status"][20] = "gap_filled"
    skeleton = {key: np.delete(values, [30, 31, 32]) for key, values in skeleton.items()}
    at = np.array([18.5, 19.0, 19.5, 20.0, 20.5, 21.0, 28.5, 29.0, 30.0, 31.5, 33.0])
    points, _, bridged = axis.moving(skeleton).at_pictures(T0 + np.round(at * 1e7).astype(np.int64), 0.0, 0.0)
    assert at[bridged[:, 0]].tolist() == [19.5, 20.0, 20.5]
    assert at[np.isnan(points[:, 0, 0])].tolist() == [30.0, 31.5]


def test_a_picture_that_was_recorded_after_a_later_one_is_in_its_place():
    times, order = np.arange(6) / 10, np.array([0, 1, 3, 2, 4, 5])
    values = 10 * times[:, None]
    at = np.array([0.05, 0.15, 0.2, 0.25, 0.35, 0.6])
    found = axis.sample(times[order], values[order], at, 0.15)[:, 0]
    assert found == pytest.approx([0.5, 1.5, 2, 2.5, 3.5, np.nan], nan_ok=True)
    before, after, _ = axis.bracket(times[order], at, 0.15)
    assert before.tolist() == [0, 1, 3, 3, 2, -1] and after.tolist() == [1, 3, 3, 2, 4, -1]
