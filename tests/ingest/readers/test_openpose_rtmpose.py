"""What Pose2Sim writes of RTMPose: 17, 26 and 133 keypoints, NaN for nobody."""

import json

import numpy as np
import pytest

from dior.body.names import COCO_17, HALPE_26, WHOLEBODY_133
from dior.errors import DiorError
from dior.ingest.readers import openpose
from tests.ingest import formats
from tests.ingest.formats import scene


@pytest.mark.parametrize("joints", [COCO_17, HALPE_26, WHOLEBODY_133])
def test_models_by_their_number_of_keypoints(tmp_path, joints):
    people = openpose.read(formats.pose2sim(tmp_path, scene(len(joints))))
    assert people.joints == joints and people.frame.tolist() == [0, 1, 1, 2, 3]


def test_somebody_of_nan_only_is_nobody_and_the_others_keep_their_places(tmp_path):
    found = scene(26)
    found[3] = [np.full((26, 3), np.nan), found[3][0]]
    found[4] = [np.full((26, 3), np.nan)]
    people = openpose.read(formats.pose2sim(tmp_path, found))
    assert people.frame.tolist() == [0, 1, 1, 2, 3] and people.person.tolist() == [0, 0, 1, 0, 1]
    assert people.ran.tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_array_equal(people.uv[-1], found[3][1][:, :2])


@pytest.mark.parametrize(
    "people", ["[NaN]", '{"a": NaN}', '[{"pose_keypoints_2d": [[NaN]]}]', "NaN", '[{"a": NaN}, 3]']
)
def test_nan_elsewhere_is_refused(tmp_path, people):
    (tmp_path / "1.json").write_text(f'{{"people": {people}}}')
    with pytest.raises(DiorError, match=r"1\.json.* as OpenPose writes them"):
        openpose.read(tmp_path)


def test_rtmlibs_134_keypoints_are_refused(tmp_path):
    """to_openpose of rtmlib makes 134 of 133: the neck comes between."""
    (tmp_path / "1.json").write_text(json.dumps({"people": [{"pose_keypoints_2d": [1.5] * 3 * 134}]}))
    with pytest.raises(DiorError, match=r"402 numbers per person, which is not 3 x 17 .*133 \(WHOLEBODY_133\)"):
        openpose.read(tmp_path)
