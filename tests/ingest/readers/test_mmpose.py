import json

import numpy as np
import pytest

from dior.body.names import COCO_17, WHOLEBODY_133
from dior.errors import DiorError
from dior.ingest.readers import mmpose
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import scene
from tests.ingest.test_detections_formats import run

# as MMPose calls them, configs/_base_/datasets/coco_wholebody.py
FACE_AND_HANDS = (
    [f"face-{i}" for i in range(68)] + [f"left_hand_{i}" for i in range(21)] + [f"thumb{i}" for i in range(21)]
)


def test_whole_body_with_names(tmp_path):
    names = [*WHOLEBODY_133[:23], *FACE_AND_HANDS]
    people = mmpose.read(formats.mmpose_demo(tmp_path, scene(133), names))
    assert people.joints == WHOLEBODY_133


def test_seventeen_keypoints_of_something_else_are_refused(tmp_path):
    """AP-10K's animals and Human3.6M have 17 as well."""
    h36m = (
        "root right_hip right_knee right_foot left_hip left_knee left_foot spine thorax neck_base head "
        "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist"
    ).split()
    path = formats.mmpose_demo(tmp_path, scene(17), h36m)
    with pytest.raises(DiorError, match=r"demo.json: keypoint 0 is 'root', and of 17 keypoints it should be nose"):
        mmpose.read(path)
    with pytest.raises(DiorError, match=r"a model of 21 keypoints, which is none of 17, 18"):
        mmpose.read(formats.mmpose_demo(tmp_path, scene(21), [f"thumb{i}" for i in range(21)]))


def test_pictures_with_nobody_and_files_of_one_picture(tmp_path):
    found = scene(17)
    found[0] = []
    folder = formats.mmpose(tmp_path, found)
    assert recognise(folder) == "mmpose"
    people = mmpose.read(folder)
    assert people.ran.tolist() == [0, 1, 2, 3] and people.frame.tolist() == [1, 1, 2, 3]
    # the demo's file of a picture
    instances = json.loads((folder / "cam01_000001.json").read_text())
    (folder / "cam01_000001.json").write_text(json.dumps({"meta_info": {}, "instance_info": instances}))
    np.testing.assert_array_equal(mmpose.read(folder).uv, people.uv)
    with pytest.raises(DiorError, match="entry 0 has no frame_id and instances; of single pictures name the folder"):
        mmpose.read(folder / "cam01_000001.json")
    with pytest.raises(DiorError, match=r"walk, cam01: no person found in any of 4 frames"):
        run(tmp_path, formats.mmpose_video(tmp_path, {frame: [] for frame in range(4)}))


def test_the_demo_counts_from_one(tmp_path):
    path = formats.mmpose_demo(tmp_path, scene(26, (1, 2, 3, 4)))
    with pytest.raises(
        DiorError, match="are they counted from 1. Then `detector.first_frame` in config.yaml should be 1"
    ):
        run(tmp_path, path)
    table, findings = run(tmp_path, path, first_frame=1)
    assert np.isfinite(table["u"].reshape(4, 26)[3]).all() and set(findings) == {"several_people"}


@pytest.mark.parametrize(
    "instance, text",
    [
        ({"keypoints": [[1.0, 2.0]] * 17}, r"entry 0: no instances with keypoints and keypoint_scores \(KeyError"),
        ({"keypoints": [[1.0, 2.0, 3.0]] * 17, "keypoint_scores": [1.0] * 17}, "no pairs of numbers"),
        ({"keypoints": [[1.0, 2.0]] * 17, "keypoint_scores": [1.0] * 16}, "no pairs of numbers with a score each"),
        ({"keypoints": [[1.0, 2.0]] * 16, "keypoint_scores": [1.0] * 16}, "16 keypoints per person, which is none of"),
    ],
)
def test_broken_instances(tmp_path, instance, text):
    path = tmp_path / "a.json"
    path.write_text(json.dumps([{"frame_id": 0, "instances": [instance]}]))
    with pytest.raises(DiorError, match=text):
        mmpose.read(path)


def test_scores_above_one_count_as_one(tmp_path):
    found = scene(17)
    found[0][0][2, 2] = 1.07
    assert mmpose.read(formats.mmpose(tmp_path, found)).score[0, 2] == 1.0
    assert mmpose.read(tmp_path / "mmpose").joints == COCO_17
