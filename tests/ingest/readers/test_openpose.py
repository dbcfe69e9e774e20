"""OpenPose's files, compact ones and others, and Pose2Sim's of RTMPose: 17, 26 and 133 keypoints, NaN for nobody."""

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


def test_the_keys_of_openpose_of_2017(tmp_path):
    folder = formats.pose2sim(tmp_path, scene(len(COCO_17)))
    new = openpose.read(folder)
    for path in folder.glob("*.json"):
        path.write_text(path.read_text().replace('"pose_keypoints_2d"', '"pose_keypoints"'))
    old = openpose.read(folder)
    assert len(old.frame) == len(new.frame) > 0
    np.testing.assert_array_equal(old.uv, new.uv)


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


def write_compactly(folder, found):
    """As OpenPose itself writes: no blanks, more keys after the pose."""
    folder.mkdir()
    for frame, people in found.items():
        content = {
            "version": 1.3,
            "people": [
                {"person_id": [-1], "pose_keypoints_2d": one, "face_keypoints_2d": [], "pose_keypoints_3d": []}
                for one in people
            ],
        }
        (folder / f"{frame}.json").write_text(json.dumps(content, separators=(",", ":")))


def test_openpose_files_of_several_forms_agree_with_plain_json(tmp_path):
    """Files that are cut at what they share, and those that cannot be, in several blocks."""
    random, found = np.random.default_rng(6), {}
    for frame in range(300):
        count = 0 if frame % 9 == 4 else 1 + frame % 3
        found[frame] = (random.uniform(1, 1000, (count, 54)) * 10.0 ** random.integers(-6, 1, (count, 1))).tolist()
    found[150][0] = []
    write_compactly(tmp_path / "cam01", found)
    (tmp_path / "cam01/160.json").write_text(json.dumps({"people": [{"pose_keypoints_2d": found[160][0]}]}))
    found[160] = found[160][:1]
    people = openpose.read(tmp_path / "cam01")
    rows = [(frame, i, one) for frame, all_of in found.items() for i, one in enumerate(all_of) if one]
    assert people.frame.tolist() == [frame for frame, _, _ in rows]
    assert people.person.tolist() == [i for _, i, _ in rows]
    points = np.array([one for _, _, one in rows]).reshape(-1, 18, 3)
    np.testing.assert_array_equal(people.uv, points[..., :2])
    np.testing.assert_array_equal(people.score, np.clip(points[..., 2], 0, 1))


@pytest.mark.parametrize("old, new", [("1.5,", "1.5,1.5,"), ("1.5,", "1.5],[1.5,"), ("1.5", "1.5x"), ("}]}", "}]")])
def test_openpose_damage_between_good_files_is_found(tmp_path, old, new):
    write_compactly(tmp_path / "cam01", {frame: [[1.5] * 54] for frame in range(300)})
    file = tmp_path / "cam01/200.json"
    text = file.read_text()
    place = len(text) // 2
    damaged = text[:place] + text[place:].replace(old, new, 1)
    assert damaged != text
    file.write_text(damaged)
    with pytest.raises(DiorError, match=r"cam01/200\.json: "):
        openpose.read(tmp_path / "cam01")
