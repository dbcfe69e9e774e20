"""ML Kit's lines: those that are decoded many at a time agree with those that are not."""

import json

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest.readers import mlkit
from tests.ingest import formats
from tests.ingest.formats import scene


def test_mlkit_lines_of_several_forms_agree_with_plain_json(tmp_path):
    """Lines that are stripped to their numbers, and those that cannot be, in one file of several blocks."""
    random, lines = np.random.default_rng(5), []
    for frame in range(200):
        landmarks = [
            {"type": i, "x": x, "y": y, "z": z, "inFrameLikelihood": s}
            for i, (x, y, z, s) in enumerate((random.uniform(-100, 1000, (33, 4)) * (1, 1, 1, 1e-3)).round(4).tolist())
        ]
        if frame % 7 == 1:
            landmarks = landmarks[::-1][:20]
        if frame % 7 == 2:
            landmarks = []
        if frame % 7 == 3:
            landmarks[5]["x"] = 1.25e2
            landmarks[6] = dict(reversed(landmarks[6].items()))
        text = json.dumps({"frame": frame, "stamp_ns": 1_708_000_000_000_000_001 + frame, "landmarks": landmarks})
        lines.append(text.replace("125.0", "1.25e2") if frame % 7 == 3 else text)
    path = tmp_path / "mixed.jsonl"
    for chosen in (lines, [one for one in lines if "1.25e2" not in one and one.count("type") in (0, 33)]):
        path.write_text("\n".join(chosen))
        people = mlkit.read(path)
        expected = np.full((len(chosen), 33, 3), np.nan)
        content = [json.loads(one) for one in chosen]
        for row, one in enumerate(content):
            for p in one["landmarks"]:
                expected[row, p["type"]] = p["x"], p["y"], p["inFrameLikelihood"]
        seen = np.isfinite(expected[..., 0]).any(axis=1)
        np.testing.assert_array_equal(people.uv, expected[seen][..., :2])
        np.testing.assert_array_equal(people.score, np.clip(np.nan_to_num(expected[seen][..., 2]), 0, 1))
        assert people.ran.tolist() == [one["frame"] for one in content]
        assert people.stamp_ns.tolist() == [one["stamp_ns"] for one in content]


def test_a_digit_within_a_key_is_no_number(tmp_path):
    """`"x1": 5` is another key: what is stripped to its numbers must not read 15."""
    whole = formats.mlkit(tmp_path, {f: people for f, people in scene(33).items() if f != 2}).read_text().splitlines()
    path = tmp_path / "digit.jsonl"
    path.write_text("\n".join([whole[0], whole[1].replace('"type": 4, "x"', '"type": 4, "x1"')]))
    people = mlkit.read(path)
    assert np.isnan(people.uv[1, 4]).all() and np.isfinite(people.uv[1, 5]).all()


@pytest.mark.parametrize("null", [False, True], ids=["many at a time", "one by one"])
def test_two_people_in_a_line_are_refused(tmp_path, null):
    path = formats.mlkit(tmp_path, scene(33))
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    lines[1]["landmarks"] += lines[1]["landmarks"][7:8]
    if null:
        lines[0]["landmarks"][0]["x"] = None
    path.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(DiorError, match=r"mlkit.jsonl: line 2 has the type 7 twice"):
        mlkit.read(path)
