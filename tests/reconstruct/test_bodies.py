"""How tall the subjects are by their joints, and what that tells of who is the subject in another walk."""

import numpy as np
import pytest

from dior.body import plausible
from dior.body.names import MLKIT_33
from dior.body.people_followed import LONGER_SHARE, UNKNOWN, Size
from dior.reconstruct import bodies
from dior.tables import tables
from tests.reconstruct import test_triangulate as triangulated
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import ring

COUNT, ASIDE = 90, (0.0, 1.2, 0.0)


def grown(factor):
    """A walker who is that much larger."""
    return factor * walker(COUNT)


def told(folder, *people, seeds=()):
    """The row of `bodies` of a walk of several people, points (T, 33, 3) each."""
    folder.mkdir(exist_ok=True)
    cameras = ring(3)
    uv = [observed(cameras, one, 0.5, seed) for seed, one in enumerate(people)]
    triangulated.write_inputs(folder, cameras, uv[0])
    everybody = triangulated.write_people(folder, cameras, *enumerate(uv))
    for kind in ("detections", "people", "timeline"):
        (folder / f"{kind}.parquet").rename(folder / f"walk_0.{kind}.parquet")
    bodies.run(
        session="field", cameras=[folder / "cameras.parquet"], names=[one.name for one in cameras],
        subjects={"walk_0": "S01"},
        walks=bodies.Walks(
            [folder / "walk_0.detections.parquet"], [everybody.with_name("walk_0.people.parquet")],
            [folder / "walk_0.timeline.parquet"], list(seeds),
        ),
        min_score=0.3, out=folder / "bodies.parquet",
    )  # fmt: skip
    table = tables.read(folder / "bodies.parquet", "bodies")
    assert table["subject"].tolist() == ["S01"] and table["sequence"].tolist() == ["walk_0"]
    return {key: table[key][0] for key in ("stature_m", "sigma_m", "longer_m")}


def test_who_is_alone_has_a_stature(tmp_path):
    row = told(tmp_path, walker(COUNT))
    assert row["stature_m"] == pytest.approx(plausible.stature(walker(COUNT), MLKIT_33), abs=0.01)
    assert 0 < row["sigma_m"] < 0.01


def test_where_somebody_else_may_be_meant_there_is_none_but_by_a_seed(tmp_path):
    both = walker(COUNT), grown(1.05) + ASIDE
    assert all(np.isnan(value) for value in told(tmp_path, *both).values())
    middle = np.nanmean(observed(ring(3), both[0], 0.5, 0)[1, 20], axis=0)
    seeds = tmp_path / "walk_0.yaml"
    seeds.write_text(f"seeds: [{{camera: cam02, frame: 20, u: {middle[0]:.1f}, v: {middle[1]:.1f}}}]")
    wrong = tmp_path / "wrong/walk_0.yaml"
    wrong.parent.mkdir()
    wrong.write_text("seeds: [{camera: cam02, frame: 20, u: 1.0, v: 1.0}]")
    assert np.isnan(told(tmp_path / "missed", walker(COUNT), seeds=[wrong])["stature_m"])
    row = told(tmp_path / "seeded", *both, seeds=[seeds])
    assert row["stature_m"] == pytest.approx(plausible.stature(both[0], MLKIT_33), abs=0.01)


def test_a_walk_does_not_tell_of_itself_and_others_in_their_mean(tmp_path):
    names = {"walk_1": "S01", "walk_2": "S01", "walk_3": "S02", "walk_4": "S01"}
    path = tmp_path / "bodies.parquet"
    bodies.write(path, names, [Size(1.7, 0.003, 0.01), Size(1.72, 0.003, 0.03), Size(1.9, 0.003), UNKNOWN])
    only = bodies.of_other_walks(path, "S01", "walk_1")
    assert only.stature_m == pytest.approx(1.72) and only.longer_m == 0
    assert only.sigma_m == pytest.approx(np.sqrt(0.003**2 + bodies.ACROSS_M**2 + (LONGER_SHARE * 0.03) ** 2))
    assert bodies.of_other_walks(path, "S01", "walk_9").stature_m == pytest.approx(1.71)
    for where, whose, walk in ((path, "S02", "walk_3"), (None, "S01", "walk_1")):
        assert np.isinf(bodies.of_other_walks(where, whose, walk).sigma_m)


@pytest.mark.parametrize("factor", [1.04, 0.96])
def test_the_other_walk_tells_the_subject_without_a_height(tmp_path, factor):
    told(tmp_path / "alone", walker(COUNT))
    both = walker(COUNT), grown(factor) + ASIDE
    cameras = ring(3)
    for mine in (0, 1):
        folder = tmp_path / str(mine)
        folder.mkdir()
        uv = [observed(cameras, one, 0.5, seed) for seed, one in enumerate(both)]
        triangulated.write_inputs(folder, cameras, uv[mine])
        everybody = triangulated.write_people(folder, cameras, *enumerate(uv))
        told_by = tmp_path / "alone/bodies.parquet"
        table = triangulated.run(folder, [one.name for one in cameras], everybody_seen=everybody, bodies=told_by)
        points, _ = tables.grid(table, "x", "y", "z")
        assert np.nanmedian(np.linalg.norm(points - both[0], axis=-1)) < 0.02
