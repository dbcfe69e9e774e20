"""A real Plug-in-Gait walk (../shared/data/mocap) as the motion of a simulated indoor capture."""

import pytest

from dior.simulate import config as simulated
from dior.simulate import settings
from tests.end_to_end.results import figure, metrics
from tests.end_to_end.workflow import snakemake


@pytest.mark.slow
def test_labels_of_a_real_walk(shared, tmp_path):
    simulated.write(
        settings.from_dict(
            {
                "subjects": 1,
                "sequences": 1,
                "environments": ["indoor"],
                "duration_s": 2.5,
                "motion": str(shared / "mocap/walk_100hz.c3d"),
            }
        ),
        tmp_path / "config",
    )
    snakemake(tmp_path)
    rows = metrics(tmp_path)
    assert figure(rows, "error_to_truth_2d", role="close") <= 1.0
    assert figure(rows, "coverage", role="close") > 0.97
