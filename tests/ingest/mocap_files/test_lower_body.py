"""Markers of the lower body alone: the legs are labelled, nothing is made up, and the 3D is taken for a person's."""

import numpy as np

from dior.body import coco17, joint_centres
from dior.body.names import COCO_17, MLKIT_33
from dior.reconstruct import world
from dior.release import head_model
from dior.tables import tables
from tests.ingest.test_mocap import run

LEGS = {f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle", "heel", "foot_index")}


def test_a_real_walk_of_the_lower_body(shared, tmp_path):
    table = run(tmp_path, shared / "mocap" / "overground_events_100hz.c3d", subject="walker01")
    xyz, names = tables.grid(table, "x", "y", "z")
    assert len(names) == 16
    points, _, _ = coco17.coco17(xyz, names)
    known = dict(zip(COCO_17, np.isfinite(points[..., 0]).mean(axis=0), strict=True))
    assert {name for name, share in known.items() if share} == LEGS & set(COCO_17)
    joints, _ = joint_centres.joints(xyz, names, MLKIT_33)
    known = dict(zip(MLKIT_33, np.isfinite(joints[..., 0]).mean(axis=0), strict=True))
    assert {name for name, share in known.items() if share} == LEGS and min(known[name] for name in LEGS) > 0.9
    # nobody knows where the head is, so that no picture is released as covered
    middle, _ = head_model.centres(xyz, names)
    assert np.isnan(middle).all()
    (tmp_path / "subjects.tsv").write_text(
        "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\tconsent_pictures\nA\twalker01\t\t\tyes\tyes\n"
    )
    world.run(
        sequence="walk", subject="walker01", skeleton=tmp_path / "mocap.parquet", people=tmp_path / "subjects.tsv",
        physics={}, source="mocap", findings=tmp_path / "w.parquet",
    )  # fmt: skip
    assert not len(tables.read(tmp_path / "w.parquet", "findings")["text"])
