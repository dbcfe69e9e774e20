from dataclasses import asdict

import numpy as np
import pytest

from dior.clocks import clock as clocks


def test_clocks_survive_being_written(tmp_path):
    gain = np.arange(12.0).reshape(2, 6)
    made = {
        "cam01": clocks.Clock(0.0, source="reference", given=(0.0, 0.0)),
        "cam02": clocks.Clock(0.25, -3.0, "estimated", "cameras", 30.0, (0.001, 5.0), {"cam01": gain, "cam02": -gain}),
    }
    paths = tmp_path / "o.parquet", tmp_path / "g.parquet"
    clocks.write(*paths, "walk_1", made, ["cam01", "cam02"], 1e-8 * np.eye(12))
    again = clocks.read(paths[:1], paths[1:])
    assert list(again) == ["cam01", "cam02"] and asdict(again["cam01"]) == asdict(made["cam01"])
    assert again["cam02"].given == (0.001, 5.0) and (again["cam02"].gains["cam02"] == -gain).all()


def test_sigma_counts_the_cameras():
    gain = np.zeros((2, 6))
    gain[0, 3] = 1 / 1.2  # a shift along the walk
    clock = clocks.Clock(0.0, given=(0.003, 1.0), gains={"cam01": gain})
    joint = np.diag([0.0] * 9 + [0.0048**2] + [0.0] * 2)
    np.testing.assert_allclose(clock.sigma(["cam00", "cam01"], joint), [0.005, 1.0])
    assert np.isnan(clock.sigma()).all()


def test_clocks_of_several_sequences_in_one_table(tmp_path):
    gain = np.ones((2, 6))
    first = clocks.Clock(0.1, 0.0, "estimated", "marks", 3.0, (0.001, 30.0), {"cam01": gain})
    made = {"walk_1": {"cam01": first}, "walk_2": {"cam01": clocks.Clock(0.2, source="manual")}}
    paths = tmp_path / "o.parquet", tmp_path / "g.parquet"
    clocks.write_all(*paths, made, ["cam01"], 1e-8 * np.eye(6))
    one, two = (clocks.read(paths[:1], paths[1:], name)["cam01"] for name in made)
    assert (one.offset_s, one.given, two.offset_s, two.source) == (0.1, (0.001, 30.0), 0.2, "manual")
    assert (one.gains["cam01"] == gain).all() and not two.gains


def test_sigma_has_the_given_part_and_the_poses_part_of_time_and_drift():
    gains = {"cam01": np.zeros((2, 6)), "cam02": np.zeros((2, 6))}
    gains["cam01"][:, 0], gains["cam02"][:, 4] = (0.3, 500.0), (-0.4, 900.0)
    clock = clocks.Clock(0.1, 20.0, "estimated", "cameras", 30.0, (0.003, 7.0), gains)
    joint = np.zeros((12, 12))
    joint[0, 0], joint[10, 10], joint[0, 10], joint[10, 0] = 1e-4, 4e-4, 5e-5, 5e-5
    time = 0.003**2 + 0.09 * 1e-4 + 0.16 * 4e-4 - 2 * 0.12 * 5e-5
    drift = 7.0**2 + 500**2 * 1e-4 + 900**2 * 4e-4 + 2 * 500 * 900 * 5e-5
    np.testing.assert_allclose(clock.sigma(["cam01", "cam02"], joint), np.sqrt([time, drift]))
    # the order of the cameras in the covariance is that of the names
    turned = np.roll(np.roll(joint, 6, axis=0), 6, axis=1)
    np.testing.assert_allclose(clock.sigma(["cam02", "cam01"], turned), np.sqrt([time, drift]))


def test_sigma_is_unknown_without_the_covariance_of_a_camera_that_it_hangs_on():
    clock = clocks.Clock(0.1, given=(0.003, 7.0), gains={"cam02": np.zeros((2, 6))})
    assert np.isnan(clock.sigma(["cam01"], np.zeros((6, 6)))).all()
    assert clock.sigma(["cam01", "cam02"], np.zeros((12, 12))).tolist() == [0.003, 7.0]
    assert clocks.Clock(0.1, given=(0.003, 7.0)).sigma().tolist() == [0.003, 7.0]


def test_the_table_has_the_interval_of_the_offset_and_that_of_the_lag_in_the_middle(tmp_path):
    """6 ppm over 30 s lead back to t0 with 0.18 ms more; -30 ppm are 0.9 ms there."""
    made = {"cam01": clocks.Clock(0.25, -30.0, "estimated", "cameras", 30.0, (0.0004, 6.0))}
    paths = tmp_path / "o.parquet", tmp_path / "g.parquet"
    clocks.write(*paths, "walk_1", made)
    table = clocks.tables.read(paths[0], "offsets")
    at_t0 = np.hypot(0.0004, 0.00018)
    assert table["sigma_s"][0] == pytest.approx(at_t0)
    assert [table[key][0] for key in ("low", "high")] == pytest.approx([0.25 - 1.96 * at_t0, 0.25 + 1.96 * at_t0])
    assert (table["late_s"][0], table["late_sigma_s"][0]) == pytest.approx((0.25 - 0.0009, 0.0004))
    assert table["late_low"][0] == pytest.approx(0.2491 - 1.96 * 0.0004)
    assert table["late_high"][0] == pytest.approx(0.2491 + 1.96 * 0.0004)
    assert (table["sigma_drift_ppm"][0], table["drift_ppm"][0]) == (6.0, -30.0)


def test_what_a_camera_does_to_time_and_drift_together_counts_in_the_offset():
    """A turn that makes the middle late by a and the drift larger by b makes t0 late by a - 30 b / 1e6."""
    gain = np.zeros((2, 6))
    gain[:, 0] = 0.01, 200.0
    clock = clocks.Clock(0.1, 0.0, middle_s=30.0, given=(0.0, 0.0), gains={"cam02": gain})
    joint = np.diag([0.5**2, 0, 0, 0, 0, 0])
    assert clock.sigma_offset(["cam02"], joint) == pytest.approx(0.5 * (0.01 - 0.006))
    assert np.isnan(clock.sigma_offset(["cam01"], joint))
    assert clocks.Clock(0.1, given=(0.003, np.nan)).sigma_offset() == 0.003


def test_a_clock_by_hand_is_doubted_by_time_and_not_by_pictures():
    assert clocks.doubtful_s(0.0001) == 0.002 and clocks.doubtful_s(0.004) == pytest.approx(0.012)
