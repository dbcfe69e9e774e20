"""The clock of the long-range camera in one sequence, with its pose known."""

import numpy as np
import pytest

from dior.calibrate import follow
from dior.clocks import clock as clocks
from dior.geometry import camera_tables, covariance
from dior.tables import tables
from tests.calibrate.test_align import prepared

LATE_S = 0.25


def run_in(folder, true, files, offsets=None, boxes=True):
    camera_tables.write_cameras(folder / "cam04.parquet", [true], "field")
    camera_tables.write_camera_covariance(folder / "cam04.covariance.parquet", ["cam04"], 1e-8 * np.eye(6), "field")
    paths = [folder / f"out/{kind}.parquet" for kind in ("offsets", "gains", "costs", "findings")]
    follow.run(
        sequence="walk", camera="cam04", camera_file=folder / "cam04.yaml",
        placed=follow.Placed([folder / "cam04.parquet"], [], [folder / "cam04.covariance.parquet"]),
        skeleton=files["skeletons"][0], frames=files["frames"][0],
        given=follow.ByHand(offsets, files["boxes"][0] if boxes else None), data_root=folder,
        written=clocks.ClockFiles(*paths),
    )  # fmt: skip
    return clocks.read(paths[:1], paths[1:2])["cam04"], tables.read(paths[0], "offsets"), paths


def middle(clock):
    return clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s


def test_the_clock_is_found_with_what_it_owes_to_the_pose(tmp_path):
    true, files, _, _ = prepared(tmp_path, "boxes")
    clock, table, paths = run_in(tmp_path, true, files)
    assert (clock.source, clock.method) == ("estimated", "boxes")
    assert middle(clock) == pytest.approx(LATE_S, abs=0.01)
    assert 0 < clock.given[0] < 0.05 and table["sigma_s"][0] > clock.given[0]
    costs = tables.read(paths[2], "clock_costs")
    assert costs["lag_s"][np.nanargmin(costs["cost_px"])] == pytest.approx(LATE_S, abs=0.03)
    assert list(tables.read(paths[3], "findings")["code"]) == ["clock_followed"]


@pytest.mark.slow
def test_gains_say_where_the_clock_goes_with_another_pose(tmp_path):
    true, files, _, uv = prepared(tmp_path, "boxes")
    # to and fro, a camera that is turned seems late as often as early
    one_way = [f for f in range(0, len(uv), 3) if np.cos(0.8 * f / 30) > 0.3]
    edges = np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1)
    edges += 3 * np.array([-1, -1, 1, 1]) + np.random.default_rng(1).standard_normal(edges.shape)
    lines = [f"{f},{','.join(f'{x:.2f}' for x in edges[f])}" for f in one_way]
    files["boxes"][0].write_text("\n".join(["frame,u_min,v_min,u_max,v_max", *lines]) + "\n")
    clock, _, _ = run_in(tmp_path, true, files)
    step = np.array([0.0, 5e-4, 0.0, 0.0, 0.0, 0.0])
    moved, _, _ = run_in(tmp_path, covariance.moved(true, step), files)
    assert abs(clock.gains["cam04"][0, 1]) > 10
    assert middle(moved) - middle(clock) == pytest.approx(clock.gains["cam04"][0] @ step, rel=0.35)


def test_what_a_person_gave_is_taken(tmp_path):
    true, files, _, _ = prepared(tmp_path, "boxes")
    path = tmp_path / "walk.yaml"
    path.write_text("cam04: {offset_s: 0.3, drift_ppm: 2}\n")
    clock, table, paths = run_in(tmp_path, true, files, path)
    assert (clock.offset_s, clock.drift_ppm, clock.source) == (0.3, 2.0, "manual")
    assert clock.given == (0.0, 0.0) and table["sigma_s"][0] == 0
    assert len(tables.read(paths[2], "clock_costs")["lag_s"]) == 0


def test_the_error_that_a_person_gave_is_taken(tmp_path):
    true, files, _, _ = prepared(tmp_path, "boxes")
    path = tmp_path / "walk.yaml"
    path.write_text("cam04: {offset_s: 0.3, sigma_s: 0.004}\n")
    clock, table, _ = run_in(tmp_path, true, files, path)
    assert clock.given == (0.004, 0.0) and table["sigma_s"][0] == pytest.approx(0.004)


def test_without_3d_the_clock_is_not_known(tmp_path):
    true, files, _, _ = prepared(tmp_path, "boxes")
    table = tables.read(files["skeletons"][0], "skeletons_3d")
    for axis in "xyz":
        table[axis][:] = np.nan
    tables.write(files["skeletons"][0], "skeletons_3d", table)
    clock, _, paths = run_in(tmp_path, true, files)
    assert (clock.source, clock.offset_s) == ("assumed_zero", 0.0) and np.isnan(clock.given).all()
    assert list(tables.read(paths[3], "findings")["code"]) == ["clock_unknown"]


def test_somebody_who_stands_tells_no_time(tmp_path):
    true, files, _, _ = prepared(tmp_path, "boxes")
    table = tables.read(files["skeletons"][0], "skeletons_3d")
    for axis in "xyz":
        grid = table[axis].reshape(-1, 4)
        grid[:] = grid[:1]
    tables.write(files["skeletons"][0], "skeletons_3d", table)
    lines = files["boxes"][0].read_text().splitlines()
    same = [lines[0]] + [",".join([line.split(",")[0], *lines[1].split(",")[1:]]) for line in lines[1:]]
    files["boxes"][0].write_text("\n".join(same) + "\n")
    clock, table, paths = run_in(tmp_path, true, files)
    assert (clock.source, clock.offset_s) == ("assumed_zero", 0.0) and np.isnan(clock.given).all()
    said = tables.read(paths[3], "findings")
    assert list(said["severity"]) == ["warning"] and "not known" in said["text"][0]
