"""The step `people`: everybody labelled by the code that labels the subject."""

import numpy as np
import pytest

from benchmarks import everyone as benchmark
from dior.body.names import MLKIT_33
from dior.clocks import clock
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.label import people, reproject
from dior.reconstruct import refine
from dior.reconstruct.triangulate import Told
from dior.tables import tables
from tests.reconstruct import test_triangulate as triangulated
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import camera, ring

COUNT = 30
NAMES = ["cam01", "cam02", "cam03"]


@pytest.fixture(scope="module")
def together(tmp_path_factory):
    """What is made of two people who are well apart, and where."""
    folder = tmp_path_factory.mktemp("together")
    return folder, *made(folder)


def made(folder, metres=1.2, several=True):
    """The 3D of a walker, and of somebody `metres` to the left, of whom there is a seed that says they are another; the
    tables of the step, the points (2, T, 33, 3) m and the cameras, the last of which is far away."""
    close, far = ring(3), camera("cam04", (0.0, 60.0, 1.9), fx=760.0, role="long_range")
    points = np.stack([walker(COUNT), walker(COUNT) + (0.0, metres, 0.0)])
    uv = [observed(close, one, 0.5, seed) for seed, one in enumerate(points)]
    triangulated.write_inputs(folder, close, uv[0])
    everybody = triangulated.write_people(folder, close, *((i, one) for i, one in enumerate(uv) if several))
    u, v = np.nanmean(uv[0][1, 20], axis=0)
    seeds = folder / "seeds.yaml"
    seeds.write_text(f"seeds: [{{camera: cam02, frame: 20, u: {u:.1f}, v: {v:.1f}}}]")
    seeds = seeds if several else None
    triangulated.run(folder, NAMES, everybody_seen=everybody, seeds=seeds)
    refine.run(
        sequence="walk_1", subject="S01", skeleton=folder / "skeleton.parquet", max_gap_s=0.2,
        out=folder / "refined.parquet", findings=folder / "gaps.parquet",
    )  # fmt: skip
    cameras = [*close, far]
    names = [one.name for one in cameras]
    camera_tables.write_cameras(folder / "cameras.parquet", cameras)
    camera_tables.write_camera_covariance(folder / "covariance.parquet", names, 1e-8 * np.eye(24))
    known = {name: clock.Clock(0.0, given=(0.0, 0.0)) for name in names}
    clock.write(folder / "clocks.parquet", folder / "gains.parquet", "walk_1", known)
    stamps = tables.read(folder / "timeline.parquet", "timeline")["stamp_ns"][::3]
    frames = {"frame": np.arange(COUNT), "stamp_ns": stamps, "height": [720] * COUNT, "width": [1280] * COUNT}
    frames = {key: np.tile(values, 4) for key, values in frames.items()}
    tables.write(folder / "frames.parquet", "frames", frames | {"camera": np.repeat(np.array(names, object), COUNT)})
    people.run(
        sequence="walk_1", subject="S01", rig=people.SequenceCameras(names, NAMES, **files(folder)),
        recorded=people.Recorded(
            folder / "detections.parquet", folder / "timeline.parquet", folder / "frames.parquet"
        ),
        told=Told(everybody, seeds=seeds),
        skeleton=folder / "refined.parquet", method="robust",
        limits=people.Limits(0.3, 45.0, 12.0, 8.0, 0.4), smoothing="smooth", max_gap_s=0.2,
        out=folder / "people_3d.parquet", out_labels=folder / "people_2d.parquet", findings=folder / "found.parquet",
    )  # fmt: skip
    body, labels = (tables.read(folder / f"{name}.parquet", name) for name in ("people_3d", "people_2d"))
    found = tables.read(folder / "found.parquet", "findings")
    return body, labels, dict(zip(found["code"], found["text"], strict=True)), points, cameras


def files(folder):
    """Where the cameras and clocks are."""
    names = {"cameras": "cameras", "covariance": "covariance", "clocks": "clocks", "clock_gains": "gains"}
    return {key: [folder / f"{name}.parquet"] for key, name in names.items()}


