from dataclasses import asdict

import numpy as np

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
