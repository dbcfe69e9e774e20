"""COCO's results: whose scores they are."""

import json

import numpy as np
import pytest

from dior.body.names import COCO_17
from dior.ingest.readers import coco
from tests.ingest import formats
from tests.ingest.formats import scene


@pytest.mark.parametrize("third", [0, 1, 2])
def test_coco_scores_of_one_throughout_give_way_to_the_persons(tmp_path, third):
    found = scene(17)
    for people in found.values():
        for one in people:
            one[:, 2] = third
    content = [one | {"score": 0.7} for one in formats.results(found, int)]
    path = tmp_path / "results.json"
    path.write_text(json.dumps(content))
    people = coco.read(path)
    assert people.joints == COCO_17
    assert set(people.score[np.isfinite(people.uv[..., 0])].tolist()) == {0.7}