def test_the_subjects_rows_are_those_of_the_subjects_own_tables(together):
    tmp_path, body, labels, *_ = together
    own = tables.read(tmp_path / "refined.parquet", "skeletons_3d")
    mine = people.of_person(body, 0)
    assert set(mine["is_subject"]) == {"yes"} and set(mine["sequence"]) == {"walk_1"}
    for key in people.BODY:
        np.testing.assert_array_equal(mine[key], own[key])
    for name in (*NAMES, "cam04"):
        reproject.run(
            sequence="walk_1", subject="S01", labelled=[name], makers=NAMES, **files(tmp_path),
            skeleton=tmp_path / "refined.parquet", frames=tmp_path / "frames.parquet", source="triangulated",
            out=[tmp_path / "labels.parquet"],
        )  # fmt: skip
        table = tables.read(tmp_path / "labels.parquet", "labels_2d")
        same = tables.of_camera(people.of_person(labels, 0), name)
        for key in set(table) - {"subject"}:
            np.testing.assert_array_equal(same[key], table[key])


def test_the_other_is_labelled_as_well_as_the_subject(together):
    _, body, labels, said, points, cameras = together
    other = people.of_person(body, 1)
    xyz, joints = tables.grid(other, "x", "y", "z")
    assert tuple(joints) == MLKIT_33 and set(other["is_subject"]) == {"no"}
    assert (other["status"] == "ok").mean() > 0.98
    errors = [
        np.linalg.norm(tables.grid(people.of_person(body, i), "x", "y", "z")[0] - points[i], axis=-1) for i in (0, 1)
    ]
    assert np.nanmean(errors[1]) == pytest.approx(np.nanmean(errors[0]), rel=0.3) and np.nanmax(errors[1]) < 0.05
    for one in cameras:
        mine = tables.of_camera(people.of_person(labels, 1), one.name)
        uv, _ = tables.grid(mine, "u", "v")
        off = np.linalg.norm(uv - cam.project(one, points[1])[0], axis=-1)
        assert np.nanmean(off) < (0.1 if one.role == "long_range" else 0.6)
        assert np.isfinite(mine["sigma_u"][np.isfinite(mine["u"])]).all()
    assert "person_2 (not the subject) at 30 of 30 instants" in said["people_labelled"]
    assert "people_too_near" not in said


@pytest.mark.slow
def test_where_two_are_too_near_the_other_is_suspect_and_null(tmp_path):
    body, labels, said, *_ = made(tmp_path, 0.12)
    assert "nobody_else" in said or "people_too_near" in said
    others = tables.rows(body, body["is_subject"] != "yes")
    assert np.isnan(others["x"][others["status"] == "suspect"]).all()
    if len(others["x"]):
        assert (others["status"] == "suspect").any()
        assert (tables.rows(labels, labels["is_subject"] != "yes")["status"] == "suspect").any()


@pytest.mark.slow
def test_where_there_is_nobody_else_the_subject_alone_is_there_and_that_is_said(tmp_path):
    body, labels, said, *_ = made(tmp_path, several=False)
    assert set(body["person"]) == set(labels["person"]) == {"person_1"} and set(body["is_subject"]) == {"yes"}
    assert "one body in each picture" in said["nobody_else"]


@pytest.mark.slow
@pytest.mark.parametrize(("level", "seed"), [("ideal", 0), ("real", 1)])
@pytest.mark.parametrize("kind", ["together", "crossing"])
def test_each_of_two_is_labelled_as_well_as_alone(kind, level, seed):
    """`python -m benchmarks.everyone` has more kinds and seeds."""
    both, single, (mixed, numbers, not_the_subject) = benchmark.one(kind, level, seed)
    px, px_alone = (each[:, 1:3, 0] / each[:, 1:3, 1] for each in (both, single))
    labelled, labelled_alone = (each[:, 3, 0] / each[:, 3, 1] for each in (both, single))
    assert (px < 1.1 * px_alone + 0.02).all() and (labelled > labelled_alone - 0.02).all()
    assert (mixed, numbers, bool(not_the_subject)) == (0, 2, False)
