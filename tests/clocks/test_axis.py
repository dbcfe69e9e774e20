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
