import json

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest.readers import coco, yolo, yolo_json
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import HEIGHT, WIDTH, scene


def test_the_same_as_the_text_rows_of_the_same_result(tmp_path):
    found = scene(17)
    rows, as_json = yolo.read(formats.yolo(tmp_path, found)), yolo_json.read(formats.yolo_json(tmp_path, found))
    np.testing.assert_allclose(as_json.uv, rows.uv * (WIDTH, HEIGHT) - 0.5, atol=1e-5)


def test_other_classes_and_results_without_visibility(tmp_path):
    folder = formats.yolo_json(tmp_path, scene(17))
    content = json.loads((folder / "cam01_1.json").read_text())
    content[0]["class"] = 16
    del content[1]["keypoints"]["visible"]
    (folder / "cam01_1.json").write_text(json.dumps(content))
    people = yolo_json.read(folder)
    assert people.frame.tolist() == [0, 1, 2, 3] and people.person.tolist() == [0, 0, 0, 0]
    assert (people.score[1] == 1).all()


def test_pictures_with_nobody(tmp_path):
    found = {frame: [] for frame in range(3)} | {3: scene(17)[3]}
    for write in (formats.yolo_json, formats.yolo_json_list, formats.yolo_json_lines):
        path = write(tmp_path, found)
        assert recognise(path) == "yolo_json"
        people = yolo_json.read(path)
        assert people.ran.tolist() == [0, 1, 2, 3] and people.frame.tolist() == [3]


@pytest.mark.parametrize(
    "content, text",
    [
        ("[{}]", "holds one picture, and no list of them; name the folder"),
        ('[[{"class": 0, "keypoints": {"x": [1], "y": [1, 2]}}]]', "picture 0: the keypoints are no pairs"),
        ('[[{"class": 0, "keypoints": {"x": [1], "y": [1]}}]]', "picture 0: 1 keypoints of a person, not 17"),
        ('[[{"name": "person"}]]', "no class and keypoints as Ultralytics writes them"),
    ],
)
def test_broken_results(tmp_path, content, text):
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(DiorError, match=text):
        yolo_json.read(tmp_path / "a.json")


def test_results_of_a_validation_whose_pictures_have_numbers(tmp_path):
    path = formats.yolo_validated(tmp_path, scene(17))
    content = json.loads(path.read_text())
    named = coco.read(path)
    for one in content:
        one["image_id"] = int(one["image_id"].split(".")[1])
    path.write_text(json.dumps(content))
    numbered = coco.read(path)
    assert numbered.frame.tolist() == named.frame.tolist() == [0, 1, 1, 2, 3]
    np.testing.assert_array_equal(numbered.uv, named.uv)
