"""MediaPipe: its own sample."""

import json
import shutil

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.ingest.readers import mediapipe
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import HEIGHT, WIDTH, scene
from tests.ingest.test_detections_formats import run

POINTS = [{"x": 0.5, "y": 0.01 * i, "z": 0.0} for i in range(33)]


def test_real_mediapipe_text(shared, tmp_path):
    path = shared / "detections" / "mediapipe_pose_landmarks.pbtxt"
    assert recognise(path) == "mediapipe"
    people = mediapipe.read(path)
    assert people.joints == MLKIT_33 and people.frame.tolist() == [0] and np.isfinite(people.uv).all()
    np.testing.assert_allclose(people.uv[0, [0, 32]], [[0.46507242, 0.41610304], [0.30121577, 0.94473803]])
    np.testing.assert_allclose(people.score[0, [0, 32]], [0.99998844, 0.97545445])
    table, _ = run(tmp_path, path)
    np.testing.assert_allclose(table["u"][0], 0.46507242 * WIDTH - 0.5, rtol=1e-6)
    np.testing.assert_allclose(table["v"][0], 0.41610304 * HEIGHT - 0.5, rtol=1e-6)
    (tmp_path / "folder").mkdir()
    for frame in (1, 3):
        shutil.copy(path, tmp_path / "folder" / f"cam01_{frame:04d}.pbtxt")
    assert mediapipe.read(tmp_path / "folder").frame.tolist() == [1, 3]


@pytest.mark.parametrize(
    "entry",
    [{"frame": 2, "landmarks": POINTS}, {"frame": 2, "landmarks": [POINTS]}, {"frame": 2, "poseLandmarks": POINTS}],
)
def test_landmarks_without_visibility_are_mediapipes_and_sure(tmp_path, entry):
    """ML Kit's have a number and a likelihood each."""
    path = tmp_path / "a.jsonl"
    for text in (json.dumps(entry), json.dumps([entry])):
        path.write_text(text)
        assert recognise(path) == "mediapipe"
        people = mediapipe.read(path)
        assert people.frame.tolist() == [2] and (people.score == 1).all()
    alone = tmp_path / "folder" / "7.json"
    alone.parent.mkdir()
    alone.write_text(json.dumps([POINTS]))
    assert recognise(alone.parent) == "mediapipe" and mediapipe.read(alone.parent).frame.tolist() == [7]


def test_nobody_in_the_first_picture(tmp_path):
    folder = formats.mediapipe_solutions(tmp_path, scene(33))
    (folder / "cam01_000000.json").write_text("null")
    assert recognise(folder) == "mediapipe"
    people = mediapipe.read(folder)
    assert people.frame.tolist() == [1, 2, 3] and people.ran.tolist() == [0, 1, 2, 3]
