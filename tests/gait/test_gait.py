"""The step: from a table of joints to the tables of gait."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from dior.body.names import COCO_17, MLKIT_33
from dior.gait import gait, tracks
from dior.reconstruct.triangulate import columns, write_skeleton
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.tables import tables
from dior.tables.gait_parameters import PARAMETERS

FPS, SECONDS, T0 = 30.0, 7.0, 1_700_000_000_000_000_000
SD_M = 0.004


@pytest.fixture(scope="module")
def walker():
    return Walker(Body(1.75), speed=1.1, half_length=20.0, start=2.0, until=SECONDS + 1)


def written(folder, points, names=MLKIT_33, covariance=None):
    """The tables that the step makes of joints (T, J, 3): parameters, events, steps; and its findings."""
    shape = points.shape[:2]
    stamps = T0 + np.rint(np.arange(shape[0]) / FPS * 1e9).astype(np.int64)
    known = np.isfinite(points).all(axis=-1)
    status = np.where(known, "ok", "too_few_views").astype(object)
    share = np.where(known, 0.1, np.nan)
    about = columns(names, stamps, points, status, np.full(shape, 3), np.zeros(shape), covariance, share)
    write_skeleton(folder / "skeleton.parquet", "S01", "walk_1", about)
    out, out_events, out_steps, findings = (folder / f"{name}.parquet" for name in ("out", "events", "steps", "found"))
    gait.run(
        sequence="walk_1", subject="S01", skeleton=folder / "skeleton.parquet", out=out, out_events=out_events,
        out_steps=out_steps, findings=findings,
    )  # fmt: skip
    made = [(out, "gait_parameters"), (out_events, "gait_events"), (out_steps, "gait_steps")]
    return *(tables.read(path, name) for path, name in made), tables.read_findings(findings)


def noisy(walker):
    points = walker.at(np.arange(0, SECONDS, 1 / FPS))[0]
    points = points + SD_M * np.random.default_rng(3).standard_normal(points.shape)
    return points, np.broadcast_to(SD_M**2 * np.eye(3), (*points.shape, 3)).copy()


def test_events_are_where_the_feet_touch_the_floor(tmp_path, walker):
    points, covariance = noisy(walker)
    _, events, _, found = written(tmp_path, points, covariance=covariance)
    true = walker.contacts
    assert not found and set(events["subject"]) == {"S01"} and set(events["sequence"]) == {"walk_1"}
    at, usable = (events["stamp_ns"] - T0) / 1e9, events["reason"] == ""
    np.testing.assert_allclose(at, events["time_s"], atol=1e-9)
    for event, strike in (("heel_strike", True), ("toe_off", False)):
        for side, foot in enumerate(("left", "right")):
            own = usable & (events["event"] == event) & (events["foot"] == foot)
            truth = true.seconds[(true.strike == strike) & (true.foot == side)]
            off = events["time_s"][own, None] - truth
            assert own.sum() >= 3 and np.abs(off).min(axis=1).max() < 0.03
    assert (np.diff(events["time_s"]) > 0).all() and (events["low_s"] < events["high_s"]).all()
    assert np.abs(events["instant"] / FPS - events["time_s"]).max() < 0.5 / FPS + 1e-6


def test_parameters_have_a_value_with_its_interval_or_a_reason(tmp_path, walker):
    points, covariance = noisy(walker)
    made, _, steps, _ = written(tmp_path, points, covariance=covariance)
    value, counted = np.isfinite(made["value"]), np.isin(made["parameter"], ("turns", "left_out"))
    assert set(made["parameter"]) == set(PARAMETERS)
    assert ((made["reason"] == "") == value).all() and (np.isfinite(made["sigma"]) == (value & ~counted)).all()
    assert set(made["parameter"][~value]) == {"belt_speed"} and set(made["reason"][~value]) == {"no_treadmill"}
    of = gait.read(tmp_path / "out.parquet")
    assert of["stride_speed", "both"]["value"] == pytest.approx(1.1, abs=0.02)
    assert of["turns", "both"]["value"] == 0
    own = (steps["parameter"] == "step_length") & (steps["foot"] == "left")
    assert of["step_length", "left"]["value"] == pytest.approx(steps["value"][own].mean())
    assert of["step_length", "left"]["n"] == own.sum()
    assert (steps["start_s"] < steps["end_s"]).all() and np.isfinite(steps["sigma"]).all()


def test_markers_without_errors_have_those_of_markers(tmp_path, walker):
    points = walker.at(np.arange(0, SECONDS, 1 / FPS))[0]
    _, events, _, _ = written(tmp_path, points)
    assert len(events["sigma_s"]) and np.isfinite(events["sigma_s"]).all()


@pytest.mark.parametrize(
    "what, said",
    [
        ("no feet", "the 3D has no pelvis, heels and toes"),
        ("nobody", "nobody's feet are known"),
        ("too short", "nobody takes a step in it"),
        ("stands", "nobody takes a step in it"),
        ("turns", "no step is left to measure"),
        ("no instants", "the 3D has no pelvis, heels and toes"),
    ],
)
def test_what_has_no_gait_is_a_note_and_tables_without_values(tmp_path, walker, what, said):
    points, names = walker.at(np.arange(0, SECONDS, 1 / FPS))[0], MLKIT_33
    if what == "no feet":
        points, names = points[:, : len(COCO_17)], COCO_17
    elif what == "nobody":
        points[:] = np.nan
    elif what == "stands":
        points[:] = points[29]
        points[:, :, 0] += 0.05 * np.sin(np.arange(len(points)) / 5)[:, None]
    elif what == "turns":
        yaw = 0.6 * np.arange(len(points)) / FPS
        turned = np.stack([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        points[..., :2] = np.einsum("ijt,tnj->tni", turned, points[..., :2])
    else:
        points = points[: 0 if what == "no instants" else 8]
    made, events, steps, found = written(tmp_path, points, names)
    assert not (events["reason"] == "").any() and not len(steps["value"])
    left = ~np.isin(made["parameter"], ("turns", "left_out"))
    assert not np.isfinite(made["value"][left]).any() and (made["reason"][left] != "").all()
    assert [one[:3] for one in found] == [("walk_1", "info", "no_gait")] and said in found[0][3]


def test_the_same_input_gives_the_same_bytes(tmp_path, walker):
    points, covariance = noisy(walker)
    first = {}
    for _ in range(2):
        written(tmp_path, points, covariance=covariance)
        made = {path.name: path.read_bytes() for path in sorted(tmp_path.glob("*.parquet"))}
        assert first in ({}, made)
        first = made


@pytest.mark.parametrize("count", [2, 3, 5, 40, 3000])
def test_curves_are_those_of_scipy(count):
    seconds = np.arange(count) / 128
    values = np.random.default_rng(count).standard_normal((count, 3)).cumsum(axis=0)
    times = np.append(np.random.default_rng(1).uniform(0, seconds[-1], 198), seconds[[0, -1]]).reshape(-1, 2)
    expected = CubicSpline(seconds, values, bc_type="natural")(times)
    np.testing.assert_allclose(tracks.curve(seconds, values)(times), expected, rtol=0, atol=1e-12)


def test_a_walks_gait_is_told_without_scipy(tmp_path, walker):
    points, covariance = noisy(walker)
    written(tmp_path, points, covariance=covariance)
    flags = ["--sequence", "walk_1", "--subject", "S01", "--skeleton", "skeleton.parquet", "--out", "again.parquet"]
    flags += ["--out-events", "e.parquet", "--out-steps", "s.parquet", "--findings", "f.parquet"]
    code = f"import sys; from dior.cli.main import main; main({['gait', *flags]}); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (tmp_path / "again.parquet").exists() and "scipy" not in done.stdout.split()
