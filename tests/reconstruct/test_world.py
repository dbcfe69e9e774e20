"""The step on tables: a right world says nothing, a wrong one is red with its cause and where to mend it."""

import numpy as np
import pytest

from benchmarks import wrong_worlds as benchmark
from dior.reconstruct import world
from dior.reconstruct.triangulate import columns, write_skeleton
from dior.tables import tables
from tests.body.test_wrong_world import HEIGHT, person
from tests.ingest.c3d_files import PLACES


def said(tmp_path, points, names, source="triangulated", height=HEIGHT, physics=None):
    count = len(points)
    status = np.where(np.isfinite(points[..., 0]), "ok", "too_few_views")
    none = np.zeros(status.shape, int)
    stamps = 10**18 + np.arange(count) * 33_333_333
    known = columns(names, stamps, points, status, none, none.astype(float))
    write_skeleton(tmp_path / "3d.parquet", "walker01", "walk_1", known)
    (tmp_path / "subjects.tsv").write_text(
        "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\tconsent_pictures\n"
        f"S01\twalker01\t{height}\t\tyes\tyes\n"
    )
    world.run(
        sequence="walk_1", subject="walker01", skeleton=tmp_path / "3d.parquet", people=tmp_path / "subjects.tsv",
        physics=physics or {}, source=source, findings=tmp_path / "findings.parquet",
    )  # fmt: skip
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert set(found["scope"]) <= {"walk_1"} and set(found["severity"]) <= {"error"}
    return dict(zip(found["code"], found["text"], strict=True))


def test_a_right_world_says_nothing(tmp_path):
    assert said(tmp_path, *person()) == {}
    assert said(tmp_path, *person(), height="") == {}


def test_a_wrong_size_says_how_much_and_where_to_mend_it(tmp_path):
    points, names = person()
    text = said(tmp_path, 1.42 * points, names)["world_scale"]
    assert "too large by 1.42" in text and "square_m" in text and "walker01" in text
    assert said(tmp_path, 1.1 * points, names) == {}
    assert "world_scale" in said(tmp_path, 1.1 * points, names, physics={"stature_share": 0.05})


def markers(mirrored=False):
    """A person of 1.7 m who glides along x with Plug-in-Gait markers."""
    still = np.array(list(PLACES.values())) * (1, -1 if mirrored else 1, 1)
    return still[None] + np.arange(60)[:, None, None] * (0.03, 0, 0), list(PLACES)


def test_a_c3d_is_judged_by_its_markers(tmp_path):
    points, names = markers()
    assert said(tmp_path, points, names, "mocap", 1.7) == {}
    text = said(tmp_path, *markers(mirrored=True), "mocap", 1.7)["world_left_handed"]
    assert "left-handed" in text and "C3D" in text
    assert "too large by 1.4" in said(tmp_path, 1.42 * points, names, "mocap", 1.7)["world_scale"]
    assert "C3D" in said(tmp_path, points - (0, 0, 0.6), names, "mocap", 1.7)["world_floor"]


def test_half_a_body_of_markers_has_no_height(tmp_path):
    points, names = markers()
    assert "world_scale" in said(tmp_path, 1.18 * points, names, "mocap", 1.7)
    legs = [i for i, name in enumerate(names) if name not in ("LSHO", "RSHO", "C7", "CLAV", "T10", "STRN")]
    assert said(tmp_path, 1.18 * points[:, legs], [names[i] for i in legs], "mocap", 1.7) == {}


def test_a_sequence_without_3d_says_nothing(tmp_path):
    assert said(tmp_path, np.full((1, 2, 3), np.nan), ["nose", "left_hip"]) == {}


@pytest.mark.slow
@pytest.mark.parametrize("kind", benchmark.C3D)
def test_what_is_wrong_with_a_c3d_is_named(kind):
    """Two seeds of each kind; `python -m benchmarks.wrong_worlds 20 c3d` has 20."""
    for seed in (1, 2):
        found, words = benchmark.found_in_c3d(kind, seed), benchmark.C3D[kind][2]
        assert benchmark.count(found, words, {}) == 1, [fault.text for fault in found]
